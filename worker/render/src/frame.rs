//! Orthonormal frames: from world space to the space in which a surface normal is +z, and back.

use glam::Vec3;

/// Three perpendicular unit vectors, right-handed.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    tangent: Vec3,
    bitangent: Vec3,
    normal: Vec3,
}

impl Frame {
    /// A frame whose third axis is the unit vector `normal`. The other two turn with it without
    /// jumps, except where z changes its sign (Duff et al., *Building an Orthonormal Basis,
    /// Revisited*, 2017).
    #[must_use]
    pub fn new(normal: Vec3) -> Self {
        let sign = 1.0_f32.copysign(normal.z);
        let a = -1.0 / (sign + normal.z);
        let b = normal.x * normal.y * a;
        Self {
            tangent: Vec3::new(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x),
            bitangent: Vec3::new(b, sign + normal.y * normal.y * a, -normal.y),
            normal,
        }
    }

    /// World to frame.
    #[must_use]
    pub fn to_local(&self, v: Vec3) -> Vec3 {
        Vec3::new(self.tangent.dot(v), self.bitangent.dot(v), self.normal.dot(v))
    }

    /// Frame to world.
    #[must_use]
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        self.tangent * v.x + self.bitangent * v.y + self.normal * v.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn axes_are_perpendicular_and_right_handed(v in prop::array::uniform3(-1f32..1.0)) {
            let v = Vec3::from(v);
            prop_assume!(v.length() > 1e-3);
            let frame = Frame::new(v.normalize());
            prop_assert!(frame.tangent.dot(frame.bitangent).abs() < 1e-6);
            prop_assert!(frame.tangent.dot(frame.normal).abs() < 1e-6);
            prop_assert!((frame.tangent.cross(frame.bitangent) - frame.normal).length() < 1e-6);
            prop_assert!((frame.to_world(frame.to_local(v)) - v).length() < 1e-6);
        }
    }

    #[test]
    fn poles_are_no_exception() {
        for z in [1.0, -1.0] {
            for x in [0.0, -0.0, 1e-30] {
                let frame = Frame::new(Vec3::new(x, 0.0, z));
                assert!((frame.tangent.cross(frame.bitangent) - frame.normal).length() < 1e-6);
            }
        }
    }
}
