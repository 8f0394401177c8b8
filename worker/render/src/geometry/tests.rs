//! The model against its simplest reading: every triangle tried in turn.

use equilux_common::ray::{NO_PRIMITIVE, Ray};
use equilux_common::scene::{Geometry, NO_INDEX, Triangle};
use glam::Vec3;
use obvhs::BvhBuildParams;
use proptest::prelude::*;

use super::block::{LeafTriangle, lay_blocks};
use super::hierarchy::{HierarchyBuilder, SHARED_RAYS_MAX, Stack, Visits, leaves};
use super::lanes::{Lanes, Task};
use super::thick_ray::ThickRay;
use super::tree::{Tree, World};
use super::*;

pub(crate) mod meshes;
mod placed;
mod tampered;
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

/// The closest hit by trying every triangle.
fn closest_of_all(corners: &[[Vec3; 3]], bounds: &Bounds, ray: &Ray) -> (u32, u32) {
    let probe = Probe::new(ray, bounds);
    let mut closest = (f32::INFINITY, NO_PRIMITIVE);
    for (primitive, corners) in (0u32..).zip(corners) {
        if let Some(distance) = probe.distance(corners, (0.0, f32::INFINITY), f32::INFINITY)
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

/// Asks a tree for a ray's closest hit, then whether anything is nearer than that, or as near.
struct Ask<'a> {
    tree: &'a Tree,
    probe: &'a Probe,
    start: Ray,
    visits: &'a mut Visits,
}

impl Task for Ask<'_> {
    type Output = ((u32, u32), [bool; 2]);

    fn run(self, lanes: impl Lanes) -> Self::Output {
        let Self { tree, probe, start, visits } = self;
        let (world, mut found) = (World(probe), start);
        let seen = (&world, &ThickRay::new(lanes, &probe.slab));
        tree.closest(lanes, seen, &mut found, visits);
        let hit = found.distance;
        let is_occluded = [hit, hit.next_up()]
            .map(|distance| tree.is_occluded(lanes, seen, &Ray { distance, ..start }, visits));
        ((hit.to_bits(), found.hit_primitive), is_occluded)
    }
}

const TRAVERSALS: [Traversal; 2] = [Traversal::Single, Traversal::Shared];

/// Asks the same for several rays at once.
struct AskTogether<'a> {
    traversal: Traversal,
    tree: &'a Tree,
    bounds: &'a Bounds,
    starts: &'a [Ray],
    stack: &'a mut Stack,
}

impl Task for AskTogether<'_> {
    type Output = Vec<((u32, u32), [bool; 2])>;

    fn run(self, lanes: impl Lanes) -> Self::Output {
        let Self { traversal, tree, bounds, starts, stack } = self;
        let (mut found, mut hits) = (starts.to_vec(), vec![None; starts.len()]);
        let places = stack.together();
        match traversal {
            Traversal::Single => {
                tree.closest_of_each(lanes, &mut found, &mut hits, bounds, places);
            }
            Traversal::Shared => {
                tree.closest_together(lanes, &mut found, &mut hits, bounds, places);
            }
        }
        assert!(found.iter().zip(hits).all(|(ray, hit)| ray.distance.is_finite() == hit.is_some()));
        let mut occluded = |reach: fn(f32) -> f32| {
            let until =
                |(start, found): (&Ray, &Ray)| Ray { distance: reach(found.distance), ..*start };
            let rays: Vec<Ray> = starts.iter().zip(&found).map(until).collect();
            match traversal {
                Traversal::Single => tree.each_occluded(lanes, &rays, bounds, stack.together()),
                Traversal::Shared => tree.occluded_together(lanes, &rays, bounds, stack.together()),
            }
        };
        let (before, behind) = (occluded(|hit| hit), occluded(f32::next_up));
        let answer = |(number, ray): (usize, &Ray)| {
            let are_occluded = [before, behind].map(|mask| mask >> number & 1 == 1);
            ((ray.distance.to_bits(), ray.hit_primitive), are_occluded)
        };
        found.iter().enumerate().map(answer).collect()
    }
}

fn qualities() -> [BvhBuildParams; 3] {
    [
        BvhBuildParams::fastest_build(),
        BvhBuildParams::fast_build(),
        BvhBuildParams::very_slow_build(),
    ]
}

fn leaf_triangles(corners: &[[Vec3; 3]]) -> Vec<LeafTriangle> {
    let all = (0u32..).zip(corners);
    all.map(|(primitive, &corners)| LeafTriangle { corners, primitive }).collect()
}

/// The tree as it is built for a file, after another one in the same memory.
fn swift(triangles: &[LeafTriangle]) -> Tree {
    let bounds = |triangle: &LeafTriangle| Bounds::around(triangle.corners);
    let mut builder = HierarchyBuilder::default();
    builder.build(triangles.iter().chain(triangles).map(bounds));
    builder.build(triangles.iter().map(bounds));
    let mut blocks = Vec::new();
    lay_blocks(leaves(builder.nodes()), triangles, builder.order(), &mut blocks);
    let tree = Tree::from_parts(builder.nodes().to_vec().into(), blocks.into());
    tree.expect("children come after their parents")
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn any_tree_finds_what_trying_every_triangle_finds(
        mut corners in prop::collection::vec(prop::array::uniform3(point()), 1..60),
        copies in 0usize..4,
        lines in prop::collection::vec(ray_line(), 1..=SHARED_RAYS_MAX),
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
        let leaves = leaf_triangles(&corners);
        let trees = qualities().map(|quality| Tree::build(&leaves, quality).0);
        let trees = trees.into_iter().chain([swift(&leaves)]);
        let trees: Vec<Tree> = trees.collect();
        let starts: Vec<Ray> = lines
            .into_iter()
            .map(|(origin, direction)| ray((origin + Vec3::splat(shift)) * scale, direction))
            .collect();
        let expected: Vec<_> = starts
            .iter()
            .map(|start| closest_of_all(&corners, &bounds, start))
            .map(|closest| (closest, [false, f32::from_bits(closest.0).is_finite()]))
            .collect();
        for instructions in Instructions::all() {
            let mut stack = Stack::new(instructions);
            for tree in &trees {
                for (&start, expected) in starts.iter().zip(&expected) {
                    let probe = &Probe::new(&start, &bounds);
                    let found = instructions.run(Ask { tree, probe, start, visits: stack.only() });
                    prop_assert_eq!(&found, expected, "{}", instructions.name());
                }
                for traversal in TRAVERSALS {
                    let (starts, bounds, stack) = (&starts[..], &bounds, &mut stack);
                    let ask = AskTogether { traversal, tree, bounds, starts, stack };
                    let found = instructions.run(ask);
                    prop_assert_eq!(&found, &expected, "{} {:?}", instructions.name(), traversal);
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
