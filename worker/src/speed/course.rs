//! The course: a small scene with all that makes scenes costly, built in code, the same everywhere.
//!
//! A room with a lamp, uneven ground, a sphere of glass and one of mirror: 1,400 triangles of five
//! materials, which with their tree are more than the nearest cache holds.

use std::sync::atomic::AtomicBool;

use equilux_common::bundle::Share;
use equilux_common::credit::Credit;
use equilux_common::ids::{Attempt, UnitId};
use equilux_common::job::{Filter, PerDepth, Settings};
use equilux_common::scene::camera::Camera;
use equilux_common::scene::{Geometry, Material, NO_INDEX, Scene, Surface, Tables, Triangle};
use equilux_common::unit::{Granularity, UnitGrid};
use equilux_common::work::{Samples, Work};
use equilux_render::renderer::Renderer;
use equilux_render::scratch::Scratch;

/// Side of the course's image, which is one unit: a lap is some hundred paths, about a millisecond.
const SIDE_PIXELS: u32 = 16;

/// Squares along a side of the ground, and along an edge of the cubes that spheres are made of.
const GROUND_SIDE: u32 = 16;
const SPHERE_SIDE: u32 = 6;

const WALL: u32 = 0;
const GROUND: u32 = 1;
const LAMP: u32 = 2;
const GLASS: u32 = 3;
const MIRROR: u32 = 4;

type Point = [f32; 3];

/// The course, ready to be run by any number of threads.
pub(super) struct Course {
    renderer: Renderer,
}

/// A thread on the course.
pub(super) struct Runner<'a> {
    course: &'a Course,
    scratch: Scratch,
    /// Never set.
    interrupt: AtomicBool,
}

impl Course {
    pub(super) fn new() -> Self {
        let (settings, camera) = (settings(), camera());
        let granularity = Granularity { tile_side_pixels: SIDE_PIXELS, samples_per_unit: 1 };
        let grid = UnitGrid::new(SIDE_PIXELS, settings.region(), 1, granularity);
        let renderer = Renderer::new(scene(), &camera, &settings, grid);
        Self { renderer: renderer.expect("the course is right") }
    }

    pub(super) fn runner(&self) -> Runner<'_> {
        let (scratch, interrupt) = (Scratch::default(), AtomicBool::new(false));
        Runner { course: self, scratch, interrupt }
    }
}

impl Runner<'_> {
    /// Traces all of the image; says how many rays that took.
    pub(super) fn lap(&mut self) -> u64 {
        let share = Share { unit: UnitId(0), attempt: Attempt(0), credit: Credit::whole() };
        let path_count = SIDE_PIXELS * SIDE_PIXELS;
        let work = Work::Samples(Samples { share, first_path: 0, path_count });
        let outcome = self.course.renderer.trace(work, &self.interrupt, &mut self.scratch);
        outcome.expect("the course's own work").counts.retired
    }
}

fn settings() -> Settings {
    Settings {
        width: SIDE_PIXELS,
        height: SIDE_PIXELS,
        crop: None,
        filter: Filter::Box,
        samples_per_pixel: 1,
        max_depth: 6,
        light_samples: PerDepth::default(),
        indirect_samples: PerDepth::default(),
        roulette_depth: None,
        seed: 1,
    }
}

fn camera() -> Camera {
    Camera {
        eye: [0.0, 1.2, 3.8],
        target: [0.0, 0.8, 0.0],
        up: [0.0, 1.0, 0.0],
        vfov: 50.0,
        aperture: 0.0,
        focus_distance: 1.0,
    }
}

fn scene() -> Scene {
    let mut geometry = Geometry::default();
    add_room(&mut geometry);
    add_ground(&mut geometry);
    add_sphere(&mut geometry, [-0.9, 0.9, 0.0], 0.7, GLASS);
    add_sphere(&mut geometry, [0.9, 0.9, -0.6], 0.7, MIRROR);
    let tables = Tables { materials: materials(), ..Tables::default() };
    Scene { geometry, tables, ..Scene::default() }
}

