//! Tests of whole scenes: their texts are read back with a strict little reader and judged.

use std::collections::BTreeSet;

use proptest::prelude::*;

use crate::vector::{Vector, vector};
use crate::*;

/// An object as it was read back.
#[derive(Debug)]
struct Object {
    name: String,
    material: String,
    /// The corners of each of its polygons.
    polygons: Vec<Vec<Vector>>,
}

impl Object {
    /// Its name without its number.
    fn noun(&self) -> &str {
        self.name.rsplit_once('_').map_or(&self.name, |(noun, _)| noun)
    }
}

/// Reads an OBJ text; anything that a strict reader would not like is a failure.
fn read(text: &str) -> Vec<Object> {
    let (mut points, mut normals) = (Vec::new(), Vec::new());
    let mut objects: Vec<Object> = Vec::new();
    for line in text.lines() {
        let (word, rest) = line.split_once(' ').expect("no line is empty");
        match word {
            "#" | "mtllib" => assert!(objects.is_empty()),
            "o" => objects.push(Object {
                name: rest.to_owned(),
                material: String::new(),
                polygons: Vec::new(),
            }),
            "usemtl" => rest.clone_into(&mut objects.last_mut().expect("an object").material),
            "v" => points.push(triple(rest)),
            "vn" => normals.push(triple(rest)),
            "f" => {
                let corners = rest.split(' ').map(|corner| corner_of(corner, &points, &normals));
                objects.last_mut().expect("an object").polygons.push(corners.collect());
            }
            other => panic!("an unknown line: {other}"),
        }
    }
    objects
}

fn triple(text: &str) -> Vector {
    let numbers: Vec<f64> = text.split(' ').map(|n| n.parse().expect("a number")).collect();
    assert_eq!(numbers.len(), 3, "{text}");
    assert!(numbers.iter().all(|n| n.is_finite()));
    vector(numbers[0], numbers[1], numbers[2])
}

fn corner_of(text: &str, points: &[Vector], normals: &[Vector]) -> Vector {
    let back = |index: &str, count: usize| {
        let back: usize = index.strip_prefix('-').expect("relative").parse().expect("an index");
        assert!((1..=count).contains(&back), "index {index} of {count}");
        count - back
    };
    if let Some((point, normal)) = text.split_once("//") {
        let length = normals[back(normal, normals.len())].length();
        assert!((length - 1.0).abs() < 2e-3, "a normal of length {length}");
        return points[back(point, points.len())];
    }
    points[back(text, points.len())]
}

/// The normal of a polygon times twice its area.
fn facing(polygon: &[Vector]) -> Vector {
    let fan = polygon.windows(2).skip(1);
    fan.fold(vector(0., 0., 0.), |sum, pair| {
        sum + (pair[0] - polygon[0]).cross(pair[1] - polygon[0])
    })
}

/// The scene's own objects and its lights.
fn models(files: &Files) -> (Vec<Object>, Vec<Object>) {
    let is_main = |file: &&File| file.name.ends_with(".obj") && file.name != "lights.obj";
    let main = files.iter().find(is_main).expect("a model");
    (read(&main.text), read(files.text("lights.obj").expect("lights")))
}

