//! What is streamed against what is loaded.

use proptest::prelude::*;

use super::*;
use crate::scene::files::{Directory, Pack};
use crate::scene::load::{Loaded, load};

/// A prototype and where it is placed.
type Placed = (Vec<WorldTriangle>, Vec<Placing>);

/// Everything that is shown, and the warnings.
struct Shown {
    triangles: Vec<WorldTriangle>,
    placed: Vec<Placed>,
    overture: Overture,
    warnings: Vec<String>,
    degenerate_count: u64,
}

fn show(files: &dyn FileSource, entry: &str) -> Result<Shown, SceneError> {
    let spool = tempfile::tempdir().unwrap();
    let (mut stream, overture) = SceneStream::open(files, entry, spool.path())?;
    let (first, first_placed) = (collect(&mut stream)?, collect_placed(&mut stream)?);
    let (triangles, placed) = (collect(&mut stream)?, collect_placed(&mut stream)?);
    assert_eq!(bits(&triangles), bits(&first), "the second time is like the first");
    for ((triangles, _), (first, _)) in placed.iter().zip(&first_placed) {
        assert_eq!(bits(triangles), bits(first), "the second time is like the first");
    }
    let (warnings, degenerate_count) = (stream.warnings().to_vec(), stream.degenerate_count());
    drop(stream);
    assert_eq!(std::fs::read_dir(spool.path()).unwrap().count(), 0, "no file is left");
    Ok(Shown { triangles, placed, overture, warnings, degenerate_count })
}

fn collect(stream: &mut dyn TriangleSource) -> Result<Vec<WorldTriangle>, SceneError> {
    let mut triangles = Vec::new();
    stream.for_each(&mut |some| {
        triangles.extend_from_slice(some);
        ControlFlow::Continue(())
    })?;
    Ok(triangles)
}

/// The prototypes that have triangles, and where they are placed.
fn collect_placed(stream: &mut dyn TriangleSource) -> Result<Vec<Placed>, SceneError> {
    let mut placed = Vec::new();
    for prototype in 0..stream.placings().len() {
        let mut triangles = Vec::new();
        stream.for_each_of(prototype, &mut |some| {
            triangles.extend_from_slice(some);
            ControlFlow::Continue(())
        })?;
        placed.push((triangles, stream.placings()[prototype].clone()));
    }
    placed.retain(|(triangles, _)| !triangles.is_empty());
    Ok(placed)
}

fn bits(triangles: &[WorldTriangle]) -> Vec<String> {
    // `Debug` tells −0 from 0 and every other bit, apart from those of NaN, which cannot be there.
    triangles.iter().map(|triangle| format!("{triangle:?}")).collect()
}

fn loaded_and_shown(files: &[(&str, Vec<u8>)], entry: &str) -> Option<(Loaded, Shown)> {
    let files = files.iter().map(|(name, bytes)| ((*name).to_owned(), bytes.clone()));
    let pack = Pack::from_files(files).unwrap();
    match (load(&pack, entry), show(&pack, entry)) {
        (Ok(loaded), Ok(shown)) => Some((loaded, shown)),
        (Err(one), Err(other)) => {
            assert_eq!(one.to_string(), other.to_string());
            None
        }
        (one, other) => panic!("{:?} but {:?}", one.err(), other.err()),
    }
}

/// Whether all is the same; of the warnings the order may differ.
fn check_same(loaded: &Loaded, shown: &Shown) {
    let expected = collect(&mut &loaded.scene.geometry).unwrap();
    assert_eq!(bits(&shown.triangles), bits(&expected));
    assert_eq!(shown.placed.len(), loaded.scene.prototypes.len());
    for ((triangles, placings), prototype) in shown.placed.iter().zip(&loaded.scene.prototypes) {
        assert_eq!(bits(triangles), bits(&collect(&mut &prototype.geometry).unwrap()));
        assert_eq!(placings, &prototype.placings);
    }
    assert_eq!(shown.degenerate_count, loaded.degenerate_count as u64);
    assert_eq!(shown.overture.tables, loaded.scene.tables);
    assert_eq!(shown.overture.camera, loaded.camera);
    assert_eq!(shown.overture.settings, loaded.settings);
    let mut warnings = [&shown.overture.warnings[..], &shown.warnings].concat();
    let mut expected = loaded.warnings.clone();
    warnings.sort();
    expected.sort();
    assert_eq!(warnings, expected);
}

const LIBRARY: &str = "newmtl white\nKd .8 .8 .8\nnewmtl lamp\nKe 5 5 5\n";

/// A coordinate of the file: mostly small and whole, so that triangles are thin or flat at times.
fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![
        20 => (-3i8..4).prop_map(f32::from),
        5 => -10f32..10.0,
        1 => prop::sample::select(vec![f32::NAN, f32::INFINITY, 3e9, -0.0, 1e-30]),
    ]
}

