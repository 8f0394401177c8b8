//! Bent shapes: a circle swept along a path (pipes, cables, handles), a line drawn out sideways
//! (slats, towels), and leaves.

use super::Shape;
use crate::frame::{Frame, sin_cos};
use crate::vector::{Vector, vector};

impl Shape {
    /// A straight round bar between two points.
    pub(crate) fn bar(from: Vector, to: Vector, radius: f64, sides: usize) -> Self {
        let length = (to - from).length();
        Self::cylinder(radius, length, sides).placed(&Frame::along(from, to))
    }

    /// A round tube along a path of at least two points, with closed ends.
    pub(crate) fn pipe(path: &[Vector], radius: f64, sides: usize) -> Self {
        let mut shape = Self::default();
        let mut side = tangent(path, 0).any_perpendicular();
        for (index, &center) in path.iter().enumerate() {
            // Carry the side along with as little twist as possible.
            let ahead = tangent(path, index);
            side = (side - ahead * side.dot(ahead)).normalized();
            let other = side.cross(ahead);
            for step in 0..sides {
                let (sin, cos) = sin_cos(360.0 * step as f64 / sides as f64);
                let normal = side * cos + other * sin;
                shape.points.push(center + normal * radius);
                shape.normals.push(normal);
            }
        }
        shape.flat((0..sides).collect());
        shape.flat((shape.points.len() - sides..shape.points.len()).rev().collect());
        shape.grid(path.len(), sides, true);
        shape
    }

    /// A strip: a line of (z, y) drawn out along x, about the middle. It is smooth and without
    /// thickness, and faces the left of the line as seen from +x (up, if z decreases).
    pub(crate) fn strip(line: &[(f64, f64)], width: f64) -> Self {
        let mut shape = Self::default();
        let line: Vec<Vector> = line.iter().map(|&(z, y)| vector(0.0, y, z)).collect();
        for (index, &point) in line.iter().enumerate() {
            let ahead = tangent(&line, index);
            shape.points.extend([-0.5, 0.5].map(|end| vector(end * width, point.y, point.z)));
            shape.normals.extend([vector(1.0, 0.0, 0.0).cross(ahead); 2]);
        }
        shape.grid(line.len(), 2, false);
        shape
    }

    /// A leaf from the origin along +z, folded along its middle and drooping.
    pub(crate) fn leaf(length: f64, width: f64, droop: f64) -> Self {
        let rib = |t: f64| vector(0.0, -droop * t * t, length * t);
        let edge = |t: f64, side: f64| rib(t) + vector(side * width / 2.0, width * 0.15, 0.0);
        let points = vec![
            rib(0.0),
            rib(0.4),
            rib(0.75),
            rib(1.0),
            edge(0.3, 1.0),
            edge(0.7, 0.75),
            edge(0.3, -1.0),
            edge(0.7, -0.75),
        ];
        let mut shape = Self { points, ..Self::default() };
        for face in [vec![0, 4, 1], vec![1, 4, 5, 2], vec![2, 5, 3]] {
            shape.flat(face.iter().copied().map(mirrored).collect());
            shape.flat(face.into_iter().rev().collect());
        }
        shape
    }

    /// Joins rows of points into quads, with the normals of the same numbers.
    fn grid(&mut self, rows: usize, columns: usize, is_closed: bool) {
        let last = if is_closed { columns } else { columns - 1 };
        for row in 0..rows - 1 {
            for column in 0..last {
                let next = (column + 1) % columns;
                let (near, far) = (row * columns, (row + 1) * columns);
                let corners = vec![near + column, near + next, far + next, far + column];
                let corners: Vec<usize> =
                    if is_closed { corners.into_iter().rev().collect() } else { corners };
                self.smooth(corners.clone(), corners);
            }
        }
    }
}

/// The corner of a leaf on the other side of its rib.
fn mirrored(corner: usize) -> usize {
    match corner {
        4 => 6,
        5 => 7,
        rib => rib,
    }
}

/// The direction of a path at one of its points.
fn tangent(path: &[Vector], index: usize) -> Vector {
    let after = path[(index + 1).min(path.len() - 1)];
    (after - path[index.saturating_sub(1)]).normalized()
}

/// Points of an arc about `center` in the plane of `x` and `y`, between two angles in degrees.
pub(crate) fn arc(center: Vector, x: Vector, y: Vector, degrees: (f64, f64)) -> Vec<Vector> {
    const STEPS: u32 = 8;
    (0..=STEPS)
        .map(|step| {
            let part = f64::from(step) / f64::from(STEPS);
            let (sin, cos) = sin_cos(degrees.0 + (degrees.1 - degrees.0) * part);
            center + x * cos + y * sin
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::tests::signed_volume;
    use super::*;

    /// How well shading normals and faces agree: the least cosine between them.
    fn agreement(shape: &Shape) -> f64 {
        let mut least = 1.0_f64;
        for face in shape.faces.iter().filter(|face| !face.normals.is_empty()) {
            let corner = |index: usize| shape.points[face.points[index]];
            let facing = (corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized();
            let cosines = face.normals.iter().map(|&n| shape.normals[n].dot(facing));
            least = cosines.fold(least, f64::min);
        }
        least
    }

    #[test]
    fn a_bent_pipe_faces_outward() {
        let (x, y) = (vector(1., 0., 0.), vector(0., 1., 0.));
        let pipe = Shape::pipe(&arc(vector(0., 0., 0.), x, y, (0., 120.)), 0.1, 16);
        assert!(signed_volume(&pipe) > 0.0);
        assert!(agreement(&pipe) > 0.7, "{}", agreement(&pipe));
        assert!(signed_volume(&Shape::bar(x, y, 0.1, 8)) > 0.0);
    }

    #[test]
    fn a_strip_faces_as_promised() {
        let strip = Shape::strip(&[(1.0, 0.0), (0.0, 0.1), (-1.0, 0.0)], 2.0);
        assert!(agreement(&strip) > 0.9);
        assert!(strip.normals.iter().all(|normal| normal.y > 0.9));
    }

    #[test]
    fn a_leaf_faces_up() {
        let leaf = Shape::leaf(0.2, 0.1, 0.02);
        for face in &leaf.faces {
            let corner = |index: usize| leaf.points[face.points[index]];
            assert!((corner(1) - corner(0)).cross(corner(2) - corner(0)).y > 0.0);
        }
    }
}
