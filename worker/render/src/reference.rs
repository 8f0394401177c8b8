//! The definition of the right image: every path in turn, in a plain loop, on one thread.
//!
//! No bundles, no units' shares, no interrupts; only the functions that say what light does. All
//! else in Equilux must give the same bits.

use equilux_common::film::TileSums;
use equilux_common::ids::{PartitionId, UnitId};
use equilux_common::ray::Ray;
use glam::Vec3;

use crate::geometry::Stack;
use crate::renderer::Renderer;
use crate::stage::{Shaded, shade};

/// Renders the job's region.
///
/// # Panics
/// If the model is not in one partition.
#[must_use]
pub fn render(renderer: &Renderer) -> TileSums {
    let whole = renderer.partitions.get(PartitionId(0)).expect("the model is in one partition");
    let mut film = TileSums::new(renderer.settings.region());
    let (mut stack, mut shaded) = (Stack::default(), Shaded::default());
    let mut rays = Vec::new();
    for id in 0..renderer.grid.unit_count() {
        let unit = renderer.grid.unit(UnitId(id)).expect("ids are below the count");
        for number in 0..unit.path_count() {
            let path @ (x, y, sample_index) = unit.path(number);
            let index = film.tile.index_of(x, y);
            film.add_sample(index, sample_index);
            rays.push(renderer.camera_ray(path));
            while let Some(mut ray) = rays.pop() {
                let slot = whole.intersect(&mut ray, &mut stack);
                shade(renderer, &ray, slot, &mut shaded);
                add(&mut film, index, &ray, &shaded);
                for shadow in &shaded.shadow_rays {
                    if !whole.is_occluded(shadow, &mut stack) {
                        film.add_radiance(index, sample_index, shadow.throughput);
                    }
                }
                rays.extend(shaded.indirect_rays.iter().chain(&shaded.specular_ray));
            }
        }
    }
    film
}

fn add(film: &mut TileSums, index: usize, ray: &Ray, shaded: &Shaded) {
    if shaded.radiance != Vec3::ZERO {
        film.add_radiance(index, ray.sample_index, shaded.radiance.into());
    }
    if let Some(features) = &shaded.features {
        film.add_features(index, features);
    }
}
