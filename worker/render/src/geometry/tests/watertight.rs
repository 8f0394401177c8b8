//! No ray slips through a closed mesh, and none hits the surface that it leaves.

use equilux_common::ray::{NO_PRIMITIVE, Ray};
use equilux_common::scene::Geometry;
use glam::Vec3;

use super::meshes::{icosphere, subdivided_box};
use super::{Partition, Stack, Traversal, loose, ray};

/// Rays shot at each of the meshes; ten million in all.
const RAYS: u64 = 2_500_000;

/// Rays that are shot at once.
const BUNDLE_RAYS: usize = 50;

/// A plain generator (Vigna's SplitMix64) for the rays of these tests.
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    /// From −1 to 1.
    fn number(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / 8_388_608.0 - 1.0
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.number(), self.number(), self.number())
    }

    fn direction(&mut self) -> Vec3 {
        loop {
            let vector = self.vector();
            if (0.01..1.0).contains(&vector.length_squared()) {
                return vector.normalize();
            }
        }
    }
}

/// Directions to corners and to points of edges, along axes, and anywhere.
fn aim(random: &mut Random, geometry: &Geometry, origin: Vec3) -> Vec3 {
    let kind = random.bits() % 8;
    let triangle = &geometry.triangles[random.bits() as usize % geometry.triangles.len()];
    let [p, q, _] = triangle.positions.map(|index| Vec3::from(geometry.positions[index as usize]));
    match kind {
        0 | 1 => (p - origin).normalize(),
        2..=4 => (p.lerp(q, random.number().abs()) - origin).normalize(),
        5 => Vec3::AXES[random.bits() as usize % 3] * random.number().signum(),
        _ => random.direction(),
    }
}

fn shoot_from_inside(geometry: Geometry, radius: f32, center: Vec3, seed: u64) {
    let aims = geometry.clone();
    let partition = Partition::new(geometry);
    let (mut random, mut stack) = (Random(seed), Stack::default());
    let mut slots = [None; BUNDLE_RAYS];
    for bundle in 0..RAYS / BUNDLE_RAYS as u64 {
        let mut rays: [Ray; BUNDLE_RAYS] = std::array::from_fn(|_| {
            let origin = center + random.vector() * radius;
            ray(origin, aim(&mut random, &aims, origin))
        });
        let traversal = if bundle % 2 == 0 { Traversal::Shared } else { Traversal::Single };
        partition.intersect_all(&mut rays, &mut slots, traversal, &mut stack);
        for (ray, slot) in rays.iter().zip(slots) {
            assert!(slot.is_some(), "{ray:?} slips through, {traversal:?}");
        }
    }
}

#[test]
fn no_ray_slips_through_a_sphere() {
    shoot_from_inside(icosphere(4, 1.0, Vec3::ZERO), 0.5, Vec3::ZERO, 1);
}

#[test]
fn no_ray_slips_through_a_small_sphere_far_from_zero() {
    let center = Vec3::new(1000.0, -2000.0, 500.0);
    shoot_from_inside(icosphere(3, 0.1, center), 0.05, center, 2);
}

#[test]
fn no_ray_slips_through_a_box() {
    shoot_from_inside(subdivided_box(40, 3.0), 2.9, Vec3::ZERO, 3);
}

#[test]
fn no_ray_slips_through_a_huge_box_of_few_triangles() {
    shoot_from_inside(subdivided_box(2, 1e6), 9e5, Vec3::ZERO, 4);
}

/// Rays that start far outside and must find the small mesh that they aim at.
#[test]
fn a_small_mesh_is_found_from_afar() {
    let geometry = icosphere(3, 1e-3, Vec3::ZERO);
    let corners: Vec<Vec3> = geometry.positions.iter().copied().map(Vec3::from).collect();
    let partition = Partition::new(geometry);
    let (mut random, mut stack) = (Random(5), Stack::default());
    for _ in 0..200_000 {
        let origin = random.direction() * 100.0;
        let corner = corners[random.bits() as usize % corners.len()];
        // Well within the silhouette, compared with the rounding of a direction over 100 units.
        let target = corner.midpoint(Vec3::ZERO);
        let mut ray = ray(origin, (target - origin).normalize());
        partition.intersect(&mut ray, &mut stack);
        assert_ne!(ray.hit_primitive, NO_PRIMITIVE, "{origin:?} misses {target:?}");
    }
}

#[test]
fn rays_that_leave_a_sphere_do_not_hit_it() {
    for (seed, scale) in (0u64..).zip([1e-4f32, 1e-2, 1.0, 1e3, 1e6]) {
        let center = Vec3::new(0.3, -7.0, 2.0) * scale;
        let partition = Partition::new(icosphere(3, scale, center));
        let (mut random, mut stack) = (Random(seed), Stack::default());
        for _ in 0..100_000 {
            let origin = center + random.direction() * (3.0 * scale);
            let target = center + random.vector() * (0.5 * scale);
            let mut ray = ray(origin, (target - origin).normalize());
            let slot = partition.intersect(&mut ray, &mut stack).expect("aimed at the sphere");
            let point = partition.surface_point(&ray, slot).expect("not in its plane");
            let out = random.direction();
            let out = if out.dot(point.face_normal) < 0.0 { -out } else { out };
            let mut left = super::ray(point.leave(out), out);
            partition.intersect(&mut left, &mut stack);
            assert_eq!(left.hit_primitive, NO_PRIMITIVE, "scale {scale}: {ray:?} {left:?}");
        }
    }
}

#[test]
fn rays_that_leave_a_slanted_plane_do_not_hit_it() {
    for (seed, scale) in (10u64..).zip([1e-4f32, 1.0, 1e6]) {
        let (mut random, mut stack) = (Random(seed), Stack::default());
        for _ in 0..2_000 {
            let corners = [random.vector(), random.vector(), random.vector()].map(|v| v * scale);
            let partition = Partition::new(loose(&[corners]));
            for _ in 0..100 {
                let (u, v) = (random.number().abs(), random.number().abs());
                let target = corners[0]
                    + ((corners[1] - corners[0]) * u + (corners[2] - corners[0]) * v) * 0.5;
                let origin = random.vector() * (2.0 * scale);
                let mut ray = ray(origin, (target - origin).normalize());
                let slot = partition.intersect(&mut ray, &mut stack);
                let point = slot.and_then(|slot| partition.surface_point(&ray, slot));
                let Some(point) = point else { continue };
                let out = random.direction();
                let mut left = super::ray(point.leave(out), out);
                partition.intersect(&mut left, &mut stack);
                assert_eq!(left.hit_primitive, NO_PRIMITIVE, "scale {scale}: {left:?}");
            }
        }
    }
}

/// A shelf a thousandth above a floor of a million units is not lost.
#[test]
fn a_huge_floor_keeps_what_is_close_to_it() {
    let floor = 1e6;
    let corners = [[
        Vec3::new(-floor, 0.0, -floor),
        Vec3::new(-floor, 0.0, floor),
        Vec3::new(floor, 0.0, 0.0),
    ]];
    let partition = Partition::new(loose(&corners));
    let mut ray = ray(Vec3::new(0.1, 0.001, 0.2), Vec3::new(0.6, -0.8, 0.0));
    let slot = partition.intersect(&mut ray, &mut Stack::default()).expect("hit");
    assert!((ray.distance - 0.00125).abs() < 1e-8, "{ray:?}");
    let point = partition.surface_point(&ray, slot).expect("not in its plane");
    assert!(point.leave(Vec3::Y).y < 1e-6);
}
