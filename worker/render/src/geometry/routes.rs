//! Which partitions a ray visits, and in what order.
//!
//! A partition is bounded by a few tight boxes; a ray enters it where it enters the first of them.
//! Rays visit partitions in the order of (entry distance, partition id), which is a function of the
//! ray and the boxes alone: no list travels with a ray, and whoever has it finds out where it goes
//! next from where it is. It is over when no partition that it has not visited can be nearer than
//! its closest hit.
//!
//! The entry is found by the same monotone operations as all intervals ([`super::slab`]), so no
//! partition with a hit that counts is ever passed by; and by the same on all machines, so those
//! who hand a ray to one another agree about what it has visited.

use equilux_common::ids::PartitionId;

use super::Bounds;
use super::hierarchy::{Hierarchy, Stack, Visits};
use super::lanes::{Lanes, Task};
use super::slab::Slab;
use super::thick_ray::ThickRay;
use super::tree::CAREFUL;
use super::triangle::Probe;

/// Most boxes that bound one partition.
pub const PARTITION_BOXES_MAX: usize = 64;

/// A place in the order in which a ray visits partitions.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
struct Entry {
    distance: f32,
    partition: u32,
}

/// The boxes of all partitions.
#[derive(Debug)]
pub struct Routes {
    partition_count: usize,
    /// Over the partitions that are not empty.
    hierarchy: Hierarchy,
    /// In the order of its leaves.
    partitions: Vec<u32>,
    /// By partition.
    bounded: Vec<Boxes>,
}

/// The boxes of one partition.
#[derive(Debug)]
struct Boxes {
    hierarchy: Hierarchy,
    /// In the order of its leaves.
    boxes: Vec<Bounds>,
}

/// Looks for the partition that a ray visits next.
struct Search<'a> {
    routes: &'a Routes,
    slab: &'a Slab,
    /// The partition that the ray has visited last.
    current: Option<u32>,
    farthest: f32,
    outer: &'a mut Visits,
    inner: &'a mut Visits,
}

impl Routes {
    /// The routes through partitions that are bounded by these boxes; one without boxes is empty.
    pub(crate) fn new(boxes: Vec<Vec<Bounds>>) -> Self {
        let partition_count = boxes.len();
        let bounded: Vec<Boxes> = boxes.iter().map(|boxes| Boxes::new(boxes)).collect();
        let there: Vec<u32> =
            (0u32..).zip(&boxes).filter(|(_, it)| !it.is_empty()).map(|(it, _)| it).collect();
        let around = |&partition: &u32| bounded[partition as usize].hierarchy.bounds();
        let (hierarchy, order) = Hierarchy::build(there.iter().map(around), CAREFUL);
        let partitions = order.iter().map(|&index| there[index as usize]).collect();
        Self { partition_count, hierarchy, partitions, bounded }
    }

    /// How many partitions there are.
    #[must_use]
    pub const fn partition_count(&self) -> usize {
        self.partition_count
    }

    /// The partition that a ray visits first, unless it hits something at `farthest` before.
    pub(crate) fn first(
        &self,
        probe: &Probe,
        farthest: f32,
        stack: &mut Stack,
    ) -> Option<PartitionId> {
        if self.partition_count == 1 {
            return Some(PartitionId(0));
        }
        self.search(None, probe, farthest, stack)
    }

    /// The partition that a ray visits after `current`, unless it hits something at `farthest`
    /// before.
    pub(crate) fn next(
        &self,
        current: PartitionId,
        probe: &Probe,
        farthest: f32,
        stack: &mut Stack,
    ) -> Option<PartitionId> {
        if self.partition_count == 1 {
            return None;
        }
        self.search(Some(current.0), probe, farthest, stack)
    }

    /// Where the ray enters a partition, if that is at `farthest` or nearer.
    #[inline(always)]
    fn entry<L: Lanes>(
        &self,
        lanes: L,
        partition: u32,
        ray: (&Slab, &ThickRay),
        farthest: f32,
        visits: &mut Visits,
    ) -> Option<Entry> {
        let boxes = self.bounded.get(partition as usize)?;
        let distance = boxes.entry(lanes, ray, farthest, visits)?;
        Some(Entry { distance, partition })
    }

    fn search(
        &self,
        current: Option<u32>,
        probe: &Probe,
        farthest: f32,
        stack: &mut Stack,
    ) -> Option<PartitionId> {
        let instructions = stack.instructions;
        let (outer, inner) = stack.split();
        let (routes, slab) = (self, &probe.slab);
        let search = Search { routes, slab, current, farthest, outer, inner };
        instructions.run(search).map(PartitionId)
    }
}

