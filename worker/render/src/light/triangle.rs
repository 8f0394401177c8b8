//! A triangle that emits: one-sided, the same radiance everywhere and in all directions.

use std::f64::consts::PI;

use equilux_common::scene::{Luminaire, Tables};
use glam::{DVec3, Vec3};

use super::{LightPoint, LightSample, luminance};
use crate::warp;

/// γ₆ of Higham's error analysis: three products of a rounded weight and their sum, as pbrt counts
/// them (*Physically Based Rendering*, 4th edition, 6.8).
const POINT_ERROR: f32 = 6.0 * (f32::EPSILON / 2.0) / (1.0 - 6.0 * (f32::EPSILON / 2.0));

/// A luminaire, ready to be sampled.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightTriangle {
    pub(super) primitive: u32,
    corners: [Vec3; 3],
    normal: Vec3,
    radiance: Vec3,
    /// Density per area: the probability of its choice over its area.
    density: f32,
}

/// A luminaire whose probability is not known yet.
#[derive(Clone, Copy, Debug)]
pub(super) struct PoweredTriangle {
    light: LightTriangle,
    area: f64,
    /// Luminous flux: luminance · area · π.
    pub(super) power: f64,
}

impl PoweredTriangle {
    /// None for a triangle without area, which no ray hits.
    pub(super) fn new(luminaire: &Luminaire, tables: &Tables) -> Option<Self> {
        let corners = luminaire.corners.map(Vec3::from);
        let radiance = Vec3::from(tables.materials[luminaire.material as usize].emission);
        let [a, b, c] = corners.map(|corner| corner.as_dvec3());
        let cross: DVec3 = (b - a).cross(c - a);
        let normal = cross.try_normalize()?.as_vec3();
        let area = 0.5 * cross.length();
        let primitive = luminaire.primitive;
        let light = LightTriangle { primitive, corners, normal, radiance, density: 0.0 };
        Some(Self { light, area, power: luminance(radiance) * area * PI })
    }

    /// The luminaire when it is chosen with this probability.
    pub(super) fn with_probability(&self, probability: f64) -> LightTriangle {
        LightTriangle { density: (probability / self.area) as f32, ..self.light }
    }
}

impl LightTriangle {
    /// Draws a point uniformly by area; none if it does not shine on `from`.
    pub(super) fn sample(&self, from: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let weights = warp::triangle(u);
        let weighted: [Vec3; 3] =
            std::array::from_fn(|corner| self.corners[corner] * weights[corner]);
        let point = weighted[0] + weighted[1] + weighted[2];
        let error = (weighted[0].abs() + weighted[1].abs() + weighted[2].abs()) * POINT_ERROR;
        let to_light = point - from;
        let distance = to_light.length();
        let wi = to_light / distance;
        let pdf = self.pdf(wi, distance);
        let surface = LightPoint { primitive: self.primitive, point, error, normal: self.normal };
        let is_lit = pdf > 0.0 && pdf.is_finite();
        is_lit.then_some(LightSample {
            wi,
            distance,
            radiance: self.radiance,
            pdf,
            surface: Some(surface),
        })
    }

    /// Density per solid angle, distance²/(cos · area) · probability, of the point at this distance
    /// along `direction`; 0 from the back.
    pub(super) fn pdf(&self, direction: Vec3, distance: f32) -> f32 {
        let cos = -self.normal.dot(direction);
        if cos > 0.0 { distance * distance * self.density / cos } else { 0.0 }
    }

    /// Radiance against a ray of this direction.
    pub(super) fn emission(&self, direction: Vec3) -> Vec3 {
        if self.normal.dot(direction) < 0.0 { self.radiance } else { Vec3::ZERO }
    }
}
