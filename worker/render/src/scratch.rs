//! What a thread keeps between pieces of work, so that tracing does not allocate.

use std::collections::BTreeMap;

use equilux_common::bundle::{BUNDLE_RAYS_MAX, Bundle, Stage};
use equilux_common::ids::PartitionId;
use equilux_common::ray::Ray;

use crate::geometry::{Slot, Stack};
use crate::stage::Shaded;

/// Most empty lists that are kept: more than are in use at a time, and few against the lists of
/// rays that come in, each of which is left over.
const SPARE_LISTS_MAX: usize = 64;

/// Rays that await a stage.
#[derive(Debug)]
pub(crate) struct Pending {
    pub(crate) stage: Stage,
    /// Where the rays are in their order of visits; none if they have not set out yet.
    pub(crate) partition: Option<PartitionId>,
    pub(crate) rays: Vec<Ray>,
}

/// A thread's working memory. One per thread; reuse it.
#[derive(Debug)]
pub struct Scratch {
    /// Most rays of a bundle.
    pub(crate) bundle_rays: usize,
    pub(crate) stack: Stack,
    pub(crate) shaded: Shaded,
    /// Where the hits are of the rays that are about to be shaded.
    pub(crate) slots: Vec<Option<Slot>>,
    /// Which of the shadow rays that are looked at reach no light.
    pub(crate) are_occluded: Vec<bool>,
    /// What is to be done, the latest last.
    pub(crate) pending: Vec<Pending>,
    /// Rays that await a stage at a partition that is not in memory.
    pub(crate) parked: BTreeMap<(PartitionId, Stage), Vec<Ray>>,
    /// Empty lists, each with room for a bundle.
    spare: Vec<Vec<Ray>>,
}

impl Default for Scratch {
    fn default() -> Self {
        Self {
            bundle_rays: BUNDLE_RAYS_MAX,
            stack: Stack::default(),
            shaded: Shaded::default(),
            slots: Vec::new(),
            are_occluded: Vec::new(),
            pending: Vec::new(),
            parked: BTreeMap::new(),
            spare: Vec::new(),
        }
    }
}

impl Scratch {
    /// An empty list of rays.
    pub(crate) fn open(&mut self) -> Vec<Ray> {
        self.spare.pop().unwrap_or_else(|| Vec::with_capacity(self.bundle_rays))
    }

    /// Takes a list back.
    pub(crate) fn reclaim(&mut self, mut rays: Vec<Ray>) {
        let is_fit = (self.bundle_rays..=2 * self.bundle_rays).contains(&rays.capacity());
        if is_fit && self.spare.len() < SPARE_LISTS_MAX {
            rays.clear();
            self.spare.push(rays);
        }
    }

    /// Adds a ray to those that will await `stage`; a full list is put on the stack.
    pub(crate) fn add(&mut self, stage: Stage, open: &mut Vec<Ray>, ray: Ray) {
        open.push(ray);
        if open.len() == self.bundle_rays {
            let full = std::mem::take(open);
            self.pending.push(Pending { stage, partition: None, rays: full });
            *open = self.open();
        }
    }

    /// Puts a list on the stack unless it is empty.
    pub(crate) fn seal(&mut self, stage: Stage, rays: Vec<Ray>) {
        if rays.is_empty() {
            self.reclaim(rays);
        } else {
            self.pending.push(Pending { stage, partition: None, rays });
        }
    }

    /// What was laid aside, as bundles that lack their shares.
    pub(crate) fn take_bundles(&mut self) -> Vec<Bundle> {
        let mut bundles = Vec::new();
        for ((partition, stage), rays) in std::mem::take(&mut self.parked) {
            // Copied, for they may wait for long and must not take more room than they need.
            for rays in rays.chunks(self.bundle_rays) {
                let (shares, rays) = (Vec::new(), rays.to_vec());
                bundles.push(Bundle { stage, partition, shares, rays });
            }
        }
        bundles
    }

    /// Lays a ray aside until its partition is in memory.
    pub(crate) fn park(&mut self, partition: PartitionId, stage: Stage, ray: Ray) {
        self.parked.entry((partition, stage)).or_default().push(ray);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_that_keep_coming_in_do_not_pile_up() {
        let mut scratch = Scratch::default();
        for capacity in 1..100 * BUNDLE_RAYS_MAX {
            scratch.reclaim(Vec::with_capacity(capacity));
            scratch.reclaim(Vec::with_capacity(BUNDLE_RAYS_MAX));
        }
        let rooms = scratch.spare.iter().map(Vec::capacity);
        assert!(rooms.sum::<usize>() <= 2 * SPARE_LISTS_MAX * BUNDLE_RAYS_MAX);
        let list = scratch.open();
        assert!(list.is_empty() && list.capacity() >= BUNDLE_RAYS_MAX);
    }
}
