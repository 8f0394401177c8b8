//! Camera rays: a pinhole or a thin lens, with the pixel's filter drawn from.
//!
//! Camera space is right-handed: x to the right, y up, and the view along −z. A sample of a pixel
//! is spread as the filter says and always counts 1 (Ernst, Stamminger, Greiner 2006), so that it
//! touches no other pixel.

use std::f32::consts::TAU;

use equilux_common::job::{Filter, Settings};
use equilux_common::ray::{NO_PRIMITIVE, Ray, ray_flags};
use equilux_common::scene::camera::Camera;
use glam::{DVec3, Vec3};

/// Standard deviation of the Gaussian filter in pixels.
const GAUSSIAN_DEVIATION: f32 = 0.5;

/// Where the Gaussian filter is cut, in pixels from the center.
const GAUSSIAN_RADIUS: f32 = 2.0;

/// A camera made ready to cast rays.
#[derive(Clone, Copy, Debug)]
pub struct RayCaster {
    eye: Vec3,
    forward: Vec3,
    right: Vec3,
    up: Vec3,
    /// Extent of a pixel on the plane at distance 1.
    pixel_size: f32,
    half_width: f32,
    half_height: f32,
    lens_radius: f32,
    focus_distance: f32,
    filter: Filter,
    width: u32,
}

impl RayCaster {
    /// Prepares the camera for an image; nothing if it has no direction: if it looks at where it
    /// stands, or straight along its up vector.
    #[must_use]
    pub fn new(camera: &Camera, settings: &Settings) -> Option<Self> {
        let [eye, target, up] =
            [camera.eye, camera.target, camera.up].map(|v| Vec3::from(v).as_dvec3());
        let forward = (target - eye).try_normalize()?;
        let right = forward.cross(up).try_normalize()?;
        let half_angle = f64::from(camera.vfov).to_radians() * 0.5;
        let (width, height) = (f64::from(settings.width), f64::from(settings.height));
        let pixel_size = 2.0 * libm::tan(half_angle) / height;
        Some(Self {
            eye: Vec3::from(camera.eye),
            forward: forward.as_vec3(),
            right: right.as_vec3(),
            up: DVec3::cross(right, forward).as_vec3(),
            pixel_size: pixel_size as f32,
            half_width: (width * 0.5) as f32,
            half_height: (height * 0.5) as f32,
            lens_radius: camera.aperture * 0.5,
            focus_distance: camera.focus_distance,
            filter: settings.filter,
            width: settings.width,
        })
    }

    /// The ray of a sample; `u` are two numbers for the place in the pixel and two for that on the
    /// lens.
    #[must_use]
    pub fn ray(&self, x: u32, y: u32, sample_index: u32, u: [f32; 4]) -> Ray {
        let [filter_x, filter_y] = offset(self.filter, [u[0], u[1]]);
        let across = (x as f32 + 0.5 + filter_x - self.half_width) * self.pixel_size;
        let above = (self.half_height - (y as f32 + 0.5 + filter_y)) * self.pixel_size;
        let view = self.forward + self.right * across + self.up * above;
        let (origin, direction) = self.through_lens(view, [u[2], u[3]]);
        Ray {
            origin: origin.into(),
            direction: direction.normalize().into(),
            throughput: [1.0; 3],
            distance: f32::INFINITY,
            hit_primitive: NO_PRIMITIVE,
            hit_partition: 0,
            pixel: x + y * self.width,
            sample_index,
            branch: 0,
            pdf: 0.0,
            depth: 0,
            share: 0,
            flags: ray_flags::SPECULAR_PATH,
        }
    }

    /// Distance of a point from the camera along its axis.
    #[must_use]
    pub fn depth_of(&self, point: Vec3) -> f32 {
        (point - self.eye).dot(self.forward)
    }

    /// Where a ray starts and goes that meets `view`, which is 1 long along the axis, in the plane
    /// in focus.
    fn through_lens(&self, view: Vec3, u: [f32; 2]) -> (Vec3, Vec3) {
        if self.lens_radius <= 0.0 {
            return (self.eye, view);
        }
        let radius = self.lens_radius * u[0].sqrt();
        let angle = TAU * u[1];
        let aside =
            self.right * (radius * libm::cosf(angle)) + self.up * (radius * libm::sinf(angle));
        (self.eye + aside, view * self.focus_distance - aside)
    }
}

/// How far from the pixel's center a sample lies, in pixels.
fn offset(filter: Filter, u: [f32; 2]) -> [f32; 2] {
    match filter {
        Filter::Box => u.map(|u| u - 0.5),
        Filter::Tent => u.map(tent),
        Filter::Gaussian => gaussian(u),
    }
}

/// Inverts the distribution function of a tent of radius 1.
fn tent(u: f32) -> f32 {
    if u < 0.5 { (2.0 * u).sqrt() - 1.0 } else { 1.0 - (2.0 - 2.0 * u).sqrt() }
}

