//! Which partitions a ray visits, and in what order.
//!
//! A partition is bounded by a few tight boxes; a ray enters it where it enters the first of them.
//! Rays visit partitions in the order of (entry distance, partition id), which is a function of the
//! ray and the boxes alone: no list travels with a ray, and whoever has it finds out where it goes
//! next from where it is. It is over when no partition that it has not visited can be nearer than
//! its closest hit.
//!
//! The entry is found by the same monotone operations as all intervals ([`super::slab`]), so no
//! partition with a hit that counts is ever passed by.

use equilux_common::ids::PartitionId;
use obvhs::BvhBuildParams;

use super::Bounds;
use super::hierarchy::{Hierarchy, Stack};
use super::slab::{Slab, pack};
use super::triangle::Probe;

/// Most boxes that bound one partition.
pub const PARTITION_BOXES_MAX: usize = 8;

/// A box and whose it is.
#[derive(Clone, Copy, Debug)]
struct OwnedBox {
    bounds: Bounds,
    partition: u32,
}

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
    hierarchy: Hierarchy,
    /// In the order of the hierarchy's leaves.
    leaves: Vec<OwnedBox>,
    /// By partition.
    boxes: Vec<Vec<Bounds>>,
}

impl Routes {
    /// The routes through partitions that are bounded by these boxes; one without boxes is empty.
    pub(crate) fn new(boxes: Vec<Vec<Bounds>>) -> Self {
        let owned: Vec<OwnedBox> = (0u32..)
            .zip(&boxes)
            .flat_map(|(partition, boxes)| {
                boxes.iter().map(move |&bounds| OwnedBox { bounds, partition })
            })
            .collect();
        let quality = BvhBuildParams { max_prims_per_leaf: 2, ..BvhBuildParams::medium_build() };
        let (hierarchy, order) = Hierarchy::build(owned.iter().map(|owned| owned.bounds), quality);
        let leaves = order.iter().map(|&index| owned[index as usize]).collect();
        Self { partition_count: boxes.len(), hierarchy, leaves, boxes }
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
        self.next_after(None, &probe.slab, farthest, stack)
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
        // A ray that does not meet the partition that it is in has been misled by its sender.
        let entry = self.entry(current.0, &probe.slab)?;
        self.next_after(Some(entry), &probe.slab, farthest, stack)
    }

    /// The least entry after `last`, at `farthest` or nearer.
    fn next_after(
        &self,
        last: Option<Entry>,
        slab: &Slab,
        farthest: f32,
        stack: &mut Stack,
    ) -> Option<PartitionId> {
        let mut next: Option<Entry> = None;
        let mut walk = self.hierarchy.walk(slab, stack.only());
        while let Some(leaf) = walk.next_leaf(next.map_or(farthest, |next| next.distance)) {
            for owned in &self.leaves[leaf] {
                let Some(distance) = distance_to(&owned.bounds, slab) else { continue };
                let entry = Entry { distance, partition: owned.partition };
                let is_later = distance > farthest || next.is_some_and(|next| next <= entry);
                if is_later || last.is_some_and(|last| self.is_visited(entry, last, slab)) {
                    continue;
                }
                next = Some(entry);
            }
        }
        next.map(|next| PartitionId(next.partition))
    }

    /// Whether the ray entered a box's partition, by this box or another one, at `last` or before.
    fn is_visited(&self, entry: Entry, last: Entry, slab: &Slab) -> bool {
        entry <= last || self.entry(entry.partition, slab).is_some_and(|first| first <= last)
    }

    /// Where the ray enters a partition.
    fn entry(&self, partition: u32, slab: &Slab) -> Option<Entry> {
        let boxes = self.boxes.get(partition as usize)?.iter();
        let nearest = boxes.filter_map(|bounds| distance_to(bounds, slab)).min_by(f32::total_cmp);
        nearest.map(|distance| Entry { distance, partition })
    }
}

/// Where the ray enters a box, if it does.
fn distance_to(bounds: &Bounds, slab: &Slab) -> Option<f32> {
    let (near, far) = slab.intervals(&pack(bounds, bounds));
    (near.x <= far.x).then_some(near.x)
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
