//! What is known of the surface at a hit, and where rays that leave it may start.
//!
//! The point is found in double precision as a mean of the corners, so it lies on the triangle up
//! to a rounding to single precision; how far off it may be goes with it. A ray that leaves starts
//! so far along the normal that it is certainly on the side it goes to (pbrt-v4, section 6.8.6).

use glam::{DVec3, Vec2, Vec3};

/// Rounding to single precision, relative: half an ulp, with slack.
const POINT_ERROR: f32 = 1.25 / 16_777_216.0;

/// Rounding in the mean of the corners and in the triangle test, relative to the corners: 2⁻⁴⁶.
const CORNER_ERROR: f32 = 1.0 / 70_368_744_177_664.0;

/// Shortest mean of unit normals that still is a direction.
const NORMAL_LENGTH_MIN: f32 = 1e-4;

/// A point on a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// The point.
    pub point: Vec3,
    /// Bound on its error, per axis.
    pub error: Vec3,
    /// The triangle's unit normal, on the side from which its corners run counter-clockwise.
    pub face_normal: Vec3,
    /// The unit normal that shading takes, on the same side.
    pub shading_normal: Vec3,
    /// Texture coordinates; zero where there are none.
    pub uv: [f32; 2],
}

impl SurfacePoint {
    /// The point of a triangle with barycentric coordinates `weights`, met by a ray of `direction`.
    pub(super) fn new(corners: &[Vec3; 3], weights: DVec3, direction: Vec3) -> Self {
        let [a, b, c] = corners.map(Vec3::as_dvec3);
        let point = (a * weights.x + b * weights.y + c * weights.z).as_vec3();
        let size = corners[0].abs().max(corners[1].abs()).max(corners[2].abs());
        let error = point.abs() * POINT_ERROR + Vec3::splat(size.max_element() * CORNER_ERROR);
        let normal = (b - a).cross(c - a).normalize_or_zero().as_vec3();
        // A triangle without area has no side; any normal does that keeps rays going.
        let face_normal = if normal == Vec3::ZERO { -direction } else { normal };
        Self { point, error, face_normal, shading_normal: face_normal, uv: [0.0; 2] }
    }

    /// Adds what the corners carry.
    pub(super) fn set_attributes(
        &mut self,
        weights: DVec3,
        normals: Option<[Vec3; 3]>,
        texcoords: Option<[[f32; 2]; 3]>,
    ) {
        let weights = weights.as_vec3();
        if let Some([a, b, c]) = normals {
            let mean = a * weights.x + b * weights.y + c * weights.z;
            if mean.length() > NORMAL_LENGTH_MIN {
                let normal = mean.normalize();
                self.shading_normal =
                    if normal.dot(self.face_normal) < 0.0 { -normal } else { normal };
            }
        }
        if let Some(texcoords) = texcoords {
            let [a, b, c] = texcoords.map(Vec2::from);
            self.uv = (a * weights.x + b * weights.y + c * weights.z).into();
        }
    }

    /// Where a ray starts that leaves in `direction`.
    #[must_use]
    pub fn leave(&self, direction: Vec3) -> Vec3 {
        leave(self.point, self.error, self.face_normal, direction)
    }
}

/// Where a ray starts that leaves the surface at `point`, known within `error`, toward the side of
/// `normal` that `direction` is on.
#[must_use]
pub fn leave(point: Vec3, error: Vec3, normal: Vec3, direction: Vec3) -> Vec3 {
    let distance = normal.abs().dot(error);
    let offset = if direction.dot(normal) < 0.0 { -normal * distance } else { normal * distance };
    Vec3::from([0, 1, 2].map(|axis| {
        let moved = point[axis] + offset[axis];
        if offset[axis] > 0.0 {
            moved.next_up()
        } else if offset[axis] < 0.0 {
            moved.next_down()
        } else {
            moved
        }
    }))
}
