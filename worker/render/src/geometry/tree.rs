//! Triangles under their tree, and the two walks of rays through it.

use equilux_common::ray::Ray;
use glam::Vec3;
use obvhs::BvhBuildParams;

use super::Bounds;
use super::block::{Block, BlockWords, Lane, LeafTriangle, lay_blocks, primitives};
use super::hierarchy::{Hierarchy, InvalidTree, Node, Visits};
use super::lanes::Lanes;
use super::table::Table;
use super::thick_ray::ThickRay;
use super::triangle::Probe;

/// How trees are built that are built for the job at hand: with care, for all its rays walk through
/// them.
pub(super) const CAREFUL: BvhBuildParams = BvhBuildParams::medium_build();

/// A ray on its way through a tree: it sees triangles in the coordinates that they have there, or
/// from those of the world.
pub(super) trait Frame {
    /// The id of a triangle.
    fn primitive(&self, local: u32) -> u32;

    /// Which triangles of a block the ray may hit at `farthest` or nearer, as a bit for each.
    fn candidates<L: Lanes>(
        &self,
        lanes: L,
        ray: &ThickRay,
        block: &Block<'_>,
        farthest: f32,
    ) -> u32;

    /// [`Probe::distance`] of a triangle that is a candidate.
    fn distance(&self, corners: &[Vec3; 3], farthest: f32) -> Option<f32>;
}

/// A ray in a tree that has the coordinates of the world.
pub(super) struct World<'a>(pub(super) &'a Probe);

impl Frame for World<'_> {
    #[inline(always)]
    fn primitive(&self, local: u32) -> u32 {
        local
    }

    #[inline(always)]
    fn candidates<L: Lanes>(
        &self,
        lanes: L,
        _ray: &ThickRay,
        block: &Block<'_>,
        _farthest: f32,
    ) -> u32 {
        self.0.passes_through(lanes, block)
    }

    #[inline(always)]
    fn distance(&self, corners: &[Vec3; 3], farthest: f32) -> Option<f32> {
        self.0.distance_of_passed(corners, (0.0, f32::INFINITY), farthest)
    }
}

/// A tree of boxes over triangles.
#[derive(Debug, Default)]
pub(super) struct Tree {
    hierarchy: Hierarchy,
    /// In the order of the leaves.
    triangles: Table<BlockWords>,
}

/// A triangle under a tree that has been hit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    /// By the order of the leaves.
    pub(super) triangle: u32,
    pub(super) lane: Lane,
}

impl Block<'_> {
    /// Improves the ray's closest hit, if one of the candidates does; says which. The block begins
    /// with the tree's triangle `first`.
    #[inline(always)]
    pub(super) fn closest(
        &self,
        frame: &impl Frame,
        first: usize,
        mut candidates: u32,
        ray: &mut Ray,
    ) -> Option<Hit> {
        let mut hit = None;
        while candidates != 0 {
            let lane = candidates.trailing_zeros() as usize;
            candidates &= candidates - 1;
            let Some(distance) = frame.distance(&self.corners(lane), ray.distance) else {
                continue;
            };
            let primitive = frame.primitive(self.primitives()[lane]);
            // Never farther; of equally near ones, the one with the least id.
            if distance < ray.distance || primitive < ray.hit_primitive {
                (ray.distance, ray.hit_primitive) = (distance, primitive);
                hit = Some(lane);
            }
        }
        #[expect(clippy::cast_possible_truncation, reason = "a tree has less than 2³² triangles")]
        hit.map(|lane| Hit { triangle: (first + lane) as u32, lane: Lane::new(lane, self.len()) })
    }

    /// Whether any of the candidates but `ray.hit_primitive` is nearer than `ray.distance`.
    #[inline(always)]
    pub(super) fn has_nearer(&self, frame: &impl Frame, mut candidates: u32, ray: &Ray) -> bool {
        while candidates != 0 {
            let lane = candidates.trailing_zeros() as usize;
            candidates &= candidates - 1;
            if frame.primitive(self.primitives()[lane]) == ray.hit_primitive {
                continue;
            }
            let distance = frame.distance(&self.corners(lane), ray.distance);
            if distance.is_some_and(|distance| distance < ray.distance) {
                return true;
            }
        }
        false
    }
}

impl Tree {
    /// Builds a tree; also gives the order of its slots, as positions in `triangles`.
    pub(super) fn build(triangles: &[LeafTriangle], quality: BvhBuildParams) -> (Self, Vec<u32>) {
        let bounds = triangles.iter().map(|triangle| Bounds::around(triangle.corners));
        let (hierarchy, order) = Hierarchy::build(bounds, quality);
        let mut blocks = Vec::new();
        lay_blocks(hierarchy.leaves(), triangles, &order, &mut blocks);
        (Self { hierarchy, triangles: blocks.into() }, order)
    }

    /// The tree of these nodes over these triangles.
    pub(super) fn from_parts(
        nodes: Table<Node>,
        triangles: Table<BlockWords>,
    ) -> Result<Self, InvalidTree> {
        Ok(Self { hierarchy: Hierarchy::from_nodes(nodes, triangles.len())?, triangles })
    }

    pub(super) const fn hierarchy(&self) -> &Hierarchy {
        &self.hierarchy
    }

    /// The triangles by their slots.
    pub(super) const fn triangles(&self) -> &Table<BlockWords> {
        &self.triangles
    }

    pub(super) fn len(&self) -> usize {
        self.triangles.len()
    }

    /// The ids of all triangles.
    pub(super) fn primitives(&self) -> impl Iterator<Item = u32> {
        primitives(&self.hierarchy, &self.triangles)
    }

    /// The box around all triangles.
    pub(super) fn bounds(&self) -> Bounds {
        self.hierarchy.bounds()
    }

    /// Improves the ray's closest hit, if it can; says which triangle that is.
    #[inline(always)]
    pub(super) fn closest<L: Lanes>(
        &self,
        lanes: L,
        (frame, thick): (&impl Frame, &ThickRay),
        ray: &mut Ray,
        visits: &mut Visits,
    ) -> Option<Hit> {
        let mut found = None;
        let triangles: &[BlockWords] = &self.triangles;
        let mut walk = self.hierarchy.walk(lanes, thick, visits);
        while let Some(leaf) = walk.next_leaf(ray.distance) {
            let first = leaf.start;
            let block = Block::new(triangles, leaf);
            let candidates = frame.candidates(lanes, thick, &block, ray.distance);
            if let Some(hit) = block.closest(frame, first, candidates, ray) {
                found = Some(hit);
            }
        }
        found
    }

    /// Whether any triangle but `ray.hit_primitive` is nearer than `ray.distance`.
    #[inline(always)]
    pub(super) fn is_occluded<L: Lanes>(
        &self,
        lanes: L,
        (frame, thick): (&impl Frame, &ThickRay),
        ray: &Ray,
        visits: &mut Visits,
    ) -> bool {
        let triangles: &[BlockWords] = &self.triangles;
        let mut walk = self.hierarchy.walk_unordered(lanes, (thick, ray.distance), visits);
        while let Some(leaf) = walk.next_leaf() {
            let block = Block::new(triangles, leaf);
            let candidates = frame.candidates(lanes, thick, &block, ray.distance);
            if block.has_nearer(frame, candidates, ray) {
                return true;
            }
        }
        false
    }
}
