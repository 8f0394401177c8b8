//! Stores of scenes with models that are placed several times.

use equilux_common::scene::placing::{Placing, Transform};
use equilux_common::scene::triangles::placements;
use equilux_render::geometry::Bounds;
use glam::Vec3;

use super::scenes::{bare, sheet};
use super::*;
use crate::build::PARTITION_BYTES_MIN;
use crate::{Store, read_partition};

/// Triangles that are where they are, and prototypes with their places.
struct Scene {
    loose: Vec<WorldTriangle>,
    prototypes: Vec<Vec<WorldTriangle>>,
    placings: Vec<Vec<Placing>>,
}

impl TriangleSource for Scene {
    fn for_each(
        &mut self,
        visit: &mut dyn FnMut(&[WorldTriangle]) -> ControlFlow<()>,
    ) -> Result<(), SceneError> {
        let _ = self.loose.chunks(100).try_for_each(visit);
        Ok(())
    }

    fn placings(&self) -> &[Vec<Placing>] {
        &self.placings
    }

    fn for_each_of(
        &mut self,
        prototype: usize,
        visit: &mut dyn FnMut(&[WorldTriangle]) -> ControlFlow<()>,
    ) -> Result<(), SceneError> {
        let _ = self.prototypes[prototype].chunks(100).try_for_each(visit);
        Ok(())
    }
}

fn placings(count: u32) -> Vec<Placing> {
    let placing = |number: u32| {
        let turn = [[0.0, 0.0, 1.0], [0.0, -0.5, 0.0], [1.0, 0.0, 0.0]];
        let translation = [f64::from(number) * 50.0, 3.0, f64::from(number % 7) * -20.0];
        Placing::new(Transform { linear: turn, translation })
    };
    (0..count).map(placing).collect()
}

fn lamp() -> WorldTriangle {
    let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    WorldTriangle { material: 1, ..bare(corners) }
}

/// Some loose, one prototype that is small, one that is too large for a partition, one at more
/// places than a partition takes, and one that is nothing.
fn scene(loose: Vec<WorldTriangle>) -> Scene {
    Scene {
        loose,
        prototypes: vec![
            [sheet(2), vec![lamp()]].concat(),
            sheet(40),
            Vec::new(),
            [vec![lamp()], sheet(1)].concat(),
        ],
        placings: vec![placings(3), placings(2), placings(5), placings(900)],
    }
}

#[test]
fn models_are_kept_once_with_all_their_places() {
    for loose in [sheet(20), Vec::new()] {
        let mut scene = scene(loose);
        let placed: u64 = [9 * 3, 3200 * 2, 3 * 900].into_iter().sum();
        let total = scene.loose.len() as u64 + placed;
        for cut in [Cut::Size(PARTITION_BYTES_MIN), Cut::Count(1), Cut::Count(9)] {
            let built = Built::new(&mut scene, cut);
            check(&built, &scene, total, cut);
        }
    }
}

fn check(built: &Built, scene: &Scene, total: u64, cut: Cut) {
    let manifest = &built.manifest;
    assert_eq!(manifest.triangle_count, total);
    let mut stored = 0;
    let mut around = Bounds::EMPTY;
    for (number, entry) in manifest.partitions.iter().enumerate() {
        let partition = read_partition(&built.partition_path(number), manifest, number).unwrap();
        assert_eq!(partition.primitive_count(), entry.placed_count);
        assert!(matches!(cut, Cut::Count(_)) || entry.memory_bytes <= PARTITION_BYTES_MIN);
        around = entry.boxes.iter().fold(around, |around, it| around.joined(it));
        stored += entry.triangle_count;
    }
    // Only what has too many places is kept more than once.
    let kept = scene.loose.len() as u64 + 9 + 3200;
    let pieces = (stored - kept) / 3;
    assert_eq!(stored, kept + 3 * pieces);
    let expected = if matches!(cut, Cut::Size(_)) { 8..=8 } else { 1..=16 };
    assert!(expected.contains(&pieces), "{pieces} with {cut:?}");
    assert_eq!(manifest.bounds, manifest.bounds.joined(&around), "they hold all boxes");

    let counts = scene.prototypes.iter().map(|it| it.len() as u64);
    let all = counts.zip(scene.placings.iter().map(Vec::as_slice));
    let lights: Vec<(u32, [f32; 3])> = placements(scene.loose.len() as u64, all)
        .filter_map(|it| {
            let local = [Some(8), None, None, Some(0)][it.prototype]?;
            Some((it.first_primitive + local, it.placing.corner([0.0; 3])))
        })
        .collect();
    let store = Store::open_path(&built.path()).unwrap();
    let found: Vec<(u32, [f32; 3])> =
        store.luminaires().iter().map(|it| (it.primitive, it.corners[0])).collect();
    assert_eq!(found, lights);
    let loose = scene.loose.iter().flat_map(|it| it.corners).map(Vec3::from);
    let loose = Bounds::around(loose);
    assert_eq!(manifest.bounds, manifest.bounds.joined(&loose));
}

#[test]
fn progress_never_goes_back_and_ends_where_it_said() {
    for cut in [Cut::Size(PARTITION_BYTES_MIN), Cut::Count(9)] {
        let mut told: Vec<Progress> = Vec::new();
        let mut observe = |progress| {
            told.push(progress);
            ControlFlow::Continue(())
        };
        let home = tempfile::tempdir().unwrap();
        let store = home.path().join("store");
        let manifest = build_in(&mut scene(sheet(20)), cut, &store, &mut observe).unwrap();
        for pair in told.windows(2) {
            let [before, after] = [0, 1].map(|at| (pair[at].phase as u32, pair[at].triangles));
            assert!(before <= after, "{pair:?} with {cut:?}");
        }
        let last = told.last().unwrap();
        assert_eq!((last.triangles, last.total), (manifest.kept_count(), Some(last.triangles)));
    }
}

#[test]
fn more_triangles_than_ids_are_refused() {
    let mut scene =
        Scene { loose: Vec::new(), prototypes: vec![sheet(40)], placings: vec![placings(1)] };
    let one = scene.placings[0][0];
    scene.placings[0] = vec![one; 1_342_178];
    let home = tempfile::tempdir().unwrap();
    let store = home.path().join("store");
    let built = build_in(&mut scene, Cut::Count(1), &store, &mut |_| ControlFlow::Continue(()));
    assert!(matches!(built, Err(BuildError::TooManyPlaced(4_294_969_600))), "{built:?}");
    assert!(!store.exists());
}
