//! Bundles of any size, interrupted anywhere and gone on with in any order, against the reference.

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, LazyLock};

use equilux_common::bundle::{BUNDLE_RAYS_MAX, Share};
use equilux_common::credit::Credit;
use equilux_common::film::TileSums;
use equilux_common::ids::{Attempt, PartitionId, UnitId};
use equilux_common::job::{PerDepth, Settings};
use equilux_common::scene::placing::Transform;
use equilux_common::scene::{Scene, Surface};
use equilux_common::unit::{Granularity, UnitGrid};
use glam::Vec3;
use proptest::prelude::*;

use super::*;
use crate::geometry::tests::meshes::icosphere;
use crate::geometry::{Partition, PartitionSet};
use crate::reference;
use crate::scene_builder::{SceneBuilder, camera, partitioned, plain, settings};

/// A scene, a job on it, and what the reference makes of it.
struct Case {
    scene: Scene,
    renderer: Renderer,
    film: TileSums,
}

/// A scene in which rays do all that rays can do.
fn case(light_samples: &[u32], indirect_samples: &[u32], roulette: Option<u32>) -> Case {
    let mut scene = SceneBuilder::new();
    scene.environment(0.2);
    let (wall, light) = (scene.diffuse(0.7), scene.light(9.0));
    let floor = scene.surface(plain(0.3, 0.4, 0.1), 1.0);
    let mirror = scene.surface(Surface::Mirror { reflectance: [0.9; 3] }, 1.0);
    let pane = scene.surface(plain(0.5, 0.2, 0.3), 0.5);
    let glass = scene.surface(Surface::Glass { ior: 1.5, transmittance: [0.9; 3] }, 1.0);
    let (x, y, z) = (Vec3::X * 2.0, Vec3::Y * 2.0, Vec3::Z * 2.0);
    scene.quad(Vec3::new(-1.0, -1.0, -1.0), z, x, floor);
    scene.quad(Vec3::new(-1.0, -1.0, -1.0), x, y, wall);
    scene.quad(Vec3::new(-1.0, -1.0, -1.0), y, z, mirror);
    scene.quad(Vec3::new(0.4, -1.0, 0.2), x, y, pane);
    scene.quad(Vec3::new(-0.5, 0.9, -0.5), Vec3::X * 0.5, Vec3::Z * 0.5, light);
    scene.mesh(&icosphere(1, 0.4, Vec3::new(0.2, -0.5, 0.1)), |_| glass);
    let place = |scale, translation| Transform {
        linear: [[scale, 0.1, 0.0], [0.0, 0.3, 0.0], [0.0, 0.0, 0.2]],
        translation,
    };
    let places = [place(0.2, [-0.6, -0.8, 0.3]), place(-0.3, [-0.1, -0.7, -0.4])];
    scene.placed_mesh(&icosphere(1, 1.0, Vec3::ZERO), wall, &places);
    let lamps = [place(0.05, [-0.8, 0.2, 0.0]), place(0.1, [0.7, 0.6, -0.3])];
    scene.placed_mesh(&icosphere(0, 0.3, Vec3::Y), light, &lamps);
    let settings = Settings {
        light_samples: PerDepth::new(light_samples.to_vec()).expect("within limits"),
        indirect_samples: PerDepth::new(indirect_samples.to_vec()).expect("within limits"),
        roulette_depth: roulette,
        height: 9,
        ..settings(13, 3, 5)
    };
    let whole = scene.scene().clone();
    let view = camera(Vec3::new(0.3, 0.2, 3.0), Vec3::ZERO, 45.0);
    let renderer = scene.renderer(&view, &settings);
    Case { scene: whole, film: reference::render(&renderer), renderer }
}

static CASES: LazyLock<[Case; 4]> = LazyLock::new(|| {
    [
        case(&[1], &[1], None),
        case(&[4, 2, 0], &[3, 1, 2], None),
        case(&[1], &[1], Some(1)),
        case(&[0], &[5, 0], Some(2)),
    ]
});

/// The job with those partitions in memory whose bits are set.
fn with_some(renderer: &Renderer, partitions: &[Arc<Partition>], bits: u32) -> Renderer {
    let is_here = |index: usize| bits >> index & 1 == 1;
    let partitions = partitions.iter().enumerate();
    let some = partitions.map(|(index, one)| is_here(index).then(|| Arc::clone(one)));
    renderer.with_partitions(PartitionSet::new(some.collect()))
}

/// All units of a job, each in as many ranges of paths as asked for.
fn all_work(renderer: &Renderer, ranges: u32) -> Vec<Work> {
    let mut works = Vec::new();
    for id in (0..renderer.grid.unit_count()).map(UnitId) {
        let count = renderer.grid.unit(id).expect("below the count").path_count();
        let mut credit = Credit::whole();
        let cuts: Vec<u32> = (0..=ranges).map(|cut| count * cut / ranges).collect();
        for pair in cuts.windows(2).filter(|pair| pair[0] < pair[1]) {
            let is_last = pair[1] == count;
            let part = if is_last { std::mem::take(&mut credit) } else { credit.split(8) };
            let share = Share { unit: id, attempt: Attempt(0), credit: part };
            let (first_path, path_count) = (pair[0], pair[1] - pair[0]);
            works.push(Work::Samples(Samples { share, first_path, path_count }));
        }
    }
    works
}

