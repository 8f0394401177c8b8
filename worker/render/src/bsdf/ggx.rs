//! The isotropic GGX distribution of microfacets (Walter et al., *Microfacet Models for Refraction
//! through Rough Surfaces*, 2007), with the separable form of Smith's shadowing.
//!
//! With `s(w) = cos + √(cos² + α² sin²)`, Smith's term is `G₁(w) = 2 cos/s(w)`, and the density of
//! the reflections about visible normals is `G₁(wo) D/(4 cos_o) = D/(2 s(wo))`. So the reflection
//! lobe `D G₁(wo) G₁(wi)/(4 cos_o cos_i) · cos_i` is that density times `G₁(wi)`: nothing divides
//! by a cosine, and nothing overflows toward the horizon.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::reflect;
use crate::warp;

/// The smallest α, which is that of Mitsuba 3. A half vector in `f32` is good to about 10⁻⁷, so
/// that a narrower lobe would drown in rounding; this one is hardly told from a mirror.
const ALPHA_MIN: f32 = 1e-4;

/// A GGX distribution.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ggx {
    alpha: f32,
}

/// The angles at the half vector of a pair of directions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Half {
    sin2_normal: f32,
    cos2_normal: f32,
    /// Cosine between the half vector and either direction.
    pub(super) cos_difference: f32,
}

/// What a pair of directions gets from the lobe.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lobe {
    /// D·G/(4 cos_o cos_i)·cos_i.
    pub(super) value: f32,
    /// Density per solid angle of [`Ggx::sample`].
    pub(super) pdf: f32,
}

impl Half {
    /// The half vector of two directions on the same side of a surface. The sine comes from a cross
    /// product, because 1 − cos² has lost all its digits where narrow lobes have their peak.
    pub(super) fn new(normal: Vec3, wo: Vec3, wi: Vec3) -> Self {
        let h = wo + wi;
        let (sin2, cos) = (normal.cross(h).length_squared(), normal.dot(h));
        let cos2 = cos * cos;
        let scale = 1.0 / (sin2 + cos2).max(f32::MIN_POSITIVE);
        Self {
            sin2_normal: sin2 * scale,
            cos2_normal: cos2 * scale,
            cos_difference: (0.5 * h.length()).min(1.0),
        }
    }
}

impl Ggx {
    /// The distribution of roughness `alpha`, brought into the range from [`ALPHA_MIN`] to 1.
    pub(super) const fn new(alpha: f32) -> Self {
        Self { alpha: alpha.max(ALPHA_MIN).min(1.0) }
    }

    /// The lobe at two directions on the same side, given their cosines and half vector.
    pub(super) fn evaluate(&self, cos_o: f32, cos_i: f32, half: &Half) -> Lobe {
        let pdf = self.distribution(half) * 0.5 / self.smith(cos_o);
        Lobe { value: pdf * (2.0 * cos_i / self.smith(cos_i)), pdf }
    }

    /// Reflects `wo` (z up and positive) about a normal drawn from those that it sees; the result
    /// may lie below the surface.
    ///
    /// The spherical caps of Dupuy & Benyoub, *Sampling Visible GGX Normals with Spherical Caps*,
    /// 2023: stretch to α = 1, where the half vector of the view and a uniform direction of a cap
    /// is a visible normal of the hemisphere.
    pub(super) fn sample(&self, wo: Vec3, u: [f32; 2]) -> Vec3 {
        let stretch = Vec3::new(self.alpha, self.alpha, 1.0);
        let view = (wo * stretch).normalize();
        let visible = warp::sphere_cap(u, -view.z) + view;
        let h = (visible * stretch).try_normalize().unwrap_or(Vec3::Z);
        reflect(wo, h)
    }

    /// D = α²/(π (sin² + α² cos²)²) at the half vector.
    fn distribution(&self, half: &Half) -> f32 {
        let alpha2 = self.alpha * self.alpha;
        let base = half.sin2_normal + alpha2 * half.cos2_normal;
        // Both cosines vanish together only when the half vector does.
        if base > 0.0 { alpha2 * FRAC_1_PI / (base * base) } else { 0.0 }
    }

    /// s = cos + √(cos² + α² sin²) of a direction.
    fn smith(&self, cos: f32) -> f32 {
        let cos2 = (cos * cos).min(1.0);
        cos + (cos2 + self.alpha * self.alpha * (1.0 - cos2)).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    /// D·G/(4 cos cos)·cos as the papers write it, with tangents, in double precision.
    fn by_the_book(alpha: f64, n: DVec3, wo: DVec3, wi: DVec3) -> f64 {
        let tan2 = |w: DVec3| w.cross(n).length_squared() / (w.dot(n) * w.dot(n));
        let g1 = |w: DVec3| 2.0 / (1.0 + (1.0 + alpha * alpha * tan2(w)).sqrt());
        let h = (wo + wi).normalize();
        let spread = 1.0 + tan2(h) / (alpha * alpha);
        let cos4 = libm::pow(h.dot(n), 4.0);
        let d = 1.0 / (std::f64::consts::PI * alpha * alpha * cos4 * spread * spread);
        d * g1(wo) * g1(wi) / (4.0 * wo.dot(n))
    }

    #[test]
    fn narrow_lobes_keep_their_digits() {
        let n = Vec3::new(0.3, -0.5, 0.7).normalize();
        let wo = (n + Vec3::new(0.5, 0.6, -0.1)).normalize();
        for (alpha, tolerance) in [(1e-4_f32, 1e-2), (0.005, 2e-4), (0.1, 1e-5), (1.0, 1e-6)] {
            for slope in [0.0, 0.3, 1.0, 4.0_f32] {
                let h = (n + Vec3::new(0.7, 0.42, 0.0).normalize() * (slope * alpha).min(0.6))
                    .normalize();
                let wi = reflect(wo, h).normalize();
                let (cos_o, cos_i) = (n.dot(wo), n.dot(wi));
                let found = Ggx::new(alpha).evaluate(cos_o, cos_i, &Half::new(n, wo, wi)).value;
                let exact =
                    by_the_book(f64::from(alpha), n.as_dvec3(), wo.as_dvec3(), wi.as_dvec3());
                let error = (f64::from(found) / exact - 1.0).abs();
                assert!(error < tolerance, "alpha {alpha}, slope {slope}: off by {error}");
            }
        }
    }
}
