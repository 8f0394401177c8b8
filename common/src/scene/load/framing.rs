//! What a model alone lacks: a camera that frames it, and light.
//!
//! The camera looks at the middle of the model's bounds from the front right and a little above,
//! from where a sphere around the bounds just fits the picture with a small margin.

use super::json::single;
use super::scene_file::VFOV_DEFAULT;
use crate::job::Settings;
use crate::scene::camera::Camera;
use crate::scene::{Environment, Geometry, Prototype};

/// From the model to the camera: right, up, front.
const DIRECTION: [f64; 3] = [0.5, 0.4, 1.0];

/// Room around the model.
const MARGIN: f64 = 1.02;

/// Radiance of the sky over a model that has no light: a white surface comes out white.
const SKY_RADIANCE: [f32; 3] = [1.0; 3];

/// A box along the axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Least coordinates.
    pub min: [f32; 3],
    /// Largest coordinates.
    pub max: [f32; 3],
}

impl Bounds {
    /// The box around all triangles; none if there are none. Around what is placed several times it
    /// is somewhat larger.
    #[must_use]
    pub fn of(geometry: &Geometry, prototypes: &[Prototype]) -> Option<Self> {
        let corners = geometry.triangles.iter().flat_map(|triangle| triangle.positions);
        let loose = Self::around(None, corners.map(|index| geometry.positions[index as usize]));
        let placed = prototypes.iter().flat_map(Prototype::boxes).flatten();
        Self::around(loose, placed)
    }

    /// The box around another one, if there is one, and some points.
    pub(super) fn around(
        bounds: Option<Self>,
        points: impl IntoIterator<Item = [f32; 3]>,
    ) -> Option<Self> {
        points.into_iter().fold(bounds, |bounds, p| {
            let Self { min, max } = bounds.unwrap_or(Self { min: p, max: p });
            Some(Self {
                min: std::array::from_fn(|axis| min[axis].min(p[axis])),
                max: std::array::from_fn(|axis| max[axis].max(p[axis])),
            })
        })
    }
}

/// A camera that shows all of what is in `bounds`.
pub(super) fn frame(bounds: &Bounds, settings: &Settings) -> Camera {
    let (min, max) = (bounds.min.map(f64::from), bounds.max.map(f64::from));
    let center: [f64; 3] = std::array::from_fn(|axis| (min[axis] + max[axis]) / 2.0);
    let radius = norm(std::array::from_fn(|axis| (max[axis] - min[axis]) / 2.0));
    let half_angle = f64::from(VFOV_DEFAULT).to_radians() / 2.0;
    let aspect = f64::from(settings.width) / f64::from(settings.height);
    let half_angle = libm::atan(libm::tan(half_angle) * aspect.min(1.0));
    let distance = radius * MARGIN / libm::sin(half_angle);
    let length = norm(DIRECTION);
    let eye = std::array::from_fn(|axis| center[axis] + DIRECTION[axis] / length * distance);
    Camera {
        eye: eye.map(single),
        target: center.map(single),
        up: [0.0, 1.0, 0.0],
        vfov: VFOV_DEFAULT,
        aperture: 0.0,
        focus_distance: single(distance),
    }
}

/// The plain sky over a model that has no light of its own.
pub(super) const fn sky() -> Environment {
    Environment::Constant { radiance: SKY_RADIANCE }
}

fn norm(v: [f64; 3]) -> f64 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::load::scene_file::default_settings;

    #[test]
    fn every_corner_is_in_the_picture() {
        let bounds = Bounds { min: [-1.0, 10.0, 3.0], max: [4.0, 11.0, 9.0] };
        for (width, height) in [(640, 480), (100, 400)] {
            let camera = frame(&bounds, &Settings { width, height, ..default_settings() });
            let axis: [f64; 3] =
                std::array::from_fn(|k| f64::from(camera.target[k]) - f64::from(camera.eye[k]));
            let half_height = libm::tan(f64::from(camera.vfov).to_radians() / 2.0);
            let half = half_height * f64::min(1.0, f64::from(width) / f64::from(height));
            for corner in 0..8 {
                let to: [f64; 3] = std::array::from_fn(|k| {
                    let end = if corner >> k & 1 == 0 { bounds.min[k] } else { bounds.max[k] };
                    f64::from(end) - f64::from(camera.eye[k])
                });
                let along = (0..3).map(|k| to[k] * axis[k]).sum::<f64>() / norm(axis);
                let aside = (norm(to).powi(2) - along * along).sqrt();
                assert!(along > 0.0 && aside < along * half, "corner {corner}");
            }
        }
    }
}
