//! Scattering at a point of a surface: the material with its textures looked up.
//!
//! Directions are unit vectors in world space that point away from the surface: `wo` to where we
//! came from, `wi` to the light. Surfaces reflect on both sides: the normal is turned to the side
//! of `wo`. All cosines are those of the shading normal; the face normal tells only the inside of
//! glass from its outside.
//!
//! A material scatters in two ways that never mix. The part that has a density is drawn with
//! [`Bsdf::sample`] and weighed with [`Bsdf::evaluate`]. The part that goes into single directions
//! (mirror, glass, and straight on where the opacity is below 1) is drawn with
//! [`Bsdf::sample_specular`].

mod ggx;
mod glass;
mod pbr;
mod plain;
#[cfg(test)]
mod tests;

use std::f32::consts::FRAC_1_PI;

use equilux_common::scene::{Material, Surface, Texture};
use glam::Vec3;

use crate::frame::Frame;
use crate::{texture, warp};
use ggx::Half;
use glass::Glass;
use pbr::Pbr;
use plain::Plain;

/// How light scatters at a point.
#[derive(Clone, Copy, Debug)]
pub struct Bsdf {
    normal: Vec3,
    face_normal: Vec3,
    opacity: f32,
    lobes: Lobes,
}

/// What is not straight on; already multiplied by the opacity, but for glass.
#[derive(Clone, Copy, Debug)]
enum Lobes {
    Black,
    Diffuse(Vec3),
    Plain(Plain),
    Pbr(Pbr),
    Mirror(Vec3),
    Glass(Glass),
}

/// A direction drawn from the part of a BSDF that has a density.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// The direction.
    pub wi: Vec3,
    /// f·|cos|/pdf of the whole non-delta part, per channel.
    pub weight: Vec3,
    /// Density per solid angle with which it was drawn.
    pub pdf: f32,
}

/// A direction drawn from the delta part of a BSDF.
#[derive(Clone, Copy, Debug)]
pub struct SpecularSample {
    /// The direction.
    pub wi: Vec3,
    /// Radiance leaving to `wo` per radiance arriving from `wi`, over the probability of the
    /// choice, per channel.
    pub weight: Vec3,
}

impl Bsdf {
    /// The scattering of `material` where its texture coordinates are `uv` and the unit normals
    /// are these.
    #[must_use]
    pub fn new(
        material: &Material,
        textures: &[Texture],
        uv: [f32; 2],
        face_normal: Vec3,
        shading_normal: Vec3,
    ) -> Self {
        let opacity = material.opacity;
        let lobes = if material.emission == [0.0; 3] {
            Lobes::new(&material.surface, textures, uv, opacity)
        } else {
            Lobes::Black
        };
        Self { normal: shading_normal, face_normal, opacity, lobes }
    }

    /// Fraction of light reflected, per channel: the sum of the lobes' reflectances at normal
    /// incidence. For glass, what is reflected and refracted together.
    #[must_use]
    pub fn albedo(&self) -> Vec3 {
        match &self.lobes {
            Lobes::Black => Vec3::ZERO,
            Lobes::Diffuse(albedo) | Lobes::Mirror(albedo) => *albedo,
            Lobes::Plain(plain) => plain.albedo(),
            Lobes::Pbr(pbr) => pbr.albedo(),
            Lobes::Glass(glass) => glass.albedo() * self.opacity,
        }
    }

    /// Whether there is a part that has a density.
    #[must_use]
    pub const fn has_scattering(&self) -> bool {
        matches!(self.lobes, Lobes::Diffuse(_) | Lobes::Plain(_) | Lobes::Pbr(_))
    }

    /// Whether there is a delta part.
    #[must_use]
    pub const fn has_specular(&self) -> bool {
        self.opacity < 1.0 || matches!(self.lobes, Lobes::Mirror(_) | Lobes::Glass(_))
    }

