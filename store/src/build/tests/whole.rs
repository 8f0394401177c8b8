//! What is in a store is what was in the scene, whatever the scene and the cut.

use std::collections::BTreeMap;
use std::fs;
use std::ops::ControlFlow;
use std::path::Path;

use equilux_common::scene::files::{Directory, ReadError};
use equilux_common::scene::{Luminaire, NO_INDEX, WorldTriangle};
use equilux_render::geometry::{Bounds, Partition};
use glam::Vec3;
use proptest::prelude::*;

use super::scenes::{any_scene, bare, sheet};
use super::{Built, Loose, build_in, camera, cameras, settings, tables};
use crate::build::PARTITION_BYTES_MIN;
use crate::{BuildError, Cut, Phase, Store, is_store, manifest_in, read_partition};

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn every_triangle_is_in_one_partition(scene in any_scene(), cut in any_cut()) {
        let built = Built::new(&mut Loose(scene.clone()), cut);
        let mut found = BTreeMap::new();
        for (number, entry) in built.manifest.partitions.iter().enumerate() {
            let path = built.partition_path(number);
            let partition = read_partition(&path, &built.manifest, number).unwrap();
            prop_assert_eq!(partition.bytes() as u64, entry.memory_bytes);
            let triangles = triangles(&partition);
            check_boxes(&triangles, &entry.boxes)?;
            if let Cut::Size(most) = cut {
                prop_assert!(entry.memory_bytes <= most || triangles.len() == 1);
            }
            for (primitive, triangle) in triangles {
                prop_assert!(found.insert(primitive, triangle).is_none(), "{} twice", primitive);
            }
        }
        if let Cut::Count(count) = cut {
            prop_assert_eq!(built.manifest.partitions.len(), count as usize);
        }
        let scene: BTreeMap<u32, WorldTriangle> = (0..).zip(scene).collect();
        // By their text, in which 0 and −0 differ.
        prop_assert_eq!(format!("{found:?}"), format!("{scene:?}"));
    }

    #[test]
    fn what_all_share_comes_back(scene in any_scene()) {
        let built = Built::new(&mut Loose(scene.clone()), Cut::Count(2));
        let store = Store::open_path(&built.path()).unwrap();
        prop_assert_eq!(store.manifest(), &built.manifest);
        prop_assert_eq!(store.tables(), &tables());
        prop_assert_eq!(store.manifest().camera, camera());
        prop_assert_eq!(&store.manifest().cameras, &cameras());
        prop_assert_eq!(&store.manifest().settings, &settings());
        let corners = scene.iter().flat_map(|triangle| triangle.corners).map(Vec3::from);
        prop_assert_eq!(store.manifest().bounds, Bounds::around(corners).or_origin());
        let lights = (0..).zip(&scene).filter(|(_, triangle)| triangle.material == 1);
        let lights: Vec<Luminaire> = lights
            .map(|(primitive, it)| Luminaire { primitive, material: 1, corners: it.corners })
            .collect();
        prop_assert_eq!(store.luminaires(), lights);
    }
}

fn any_cut() -> impl Strategy<Value = Cut> {
    prop_oneof![
        (1u32..12).prop_map(Cut::Count),
        Just(Cut::Count(60)),
        Just(Cut::Size(PARTITION_BYTES_MIN))
    ]
}

/// All triangles of a partition, from its tables.
fn triangles(partition: &Partition) -> Vec<(u32, WorldTriangle)> {
    let [nodes, leaves, materials, normals, texcoords, normal_table, texcoord_table, ..] =
        partition.image().sections();
    let nodes: Vec<[u32; 64]> = bytemuck::pod_collect_to_vec(nodes);
    let leaves: Vec<u32> = bytemuck::pod_collect_to_vec(leaves);
    let materials: Vec<u32> = bytemuck::pod_collect_to_vec(materials);
    let normals: Vec<[u32; 3]> = bytemuck::pod_collect_to_vec(normals);
    let texcoords: Vec<[u32; 3]> = bytemuck::pod_collect_to_vec(texcoords);
    let normal_table: Vec<[f32; 3]> = bytemuck::pod_collect_to_vec(normal_table);
    let texcoord_table: Vec<[f32; 2]> = bytemuck::pod_collect_to_vec(texcoord_table);
    let attribute = |indices: &[[u32; 3]], slot: usize| {
        indices.get(slot).copied().filter(|indices| indices[0] != NO_INDEX)
    };
    // A leaf of `count` triangles from `first` on has rows of as many words.
    let triangle = |(first, count, lane): (usize, usize, usize)| {
        let slot = first + lane;
        let word = |row: usize| leaves[first * 10 + row * count + lane];
        let corner = |at: usize| [0, 1, 2].map(|axis| f32::from_bits(word(3 * at + axis)));
        let triangle = WorldTriangle {
            corners: [corner(0), corner(1), corner(2)],
            normals: attribute(&normals, slot).map(|it| it.map(|at| normal_table[at as usize])),
            texcoords: attribute(&texcoords, slot)
                .map(|it| it.map(|at| texcoord_table[at as usize])),
            material: materials[slot],
        };
        (word(9), triangle)
    };
    let children =
        nodes.iter().flat_map(|node| (0..8).map(|lane| (node[48 + lane], node[56 + lane])));
    let runs = children.filter(|&(_, count)| count != u32::MAX);
    let lanes = runs.flat_map(|(first, count)| (0..count).map(move |lane| (first, count, lane)));
    lanes
        .map(|(first, count, lane)| triangle((first as usize, count as usize, lane as usize)))
        .collect()
}

