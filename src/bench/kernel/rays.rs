//! The rays that kernels are measured with: those of a renderer, but without materials.
//!
//! They are made once for a scene, by the renderer's own sampler, and come in the order in which a
//! renderer has them: camera rays pixel by pixel in tiles, and what they spawn in the order of the
//! hits.

use equilux_common::ids::UnitId;
use equilux_common::job::Settings;
use equilux_common::ray::{NO_PRIMITIVE, Ray};
use equilux_common::scene::camera::Camera;
use equilux_common::unit::{Granularity, Rect, Unit, UnitGrid};
use equilux_render::camera::RayCaster;
use equilux_render::frame::Frame;
use equilux_render::geometry::surface_point::SurfacePoint;
use equilux_render::geometry::{Partition, Stack};
use equilux_render::renderer::RenderError;
use equilux_render::sampler::{Place, Purpose};
use equilux_render::warp;
use glam::Vec3;

use super::kind::ByKind;
use super::targets::Targets;

/// Tiles as those of a render on few threads.
const TILES: Granularity = Granularity { tile_side_pixels: 16, samples_per_unit: 1 };

/// How far toward the light a shadow ray looks, over the distance: 1 − 2⁻¹⁹, as in the renderer,
/// so that neighbors of the triangle that it goes to do not hide it.
const SHADOW_REACH: f64 = 1.0 - 1.0 / 524_288.0;

/// What rays are made from.
pub(super) struct RayMaker<'a> {
    pub(super) partition: &'a Partition,
    /// What shadow rays go to.
    pub(super) targets: &'a Targets,
    /// Names the random numbers.
    pub(super) seed: u64,
}

/// Where a ray has hit.
struct Hit {
    ray: Ray,
    surface: SurfacePoint,
}

/// The camera rays of an image of about so many pixels, one through each.
pub(super) fn primary(
    camera: &Camera,
    settings: &Settings,
    count: u32,
) -> Result<Vec<Ray>, RenderError> {
    let (width, height) = sides(settings, count);
    let settings = Settings { width, height, crop: None, ..settings.clone() };
    let caster = RayCaster::new(camera, &settings).ok_or(RenderError::NoView)?;
    let grid = UnitGrid::new(width, Rect { x0: 0, y0: 0, x1: width, y1: height }, 1, TILES);
    let units = (0..grid.unit_count()).filter_map(|id| grid.unit(UnitId(id)));
    let ray = |unit: Unit, path| {
        let (x, y, sample) = unit.path(path);
        let place = Place::of_path(settings.seed, x + y * width, sample);
        caster.ray(x, y, sample, place.numbers(Purpose::Camera))
    };
    Ok(units.flat_map(|unit| (0..unit.path_count()).map(move |path| ray(unit, path))).collect())
}

/// Width and height of an image with about so many pixels, in the settings' proportion.
fn sides(settings: &Settings, count: u32) -> (u32, u32) {
    let (width, height) = (f64::from(settings.width), f64::from(settings.height));
    let scale = (f64::from(count) / (width * height)).sqrt();
    let side = |side: f64| (side * scale).round().max(1.0) as u32;
    (side(width), side(height))
}

impl RayMaker<'_> {
    /// Rays of all kinds that follow from camera rays.
    pub(super) fn all(&self, primary: Vec<Ray>) -> ByKind<Vec<Ray>> {
        let first = self.hits(&primary);
        let diffuse1: Vec<Ray> = first.iter().map(|hit| self.scattered(hit)).collect();
        let shadow1 = first.iter().filter_map(|hit| self.toward_light(hit)).collect();
        drop(first);
        let second = self.hits(&diffuse1);
        let diffuse2 = second.iter().map(|hit| self.scattered(hit)).collect();
        let shadow2 = second.iter().filter_map(|hit| self.toward_light(hit)).collect();
        ByKind([primary, diffuse1, diffuse2, shadow1, shadow2])
    }

    fn hits(&self, rays: &[Ray]) -> Vec<Hit> {
        let mut stack = Stack::default();
        let mut hit = |ray: &Ray| {
            let mut ray = *ray;
            let slot = self.partition.intersect(&mut ray, &mut stack)?;
            let surface = self.partition.surface_point(&ray, slot)?;
            Some(Hit { ray, surface })
        };
        rays.iter().filter_map(&mut hit).collect()
    }

    /// A cosine-distributed ray to the side that the last one came from.
    fn scattered(&self, hit: &Hit) -> Ray {
        let [u0, u1, ..] = self.place(hit).numbers(Purpose::Scattering);
        let direction = Frame::new(hit.normal()).to_world(warp::cosine_hemisphere([u0, u1]));
        Ray {
            origin: hit.surface.leave(direction).into(),
            direction: direction.normalize().into(),
            distance: f32::INFINITY,
            hit_primitive: NO_PRIMITIVE,
            depth: hit.ray.depth + 1,
            ..hit.ray
        }
    }

    /// A ray to a point of a light; none if that shines to the other side, of either surface: a
    /// renderer would not ask.
    fn toward_light(&self, hit: &Hit) -> Option<Ray> {
        let [u0, u1, u2, _] = self.place(hit).numbers(Purpose::Light);
        let target = self.targets.pick([u0, u1, u2])?;
        let toward = target.point - hit.surface.point;
        if toward.dot(hit.normal()) <= 0.0 || toward.dot(target.normal) >= 0.0 {
            return None;
        }
        let origin = hit.surface.leave(toward);
        let line = target.point.as_dvec3() - origin.as_dvec3();
        let distance = line.length();
        (distance > 0.0).then(|| Ray {
            origin: origin.into(),
            direction: (line / distance).as_vec3().into(),
            distance: (distance * SHADOW_REACH) as f32,
            hit_primitive: target.primitive,
            ..hit.ray
        })
    }

    fn place(&self, hit: &Hit) -> Place {
        Place::of_ray(self.seed, &hit.ray)
    }
}

impl Hit {
    /// The face normal on the side that the ray came from.
    fn normal(&self) -> Vec3 {
        let normal = self.surface.face_normal;
        if normal.dot(Vec3::from(self.ray.direction)) > 0.0 { -normal } else { normal }
    }
}
