//! The one triangle test: watertight, and exact in what it decides.
//!
//! *Whether the ray passes through the triangle* is asked as Woop, Benthin and Wald do
//! (*Watertight Ray/Triangle Intersection*, JCGT 2(1), 2013). The triangle is moved and sheared so
//! that the ray becomes the z axis; each corner's place in the plane then depends on the corner
//! and the ray alone, so triangles that share an edge see the same edge. The sign of an edge
//! function f·g − h·k tells on which side of the edge the axis passes. Rounding a product is
//! monotone, so in single precision the sign is right whenever the difference is not zero; if it
//! is, it is found again in double precision, where such products are exact.
//!
//! *Where* is then asked in double precision, of the triangle's plane, and answered only if the
//! plane is certainly ahead: the numerator n·(v₀ − o) and the denominator n·d must exceed the
//! bounds on their rounding errors. So a huge triangle does not lose what lies close before it,
//! and a ray that starts a few ulps above a surface does not hit it.

use bytemuck::{Pod, Zeroable};
use equilux_common::ray::Ray;
use glam::{DVec3, Vec3};

use super::Bounds;
use super::block::Block;
use super::lanes::Lanes;
use super::slab::{Slab, greater, lesser};

/// Bound on the relative error of n·x in double precision, where n is a cross product of
/// differences: 6 roundings (Higham's γ₆ is below 7 · 2⁻⁵³), with slack.
const PRODUCT_ERROR: f64 = 1.0 / 562_949_953_421_312.0;

/// A ray made ready for tests against boxes and triangles.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Probe {
    pub(super) origin: Vec3,
    pub(super) direction: Vec3,
    /// Shear in x and y that turns the direction into the z axis.
    shear: [f32; 2],
    pub(super) slab: Slab,
    /// The axes that become x, y and z; the last is that of the direction's largest component.
    axes: [u32; 3],
    unused: u32,
}

impl Probe {
    /// The ray in a model within `bounds`.
    #[inline(always)]
    pub(crate) fn new(ray: &Ray, bounds: &Bounds) -> Self {
        let (origin, direction) = (Vec3::from(ray.origin), Vec3::from(ray.direction));
        let axis = largest_axis(direction);
        let shear = [
            direction[(axis + 1) % 3] / direction[axis],
            direction[(axis + 2) % 3] / direction[axis],
        ];
        let slab = Slab::new(origin, direction, bounds);
        let axes = [(axis + 1) % 3, (axis + 2) % 3, axis].map(|axis| axis as u32);
        Self { origin, direction, shear, slab, axes, unused: 0 }
    }

    #[inline(always)]
    fn axes(&self) -> [usize; 3] {
        let [x, y, z] = self.axes;
        [x as usize, y as usize, z as usize]
    }

    /// The distance at which the ray hits the triangle, if that counts as a hit and is at most
    /// `farthest`. Hits only count within the interval from `nearest` to `last`, too.
    #[inline]
    pub(super) fn distance(
        &self,
        corners: &[Vec3; 3],
        (nearest, last): (f32, f32),
        farthest: f32,
    ) -> Option<f32> {
        let (x, y) = self.sheared(corners);
        let edges = edge_functions(x, y);
        let is_beside = edges.min_element() < 0.0 && edges.max_element() > 0.0;
        let passes = !is_beside && (edges.cmpne(Vec3::ZERO).all() || passes_through_exactly(x, y));
        if !passes {
            return None;
        }
        self.distance_of_passed(corners, (nearest, last), farthest)
    }

    /// [`Self::distance`] of a triangle that the ray is known to pass through.
    #[inline(always)]
    pub(super) fn distance_of_passed(
        &self,
        corners: &[Vec3; 3],
        (nearest, last): (f32, f32),
        farthest: f32,
    ) -> Option<f32> {
        let (near, far) = self.slab.interval_around(corners);
        let (near, far) = (greater(near, nearest), lesser(far, last));
        if !(near <= far && near <= farthest) {
            return None;
        }
        let distance = greater(lesser(self.distance_of_plane(corners)?, far), near);
        (distance <= farthest).then_some(distance)
    }

    /// Which triangles of a block the ray passes through, as a bit for each: the same as
    /// [`Self::distance`] asks, to the bit.
    #[inline(always)]
    pub(super) fn passes_through<L: Lanes>(&self, lanes: L, block: &Block<'_>) -> u32 {
        let [a, b, c] = [
            self.sheared_lanes(lanes, block, 0),
            self.sheared_lanes(lanes, block, 1),
            self.sheared_lanes(lanes, block, 2),
        ];
        let (u, v, w) = (edges(lanes, c, b), edges(lanes, a, c), edges(lanes, b, a));
        let zero = lanes.splat(0.0);
        let is_below = lanes.less(lanes.min(u, lanes.min(v, w)), zero);
        let is_above = lanes.less(zero, lanes.max(u, lanes.max(v, w)));
        let mut passed = !(is_below & is_above) & ((1 << block.len()) - 1);
        if passed != 0 {
            let on_edge = lanes.equal(u, zero) | lanes.equal(v, zero) | lanes.equal(w, zero);
            let mut doubtful = passed & on_edge;
            while doubtful != 0 {
                let lane = doubtful.trailing_zeros();
                doubtful &= doubtful - 1;
                let (x, y) = self.sheared(&block.corners(lane as usize));
                passed &= !(u32::from(!passes_through_exactly(x, y)) << lane);
            }
        }
        passed
    }