/// The boxes hold every triangle whole, and are no worse than one box.
fn check_boxes(triangles: &[(u32, WorldTriangle)], boxes: &[Bounds]) -> Result<(), TestCaseError> {
    let around = |triangle: &WorldTriangle| Bounds::around(triangle.corners.map(Vec3::from));
    let is_held = |triangle: &WorldTriangle| {
        boxes.iter().any(|bounds| bounds.joined(&around(triangle)) == *bounds)
    };
    prop_assert!(triangles.iter().all(|(_, triangle)| is_held(triangle)));
    let join = |around: Bounds, it: Bounds| around.joined(&it);
    let whole = triangles.iter().map(|(_, it)| around(it)).fold(Bounds::EMPTY, join);
    prop_assert_eq!(boxes.iter().copied().fold(Bounds::EMPTY, join), whole);
    Ok(())
}

#[test]
fn the_same_scene_gives_the_same_bytes() {
    let mut scene = sheet(60);
    scene.extend(vec![scene[7]; 300]);
    for cut in [Cut::Count(5), Cut::Size(PARTITION_BYTES_MIN)] {
        let [a, b] = [(); 2].map(|()| Built::new(&mut Loose(scene.clone()), cut));
        assert_eq!(files(&a.path()), files(&b.path()));
        assert!(files(&a.path()).len() > 6);
    }
}

/// Names and bytes of all files.
fn files(directory: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(directory).unwrap().map(|entry| entry.unwrap().path());
    let files = entries.flat_map(|path| match path.is_dir() {
        true => files(&path),
        false => BTreeMap::from([(path.display().to_string(), fs::read(&path).unwrap())]),
    });
    let strip = |(name, bytes): (String, _)| (name.split("/store/").last().unwrap().into(), bytes);
    files.map(strip).collect()
}

#[test]
fn partitions_are_about_equal_and_tight() {
    let scene = sheet(100);
    for count in [2, 7, 32] {
        let built = Built::new(&mut Loose(scene.clone()), Cut::Count(count));
        let mean = scene.len() as f64 / f64::from(count);
        let mut area = 0.0;
        for entry in &built.manifest.partitions {
            let share = entry.triangle_count as f64 / mean;
            assert!((0.7..1.3).contains(&share), "{count}: {share}");
            let boxes = entry.boxes.iter().copied();
            area += boxes.fold(Bounds::EMPTY, |a, b| a.joined(&b)).half_area();
        }
        // A sheet of 10⁴ in all; whoever cuts at random gets nearly that for each partition.
        assert!(area < 13_000.0 + 300.0 * f64::from(count) as f32, "{count}: {area}");
    }
}

