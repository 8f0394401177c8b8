//! Tests of whole cities: their files are read back and judged.

use proptest::prelude::*;

use super::layout::cells;
use super::mesh::Quota;
use super::*;
use crate::vector::{Vector, vector};

/// Bytes of all files.
fn written(city: &City) -> Vec<Vec<u8>> {
    let mut files = vec![Vec::new(); city.files().len()];
    let append = |index: usize, bytes: &[u8]| {
        files[index].extend_from_slice(bytes);
        Ok::<(), ()>(())
    };
    city.write(append).expect("nothing fails");
    files
}

/// FNV-1a: enough to notice that a byte has changed.
fn hash(files: &[Vec<u8>]) -> u64 {
    files.iter().flatten().fold(0xCBF2_9CE4_8422_2325, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x100_0000_01B3)
    })
}

/// Quads of a PLY file, by a strict little reader.
fn quads(file: &[u8]) -> Vec<[Vector; 4]> {
    let end = b"end_header\n";
    let head = file.windows(end.len()).position(|window| window == end).expect("a head");
    let (head, body) = file.split_at(head + end.len());
    let head = std::str::from_utf8(head).expect("a head is text");
    let count = |word: &str| -> usize {
        let line = head.lines().find_map(|line| line.strip_prefix(word)).expect(word);
        line.trim().parse().expect("a count")
    };
    let (vertices, faces) = (count("element vertex"), count("element face"));
    assert_eq!(body.len(), 12 * vertices + 17 * faces, "{head}");
    let (points, faces) = body.split_at(12 * vertices);
    quads_of(points, faces)
}

fn quads_of(points: &[u8], faces: &[u8]) -> Vec<[Vector; 4]> {
    let four = |bytes: &[u8]| <[u8; 4]>::try_from(bytes).expect("four bytes");
    let number = |bytes: &[u8]| f64::from(f32::from_le_bytes(four(bytes)));
    let points: Vec<Vector> = points
        .chunks_exact(12)
        .map(|xyz| vector(number(&xyz[..4]), number(&xyz[4..8]), number(&xyz[8..])))
        .collect();
    let quad = |face: &[u8]| {
        assert_eq!(face[0], 4);
        std::array::from_fn(|i| {
            points[u32::from_le_bytes(four(&face[1 + 4 * i..5 + 4 * i])) as usize]
        })
    };
    faces.chunks_exact(17).map(quad).collect()
}

/// Quads of one finish of what is built.
fn built(finish: Finish, build: impl Fn(&mut Mesh)) -> Vec<[Vector; 4]> {
    let [points, faces] = [Pass::Vertices, Pass::Faces].map(|pass| {
        let mut all = Vec::new();
        let mut outlet = |of: Finish, bytes: &[u8]| {
            if of == finish {
                all.extend_from_slice(bytes);
            }
            ControlFlow::Continue(())
        };
        let mut mesh = Mesh::writing(pass, &mut outlet);
        build(&mut mesh);
        mesh.finish();
        drop(mesh);
        all
    });
    quads_of(&points, &faces)
}

/// Twice the areas of the halves of a quad, and its normal.
fn areas_and_normal([a, b, c, d]: [Vector; 4]) -> ([f64; 2], Vector) {
    let (one, other) = ((b - a).cross(c - a), (c - a).cross(d - a));
    ([one.length(), other.length()], (one + other).normalized())
}

fn check(quad: [Vector; 4], what: &str) {
    let (areas, _) = areas_and_normal(quad);
    assert!(areas.iter().all(|area| *area > 1e-9), "{what} has no area: {quad:?}");
    for Vector { x, y, z } in quad {
        let is_near = x.abs() < 1e4 && z.abs() < 1e4 && (-1.0..500.0).contains(&y);
        assert!(is_near, "{what} is far off: {quad:?}");
    }
}

#[test]
fn a_city_is_the_same_bytes_for_ever() {
    let files = written(&City::new(5_000).expect("a size"));
    assert_eq!(files, written(&City::new(5_000).expect("a size")));
    assert_eq!(hash(&files), 0xA0EE_91BE_AE03_DC88, "a change of the city changes the hash");
}

#[test]
fn files_are_as_long_as_their_heads_say_and_all_triangles_have_area() {
    for triangles in [1_000, 30_000] {
        let city = City::new(triangles).expect("a size");
        let mut sum = 0;
        for (file, bytes) in city.files().iter().zip(written(&city)) {
            assert_eq!(file.bytes, bytes.len() as u64, "{}", file.name);
            if file.name.ends_with(".ply") {
                let quads = quads(&bytes);
                quads.iter().for_each(|quad| check(*quad, &file.name));
                sum += 2 * quads.len() as u64;
            }
        }
        assert_eq!(sum, city.triangle_count());
    }
}