fn shipped() -> [(&'static str, Files); 3] {
    [
        ("cornell-box", cornell_box()),
        ("office", office(1).expect("a size")),
        ("bathroom", bathroom(1).expect("a size")),
    ]
}

#[test]
fn counts_are_exact() {
    for (name, objects, lights) in [("office", 3_256, 3), ("bathroom", 18_012, 4)] {
        let (_, files) = shipped().into_iter().find(|scene| scene.0 == name).expect("shipped");
        let main = files.text(&format!("{name}.obj")).expect("a model");
        let lines = |text: &str| text.lines().filter(|line| line.starts_with("o ")).count();
        assert_eq!(lines(main), objects, "{name}");
        assert_eq!(lines(files.text("lights.obj").expect("lights")), lights, "{name}");
        let counts = files.counts();
        assert_eq!((counts.objects, counts.lights), (objects as u64, lights as u64));
    }
}

#[test]
fn every_polygon_is_sound_and_counted() {
    for (name, files) in shipped() {
        let (objects, lights) = models(&files);
        let mut triangles = 0;
        let mut names = BTreeSet::new();
        for object in objects.iter().chain(&lights) {
            assert!(names.insert(&object.name), "{name} has two {}", object.name);
            for polygon in &object.polygons {
                triangles += polygon.len() as u64 - 2;
                let area = facing(polygon).length();
                assert!(area > 1e-9, "{name}: {} has a face without area", object.name);
            }
        }
        assert_eq!(triangles, files.counts().triangles, "{name}");
    }
}

#[test]
fn materials_are_defined_and_lights_alone_shine() {
    for (name, files) in shipped() {
        let mtl = files.text(&format!("{name}.mtl")).expect("materials");
        let entry = |material: &str| {
            let start = mtl.find(&format!("newmtl {material}\n")).expect("defined");
            mtl[start..].split("\n\n").next().expect("an entry")
        };
        let (objects, lights) = models(&files);
        assert!(objects.iter().all(|object| !entry(&object.material).contains("Ke")), "{name}");
        assert!(lights.iter().all(|light| entry(&light.material).contains("Ke")), "{name}");
    }
}

/// Six times the signed volume; positive for a closed shape that faces outward.
fn signed_volume(object: &Object) -> f64 {
    let first = object.polygons[0][0];
    let fan = |polygon: &Vec<Vector>| (polygon[0] - first).dot(facing(polygon));
    object.polygons.iter().map(fan).sum()
}

#[test]
fn solid_things_face_outward() {
    let solid = [
        "apple",
        "basin",
        "book",
        "bottle",
        "castor",
        "chair_back",
        "chair_seat",
        "desk_top",
        "door",
        "drawer",
        "drawer_handle",
        "folded_towel",
        "globe",
        "globe_light",
        "lamp_bulb",
        "mug",
        "pearl",
        "pebble",
        "rolled_towel",
        "screen_case",
        "tap_spout",
        "vase",
    ];
    for (name, files) in &shipped()[1..] {
        let (objects, lights) = models(files);
        for object in objects.iter().chain(&lights) {
            if solid.contains(&object.noun()) {
                assert!(signed_volume(object) > 0.0, "{name}: {}", object.name);
            }
        }
    }
}

#[test]
fn lights_shine_into_the_room() {
    let (_, office_lights) = models(&office(1).expect("a size"));
    let toward = |light: &Object, direction: Vector| {
        light.polygons.iter().map(|polygon| facing(polygon).dot(direction)).collect::<Vec<_>>()
    };
    let into_the_room = vector(0., 0., 1.);
    assert!(toward(&office_lights[0], into_the_room).iter().all(|&cosine| cosine > 0.0));
    // The tube shines down and up.
    let down = toward(&office_lights[1], vector(0., -1., 0.));
    assert!(down[0] > 0.0 && down[1] < 0.0);
    let (_, bathroom_lights) = models(&bathroom(1).expect("a size"));
    for panel in &bathroom_lights[..2] {
        assert!(toward(panel, vector(0., -1., 0.)).iter().all(|&cosine| cosine > 0.0));
    }
}

#[test]
fn cameras_stand_free() {
    for (files, eye) in [
        (office(1).expect("a size"), vector(0.42, 1.62, 4.92)),
        (bathroom(1).expect("a size"), vector(1.0, 1.5, 3.02)),
    ] {
        for object in models(&files).0 {
            let near = object.polygons.iter().flatten();
            let nearest = near.map(|&point| (point - eye).length()).fold(f64::INFINITY, f64::min);
            assert!(nearest > 0.15, "{} is {nearest} from the eye", object.name);
        }
    }
}

#[test]
fn no_faces_overlap_in_one_plane() {
    for (name, files) in &shipped()[1..] {
        let (objects, lights) = models(files);
        let clashes = coplanar::overlaps(objects.iter().chain(&lights));
        assert!(clashes.is_empty(), "{name}: {clashes:?}");
    }
}

/// Axis-aligned faces that lie in one plane and cover each other.
mod coplanar {
    use super::*;

    /// Faces nearer than this are in one plane.
    const PLANE: f64 = 0.0004;
    /// Overlaps narrower than this are only edges that meet.
    const SLIVER: f64 = 0.0015;

    struct Face<'a> {
        noun: &'a str,
        at: f64,
        low: [f64; 2],
        high: [f64; 2],
    }

    /// The kinds of objects that overlap.
    pub(super) fn overlaps<'a>(
        objects: impl Iterator<Item = &'a Object> + Clone,
    ) -> BTreeSet<(&'a str, &'a str)> {
        let mut clashes = BTreeSet::new();
        for axis in 0..3 {
            let mut faces: Vec<Face<'_>> = objects.clone().flat_map(|o| flat(o, axis)).collect();
            faces.sort_by(|a, b| a.at.total_cmp(&b.at));
            for (here, face) in faces.iter().enumerate() {
                let near = faces[here + 1..].iter().take_while(|f| f.at - face.at < PLANE);
                let clash = near.filter(|other| overlap(face, other));
                clashes.extend(clash.map(|other| (face.noun, other.noun)));
            }
        }
        clashes
    }

    /// The faces of an object in planes across an axis.
    fn flat(object: &Object, axis: usize) -> Vec<Face<'_>> {
        let of = |p: Vector, axis: usize| [p.x, p.y, p.z][axis % 3];
        let faces = object.polygons.iter().filter(|polygon| {
            polygon.len() == 4
                && polygon.iter().all(|p| (of(*p, axis) - of(polygon[0], axis)).abs() < 1e-4)
        });
        let bounds = |polygon: &[Vector], axis: usize| {
            let along = polygon.iter().map(|p| of(*p, axis));
            (along.clone().fold(f64::MAX, f64::min), along.fold(f64::MIN, f64::max))
        };
        faces
            // Only true rectangles fill their bounds.
            .filter(|polygon| {
                let (u, v) = (bounds(polygon, axis + 1), bounds(polygon, axis + 2));
                let area = (u.1 - u.0) * (v.1 - v.0);
                (facing(polygon).length() / 2.0 - area).abs() < 0.02 * area
            })
            .map(|polygon| {
                let (u, v) = (bounds(polygon, axis + 1), bounds(polygon, axis + 2));
                Face {
                    noun: object.noun(),
                    at: of(polygon[0], axis),
                    low: [u.0, v.0],
                    high: [u.1, v.1],
                }
            })
            .collect()
    }

    fn overlap(a: &Face<'_>, b: &Face<'_>) -> bool {
        (0..2).all(|k| a.high[k].min(b.high[k]) - a.low[k].max(b.low[k]) > SLIVER)
    }
}

