//! The primitive shapes that everything is put together from.
//!
//! A shape is polygons over shared points, corners counter-clockwise seen from outside, so that the
//! normals of a closed shape point outward. It is built about its own origin (standing on y = 0
//! unless said otherwise) and then placed by a [`Frame`].

mod lathe;
mod sweep;

pub(crate) use sweep::arc;

use crate::frame::Frame;
use crate::vector::{Vector, vector};

/// Polygons, with shading normals on those that are to look round.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shape {
    pub(crate) points: Vec<Vector>,
    pub(crate) normals: Vec<Vector>,
    pub(crate) faces: Vec<Face>,
}

/// A polygon: corners into the points, and into the normals or none.
#[derive(Clone, Debug)]
pub(crate) struct Face {
    pub(crate) points: Vec<usize>,
    pub(crate) normals: Vec<usize>,
}

impl Shape {
    /// A box with its bottom in the middle of y = 0.
    pub(crate) fn cuboid(x: f64, y: f64, z: f64) -> Self {
        Self::tapered((x, z), (x, z), y)
    }

    /// A box whose bottom and top differ in size.
    pub(crate) fn tapered(bottom: (f64, f64), top: (f64, f64), height: f64) -> Self {
        let ring = |(x, z): (f64, f64)| {
            let (x, z) = (x / 2.0, z / 2.0);
            [(-x, -z), (x, -z), (x, z), (-x, z)]
        };
        Self::loft(&ring(bottom), &ring(top), height)
    }

    /// An upright prism over an outline in x and z that runs from +x to +z (clockwise from above).
    pub(crate) fn prism(outline: &[(f64, f64)], height: f64) -> Self {
        Self::loft(outline, outline, height)
    }

    /// A solid between two outlines of as many corners, at y = 0 and at `height`.
    fn loft(bottom: &[(f64, f64)], top: &[(f64, f64)], height: f64) -> Self {
        let count = bottom.len();
        let lower = bottom.iter().map(|&(x, z)| vector(x, 0.0, z));
        let upper = top.iter().map(|&(x, z)| vector(x, height, z));
        let mut shape = Self { points: lower.chain(upper).collect(), ..Self::default() };
        shape.flat((0..count).collect());
        shape.flat((count..2 * count).rev().collect());
        for here in 0..count {
            let next = (here + 1) % count;
            shape.flat(vec![here, count + here, count + next, next]);
        }
        shape
    }

    /// A rectangle in the plane z = 0 that faces +z, standing on the middle of y = 0.
    pub(crate) fn panel(width: f64, height: f64) -> Self {
        let x = width / 2.0;
        Self::polygon(vec![
            vector(-x, 0.0, 0.0),
            vector(x, 0.0, 0.0),
            vector(x, height, 0.0),
            vector(-x, height, 0.0),
        ])
    }

    /// A rectangle in the plane y = 0 that faces up, about the origin.
    pub(crate) fn sheet(x: f64, z: f64) -> Self {
        let (x, z) = (x / 2.0, z / 2.0);
        Self::polygon(vec![
            vector(-x, 0.0, z),
            vector(x, 0.0, z),
            vector(x, 0.0, -z),
            vector(-x, 0.0, -z),
        ])
    }

    /// One polygon.
    pub(crate) fn polygon(points: Vec<Vector>) -> Self {
        let corners = (0..points.len()).collect();
        let mut shape = Self { points, ..Self::default() };
        shape.flat(corners);
        shape
    }

    /// Several polygons, which share no points.
    pub(crate) fn polygons(polygons: impl IntoIterator<Item = Vec<Vector>>) -> Self {
        polygons.into_iter().fold(Self::default(), |shape, points| shape.and(Self::polygon(points)))
    }

    /// This and another as one shape.
    pub(crate) fn and(mut self, other: Self) -> Self {
        let (points, normals) = (self.points.len(), self.normals.len());
        self.points.extend(other.points);
        self.normals.extend(other.normals);
        self.faces.extend(other.faces.into_iter().map(|face| Face {
            points: face.points.iter().map(|index| index + points).collect(),
            normals: face.normals.iter().map(|index| index + normals).collect(),
        }));
        self
    }

