//! A tree of boxes over things that have bounds, and the walk through it.
//!
//! `obvhs` builds a binary tree (PLOC with reinsertion); it is then collapsed to one whose nodes
//! have up to eight children ([`collapse`]), for as many boxes are tested at a time. No walk
//! allocates once its stack, which is the caller's, fits the tree.

mod builder;
mod collapse;
mod shared;
mod single;
mod visits;

use std::ops::Range;
use std::time::Duration;

use bytemuck::{Pod, Zeroable};
use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::builder::build_bvh2;

pub(super) use self::builder::HierarchyBuilder;
use self::collapse::Collapse;
pub(super) use self::shared::{Reach, SHARED_RAYS_MAX};
pub(super) use self::visits::Visits;
use super::Bounds;
use super::lanes::Instructions;
use super::ready::Ready;
use super::table::Table;
use super::thick_ray::EightBoxes;

/// Most children of a node, and most things of a leaf.
pub(super) const WIDTH: usize = 8;

/// [`Node::counts`] of a child that is a node.
const NODE: u32 = u32::MAX;

/// A child of a node: another node, or a run of things.
#[derive(Clone, Copy, Debug, Default)]
struct Child {
    /// Index of the node, or of the first thing.
    first: u32,
    /// How many things; [`NODE`] if it is a node.
    count: u32,
}

impl Child {
    /// The run of things that it is, unless it is a node.
    #[inline(always)]
    fn leaf(self) -> Option<Range<usize>> {
        let first = self.first as usize;
        (self.count != NODE).then(|| first..first + self.count as usize)
    }
}

/// Up to eight children and the bounds of each. A child that is a node has a greater index.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub(super) struct Node {
    bounds: EightBoxes,
    /// Of each child, the index of its node or of its first thing.
    firsts: [u32; WIDTH],
    /// How many things it has: [`NODE`] if it is a node, 0 if there is no such child.
    counts: [u32; WIDTH],
}

/// The root as a child.
const ROOT: Child = Child { first: 0, count: NODE };

/// Where a walk keeps what it has yet to visit, and by which instructions it goes. Fits itself to
/// any tree; reuse it.
#[derive(Debug)]
pub struct Stack {
    pub(super) instructions: Instructions,
    visits: Visits,
    /// For walks within steps of another one.
    inner: Visits,
    ready: Ready,
}

impl Default for Stack {
    /// For the instructions that were chosen.
    fn default() -> Self {
        Self::new(Instructions::chosen())
    }
}

impl Stack {
    /// For walks by these instructions.
    #[must_use]
    pub fn new(instructions: Instructions) -> Self {
        Self {
            instructions,
            visits: Visits::default(),
            inner: Visits::default(),
            ready: Ready::default(),
        }
    }

    /// For one walk.
    pub(super) const fn only(&mut self) -> &mut Visits {
        &mut self.visits
    }

    /// For rays that walk together.
    pub(super) const fn together(&mut self) -> (&mut Visits, &mut Ready) {
        (&mut self.visits, &mut self.ready)
    }

    /// For a walk, and for others within its steps.
    pub(super) const fn split(&mut self) -> (&mut Visits, &mut Visits) {
        (&mut self.visits, &mut self.inner)
    }
}

impl Node {
    /// A node without children.
    const fn childless() -> Self {
        let (lower, upper) = ([f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]);
        Self { bounds: [[lower; 3], [upper; 3]], firsts: [0; WIDTH], counts: [0; WIDTH] }
    }

    #[inline(always)]
    fn child(&self, lane: usize) -> Child {
        Child { first: self.firsts[lane], count: self.counts[lane] }
    }

    fn set_child(&mut self, lane: usize, bounds: &Bounds, child: Child) {
        for axis in 0..3 {
            self.bounds[0][axis][lane] = bounds.lower[axis];
            self.bounds[1][axis][lane] = bounds.upper[axis];
        }
        (self.firsts[lane], self.counts[lane]) = (child.first, child.count);
    }

    /// The children that there are, with their bounds.
    fn children(&self) -> impl Iterator<Item = (Bounds, Child)> {
        let bounds = |lane: usize| {
            let [lower, upper] = self.bounds.map(|side| Vec3::from(side.map(|row| row[lane])));
            Bounds { lower, upper }
        };
        let all = (0..WIDTH).map(move |lane| (bounds(lane), self.child(lane)));
        all.filter(|(_, child)| child.count > 0)
    }

