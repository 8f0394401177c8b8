//! One ray's walk through a tree.

use std::ops::Range;

use super::visits::{Visits, Waiting};
use super::{Child, Hierarchy, Node, ROOT};
use crate::geometry::lanes::Lanes;
use crate::geometry::thick_ray::ThickRay;

/// A walk through the tree, nearer children first.
pub(in crate::geometry) struct Walk<'a, L: Lanes> {
    lanes: L,
    nodes: &'a [Node],
    ray: &'a ThickRay,
    visits: Waiting<'a>,
    next: Option<Child>,
}

/// A walk through the tree in no particular order.
pub(in crate::geometry) struct UnorderedWalk<'a, L: Lanes> {
    lanes: L,
    nodes: &'a [Node],
    ray: &'a ThickRay,
    farthest: f32,
    visits: Waiting<'a>,
    next: Option<Child>,
}

impl Hierarchy {
    /// A walk that comes by all leaves that a ray may meet, nearer children first.
    #[inline(always)]
    pub(in crate::geometry) fn walk<'a, L: Lanes>(
        &'a self,
        lanes: L,
        ray: &'a ThickRay,
        visits: &'a mut Visits,
    ) -> Walk<'a, L> {
        let next = (!self.nodes.is_empty()).then_some(ROOT);
        Walk { lanes, nodes: &self.nodes, ray, visits: visits.fit(self.depth), next }
    }

    /// A walk that comes by all leaves that a ray may meet at `farthest` or nearer.
    #[inline(always)]
    pub(in crate::geometry) fn walk_unordered<'a, L: Lanes>(
        &'a self,
        lanes: L,
        (ray, farthest): (&'a ThickRay, f32),
        visits: &'a mut Visits,
    ) -> UnorderedWalk<'a, L> {
        let next = (!self.nodes.is_empty()).then_some(ROOT);
        let visits = visits.fit(self.depth);
        UnorderedWalk { lanes, nodes: &self.nodes, ray, farthest, visits, next }
    }
}

impl<L: Lanes> Walk<'_, L> {
    /// The things under the next leaf whose box the ray meets at `farthest` or nearer.
    #[inline(always)]
    pub(in crate::geometry) fn next_leaf(&mut self, farthest: f32) -> Option<Range<usize>> {
        loop {
            let child = match self.next.take() {
                Some(child) => child,
                None => self.resume(farthest)?,
            };
            if let Some(leaf) = child.leaf() {
                return Some(leaf);
            }
            self.enter(&self.nodes[child.first as usize], farthest);
        }
    }

    /// The latest child that was put off and may still matter.
    #[inline(always)]
    fn resume(&mut self, farthest: f32) -> Option<Child> {
        loop {
            let place = self.visits.pop()?;
            // Not what is as near: a hit at the same distance may have the lesser id.
            if self.visits.near(place) <= farthest {
                return Some(self.visits.child(place));
            }
        }
    }

    /// Goes on with the nearest child that is met, and puts off the others.
    #[inline(always)]
    fn enter(&mut self, node: &Node, farthest: f32) {
        let (near, far) = self.ray.interval_in(self.lanes, &node.bounds, farthest);
        let met = self.lanes.at_most(near, far);
        if met & met.wrapping_sub(1) == 0 {
            self.next = (met != 0).then(|| node.child(met.trailing_zeros() as usize));
            return;
        }
        let order = self.lanes.farthest_first(near, far);
        self.visits.push_at(self.lanes, node, (near, order), met.count_ones());
        self.next = self.visits.pop().map(|place| self.visits.child(place));
    }
}

impl<L: Lanes> UnorderedWalk<'_, L> {
    /// The things under the next leaf whose box the ray meets.
    #[inline(always)]
    pub(in crate::geometry) fn next_leaf(&mut self) -> Option<Range<usize>> {
        loop {
            let child = match self.next.take() {
                Some(child) => child,
                None => self.visits.pop().map(|place| self.visits.child(place))?,
            };
            if let Some(leaf) = child.leaf() {
                return Some(leaf);
            }
            self.enter(&self.nodes[child.first as usize]);
        }
    }

    /// Goes on with one of the children that are met, and puts off the others.
    #[inline(always)]
    fn enter(&mut self, node: &Node) {
        let (near, far) = self.ray.interval_in(self.lanes, &node.bounds, self.farthest);
        let met = self.lanes.at_most(near, far);
        if met & met.wrapping_sub(1) == 0 {
            self.next = (met != 0).then(|| node.child(met.trailing_zeros() as usize));
            return;
        }
        let order = self.lanes.chosen_first(met);
        self.visits.push(self.lanes, node, order, met.count_ones());
        self.next = self.visits.pop().map(|place| self.visits.child(place));
    }
}
