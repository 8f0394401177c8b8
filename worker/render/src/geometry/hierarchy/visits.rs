//! What walks have yet to visit.

use crate::geometry::lanes::Lanes;

use super::{Child, Node, ROOT, WIDTH};

/// Children that a walk has put off, the next one last. Fits itself to any tree; reuse it.
#[derive(Debug, Default)]
pub(in crate::geometry) struct Visits {
    /// The nearest distance at which each may hold a hit.
    nears: Vec<f32>,
    firsts: Vec<u32>,
    counts: Vec<u32>,
    /// A bit for each ray that visits it, where several go together.
    rays: Vec<u32>,
}

/// The visits of one walk.
pub(super) struct Waiting<'a> {
    nears: &'a mut [f32],
    firsts: &'a mut [u32],
    counts: &'a mut [u32],
    rays: &'a mut [u32],
    len: usize,
}

impl Visits {
    /// Nothing yet, with room for so many.
    #[inline]
    pub(super) fn fit(&mut self, depth: usize) -> Waiting<'_> {
        // All lanes of a node are written, however many of them count.
        let room = depth + WIDTH;
        if self.nears.len() < room {
            self.nears.resize(room, 0.0);
            self.firsts.resize(room, 0);
            self.counts.resize(room, 0);
            self.rays.resize(room, 0);
        }
        let Self { nears, firsts, counts, rays } = self;
        Waiting { nears, firsts, counts, rays, len: 0 }
    }
}

impl Waiting<'_> {
    /// Puts off the root, which all rays visit.
    #[inline(always)]
    pub(super) fn begin(&mut self) {
        (self.nears[0], self.firsts[0], self.counts[0]) = (0.0, ROOT.first, ROOT.count);
        self.rays[0] = u32::MAX;
        self.len = 1;
    }

    /// The last one is next: takes it away.
    #[inline(always)]
    pub(super) fn pop(&mut self) -> Option<usize> {
        self.len = self.len.checked_sub(1)?;
        Some(self.len)
    }

    #[inline(always)]
    pub(super) fn near(&self, place: usize) -> f32 {
        self.nears[place]
    }

    #[inline(always)]
    pub(super) fn child(&self, place: usize) -> Child {
        Child { first: self.firsts[place], count: self.counts[place] }
    }

    #[inline(always)]
    pub(super) fn rays(&self, place: usize) -> u32 {
        self.rays[place]
    }

    /// Puts off the first so many children of this order.
    #[inline(always)]
    pub(super) fn push<L: Lanes>(&mut self, lanes: L, node: &Node, order: L::Order, count: u32) {
        let place = self.len..self.len + WIDTH;
        self.firsts[place.clone()].copy_from_slice(&lanes.arrange(&node.firsts, order));
        self.counts[place].copy_from_slice(&lanes.arrange(&node.counts, order));
        self.len += count as usize;
    }

    /// [`Self::push`] with the distances of all of them.
    #[inline(always)]
    pub(super) fn push_at<L: Lanes>(
        &mut self,
        lanes: L,
        node: &Node,
        (near, order): (L::Floats, L::Order),
        count: u32,
    ) {
        let near = lanes.store(lanes.arrange_floats(near, order));
        self.nears[self.len..self.len + WIDTH].copy_from_slice(&near);
        self.push(lanes, node, order, count);
    }

    /// Says which rays visit those that were put off last, by the lanes of their node.
    #[inline(always)]
    pub(super) fn visit_by<L: Lanes>(
        &mut self,
        lanes: L,
        rays: &[u32; WIDTH],
        order: L::Order,
        count: u32,
    ) {
        let place = self.len - count as usize;
        self.rays[place..place + WIDTH].copy_from_slice(&lanes.arrange(rays, order));
    }
}
