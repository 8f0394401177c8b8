//! A tree of boxes over things that have bounds, and the walk through it.
//!
//! `obvhs` builds it (PLOC with reinsertion); it is then laid out anew, two boxes to a cache line.
//! No walk allocates: its stack is the caller's and as deep as the tree.

mod builder;

use std::ops::Range;
use std::time::Duration;

use bytemuck::{Pod, Zeroable};
use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;

pub(super) use self::builder::HierarchyBuilder;
use super::Bounds;
use super::slab::{BoxPair, Slab, pack, unpack};
use super::table::Table;

/// [`Child::count`] of a child that is a node.
const NODE: u32 = u32::MAX;

/// A child of a node: another node, or a run of things.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
struct Child {
    /// Index of the node, or of the first thing.
    first: u32,
    /// How many things; [`NODE`] if it is a node.
    count: u32,
}

/// Two children and the bounds of each. A child that is a node has a greater index.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub(super) struct Node {
    bounds: BoxPair,
    children: [Child; 2],
}

/// A child that a walk has yet to visit, and the nearest distance at which it may hold a hit.
#[derive(Clone, Copy, Debug, Default)]
struct Visit {
    child: Child,
    near: f32,
}

/// Where a walk keeps what it has yet to visit. Fits itself to any tree; reuse it.
#[derive(Debug, Default)]
pub struct Stack {
    visits: Visits,
    /// For walks within steps of another one.
    inner: Visits,
}

/// Where one walk at a time keeps what it has yet to visit.
#[derive(Debug, Default)]
pub(super) struct Visits(Vec<Visit>);

impl Stack {
    /// For one walk.
    pub(super) const fn only(&mut self) -> &mut Visits {
        &mut self.visits
    }

    /// For a walk, and for others within its steps.
    pub(super) const fn split(&mut self) -> (&mut Visits, &mut Visits) {
        (&mut self.visits, &mut self.inner)
    }
}

/// A tree of boxes.
#[derive(Debug, Default)]
pub(super) struct Hierarchy {
    nodes: Table<Node>,
    /// Most children that a walk may have put off at any time.
    depth: usize,
}

/// Nodes that are no tree over so many things.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("node {0} of its tree leads astray")]
pub struct InvalidTree(usize);

impl Hierarchy {
    /// Builds a tree over things with these bounds; also gives the order in which the things lie
    /// under it: the position of each among `bounds`.
    pub(super) fn build(
        bounds: impl Iterator<Item = Bounds>,
        quality: BvhBuildParams,
    ) -> (Self, Vec<u32>) {
        let boxes: Vec<Aabb> = bounds.map(|bounds| aabb(&bounds)).collect();
        if boxes.is_empty() {
            return (Self::default(), Vec::new());
        }
        let built = build_bvh2(&boxes, quality, &mut Duration::default());
        drop(boxes);
        let (nodes, depth) = lay_out(&built);
        (Self { nodes: nodes.into(), depth }, built.primitive_indices)
    }

    /// The tree of these nodes over `count` things.
    pub(super) fn from_nodes(nodes: Table<Node>, count: usize) -> Result<Self, InvalidTree> {
        // Children follow their parents, so going backward every child's height is known. It is
        // zero of those that have a parent already.
        let mut heights = vec![1u32; nodes.len()];
        for (index, node) in nodes.iter().enumerate().rev() {
            for child in node.children {
                let first = child.first as usize;
                if child.count != NODE {
                    if first + child.count as usize > count {
                        return Err(InvalidTree(index));
                    }
                    continue;
                }
                let height = heights.get(first).copied().unwrap_or(0);
                if first <= index || height == 0 {
                    return Err(InvalidTree(index));
                }
                heights[first] = 0;
                heights[index] = heights[index].max(height + 1);
            }
        }
        let depth = heights.first().map_or(0, |&height| height as usize);
        Ok(Self { nodes, depth })
    }

    /// Its nodes, as [`Self::from_nodes`] takes them.
    pub(super) const fn nodes(&self) -> &Table<Node> {
        &self.nodes
    }

    /// A walk that comes by all leaves that a ray may meet, nearer children first.
    #[inline]
    pub(super) fn walk<'a>(&'a self, slab: &'a Slab, visits: &'a mut Visits) -> Walk<'a> {
        let Visits(visits) = visits;
        if visits.len() < self.depth {
            visits.resize(self.depth, Visit::default());
        }
        let next = (!self.nodes.is_empty()).then_some(Child { first: 0, count: NODE });
        Walk { nodes: &self.nodes, slab, visits, waiting: 0, next }
    }

    /// The box around all that is in the tree; nothing if that is nothing.
    pub(super) fn bounds(&self) -> Bounds {
        boxes(&self.nodes, 1).first().copied().unwrap_or(Bounds::EMPTY)
    }
}

