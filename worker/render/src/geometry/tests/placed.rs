//! Objects at several places against the same triangles where they end up.

use equilux_common::scene::placing::{Placing, Transform};
use equilux_common::scene::{Prototype, Scene, WorldTriangle};

use super::*;

/// A transform whose entries are often whole, so that boxes stay flat and edges meet.
fn transform() -> impl Strategy<Value = Transform> {
    let entry = || prop_oneof![3 => (-2i8..=2).prop_map(f64::from), 2 => -2f64..2.0];
    let row = move || [entry(), entry(), entry()];
    let shift = prop_oneof![(-3i8..=3).prop_map(f64::from), -4f64..4.0, -3e4f64..3e4];
    let all = ([row(), row(), row()], [shift.clone(), shift.clone(), shift]);
    all.prop_map(|(linear, translation)| Transform { linear, translation })
        .prop_filter("flat", Transform::is_reversible)
}

fn triangles(most: usize) -> impl Strategy<Value = Vec<[Vec3; 3]>> {
    prop::collection::vec(prop::array::uniform3(point()), 1..most)
}

#[derive(Clone, Debug)]
struct Model {
    loose: Vec<[Vec3; 3]>,
    prototypes: Vec<(Vec<[Vec3; 3]>, Vec<Transform>)>,
}

fn model() -> impl Strategy<Value = Model> {
    let prototype = (triangles(12), prop::collection::vec(transform(), 1..6));
    let prototypes = prop::collection::vec(prototype, 1..4);
    (triangles(8), prototypes).prop_map(|(loose, prototypes)| Model { loose, prototypes })
}

impl Model {
    fn scene(&self) -> Scene {
        let prototypes = self.prototypes.iter().map(|(triangles, transforms)| Prototype {
            geometry: loose(triangles),
            placings: transforms.iter().copied().map(Placing::new).collect(),
        });
        let (geometry, prototypes) = (loose(&self.loose), prototypes.collect());
        Scene { geometry, prototypes, ..Scene::default() }
    }

    /// All triangles where they end up, by their ids.
    fn flat(&self) -> Vec<[Vec3; 3]> {
        let scene = self.scene();
        let placed = scene.placements().flat_map(|placement| {
            let placing = placement.placing;
            let triangles = &self.prototypes[placement.prototype].0;
            let place = move |corner: Vec3| Vec3::from(placing.corner(corner.into()));
            triangles.iter().map(move |corners| placing.order(corners.map(place)))
        });
        self.loose.iter().copied().chain(placed).collect()
    }

    /// The model in partitions: triangle `index` of each kind in part `owners[index % …]`.
    fn cut(&self, owners: &[usize], bounds: &Bounds) -> Vec<Partition> {
        let scene = self.scene();
        let parts = 0..owners.iter().max().map_or(1, |most| most + 1);
        let builders = parts.map(|part| {
            let is_here = |number: u32| owners[number as usize % owners.len()] == part;
            let mut builder = PartitionBuilder::default();
            push(&mut builder, &self.loose, is_here);
            for (number, (triangles, _)) in self.prototypes.iter().enumerate() {
                let places = scene.placements().filter(|it| it.prototype == number);
                builder.begin_object(places.map(|it| (it.placing, it.first_primitive)).collect());
                push(&mut builder, triangles, is_here);
            }
            builder.build(bounds)
        });
        builders.collect()
    }
}

fn push(builder: &mut PartitionBuilder, all: &[[Vec3; 3]], is_here: impl Fn(u32) -> bool) {
    for (number, corners) in (0u32..).zip(all).filter(|(number, _)| is_here(*number)) {
        let corners = corners.map(Vec3::into);
        let (normals, texcoords) = (None, None);
        builder.push(number, &WorldTriangle { corners, normals, texcoords, material: 0 });
    }
}

/// The closest hits of rays in some partitions, one after another.
fn closest(
    partitions: &[Partition],
    starts: &[Ray],
    traversal: Traversal,
    stack: &mut Stack,
) -> Vec<(u32, u32)> {
    let (mut found, mut slots) = (starts.to_vec(), vec![None; starts.len()]);
    for partition in partitions {
        partition.intersect_all(&mut found, &mut slots, traversal, stack);
    }
    found.iter().map(|ray| (ray.distance.to_bits(), ray.hit_primitive)).collect()
}

/// All ways in which rays may be traced.
fn ways() -> impl Iterator<Item = (Instructions, Traversal)> {
    let all = Instructions::all().into_iter();
    all.flat_map(|it| [(it, Traversal::Single), (it, Traversal::Shared)])
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn what_is_placed_is_hit_as_if_it_had_been_moved_there(
        model in model(), lines in prop::collection::vec(ray_line(), 10),
        owners in prop::collection::vec(0usize..4, 1..5), at in any::<prop::sample::Index>(),
    ) {
        let (scene, flat) = (model.scene(), model.flat());
        let bounds = Bounds::of_model(&scene.geometry, &scene.prototypes);
        let is_within = |corner: &Vec3| {
            corner.cmpge(bounds.lower).all() && corner.cmple(bounds.upper).all()
        };
        prop_assert!(flat.iter().flatten().all(is_within));
        let Scene { geometry, prototypes, .. } = scene;
        let whole = PartitionBuilder::of_model(geometry, prototypes).build(&bounds);
        prop_assert_eq!(whole.primitive_count(), flat.len() as u64);
        let parts = model.cut(&owners, &bounds);
        let target = flat[at.index(flat.len())];
        // Some rays start far away, toward something that is there.
        let middle = (target[0] + target[1] + target[2]) / 3.0;
        let starts: Vec<Ray> = lines
            .into_iter()
            .flat_map(|(origin, direction)| {
                let aimed = (middle - origin).try_normalize().unwrap_or(direction);
                [direction, aimed].map(|direction| ray(origin, direction))
            })
            .collect();
        let expected: Vec<(u32, u32)> =
            starts.iter().map(|start| closest_of_all(&flat, &bounds, start)).collect();
        for (instructions, traversal) in ways() {
            let mut stack = Stack::new(instructions);
            let found = closest(std::slice::from_ref(&whole), &starts, traversal, &mut stack);
            prop_assert_eq!(&found, &expected);
            prop_assert_eq!(&closest(&parts, &starts, traversal, &mut stack), &expected);
            let hits = expected.iter().map(|&(hit, primitive)| (f32::from_bits(hit), primitive));
            let shadows = |reach: fn(&Ray, (f32, u32)) -> Ray| -> Vec<Ray> {
                starts.iter().zip(hits.clone()).map(|(start, hit)| reach(start, hit)).collect()
            };
            let mut are_occluded = vec![false; starts.len()];
            let behind = shadows(|start, (hit, _)| Ray { distance: hit.next_up(), ..*start });
            whole.are_occluded(&behind, &mut are_occluded, traversal, &mut stack);
            let are_hit: Vec<bool> = hits.clone().map(|(hit, _)| hit.is_finite()).collect();
            prop_assert_eq!(&are_occluded, &are_hit);
            let before = shadows(|start, (distance, hit_primitive)| Ray {
                distance,
                hit_primitive,
                ..*start
            });
            whole.are_occluded(&before, &mut are_occluded, traversal, &mut stack);
            prop_assert!(!are_occluded.contains(&true));
        }
    }
}
