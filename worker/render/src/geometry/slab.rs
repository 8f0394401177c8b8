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

use bytemuck::{Pod, Zeroable};
use glam::{Vec3, Vec3A, Vec4};

use super::Bounds;

/// Bound on the sideways error of the triangle test over (|x| + |z|): 8 half-ulps, for 5 + slack.
pub(super) const SIDEWAYS_ERROR: f32 = 8.0 / 16_777_216.0;

/// Factor on the near end of an interval: 1 − 2⁻²⁰.
const NEAR_FACTOR: f32 = 1.0 - 1.0 / 1_048_576.0;

/// Factor on the far end of an interval: 1 + 2⁻²⁰.
const FAR_FACTOR: f32 = 1.0 + 1.0 / 1_048_576.0;

/// Smallest component of a direction that is divided by. A smaller one moves a ray, over the
/// longest distance, by far less than the ray is thick.
pub(super) const COMPONENT_MIN: f32 = 1e-18;

/// A ray as boxes see it.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Slab {
    /// Where it begins as lower bounds of boxes see it; w is of no meaning here and below.
    above: Vec4,
    /// Where it begins as upper bounds see it.
    below: Vec4,
    /// The reciprocal of its direction: never zero or infinite.
    inverse: Vec4,
}

impl Slab {
    /// A ray in a model within `bounds`.
    #[inline(always)]
    pub(super) fn new(origin: Vec3, direction: Vec3, bounds: &Bounds) -> Self {
        Self::thick(origin, direction, thickness(origin, bounds))
    }

    /// A ray that is so thick along each axis.
    #[inline(always)]
    pub(super) fn thick(origin: Vec3, direction: Vec3, thickness: Vec3) -> Self {
        let (above, below) = (origin + thickness, origin - thickness);
        let direction = Vec3A::from(direction);
        let is_small = direction.abs().cmplt(Vec3A::splat(COMPONENT_MIN));
        let least = Vec3A::splat(COMPONENT_MIN).copysign(direction);
        let above = Vec3::new(next_up(above.x), next_up(above.y), next_up(above.z));
        let below = -Vec3::new(next_up(-below.x), next_up(-below.y), next_up(-below.z));
        // Never infinite, so that no zero is multiplied by infinity.
        let inverse = Vec3A::ONE / Vec3A::select(is_small, least, direction);
        Self { above: above.extend(0.0), below: below.extend(0.0), inverse: inverse.extend(0.0) }
    }

    /// Where the ray begins as planes across an axis see it: lower bounds of boxes, or upper ones.
    #[inline(always)]
    pub(super) fn origin(&self, axis: usize, is_lower: bool) -> f32 {
        if is_lower { self.above[axis] } else { self.below[axis] }
    }

    /// The reciprocal of the ray's direction along an axis: never zero or infinite.
    #[inline(always)]
    pub(super) fn inverse(&self, axis: usize) -> f32 {
        self.inverse[axis]
    }

    /// The nearest and farthest distance in a box, which is missed if the nearest exceeds the
    /// farthest.
    #[inline(always)]
    pub(super) fn interval(&self, bounds: &Bounds) -> (f32, f32) {
        self.interval_between(bounds.lower.into(), bounds.upper.into())
    }

    /// [`Self::interval`] in a triangle's own box.
    #[inline(always)]
    pub(super) fn interval_around(&self, corners: &[Vec3; 3]) -> (f32, f32) {
        let (a, b, c) = (Vec3A::from(corners[0]), Vec3A::from(corners[1]), Vec3A::from(corners[2]));
        self.interval_between(a.min(b).min(c), a.max(b).max(c))
    }

    #[inline(always)]
    fn interval_between(&self, lower: Vec3A, upper: Vec3A) -> (f32, f32) {
        let [above, below] = [Vec3A::from_vec4(self.above), Vec3A::from_vec4(self.below)];
        let inverse = Vec3A::from_vec4(self.inverse);
        let (lower, upper) = ((lower - above) * inverse, (upper - below) * inverse);
        let near = greater(lower.min(upper).max_element(), 0.0);
        let far = lower.max(upper).min_element();
        (near * NEAR_FACTOR, far * FAR_FACTOR)
    }
}

/// How far beside a triangle of a model within `bounds` a ray from `origin` may pass that the
/// triangle test lets hit it.
#[inline]
pub(super) fn thickness(origin: Vec3, bounds: &Bounds) -> Vec3 {
    let reach = (bounds.lower - origin).abs().max((bounds.upper - origin).abs());
    (reach + Vec3::splat(reach.max_element())) * SIDEWAYS_ERROR
}

/// [`f32::next_up`] of a number that is finite, without a branch: every ray takes six.
#[inline(always)]
fn next_up(number: f32) -> f32 {
    // Makes a negative zero a positive one.
    let bits = (number + 0.0).to_bits();
    f32::from_bits(bits.wrapping_add(1).wrapping_sub((bits >> 31) << 1))
}

/// The lesser of two numbers that are not NaN.
#[inline(always)]
pub(super) fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The greater of two numbers that are not NaN.
#[inline(always)]
pub(super) fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
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
        fn the_next_number_is_the_one_that_the_library_knows(number in prop::num::f32::NORMAL
            | prop::num::f32::SUBNORMAL | prop::num::f32::ZERO | prop::num::f32::NEGATIVE)
        {
            prop_assert_eq!(next_up(number).to_bits(), number.next_up().to_bits());
            prop_assert_eq!((-next_up(-number)).to_bits(), number.next_down().to_bits());
        }

        #[test]
        fn the_interval_of_a_larger_box_contains_that_of_a_smaller_one(
            points in prop::array::uniform4(point()), origin in point(), direction in point(),
        ) {
            prop_assume!(direction.length() > 0.0);
            let inner = Bounds::around(points[..2].iter().copied());
            let outer = Bounds::around(points);
            let model = Bounds::around(points);
            let slab = Slab::new(origin, direction.normalize(), &model);
            let ((near, far), (outer_near, outer_far)) =
                (slab.interval(&inner), slab.interval(&outer));
            prop_assert!(outer_near <= near && far <= outer_far, "{near} {far}");
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
            let (near, far) = slab.interval(&bounds);
            prop_assert!(near <= far);
            let distance = (target - origin.as_dvec3()).length();
            prop_assert!(f64::from(near) <= distance * (1.0 + 1e-9));
        }
    }
}
