//! What a ray meets at its end: light, or a surface that sends it on.

use equilux_common::film::Features;
use equilux_common::ids::PartitionId;
use equilux_common::ray::{NO_PRIMITIVE, Ray};
use glam::Vec3;

use super::scatter::Scatter;
use super::{Shaded, weight};
use crate::bsdf::Bsdf;
use crate::geometry::Slot;
use crate::geometry::surface_point::SurfacePoint;
use crate::renderer::Renderer;

/// Shades a ray whose closest hit is known, and where it is: adds what it contributes and spawns
/// what it sends on.
pub(crate) fn shade(renderer: &Renderer, ray: &Ray, slot: Option<Slot>, shaded: &mut Shaded) {
    shaded.clear();
    if ray.hit_primitive == NO_PRIMITIVE {
        shaded.radiance = environment(renderer, ray);
        return;
    }
    let partition = renderer.partitions.get(PartitionId(ray.hit_partition));
    // Of a ray that another machine claims to have hit this, and that does not, nothing is made.
    let (Some(partition), Some(slot)) = (partition, slot) else { return };
    let Some(surface) = partition.surface_point(ray, slot) else { return };
    let material = &renderer.model.materials[partition.material(slot) as usize];
    let is_light = material.emission != [0.0; 3];
    if is_light {
        shaded.radiance = emission(renderer, ray);
    }
    let has_depth_left = u32::from(ray.depth) + 2 <= renderer.settings.max_depth;
    let goes_on = has_depth_left && !is_light;
    if ray.depth > 0 && !goes_on {
        return;
    }
    let SurfacePoint { uv, face_normal, shading_normal, .. } = surface;
    let bsdf = Bsdf::new(material, &renderer.model.textures, uv, face_normal, shading_normal);
    if ray.depth == 0 {
        shaded.features = Some(features(renderer, ray, &surface, &bsdf));
    }
    if goes_on {
        Scatter::new(renderer, ray, &surface, &bsdf).spawn(shaded);
    }
}

fn environment(renderer: &Renderer, ray: &Ray) -> Vec3 {
    let direction = Vec3::from(ray.direction);
    let radiance = renderer.model.lights.environment(direction);
    if radiance == Vec3::ZERO {
        return Vec3::ZERO;
    }
    found(renderer, ray, radiance, || renderer.model.lights.pdf_of_environment(direction))
}

fn emission(renderer: &Renderer, ray: &Ray) -> Vec3 {
    let direction = Vec3::from(ray.direction);
    let radiance = renderer.model.lights.emission(ray.hit_primitive, direction);
    if radiance == Vec3::ZERO {
        return Vec3::ZERO;
    }
    found(renderer, ray, radiance, || {
        renderer.model.lights.pdf_of_hit(ray.hit_primitive, direction, ray.distance)
    })
}

/// throughput · radiance · weight, where light samples may have found the same light: with m rays
/// drawn from the BSDF and n from the lights, w = (m·p_bsdf)² / ((m·p_bsdf)² + (n·p_light)²).
fn found(renderer: &Renderer, ray: &Ray, radiance: Vec3, pdf: impl Fn() -> f32) -> Vec3 {
    let unweighted = Vec3::from(ray.throughput) * radiance;
    // No light sample competes with what a camera or a specular ray finds.
    let Some(depth_before) = usize::from(ray.depth).checked_sub(1).filter(|_| ray.pdf > 0.0) else {
        return unweighted;
    };
    let light_samples = renderer.settings.light_samples.at(depth_before);
    unweighted * weight::power(ray.pdf, light_samples as f32 * pdf())
}

fn features(renderer: &Renderer, ray: &Ray, surface: &SurfacePoint, bsdf: &Bsdf) -> Features {
    let is_behind = surface.shading_normal.dot(Vec3::from(ray.direction)) > 0.0;
    let normal = if is_behind { -surface.shading_normal } else { surface.shading_normal };
    Features {
        albedo: bsdf.albedo().into(),
        normal: normal.into(),
        depth: renderer.caster.depth_of(surface.point),
    }
}