/// Puts the rays of both bundles into one, as a worker may do on their way.
fn join(mut into: Bundle, from: Bundle) -> Bundle {
    let offset = u8::try_from(into.shares.len()).expect("few shares");
    into.shares.extend(from.shares);
    into.rays.extend(from.rays.into_iter().map(|ray| Ray { share: ray.share + offset, ..ray }));
    into
}

fn can_join(into: &Work, from: &Work) -> bool {
    match (into, from) {
        (Work::Rays(into), Work::Rays(from)) => {
            (into.stage, into.partition) == (from.stage, from.partition)
                && into.rays.len() + from.rays.len() <= BUNDLE_RAYS_MAX
        }
        _ => false,
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn bundles_and_partitions_of_any_size_interrupted_anywhere_give_the_reference_image(
        case in 0usize..4,
        bundle_rays in 1usize..=BUNDLE_RAYS_MAX,
        ranges in 1u32..4,
        choices in prop::collection::vec(
            (any::<prop::sample::Index>(), 0u32..40, any::<bool>(), any::<u32>()), 1..200,
        ),
        owners in prop::collection::vec(0usize..7, 1..30),
        is_cut in any::<bool>(),
    ) {
        let Case { scene, renderer, film: expected } = &CASES[case];
        let (renderer, partitions) = if is_cut {
            partitioned(scene, &owners, renderer)
        } else {
            (renderer.clone(), Vec::new())
        };
        let mut scratch = Scratch::default();
        scratch.bundle_rays = bundle_rays;
        let mut works = all_work(&renderer, ranges);
        let mut film = TileSums::new(renderer.settings.region());
        let unit_count = renderer.grid.unit_count() as usize;
        let mut credits = vec![Credit::zero(); unit_count];
        let (mut spawned, mut retired) = (0, 0);
        let mut choices = choices.into_iter().cycle().take(2000);
        while !works.is_empty() {
            // After so many choices, no more interrupts, and all partitions are in memory.
            let (index, steps, joins, here) = match choices.next() {
                Some((index, steps, joins, here)) => {
                    (index.index(works.len()), steps, joins, here)
                }
                None => (0, u32::MAX, false, u32::MAX),
            };
            let mut work = works.swap_remove(index);
            if joins && let Some(other) = works.iter().position(|other| can_join(&work, other))
                && let (Work::Rays(into), Work::Rays(from)) = (work.clone(), works[other].clone())
            {
                works.swap_remove(other);
                work = Work::Rays(join(into, from));
            }
            let mut left = steps;
            let is_wanted_back = || { left = left.saturating_sub(1); left == 0 };
            let equipped =
                if is_cut { with_some(&renderer, &partitions, here) } else { renderer.clone() };
            let tracing = Tracing::new(&equipped, &work, is_wanted_back, &mut scratch);
            let outcome = tracing.expect("work of this job").run(work, &mut ());
            spawned += outcome.counts.spawned();
            retired += outcome.counts.retired;
            for (share, sums) in outcome.retired {
                film.merge(&sums);
                let credit = &mut credits[share.unit.0 as usize];
                credit.merge(&share.credit).expect("no more than the whole");
            }
            for bundle in outcome.successors {
                prop_assert!(bundle.rays.len() <= bundle_rays.max(BUNDLE_RAYS_MAX));
                prop_assert!(bundle.shares.iter().all(|share| !share.credit.is_zero()));
                prop_assert!(!credits[bundle.shares[0].unit.0 as usize].is_whole());
                works.push(Work::Rays(bundle));
            }
        }
        prop_assert_eq!(spawned, retired);
        prop_assert!(credits.iter().all(Credit::is_whole));
        prop_assert!(film == *expected, "another image");
    }

    #[test]
    fn work_of_another_job_is_refused_or_harmless(
        unit in 0u32..20, pixel in prop_oneof![0u32..200, any::<u32>()],
        sample_index in prop_oneof![0u32..4, any::<u32>()],
        hit_primitive in prop_oneof![0u32..100, any::<u32>()],
        depth in prop_oneof![0u16..6, any::<u16>()], share in 0u8..3, stage in 0usize..3,
        origin in any::<[f32; 3]>(), direction in any::<[f32; 3]>(), distance in any::<f32>(),
        partition in 0u32..2,
    ) {
        let ray = Ray {
            origin, direction, throughput: [1.0; 3], distance, hit_primitive,
            hit_partition: partition, pixel, sample_index, branch: 7, pdf: 0.3, depth, share, flags: 255,
        };
        let credit = Credit::whole();
        let shares = vec![Share { unit: UnitId(unit), attempt: Attempt(0), credit }];
        let stage = [Stage::Intersect, Stage::Shade, Stage::Shadow][stage];
        let partition = PartitionId(partition);
        let work = Work::Rays(Bundle { stage, partition, shares, rays: vec![ray] });
        let interrupt = AtomicBool::new(false);
        if let Ok(outcome) = CASES[0].renderer.trace(work, &interrupt, &mut Scratch::default()) {
            prop_assert!(outcome.retired[0].0.credit.is_whole());
        }
    }
}

#[test]
fn paths_that_a_unit_does_not_have_are_refused() {
    let renderer = &CASES[0].renderer;
    let trace = |unit, first_path, path_count, credit| {
        let share = Share { unit: UnitId(unit), attempt: Attempt(0), credit };
        let work = Work::Samples(Samples { share, first_path, path_count });
        renderer.trace(work, &AtomicBool::new(false), &mut Scratch::default()).map(|_| ())
    };
    let count = renderer.grid.unit(UnitId(0)).expect("the first unit").path_count();
    assert_eq!(trace(0, 0, count, Credit::whole()), Ok(()));
    assert!(matches!(trace(0, 1, count, Credit::whole()), Err(InvalidWork::Paths { .. })));
    assert!(matches!(
        trace(0, u32::MAX, u32::MAX, Credit::whole()),
        Err(InvalidWork::Paths { .. })
    ));
    assert_eq!(trace(999, 0, 1, Credit::whole()), Err(InvalidWork::Unit(UnitId(999))));
    assert_eq!(trace(0, 0, 1, Credit::zero()), Err(InvalidWork::Credit(UnitId(0))));
}

/// With rays to trace and an interrupt that is already set, nothing but the start is made.
#[test]
fn an_interrupt_gives_up_what_has_not_begun() {
    let renderer = &CASES[0].renderer;
    let work = all_work(renderer, 1).swap_remove(0);
    let count = u64::from(renderer.grid.unit(UnitId(0)).expect("the first unit").path_count());
    let interrupt = AtomicBool::new(true);
    let outcome = renderer.trace(work, &interrupt, &mut Scratch::default()).expect("of this job");
    assert_eq!(outcome.counts, RayCounts { camera: count, ..RayCounts::default() });
    let rays: usize = outcome.successors.iter().map(|bundle| bundle.rays.len()).sum();
    assert_eq!(rays as u64, count);
    assert_eq!(outcome.retired.len(), 1);
}

/// More camera samples than an interrupt gives up are traced down to that number.
#[test]
fn an_interrupt_gives_up_a_bounded_number_of_rays() {
    let settings = settings(16, 128, 2);
    let granularity = Granularity { tile_side_pixels: 16, samples_per_unit: 128 };
    let grid = UnitGrid::new(16, settings.region(), 128, granularity);
    let view = camera(Vec3::Z, Vec3::ZERO, 45.0);
    let renderer = Renderer::new(Scene::default(), &view, &settings, grid).expect("nothing to see");
    let work = all_work(&renderer, 1).swap_remove(0);
    let interrupt = AtomicBool::new(true);
    let outcome = renderer.trace(work, &interrupt, &mut Scratch::default()).expect("of this job");
    let rays: usize = outcome.successors.iter().map(|bundle| bundle.rays.len()).sum();
    let rays_max = GIVEN_UP_PATHS_MAX as usize + BUNDLE_RAYS_MAX;
    assert!((1..=rays_max).contains(&rays), "{rays}");
    assert_eq!((outcome.counts.camera, outcome.counts.retired + rays as u64), (32_768, 32_768));
}

/// Rays by what an observer was told of them.
#[derive(Debug, Default, PartialEq, Eq)]
struct Seen {
    started: u64,
    intersected: u64,
    shadow: u64,
}

impl Observer for Seen {
    fn started(&mut self, rays: &[Ray]) {
        self.started += rays.len() as u64;
    }

    fn advanced(&mut self, stage: Stage, rays: &[Ray]) {
        let count = rays.len() as u64;
        match stage {
            Stage::Intersect => self.intersected += count,
            Stage::Shadow => self.shadow += count,
            Stage::Shade => unreachable!("rays that are shaded have been intersected here"),
        }
    }
}

#[test]
fn an_observer_sees_every_ray_once_and_changes_nothing() {
    for Case { renderer, film: expected, .. } in &*CASES {
        let (mut film, mut scratch) =
            (TileSums::new(renderer.settings.region()), Scratch::default());
        let (mut seen, mut counts) = (Seen::default(), RayCounts::default());
        for work in all_work(renderer, 2) {
            let interrupt = AtomicBool::new(false);
            let outcome = renderer.trace_observed(work, &interrupt, &mut scratch, &mut seen);
            let outcome = outcome.expect("of this job");
            outcome.retired.iter().for_each(|(_, sums)| film.merge(sums));
            counts.add(&outcome.counts);
        }
        let RayCounts { camera, indirect, specular, shadow, .. } = counts;
        let intersected = camera + indirect + specular;
        assert_eq!(seen, Seen { started: camera, intersected, shadow });
        assert!(film == *expected, "another image");
    }
}