/// Faces by their corners: few are polygons, and some are thin.
fn faces() -> impl Strategy<Value = Vec<Vec<usize>>> {
    let corners = prop_oneof![8 => Just(3usize), 2 => 0usize..7];
    let face = corners.prop_flat_map(|count| prop::collection::vec(any::<usize>(), count));
    prop::collection::vec(face, 1..20)
}

type Vertex = ([f32; 3], [f32; 3], [f32; 2]);

fn vertices() -> impl Strategy<Value = Vec<Vertex>> {
    let three = || [coordinate(), coordinate(), coordinate()];
    prop::collection::vec((three(), three(), [coordinate(), coordinate()]), 1..12)
}

/// An OBJ file whose faces take turns in what they have, are of, and belong to.
fn obj(vertices: &[Vertex], faces: &[Vec<usize>], variant: u8) -> Vec<u8> {
    let mut text = String::from("mtllib a.mtl\n");
    let lines: Vec<String> = vertices
        .iter()
        .map(|([x, y, z], [nx, ny, nz], [u, v])| {
            format!("v {x} {y} {z}\nvn {nx} {ny} {nz}\nvt {u} {v}\n")
        })
        .collect();
    let body: String = faces
        .iter()
        .enumerate()
        .map(|(number, face)| {
            let turn = number as u8 ^ variant;
            let corner = |at: &usize| {
                let i = at % vertices.len() + 1;
                [
                    format!(" {i}"),
                    format!(" {i}/{i}"),
                    format!(" {i}//{i}"),
                    format!(" {i}/{i}/{i}"),
                ][usize::from(turn % 4)]
                .clone()
            };
            let statement = ["", "o a\n", "usemtl white\n", "g b\nusemtl lamp\n", "usemtl none\n"];
            let corners: String = face.iter().map(corner).collect();
            format!("{}f{corners}\n", statement[usize::from(turn % 5)])
        })
        .collect();
    // Faces may come before the vertices that they refer to.
    text += &if variant & 1 == 0 { lines.concat() + &body } else { body + &lines.concat() };
    text.into_bytes()
}

/// A PLY file, binary or text, with or without normals and texture coordinates.
fn ply(vertices: &[Vertex], faces: &[Vec<usize>], variant: u8) -> Vec<u8> {
    let (is_text, has_normals, has_texcoords) =
        (variant & 2 != 0, variant & 4 != 0, variant & 8 != 0);
    // A list makes vertices vary in length.
    let has_list = variant & 16 != 0;
    let mut header = format!(
        "ply\nformat {} 1.0\nelement vertex {}\n",
        if is_text { "ascii" } else { "binary_little_endian" },
        vertices.len()
    );
    let names = [
        ("x", true),
        ("y", true),
        ("z", true),
        ("nx", has_normals),
        ("ny", has_normals),
        ("nz", has_normals),
        ("u", has_texcoords),
        ("v", has_texcoords),
    ];
    for (name, _) in names.iter().filter(|(_, is_there)| *is_there) {
        header += &format!("property float {name}\n");
    }
    if has_list {
        header += "property list uchar uchar odd\n";
    }
    header += &format!(
        "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        faces.len()
    );
    let mut body = Vec::new();
    let byte = |body: &mut Vec<u8>, value: usize| match is_text {
        true => body.extend(format!("{value} ").into_bytes()),
        false => body.push(value as u8),
    };
    for (number, (p, n, t)) in vertices.iter().enumerate() {
        let numbers = p.iter().chain(n).chain(t).zip(&names);
        for (number, _) in numbers.filter(|(_, (_, is_there))| *is_there) {
            match is_text {
                true => body.extend(format!("{number} ").into_bytes()),
                false => body.extend(number.to_le_bytes()),
            }
        }
        if has_list {
            byte(&mut body, number % 3);
            (0..number % 3).for_each(|_| byte(&mut body, 7));
        }
    }
    for face in faces {
        byte(&mut body, face.len());
        for at in face {
            let index = at % vertices.len();
            match is_text {
                true => body.extend(format!("{index} ").into_bytes()),
                false => body.extend((index as i32).to_le_bytes()),
            }
        }
    }
    [header.into_bytes(), body].concat()
}

const SCENE: &str = r#"{"equilux": 1, "camera": {"eye": [0, 0, 50], "target": [0, 0, 0]}, "models": [
    {"file": "a.obj"},
    {"file": "b.ply", "transform": {"scale": [-1, 2, 0.5], "rotate": [10, 20, 30]}},
    {"file": "b.ply", "material": "stone", "transform": {"translate": [1e8, 0, -7]}},
    {"file": "a.obj", "material": "lamp", "transform": [0, 1, 0, 5,  1, 0, 0.5, 6,  0, 0, -1, 7,
                                                        0, 0, 0, 1]},
    {"file": "a.obj", "transform": {"translate": [0.1, 2, 3]}},
    {"file": "b.ply", "transform": {"scale": 3, "rotate": [0, 90, 0]}},
    {"file": "a.obj", "transform": {"scale": [1, 1e-9, 1]}}],
    "materials": {"stone": {"type": "plain", "diffuse": [0.1, 0.2, 0.3]}}}"#;

