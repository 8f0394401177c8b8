//! Rays that wait, in a pile for each partition that they wait for.

use std::collections::BTreeMap;

use equilux_common::bundle::{Bundle, Share, Stage};
use equilux_common::ids::PartitionId;

/// All piles; none is empty.
#[derive(Debug, Default)]
pub(super) struct Piles {
    piles: BTreeMap<PartitionId, Pile>,
    ray_count: u64,
}

/// The rays that wait for one partition.
#[derive(Debug, Default)]
struct Pile {
    /// By depth and stage: those closest to their end last.
    bundles: BTreeMap<(u16, Stage), Vec<Bundle>>,
    ray_count: u64,
}

impl Piles {
    /// Rays that wait.
    pub(super) const fn ray_count(&self) -> u64 {
        self.ray_count
    }

    /// Rays that wait for a partition.
    pub(super) fn rays_at(&self, partition: PartitionId) -> u64 {
        self.piles.get(&partition).map_or(0, |pile| pile.ray_count)
    }

    /// The partition that most rays wait for, among some.
    pub(super) fn fullest(&self, is_among: impl Fn(PartitionId) -> bool) -> Option<PartitionId> {
        let piles = self.piles.iter().filter(|&(&partition, _)| is_among(partition));
        // Of equally full ones, the first.
        let fullest = piles.rev().max_by_key(|(_, pile)| pile.ray_count);
        fullest.map(|(&partition, _)| partition)
    }

    /// The bundle that is next in a pile.
    pub(super) fn next(&self, partition: PartitionId) -> Option<&Bundle> {
        self.piles.get(&partition)?.bundles.last_key_value()?.1.last()
    }

    /// Rays came in.
    pub(super) fn push(&mut self, bundle: Bundle) {
        let rays = bundle.rays.len() as u64;
        let pile = self.piles.entry(bundle.partition).or_default();
        pile.ray_count += rays;
        self.ray_count += rays;
        pile.bundles.entry((bundle.depth(), bundle.stage)).or_default().push(bundle);
    }

    /// Takes out the bundle that is next in a pile.
    pub(super) fn pop(&mut self, partition: PartitionId) -> Option<Bundle> {
        let pile = self.piles.get_mut(&partition)?;
        let mut last = pile.bundles.last_entry()?;
        let bundle = last.get_mut().pop()?;
        if last.get().is_empty() {
            last.remove();
        }
        let rays = bundle.rays.len() as u64;
        pile.ray_count -= rays;
        self.ray_count -= rays;
        if pile.ray_count == 0 {
            self.piles.remove(&partition);
        }
        Some(bundle)
    }

    /// Drops what `keep` refuses; says how many rays went.
    pub(super) fn retain(&mut self, keep: impl Fn(&Share) -> bool) -> u64 {
        let before = self.ray_count;
        let mut left = Vec::new();
        for mut bundle in self.take_all() {
            bundle.retain_shares(&keep);
            left.push(bundle);
        }
        left.into_iter().filter(|bundle| !bundle.shares.is_empty()).for_each(|b| self.push(b));
        before - self.ray_count
    }

    /// All bundles.
    pub(super) fn iter(&self) -> impl Iterator<Item = &Bundle> {
        self.piles.values().flat_map(|pile| pile.bundles.values().flatten())
    }

    /// Takes out all bundles.
    pub(super) fn take_all(&mut self) -> impl Iterator<Item = Bundle> + use<> {
        self.ray_count = 0;
        let piles = std::mem::take(&mut self.piles).into_values();
        piles.flat_map(|pile| pile.bundles.into_values().flatten())
    }
}
