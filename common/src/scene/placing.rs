//! Where models stand: transforms, and what they do to vertices, normals and boxes.
//!
//! A model that is placed once is moved into the scene when it is read. One that is placed several
//! times stays in its own coordinates, and its corners are moved whenever a ray comes near. Both
//! ask the functions here, so it is the same triangle to the bit.

use bytemuck::{Pod, Zeroable};

/// Largest coordinate: products of four such lengths still fit single precision, with room.
pub const COORDINATE_MAX: f64 = 1e9;

/// Largest product of the greatest entries of a transform and its inverse with which rays are moved
/// into the coordinates of a model: beyond it, rounding would make them too thick.
const CONDITION_MAX: f64 = 1e5;

/// Bound on what rounding in double precision moves a point by, over the magnitudes that are added.
const ROUNDING: f64 = 1e-14;

/// Entries by row.
pub type Matrix = [[f64; 3]; 3];

/// `x ↦ linear · x + translation`, invertible, in double precision.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Transform {
    /// The linear part.
    pub linear: Matrix,
    /// Where the origin comes to lie.
    pub translation: [f64; 3],
}

/// How a model is placed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placing {
    transform: Transform,
    /// What normals are multiplied by.
    normal_matrix: Matrix,
    is_mirroring: bool,
}

impl Transform {
    /// Leaves a model where it is.
    pub const IDENTITY: Self =
        Self { linear: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], translation: [0.0; 3] };

    /// Where a point comes to lie.
    #[must_use]
    #[inline]
    pub fn point(&self, p: [f64; 3]) -> [f64; 3] {
        let turned = apply(&self.linear, p);
        std::array::from_fn(|axis| turned[axis] + self.translation[axis])
    }

    /// Where a vertex comes to lie, rounded to single precision.
    #[must_use]
    #[inline]
    pub fn corner(&self, position: [f32; 3]) -> [f32; 3] {
        self.point(position.map(f64::from)).map(single)
    }

    /// What to multiply normals by: the inverse transpose up to a positive factor, so that unit
    /// length is lost.
    #[must_use]
    pub fn normal_matrix(&self) -> Matrix {
        let sign = if self.is_mirroring() { -1.0 } else { 1.0 };
        self.cofactors().map(|row| row.map(|entry| entry * sign))
    }

    /// Whether left hands become right hands.
    #[must_use]
    pub fn is_mirroring(&self) -> bool {
        self.determinant() < 0.0
    }

    /// How much larger volumes become; negative if it mirrors.
    #[must_use]
    pub fn determinant(&self) -> f64 {
        let cofactors = self.cofactors();
        (0..3).map(|column| self.linear[0][column] * cofactors[0][column]).sum()
    }

    /// The inverse of the linear part.
    #[must_use]
    pub fn inverse(&self) -> Matrix {
        let (cofactors, determinant) = (self.cofactors(), self.determinant());
        std::array::from_fn(|row| {
            std::array::from_fn(|column| cofactors[column][row] / determinant)
        })
    }

    /// Whether rays can be moved into the coordinates of the model: it is not all but flat, and its
    /// inverse fits single precision.
    #[must_use]
    pub fn is_reversible(&self) -> bool {
        let is_sound = |entry: &f64| entry.is_finite() && entry.abs() <= COORDINATE_MAX;
        if !self.linear.as_flattened().iter().chain(&self.translation).all(is_sound) {
            return false;
        }
        let largest = |matrix: &Matrix| {
            matrix.as_flattened().iter().fold(0.0, |most: f64, entry| most.max(entry.abs()))
        };
        let (forth, back) = (largest(&self.linear), largest(&self.inverse()));
        forth * back <= CONDITION_MAX && back <= COORDINATE_MAX
    }

    /// The inverse transpose times the determinant.
    fn cofactors(&self) -> Matrix {
        let m = &self.linear;
        std::array::from_fn(|row| {
            std::array::from_fn(|column| {
                let (r1, r2) = ((row + 1) % 3, (row + 2) % 3);
                let (c1, c2) = ((column + 1) % 3, (column + 2) % 3);
                m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1]
            })
        })
    }
}

impl Placing {
    /// Prepares a transform.
    #[must_use]
    pub fn new(transform: Transform) -> Self {
        let (normal_matrix, is_mirroring) = (transform.normal_matrix(), transform.is_mirroring());
        Self { transform, normal_matrix, is_mirroring }
    }

    /// The transform.
    #[must_use]
    pub const fn transform(&self) -> &Transform {
        &self.transform
    }

    /// Whether positions stay what they are, up to the sign of zeros.
    #[must_use]
    pub fn is_identity(&self) -> bool {
        self.transform == Transform::IDENTITY
    }

    /// Where a vertex comes to lie.
    #[must_use]
    #[inline]
    pub fn corner(&self, position: [f32; 3]) -> [f32; 3] {
        self.transform.corner(position)
    }

