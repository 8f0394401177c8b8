//! Triangles under their tree, and the two walks of rays through it.

use bytemuck::{Pod, Zeroable};
use equilux_common::ray::Ray;
use glam::Vec3;
use obvhs::BvhBuildParams;

use super::Bounds;
use super::hierarchy::{Hierarchy, InvalidTree, Node, Stack};
use super::table::Table;
use super::triangle::Probe;

/// How trees are built that are built for the job at hand: with care, for all its rays walk through
/// them.
pub(super) const CAREFUL: BvhBuildParams =
    BvhBuildParams { max_prims_per_leaf: 4, ..BvhBuildParams::medium_build() };

/// How trees of partitions are built, where building is what takes the time: a narrower search for
/// what to join, and fewer nodes put elsewhere afterwards.
pub(super) const SWIFT: BvhBuildParams =
    BvhBuildParams { max_prims_per_leaf: 4, ..BvhBuildParams::fast_build() };

/// A triangle where the walk needs it: beside its neighbors in the leaf.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct LeafTriangle {
    pub(super) corners: [Vec3; 3],
    pub(super) primitive: u32,
}

/// The position of a triangle in its tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slot(pub(super) u32);

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

    /// Improves the ray's closest hit, if it can; says where that is.
    pub(super) fn closest(&self, probe: &Probe, ray: &mut Ray, stack: &mut Stack) -> Option<Slot> {
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

    fn find_closest<const AXIS: usize>(
        &self,
        probe: &Probe,
        ray: &mut Ray,
        stack: &mut Stack,
    ) -> Option<Slot> {
        let mut found = None;
        let triangles: &[LeafTriangle] = &self.triangles;
        let mut walk = self.hierarchy.walk(&probe.slab, stack);
        while let Some(leaf) = walk.next_leaf(ray.distance) {
            for (slot, triangle) in (leaf.start..).zip(&triangles[leaf]) {
                let Some(distance) = probe.distance::<AXIS>(&triangle.corners, ray.distance) else {
                    continue;
                };
                // Never farther; of equally near ones, the one with the least id.
                if distance < ray.distance || triangle.primitive < ray.hit_primitive {
                    (ray.distance, ray.hit_primitive) = (distance, triangle.primitive);
                    found = Some(slot);
                }
            }
        }
        #[expect(clippy::cast_possible_truncation, reason = "a tree has less than 2³² triangles")]
        found.map(|slot| Slot(slot as u32))
    }

    fn find_any<const AXIS: usize>(&self, probe: &Probe, ray: &Ray, stack: &mut Stack) -> bool {
        let triangles: &[LeafTriangle] = &self.triangles;
        let mut walk = self.hierarchy.walk(&probe.slab, stack);
        while let Some(leaf) = walk.next_leaf(ray.distance) {
            let is_hit = triangles[leaf].iter().any(|triangle| {
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