proptest! {
    #[test]
    fn what_is_streamed_is_what_is_loaded(
        vertices in vertices(), faces in faces(), variant: u8, is_alone: bool,
    ) {
        let files = [
            ("s.json", SCENE.as_bytes().to_vec()),
            ("a.obj", obj(&vertices, &faces, variant)),
            ("b.ply", ply(&vertices, &faces, variant)),
            ("a.mtl", LIBRARY.as_bytes().to_vec()),
        ];
        let entries = if is_alone { &["a.obj", "b.ply"][..] } else { &["s.json"] };
        for entry in entries {
            if let Some((loaded, shown)) = loaded_and_shown(&files, entry) {
                check_same(&loaded, &shown);
            }
        }
    }

    #[test]
    fn changed_models_fail_alike(
        vertices in vertices(), faces in faces(), variant: u8,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..5),
    ) {
        for (name, mut bytes) in [
            ("a.obj", obj(&vertices, &faces, variant)),
            ("a.ply", ply(&vertices, &faces, variant)),
        ] {
            for (at, value) in &changes {
                let at = at.index(bytes.len());
                bytes[at] = *value;
            }
            let files = [(name, bytes), ("a.mtl", LIBRARY.as_bytes().to_vec())];
            if let Some((loaded, shown)) = loaded_and_shown(&files, name) {
                check_same(&loaded, &shown);
            }
        }
    }
}

const QUADS: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\nf 4 3 2\n";

fn on_disk(name: &str, bytes: &[u8]) -> (tempfile::TempDir, Directory) {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    let (directory, _) = Directory::of(&path).unwrap();
    (home, directory)
}

#[test]
fn the_overture_tells_what_will_come() {
    let (_home, directory) = on_disk("a.obj", QUADS.as_bytes());
    let shown = show(&directory, "a.obj").unwrap();
    assert_eq!((shown.overture.triangle_count, shown.triangles.len()), (3, 3));
    assert_eq!(shown.overture.model_bytes, QUADS.len() as u64);
}

#[test]
fn a_model_that_changes_between_passes_is_an_error() {
    let vertices = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(|p| (p, p, [0.0; 2]));
    let bytes = ply(&vertices, &[vec![0, 1, 2]], 0);
    let (home, directory) = on_disk("a.ply", &bytes);
    let spool = tempfile::tempdir().unwrap();
    let (mut stream, _) = SceneStream::open(&directory, "a.ply", spool.path()).unwrap();
    assert_eq!(collect(&mut stream).unwrap().len(), 1);
    std::fs::write(home.path().join("a.ply"), &bytes[..bytes.len() - 3]).unwrap();
    let error = collect(&mut stream).unwrap_err().to_string();
    assert!(error.starts_with("a.ply: has changed while it was being read"), "{error}");
    std::fs::remove_file(home.path().join("a.ply")).unwrap();
    let error = collect(&mut stream).unwrap_err().to_string();
    assert!(error.starts_with("a.ply: no such file"), "{error}");
}

#[test]
fn a_spool_that_cannot_be_written_or_is_cut_is_an_error() {
    let (home, directory) = on_disk("a.obj", QUADS.as_bytes());
    let absent = home.path().join("absent");
    let error = SceneStream::open(&directory, "a.obj", &absent).unwrap_err().to_string();
    assert!(error.contains("absent") && error.contains("make room"), "{error}");
    let spool = tempfile::tempdir().unwrap();
    let (mut stream, _) = SceneStream::open(&directory, "a.obj", spool.path()).unwrap();
    for entry in std::fs::read_dir(spool.path()).unwrap() {
        std::fs::write(entry.unwrap().path(), b"\x03").unwrap();
    }
    let error = collect(&mut stream).unwrap_err().to_string();
    assert!(error.contains("has changed"), "{error}");
}

#[test]
fn it_can_be_broken_off() {
    let (_home, directory) = on_disk("a.obj", QUADS.repeat(2000).as_bytes());
    let spool = tempfile::tempdir().unwrap();
    let (mut stream, _) = SceneStream::open(&directory, "a.obj", spool.path()).unwrap();
    let mut calls = 0;
    let result = stream.for_each(&mut |_| {
        calls += 1;
        ControlFlow::Break(())
    });
    assert!(result.is_ok() && calls == 1);
    assert_eq!(collect(&mut stream).unwrap().len(), 6000);
}
