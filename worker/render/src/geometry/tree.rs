//! Triangles under their tree, and the two walks of rays through it.

use bytemuck::{Pod, Zeroable};
use equilux_common::ray::Ray;
use glam::Vec3;
use obvhs::BvhBuildParams;

use super::Bounds;
use super::hierarchy::{Hierarchy, InvalidTree, Node, Visits};
use super::slab::Slab;
use super::table::Table;
use super::triangle::Probe;

/// How trees are built that are built for the job at hand: with care, for all its rays walk through
/// them.
pub(super) const CAREFUL: BvhBuildParams =
    BvhBuildParams { max_prims_per_leaf: 4, ..BvhBuildParams::medium_build() };

/// A triangle where the walk needs it: beside its neighbors in the leaf.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct LeafTriangle {
    pub(super) corners: [Vec3; 3],
    pub(super) primitive: u32,
}

/// How a ray sees the triangles of a tree: in the coordinates that they have there, or from those
/// of the world.
pub(super) trait Frame {
    /// The ray as the tree's boxes see it.
    fn slab(&self) -> &Slab;

    /// The id of a triangle.
    fn primitive(&self, local: u32) -> u32;

    /// [`Probe::distance`] of a triangle.
    fn distance<const AXIS: usize>(
        &self,
        probe: &Probe,
        corners: &[Vec3; 3],
        farthest: f32,
    ) -> Option<f32>;
}

/// A tree in the coordinates of the world.
pub(super) struct World<'a>(pub(super) &'a Slab);

impl Frame for World<'_> {
    #[inline]
    fn slab(&self) -> &Slab {
        self.0
    }

    #[inline]
    fn primitive(&self, local: u32) -> u32 {
        local
    }

    #[inline]
    fn distance<const AXIS: usize>(
        &self,
        probe: &Probe,
        corners: &[Vec3; 3],
        farthest: f32,
    ) -> Option<f32> {
        probe.distance::<AXIS>(corners, farthest)
    }
}

/// A binary tree of boxes over triangles.
#[derive(Debug, Default)]
pub(super) struct Tree {
    hierarchy: Hierarchy,
    /// In the order of the leaves.
    triangles: Table<LeafTriangle>,
}

impl Tree {
    /// Builds a tree; also gives the order of its slots, as positions in `triangles`.
    pub(super) fn build(triangles: &[LeafTriangle], quality: BvhBuildParams) -> (Self, Vec<u32>) {
        let bounds = triangles.iter().map(|triangle| Bounds::around(triangle.corners));
        let (hierarchy, order) = Hierarchy::build(bounds, quality);
        let triangles: Vec<_> = order.iter().map(|&index| triangles[index as usize]).collect();
        (Self { hierarchy, triangles: triangles.into() }, order)
    }

    /// The tree of these nodes over these triangles.
    pub(super) fn from_parts(
        nodes: Table<Node>,
        triangles: Table<LeafTriangle>,
    ) -> Result<Self, InvalidTree> {
        Ok(Self { hierarchy: Hierarchy::from_nodes(nodes, triangles.len())?, triangles })
    }

    pub(super) const fn hierarchy(&self) -> &Hierarchy {
        &self.hierarchy
    }

    /// The triangles by their slots.
    pub(super) const fn triangles(&self) -> &Table<LeafTriangle> {
        &self.triangles
    }

    pub(super) fn len(&self) -> usize {
        self.triangles.len()
    }

    /// The box around all triangles.
    pub(super) fn bounds(&self) -> Bounds {
        self.hierarchy.bounds()
    }

    /// Improves the ray's closest hit, if it can; says which triangle that is, by the order of the
    /// leaves.
    pub(super) fn closest(
        &self,
        probe: &Probe,
        frame: &impl Frame,
        ray: &mut Ray,
        visits: &mut Visits,
    ) -> Option<u32> {
        match probe.axis {
            0 => self.find_closest::<0>(probe, frame, ray, visits),
            1 => self.find_closest::<1>(probe, frame, ray, visits),
            _ => self.find_closest::<2>(probe, frame, ray, visits),
        }
    }

    /// Whether any triangle but `ray.hit_primitive` is nearer than `ray.distance`.
    pub(super) fn is_occluded(
        &self,
        probe: &Probe,
        frame: &impl Frame,
        ray: &Ray,
        visits: &mut Visits,
    ) -> bool {
        match probe.axis {
            0 => self.find_any::<0>(probe, frame, ray, visits),
            1 => self.find_any::<1>(probe, frame, ray, visits),
            _ => self.find_any::<2>(probe, frame, ray, visits),
        }
    }

    fn find_closest<const AXIS: usize>(
        &self,
        probe: &Probe,
        frame: &impl Frame,
        ray: &mut Ray,
        visits: &mut Visits,
    ) -> Option<u32> {
        let mut found = None;
        let triangles: &[LeafTriangle] = &self.triangles;
        let mut walk = self.hierarchy.walk(frame.slab(), visits);
        while let Some(leaf) = walk.next_leaf(ray.distance) {
            for (slot, triangle) in (leaf.start..).zip(&triangles[leaf]) {
                let corners = &triangle.corners;
                let Some(distance) = frame.distance::<AXIS>(probe, corners, ray.distance) else {
                    continue;
                };
                let primitive = frame.primitive(triangle.primitive);
                // Never farther; of equally near ones, the one with the least id.
                if distance < ray.distance || primitive < ray.hit_primitive {
                    (ray.distance, ray.hit_primitive) = (distance, primitive);
                    found = Some(slot);
                }
            }
        }
        #[expect(clippy::cast_possible_truncation, reason = "a tree has less than 2³² triangles")]
        found.map(|slot| slot as u32)
    }

    fn find_any<const AXIS: usize>(
        &self,
        probe: &Probe,
        frame: &impl Frame,
        ray: &Ray,
        visits: &mut Visits,
    ) -> bool {
        let triangles: &[LeafTriangle] = &self.triangles;
        let mut walk = self.hierarchy.walk(frame.slab(), visits);
        while let Some(leaf) = walk.next_leaf(ray.distance) {
            let is_hit = triangles[leaf].iter().any(|triangle| {
                frame.primitive(triangle.primitive) != ray.hit_primitive
                    && frame
                        .distance::<AXIS>(probe, &triangle.corners, ray.distance)
                        .is_some_and(|distance| distance < ray.distance)
            });
            if is_hit {
                return true;
            }
        }
        false
    }
}
