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
    /// 2023: stretch to α = 1, where the half vector of the view and a uniform direction of a cap is
    /// a visible normal of the hemisphere.
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
