//! Rays that walk through a tree together: a node is fetched once for all that visit it.

use std::ops::Range;

use super::visits::{Visits, Waiting};
use super::{Hierarchy, Node, WIDTH};
use crate::geometry::lanes::Lanes;
use crate::geometry::thick_ray::ThickRay;

/// Most rays that walk together: a bit is kept for each.
pub(in crate::geometry) const SHARED_RAYS_MAX: usize = 32;

/// How far each ray may still go; less than zero if it is not to go on.
pub(in crate::geometry) type Reach = [f32; SHARED_RAYS_MAX];

/// A walk of several rays through the tree.
pub(in crate::geometry) struct SharedWalk<'a, L: Lanes> {
    lanes: L,
    nodes: &'a [Node],
    rays: &'a [ThickRay],
    visits: Waiting<'a>,
}

/// A walk of several rays through the tree in no particular order.
pub(in crate::geometry) struct UnorderedSharedWalk<'a, L: Lanes> {
    lanes: L,
    nodes: &'a [Node],
    rays: &'a [ThickRay],
    reach: Reach,
    visits: Waiting<'a>,
}

impl Hierarchy {
    /// A walk that comes by all leaves that any of these rays may meet, at most
    /// [`SHARED_RAYS_MAX`]; those that are nearer to the nearest of them first.
    #[inline(always)]
    pub(in crate::geometry) fn walk_together<'a, L: Lanes>(
        &'a self,
        lanes: L,
        rays: &'a [ThickRay],
        visits: &'a mut Visits,
    ) -> SharedWalk<'a, L> {
        let visits = self.begin(visits);
        SharedWalk { lanes, nodes: &self.nodes, rays, visits }
    }

    /// A walk that comes by all leaves that any of these rays may meet within its reach.
    #[inline(always)]
    pub(in crate::geometry) fn walk_together_unordered<'a, L: Lanes>(
        &'a self,
        lanes: L,
        (rays, reach): (&'a [ThickRay], Reach),
        visits: &'a mut Visits,
    ) -> UnorderedSharedWalk<'a, L> {
        let visits = self.begin(visits);
        UnorderedSharedWalk { lanes, nodes: &self.nodes, rays, reach, visits }
    }

    /// The root, which all rays visit, if there is one.
    #[inline(always)]
    fn begin<'a>(&self, visits: &'a mut Visits) -> Waiting<'a> {
        let mut visits = visits.fit(self.depth);
        if !self.nodes.is_empty() {
            visits.begin();
        }
        visits
    }
}

impl<L: Lanes> SharedWalk<'_, L> {
    /// The things under the next leaf whose box any ray meets within its reach, and which rays may:
    /// a bit for each. Beyond the last ray, `reach` is less than zero.
    #[inline(always)]
    pub(in crate::geometry) fn next_leaf(&mut self, reach: &Reach) -> Option<(Range<usize>, u32)> {
        while let Some(place) = self.visits.pop() {
            let rays = self.visits.rays(place);
            let rays = rays & within(self.lanes, self.visits.near(place), reach);
            if rays == 0 {
                continue;
            }
            let child = self.visits.child(place);
            if let Some(leaf) = child.leaf() {
                return Some((leaf, rays));
            }
            let node = &self.nodes[child.first as usize];
            if rays & (rays - 1) == 0 {
                self.enter_alone(node, rays, reach);
            } else {
                self.enter(node, rays, reach);
            }
        }
        None
    }

    /// Puts off the children that any of the rays meet, nearer ones uppermost.
    #[inline(always)]
    fn enter(&mut self, node: &Node, rays: u32, reach: &Reach) {
        let lanes = self.lanes;
        let mut met_by_ray = [0u8; SHARED_RAYS_MAX];
        let mut nearest = lanes.splat(f32::INFINITY);
        let (mut met, mut rest) = (0, rays);
        while rest != 0 {
            let ray = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let (near, far) = self.rays[ray].interval_in(lanes, &node.bounds, reach[ray]);
            let met_at = lanes.select_at_most(near, far, near, lanes.splat(f32::INFINITY));
            nearest = lanes.min(nearest, met_at);
            let met_here = lanes.at_most(near, far);
            met |= met_here;
            met_by_ray[ray] = met_here as u8;
        }
        let columns = lanes.columns(&met_by_ray);
        let order = lanes.farthest_first(nearest, lanes.splat(f32::MAX));
        let count = met.count_ones();
        self.visits.push_at(lanes, node, (nearest, order), count);
        self.visits.visit_by(lanes, &columns, order, count);
    }

    /// [`Self::enter`] for one ray.
    #[inline(always)]
    fn enter_alone(&mut self, node: &Node, rays: u32, reach: &Reach) {
        let (lanes, ray) = (self.lanes, rays.trailing_zeros() as usize);
        let (near, far) = self.rays[ray].interval_in(lanes, &node.bounds, reach[ray]);
        let order = lanes.farthest_first(near, far);
        let count = lanes.at_most(near, far).count_ones();
        self.visits.push_at(lanes, node, (near, order), count);
        self.visits.visit_by(lanes, &[rays; WIDTH], order, count);
    }
}

impl<L: Lanes> UnorderedSharedWalk<'_, L> {
    /// The things under the next leaf whose box any ray meets, and which of the rays that are still
    /// `wanted` may: a bit for each.
    #[inline(always)]
    pub(in crate::geometry) fn next_leaf(&mut self, wanted: u32) -> Option<(Range<usize>, u32)> {
        while let Some(place) = self.visits.pop() {
            let rays = self.visits.rays(place) & wanted;
            if rays == 0 {
                continue;
            }
            let child = self.visits.child(place);
            if let Some(leaf) = child.leaf() {
                return Some((leaf, rays));
            }
            self.enter(&self.nodes[child.first as usize], rays);
        }
        None
    }

    /// Puts off the children that any of the rays meet.
    #[inline(always)]
    fn enter(&mut self, node: &Node, rays: u32) {
        let lanes = self.lanes;
        let mut met_by_ray = [0u8; SHARED_RAYS_MAX];
        let (mut met, mut rest) = (0, rays);
        while rest != 0 {
            let ray = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let (near, far) = self.rays[ray].interval_in(lanes, &node.bounds, self.reach[ray]);
            let met_here = lanes.at_most(near, far);
            met |= met_here;
            met_by_ray[ray] = met_here as u8;
        }
        let (order, count) = (lanes.chosen_first(met), met.count_ones());
        self.visits.push(lanes, node, order, count);
        self.visits.visit_by(lanes, &lanes.columns(&met_by_ray), order, count);
    }
}

/// Which rays reach so far: a bit for each.
#[inline(always)]
fn within<L: Lanes>(lanes: L, near: f32, reach: &Reach) -> u32 {
    let near = lanes.splat(near);
    let mut rays = 0;
    for (group, reach) in reach.as_chunks::<8>().0.iter().enumerate() {
        rays |= lanes.at_most(near, lanes.load(reach)) << (8 * group);
    }
    rays
}