/// In the order of the constants.
fn materials() -> Vec<Material> {
    let black =
        Surface::Plain { diffuse: [0.0; 3], diffuse_texture: None, specular: [0.0; 3], alpha: 1.0 };
    let wall = Surface::Plain {
        diffuse: [0.7, 0.6, 0.5],
        diffuse_texture: None,
        specular: [0.1; 3],
        alpha: 0.3,
    };
    let ground =
        Surface::Pbr { base: [0.4, 0.5, 0.3], base_texture: None, roughness: 0.5, metallic: 0.2 };
    let glass = Surface::Glass { ior: 1.5, transmittance: [0.95; 3] };
    let mirror = Surface::Mirror { reflectance: [0.9; 3] };
    let material = |emission, surface| {
        let name = String::new();
        Material { name, emission: [emission; 3], surface, opacity: 1.0 }
    };
    vec![
        material(0.0, wall),
        material(0.0, ground),
        material(12.0, black),
        material(0.0, glass),
        material(0.0, mirror),
    ]
}

/// Four walls, a ceiling and the lamp below it.
fn add_room(geometry: &mut Geometry) {
    let (x, y, z) = ([4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 8.0]);
    let sheets = [
        ([-2.0, -0.5, -4.0], x, y, WALL),
        ([-2.0, -0.5, 4.0], y, x, WALL),
        ([-2.0, -0.5, -4.0], y, z, WALL),
        ([2.0, -0.5, -4.0], z, y, WALL),
        ([-2.0, 3.5, -4.0], x, z, WALL),
        ([-0.5, 3.4, -0.5], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], LAMP),
    ];
    for (corner, across, up, material) in sheets {
        add_sheet(geometry, 1, material, |u, v| {
            std::array::from_fn(|axis| corner[axis] + across[axis] * u + up[axis] * v)
        });
    }
}

/// Squares of different heights that hang together.
fn add_ground(geometry: &mut Geometry) {
    add_sheet(geometry, GROUND_SIDE, GROUND, |u, v| {
        let (column, row) = (u * GROUND_SIDE as f32, v * GROUND_SIDE as f32);
        let height = (column * 7.0 + row * 3.0 + column * row) % 5.0 * 0.04;
        [u * 4.0 - 2.0, height, 4.0 - v * 8.0]
    });
}

/// The six faces of a cube, blown up.
fn add_sphere(geometry: &mut Geometry, center: Point, radius: f32, material: u32) {
    for face in 0..6_usize {
        let (axis, side) = (face % 3, if face < 3 { 1.0 } else { -1.0 });
        add_sheet(geometry, SPHERE_SIDE, material, |u, v| {
            // Turned with the side, so that every face looks outward.
            let (a, b) = ((2.0 * u - 1.0) * side, 2.0 * v - 1.0);
            let length = (1.0 + a * a + b * b).sqrt();
            let mut point = center;
            point[axis] += side * radius / length;
            point[(axis + 1) % 3] += a * radius / length;
            point[(axis + 2) % 3] += b * radius / length;
            point
        });
    }
}

/// A net of `side` × `side` squares; `at` says where the points of the unit square come to lie.
fn add_sheet(geometry: &mut Geometry, side: u32, material: u32, at: impl Fn(f32, f32) -> Point) {
    let first = geometry.positions.len() as u32;
    let along = |step: u32| step as f32 / side as f32;
    for (row, column) in (0..=side).flat_map(|row| (0..=side).map(move |column| (row, column))) {
        geometry.positions.push(at(along(column), along(row)));
    }
    for (row, column) in (0..side).flat_map(|row| (0..side).map(move |column| (row, column))) {
        let corner = first + row * (side + 1) + column;
        let (right, above) = (corner + 1, corner + side + 1);
        for positions in [[corner, right, above + 1], [corner, above + 1, above]] {
            let none = [NO_INDEX; 3];
            geometry.triangles.push(Triangle {
                positions,
                normals: none,
                texcoords: none,
                material,
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_lap_is_the_same_and_goes_deep() {
        let course = Course::new();
        let (mut first, mut second) = (course.runner(), course.runner());
        let rays = first.lap();
        assert_eq!((first.lap(), second.lap()), (rays, rays));
        assert!(rays > 6 * u64::from(SIDE_PIXELS * SIDE_PIXELS), "{rays}");
    }
}
