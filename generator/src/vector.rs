//! Points and directions: the little linear algebra that placing furniture takes.
//!
//! Only additions, multiplications, divisions and square roots, which IEEE 754 rounds alike
//! everywhere; sines and cosines come from `libm` (see `frame.rs`).

use std::ops::{Add, Mul, Neg, Sub};

/// A point or direction in metres; x right, y up, z towards the viewer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Vector {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) z: f64,
}

/// Short for a [`Vector`] of three coordinates.
pub(crate) const fn vector(x: f64, y: f64, z: f64) -> Vector {
    Vector { x, y, z }
}

impl Vector {
    pub(crate) fn dot(self, other: Self) -> f64 {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    pub(crate) fn cross(self, other: Self) -> Self {
        vector(
            self.y * other.z - self.z * other.y,
            self.z * other.x - self.x * other.z,
            self.x * other.y - self.y * other.x,
        )
    }

    pub(crate) fn length(self) -> f64 {
        self.dot(self).sqrt()
    }

    /// The direction of a vector that is not zero.
    pub(crate) fn normalized(self) -> Self {
        let length = self.length();
        assert!(length > 0.0, "a zero vector has no direction");
        self * (1.0 / length)
    }

    /// Some unit vector at right angles to this unit vector.
    pub(crate) fn any_perpendicular(self) -> Self {
        let axis = if self.x.abs() < 0.8 { vector(1.0, 0.0, 0.0) } else { vector(0.0, 0.0, 1.0) };
        self.cross(axis).normalized()
    }
}

impl Add for Vector {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        vector(self.x + other.x, self.y + other.y, self.z + other.z)
    }
}

impl Sub for Vector {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        vector(self.x - other.x, self.y - other.y, self.z - other.z)
    }
}

impl Neg for Vector {
    type Output = Self;
    fn neg(self) -> Self {
        vector(-self.x, -self.y, -self.z)
    }
}

impl Mul<f64> for Vector {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        vector(self.x * factor, self.y * factor, self.z * factor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_axes_are_right_handed() {
        assert_eq!(vector(1., 0., 0.).cross(vector(0., 1., 0.)), vector(0., 0., 1.));
    }

    #[test]
    fn a_perpendicular_is_perpendicular() {
        for axis in [vector(1., 0., 0.), vector(0., 1., 0.), vector(0.6, 0., 0.8)] {
            assert!(axis.dot(axis.any_perpendicular()).abs() < 1e-12);
        }
    }
}
