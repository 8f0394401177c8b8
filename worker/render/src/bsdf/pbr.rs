//! The metallic-roughness model: a diffuse base under a GGX coat with Schlick's Fresnel term.
//!
//! f = (1 − F(cos_o)) (1 − F(cos_i)) `base` (1 − `metallic`)/π + F(cos_d) D·G/(4 cos_o cos_i)
//!
//! with F(c) = F₀ + (1 − F₀)(1 − c)⁵, F₀ = 4% mixed with `base` by `metallic`, and cos_d between
//! the half vector and either direction: what the coat reflects does not reach the base, on the way
//! in and on the way out.
//!
//! **Energy.** Of light from `wo`, the coat reflects F₀ A + (1 − F₀) B, where A ≤ 1 and B are the
//! lobe's albedos for F = 1 and F = (1 − cos_d)⁵. The mean of 1 − F(cos_i) over the hemisphere is
//! (1 − F₀) · 20/21, so the base reflects at most (1 − F₀)² (1 − (1 − cos_o)⁵) · 20/21. The sum is
//! at most 1 for every `base` and `metallic` if B ≤ 1/21 + 20/21 (1 − cos_o)⁵, in which no colour
//! occurs any more. A test integrates B over all angles and roughnesses.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::ggx::{Ggx, Half};
use super::mean;
use crate::warp;

/// Reflectance of a dielectric of index 1.5 at normal incidence.
const DIELECTRIC_REFLECTANCE: f32 = 0.04;

/// Least weight of the coat in the choice of lobes, so that a black metal's rim is found too.
const COAT_WEIGHT_MIN: f32 = 0.04;

/// A base and a coat.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pbr {
    base: Vec3,
    f0: Vec3,
    ggx: Ggx,
    opacity: f32,
}

impl Pbr {
    pub(super) fn new(base: Vec3, roughness: f32, metallic: f32, opacity: f32) -> Self {
        Self {
            base: base * (1.0 - metallic),
            f0: Vec3::splat(DIELECTRIC_REFLECTANCE * (1.0 - metallic)) + base * metallic,
            ggx: Ggx::new(roughness * roughness),
            opacity,
        }
    }

    pub(super) fn albedo(&self) -> Vec3 {
        (self.f0 + self.base * (Vec3::ONE - self.f0)) * self.opacity
    }

    /// f·cos and density at two directions on the same side.
    pub(super) fn evaluate(&self, cos_o: f32, cos_i: f32, half: &Half) -> (Vec3, f32) {
        let coat = self.ggx.evaluate(cos_o, cos_i, half);
        let let_in = Vec3::ONE - self.fresnel(cos_o);
        let let_out = Vec3::ONE - self.fresnel(cos_i);
        let base_pdf = cos_i * FRAC_1_PI;
        let value = self.base * let_in * let_out * base_pdf
            + self.fresnel(half.cos_difference) * coat.value;
        let share = self.coat_share(cos_o);
        (value * self.opacity, share * coat.pdf + (1.0 - share) * base_pdf)
    }

    /// A direction in the frame of the normal.
    pub(super) fn sample(&self, wo: Vec3, choice: f32, place: [f32; 2]) -> Vec3 {
        if choice < self.coat_share(wo.z) {
            self.ggx.sample(wo, place)
        } else {
            warp::cosine_hemisphere(place)
        }
    }

    /// Probability of drawing from the coat.
    fn coat_share(&self, cos_o: f32) -> f32 {
        let fresnel = mean(self.fresnel(cos_o));
        let coat = fresnel.max(COAT_WEIGHT_MIN);
        coat / (coat + mean(self.base) * (1.0 - fresnel).max(0.0))
    }

    /// Schlick's approximation of the Fresnel term.
    fn fresnel(&self, cos: f32) -> Vec3 {
        let m = (1.0 - cos).clamp(0.0, 1.0);
        let m2 = m * m;
        self.f0 + (Vec3::ONE - self.f0) * (m2 * m2 * m)
    }
}
