//! Warps: maps from the unit square to the domains that are sampled.
//!
//! All keep neighbors near one another, so that the even spread of the points that go in is not
//! lost. Round domains go by way of the disk, whose map needs sines and cosines of at most 45°.

use std::f32::consts::FRAC_PI_4;

use glam::{Vec2, Vec3};

/// A point of the unit disk, uniform by area (Shirley & Chiu, *A Low Distortion Map Between Disk
/// and Square*, 1997).
#[must_use]
pub fn disk(u: [f32; 2]) -> Vec2 {
    let (a, b) = (2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0);
    if a == 0.0 && b == 0.0 {
        return Vec2::ZERO;
    }
    if a.abs() > b.abs() {
        let (sin, cos) = sin_cos_eighth(FRAC_PI_4 * (b / a));
        Vec2::new(a * cos, a * sin)
    } else {
        let (sin, cos) = sin_cos_eighth(FRAC_PI_4 * (a / b));
        Vec2::new(b * sin, b * cos)
    }
}

/// A direction of the upper hemisphere with density cos/π.
#[must_use]
pub fn cosine_hemisphere(u: [f32; 2]) -> Vec3 {
    let p = disk(u);
    p.extend((1.0 - p.length_squared()).max(0.0).sqrt())
}

/// A direction with z from 1 to `z_min`, uniform by solid angle: the disk mapped onto the cap by
/// Lambert's equal-area projection.
#[must_use]
pub fn sphere_cap(u: [f32; 2], z_min: f32) -> Vec3 {
    let p = disk(u);
    let depth = p.length_squared().min(1.0) * (1.0 - z_min);
    (p * ((1.0 - z_min) * (2.0 - depth)).max(0.0).sqrt()).extend(1.0 - depth)
}

/// A direction with density 1/(4π).
#[must_use]
pub fn sphere(u: [f32; 2]) -> Vec3 {
    sphere_cap(u, -1.0)
}

/// Barycentric coordinates of a point of a triangle, uniform by area (Heitz, *A Low-Distortion Map
/// Between Triangle and Square*, 2019).
#[must_use]
pub fn triangle(u: [f32; 2]) -> [f32; 3] {
    let (b0, b1) =
        if u[1] > u[0] { (0.5 * u[0], u[1] - 0.5 * u[0]) } else { (u[0] - 0.5 * u[1], 0.5 * u[1]) };
    [b0, b1, (1.0 - b0 - b1).max(0.0)]
}

/// Sine and cosine of at most π/4 by their Taylor series, within 10⁻⁷.
fn sin_cos_eighth(x: f32) -> (f32, f32) {
    let s = x * x;
    let sin = x
        * (1.0
            + s * (-1.0 / 6.0 + s * (1.0 / 120.0 + s * (-1.0 / 5040.0 + s * (1.0 / 362_880.0)))));
    let cos = 1.0 + s * (-0.5 + s * (1.0 / 24.0 + s * (-1.0 / 720.0 + s * (1.0 / 40_320.0))));
    (sin, cos)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Centers of a fine grid over the unit square.
    fn grid(side: u16) -> impl Iterator<Item = [f32; 2]> {
        (0..side).flat_map(move |row| {
            (0..side).map(move |column| {
                [
                    (f32::from(column) + 0.5) / f32::from(side),
                    (f32::from(row) + 0.5) / f32::from(side),
                ]
            })
        })
    }

    /// Mean of `f` over the grid: an integral over the warped domain's density.
    fn mean(f: impl Fn([f32; 2]) -> f32) -> f64 {
        grid(256).map(|u| f64::from(f(u))).sum::<f64>() / (256.0 * 256.0)
    }

    fn assert_near(value: f64, expected: f64) {
        assert!((value - expected).abs() < 1e-4, "{value} is not {expected}");
    }

    #[test]
    fn series_agree_with_libm() {
        for step in -1000_i16..=1000 {
            let x = FRAC_PI_4 * f32::from(step) / 1000.0;
            let (sin, cos) = sin_cos_eighth(x);
            assert!((sin - libm::sinf(x)).abs() < 1.2e-7 && (cos - libm::cosf(x)).abs() < 1.2e-7);
        }
    }

    #[test]
    fn moments_are_those_of_the_densities() {
        assert_near(mean(|u| disk(u).length_squared()), 0.5);
        assert_near(mean(|u| disk(u).x.powi(4)), 1.0 / 8.0);
        assert_near(mean(|u| disk(u).x * disk(u).y), 0.0);
        assert_near(mean(|u| cosine_hemisphere(u).z.powi(2)), 0.5);
        assert_near(mean(|u| sphere(u).z.powi(2)), 1.0 / 3.0);
        assert_near(mean(|u| sphere(u).x.powi(2)), 1.0 / 3.0);
        assert_near(mean(|u| sphere_cap(u, 0.5).z), 0.75);
        assert_near(mean(|u| triangle(u)[0]), 1.0 / 3.0);
        assert_near(mean(|u| triangle(u)[2].powi(2)), 1.0 / 6.0);
        assert_near(mean(|u| triangle(u)[0] * triangle(u)[1]), 1.0 / 12.0);
    }

    #[test]
    fn corners_of_the_square_stay_in_the_domain() {
        let below_one = 1.0 - f32::EPSILON / 2.0;
        for u in
            [[0.0, 0.0], [0.0, below_one], [below_one, 0.0], [below_one, below_one], [0.5, 0.5]]
        {
            assert!(disk(u).length() <= 1.0 + 2e-7);
            assert!((cosine_hemisphere(u).length() - 1.0).abs() < 3e-7);
            assert!((sphere(u).length() - 1.0).abs() < 3e-7);
            let b = triangle(u);
            assert!(b.iter().all(|&b| (0.0..=1.0).contains(&b)));
            assert!((b[0] + b[1] + b[2] - 1.0).abs() < 2e-7);
        }
    }
}