#[test]
fn whoever_breaks_off_finds_what_was_there_before() {
    let home = tempfile::tempdir().unwrap();
    let store = home.path().join("store");
    let mut go_on = |_| ControlFlow::Continue(());
    build_in(&mut Loose(sheet(5)), Cut::Count(2), &store, &mut go_on).unwrap();
    let before = files(home.path());
    for phase in [Phase::Survey, Phase::Distribution, Phase::Partitions] {
        let mut break_off = |progress: crate::Progress| {
            if progress.phase == phase { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let built = build_in(&mut Loose(sheet(9)), Cut::Count(3), &store, &mut break_off);
        assert!(matches!(built, Err(BuildError::Interrupted)), "{phase:?}");
        assert_eq!(files(home.path()), before, "{phase:?}");
        assert_eq!(fs::read_dir(home.path()).unwrap().count(), 1, "{phase:?}");
    }
    build_in(&mut Loose(sheet(9)), Cut::Count(3), &store, &mut go_on).unwrap();
    assert_ne!(files(home.path()), before);
    assert_eq!(fs::read_dir(home.path()).unwrap().count(), 1);
}

#[test]
fn what_is_no_store_is_not_replaced() {
    let home = tempfile::tempdir().unwrap();
    let mut go_on = |_| ControlFlow::Continue(());
    let mut build_at =
        |path: &Path| build_in(&mut Loose(sheet(2)), Cut::Count(1), path, &mut go_on);
    let file = home.path().join("file");
    fs::write(&file, "mine").unwrap();
    assert!(matches!(build_at(&file), Err(BuildError::Occupied { .. })));
    assert!(matches!(build_at(home.path()), Err(BuildError::Occupied { .. })));
    let store = home.path().join("store");
    fs::create_dir(&store).unwrap();
    build_at(&store).unwrap();
    assert!(is_store(&store) && is_store(&store.join("manifest.json")) && !is_store(&file));
    fs::write(store.join("notes"), "mine").unwrap();
    assert!(matches!(build_at(&store), Err(BuildError::Occupied { .. })));
    let error = build_at(&file.join("store")).unwrap_err();
    assert!(matches!(error, BuildError::Unwritable { .. }), "{error}");
    assert!(error.to_string().contains("file: cannot be written"), "{error}");
}

#[test]
fn stores_are_told_from_scenes_that_others_name() {
    let root = tempfile::tempdir().unwrap();
    let mut go_on = |_| ControlFlow::Continue(());
    let store = root.path().join("store");
    build_in(&mut Loose(sheet(2)), Cut::Count(1), &store, &mut go_on).unwrap();
    for (name, text) in [("scene", "{}"), ("both", "{}"), ("lost", "")] {
        let directory = root.path().join(name);
        fs::create_dir(&directory).unwrap();
        let file = if name == "lost" { "manifest.json" } else { "scene.json" };
        fs::write(directory.join(file), text).unwrap();
    }
    fs::copy(store.join("manifest.json"), root.path().join("both/manifest.json")).unwrap();
    let confined = Directory::confined(root.path()).unwrap();
    for (path, entry) in [
        ("store", Some("store/manifest.json")),
        ("./store/manifest.json", Some("store/manifest.json")),
        ("store/luminaires.bin", None),
        ("scene", None),
        ("scene/scene.json", None),
        ("both", Some("both/manifest.json")),
        ("both/scene.json", None),
        ("lost", Some("lost/manifest.json")),
        ("store/partitions", None),
        (".", None),
    ] {
        assert_eq!(manifest_in(&confined, path).unwrap().as_deref(), entry, "{path}");
    }
    assert!(matches!(manifest_in(&confined, "absent"), Err(ReadError::Missing { .. })));
    assert!(matches!(manifest_in(&confined, "../store"), Err(ReadError::Outside { .. })));
    fs::write(root.path().join("both/manifest.json"), "{}").unwrap();
    assert_eq!(manifest_in(&confined, "both").unwrap(), None, "its scene file is left");
}

#[test]
fn what_no_image_can_be_made_of_is_refused() {
    let home = tempfile::tempdir().unwrap();
    let refuse = |triangle: WorldTriangle| {
        let (store, mut go_on) = (home.path().join("store"), |_| ControlFlow::Continue(()));
        build_in(&mut Loose(vec![triangle]), Cut::Count(1), &store, &mut go_on).unwrap_err()
    };
    let far = refuse(bare([[0.0; 3], [1.0; 3], [0.0, 1e12, 0.0]]));
    assert!(matches!(far, BuildError::OutOfRange { primitive: 0 }), "{far}");
    let nowhere = refuse(bare([[f32::NAN; 3]; 3]));
    assert!(matches!(nowhere, BuildError::OutOfRange { .. }), "{nowhere}");
    let unknown = refuse(WorldTriangle { material: 3, ..bare([[0.0; 3]; 3]) });
    assert!(matches!(unknown, BuildError::NoMaterial { material: 3, .. }), "{unknown}");
    assert_eq!(fs::read_dir(home.path()).unwrap().count(), 0);
}

/// A scene that has another triangle each time.
struct Restless(Vec<Loose>);

impl equilux_common::scene::triangles::TriangleSource for Restless {
    fn for_each(
        &mut self,
        visit: &mut dyn FnMut(&[WorldTriangle]) -> ControlFlow<()>,
    ) -> Result<(), equilux_common::scene::error::SceneError> {
        self.0.remove(0).for_each(visit)
    }
}

#[test]
fn a_scene_that_changes_is_noticed() {
    let moved = |triangle: &WorldTriangle| bare(triangle.corners.map(|[x, y, z]| [x, y + 2.0, z]));
    let first = sheet(4);
    let fewer = first[1..].to_vec();
    let more = [first.clone(), first[..1].to_vec()].concat();
    let elsewhere = first.iter().map(moved).collect();
    for second in [fewer, more, elsewhere] {
        let home = tempfile::tempdir().unwrap();
        let mut source = Restless(vec![Loose(first.clone()), Loose(second)]);
        let mut go_on = |_| ControlFlow::Continue(());
        let built = build_in(&mut source, Cut::Count(2), &home.path().join("store"), &mut go_on);
        assert!(matches!(built, Err(BuildError::Changed)));
    }
}
