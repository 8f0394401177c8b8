//! Rays that walk through a tree together: a node is fetched once for all that visit it.

use std::ops::Range;

use super::{Child, Hierarchy, NODE, Node, ROOT, Visit, Visits, insert};
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
    visits: &'a mut [Visit],
    /// How many of the visits are still to be made.
    waiting: usize,
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
        let visits = visits.fit(self.depth.max(1));
        visits[0] = Visit { child: ROOT, near: 0.0, rays: u32::MAX };
        let waiting = usize::from(!self.nodes.is_empty());
        SharedWalk { lanes, nodes: &self.nodes, rays, visits, waiting }
    }
}

impl<L: Lanes> SharedWalk<'_, L> {
    /// The things under the next leaf whose box any ray meets within its reach, and which rays may:
    /// a bit for each. Beyond the last ray, `reach` is less than zero.
    #[inline(always)]
    pub(in crate::geometry) fn next_leaf(&mut self, reach: &Reach) -> Option<(Range<usize>, u32)> {
        while self.waiting > 0 {
            self.waiting -= 1;
            let Visit { child, near, rays } = self.visits[self.waiting];
            let rays = rays & within(self.lanes, near, reach);
            if rays == 0 {
                continue;
            }
            let Child { first, count } = child;
            let first = first as usize;
            if count != NODE {
                return Some((first..first + count as usize, rays));
            }
            if rays & (rays - 1) == 0 {
                self.enter_alone(&self.nodes[first], rays, reach);
            } else {
                self.enter(&self.nodes[first], rays, reach);
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
            nearest = lanes.min(nearest, lanes.where_at_most(near, far));
            let met_here = lanes.at_most(near, far);
            met |= met_here;
            met_by_ray[ray] = met_here as u8;
        }
        let (nearest, columns) = (lanes.store(nearest), lanes.columns(&met_by_ray));
        let base = self.waiting;
        while met != 0 {
            let lane = met.trailing_zeros() as usize;
            met &= met - 1;
            let visit = Visit { child: node.child(lane), near: nearest[lane], rays: columns[lane] };
            insert(self.visits, base..self.waiting, visit);
            self.waiting += 1;
        }
    }

    /// [`Self::enter`] for one ray.
    #[inline(always)]
    fn enter_alone(&mut self, node: &Node, rays: u32, reach: &Reach) {
        let (lanes, ray) = (self.lanes, rays.trailing_zeros() as usize);
        let (near, far) = self.rays[ray].interval_in(lanes, &node.bounds, reach[ray]);
        let (mut met, near) = (lanes.at_most(near, far), lanes.store(near));
        let base = self.waiting;
        while met != 0 {
            let lane = met.trailing_zeros() as usize;
            met &= met - 1;
            let visit = Visit { child: node.child(lane), near: near[lane], rays };
            insert(self.visits, base..self.waiting, visit);
            self.waiting += 1;
        }
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
