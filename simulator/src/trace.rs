//! A piece of work being traced: which rays ended, which were given up, and whose credit is whose.
//!
//! What the tracers of the simulator have in common. Where rays of a share ended, the share's
//! credit is split between what retired and the bundles of what was given up; where none did, all
//! of it goes on in the bundles.

use std::collections::BTreeMap;
use std::time::Duration;

use equilux_common::bundle::{BUNDLE_RAYS_MAX, Bundle, Share, Stage};
use equilux_common::film::TileSums;
use equilux_common::ids::PartitionId;
use equilux_common::ray::Ray;
use equilux_common::unit::Rect;
use equilux_common::work::{Outcome, RayCounts};

use crate::tracer::Traced;

/// The partition that a replicated model is.
pub(crate) const WHOLE_MODEL: PartitionId = PartitionId(0);

/// One piece being traced.
pub(crate) struct Trace {
    shares: Vec<Share>,
    /// What each share's rays added, if any ended.
    sums: Vec<Option<TileSums>>,
    /// By the partition that the rays need, and what for.
    given_up: BTreeMap<(PartitionId, Stage), Vec<Ray>>,
    pub(crate) counts: RayCounts,
    pub(crate) nanos: u64,
}

impl Trace {
    /// Nothing of these shares has been traced yet.
    pub(crate) fn new(shares: &[Share]) -> Self {
        let sums = vec![None; shares.len()];
        let (given_up, counts) = (BTreeMap::new(), RayCounts::default());
        Self { shares: shares.to_vec(), sums, given_up, counts, nanos: 0 }
    }

    /// A share of the piece.
    pub(crate) fn share(&self, ray: &Ray) -> &Share {
        &self.shares[usize::from(ray.share)]
    }

    /// What the rays of a share added: pixels of `tile`, if nothing has been added yet.
    pub(crate) fn sums(&mut self, share: usize, tile: Rect) -> &mut TileSums {
        self.sums[share].get_or_insert_with(|| TileSums::new(tile))
    }

    /// A ray goes on elsewhere, where this partition is, with this stage.
    pub(crate) fn give_up(&mut self, partition: PartitionId, stage: Stage, ray: Ray) {
        self.given_up.entry((partition, stage)).or_default().push(ray);
    }

    /// What it came to.
    pub(crate) fn finish(mut self) -> Traced {
        let given_up = std::mem::take(&mut self.given_up);
        let bundles: Vec<((PartitionId, Stage), &[Ray])> = given_up
            .iter()
            .flat_map(|(&place, rays)| rays.chunks(BUNDLE_RAYS_MAX).map(move |rays| (place, rays)))
            .collect();
        let mut left: Vec<usize> = (0..self.shares.len())
            .map(|index| bundles.iter().filter(|(_, rays)| holds(rays, index)).count())
            .collect();
        let seal = |(place, rays): (_, &[Ray])| self.seal(place, rays.to_vec(), &mut left);
        let successors = bundles.into_iter().map(seal).collect();
        let retired = self.shares.into_iter().zip(self.sums);
        let retired = retired.filter_map(|(share, sums)| Some((share, sums?))).collect();
        let outcome = Outcome { retired, successors, counts: self.counts };
        Traced { outcome, elapsed: Duration::from_nanos(self.nanos) }
    }

    /// Makes a bundle of rays, with its part of the credit of each share. `left` counts the bundles
    /// to come per share; where no ray has ended, the last of them takes all that is left.
    fn seal(
        &mut self,
        (partition, stage): (PartitionId, Stage),
        mut rays: Vec<Ray>,
        left: &mut [usize],
    ) -> Bundle {
        let mut shares = Vec::new();
        for (index, share) in
            self.shares.iter_mut().enumerate().filter(|(index, _)| holds(&rays, *index))
        {
            let takers = left[index] + usize::from(self.sums[index].is_some());
            let credit = if takers == 1 {
                std::mem::take(&mut share.credit)
            } else {
                share.credit.split(takers)
            };
            left[index] -= 1;
            shares.push((index, Share { credit, ..share.clone() }));
        }
        for ray in &mut rays {
            let place = shares.iter().position(|(index, _)| *index == usize::from(ray.share));
            ray.share = u8::try_from(place.expect("its share was put in")).expect("few shares");
        }
        let shares = shares.into_iter().map(|(_, share)| share).collect();
        Bundle { stage, partition, shares, rays }
    }
}

fn holds(rays: &[Ray], share: usize) -> bool {
    rays.iter().any(|ray| usize::from(ray.share) == share)
}

/// An interrupt's time in nanoseconds; never, if there is none.
pub(crate) fn limit_nanos(limit: Option<Duration>) -> u64 {
    limit.map_or(u64::MAX, |limit| u64::try_from(limit.as_nanos()).unwrap_or(u64::MAX))
}
