//! A ray's way from partition to partition, as far as they are in memory.

use equilux_common::bundle::Stage;
use equilux_common::ids::PartitionId;
use equilux_common::ray::{NO_PRIMITIVE, Ray};

use crate::geometry::{Partition, Slot, Stack, Traversal};
use crate::renderer::Renderer;

/// A ray can only go on where this partition is, and is to do this there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Elsewhere {
    pub(crate) partition: PartitionId,
    pub(crate) stage: Stage,
}

/// Depth of the last rays that go much the same way as those beside them: those from what cameras
/// see.
const LAST_SHARED_DEPTH: u32 = 1;

impl Renderer {
    /// Whether the model is one partition, which is in memory.
    pub(crate) fn is_whole(&self) -> bool {
        self.whole().is_some()
    }

    fn whole(&self) -> Option<&Partition> {
        let is_one = self.model.routes.partition_count() == 1;
        self.partitions.get(PartitionId(0)).filter(|_| is_one)
    }

    /// [`Self::find_hit`] for each ray of a bundle, in a whole model.
    pub(crate) fn find_all_hits(
        &self,
        rays: &mut [Ray],
        slots: &mut Vec<Option<Slot>>,
        stack: &mut Stack,
    ) {
        slots.resize(rays.len(), None);
        let Some(whole) = self.whole() else { return };
        let is_shared = rays.first().is_some_and(|ray| u32::from(ray.depth) <= LAST_SHARED_DEPTH);
        let traversal = if is_shared { Traversal::Shared } else { Traversal::Single };
        whole.intersect_all(rays, slots, traversal, stack);
        for (ray, slot) in rays.iter_mut().zip(slots) {
            match slot {
                Some(_) => ray.hit_partition = 0,
                // A hit from before is here, too: all of the model is.
                None => *slot = self.place_of_hit(ray, stack).ok().flatten(),
            }
        }
    }

    /// Which shadow rays of a bundle reach no light, in a whole model.
    pub(crate) fn find_occluded(
        &self,
        rays: &[Ray],
        are_occluded: &mut Vec<bool>,
        stack: &mut Stack,
    ) {
        are_occluded.clear();
        are_occluded.resize(rays.len(), false);
        if let Some(whole) = self.whole() {
            whole.are_occluded(rays, are_occluded, Traversal::Shared, stack);
        }
    }

    /// The partition that a ray visits first, if it meets any.
    pub(crate) fn first_partition(&self, ray: &Ray, stack: &mut Stack) -> Option<PartitionId> {
        self.model.routes.first(&self.model.probe(ray), ray.distance, stack)
    }

    /// Finds the ray's closest hit, from the partition it is in or, if it has not set out yet, from
    /// the first one on; gives the place of what it hits, if it hits anything.
    pub(crate) fn find_hit(
        &self,
        ray: &mut Ray,
        current: Option<PartitionId>,
        stack: &mut Stack,
    ) -> Result<Option<Slot>, Elsewhere> {
        let probe = self.model.probe(ray);
        let routes = &self.model.routes;
        let mut next = current.or_else(|| routes.first(&probe, ray.distance, stack));
        let mut slot = None;
        while let Some(partition) = next {
            let Some(resident) = self.partitions.get(partition) else {
                return Err(Elsewhere { partition, stage: Stage::Intersect });
            };
            if let Some(found) = resident.intersect_probed(&probe, ray, stack) {
                ray.hit_partition = partition.0;
                slot = Some(found);
            }
            next = routes.next(partition, &probe, ray.distance, stack);
        }
        if slot.is_some() { Ok(slot) } else { self.place_of_hit(ray, stack) }
    }

    /// The place of what the ray hit in a partition that it has left, if it hit anything.
    pub(crate) fn place_of_hit(
        &self,
        ray: &Ray,
        stack: &mut Stack,
    ) -> Result<Option<Slot>, Elsewhere> {
        if ray.hit_primitive == NO_PRIMITIVE {
            return Ok(None);
        }
        let partition = PartitionId(ray.hit_partition);
        match self.partitions.get(partition) {
            Some(resident) => Ok(resident.locate(ray, stack)),
            None => Err(Elsewhere { partition, stage: Stage::Shade }),
        }
    }

    /// Whether nothing hides the light from a shadow ray, as far as that can be told here.
    pub(crate) fn is_lit(
        &self,
        ray: &Ray,
        current: Option<PartitionId>,
        stack: &mut Stack,
    ) -> Result<bool, Elsewhere> {
        let probe = self.model.probe(ray);
        let routes = &self.model.routes;
        let mut next = current.or_else(|| routes.first(&probe, ray.distance, stack));
        while let Some(partition) = next {
            let Some(resident) = self.partitions.get(partition) else {
                return Err(Elsewhere { partition, stage: Stage::Shadow });
            };
            if resident.is_occluded_probed(&probe, ray, stack) {
                return Ok(false);
            }
            next = routes.next(partition, &probe, ray.distance, stack);
        }
        Ok(true)
    }
}
