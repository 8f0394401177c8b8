//! A ray's way from partition to partition, as far as they are in memory.

use equilux_common::bundle::Stage;
use equilux_common::ids::PartitionId;
use equilux_common::ray::{NO_PRIMITIVE, Ray};

use crate::geometry::{Slot, Stack};
use crate::renderer::Renderer;

/// A ray can only go on where this partition is, and is to do this there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Elsewhere {
    pub(crate) partition: PartitionId,
    pub(crate) stage: Stage,
}

impl Renderer {
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
