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

#[cfg(test)]
mod tests {
    use super::*;

    const IOR: f32 = 1.5;

    /// A direction at this sine from +z, or from −z.
    fn direction(sin: f32, side: f32) -> Vec3 {
        Vec3::new(0.6 * sin, 0.8 * sin, side * (1.0 - sin * sin).sqrt())
    }

    fn sample(wo: Vec3, u: f32) -> SpecularSample {
        let glass = Glass::new(IOR, Vec3::new(1.0, 0.5, 0.25));
        glass.sample(wo, Vec3::Z, Vec3::Z, u).expect("not in the plane")
    }

    #[test]
    fn fresnel_is_what_the_textbooks_tabulate() {
        for (cos, eta, expected) in [
            (1.0, 1.5, 0.04),
            (0.5, 1.5, 0.089_187_5),
            (1.0, 1.0 / 1.5, 0.04),
            (0.6, 1.333, 0.039_150),
            (0.5, 1.0 / 1.5, 1.0),
            (1e-7, 1.5, 1.0),
        ] {
            let (found, _) = fresnel(cos, eta);
            assert!((found - expected).abs() < 2e-5, "cos {cos}, eta {eta}: {found}");
        }
    }

    #[test]
    fn it_bends_as_snell_says_and_scales_radiance() {
        for (sin, side, eta) in
            [(0.0, 1.0, IOR), (0.8, 1.0, IOR), (0.99, 1.0, IOR), (0.6, -1.0, 1.0 / IOR)]
        {
            let wo = direction(sin, side);
            let bent = sample(wo, 0.999_999);
            let expected = direction(sin / eta, 1.0) * Vec3::new(-1.0, -1.0, -side);
            assert!((bent.wi - expected).length() < 1e-6, "{} is not {expected}", bent.wi);
            let radiance = Vec3::new(1.0, 0.5, 0.25) / (eta * eta);
            assert!((bent.weight - radiance).length() < 1e-6);
        }
    }

    #[test]
    fn beyond_the_critical_angle_all_is_reflected() {
        let wo = direction(0.7, -1.0);
        let mirrored = sample(wo, 0.999_999);
        assert!((mirrored.wi - Vec3::new(-wo.x, -wo.y, wo.z)).length() < 1e-6);
        assert_eq!(mirrored.weight, Vec3::ONE);
    }

    #[test]
    fn no_flux_is_lost() {
        for (sin, side, eta) in
            [(0.3, 1.0, IOR), (0.95, 1.0, IOR), (0.5, -1.0, 1.0 / IOR), (0.9, -1.0, 1.0 / IOR)]
        {
            let wo = direction(sin, side);
            let (mut flux, mut reflected) = (0.0, 0.0);
            for step in 0_u16..1000 {
                let sample = sample(wo, (f32::from(step) + 0.5) / 1000.0);
                let is_reflected = sample.wi.z * side > 0.0;
                flux += sample.weight.x * if is_reflected { 1.0 } else { eta * eta } / 1000.0;
                reflected += f32::from(u8::from(is_reflected)) / 1000.0;
            }
            assert!((flux - 1.0).abs() < 1e-4, "{flux}");
            assert!((reflected - fresnel(wo.z.abs(), eta).0).abs() < 1.1e-3);
        }
    }

    #[test]
    fn in_and_out_of_a_pane_leaves_radiance_and_direction() {
        let wo = direction(0.7, 1.0);
        let inside = sample(wo, 0.999_999);
        // Now seen from the far face, whose outside is −z.
        let glass = Glass::new(IOR, Vec3::ONE);
        let outside = glass.sample(-inside.wi, -Vec3::Z, -Vec3::Z, 0.999_999).expect("it leaves");
        assert!((outside.wi + wo).length() < 1e-6);
        assert!((inside.weight.x * outside.weight.x - 1.0).abs() < 1e-6);
    }

    #[test]
    fn the_face_tells_inside_from_outside() {
        let glass = Glass::new(IOR, Vec3::ONE);
        let wo = direction(0.3, 1.0);
        for shading in [Vec3::Z, -Vec3::Z, Vec3::X, Vec3::new(-1.0, 0.0, 0.1).normalize()] {
            let bent = glass.sample(wo, shading, Vec3::Z, 0.999_999).expect("not in the plane");
            assert!((bent.weight.x * IOR * IOR - 1.0).abs() < 1e-6, "entered from outside");
        }
    }
}
