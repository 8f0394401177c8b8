//! The renderer's kernel, in each of its modes.

use equilux_common::ray::Ray;
use equilux_render::geometry::{Partition, Stack};

use super::timing::Kernel;

/// A way in which the renderer traces a bundle.
struct Mode {
    name: &'static str,
    closest: fn(&Partition, &mut [Ray], &mut Stack),
    any: fn(&Partition, &[Ray], &mut [bool], &mut Stack),
}

/// All modes.
const MODES: [Mode; 1] = [Mode { name: "single", closest: closest_single, any: any_single }];

/// The kernel in one mode.
struct Own<'a> {
    mode: Mode,
    partition: &'a Partition,
    stack: Stack,
}

/// The kernel in each mode.
pub(super) fn kernels(partition: &Partition) -> impl Iterator<Item = Box<dyn Kernel + '_>> {
    MODES.into_iter().map(move |mode| -> Box<dyn Kernel + '_> {
        Box::new(Own { mode, partition, stack: Stack::default() })
    })
}

impl Kernel for Own<'_> {
    fn name(&self) -> &'static str {
        self.mode.name
    }

    fn closest(&mut self, rays: &mut [Ray]) {
        (self.mode.closest)(self.partition, rays, &mut self.stack);
    }

    fn any(&mut self, rays: &[Ray], are_hit: &mut [bool]) {
        (self.mode.any)(self.partition, rays, are_hit, &mut self.stack);
    }
}

fn closest_single(partition: &Partition, rays: &mut [Ray], stack: &mut Stack) {
    for ray in rays {
        partition.intersect(ray, stack);
    }
}

fn any_single(partition: &Partition, rays: &[Ray], are_hit: &mut [bool], stack: &mut Stack) {
    for (ray, is_hit) in rays.iter().zip(are_hit) {
        *is_hit = partition.is_occluded(ray, stack);
    }
}
