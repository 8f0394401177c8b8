//! Light from where there is no surface: the same from everywhere, or an image in latitude and
//! longitude.
//!
//! The middle of the image lies toward −z, its top toward +y, its right half toward +x: seen from
//! inside, it is not mirrored. A rotation turns it about +y, counter-clockwise seen from above.
//! The constant environment is sampled uniformly over the sphere, since the receiver's normal is
//! not known here.

use std::f32::consts::{FRAC_1_PI, PI};
use std::f64;

use equilux_common::scene::{Environment, Tables, Texture};
use glam::{Vec2, Vec3};

use super::luminance;
use crate::texture::{self, Rows};
use crate::warp;

/// Keeps densities finite at the poles, where rows of texels shrink to points.
const SIN_MIN: f32 = 1e-6;

/// The environment as a luminaire.
#[derive(Clone, Debug)]
pub(super) enum EnvironmentLight {
    Black,
    Constant(Vec3),
    Image(Box<ImageLight>),
}

/// An image that surrounds the scene.
#[derive(Clone, Debug)]
pub(super) struct ImageLight {
    image: Texture,
    scale: f32,
    /// Sine and cosine of the rotation.
    turn: Vec2,
    texels: TexelChoice,
    /// Luminance, integrated over all directions.
    luminance: f64,
}

impl EnvironmentLight {
    pub(super) fn new(tables: &Tables) -> Self {
        match tables.environment {
            Environment::Black => Self::Black,
            Environment::Constant { radiance } => Self::Constant(Vec3::from(radiance)),
            Environment::Image { texture, scale, rotation } => {
                let images = &tables.textures;
                let image = images.get(texture as usize).filter(|image| image.width > 0);
                image.map_or(Self::Black, |image| {
                    Self::Image(Box::new(ImageLight::new(image.clone(), scale, rotation)))
                })
            }
        }
    }

    /// Bytes of memory that its image takes.
    pub(super) fn bytes(&self) -> usize {
        match self {
            Self::Black | Self::Constant(_) => 0,
            Self::Image(light) => {
                texture::bytes(&light.image) + size_of_val(light.texels.columns.as_slice())
            }
        }
    }

    /// Luminous flux through a disk of this radius from all sides.
    pub(super) fn power(&self, radius: f64) -> f64 {
        let disk = f64::consts::PI * radius * radius;
        match self {
            Self::Black => 0.0,
            Self::Constant(radiance) => 4.0 * f64::consts::PI * luminance(*radiance) * disk,
            Self::Image(image) => image.luminance * disk,
        }
    }

    /// Radiance from this direction.
    pub(super) fn radiance(&self, direction: Vec3) -> Vec3 {
        match self {
            Self::Black => Vec3::ZERO,
            Self::Constant(radiance) => *radiance,
            Self::Image(image) => image.radiance(direction),
        }
    }

    /// Density per solid angle of [`EnvironmentLight::sample`].
    pub(super) fn pdf(&self, direction: Vec3) -> f32 {
        match self {
            Self::Black => 0.0,
            Self::Constant(_) => 0.25 * FRAC_1_PI,
            Self::Image(image) => image.pdf(direction),
        }
    }

    /// A direction in which there is light.
    pub(super) fn sample(&self, u: [f32; 2]) -> Option<Vec3> {
        match self {
            Self::Black => None,
            Self::Constant(_) => Some(warp::sphere(u)),
            Self::Image(image) => Some(image.direction(image.texels.sample(u))),
        }
    }
}

impl ImageLight {
    fn new(image: Texture, scale: f32, rotation: f32) -> Self {
        let radians = f64::from(rotation).rem_euclid(360.0).to_radians();
        let turn = Vec2::new(libm::sin(radians) as f32, libm::cos(radians) as f32);
        let (texels, sum) = TexelChoice::new(&image);
        // A texel's solid angle is sinθ · 2π/width · π/height; the sum has the sine already.
        let solid_angle = 2.0 * f64::consts::PI * f64::consts::PI
            / (f64::from(image.width) * f64::from(image.height));
        let luminance = sum * solid_angle * f64::from(scale).max(0.0);
        Self { image, scale, turn, texels, luminance }
    }

    fn radiance(&self, direction: Vec3) -> Vec3 {
        let position = self.position(direction);
        let uv = [position.x, 1.0 - position.y];
        texture::lookup_with(&self.image, uv, Rows::Clamp) * self.scale
    }

    /// The density on the image over 2π² sinθ, the solid angle of the image per its area.
    fn pdf(&self, direction: Vec3) -> f32 {
        let sin = Vec2::new(direction.x, direction.z).length().max(SIN_MIN);
        self.texels.density(self.position(direction)) / (2.0 * PI * PI * sin)
    }