    /// Whether children that are not there are nowhere and have nothing, so that it does no harm if
    /// a ray that is no line (its direction is not a number) meets them all the same.
    fn is_sealed(&self) -> bool {
        let is_away = |lane: usize| {
            let bounds = self.bounds.map(|side| side.map(|row| row[lane]));
            bounds == Self::childless().bounds.map(|side| side.map(|row| row[0]))
        };
        (0..WIDTH).all(|lane| self.counts[lane] > 0 || self.firsts[lane] == 0 && is_away(lane))
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
pub struct InvalidTree(pub(super) usize);

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
        let quality = BvhBuildParams { max_prims_per_leaf: 1, ..quality };
        let built = build_bvh2(&boxes, quality, &mut Duration::default());
        drop(boxes);
        let mut collapse = Collapse::default();
        let things = |place: Range<u32>| place.map(|it| built.primitive_indices[it as usize]);
        collapse
            .run(&built.nodes, |node| things(node.first_index..node.first_index + node.prim_count));
        let Collapse { nodes, order, .. } = collapse;
        let depth = depth_of(&nodes, order.len()).expect("children come after their parents");
        (Self { nodes: nodes.into(), depth }, order)
    }

    /// The tree of these nodes over `count` things.
    pub(super) fn from_nodes(nodes: Table<Node>, count: usize) -> Result<Self, InvalidTree> {
        let depth = depth_of(&nodes, count)?;
        Ok(Self { nodes, depth })
    }

    /// Its nodes, as [`Self::from_nodes`] takes them.
    pub(super) const fn nodes(&self) -> &Table<Node> {
        &self.nodes
    }

    /// The runs of things under all leaves.
    pub(super) fn leaves(&self) -> impl Iterator<Item = Range<usize>> {
        leaves(&self.nodes)
    }

    /// The box around all that is in the tree; nothing if that is nothing.
    pub(super) fn bounds(&self) -> Bounds {
        boxes(&self.nodes, 1).first().copied().unwrap_or(Bounds::EMPTY)
    }
}

/// The runs of things under all leaves of the tree of these nodes.
pub(super) fn leaves(nodes: &[Node]) -> impl Iterator<Item = Range<usize>> {
    nodes.iter().flat_map(Node::children).filter_map(|(_, child)| child.leaf())
}

/// Makes sure that nodes are a tree over `count` things; says how many children a walk may have
/// put off at any time.
fn depth_of(nodes: &[Node], count: usize) -> Result<usize, InvalidTree> {
    // Children follow their parents, so going backward it is known of every child how many visits
    // may have been put off below it. It is zero of those that have a parent already.
    let mut visits = vec![1; nodes.len()];
    for (index, node) in nodes.iter().enumerate().rev() {
        let invalid = InvalidTree(index);
        if !node.is_sealed() {
            return Err(invalid);
        }
        let mut most_below = 0;
        for (_, child) in node.children() {
            let first = child.first as usize;
            if child.count != NODE {
                if child.count as usize > WIDTH || first + child.count as usize > count {
                    return Err(invalid);
                }
                continue;
            }
            let below = visits.get(first).copied().unwrap_or(0);
            if first <= index || below == 0 {
                return Err(invalid);
            }
            visits[first] = 0;
            most_below = most_below.max(below);
        }
        // All children are put off, then one of them is gone into.
        visits[index] = most_below + WIDTH;
    }
    Ok(visits.first().copied().unwrap_or(0))
}

/// Boxes that together hold all that is in the tree of these nodes, at most `most` and at least
/// one if there is anything: the largest is opened as long as there is room, then the closest are
/// joined.
pub(super) fn boxes(nodes: &[Node], most: usize) -> Vec<Bounds> {
    let Some(root) = nodes.first() else { return Vec::new() };
    let mut boxes: Vec<(Bounds, Child)> = root.children().collect();
    while boxes.len() < most {
        let closed = (0..boxes.len()).filter(|&index| boxes[index].1.count == NODE);
        let area = |&index: &usize| boxes[index].0.half_area();
        let Some(largest) = closed.max_by(|a, b| area(a).total_cmp(&area(b))) else { break };
        let (_, child) = boxes.swap_remove(largest);
        boxes.extend(nodes[child.first as usize].children());
    }
    let mut boxes: Vec<Bounds> = boxes.into_iter().map(|(bounds, _)| bounds).collect();
    while boxes.len() > most.max(1) {
        join_closest(&mut boxes);
    }
    boxes
}

/// Joins the two boxes whose union has the least surface more than they have.
fn join_closest(boxes: &mut Vec<Bounds>) {
    let pairs = (1..boxes.len()).flat_map(|b| (0..b).map(move |a| (a, b)));
    let growth = |&(a, b): &(usize, usize)| {
        let (a, b) = (&boxes[a], &boxes[b]);
        a.joined(b).half_area() - a.half_area() - b.half_area()
    };
    let closest = pairs.min_by(|x, y| growth(x).total_cmp(&growth(y)));
    if let Some((a, b)) = closest {
        let joined = boxes.swap_remove(b);
        boxes[a] = boxes[a].joined(&joined);
    }
}

fn aabb(bounds: &Bounds) -> Aabb {
    Aabb::new(Vec3A::from(bounds.lower), Vec3A::from(bounds.upper))
}

fn bounds_of(aabb: &Aabb) -> Bounds {
    Bounds { lower: Vec3::from(aabb.min), upper: Vec3::from(aabb.max) }
}
