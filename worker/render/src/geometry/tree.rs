//! The tree of boxes over the triangles and the walks through it.
//!
//! `obvhs` builds it (PLOC with reinsertion); it is then laid out anew, two boxes to a cache line.
//! No walk allocates: its stack is the caller's and as deep as the tree.

use std::time::Duration;

use equilux_common::ray::Ray;
use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;

use super::Bounds;
use super::slab::{BoxPair, pack};
use super::triangle::Probe;

/// [`Child::count`] of a child that is a node.
const NODE: u32 = u32::MAX;

/// A child of a node: another node, or a run of leaf triangles.
#[derive(Clone, Copy, Debug, Default)]
struct Child {
    /// Index of the node, or of the first triangle.
    first: u32,
    /// How many triangles; [`NODE`] if it is a node.
    count: u32,
}

/// Two children and the bounds of each.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Node {
    bounds: BoxPair,
    children: [Child; 2],
}

/// A triangle where the walk needs it: beside its neighbors in the leaf.
#[derive(Clone, Copy, Debug)]
struct LeafTriangle {
    corners: [Vec3; 3],
    primitive: u32,
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
    visits: Vec<Visit>,
}

/// A binary tree of boxes.
#[derive(Debug)]
pub(super) struct Tree {
    nodes: Vec<Node>,
    triangles: Vec<LeafTriangle>,
    /// Most children that a walk may have put off at any time.
    depth: usize,
}

impl Tree {
    pub(super) fn new(corners: &[[Vec3; 3]]) -> Self {
        let quality = BvhBuildParams { max_prims_per_leaf: 4, ..BvhBuildParams::medium_build() };
        Self::with_quality(corners, quality)
    }

    pub(super) fn with_quality(corners: &[[Vec3; 3]], quality: BvhBuildParams) -> Self {
        if corners.is_empty() {
            return Self { nodes: Vec::new(), triangles: Vec::new(), depth: 0 };
        }
        let boxes: Vec<Boxed> = corners.iter().map(Boxed::around).collect();
        let built = build_bvh2(&boxes, quality, &mut Duration::default());
        let triangles = built
            .primitive_indices
            .iter()
            .map(|&primitive| LeafTriangle { corners: corners[primitive as usize], primitive })
            .collect();
        let (nodes, depth) = lay_out(&built);
        Self { nodes, triangles, depth }
    }

    /// Bytes of memory that it takes.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice()) + size_of_val(self.triangles.as_slice())
    }

    /// Improves the ray's closest hit.
    pub(super) fn closest(&self, probe: &Probe, ray: &mut Ray, stack: &mut Stack) {
        match probe.axis {
            0 => self.find_closest::<0>(probe, ray, stack),
            1 => self.find_closest::<1>(probe, ray, stack),
            _ => self.find_closest::<2>(probe, ray, stack),
        }
    }

    /// Whether any triangle but `ray.hit_primitive` is nearer than `ray.distance`.
    pub(super) fn is_occluded(&self, probe: &Probe, ray: &Ray, stack: &mut Stack) -> bool {
        match probe.axis {
            0 => self.find_any::<0>(probe, ray, stack),
            1 => self.find_any::<1>(probe, ray, stack),
            _ => self.find_any::<2>(probe, ray, stack),
        }
    }

    fn find_closest<const AXIS: usize>(&self, probe: &Probe, ray: &mut Ray, stack: &mut Stack) {
        let mut walk = Walk::new(self, stack);
        while let Some(triangles) = walk.next_leaf(probe, ray.distance) {
            for triangle in triangles {
                let Some(distance) = probe.distance::<AXIS>(&triangle.corners, ray.distance) else {
                    continue;
                };
                // Never farther; of equally near ones, the one with the least id.
                if distance < ray.distance || triangle.primitive < ray.hit_primitive {
                    (ray.distance, ray.hit_primitive) = (distance, triangle.primitive);
                }
            }
        }
    }

    fn find_any<const AXIS: usize>(&self, probe: &Probe, ray: &Ray, stack: &mut Stack) -> bool {
        let mut walk = Walk::new(self, stack);
        while let Some(triangles) = walk.next_leaf(probe, ray.distance) {
            let is_hit = triangles.iter().any(|triangle| {
                triangle.primitive != ray.hit_primitive
                    && probe
                        .distance::<AXIS>(&triangle.corners, ray.distance)
                        .is_some_and(|distance| distance < ray.distance)
            });
            if is_hit {
                return true;
            }
        }
        false
    }
}

/// A walk through the tree that comes by all leaves that may matter, nearer children first.
struct Walk<'a> {
    tree: &'a Tree,
    visits: &'a mut [Visit],
    /// How many of the visits are still to be made.
    waiting: usize,
    next: Option<Child>,
}

impl<'a> Walk<'a> {
    fn new(tree: &'a Tree, stack: &'a mut Stack) -> Self {
        if stack.visits.len() < tree.depth {
            stack.visits.resize(tree.depth, Visit::default());
        }
        let next = (!tree.nodes.is_empty()).then_some(Child { first: 0, count: NODE });
        Self { tree, visits: &mut stack.visits, waiting: 0, next }
    }

    /// The next leaf whose box the ray meets at `farthest` or nearer.
    #[inline]
    fn next_leaf(&mut self, probe: &Probe, farthest: f32) -> Option<&'a [LeafTriangle]> {
        loop {
            let child = match self.next.take() {
                Some(child) => child,
                None => self.resume(farthest)?,
            };
            let first = child.first as usize;
            if child.count != NODE {
                return Some(&self.tree.triangles[first..first + child.count as usize]);
            }
            self.enter(&self.tree.nodes[first], probe, farthest);
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
    fn enter(&mut self, node: &Node, probe: &Probe, farthest: f32) {
        let (near, far) = probe.slab.intervals(&node.bounds);
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

/// A triangle's bounds, as the builder wants them.
struct Boxed(Aabb);

impl Boxed {
    fn around(corners: &[Vec3; 3]) -> Self {
        let bounds = Bounds::around(*corners);
        Self(Aabb::new(Vec3A::from(bounds.lower), Vec3A::from(bounds.upper)))
    }
}

impl obvhs::Boundable for Boxed {
    fn aabb(&self) -> Aabb {
        self.0
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

fn bounds_of(aabb: &Aabb) -> Bounds {
    Bounds { lower: Vec3::from(aabb.min), upper: Vec3::from(aabb.max) }
}