    /// Where a corner of each triangle is in the plane across the ray.
    #[inline(always)]
    fn sheared_lanes<L: Lanes>(
        &self,
        lanes: L,
        block: &Block<'_>,
        corner: usize,
    ) -> (L::Floats, L::Floats) {
        let [kx, ky, kz] = self.axes();
        let z = self.moved_lanes(lanes, block, (corner, kz));
        let (across_x, across_y) = (lanes.splat(self.shear[0]), lanes.splat(self.shear[1]));
        let x = self.moved_lanes(lanes, block, (corner, kx));
        let y = self.moved_lanes(lanes, block, (corner, ky));
        (lanes.sub(x, lanes.mul(across_x, z)), lanes.sub(y, lanes.mul(across_y, z)))
    }

    /// A coordinate of a corner of each triangle, seen from the ray's origin.
    #[inline(always)]
    fn moved_lanes<L: Lanes>(
        &self,
        lanes: L,
        block: &Block<'_>,
        (corner, axis): (usize, usize),
    ) -> L::Floats {
        let coordinates = lanes.load_some(block.coordinates(corner, axis));
        lanes.sub(coordinates, lanes.splat(self.origin[axis]))
    }

    /// Barycentric coordinates of the point of the triangle where the ray meets it; nothing if the
    /// ray lies in the triangle's plane. Never negative, and 1 in sum up to rounding.
    pub(super) fn barycentrics(&self, corners: &[Vec3; 3]) -> Option<DVec3> {
        let [kx, ky, kz] = self.axes();
        let direction = self.direction.as_dvec3();
        let [a, b, c] = corners.map(|corner| corner.as_dvec3() - self.origin.as_dvec3());
        let z = DVec3::new(a[kz], b[kz], c[kz]) / direction[kz];
        let x = DVec3::new(a[kx], b[kx], c[kx]) - direction[kx] * z;
        let y = DVec3::new(a[ky], b[ky], c[ky]) - direction[ky] * z;
        let edges = edge_functions_in_double(x, y);
        let weights = (edges * edges.element_sum().signum()).max(DVec3::ZERO);
        let weights = weights / weights.element_sum();
        weights.is_finite().then_some(weights)
    }

    /// Where corners are in the plane across the ray.
    #[inline]
    fn sheared(&self, corners: &[Vec3; 3]) -> (Vec3, Vec3) {
        let [a, b, c] = corners.map(|corner| (corner - self.origin).to_array());
        let [kx, ky, kz] = self.axes();
        let z = Vec3::new(a[kz], b[kz], c[kz]);
        let x = Vec3::new(a[kx], b[kx], c[kx]) - self.shear[0] * z;
        let y = Vec3::new(a[ky], b[ky], c[ky]) - self.shear[1] * z;
        (x, y)
    }

    #[inline(always)]
    fn distance_of_plane(&self, corners: &[Vec3; 3]) -> Option<f32> {
        let (a, b, c) = (corners[0].as_dvec3(), corners[1].as_dvec3(), corners[2].as_dvec3());
        let (e, f) = (b - a, c - a);
        let normal = e.cross(f);
        let size = cross_magnitude(e.abs(), f.abs());
        let (to_plane, direction) = (a - self.origin.as_dvec3(), self.direction.as_dvec3());
        let (numerator, denominator) = (normal.dot(to_plane), normal.dot(direction));
        let is_certain = numerator.abs() > PRODUCT_ERROR * size.dot(to_plane.abs())
            && denominator.abs() > PRODUCT_ERROR * size.dot(direction.abs());
        let distance = numerator / denominator;
        (is_certain && distance > 0.0).then_some(distance as f32)
    }
}

#[inline(always)]
fn largest_axis(direction: Vec3) -> usize {
    let size = direction.abs();
    if size.x >= size.y && size.x >= size.z {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    }
}

/// The same question where an edge function came out as zero.
#[cold]
#[inline(never)]
fn passes_through_exactly(x: Vec3, y: Vec3) -> bool {
    let edges = edge_functions_in_double(x.as_dvec3(), y.as_dvec3());
    !(edges.min_element() < 0.0 && edges.max_element() > 0.0)
}

/// [`edge_functions`] of the edges between two corners of each triangle.
#[inline(always)]
fn edges<L: Lanes>(
    lanes: L,
    (from_x, from_y): (L::Floats, L::Floats),
    (to_x, to_y): (L::Floats, L::Floats),
) -> L::Floats {
    lanes.sub(lanes.mul(from_x, to_y), lanes.mul(from_y, to_x))
}

/// Twice the signed areas between the axis and the edges opposite to each corner, rounded.
#[inline]
fn edge_functions(x: Vec3, y: Vec3) -> Vec3 {
    Vec3::new(x.z * y.y - y.z * x.y, x.x * y.z - y.x * x.z, x.y * y.x - y.y * x.x)
}

/// Twice the signed areas between the axis and the edges opposite to each corner.
fn edge_functions_in_double(x: DVec3, y: DVec3) -> DVec3 {
    DVec3::new(x.z * y.y - y.z * x.y, x.x * y.z - y.x * x.z, x.y * y.x - y.y * x.x)
}

/// The cross product with its differences turned into sums: what rounding errors scale with.
#[inline(always)]
fn cross_magnitude(e: DVec3, f: DVec3) -> DVec3 {
    DVec3::new(e.y * f.z + e.z * f.y, e.z * f.x + e.x * f.z, e.x * f.y + e.y * f.x)
}
