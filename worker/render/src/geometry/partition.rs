//! A part of the model with its own tree: what can be sent, stored and dropped as one.

mod builder;
mod sections;

use equilux_common::ray::{NO_PRIMITIVE, Ray};
use equilux_common::scene::NO_INDEX;
use glam::Vec3;

pub use self::builder::PartitionBuilder;
pub use self::sections::{InvalidPartition, ModelLimits, SECTION_COUNT};
use super::Bounds;
use super::hierarchy::Stack;
use super::surface_point::SurfacePoint;
use super::table::Table;
use super::tree::{Slot, Tree};
use super::triangle::Probe;

/// A part of the model with its own tree.
#[derive(Debug)]
pub struct Partition {
    tree: Tree,
    attributes: Attributes,
    /// Bounds of the whole model, by which the thickness of rays is measured.
    model_bounds: Bounds,
}

/// What shading needs to know of triangles beside their corners.
#[derive(Debug)]
struct Attributes {
    /// Each triangle's material, by slot.
    materials: Table<u32>,
    /// Each triangle's shading normals, by slot, into `normal_table`, or [`NO_INDEX`] thrice; empty
    /// if none has any.
    normals: Table<[u32; 3]>,
    /// Likewise for texture coordinates.
    texcoords: Table<[u32; 3]>,
    normal_table: Table<[f32; 3]>,
    texcoord_table: Table<[f32; 2]>,
}

impl Partition {
    /// How many triangles there are.
    #[must_use]
    pub fn triangle_count(&self) -> usize {
        self.tree.len()
    }

    /// Bytes of memory that it takes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.sections().iter().map(|section| section.len()).sum()
    }

    /// Boxes that hold all triangles, and little else: at most `most`, at least one if there are
    /// triangles.
    #[must_use]
    pub fn boxes(&self, most: usize) -> Vec<Bounds> {
        self.tree.hierarchy().boxes(most)
    }

    /// Improves the ray's closest hit so far (`distance`, `hit_primitive`) by what is found here,
    /// if anything is.
    pub fn intersect(&self, ray: &mut Ray, stack: &mut Stack) -> Option<Slot> {
        self.intersect_probed(&self.probe(ray), ray, stack)
    }

    /// [`Self::intersect`] for a ray that has been made ready.
    pub(crate) fn intersect_probed(
        &self,
        probe: &Probe,
        ray: &mut Ray,
        stack: &mut Stack,
    ) -> Option<Slot> {
        self.tree.closest(probe, ray, stack)
    }

    /// Whether anything lies nearer than the shadow ray's `distance`, apart from the light that it
    /// goes to (`hit_primitive`).
    #[must_use]
    pub fn is_occluded(&self, ray: &Ray, stack: &mut Stack) -> bool {
        self.is_occluded_probed(&self.probe(ray), ray, stack)
    }

    /// [`Self::is_occluded`] for a ray that has been made ready.
    pub(crate) fn is_occluded_probed(&self, probe: &Probe, ray: &Ray, stack: &mut Stack) -> bool {
        self.tree.is_occluded(probe, ray, stack)
    }

    /// Where the triangle is that the ray has hit; nothing if it has hit none that is here.
    #[must_use]
    pub fn locate(&self, ray: &Ray, stack: &mut Stack) -> Option<Slot> {
        let mut again = Ray { hit_primitive: NO_PRIMITIVE, ..*ray };
        let slot = self.intersect(&mut again, stack)?;
        (again.hit_primitive == ray.hit_primitive).then_some(slot)
    }

    /// The material of a triangle.
    #[must_use]
    pub fn material(&self, Slot(slot): Slot) -> u32 {
        self.attributes.materials[slot as usize]
    }

    /// What is known of the surface where the ray has hit a triangle; nothing if the ray lies in
    /// the triangle's plane.
    #[must_use]
    pub fn surface_point(&self, ray: &Ray, Slot(slot): Slot) -> Option<SurfacePoint> {
        let slot = slot as usize;
        let corners = &self.tree.triangles()[slot].corners;
        let weights = self.probe(ray).barycentrics(corners)?;
        let mut point = SurfacePoint::new(corners, weights, Vec3::from(ray.direction));
        let Attributes { normals, texcoords, normal_table, texcoord_table, .. } = &self.attributes;
        let normals = indices(normals, slot)
            .map(|indices| indices.map(|index| Vec3::from(normal_table[index as usize])));
        let texcoords = indices(texcoords, slot)
            .map(|indices| indices.map(|index| texcoord_table[index as usize]));
        point.set_attributes(weights, normals, texcoords);
        Some(point)
    }

    fn probe(&self, ray: &Ray) -> Probe {
        Probe::new(ray, &self.model_bounds)
    }
}

/// A triangle's indices, if it has any.
fn indices(table: &[[u32; 3]], slot: usize) -> Option<[u32; 3]> {
    table.get(slot).copied().filter(|indices| indices[0] != NO_INDEX)
}
