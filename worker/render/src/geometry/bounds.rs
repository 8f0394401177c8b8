//! Axis-aligned boxes.

use equilux_common::scene::{Geometry, Prototype, load};
use glam::Vec3;

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

    /// The box around the triangles of a model; that of the origin if there are none.
    #[must_use]
    pub fn of_model(geometry: &Geometry, prototypes: &[Prototype]) -> Self {
        let bounds = load::Bounds::of(geometry, prototypes);
        bounds
            .map_or(Self::EMPTY, |it| Self { lower: it.min.into(), upper: it.max.into() })
            .or_origin()
    }

    /// Itself, or the box of the origin if it holds nothing.
    #[must_use]
    pub fn or_origin(self) -> Self {
        let is_empty = self.lower.cmpgt(self.upper).any();
        if is_empty { Self { lower: Vec3::ZERO, upper: Vec3::ZERO } } else { self }
    }

    /// The box around both.
    #[must_use]
    pub fn joined(&self, other: &Self) -> Self {
        Self { lower: self.lower.min(other.lower), upper: self.upper.max(other.upper) }
    }

    /// Half of its surface; 0 if it holds nothing.
    #[must_use]
    pub fn half_area(&self) -> f32 {
        let size = (self.upper - self.lower).max(Vec3::ZERO);
        size.x * size.y + size.y * size.z + size.z * size.x
    }
}