    /// Where a vertex comes to lie, if that is a place that can be worked with.
    #[must_use]
    #[inline]
    pub fn position(&self, position: [f32; 3]) -> Option<[f32; 3]> {
        let p = self.transform.point(position.map(f64::from));
        let is_good = p.iter().all(|component| component.abs() <= COORDINATE_MAX);
        is_good.then(|| p.map(single))
    }

    /// Where a normal comes to point, of unit length; none if it points nowhere.
    #[must_use]
    #[inline]
    pub fn normal(&self, normal: [f32; 3]) -> Option<[f32; 3]> {
        let n = apply(&self.normal_matrix, normal.map(f64::from));
        Some(unit(n)?.map(single))
    }

    /// The corners of a triangle in the order in which they turn about its outside. A mirrored
    /// order turns the other way: it is turned back, so that the face normal stays outside.
    #[must_use]
    #[inline]
    pub fn order<T>(&self, [a, b, c]: [T; 3]) -> [T; 3] {
        if self.is_mirroring { [a, c, b] } else { [a, b, c] }
    }

    /// A box, by its least and greatest corner, that holds whatever of another box is placed, with
    /// all that is rounded on the way.
    #[must_use]
    pub fn around(&self, [lower, upper]: [[f32; 3]; 2]) -> [[f32; 3]; 2] {
        let Transform { linear, translation } = &self.transform;
        let (mut least, mut greatest) = ([0.0; 3], [0.0; 3]);
        for axis in 0..3 {
            let (mut low, mut high) = (translation[axis], translation[axis]);
            let mut magnitude = translation[axis].abs();
            for (column, factor) in linear[axis].into_iter().enumerate() {
                let ends = [lower[column], upper[column]].map(|end| factor * f64::from(end));
                low += ends[0].min(ends[1]);
                high += ends[0].max(ends[1]);
                magnitude += ends[0].abs().max(ends[1].abs());
            }
            least[axis] = single(low - magnitude * ROUNDING).next_down();
            greatest[axis] = single(high + magnitude * ROUNDING).next_up();
        }
        [least, greatest]
    }
}

/// A matrix times a vector.
#[must_use]
#[inline]
pub fn apply(m: &Matrix, v: [f64; 3]) -> [f64; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn unit(v: [f64; 3]) -> Option<[f64; 3]> {
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    (length.is_finite() && length > f64::MIN_POSITIVE)
        .then(|| v.map(|component| component / length))
}

#[expect(clippy::cast_possible_truncation, reason = "what is too large becomes infinite")]
const fn single(number: f64) -> f32 {
    number as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    pub(crate) fn transform() -> impl Strategy<Value = Transform> {
        let entry = || prop_oneof![-3f64..3.0, (-2i8..3).prop_map(f64::from)];
        let row = move || [entry(), entry(), entry()];
        let all = ([row(), row(), row()], prop::array::uniform3(-1e4f64..1e4));
        all.prop_map(|(linear, translation)| Transform { linear, translation })
            .prop_filter("flat", Transform::is_reversible)
    }

    proptest! {
        #[test]
        fn what_is_placed_lies_in_the_box_around_it(
            transform in transform(), corners in prop::array::uniform2([-9f32..9.0, -9f32..9.0, -9f32..9.0]),
            at in prop::array::uniform3(0f32..=1.0),
        ) {
            let [a, b] = corners;
            let lower: [f32; 3] = std::array::from_fn(|axis| a[axis].min(b[axis]));
            let upper: [f32; 3] = std::array::from_fn(|axis| a[axis].max(b[axis]));
            let point: [f32; 3] = std::array::from_fn(|axis| {
                (lower[axis] + (upper[axis] - lower[axis]) * at[axis]).clamp(lower[axis], upper[axis])
            });
            let placing = Placing::new(transform);
            let [least, greatest] = placing.around([lower, upper]);
            for point in [point, lower, upper] {
                let placed = placing.corner(point);
                for axis in 0..3 {
                    prop_assert!((least[axis]..=greatest[axis]).contains(&placed[axis]));
                }
            }
        }

        #[test]
        fn the_inverse_brings_points_back(transform in transform(), point in [-9f64..9.0, -9f64..9.0, -9f64..9.0]) {
            let placed = transform.point(point);
            let moved = std::array::from_fn(|axis| placed[axis] - transform.translation[axis]);
            let back = apply(&transform.inverse(), moved);
            for axis in 0..3 {
                prop_assert!((back[axis] - point[axis]).abs() < 1e-6, "{back:?} {point:?}");
            }
        }
    }

    #[test]
    fn what_is_all_but_flat_is_not_reversible() {
        let scaled = |z| Transform {
            linear: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, z]],
            ..Transform::IDENTITY
        };
        assert!(scaled(1e-4).is_reversible() && scaled(-3.0).is_reversible());
        assert!(!scaled(1e-6).is_reversible() && !scaled(0.0).is_reversible());
        assert!(!scaled(f64::NAN).is_reversible() && !scaled(f64::INFINITY).is_reversible());
        let far = Transform { translation: [0.0, f64::NAN, 0.0], ..Transform::IDENTITY };
        assert!(!far.is_reversible());
    }
}
