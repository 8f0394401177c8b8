//! Where a thing stands and which way it is turned: a rigid frame, built up by moves in the thing's
//! own axes, as one would push furniture about.

use crate::vector::{Vector, vector};

/// An origin and three perpendicular unit axes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    origin: Vector,
    x: Vector,
    y: Vector,
    z: Vector,
}

impl Frame {
    /// At a point of the room, not turned.
    pub(crate) const fn at(x: f64, y: f64, z: f64) -> Self {
        Self {
            origin: vector(x, y, z),
            x: vector(1.0, 0.0, 0.0),
            y: vector(0.0, 1.0, 0.0),
            z: vector(0.0, 0.0, 1.0),
        }
    }

    /// At `from`, with the y axis towards `to`.
    pub(crate) fn along(from: Vector, to: Vector) -> Self {
        let y = (to - from).normalized();
        let x = y.any_perpendicular();
        Self { origin: from, x, y, z: x.cross(y) }
    }

    /// Moved along its own axes.
    pub(crate) fn shifted(self, x: f64, y: f64, z: f64) -> Self {
        Self { origin: self.point(vector(x, y, z)), ..self }
    }

    /// Turned about its own y axis, counter-clockwise seen from above.
    pub(crate) fn turned(self, degrees: f64) -> Self {
        let (sin, cos) = sin_cos(degrees);
        Self { x: self.x * cos - self.z * sin, z: self.x * sin + self.z * cos, ..self }
    }

    /// Tilted about its own x axis: y leans towards z.
    pub(crate) fn tilted(self, degrees: f64) -> Self {
        let (sin, cos) = sin_cos(degrees);
        Self { y: self.y * cos + self.z * sin, z: self.z * cos - self.y * sin, ..self }
    }

    /// Rolled about its own z axis: x leans towards y.
    pub(crate) fn rolled(self, degrees: f64) -> Self {
        let (sin, cos) = sin_cos(degrees);
        Self { x: self.x * cos + self.y * sin, y: self.y * cos - self.x * sin, ..self }
    }

    /// A local point in the room.
    pub(crate) fn point(&self, local: Vector) -> Vector {
        self.origin + self.direction(local)
    }

    /// A local direction in the room.
    pub(crate) fn direction(&self, local: Vector) -> Vector {
        self.x * local.x + self.y * local.y + self.z * local.z
    }
}

/// Sine and cosine of an angle in degrees, the same on every machine.
pub(crate) fn sin_cos(degrees: f64) -> (f64, f64) {
    libm::sincos(degrees.to_radians())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(a: Vector, b: Vector) -> bool {
        (a - b).length() < 1e-12
    }

    #[test]
    fn turning_left_takes_the_front_to_the_right() {
        let frame = Frame::at(0., 0., 0.).turned(90.0);
        assert!(near(frame.direction(vector(0., 0., 1.)), vector(1., 0., 0.)));
        assert!(near(frame.direction(vector(1., 0., 0.)), vector(0., 0., -1.)));
    }

    #[test]
    fn every_move_keeps_the_frame_right_handed() {
        let frame = Frame::at(1., 2., 3.).turned(33.).tilted(-71.).rolled(12.).shifted(1., 0., 0.);
        assert!(near(frame.x.cross(frame.y), frame.z));
        let frame = Frame::along(vector(1., 0., 0.), vector(1., 2., 2.));
        assert!(near(frame.x.cross(frame.y), frame.z));
    }
}
