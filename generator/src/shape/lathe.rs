//! Round shapes: a profile turned about the y axis, as on a lathe.

use super::Shape;
use crate::frame::sin_cos;
use crate::vector::{Vector, vector};

/// Cosine of the sharpest bend in a profile that is still shaded as smooth.
const SMOOTH_COSINE: f64 = 0.6;

impl Shape {
    /// Turns a profile of (radius, y) about the y axis. The solid is to the left of the profile as
    /// one walks along it with the axis at the left: up along the outside, down along the inside.
    pub(crate) fn lathe(profile: &[(f64, f64)], sides: usize) -> Self {
        let mut shape = Self::default();
        let rings: Vec<Vec<usize>> =
            profile.iter().map(|&(r, y)| shape.ring(r, y, sides)).collect();
        let across: Vec<(f64, f64)> = profile.windows(2).map(|w| across(w[0], w[1])).collect();
        for (index, ends) in profile.windows(2).enumerate() {
            let (lower, upper) = (&rings[index], &rings[index + 1]);
            let is_level = (ends[0].1 - ends[1].1).abs() < 1e-9;
            if is_level && lower.len() == 1 {
                shape.flat(upper.clone());
            } else if is_level && upper.len() == 1 {
                shape.flat(lower.iter().rev().copied().collect());
            } else {
                let bend = |other: Option<&(f64, f64)>| blend(across[index], other.copied());
                let below = bend(index.checked_sub(1).and_then(|below| across.get(below)));
                let above = bend(across.get(index + 1));
                shape.band(lower, upper, [below, above], sides);
            }
        }
        shape
    }

    /// An upright cylinder on y = 0.
    pub(crate) fn cylinder(radius: f64, height: f64, sides: usize) -> Self {
        Self::lathe(&[(0.0, 0.0), (radius, 0.0), (radius, height), (0.0, height)], sides)
    }

    /// A sphere about the origin.
    pub(crate) fn sphere(radius: f64, sides: usize, stacks: usize) -> Self {
        let profile: Vec<(f64, f64)> = (0..=stacks)
            .map(|stack| {
                let (sin, cos) = sin_cos(180.0 * stack as f64 / stacks as f64);
                let at_pole = stack == 0 || stack == stacks;
                (if at_pole { 0.0 } else { radius * sin }, -radius * cos)
            })
            .collect();
        Self::lathe(&profile, sides)
    }

    /// A stone or a bead: a sphere of few faces, not smoothed.
    pub(crate) fn pebble(radius: f64) -> Self {
        let mut shape = Self::sphere(radius, 5, 4);
        shape.normals.clear();
        shape.faces.iter_mut().for_each(|face| face.normals.clear());
        shape
    }

    /// A closed ring of points, or one point on the axis.
    fn ring(&mut self, radius: f64, y: f64, sides: usize) -> Vec<usize> {
        let first = self.points.len();
        if radius == 0.0 {
            self.points.push(vector(0.0, y, 0.0));
            return vec![first];
        }
        self.points.extend((0..sides).map(|side| around(side, sides, (radius, y))));
        (first..first + sides).collect()
    }

    /// The faces between two rings, with the normals of either.
    fn band(&mut self, lower: &[usize], upper: &[usize], ends: [(f64, f64); 2], sides: usize) {
        let starts = ends.map(|end| self.ring_normals(end, sides));
        for here in 0..sides {
            let next = (here + 1) % sides;
            let mut points = vec![];
            let mut normals = vec![];
            let mut corner = |ring: &[usize], start: usize, side: usize| {
                points.push(ring[side % ring.len()]);
                normals.push(start + side);
            };
            corner(lower, starts[0], here);
            corner(upper, starts[1], here);
            if upper.len() > 1 {
                corner(upper, starts[1], next);
            }
            if lower.len() > 1 {
                corner(lower, starts[0], next);
            }
            self.smooth(points, normals);
        }
    }

    /// Where the normals of a ring start; those of the ring before are used again if the same.
    fn ring_normals(&mut self, across: (f64, f64), sides: usize) -> usize {
        let ring: Vec<Vector> = (0..sides).map(|side| around(side, sides, across)).collect();
        if self.normals.ends_with(&ring) {
            return self.normals.len() - sides;
        }
        self.normals.extend(ring);
        self.normals.len() - sides
    }
}

fn around(side: usize, sides: usize, (radius, y): (f64, f64)) -> Vector {
    let (sin, cos) = sin_cos(360.0 * side as f64 / sides as f64);
    vector(radius * cos, y, radius * sin)
}

/// The outward normal of a piece of profile.
fn across(from: (f64, f64), to: (f64, f64)) -> (f64, f64) {
    unit((to.1 - from.1, from.0 - to.0))
}

/// The normal where two pieces meet: their mean if the bend is gentle.
fn blend(own: (f64, f64), other: Option<(f64, f64)>) -> (f64, f64) {
    match other {
        Some(other) if own.0 * other.0 + own.1 * other.1 > SMOOTH_COSINE => {
            unit((own.0 + other.0, own.1 + other.1))
        }
        _ => own,
    }
}

fn unit((x, y): (f64, f64)) -> (f64, f64) {
    let length = (x * x + y * y).sqrt();
    assert!(length > 0.0, "two points of a profile are the same");
    (x / length, y / length)
}

#[cfg(test)]
mod tests {
    use super::super::tests::signed_volume;
    use super::*;

    #[test]
    fn round_solids_face_outward_and_have_their_volumes() {
        let pi = std::f64::consts::PI;
        let cylinder = signed_volume(&Shape::cylinder(0.5, 2.0, 64)) / 6.0;
        assert!((cylinder / (pi * 0.5) - 1.0).abs() < 0.01, "{cylinder}");
        let sphere = signed_volume(&Shape::sphere(1.0, 64, 32)) / 6.0;
        assert!((sphere / (4.0 / 3.0 * pi) - 1.0).abs() < 0.01, "{sphere}");
        let cup = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.9, 1.0), (0.9, 0.1), (0.0, 0.1)];
        let cup = signed_volume(&Shape::lathe(&cup, 64)) / 6.0;
        assert!((cup / (pi * (1.0 - 0.81 * 0.9)) - 1.0).abs() < 0.01, "{cup}");
    }

    #[test]
    fn shading_normals_agree_with_faces() {
        let shape = Shape::sphere(1.0, 16, 8).scaled(1.0, 0.5, 2.0);
        for face in &shape.faces {
            let corner = |index: usize| shape.points[face.points[index]];
            let facing = (corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized();
            for &normal in &face.normals {
                assert!(shape.normals[normal].dot(facing) > 0.5);
                assert!((shape.normals[normal].length() - 1.0).abs() < 1e-9);
            }
        }
    }
}
