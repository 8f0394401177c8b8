//! The reading of plain MTL: `diffuse`/π + `specular` · D·G/(4 cos cos), without Fresnel term.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::ggx::{Ggx, Half};
use super::mean;
use crate::warp;

/// A diffuse lobe and a GGX lobe; at least the second is not black.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plain {
    diffuse: Vec3,
    specular: Vec3,
    ggx: Ggx,
    /// Probability of drawing from the diffuse lobe.
    diffuse_share: f32,
}

impl Plain {
    pub(super) fn new(diffuse: Vec3, specular: Vec3, alpha: f32) -> Self {
        let diffuse_share = mean(diffuse) / (mean(diffuse) + mean(specular));
        Self { diffuse, specular, ggx: Ggx::new(alpha), diffuse_share }
    }

    pub(super) fn albedo(&self) -> Vec3 {
        self.diffuse + self.specular
    }

    /// f·cos and density at two directions on the same side.
    pub(super) fn evaluate(&self, cos_o: f32, cos_i: f32, half: &Half) -> (Vec3, f32) {
        let gloss = self.ggx.evaluate(cos_o, cos_i, half);
        let diffuse_pdf = cos_i * FRAC_1_PI;
        let value = self.diffuse * diffuse_pdf + self.specular * gloss.value;
        let share = self.diffuse_share;
        (value, share * diffuse_pdf + (1.0 - share) * gloss.pdf)
    }

    /// A direction in the frame of the normal.
    pub(super) fn sample(&self, wo: Vec3, choice: f32, place: [f32; 2]) -> Vec3 {
        if choice < self.diffuse_share {
            warp::cosine_hemisphere(place)
        } else {
            self.ggx.sample(wo, place)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lobes_add_up_and_share_draws_by_albedo() {
        let (n, wo) = (Vec3::Z, Vec3::new(0.6, 0.0, 0.8));
        let wi = Vec3::new(-0.48, 0.36, 0.8);
        let half = Half::new(n, wo, wi);
        let both = Plain::new(Vec3::new(0.6, 0.3, 0.0), Vec3::splat(0.1), 0.3);
        let gloss = Plain::new(Vec3::ZERO, Vec3::ONE, 0.3);
        let (value, pdf) = both.evaluate(0.8, 0.8, &half);
        let (gloss_value, gloss_pdf) = gloss.evaluate(0.8, 0.8, &half);
        let expected = Vec3::new(0.6, 0.3, 0.0) * 0.8 * FRAC_1_PI + gloss_value * 0.1;
        assert!((value - expected).length() < 1e-6);
        assert!((pdf - (0.75 * 0.8 * FRAC_1_PI + 0.25 * gloss_pdf)).abs() < 1e-6);
        assert!((both.albedo() - Vec3::new(0.7, 0.4, 0.1)).length() < 1e-6);
    }
}
