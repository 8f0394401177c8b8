//! What leaves a surface: n shadow rays, m indirect rays, one specular ray (the paper's section 2,
//! steps 2 to 4), with light samples and BSDF samples weighed against each other.

use equilux_common::ray::{NO_PRIMITIVE, Ray, ray_flags};
use glam::Vec3;

use super::{Shaded, weight};
use crate::bsdf::Bsdf;
use crate::geometry::surface_point::{SurfacePoint, leave};
use crate::light::LightSample;
use crate::renderer::Renderer;
use crate::sampler::{Place, Purpose, branch_of_indirect, branch_of_specular};

/// How far toward the light a shadow ray looks, over the distance: 1 − 2⁻¹⁹. A light is made of
/// several triangles, and the rounding of the direction must not let a neighbor of the one that is
/// sampled hide it.
const SHADOW_REACH: f64 = 1.0 - 1.0 / 524_288.0;

/// Largest probability of going on, so that a path between perfect reflectors ends as well.
const SURVIVAL_MAX: f32 = 0.95;

/// A ray at a surface that scatters it.
pub(super) struct Scatter<'a> {
    renderer: &'a Renderer,
    ray: &'a Ray,
    surface: &'a SurfacePoint,
    bsdf: &'a Bsdf,
    place: Place,
    wo: Vec3,
    throughput: Vec3,
    light_samples: u32,
    indirect_samples: u32,
}

impl<'a> Scatter<'a> {
    pub(super) fn new(
        renderer: &'a Renderer,
        ray: &'a Ray,
        surface: &'a SurfacePoint,
        bsdf: &'a Bsdf,
    ) -> Self {
        let settings = &renderer.settings;
        let depth = usize::from(ray.depth);
        Self {
            renderer,
            ray,
            surface,
            bsdf,
            place: Place::of_ray(settings.seed, ray),
            wo: -Vec3::from(ray.direction),
            throughput: Vec3::from(ray.throughput),
            light_samples: settings.light_samples.at(depth),
            indirect_samples: settings.indirect_samples.at(depth),
        }
    }

    pub(super) fn spawn(&self, shaded: &mut Shaded) {
        if self.bsdf.has_scattering() {
            if !self.renderer.model.lights.is_empty() {
                let indices = 0..self.light_samples;
                shaded.shadow_rays.extend(indices.filter_map(|index| self.shadow_ray(index)));
            }
            let indices = 0..self.indirect_samples;
            shaded.indirect_rays.extend(indices.filter_map(|index| self.indirect_ray(index)));
        }
        if self.bsdf.has_specular() {
            shaded.specular_ray = self.specular_ray();
        }
    }

    /// Estimates direct light: throughput · f·cos · L / (n·p_light) · w, with the weight
    /// w = (n·p_light)² / ((n·p_light)² + (m·p_bsdf)²).
    fn shadow_ray(&self, index: u32) -> Option<Ray> {
        let [u0, u1, u2, _] = self.place.numbers_of(Purpose::Light, index, self.light_samples);
        let light = self.renderer.model.lights.sample(self.surface.point, [u0, u1, u2])?;
        let (value, bsdf_pdf) = self.bsdf.evaluate(self.wo, light.wi);
        if value == Vec3::ZERO {
            return None;
        }
        let light_pdf = self.light_samples as f32 * light.pdf;
        let weight = weight::power(light_pdf, self.indirect_samples as f32 * bsdf_pdf);
        let contribution = self.throughput * value * light.radiance * (weight / light_pdf);
        if contribution == Vec3::ZERO {
            return None;
        }
        self.toward(&light, contribution)
    }

    /// A shadow ray to where the light was sampled. It carries its contribution, and the light's
    /// own triangle, which cannot hide itself.
    fn toward(&self, light: &LightSample, contribution: Vec3) -> Option<Ray> {
        let origin = self.surface.leave(light.wi);
        let ray = Ray {
            origin: origin.into(),
            direction: light.wi.into(),
            throughput: contribution.into(),
            distance: f32::INFINITY,
            hit_primitive: NO_PRIMITIVE,
            pdf: 0.0,
            ..*self.ray
        };
        let Some(lit) = light.surface else { return Some(ray) };
        let target = leave(lit.point, lit.error, lit.normal, -light.wi);
        let line = target.as_dvec3() - origin.as_dvec3();
        let distance = line.length();
        (distance > 0.0).then(|| Ray {
            direction: (line / distance).as_vec3().into(),
            distance: (distance * SHADOW_REACH) as f32,
            hit_primitive: lit.primitive,
            ..ray
        })
    }

    /// Estimates indirect light: throughput · f·cos / (m·p_bsdf).
    fn indirect_ray(&self, index: u32) -> Option<Ray> {
        let count = self.indirect_samples;
        let [u0, u1, u2, _] = self.place.numbers_of(Purpose::Scattering, index, count);
        let sample = self.bsdf.sample(self.wo, [u0, u1, u2])?;
        self.go_on(Ray {
            origin: self.surface.leave(sample.wi).into(),
            direction: sample.wi.into(),
            throughput: (self.throughput * sample.weight / count as f32).into(),
            branch: branch_of_indirect(self.ray.branch, index, count),
            pdf: sample.pdf * count as f32,
            flags: self.ray.flags & !ray_flags::SPECULAR_PATH,
            ..*self.ray
        })
    }

    /// Estimates the specular component: throughput · its reflectance or transmittance.
    fn specular_ray(&self) -> Option<Ray> {
        let [u, ..] = self.place.numbers(Purpose::Specular);
        let sample = self.bsdf.sample_specular(self.wo, u)?;
        let is_alone = self.indirect_samples == 0 || !self.bsdf.has_scattering();
        self.go_on(Ray {
            origin: self.surface.leave(sample.wi).into(),
            direction: sample.wi.into(),
            throughput: (self.throughput * sample.weight).into(),
            branch: branch_of_specular(self.ray.branch, is_alone),
            pdf: 0.0,
            ..*self.ray
        })
    }

    /// Sends a ray on to the next depth, if it carries anything and survives roulette.
    fn go_on(&self, ray: Ray) -> Option<Ray> {
        let next = Ray {
            distance: f32::INFINITY,
            hit_primitive: NO_PRIMITIVE,
            depth: self.ray.depth + 1,
            ..ray
        };
        let throughput = Vec3::from(next.throughput);
        if throughput == Vec3::ZERO {
            return None;
        }
        let settings = &self.renderer.settings;
        if settings.roulette_depth.is_none_or(|depth| u32::from(next.depth) < depth) {
            return Some(next);
        }
        let survival = throughput.max_element().min(SURVIVAL_MAX);
        let [u, ..] = Place::of_ray(settings.seed, &next).numbers(Purpose::Roulette);
        (u < survival).then(|| Ray { throughput: (throughput / survival).into(), ..next })
    }
}
