//! The luminaires: every triangle that emits, and the environment.
//!
//! A light is chosen by its power, a triangle is sampled by its area, the environment by its
//! radiance. Every density is per solid angle at the receiver and includes the choice, and
//! [`Lights::pdf_of_hit`] and [`Lights::pdf_of_environment`] answer with the very numbers that
//! [`Lights::sample`] gives, so that the two ways to find a light can be weighed one against the
//! other.

mod choice;
mod environment;
#[cfg(test)]
mod tests;
mod triangle;

use equilux_common::scene::{Luminaire, Tables};
use glam::Vec3;

use choice::Choice;
use environment::EnvironmentLight;
use triangle::{LightTriangle, PoweredTriangle};

use crate::geometry::Bounds;

/// All light of a scene.
#[derive(Clone, Debug)]
pub struct Lights {
    /// By primitive id.
    triangles: Vec<LightTriangle>,
    environment: EnvironmentLight,
    /// Probability of choosing the environment.
    environment_probability: f32,
    /// By power: the triangles in their order, then the environment.
    choice: Choice,
}

/// Light arriving at a point, if nothing is in its way.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Toward the light; unit length.
    pub wi: Vec3,
    /// How far it is; infinity for the environment.
    pub distance: f32,
    /// Radiance per channel.
    pub radiance: Vec3,
    /// Density per solid angle, the choice of the light included.
    pub pdf: f32,
    /// Where on which surface; none for the environment.
    pub surface: Option<LightPoint>,
}

/// A point of a luminaire.
#[derive(Clone, Copy, Debug)]
pub struct LightPoint {
    /// Its triangle.
    pub primitive: u32,
    /// The point.
    pub point: Vec3,
    /// Bound of the point's rounding error, per axis.
    pub error: Vec3,
    /// Unit normal of the side that emits.
    pub normal: Vec3,
}

impl Lights {
    /// Gathers the luminaires of a model within these bounds, by which the power of the environment
    /// is measured. They come in the order of their primitive ids.
    #[must_use]
    pub fn new(tables: &Tables, luminaires: &[Luminaire], bounds: &Bounds) -> Self {
        let environment = EnvironmentLight::new(tables);
        let powered = luminaires.iter().filter_map(|light| PoweredTriangle::new(light, tables));
        let powered: Vec<PoweredTriangle> = powered.collect();
        let environment_power = environment.power(model_radius(bounds));
        let powers = powered.iter().map(|light| light.power).chain([environment_power]);
        let choice = Choice::new(powers);
        let triangles: Vec<LightTriangle> = powered
            .iter()
            .enumerate()
            .map(|(position, light)| light.with_probability(choice.probability(position)))
            .collect();
        let environment_probability = choice.probability(triangles.len()) as f32;
        Self { triangles, environment, environment_probability, choice }
    }

    /// Whether there is no light at all.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.choice.is_empty()
    }

    /// Bytes of memory that its large parts take.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.triangles.as_slice()) + self.environment.bytes()
    }

    /// Draws light that arrives at `from`: `u[0]` chooses the light, the others the point on it.
    /// None where the light drawn does not shine here, which counts as a sample of radiance 0.
    #[must_use]
    pub fn sample(&self, from: Vec3, u: [f32; 3]) -> Option<LightSample> {
        let position = self.choice.pick(u[0])?;
        let place = [u[1], u[2]];
        match self.triangles.get(position) {
            Some(light) => light.sample(from, place),
            None => self.sample_environment(place),
        }
    }

    /// The density with which [`Lights::sample`] draws the point of `primitive` that lies at this
    /// distance along a ray of this direction (unit length, toward the light); 0 where the light
    /// does not shine.
    #[must_use]
    pub fn pdf_of_hit(&self, primitive: u32, direction: Vec3, distance: f32) -> f32 {
        self.light(primitive).map_or(0.0, |light| light.pdf(direction, distance))
    }

    /// The density with which [`Lights::sample`] draws this direction of the environment.
    #[must_use]
    pub fn pdf_of_environment(&self, direction: Vec3) -> f32 {
        self.environment.pdf(direction) * self.environment_probability
    }

    /// Radiance that `primitive` sends against a ray that hits it with this direction; zero from
    /// the back and from what is no light.
    #[must_use]
    pub fn emission(&self, primitive: u32, direction: Vec3) -> Vec3 {
        self.light(primitive).map_or(Vec3::ZERO, |light| light.emission(direction))
    }

    /// Radiance that the environment sends against a ray of this direction.
    #[must_use]
    pub fn environment(&self, direction: Vec3) -> Vec3 {
        self.environment.radiance(direction)
    }

    fn light(&self, primitive: u32) -> Option<&LightTriangle> {
        let position = self.triangles.binary_search_by_key(&primitive, |light| light.primitive);
        position.ok().map(|position| &self.triangles[position])
    }

    fn sample_environment(&self, u: [f32; 2]) -> Option<LightSample> {
        let wi = self.environment.sample(u)?;
        let pdf = self.pdf_of_environment(wi);
        let radiance = self.environment.radiance(wi);
        let sample = LightSample { wi, distance: f32::INFINITY, radiance, pdf, surface: None };
        (pdf > 0.0).then_some(sample)
    }
}

/// Luminance of a colour with Rec. 709 primaries.
fn luminance(color: Vec3) -> f64 {
    let [r, g, b] = color.to_array().map(f64::from);
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// Radius of a sphere around the bounds; 1 where they are empty.
fn model_radius(bounds: &Bounds) -> f64 {
    let radius = 0.5 * (bounds.upper - bounds.lower).as_dvec3().length();
    if radius.is_finite() && radius > 0.0 { radius } else { 1.0 }
}