#[test]
fn files_are_small() {
    for ((name, files), most) in shipped().iter().zip([20_000, 1_500_000, 4_000_000]) {
        let total: usize = files.iter().map(|file| file.text.len()).sum();
        assert!(total <= most, "{name} takes {total} bytes");
    }
}

#[test]
fn two_calls_agree() {
    assert_eq!(office(2), office(2));
    assert_eq!(bathroom(1), bathroom(1));
}

#[test]
fn counts_grow_with_the_size() {
    for size in 2..=4 {
        let bays = u64::from(size);
        let counts = office(size).expect("a size").counts();
        assert_eq!((counts.objects, counts.lights), (bays * OFFICE_OBJECTS, bays * OFFICE_LIGHTS));
        let counts = bathroom(size).expect("a size").counts();
        let wanted = bays * BATHROOM_OBJECTS;
        assert!(counts.objects.abs_diff(wanted) * 10 < wanted, "{}", counts.objects);
        assert_eq!(counts.lights, bays * BATHROOM_LIGHTS);
    }
}

#[test]
fn impossible_sizes_are_refused() {
    for (made, scene, most) in
        [(office(0), "office", OFFICE_SIZE_MAX), (bathroom(0), "bathroom", BATHROOM_SIZE_MAX)]
    {
        assert_eq!(made, Err(InvalidSize { scene, size: 0, most }));
    }
    let error = office(OFFICE_SIZE_MAX + 1).expect_err("too large");
    let text = "the size of office must be from 1 to 256, not 257; choose one in that range";
    assert_eq!(error.to_string(), text);
}

proptest! {
    #[test]
    fn sizes_beyond_the_limit_are_refused(beyond in 1..u32::MAX - OFFICE_SIZE_MAX) {
        prop_assert!(office(OFFICE_SIZE_MAX + beyond).is_err());
        prop_assert!(bathroom(BATHROOM_SIZE_MAX.saturating_add(beyond)).is_err());
    }
}