/// A Gaussian in the plane, cut at a radius: its distribution function over the radius r is
/// (1 − exp(−r²/2σ²)) / (1 − exp(−R²/2σ²)).
fn gaussian(u: [f32; 2]) -> [f32; 2] {
    let variance = GAUSSIAN_DEVIATION * GAUSSIAN_DEVIATION;
    let kept = 1.0 - libm::expf(-GAUSSIAN_RADIUS * GAUSSIAN_RADIUS / (2.0 * variance));
    let radius = (-2.0 * variance * libm::logf(1.0 - u[0] * kept)).max(0.0).sqrt();
    let angle = TAU * u[1];
    [radius * libm::cosf(angle), radius * libm::sinf(angle)]
}

#[cfg(test)]
mod tests {
    use equilux_common::job::PerDepth;

    use super::*;

    fn settings(filter: Filter) -> Settings {
        Settings {
            width: 40,
            height: 20,
            crop: None,
            filter,
            samples_per_pixel: 1,
            max_depth: 2,
            light_samples: PerDepth::default(),
            indirect_samples: PerDepth::default(),
            roulette_depth: None,
            seed: 0,
        }
    }

    const CAMERA: Camera = Camera {
        eye: [1.0, 2.0, 3.0],
        target: [1.0, 2.0, -7.0],
        up: [0.0, 1.0, 0.0],
        vfov: 90.0,
        aperture: 0.0,
        focus_distance: 5.0,
    };

    fn direction(caster: &RayCaster, x: u32, y: u32, u: [f32; 4]) -> Vec3 {
        Vec3::from(caster.ray(x, y, 0, u).direction)
    }

    #[test]
    fn the_top_left_corner_is_up_and_to_the_left() {
        let caster = RayCaster::new(&CAMERA, &settings(Filter::Box)).expect("a camera");
        // 90 degrees from top to bottom, so the top edge is at 45 degrees; twice that across.
        let corner = direction(&caster, 0, 0, [0.0; 4]);
        assert!(corner.distance(Vec3::new(-2.0, 1.0, -1.0).normalize()) < 1e-6, "{corner}");
        let middle = direction(&caster, 20, 10, [0.0; 4]);
        assert!(middle.distance(Vec3::NEG_Z) < 1e-6, "{middle}");
        assert_eq!(caster.ray(3, 2, 0, [0.0; 4]).pixel, 83);
        assert!((caster.depth_of(Vec3::new(9.0, -3.0, 1.0)) - 2.0).abs() < 1e-6);
    }

    #[test]
    fn all_rays_of_a_lens_meet_in_the_plane_in_focus() {
        let camera = Camera { aperture: 0.8, ..CAMERA };
        let caster = RayCaster::new(&camera, &settings(Filter::Box)).expect("a camera");
        let pinhole = direction(&RayCaster { lens_radius: 0.0, ..caster }, 7, 3, [0.5; 4]);
        let focus = Vec3::from(CAMERA.eye) + pinhole * (5.0 / -pinhole.z);
        for number in 0..16 {
            let u = [0.5, 0.5, (number as f32 + 0.5) / 16.0, (number % 4) as f32 / 4.0];
            let ray = caster.ray(7, 3, 0, u);
            let (origin, direction) = (Vec3::from(ray.origin), Vec3::from(ray.direction));
            assert!(origin.distance(Vec3::from(CAMERA.eye)) <= 0.4);
            assert!((focus - origin).normalize().distance(direction) < 1e-6);
        }
    }

    #[test]
    fn filters_have_their_moments() {
        // Variance per axis: 1/12 of a box, 1/6 of a tent, 1/4 of the Gaussian (nearly: it is cut).
        for (filter, variance) in
            [(Filter::Box, 1.0 / 12.0), (Filter::Tent, 1.0 / 6.0), (Filter::Gaussian, 0.25)]
        {
            let side = 200u16;
            let (mut sum, mut squares) = ([0.0; 2], [0.0; 2]);
            for number in 0..side * side {
                let u =
                    [number % side, number / side].map(|k| (f32::from(k) + 0.5) / f32::from(side));
                for (axis, offset) in offset(filter, u).map(f64::from).into_iter().enumerate() {
                    sum[axis] += offset;
                    squares[axis] += offset * offset;
                }
            }
            let count = f64::from(side) * f64::from(side);
            for axis in 0..2 {
                assert!((sum[axis] / count).abs() < 1e-3, "{filter:?}");
                assert!((squares[axis] / count - variance).abs() < 2e-3, "{filter:?}");
            }
        }
    }

    #[test]
    fn a_camera_without_direction_is_refused() {
        for camera in
            [Camera { target: CAMERA.eye, ..CAMERA }, Camera { up: [0.0, 0.0, 3.0], ..CAMERA }]
        {
            assert!(RayCaster::new(&camera, &settings(Filter::Box)).is_none());
        }
    }
}
