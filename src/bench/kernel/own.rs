//! The renderer's kernel, in each of its modes.

use equilux_common::ray::Ray;
use equilux_render::geometry::{Partition, Slot, Stack, Traversal};

use super::timing::Kernel;

/// All modes.
const MODES: [(&str, Traversal); 2] =
    [("single", Traversal::Single), ("shared", Traversal::Shared)];

/// The kernel in one mode.
struct Own<'a> {
    name: &'static str,
    traversal: Traversal,
    partition: &'a Partition,
    slots: Vec<Option<Slot>>,
    stack: Stack,
}

/// The kernel in each mode.
pub(super) fn kernels(partition: &Partition) -> impl Iterator<Item = Box<dyn Kernel + '_>> {
    MODES.into_iter().map(move |(name, traversal)| -> Box<dyn Kernel + '_> {
        Box::new(Own { name, traversal, partition, slots: Vec::new(), stack: Stack::default() })
    })
}

impl Kernel for Own<'_> {
    fn name(&self) -> &'static str {
        self.name
    }

    fn closest(&mut self, rays: &mut [Ray]) {
        self.slots.resize(rays.len(), None);
        self.partition.intersect_all(rays, &mut self.slots, self.traversal, &mut self.stack);
    }

    fn any(&mut self, rays: &[Ray], are_hit: &mut [bool]) {
        self.partition.are_occluded(rays, are_hit, self.traversal, &mut self.stack);
    }
}
