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

#[cfg(test)]
mod tests {
    use super::*;

    /// B of the proof above: the coat's albedo for F = (1 − cos_d)⁵, as the mean weight of draws
    /// from the lobe on a grid.
    fn grazing_albedo(alpha: f32, cos_o: f32) -> f32 {
        const SIDE: u16 = 128;
        let ggx = Ggx::new(alpha);
        let wo = Vec3::new((1.0 - cos_o * cos_o).sqrt(), 0.0, cos_o);
        let place = |step: u16| (f32::from(step) + 0.5) / f32::from(SIDE);
        let mut sum = 0.0;
        for (row, column) in (0..SIDE).flat_map(|row| (0..SIDE).map(move |column| (row, column))) {
            let wi = ggx.sample(wo, [place(column), place(row)]);
            if wi.z > 0.0 {
                let half = Half::new(Vec3::Z, wo, wi);
                let lobe = ggx.evaluate(cos_o, wi.z, &half);
                sum += (1.0 - half.cos_difference).powi(5) * lobe.value / lobe.pdf;
            }
        }
        sum / (f32::from(SIDE) * f32::from(SIDE))
    }

    #[test]
    fn the_coat_leaves_room_for_the_base_at_every_angle_and_roughness() {
        for alpha in [1e-4, 0.01, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0] {
            for step in 1_u8..=40 {
                let cos_o = f32::from(step) / 40.0;
                let room = 1.0 / 21.0 + 20.0 / 21.0 * (1.0 - cos_o).powi(5);
                let coat = grazing_albedo(alpha, cos_o);
                assert!(coat < room, "alpha {alpha}, cos {cos_o}: {coat} exceeds {room}");
            }
        }
    }

    #[test]
    fn a_white_base_is_nearly_white() {
        let white = Pbr::new(Vec3::ONE, 0.5, 0.0, 1.0);
        assert!((white.albedo().x - 1.0).abs() < 1e-6);
        let metal = Pbr::new(Vec3::new(0.9, 0.6, 0.2), 0.5, 1.0, 1.0);
        assert!((metal.albedo() - Vec3::new(0.9, 0.6, 0.2)).length() < 1e-6);
    }
}
