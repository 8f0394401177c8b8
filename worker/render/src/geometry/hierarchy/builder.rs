//! Trees for files, one after another, where building is what takes the time.
//!
//! Three things make it fast. What is needed on the way stays for the next tree: most of the time
//! would go to the system, for clearing fresh memory. Things that come one after another and lie
//! together, as the halves of a quad do, are one thing to the search, which so has about half as
//! much to do; most would end in the same leaf anyway. And nodes are joined to leaves while they
//! are laid out.
//!
//! What is built depends on the things alone: not on the trees that were built before.

use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

use super::{Child, NODE, Node, aabb, bounds_of};
use crate::geometry::Bounds;
use crate::geometry::slab::pack;

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

/// Most things of a leaf.
const LEAF_THINGS_MAX: u8 = 4;

/// What visiting a node costs, where testing a thing costs 1.
const NODE_COST: f32 = 3.0;

/// Builds trees.
#[derive(Default)]
pub(in crate::geometry) struct HierarchyBuilder {
    /// The first thing of each pair, and the end of the last. A pair may have one thing only.
    begins: Vec<u32>,
    boxes: Vec<Aabb>,
    search: PlocBuilder,
    found: Bvh2,
    reinsertion: ReinsertionOptimizer,
    /// Nodes that were found and have children, parents first.
    parents: Vec<u32>,
    /// By node that was found: how many things are below it if it is a leaf or becomes one, else 0.
    leaf_things: Vec<u8>,
    nodes: Vec<Node>,
    order: Vec<u32>,
}

/// Two sibling nodes that were found and are yet to be laid out.
struct Open {
    /// The left one; the right one follows it.
    first: u32,
    /// Which of our nodes, and which child of it, they are the children of.
    parent: Option<(usize, usize)>,
}

impl HierarchyBuilder {
    /// Builds a tree over things with these bounds.
    pub(in crate::geometry) fn build(&mut self, bounds: impl Iterator<Item = Bounds>) {
        self.nodes.clear();
        self.order.clear();
        self.pair(bounds);
        if !self.boxes.is_empty() {
            self.search();
            self.join_leaves();
            self.lay_out();
        }
    }

    /// The nodes of the last tree, as [`super::Hierarchy::from_nodes`] takes them.
    pub(in crate::geometry) fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The order in which the things lie under the last tree: the position of each in what it was
    /// built from.
    pub(in crate::geometry) fn order(&self) -> &[u32] {
        &self.order
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

    /// Decides which nodes become leaves: those below which two leaves or more cost less as one.
    fn join_leaves(&mut self) {
        let nodes = &self.found.nodes;
        self.leaf_things.clear();
        self.leaf_things.resize(nodes.len(), 0);
        self.parents.clear();
        let mut open = vec![0];
        while let Some(index) = open.pop() {
            let node = &nodes[index as usize];
            if node.is_leaf() {
                let pair = node.first_index as usize;
                self.leaf_things[index as usize] =
                    (self.begins[pair + 1] - self.begins[pair]) as u8;
            } else {
                self.parents.push(index);
                open.extend([node.first_index + 1, node.first_index]);
            }
        }
        for &index in self.parents.iter().rev() {
            let node = &nodes[index as usize];
            let children = [node.first_index as usize, node.first_index as usize + 1];
            let [left, right] = children.map(|child| self.leaf_things[child]);
            if left == 0 || right == 0 || left + right > LEAF_THINGS_MAX {
                continue;
            }
            let area = |node: &Bvh2Node| node.aabb().half_area();
            let apart = area(&nodes[children[0]]) * f32::from(left)
                + area(&nodes[children[1]]) * f32::from(right);
            if area(node) * (f32::from(left + right) - NODE_COST) <= apart {
                self.leaf_things[index as usize] = left + right;
            }
        }
    }

    fn lay_out(&mut self) {
        if self.leaf_things[0] > 0 {
            let bounds = bounds_of(self.found.nodes[0].aabb());
            let children = [self.child(0), Child { first: 0, count: 0 }];
            self.nodes.push(Node { bounds: pack(&bounds, &bounds), children });
            return;
        }
        let mut open = vec![Open { first: self.found.nodes[0].first_index, parent: None }];
        while let Some(Open { first, parent }) = open.pop() {
            let index = self.nodes.len();
            if let Some((node, side)) = parent {
                let first = u32::try_from(index).expect("triangles are limited");
                self.nodes[node].children[side].first = first;
            }
            let pair = [first, first + 1];
            let [left, right] =
                pair.map(|found| bounds_of(self.found.nodes[found as usize].aabb()));
            let children = pair.map(|found| self.child(found));
            self.nodes.push(Node { bounds: pack(&left, &right), children });
            for side in [1, 0] {
                if children[side].count == NODE {
                    open.push(Open { first: children[side].first, parent: Some((index, side)) });
                }
            }
        }
    }

    /// What becomes of a node that was found: a leaf, whose things are next in the order, or a node
    /// of which its children are known, but not yet where they will lie.
    fn child(&mut self, found: u32) -> Child {
        let things = self.leaf_things[found as usize];
        if things == 0 {
            return Child { first: self.found.nodes[found as usize].first_index, count: NODE };
        }
        let first = u32::try_from(self.order.len()).expect("triangles are limited");
        self.gather(found);
        Child { first, count: u32::from(things) }
    }

    fn gather(&mut self, found: u32) {
        let node = &self.found.nodes[found as usize];
        let first = node.first_index;
        if node.is_leaf() {
            let pair = first as usize;
            self.order.extend(self.begins[pair]..self.begins[pair + 1]);
        } else {
            self.gather(first);
            self.gather(first + 1);
        }
    }
}
