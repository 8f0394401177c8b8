//! Regions: what belongs to each worker, how much it is, and which regions touch.

use std::num::NonZeroU64;

use crate::clusters::{Clusters, Homes, number};
use crate::host::limit;

/// Clusters in regions.
pub(crate) struct Regions<'a> {
    /// What is mapped.
    pub(crate) clusters: &'a Clusters,
    /// Where it is.
    pub(crate) homes: Homes,
    /// The clusters of each region, ascending.
    pub(crate) members: Vec<Vec<u32>>,
    /// Bytes of each region.
    pub(crate) loads: Vec<u64>,
    /// What each region should have, in bytes.
    pub(crate) shares: &'a [u64],
    /// What each region may have.
    pub(crate) limits: Vec<u64>,
}

impl<'a> Regions<'a> {
    /// In which each may have its share and the tolerance, or a part of its share beyond it if that
    /// is more.
    pub(crate) fn new(
        clusters: &'a Clusters,
        homes: Homes,
        shares: &'a [u64],
        slack: Option<NonZeroU64>,
    ) -> Self {
        let mut members = vec![Vec::new(); shares.len()];
        let mut loads = vec![0; shares.len()];
        for cluster in 0..clusters.count() {
            let home = homes.of(cluster) as usize;
            members[home].push(number(cluster));
            loads[home] += clusters.bytes(cluster);
        }
        let slack = |share: u64| slack.map_or(0, |part| share / part);
        let limits = shares.iter().map(|&share| limit(share).max(share + slack(share)));
        Self { clusters, homes, members, loads, shares, limits: limits.collect() }
    }

    /// Bytes beyond the limit.
    pub(crate) fn excess(&self, region: usize) -> u64 {
        self.loads[region].saturating_sub(self.limits[region])
    }

    /// Bytes beyond the limits, of all regions.
    pub(crate) fn total_excess(&self) -> u64 {
        (0..self.loads.len()).map(|region| self.excess(region)).sum()
    }

    /// Compares how full two regions are for their shares: whether the first is fuller. One without
    /// a share is fuller than any other.
    pub(crate) fn is_fuller(&self, a: usize, b: usize) -> bool {
        let product = |load: usize, share: usize| {
            u128::from(self.loads[load]) * u128::from(self.shares[share])
        };
        product(a, b) > product(b, a)
    }

    /// Moves a cluster to another region; `members` is the caller's to bring up to date.
    pub(crate) fn rehome(&mut self, cluster: u32, to: usize) {
        let bytes = self.clusters.bytes(cluster as usize);
        let from = self.homes.of(cluster as usize) as usize;
        self.loads[from] -= bytes;
        self.loads[to] += bytes;
        self.homes.set(cluster as usize, number(to));
    }

    /// Pairs of regions that are neighbors, the smaller number first, ascending.
    pub(crate) fn pairs(&self) -> Vec<[usize; 2]> {
        let upward = |region: usize| {
            let neighbors = self.neighbors(region).into_iter();
            neighbors.filter(move |&other| other > region).map(move |other| [region, other])
        };
        (0..self.loads.len()).flat_map(upward).collect()
    }

    /// Regions that are neighbors of this one, ascending: those with a tie to it, and the next by
    /// number either way, so that all are connected. A region without share has neighbors only as
    /// long as it has anything.
    pub(crate) fn neighbors(&self, region: usize) -> Vec<usize> {
        if !self.takes_part(region) {
            return Vec::new();
        }
        let ties = self.members[region].iter();
        let ties = ties.flat_map(|&member| self.clusters.ties(member as usize));
        let tied = ties.map(|tie| self.homes.of(tie.0 as usize) as usize);
        let before = (0..region).rev().find(|&other| self.takes_part(other));
        let after = (region + 1..self.loads.len()).find(|&other| self.takes_part(other));
        let mut neighbors: Vec<_> = tied.chain(before).chain(after).collect();
        neighbors.sort_unstable();
        neighbors.dedup();
        neighbors.retain(|&other| other != region && self.takes_part(other));
        neighbors
    }

    fn takes_part(&self, region: usize) -> bool {
        self.shares[region] > 0 || self.loads[region] > 0
    }
}