#[test]
fn all_details_of_all_kinds_of_blocks_have_area() {
    let cells = cells();
    let is_chosen = |kind| move |cell: &&layout::Cell| cell.kind == kind;
    let towers = cells.iter().filter(|cell| cell.centrality() > 0.6).take(2);
    let others = [layout::Kind::Park, layout::Kind::Landmark]
        .map(|kind| cells.iter().find(is_chosen(kind)).expect("one of each"));
    for cell in cells.iter().take(3).chain(towers).chain(others) {
        for detail in DETAILS {
            for finish in Finish::ALL {
                let quads = built(finish, |mesh| {
                    mesh.leaves = Quota { wanted: 500, left: 40 };
                    block::build(mesh, cell, detail);
                });
                quads.iter().for_each(|quad| check(*quad, finish.name()));
            }
        }
    }
}

#[test]
fn finer_blocks_have_more_triangles() {
    for cell in cells().iter().take(40) {
        let counts = DETAILS.map(|detail| {
            let mut mesh = Mesh::counting();
            block::build(&mut mesh, cell, detail);
            mesh.tally().quads
        });
        assert!(counts.is_sorted(), "{cell:?}: {counts:?}");
    }
}

#[test]
fn lights_shine_away_from_what_bears_them() {
    let cells = cells();
    let landmark = cells.iter().find(|cell| cell.kind == layout::Kind::Landmark).expect("one");
    let (x, z) = landmark.block().middle();
    let lit = |mesh: &mut Mesh| {
        mesh.lit = Quota { wanted: 500, left: 500 };
        block::build(mesh, landmark, Detail::Windows);
    };
    for finish in [Finish::WarmWindow, Finish::PaleWindow, Finish::BlueSign, Finish::RedSign] {
        for quad in built(finish, lit) {
            let (_, normal) = areas_and_normal(quad);
            let out = vector(quad[0].x - x, 0.0, quad[0].z - z);
            assert!(normal.dot(out) > 0.0 && normal.y.abs() < 1e-6, "{finish:?}: {quad:?}");
        }
    }
    let lamps = built(Finish::Lamp, |mesh| block::build(mesh, &cells[0], Detail::Grid));
    assert!(!lamps.is_empty());
    assert!(lamps.into_iter().all(|lamp| areas_and_normal(lamp).1.y < -0.99));
}

#[test]
fn numbers_that_make_no_city_are_refused() {
    for given in [0, 999, 1_000_000_001, u64::MAX] {
        let error = City::new(given).map(|_| ()).expect_err("out of range");
        assert_eq!(error, InvalidTriangles { given });
        assert!(error.to_string().contains("from 1000 to 1000000000"), "{error}");
    }
}

#[test]
fn a_city_has_its_triangles_few_lights_and_no_file_with_most_of_it() {
    for triangles in [20_000, 100_000, 1_000_001, 3_000_000] {
        let city = City::new(triangles).expect("a size");
        let count = city.triangle_count();
        assert!(count == triangles - triangles % 2, "{count} of {triangles}");
        let emitting = city.emitter_count();
        assert!(emitting > 0 && emitting * 200 <= count, "{emitting} of {count} emit");
        for (finish, (_, faces)) in &city.parts {
            assert!(faces * 2 * 10 <= count * 4, "{finish:?}: {} of {count}", faces * 2);
        }
    }
}

#[test]
fn pieces_are_small_and_an_error_ends_the_writing() {
    let city = City::new(60_000).expect("a size");
    let mut calls = 0;
    let result = city.write(|_, bytes| {
        assert!(bytes.len() < 2 * mesh::CHUNK_BYTES, "{} bytes", bytes.len());
        calls += 1;
        if calls < 50 { Ok(()) } else { Err("full") }
    });
    assert_eq!((result, calls), (Err("full"), 50));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn a_city_never_has_more_triangles_than_asked_for(triangles in 1_000_u64..120_000) {
        let city = City::new(triangles).expect("a size");
        let count = city.triangle_count();
        prop_assert!(count <= triangles && count * 2 >= triangles, "{count} of {triangles}");
        prop_assert!(city.emitter_count() * 200 <= triangles);
    }
}