/// Boxes that together hold all that is in the tree of these nodes, at most `most` and at least
/// one if there is anything: the largest is opened as long as there is room.
pub(super) fn boxes(nodes: &[Node], most: usize) -> Vec<Bounds> {
    let open = |node: &Node| {
        let [left, right] = unpack(&node.bounds);
        let pairs = [(left, node.children[0]), (right, node.children[1])];
        pairs.into_iter().filter(|(_, child)| child.count > 0)
    };
    let Some(root) = nodes.first() else { return Vec::new() };
    let mut boxes: Vec<(Bounds, Child)> = open(root).collect();
    if boxes.len() > most.max(1) {
        return vec![boxes[0].0.joined(&boxes[1].0)];
    }
    while boxes.len() < most {
        let closed = (0..boxes.len()).filter(|&index| boxes[index].1.count == NODE);
        let area = |&index: &usize| boxes[index].0.half_area();
        let Some(largest) = closed.max_by(|a, b| area(a).total_cmp(&area(b))) else { break };
        let (_, child) = boxes.swap_remove(largest);
        boxes.extend(open(&nodes[child.first as usize]));
    }
    boxes.into_iter().map(|(bounds, _)| bounds).collect()
}

/// A walk through the tree.
pub(super) struct Walk<'a> {
    nodes: &'a [Node],
    slab: &'a Slab,
    visits: &'a mut [Visit],
    /// How many of the visits are still to be made.
    waiting: usize,
    next: Option<Child>,
}

impl Walk<'_> {
    /// The things under the next leaf whose box the ray meets at `farthest` or nearer.
    #[inline]
    pub(super) fn next_leaf(&mut self, farthest: f32) -> Option<Range<usize>> {
        loop {
            let child = match self.next.take() {
                Some(child) => child,
                None => self.resume(farthest)?,
            };
            let first = child.first as usize;
            if child.count != NODE {
                return Some(first..first + child.count as usize);
            }
            self.enter(&self.nodes[first], farthest);
        }
    }

    /// The latest child that was put off and may still matter.
    #[inline]
    fn resume(&mut self, farthest: f32) -> Option<Child> {
        while self.waiting > 0 {
            self.waiting -= 1;
            let visit = self.visits[self.waiting];
            // Strictly: a hit at the same distance may have the lesser id.
            if visit.near <= farthest {
                return Some(visit.child);
            }
        }
        None
    }

    #[inline]
    fn enter(&mut self, node: &Node, farthest: f32) {
        let (near, far) = self.slab.intervals(&node.bounds);
        let is_met = [near.x <= far.x && near.x <= farthest, near.y <= far.y && near.y <= farthest];
        let [left, right] = node.children;
        self.next = match is_met {
            [false, false] => None,
            [true, false] => Some(left),
            [false, true] => Some(right),
            [true, true] => {
                let is_left_nearer = near.x <= near.y;
                let visit = if is_left_nearer {
                    Visit { child: right, near: near.y }
                } else {
                    Visit { child: left, near: near.x }
                };
                self.visits[self.waiting] = visit;
                self.waiting += 1;
                Some(if is_left_nearer { left } else { right })
            }
        };
    }
}

/// Two sibling nodes of the builder that are yet to be laid out.
struct Open {
    /// The builder's index of the left one; the right one follows it.
    first: u32,
    /// Which of our nodes, and which child of it, they are the children of.
    parent: Option<(usize, usize)>,
    depth: usize,
}

/// Turns the builder's nodes into ours; also says how deep they go.
fn lay_out(built: &Bvh2) -> (Vec<Node>, usize) {
    let root = &built.nodes[0];
    if root.is_leaf() {
        let bounds = bounds_of(root.aabb());
        let leaf = Child { first: root.first_index, count: root.prim_count };
        let nothing = Child { first: 0, count: 0 };
        return (vec![Node { bounds: pack(&bounds, &bounds), children: [leaf, nothing] }], 1);
    }
    let mut nodes = Vec::with_capacity(built.nodes.len() / 2);
    let mut open = vec![Open { first: root.first_index, parent: None, depth: 1 }];
    let mut deepest = 0;
    while let Some(Open { first, parent, depth }) = open.pop() {
        deepest = deepest.max(depth);
        let index = nodes.len();
        if let Some((node, side)) = parent {
            let node: &mut Node = &mut nodes[node];
            node.children[side].first = u32::try_from(index).expect("triangles are limited");
        }
        let pair = [&built.nodes[first as usize], &built.nodes[first as usize + 1]];
        let children = pair.map(|child| {
            let count = if child.is_leaf() { child.prim_count } else { NODE };
            Child { first: child.first_index, count }
        });
        let bounds = pack(&bounds_of(pair[0].aabb()), &bounds_of(pair[1].aabb()));
        nodes.push(Node { bounds, children });
        for side in [1, 0] {
            if !pair[side].is_leaf() {
                let (first, parent) = (pair[side].first_index, Some((index, side)));
                open.push(Open { first, parent, depth: depth + 1 });
            }
        }
    }
    (nodes, deepest)
}

fn aabb(bounds: &Bounds) -> Aabb {
    Aabb::new(Vec3A::from(bounds.lower), Vec3A::from(bounds.upper))
}

fn bounds_of(aabb: &Aabb) -> Bounds {
    Bounds { lower: Vec3::from(aabb.min), upper: Vec3::from(aabb.max) }
}
