//! The model against its simplest reading: every triangle tried in turn.

use equilux_common::ray::{NO_PRIMITIVE, Ray};
use equilux_common::scene::{Geometry, NO_INDEX, Triangle};
use glam::Vec3;
use obvhs::BvhBuildParams;
use proptest::prelude::*;

use super::hierarchy::{HierarchyBuilder, Stack};
use super::tree::{LeafTriangle, Tree, World};
use super::*;

pub(crate) mod meshes;
mod placed;
mod watertight;

/// Geometry of loose triangles.
pub(super) fn loose(corners: &[[Vec3; 3]]) -> Geometry {
    let triangles = (0..u32::try_from(corners.len()).expect("few triangles"))
        .map(|index| Triangle {
            positions: [3 * index, 3 * index + 1, 3 * index + 2],
            normals: [NO_INDEX; 3],
            texcoords: [NO_INDEX; 3],
            material: 0,
        })
        .collect();
    let positions = corners.iter().flatten().map(Vec3::to_array).collect();
    Geometry { positions, triangles, ..Geometry::default() }
}

/// A ray that has hit nothing.
pub(crate) fn ray(origin: Vec3, direction: Vec3) -> Ray {
    Ray {
        origin: origin.into(),
        direction: direction.into(),
        throughput: [1.0; 3],
        distance: f32::INFINITY,
        hit_primitive: NO_PRIMITIVE,
        hit_partition: 0,
        pixel: 0,
        sample_index: 0,
        branch: 0,
        pdf: 0.0,
        depth: 0,
        share: 0,
        flags: 0,
    }
}

fn distance(probe: &Probe, corners: &[Vec3; 3]) -> Option<f32> {
    match probe.axis {
        0 => probe.distance::<0>(corners, f32::INFINITY),
        1 => probe.distance::<1>(corners, f32::INFINITY),
        _ => probe.distance::<2>(corners, f32::INFINITY),
    }
}

/// The closest hit by trying every triangle.
fn closest_of_all(corners: &[[Vec3; 3]], bounds: &Bounds, ray: &Ray) -> (u32, u32) {
    let probe = Probe::new(ray, bounds);
    let mut closest = (f32::INFINITY, NO_PRIMITIVE);
    for (primitive, corners) in (0u32..).zip(corners) {
        if let Some(distance) = distance(&probe, corners)
            && (distance, primitive) < closest
        {
            closest = (distance, primitive);
        }
    }
    (closest.0.to_bits(), closest.1)
}

/// Coordinates of a coarse grid, so that edges, corners and planes are hit exactly and boxes are
/// flat; some are moved by an ulp.
fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![
        4 => (-3i8..=3).prop_map(f32::from),
        1 => Just(-0.0f32),
        1 => (-3i8..=3).prop_map(|number| f32::from(number).next_up()),
        3 => -3f32..3.0,
    ]
}

fn point() -> impl Strategy<Value = Vec3> {
    [coordinate(), coordinate(), coordinate()].prop_map(Vec3::from)
}

/// Two points with distinct directions between them, or one straight along an axis.
fn ray_line() -> impl Strategy<Value = (Vec3, Vec3)> {
    let along_axis = (point(), 0usize..3, any::<bool>()).prop_map(|(origin, axis, is_down)| {
        let mut direction = if is_down { [-0.0; 3] } else { [0.0; 3] };
        direction[axis] = if is_down { -1.0 } else { 1.0 };
        (origin, Vec3::from(direction))
    });
    let between = (point(), point())
        .prop_filter("needs a direction", |(origin, target)| origin != target)
        .prop_map(|(origin, target)| (origin, (target - origin).normalize()));
    prop_oneof![1 => along_axis, 3 => between]
}

fn qualities() -> [BvhBuildParams; 3] {
    let fat = BvhBuildParams { max_prims_per_leaf: 7, ..BvhBuildParams::fast_build() };
    [BvhBuildParams::fastest_build(), fat, BvhBuildParams::very_slow_build()]
}