impl Boxes {
    fn new(boxes: &[Bounds]) -> Self {
        let (hierarchy, order) = Hierarchy::build(boxes.iter().copied(), CAREFUL);
        let boxes = order.iter().map(|&index| boxes[index as usize]).collect();
        Self { hierarchy, boxes }
    }

    /// Where the ray enters the first of the boxes, if that is at `farthest` or nearer.
    #[inline(always)]
    fn entry<L: Lanes>(
        &self,
        lanes: L,
        (slab, ray): (&Slab, &ThickRay),
        farthest: f32,
        visits: &mut Visits,
    ) -> Option<f32> {
        let mut nearest = None;
        let mut walk = self.hierarchy.walk(lanes, ray, visits);
        while let Some(leaf) = walk.next_leaf(nearest.unwrap_or(farthest)) {
            for bounds in &self.boxes[leaf] {
                let Some(distance) = distance_to(bounds, slab) else { continue };
                if distance <= farthest && nearest.is_none_or(|nearest| distance < nearest) {
                    nearest = Some(distance);
                }
            }
        }
        nearest
    }
}

impl Task for Search<'_> {
    type Output = Option<u32>;

    #[inline(always)]
    fn run(self, lanes: impl Lanes) -> Option<u32> {
        let Self { routes, slab, current, farthest, outer, inner } = self;
        let ray = ThickRay::new(lanes, slab);
        let last = match current {
            // A ray that does not meet the partition that it is in has been misled by its sender.
            Some(partition) => {
                Some(routes.entry(lanes, partition, (slab, &ray), f32::INFINITY, inner)?)
            }
            None => None,
        };
        let mut next: Option<Entry> = None;
        let mut nearest = farthest;
        let mut walk = routes.hierarchy.walk(lanes, &ray, outer);
        while let Some(leaf) = walk.next_leaf(nearest) {
            for &partition in &routes.partitions[leaf] {
                let Some(entry) = routes.entry(lanes, partition, (slab, &ray), nearest, inner)
                else {
                    continue;
                };
                let is_visited = last.is_some_and(|last| entry <= last);
                if !is_visited && next.is_none_or(|next| entry < next) {
                    nearest = entry.distance;
                    next = Some(entry);
                }
            }
        }
        next.map(|next| next.partition)
    }
}

/// Where the ray enters a box, if it does.
fn distance_to(bounds: &Bounds, slab: &Slab) -> Option<f32> {
    let (near, far) = slab.interval(bounds);
    (near <= far).then_some(near)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::tests::ray;
    use equilux_common::ray::Ray;
    use glam::Vec3;
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = Vec3> {
        prop::array::uniform3(prop_oneof![(-3i8..=3).prop_map(f32::from), -3f32..3.0])
            .prop_map(Vec3::from)
    }

    fn partitions() -> impl Strategy<Value = Vec<Vec<Bounds>>> {
        let bounds = prop::array::uniform2(point()).prop_map(Bounds::around);
        prop::collection::vec(prop::collection::vec(bounds, 0..4), 2..12)
    }

    /// All visits in their order, by sorting.
    fn sorted(boxes: &[Vec<Bounds>], slab: &Slab, farthest: f32) -> Vec<u32> {
        let nearest = |boxes: &Vec<Bounds>| {
            boxes.iter().filter_map(|bounds| distance_to(bounds, slab)).min_by(f32::total_cmp)
        };
        let mut visits: Vec<(f32, u32)> = (0u32..)
            .zip(boxes)
            .filter_map(|(partition, boxes)| Some((nearest(boxes)?, partition)))
            .filter(|&(distance, _)| distance <= farthest)
            .collect();
        visits.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        visits.into_iter().map(|(_, partition)| partition).collect()
    }

    proptest! {
        #[test]
        fn every_partition_that_is_met_is_visited_once_and_in_order(
            boxes in partitions(), origin in point(), target in point(),
            farthest in prop_oneof![Just(f32::INFINITY), 0f32..6.0],
        ) {
            prop_assume!(origin != target);
            let ray: Ray = ray(origin, (target - origin).normalize());
            let model = boxes.iter().flatten().fold(Bounds::EMPTY, |all, one| all.joined(one));
            let probe = Probe::new(&ray, &model.or_origin());
            let routes = Routes::new(boxes.clone());
            let mut stack = Stack::default();
            let mut visited = Vec::new();
            let mut next = routes.first(&probe, farthest, &mut stack);
            while let Some(current) = next {
                visited.push(current.0);
                prop_assert!(visited.len() <= boxes.len(), "{visited:?}");
                next = routes.next(current, &probe, farthest, &mut stack);
            }
            prop_assert_eq!(visited, sorted(&boxes, &probe.slab, farthest));
        }
    }
}
