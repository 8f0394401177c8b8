//! Rays that walk through a tree of triangles together.

use equilux_common::ray::Ray;

use super::Bounds;
use super::block::{Block, BlockWords};
use super::hierarchy::{Reach, SHARED_RAYS_MAX, Visits};
use super::lanes::Lanes;
use super::thick_ray::ThickRay;
use super::tree::{Hit, Tree, World};
use super::triangle::Probe;

/// How rays of a bundle walk through a tree. It does not matter for what they find.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Traversal {
    /// One after another: for rays that go different ways.
    Single,
    /// Together: for rays that go much the same way.
    Shared,
}

/// Rays made ready to walk together; reuse it.
#[derive(Debug, Default)]
pub(super) struct Company {
    probes: Vec<Probe>,
    thick: Vec<ThickRay>,
}

impl Company {
    /// Makes rays ready, at most [`SHARED_RAYS_MAX`]; also says how far each may go.
    #[inline(always)]
    fn gather<L: Lanes>(&mut self, lanes: L, rays: &[Ray], bounds: &Bounds) -> Reach {
        let mut reach = [-1.0; SHARED_RAYS_MAX];
        self.probes.clear();
        self.thick.clear();
        for (ray, reach) in rays.iter().zip(&mut reach) {
            let probe = Probe::new(ray, bounds);
            self.thick.push(ThickRay::new(lanes, &probe.slab));
            self.probes.push(probe);
            *reach = ray.distance;
        }
        reach
    }
}

impl Tree {
    /// [`Self::closest`] for several rays, at most [`SHARED_RAYS_MAX`]: calls `found` with the
    /// number of a ray whenever a nearer hit of it is found.
    #[inline(always)]
    pub(super) fn closest_together<L: Lanes>(
        &self,
        lanes: L,
        rays: &mut [Ray],
        hits: &mut [Option<Hit>],
        bounds: &Bounds,
        (visits, company): (&mut Visits, &mut Company),
    ) {
        let mut reach = company.gather(lanes, rays, bounds);
        let triangles: &[BlockWords] = self.triangles();
        let mut walk = self.hierarchy().walk_together(lanes, &company.thick, visits);
        while let Some((leaf, mut visitors)) = walk.next_leaf(&reach) {
            let first = leaf.start;
            let block = Block::new(triangles, leaf);
            while visitors != 0 {
                let number = visitors.trailing_zeros() as usize;
                visitors &= visitors - 1;
                let (probe, ray) = (&company.probes[number], &mut rays[number]);
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
        (visits, company): (&mut Visits, &mut Company),
    ) -> u32 {
        let mut reach = company.gather(lanes, rays, bounds);
        let mut occluded = 0;
        let triangles: &[BlockWords] = self.triangles();
        let mut walk = self.hierarchy().walk_together(lanes, &company.thick, visits);
        while let Some((leaf, mut visitors)) = walk.next_leaf(&reach) {
            let block = Block::new(triangles, leaf);
            while visitors != 0 {
                let number = visitors.trailing_zeros() as usize;
                visitors &= visitors - 1;
                let probe = &company.probes[number];
                let candidates = probe.passes_through(lanes, &block);
                if block.has_nearer(&World(probe), candidates, &rays[number]) {
                    occluded |= 1 << number;
                    reach[number] = -1.0;
                }
            }
        }
        occluded
    }
}
