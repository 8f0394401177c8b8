//! Smooth glass: reflection and refraction by Fresnel's equations.
//!
//! Paths start at the eye and carry radiance. Where light passes from one medium into another, a
//! bundle's solid angle changes by the square of the ratio of the indices, and radiance with it:
//! L/η² is what stays the same. So the weight of a refraction is multiplied by (η of the side of
//! `wo`/η of the side of `wi`)², as Mitsuba's `dielectric` does for radiance; in and out again the
//! factors cancel. Flux has no such factor.

use glam::Vec3;

use super::{SpecularSample, reflect};

/// The indices of refraction that MTL allows are 0.001 to 10; beyond, `f32` loses Snell's law.
const IOR_RANGE: (f32, f32) = (1e-3, 1e3);

/// A smooth boundary of a transparent body.
#[derive(Clone, Copy, Debug)]
pub(super) struct Glass {
    ior: f32,
    transmittance: Vec3,
}

impl Glass {
    pub(super) const fn new(ior: f32, transmittance: Vec3) -> Self {
        Self { ior: ior.max(IOR_RANGE.0).min(IOR_RANGE.1), transmittance }
    }

    pub(super) fn albedo(&self) -> Vec3 {
        let (reflected, _) = fresnel(1.0, self.ior);
        Vec3::splat(reflected) + self.transmittance * (1.0 - reflected)
    }

    /// Reflects with the probability that Fresnel's equations give, else refracts.
    ///
    /// The face normal decides whether `wo` is inside. Where an interpolated normal contradicts it,
    /// the face normal is taken for it.
    pub(super) fn sample(
        &self,
        wo: Vec3,
        shading_normal: Vec3,
        face_normal: Vec3,
        u: f32,
    ) -> Option<SpecularSample> {
        let face_cos = face_normal.dot(wo);
        let outward =
            if shading_normal.dot(face_normal) < 0.0 { -shading_normal } else { shading_normal };
        let agrees = outward.dot(wo) * face_cos > 0.0;
        let outward = if agrees { outward } else { face_normal };
        let normal = if face_cos < 0.0 { -outward } else { outward };
        let cos_o = normal.dot(wo).min(1.0);
        if cos_o.is_nan() || cos_o <= 0.0 {
            return None;
        }
        // Index on the far side over that on the side of wo.
        let eta = if face_cos < 0.0 { 1.0 / self.ior } else { self.ior };
        let (reflected, cos_i) = fresnel(cos_o, eta);
        Some(if u < reflected {
            SpecularSample { wi: reflect(wo, normal).normalize(), weight: Vec3::ONE }
        } else {
            let wi = (normal * cos_o - wo) / eta - normal * cos_i;
            SpecularSample { wi: wi.normalize(), weight: self.transmittance / (eta * eta) }
        })
    }
}

/// The fraction of unpolarized light that a smooth boundary reflects, and the cosine on its far
/// side (0 under total reflection). `eta` is the far index over the near one.
fn fresnel(cos: f32, eta: f32) -> (f32, f32) {
    let sin2_far = (1.0 - cos * cos) / (eta * eta);
    if sin2_far >= 1.0 {
        return (1.0, 0.0);
    }
    let cos_far = (1.0 - sin2_far).sqrt();
    let parallel = (eta * cos - cos_far) / (eta * cos + cos_far);
    let perpendicular = (cos - eta * cos_far) / (cos + eta * cos_far);
    (0.5 * (parallel * parallel + perpendicular * perpendicular), cos_far)
}
