//! What is asked of a partition, for the instruction set that answers it.

use equilux_common::ray::Ray;

use super::{Partition, Slot};
use crate::geometry::company::Traversal;
use crate::geometry::hierarchy::{SHARED_RAYS_MAX, Stack};
use crate::geometry::lanes::{Lanes, Task};
use crate::geometry::thick_ray::ThickRay;
use crate::geometry::tree::World;
use crate::geometry::triangle::Probe;

/// Improves a ray's closest hit.
pub(super) struct Closest<'a> {
    pub(super) partition: &'a Partition,
    pub(super) probe: &'a Probe,
    pub(super) ray: &'a mut Ray,
    pub(super) stack: &'a mut Stack,
}

/// Asks whether anything hides a light.
pub(super) struct Occluded<'a> {
    pub(super) partition: &'a Partition,
    pub(super) probe: &'a Probe,
    pub(super) ray: &'a Ray,
    pub(super) stack: &'a mut Stack,
}

/// [`Closest`] for each ray of a bundle.
pub(super) struct ClosestOfAll<'a> {
    pub(super) partition: &'a Partition,
    pub(super) rays: &'a mut [Ray],
    pub(super) slots: &'a mut [Option<Slot>],
    pub(super) traversal: Traversal,
    pub(super) stack: &'a mut Stack,
}

/// [`Occluded`] for each ray of a bundle.
pub(super) struct AllOccluded<'a> {
    pub(super) partition: &'a Partition,
    pub(super) rays: &'a [Ray],
    pub(super) are_occluded: &'a mut [bool],
    pub(super) traversal: Traversal,
    pub(super) stack: &'a mut Stack,
}

impl Partition {
    /// Improves a ray's closest hit by what is at several places.
    #[inline(always)]
    fn closest_placed<L: Lanes>(
        &self,
        lanes: L,
        probe: &Probe,
        ray: &mut Ray,
        stack: &mut Stack,
    ) -> Option<Slot> {
        match &self.placed {
            Some(placed) => placed.closest(lanes, (probe, &self.model_bounds), ray, stack),
            None => None,
        }
    }

    #[inline(always)]
    fn is_occluded_by_placed<L: Lanes>(
        &self,
        lanes: L,
        probe: &Probe,
        ray: &Ray,
        stack: &mut Stack,
    ) -> bool {
        match &self.placed {
            Some(placed) => placed.is_occluded(lanes, (probe, &self.model_bounds), ray, stack),
            None => false,
        }
    }
}

impl Task for Closest<'_> {
    type Output = Option<Slot>;

    #[inline(always)]
    fn run(self, lanes: impl Lanes) -> Option<Slot> {
        let Self { partition, probe, ray, stack } = self;
        let thick = ThickRay::new(lanes, &probe.slab);
        let loose = partition.tree.closest(lanes, (&World(probe), &thick), ray, stack.only());
        let placed = partition.closest_placed(lanes, probe, ray, stack);
        placed.or(loose.map(Slot::loose))
    }
}

impl Task for Occluded<'_> {
    type Output = bool;

    #[inline(always)]
    fn run(self, lanes: impl Lanes) -> bool {
        let Self { partition, probe, ray, stack } = self;
        let thick = ThickRay::new(lanes, &probe.slab);
        partition.tree.is_occluded(lanes, (&World(probe), &thick), ray, stack.only())
            || partition.is_occluded_by_placed(lanes, probe, ray, stack)
    }
}

impl Task for ClosestOfAll<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self, lanes: impl Lanes) {
        let Self { partition, rays, slots, traversal, stack } = self;
        let groups = rays.chunks_mut(SHARED_RAYS_MAX).zip(slots.chunks_mut(SHARED_RAYS_MAX));
        for (rays, slots) in groups {
            let mut hits = [None; SHARED_RAYS_MAX];
            let (tree, bounds) = (&partition.tree, &partition.model_bounds);
            let places = stack.together();
            match traversal {
                Traversal::Single => tree.closest_of_each(lanes, rays, &mut hits, bounds, places),
                Traversal::Shared => tree.closest_together(lanes, rays, &mut hits, bounds, places),
            }
            for ((ray, slot), hit) in rays.iter_mut().zip(slots).zip(hits) {
                *slot = hit.map(Slot::loose);
                if partition.placed.is_some() {
                    let probe = partition.probe(ray);
                    *slot = partition.closest_placed(lanes, &probe, ray, stack).or(*slot);
                }
            }
        }
    }
}

impl Task for AllOccluded<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self, lanes: impl Lanes) {
        let Self { partition, rays, are_occluded, traversal, stack } = self;
        let groups = rays.chunks(SHARED_RAYS_MAX).zip(are_occluded.chunks_mut(SHARED_RAYS_MAX));
        for (rays, are_occluded) in groups {
            let (tree, bounds) = (&partition.tree, &partition.model_bounds);
            let places = stack.together();
            let occluded = match traversal {
                Traversal::Single => tree.each_occluded(lanes, rays, bounds, places),
                Traversal::Shared => tree.occluded_together(lanes, rays, bounds, places),
            };
            for (number, (ray, is_occluded)) in rays.iter().zip(are_occluded).enumerate() {
                *is_occluded = occluded >> number & 1 == 1;
                if !*is_occluded && partition.placed.is_some() {
                    let probe = partition.probe(ray);
                    *is_occluded = partition.is_occluded_by_placed(lanes, &probe, ray, stack);
                }
            }
        }
    }
}
