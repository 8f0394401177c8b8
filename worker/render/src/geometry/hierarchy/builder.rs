//! Trees for files, one after another, where building is what takes the time.
//!
//! Three things make it fast. What is needed on the way stays for the next tree: most of the time
//! would go to the system, for clearing fresh memory. Things that come one after another and lie
//! together, as the halves of a quad do, are one thing to the search, which so has about half as
//! much to do; most would end in the same leaf anyway.
//!
//! What is built depends on the things alone: not on the trees that were built before.

use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

use super::collapse::Collapse;
use super::{Node, aabb};
use crate::geometry::Bounds;

/// How far the search looks for the nearest neighbor, in the order along a space-filling curve.
const SEARCH_DISTANCE: PlocSearchDistance = PlocSearchDistance::Low;

/// So many rounds of the search, those with the most nodes, look at direct neighbors only.
const HASTY_ROUNDS: usize = 2;

/// What part of the nodes is tried elsewhere in the tree, at most at once.
const REINSERTED: f32 = 0.01;

/// Two things are one to the search if the box around both has at most so much of the surface that
/// their own boxes have together: halves of a quad have from 1/2 to a little more, those of
/// neighboring quads have about 1.
const PAIR_SURFACE: f32 = 0.75;

/// Builds trees.
#[derive(Default)]
pub(in crate::geometry) struct HierarchyBuilder {
    /// The first thing of each pair, and the end of the last. A pair may have one thing only.
    begins: Vec<u32>,
    boxes: Vec<Aabb>,
    search: PlocBuilder,
    found: Bvh2,
    reinsertion: ReinsertionOptimizer,
    collapse: Collapse,
}

impl HierarchyBuilder {
    /// Builds a tree over things with these bounds.
    pub(in crate::geometry) fn build(&mut self, bounds: impl Iterator<Item = Bounds>) {
        self.pair(bounds);
        if self.boxes.is_empty() {
            self.collapse.clear();
            return;
        }
        self.search();
        let begins = &self.begins;
        self.collapse.run(&self.found.nodes, |leaf| {
            let pair = leaf.first_index as usize;
            begins[pair]..begins[pair + 1]
        });
    }

    /// The nodes of the last tree, as [`super::Hierarchy::from_nodes`] takes them.
    pub(in crate::geometry) fn nodes(&self) -> &[Node] {
        &self.collapse.nodes
    }

    /// The order in which the things lie under the last tree: the position of each in what it was
    /// built from.
    pub(in crate::geometry) fn order(&self) -> &[u32] {
        &self.collapse.order
    }

    fn pair(&mut self, bounds: impl Iterator<Item = Bounds>) {
        self.begins.clear();
        self.boxes.clear();
        let mut single: Option<Bounds> = None;
        let mut count = 0;
        for next in bounds {
            let pair = single.take().map(|first| (first, first.joined(&next)));
            let is_pair = |(first, both): &(Bounds, Bounds)| {
                both.half_area() <= PAIR_SURFACE * (first.half_area() + next.half_area())
            };
            match (pair.filter(is_pair), self.boxes.last_mut()) {
                (Some((_, both)), Some(last)) => *last = aabb(&both),
                _ => {
                    self.begins.push(count);
                    self.boxes.push(aabb(&next));
                    single = Some(next);
                }
            }
            count += 1;
        }
        self.begins.push(count);
    }

    /// Finds a tree over the pairs, each a leaf of its own.
    fn search(&mut self) {
        let mut pairs = std::mem::take(&mut self.found.primitive_indices);
        pairs.clear();
        pairs.extend(0..u32::try_from(self.boxes.len()).expect("triangles are limited"));
        let Self { search, found, boxes, .. } = self;
        let (distance, precision) = (SEARCH_DISTANCE, SortPrecision::U64);
        search.build_with_bvh(found, distance, boxes, pairs, precision, HASTY_ROUNDS);
        self.reinsertion.run(found, REINSERTED, None);
    }
}