/// The tree as it is built for a file, after another one in the same memory.
fn swift(leaves: &[LeafTriangle]) -> Tree {
    let bounds = |leaf: &LeafTriangle| Bounds::around(leaf.corners);
    let mut builder = HierarchyBuilder::default();
    builder.build(leaves.iter().chain(leaves).map(bounds));
    builder.build(leaves.iter().map(bounds));
    let triangles = builder.order().iter().map(|&index| leaves[index as usize]);
    let triangles: Vec<_> = triangles.collect();
    let tree = Tree::from_parts(builder.nodes().to_vec().into(), triangles.into());
    tree.expect("children come after their parents")
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn any_tree_finds_what_trying_every_triangle_finds(
        mut corners in prop::collection::vec(prop::array::uniform3(point()), 1..60),
        copies in 0usize..4,
        lines in prop::collection::vec(ray_line(), 20),
        scale in prop_oneof![Just(1f32), Just(1e6), Just(1e-6), Just(1e-20)],
        shift in prop_oneof![Just(0f32), Just(1000.0), Just(-12345.678)],
    ) {
        // Equal triangles make ties.
        let count = corners.len();
        corners.extend_from_within(..copies.min(count));
        for corner in corners.iter_mut().flatten() {
            *corner = (*corner + Vec3::splat(shift)) * scale;
        }
        let bounds = Bounds::around(corners.iter().flatten().copied());
        let leaves: Vec<LeafTriangle> = (0u32..)
            .zip(&corners)
            .map(|(primitive, &corners)| LeafTriangle { corners, primitive })
            .collect();
        let trees = qualities().map(|quality| Tree::build(&leaves, quality).0);
        let trees = trees.into_iter().chain([swift(&leaves)]);
        let trees: Vec<Tree> = trees.collect();
        let mut stack = Stack::default();
        for (origin, direction) in lines {
            let start = ray((origin + Vec3::splat(shift)) * scale, direction);
            let expected = closest_of_all(&corners, &bounds, &start);
            let probe = Probe::new(&start, &bounds);
            for tree in &trees {
                let mut found = start;
                let world = World(&probe.slab);
                tree.closest(&probe, &world, &mut found, stack.only());
                prop_assert_eq!((found.distance.to_bits(), found.hit_primitive), expected);
                let hit = f32::from_bits(expected.0);
                let until = |distance| Ray { distance, ..start };
                let mut is_occluded =
                    |distance| tree.is_occluded(&probe, &world, &until(distance), stack.only());
                prop_assert!(!is_occluded(hit));
                if hit.is_finite() {
                    prop_assert!(is_occluded(hit.next_up()));
                }
            }
        }
    }

    #[test]
    fn a_hit_is_where_the_ray_is(
        corners in prop::array::uniform3(point()), line in ray_line(),
    ) {
        let partition = Partition::new(loose(&[corners]));
        let mut hit = ray(line.0, line.1);
        let slot = partition.intersect(&mut hit, &mut Stack::default());
        if let Some(surface) = slot.and_then(|slot| partition.surface_point(&hit, slot)) {
            let reached = line.0 + line.1 * hit.distance;
            prop_assert!(reached.distance(surface.point) < 1e-4, "{reached} {}", surface.point);
            prop_assert!((surface.face_normal.length() - 1.0).abs() < 1e-6);
        } else {
            prop_assert_eq!(hit.hit_primitive, NO_PRIMITIVE);
        }
    }
}

#[test]
fn a_hit_found_before_is_kept_unless_a_nearer_one_is_found() {
    let corners =
        [[Vec3::new(-1.0, -1.0, 5.0), Vec3::new(3.0, -1.0, 5.0), Vec3::new(-1.0, 3.0, 5.0)]];
    let partition = Partition::new(loose(&corners));
    let start = ray(Vec3::ZERO, Vec3::Z);
    for (distance, primitive, expected) in [(4.0, 7, 7), (6.0, 7, 0), (5.0, 7, 0)] {
        let mut ray = Ray { distance, hit_primitive: primitive, ..start };
        partition.intersect(&mut ray, &mut Stack::default());
        assert_eq!((ray.hit_primitive, ray.distance), (expected, distance.min(5.0)));
    }
}

#[test]
fn an_empty_model_is_never_hit() {
    let partition = Partition::new(Geometry::default());
    let mut ray = ray(Vec3::ZERO, Vec3::Z);
    partition.intersect(&mut ray, &mut Stack::default());
    assert_eq!(ray.hit_primitive, NO_PRIMITIVE);
    assert!(!partition.is_occluded(&ray, &mut Stack::default()));
}

#[test]
fn the_light_does_not_hide_itself() {
    let corners =
        [[Vec3::new(-1.0, -1.0, 5.0), Vec3::new(3.0, -1.0, 5.0), Vec3::new(-1.0, 3.0, 5.0)]];
    let partition = Partition::new(loose(&corners));
    let shadow = Ray { distance: 10.0, ..ray(Vec3::ZERO, Vec3::Z) };
    assert!(partition.is_occluded(&shadow, &mut Stack::default()));
    let to_light = Ray { hit_primitive: 0, ..shadow };
    assert!(!partition.is_occluded(&to_light, &mut Stack::default()));
}

#[test]
fn of_thousands_of_equal_triangles_the_first_is_hit() {
    let corners =
        [Vec3::new(-1.0, -1.0, 5.0), Vec3::new(3.0, -1.0, 5.0), Vec3::new(-1.0, 3.0, 5.0)];
    let partition = Partition::new(loose(&[corners; 5000]));
    let mut ray = ray(Vec3::ZERO, Vec3::Z);
    partition.intersect(&mut ray, &mut Stack::default());
    assert_eq!((ray.hit_primitive, ray.distance), (0, 5.0));
}