    /// f·|cos| of the non-delta part, per channel.
    #[must_use]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        self.evaluate(wo, wi).0
    }

    /// The density per solid angle with which [`Bsdf::sample`] draws `wi`.
    #[must_use]
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.evaluate(wo, wi).1
    }

    /// [`Bsdf::eval`] and [`Bsdf::pdf`] for little more than the price of one.
    #[must_use]
    pub fn evaluate(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        let (signed_o, signed_i) = (self.normal.dot(wo), self.normal.dot(wi));
        let is_reflection = signed_o * signed_i > 0.0;
        if !is_reflection {
            return (Vec3::ZERO, 0.0);
        }
        let (cos_o, cos_i) = (signed_o.abs(), signed_i.abs());
        let half = || Half::new(self.normal, wo, wi);
        match &self.lobes {
            Lobes::Black | Lobes::Mirror(_) | Lobes::Glass(_) => (Vec3::ZERO, 0.0),
            Lobes::Diffuse(albedo) => (*albedo * (cos_i * FRAC_1_PI), cos_i * FRAC_1_PI),
            Lobes::Plain(plain) => plain.evaluate(cos_o, cos_i, &half()),
            Lobes::Pbr(pbr) => pbr.evaluate(cos_o, cos_i, &half()),
        }
    }

    /// Draws a direction from the non-delta part; none where there is no such part or the lobe
    /// leads below the surface, which counts as a sample of weight 0.
    #[must_use]
    pub fn sample(&self, wo: Vec3, u: [f32; 3]) -> Option<BsdfSample> {
        let frame = Frame::new(self.normal_toward(wo)?);
        let place = [u[1], u[2]];
        let local = match &self.lobes {
            Lobes::Black | Lobes::Mirror(_) | Lobes::Glass(_) => return None,
            Lobes::Diffuse(_) => warp::cosine_hemisphere(place),
            Lobes::Plain(plain) => plain.sample(frame.to_local(wo), u[0], place),
            Lobes::Pbr(pbr) => pbr.sample(frame.to_local(wo), u[0], place),
        };
        let wi = frame.to_world(local);
        let (value, pdf) = self.evaluate(wo, wi);
        let weight = if let Lobes::Diffuse(albedo) = self.lobes { albedo } else { value / pdf };
        let is_valid = local.z > 0.0 && pdf > 0.0 && weight.is_finite();
        is_valid.then_some(BsdfSample { wi, weight, pdf })
    }

    /// Draws one of the delta directions: straight on, reflected or refracted.
    #[must_use]
    pub fn sample_specular(&self, wo: Vec3, u: f32) -> Option<SpecularSample> {
        let straight = 1.0 - self.opacity;
        let bent = match &self.lobes {
            Lobes::Mirror(reflectance) => mean(*reflectance),
            Lobes::Glass(_) => self.opacity,
            _ => 0.0,
        };
        let probability = straight / (straight + bent);
        if u < probability {
            return Some(SpecularSample { wi: -wo, weight: Vec3::splat(straight + bent) });
        }
        // Where neither part is there, the probability is NaN and no lobe matches below.
        let rest = 1.0 - probability;
        let bent = match &self.lobes {
            Lobes::Mirror(reflectance) => {
                let wi = reflect(wo, self.normal_toward(wo)?);
                SpecularSample { wi: wi.normalize(), weight: *reflectance }
            }
            Lobes::Glass(glass) => {
                let sample =
                    glass.sample(wo, self.normal, self.face_normal, (u - probability) / rest)?;
                SpecularSample { weight: sample.weight * self.opacity, ..sample }
            }
            _ => return None,
        };
        Some(SpecularSample { weight: bent.weight / rest, ..bent })
    }

    /// The shading normal on the side of `wo`; none where `wo` lies in the surface.
    fn normal_toward(&self, wo: Vec3) -> Option<Vec3> {
        let cos = self.normal.dot(wo);
        if cos > 0.0 {
            Some(self.normal)
        } else if cos < 0.0 {
            Some(-self.normal)
        } else {
            None
        }
    }
}

impl Lobes {
    fn new(surface: &Surface, textures: &[Texture], uv: [f32; 2], opacity: f32) -> Self {
        let color = |factor: [f32; 3], texture: Option<u32>| {
            let texel = texture.and_then(|index| textures.get(index as usize));
            Vec3::from_array(factor) * texel.map_or(Vec3::ONE, |found| texture::lookup(found, uv))
        };
        if opacity <= 0.0 {
            return Self::Black;
        }
        match *surface {
            Surface::Plain { diffuse, diffuse_texture, specular, alpha } => Self::plain(
                color(diffuse, diffuse_texture) * opacity,
                Vec3::from_array(specular) * opacity,
                alpha,
            ),
            Surface::Mirror { reflectance } if reflectance == [0.0; 3] => Self::Black,
            Surface::Mirror { reflectance } => {
                Self::Mirror(Vec3::from_array(reflectance) * opacity)
            }
            Surface::Glass { ior, transmittance } => {
                Self::Glass(Glass::new(ior, Vec3::from_array(transmittance)))
            }
            Surface::Pbr { base, base_texture, roughness, metallic } => {
                Self::Pbr(Pbr::new(color(base, base_texture), roughness, metallic, opacity))
            }
        }
    }

    fn plain(diffuse: Vec3, specular: Vec3, alpha: f32) -> Self {
        if specular != Vec3::ZERO {
            Self::Plain(Plain::new(diffuse, specular, alpha))
        } else if diffuse != Vec3::ZERO {
            Self::Diffuse(diffuse)
        } else {
            Self::Black
        }
    }
}

/// `w` mirrored about `axis`.
fn reflect(w: Vec3, axis: Vec3) -> Vec3 {
    axis * (2.0 * w.dot(axis)) - w
}

/// Mean over the channels: by it, lobes share the samples.
fn mean(v: Vec3) -> f32 {
    (v.x + v.y + v.z) * (1.0 / 3.0)
}
