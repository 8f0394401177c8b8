//! Rays that walk through a tree of triangles together.

use equilux_common::ray::Ray;

use super::Bounds;
use super::block::{Block, BlockWords};
use super::hierarchy::{Reach, SHARED_RAYS_MAX, Visits};
use super::lanes::Lanes;
use super::ready::Ready;
use super::tree::{Hit, Tree, World};

/// How rays of a bundle walk through a tree. It does not matter for what they find.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Traversal {
    /// One after another: for rays that go different ways.
    Single,
    /// Together: for rays that go much the same way.
    Shared,
}

/// How far rays may go that are made ready together.
fn reach(rays: &[Ray]) -> Reach {
    let mut reach = [-1.0; SHARED_RAYS_MAX];
    rays.iter().zip(&mut reach).for_each(|(ray, reach)| *reach = ray.distance);
    reach
}

impl Tree {
    /// [`Self::closest`] of several rays, at most [`SHARED_RAYS_MAX`], one after another.
    #[inline(always)]
    pub(super) fn closest_of_each<L: Lanes>(
        &self,
        lanes: L,
        rays: &mut [Ray],
        hits: &mut [Option<Hit>],
        bounds: &Bounds,
        (visits, ready): (&mut Visits, &mut Ready),
    ) {
        let (probes, thick) = ready.make(lanes, rays, bounds);
        for (((ray, hit), probe), thick) in rays.iter_mut().zip(hits).zip(probes).zip(thick) {
            *hit = self.closest(lanes, (&World(probe), thick), ray, visits);
        }
    }

    /// [`Self::is_occluded`] of several rays, at most [`SHARED_RAYS_MAX`], one after another: those
    /// that are, as a bit for each.
    #[inline(always)]
    pub(super) fn each_occluded<L: Lanes>(
        &self,
        lanes: L,
        rays: &[Ray],
        bounds: &Bounds,
        (visits, ready): (&mut Visits, &mut Ready),
    ) -> u32 {
        let (probes, thick) = ready.make(lanes, rays, bounds);
        let mut occluded = 0;
        for (number, ((ray, probe), thick)) in rays.iter().zip(probes).zip(thick).enumerate() {
            let is_occluded = self.is_occluded(lanes, (&World(probe), thick), ray, visits);
            occluded |= u32::from(is_occluded) << number;
        }
        occluded
    }

    /// [`Self::closest`] for several rays, at most [`SHARED_RAYS_MAX`]: calls `found` with the
    /// number of a ray whenever a nearer hit of it is found.
    #[inline(always)]
    pub(super) fn closest_together<L: Lanes>(
        &self,
        lanes: L,
        rays: &mut [Ray],
        hits: &mut [Option<Hit>],
        bounds: &Bounds,
        (visits, ready): (&mut Visits, &mut Ready),
    ) {
        let (probes, thick) = ready.make(lanes, rays, bounds);
        let mut reach = reach(rays);
        let triangles: &[BlockWords] = self.triangles();
        let mut walk = self.hierarchy().walk_together(lanes, thick, visits);
        while let Some((leaf, mut visitors)) = walk.next_leaf(&reach) {
            let first = leaf.start;
            let block = Block::new(triangles, leaf);
            while visitors != 0 {
                let number = visitors.trailing_zeros() as usize;
                visitors &= visitors - 1;
                let (probe, ray) = (&probes[number], &mut rays[number]);
                let candidates = probe.passes_through(lanes, &block);
                if let Some(hit) = block.closest(&World(probe), first, candidates, ray) {
                    hits[number] = Some(hit);
                    reach[number] = ray.distance;
                }
            }
        }
    }

    /// [`Self::is_occluded`] for several rays, at most [`SHARED_RAYS_MAX`]: those that are, as a
    /// bit for each.
    #[inline(always)]
    pub(super) fn occluded_together<L: Lanes>(
        &self,
        lanes: L,
        rays: &[Ray],
        bounds: &Bounds,
        (visits, ready): (&mut Visits, &mut Ready),
    ) -> u32 {
        let (probes, thick) = ready.make(lanes, rays, bounds);
        let all = u32::MAX.unbounded_shr((SHARED_RAYS_MAX - rays.len()) as u32);
        let mut occluded = 0;
        let triangles: &[BlockWords] = self.triangles();
        let rays_and_reach = (thick, reach(rays));
        let mut walk = self.hierarchy().walk_together_unordered(lanes, rays_and_reach, visits);
        while let Some((leaf, mut visitors)) = walk.next_leaf(all & !occluded) {
            let block = Block::new(triangles, leaf);
            while visitors != 0 {
                let number = visitors.trailing_zeros() as usize;
                visitors &= visitors - 1;
                let probe = &probes[number];
                let candidates = probe.passes_through(lanes, &block);
                if block.has_nearer(&World(probe), candidates, &rays[number]) {
                    occluded |= 1 << number;
                }
            }
        }
        occluded
    }
}
