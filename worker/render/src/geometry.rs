//! The model as rays see it: triangles under a tree of boxes, closest hits, visibility, and what is
//! known of the surface at a hit.
//!
//! Three ideas keep hits exact, whatever the tree:
//!
//! 1. One triangle test ([`triangle`]), watertight on shared edges and vertices.
//! 2. A hit counts only within the interval that the ray spends in the triangle's own box, and its
//!    distance is clamped into it. The interval comes from a chain of monotone operations
//!    ([`slab`]), so the interval of any box around the triangle contains that of the triangle.
//!    A walk through boxes, in any order and of any tree, hence never culls a hit that counts.
//! 3. The closest hit is the least (distance, primitive id), so ties do not depend on the order
//!    either.
//!
//! Uncertainty is the ray's, not the boxes': boxes are the exact bounds of what they hold, and the
//! slab test makes the ray as thick as the triangle test can err.

pub mod surface_point;

mod slab;
mod tree;
mod triangle;

use equilux_common::ray::{NO_PRIMITIVE, Ray};
use equilux_common::scene::{Geometry, NO_INDEX};
use glam::Vec3;

use self::surface_point::SurfacePoint;
pub use self::tree::Stack;
use self::tree::Tree;

/// Largest magnitude of a coordinate in a model: with it, no product in the triangle test leaves
/// the range of single precision.
pub const COORDINATE_MAX: f32 = 1e11;

/// Most triangles in a model: their ids and those of the tree's nodes take 32 bits.
pub const TRIANGLES_MAX: usize = 1 << 30;

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Least coordinates.
    pub lower: Vec3,
    /// Greatest coordinates.
    pub upper: Vec3,
}

impl Bounds {
    /// The box that holds nothing.
    pub const EMPTY: Self = Self { lower: Vec3::INFINITY, upper: Vec3::NEG_INFINITY };

    /// The box around some points.
    #[must_use]
    pub fn around(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, |bounds, point| Self {
            lower: bounds.lower.min(point),
            upper: bounds.upper.max(point),
        })
    }
}

/// A part of the model with its own tree.
#[derive(Debug)]
pub struct Partition {
    geometry: Geometry,
    tree: Tree,
    /// Bounds of the whole model, by which the thickness of rays is measured.
    bounds: Bounds,
}

impl Partition {
    /// Builds the tree over all of `geometry`, whose indices are in range, whose coordinates are
    /// within [`COORDINATE_MAX`], and which has at most [`TRIANGLES_MAX`] triangles.
    #[must_use]
    pub fn new(geometry: Geometry) -> Self {
        let tree = Tree::new(&corners_of_all(&geometry));
        let bounds = Self::bounds_of(&geometry);
        Self { geometry, tree, bounds }
    }

    /// The bounds of a model's vertices; a point at zero if it has none.
    #[must_use]
    pub fn bounds_of(geometry: &Geometry) -> Bounds {
        if geometry.positions.is_empty() {
            return Bounds { lower: Vec3::ZERO, upper: Vec3::ZERO };
        }
        Bounds::around(geometry.positions.iter().copied().map(Vec3::from))
    }

    /// How many triangles there are.
    #[must_use]
    pub const fn triangle_count(&self) -> usize {
        self.geometry.triangles.len()
    }

    /// Bytes of memory that it takes.
    pub(crate) fn bytes(&self) -> usize {
        let Geometry { positions, normals, texcoords, triangles, objects } = &self.geometry;
        let names: usize = objects.iter().map(|object| object.name.len()).sum();
        size_of_val(positions.as_slice())
            + size_of_val(normals.as_slice())
            + size_of_val(texcoords.as_slice())
            + size_of_val(triangles.as_slice())
            + size_of_val(objects.as_slice())
            + names
            + self.tree.bytes()
    }

    /// The material of a triangle.
    #[must_use]
    pub fn material(&self, primitive: u32) -> u32 {
        self.geometry.triangles[primitive as usize].material
    }

    /// Improves the ray's closest hit so far (`distance`, `hit_primitive`) by what is found here.
    pub fn intersect(&self, ray: &mut Ray, stack: &mut Stack) {
        let probe = triangle::Probe::new(ray, &self.bounds);
        self.tree.closest(&probe, ray, stack);
    }

    /// Whether anything lies nearer than the shadow ray's `distance`, apart from the light that it
    /// goes to (`hit_primitive`).
    #[must_use]
    pub fn is_occluded(&self, ray: &Ray, stack: &mut Stack) -> bool {
        self.tree.is_occluded(&triangle::Probe::new(ray, &self.bounds), ray, stack)
    }

    /// What is known of the surface at the ray's closest hit; nothing if there is none.
    #[must_use]
    pub fn surface_point(&self, ray: &Ray) -> Option<SurfacePoint> {
        if ray.hit_primitive == NO_PRIMITIVE {
            return None;
        }
        let triangle = self.geometry.triangles.get(ray.hit_primitive as usize)?;
        let corners = corners(&self.geometry, &triangle.positions);
        let weights = triangle::Probe::new(ray, &self.bounds).barycentrics(&corners)?;
        let normals = (triangle.normals[0] != NO_INDEX).then(|| {
            triangle.normals.map(|index| Vec3::from(self.geometry.normals[index as usize]))
        });
        let texcoords = (triangle.texcoords[0] != NO_INDEX)
            .then(|| triangle.texcoords.map(|index| self.geometry.texcoords[index as usize]));
        let mut point = SurfacePoint::new(&corners, weights, Vec3::from(ray.direction));
        point.set_attributes(weights, normals, texcoords);
        Some(point)
    }
}

fn corners(geometry: &Geometry, indices: &[u32; 3]) -> [Vec3; 3] {
    indices.map(|index| Vec3::from(geometry.positions[index as usize]))
}

fn corners_of_all(geometry: &Geometry) -> Vec<[Vec3; 3]> {
    geometry.triangles.iter().map(|triangle| corners(geometry, &triangle.positions)).collect()
}

#[cfg(test)]
pub(crate) mod tests;