    /// Where a direction lies on the image: 0 to 1 to the right and down.
    fn position(&self, direction: Vec3) -> Vec2 {
        let (sin, cos) = self.turn.into();
        let x = direction.x * cos - direction.z * sin;
        let z = direction.x * sin + direction.z * cos;
        let longitude = libm::atan2f(x, -z);
        let from_top = libm::acosf(direction.y.clamp(-1.0, 1.0));
        Vec2::new(0.5 + longitude * (0.5 * FRAC_1_PI), from_top * FRAC_1_PI)
    }

    /// The direction of a position on the image.
    fn direction(&self, position: Vec2) -> Vec3 {
        let (sin_longitude, cos_longitude) = libm::sincosf((position.x - 0.5) * 2.0 * PI);
        let (sin_from_top, y) = libm::sincosf(position.y * PI);
        let (x, z) = (sin_longitude * sin_from_top, -cos_longitude * sin_from_top);
        let (sin, cos) = self.turn.into();
        Vec3::new(x * cos + z * sin, y, z * cos - x * sin)
    }
}

/// Chooses texels by luminance × sinθ: first the row, then the column.
#[derive(Clone, Debug)]
struct TexelChoice {
    width: usize,
    /// For each row and each texel of it, the probability of all up to and including it.
    columns: Vec<f32>,
    rows: Vec<f32>,
}

impl TexelChoice {
    /// The choice, and the sum of all weights.
    fn new(image: &Texture) -> (Self, f64) {
        let (width, height) = (image.width as usize, image.height as usize);
        let mut columns = Vec::with_capacity(width * height);
        let mut row_weights = Vec::with_capacity(height);
        for y in 0..image.height {
            let sin = libm::sin(f64::consts::PI * (f64::from(y) + 0.5) / f64::from(image.height));
            let weights: Vec<f64> =
                (0..image.width).map(|x| mean_luminance(image, x, y) * sin).collect();
            row_weights.push(push_sums(&mut columns, &weights));
        }
        let mut rows = Vec::with_capacity(height);
        let sum = push_sums(&mut rows, &row_weights);
        (Self { width, columns, rows }, sum)
    }

    /// A position on the image (0 to 1 to the right and down), uniform within its texel.
    fn sample(&self, u: [f32; 2]) -> Vec2 {
        let (row, y) = invert(&self.rows, u[1]);
        let (_, x) = invert(self.row(row), u[0]);
        Vec2::new(x, y)
    }

    /// The density of [`TexelChoice::sample`] over the unit square.
    fn density(&self, position: Vec2) -> f32 {
        let place = |x: f32, count: usize| ((x * count as f32) as usize).min(count - 1);
        let row = place(position.y, self.rows.len());
        let column = place(position.x, self.width);
        let texel_count = self.width as f32 * self.rows.len() as f32;
        step(&self.rows, row) * step(self.row(row), column) * texel_count
    }

    fn row(&self, row: usize) -> &[f32] {
        &self.columns[row * self.width..(row + 1) * self.width]
    }
}

/// Mean luminance over the area of a texel. Bilinear interpolation mixes in an eighth of each
/// neighbor, so that a black texel beside a bright one is not black.
fn mean_luminance(image: &Texture, x: u32, y: u32) -> f64 {
    let column = |x: u32| {
        let at = |y: u32| luminance(texture::texel(image, x, y)).max(0.0);
        (at(y.saturating_sub(1)) + 6.0 * at(y) + at((y + 1).min(image.height - 1))) / 8.0
    };
    let (left, right) = ((x + image.width - 1) % image.width, (x + 1) % image.width);
    (column(left) + 6.0 * column(x) + column(right)) / 8.0
}

/// Appends the sums of `weights`, scaled to end at 1, and returns their total.
fn push_sums(sums: &mut Vec<f32>, weights: &[f64]) -> f64 {
    let total: f64 = weights.iter().sum();
    let scale = if total > 0.0 { 1.0 / total } else { 0.0 };
    let mut sum = 0.0;
    sums.extend(weights.iter().map(|weight| {
        sum += weight;
        (sum * scale) as f32
    }));
    total
}

/// The step of `sums` that `u` falls on, and where (0 to 1 over all steps) it falls.
fn invert(sums: &[f32], u: f32) -> (usize, f32) {
    let index = sums.partition_point(|&sum| sum <= u).min(sums.len() - 1);
    let width = step(sums, index);
    let within = if width > 0.0 { (u - (sums[index] - width)) / width } else { 0.5 };
    (index, (index as f32 + within.clamp(0.0, 1.0)) / sums.len() as f32)
}

/// The probability of a step.
fn step(sums: &[f32], index: usize) -> f32 {
    let before = if index == 0 { 0.0 } else { sums[index - 1] };
    sums[index] - before
}