    /// In the room instead of about its own origin.
    pub(crate) fn placed(mut self, at: &Frame) -> Self {
        self.points.iter_mut().for_each(|point| *point = at.point(*point));
        self.normals.iter_mut().for_each(|normal| *normal = at.direction(*normal));
        self
    }

    /// Stretched along the axes by positive factors.
    pub(crate) fn scaled(mut self, x: f64, y: f64, z: f64) -> Self {
        let stretch = |p: Vector, x: f64, y: f64, z: f64| vector(p.x * x, p.y * y, p.z * z);
        self.points.iter_mut().for_each(|point| *point = stretch(*point, x, y, z));
        self.normals
            .iter_mut()
            .for_each(|n| *n = stretch(*n, 1.0 / x, 1.0 / y, 1.0 / z).normalized());
        self
    }

    /// Triangles that its polygons make.
    pub(crate) fn triangle_count(&self) -> u64 {
        self.faces.iter().map(|face| face.points.len() as u64 - 2).sum()
    }

    fn flat(&mut self, points: Vec<usize>) {
        self.faces.push(Face { points, normals: Vec::new() });
    }

    fn smooth(&mut self, points: Vec<usize>, normals: Vec<usize>) {
        assert_eq!(points.len(), normals.len(), "a normal for each corner");
        self.faces.push(Face { points, normals });
    }
}

/// The outline of a rectangle with corners rounded in `steps` steps, for [`Shape::prism`].
pub(crate) fn rounded_rectangle(x: f64, z: f64, radius: f64, steps: u32) -> Vec<(f64, f64)> {
    let (x, z) = (x / 2.0 - radius, z / 2.0 - radius);
    let corners = [(x, z, 0.0), (-x, z, 90.0), (-x, -z, 180.0), (x, -z, 270.0)];
    let corner = |(x, z, start): (f64, f64, f64)| {
        (0..=steps).map(move |step| {
            let (sin, cos) =
                crate::frame::sin_cos(start + 90.0 * f64::from(step) / f64::from(steps));
            (x + radius * cos, z + radius * sin)
        })
    };
    corners.into_iter().flat_map(corner).collect()
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Six times the volume that the faces enclose; positive if they face outward.
    pub(crate) fn signed_volume(shape: &Shape) -> f64 {
        let corner = |face: &Face, index: usize| shape.points[face.points[index]];
        let fan = |face: &Face| -> f64 {
            (2..face.points.len())
                .map(|i| corner(face, 0).dot(corner(face, i - 1).cross(corner(face, i))))
                .sum()
        };
        shape.faces.iter().map(fan).sum::<f64>()
    }

    #[test]
    fn a_box_faces_outward_and_has_its_volume() {
        let shape = Shape::cuboid(2.0, 3.0, 4.0);
        assert!((signed_volume(&shape) / 6.0 - 24.0).abs() < 1e-9);
        assert_eq!(shape.triangle_count(), 12);
        let moved = shape.placed(&Frame::at(5., 6., 7.).turned(30.).tilted(20.));
        assert!((signed_volume(&moved) / 6.0 - 24.0).abs() < 1e-9);
    }

    #[test]
    fn a_rounded_prism_faces_outward() {
        let shape = Shape::prism(&rounded_rectangle(1.0, 0.5, 0.1, 3), 0.2);
        let volume = signed_volume(&shape) / 6.0;
        assert!(volume > 0.09 && volume < 0.1, "{volume}");
    }

    #[test]
    fn panels_face_front_and_sheets_up() {
        let front =
            |s: &Shape| (s.points[1] - s.points[0]).cross(s.points[2] - s.points[1]).normalized();
        assert_eq!(front(&Shape::panel(1., 2.)), vector(0., 0., 1.));
        assert_eq!(front(&Shape::sheet(1., 2.)), vector(0., 1., 0.));
    }
}
