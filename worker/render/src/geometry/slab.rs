//! The interval of distances that a ray spends in a box, by slabs, never underestimated and
//! monotone.
//!
//! The triangle test errs sideways by at most γ₅·(|x| + |z|), where x and z are the extents of the
//! triangle seen from the ray's origin (pbrt-v4, section 6.8.7). A ray that the test lets hit a
//! triangle may therefore truly pass that far beside its box. So the ray is made thick: the lower
//! planes are seen from an origin moved up by a bound on that error, the upper planes from one
//! moved down (Woop, Benthin, Wald 2013, section 4, where the bound is taken over the whole model
//! as it is here).
//!
//! Errors along the ray are relative: a difference, a reciprocal and a product, γ₃ together. The
//! interval's ends are moved apart by 2⁻²⁰ of themselves, many times as much.
//!
//! Subtraction, multiplication by a constant, minimum and maximum are monotone in floating point
//! too. So for boxes A ⊂ B the computed interval of B contains that of A: bit for bit, not just
//! within an error.

use glam::{Vec3, Vec4};

use super::Bounds;

/// Bound on the sideways error of the triangle test over (|x| + |z|): 8 half-ulps, for 5 + slack.
const SIDEWAYS_ERROR: f32 = 8.0 / 16_777_216.0;

/// Factor on the near end of an interval: 1 − 2⁻²⁰.
const NEAR_FACTOR: f32 = 1.0 - 1.0 / 1_048_576.0;

/// Factor on the far end of an interval: 1 + 2⁻²⁰.
const FAR_FACTOR: f32 = 1.0 + 1.0 / 1_048_576.0;

/// Smallest component of a direction that is divided by. A smaller one moves a ray, over the
/// longest distance, by far less than the ray is thick.
const COMPONENT_MIN: f32 = 1e-18;

/// Two boxes, axis by axis: (first lower, second lower, first upper, second upper).
pub(super) type BoxPair = [Vec4; 3];

/// Packs two boxes.
pub(super) fn pack(first: &Bounds, second: &Bounds) -> BoxPair {
    [0, 1, 2].map(|axis| {
        Vec4::new(first.lower[axis], second.lower[axis], first.upper[axis], second.upper[axis])
    })
}

/// Takes the two boxes apart again.
pub(super) fn unpack(pair: &BoxPair) -> [Bounds; 2] {
    [0, 1].map(|which| Bounds {
        lower: Vec3::from([0, 1, 2].map(|axis| pair[axis][which])),
        upper: Vec3::from([0, 1, 2].map(|axis| pair[axis][which + 2])),
    })
}

/// A ray as boxes see it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slab {
    origins: BoxPair,
    inverses: BoxPair,
}

impl Slab {
    /// A ray in a model within `bounds`.
    pub(super) fn new(origin: Vec3, direction: Vec3, bounds: &Bounds) -> Self {
        Self::thick(origin, direction, thickness(origin, bounds))
    }

    /// A ray that is so thick along each axis.
    #[inline]
    pub(super) fn thick(origin: Vec3, direction: Vec3, thickness: Vec3) -> Self {
        let origins = [0, 1, 2].map(|axis| {
            let above = (origin[axis] + thickness[axis]).next_up();
            let below = (origin[axis] - thickness[axis]).next_down();
            Vec4::new(above, above, below, below)
        });
        let inverses = [0, 1, 2].map(|axis| Vec4::splat(inverse(direction[axis])));
        Self { origins, inverses }
    }

    /// The nearest and farthest distance in each of two boxes: lanes 0 and 1 of each result. A box
    /// is missed if its nearest exceeds its farthest.
    #[inline]
    pub(super) fn intervals(&self, boxes: &BoxPair) -> (Vec4, Vec4) {
        let (near_x, far_x) = self.interval_on_axis(boxes, 0);
        let (near_y, far_y) = self.interval_on_axis(boxes, 1);
        let (near_z, far_z) = self.interval_on_axis(boxes, 2);
        let near = near_x.max(near_y).max(near_z).max(Vec4::ZERO);
        let far = far_x.min(far_y).min(far_z);
        (near * NEAR_FACTOR, far * FAR_FACTOR)
    }

    #[inline]
    fn interval_on_axis(&self, boxes: &BoxPair, axis: usize) -> (Vec4, Vec4) {
        let planes = (boxes[axis] - self.origins[axis]) * self.inverses[axis];
        let [x, y, z, w] = planes.to_array();
        let swapped = Vec4::new(z, w, x, y);
        (planes.min(swapped), planes.max(swapped))
    }
}

/// How far beside a triangle of a model within `bounds` a ray from `origin` may pass that the
/// triangle test lets hit it.
pub(super) fn thickness(origin: Vec3, bounds: &Bounds) -> Vec3 {
    let reach = (bounds.lower - origin).abs().max((bounds.upper - origin).abs());
    (reach + Vec3::splat(reach.max_element())) * SIDEWAYS_ERROR
}

/// A reciprocal that is never infinite, so that no zero is multiplied by infinity.
fn inverse(component: f32) -> f32 {
    if component.abs() >= COMPONENT_MIN {
        1.0 / component
    } else {
        (1.0 / COMPONENT_MIN).copysign(component)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn coordinate() -> impl Strategy<Value = f32> {
        prop_oneof![-10f32..10.0, Just(0.0), Just(-0.0), -1e6f32..1e6, -1e-6f32..1e-6]
    }

    fn point() -> impl Strategy<Value = Vec3> {
        [coordinate(), coordinate(), coordinate()].prop_map(Vec3::from)
    }

    proptest! {
        #[test]
        fn the_interval_of_a_larger_box_contains_that_of_a_smaller_one(
            points in prop::array::uniform4(point()), origin in point(), direction in point(),
        ) {
            prop_assume!(direction.length() > 0.0);
            let inner = Bounds::around(points[..2].iter().copied());
            let outer = Bounds::around(points);
            let model = Bounds::around(points);
            let slab = Slab::new(origin, direction.normalize(), &model);
            let (near, far) = slab.intervals(&pack(&inner, &outer));
            prop_assert!(near.y <= near.x && far.x <= far.y, "{near} {far}");
        }

        #[test]
        fn a_ray_through_a_point_of_a_box_meets_the_box(
            corners in prop::array::uniform2(point()), origin in point(),
            at in prop::array::uniform3(0f64..1.0),
        ) {
            let bounds = Bounds::around(corners);
            let target = bounds.lower.as_dvec3()
                + (bounds.upper - bounds.lower).as_dvec3() * glam::DVec3::from(at);
            let direction = (target - origin.as_dvec3()).normalize_or_zero().as_vec3();
            prop_assume!(direction != Vec3::ZERO);
            let slab = Slab::new(origin, direction, &bounds);
            let (near, far) = slab.intervals(&pack(&bounds, &bounds));
            prop_assert!(near.x <= far.x);
            let distance = (target - origin.as_dvec3()).length();
            prop_assert!(f64::from(near.x) <= distance * (1.0 + 1e-9));
        }
    }
}
