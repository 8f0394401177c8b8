//! PLY files of all kinds, good and bad.

use proptest::prelude::*;

use super::header::{Encoding, Kind};
use super::scalar::{ByteOrder, Scalar};
use super::*;

/// What a property of an element holds.
#[derive(Clone, Debug)]
enum Value {
    Single(f64),
    List(Vec<f64>),
}

/// An element to be written: its name, its properties and their values.
type Elements = Vec<(&'static str, Vec<(&'static str, Kind)>, Vec<Vec<Value>>)>;

const ENCODINGS: [Encoding; 3] =
    [Encoding::Ascii, Encoding::Binary(ByteOrder::Little), Encoding::Binary(ByteOrder::Big)];

fn name_of(scalar: Scalar) -> &'static str {
    Scalar::names().filter(|name| Scalar::named(name) == Some(scalar)).last().unwrap()
}

fn encode(scalar: Scalar, number: f64, order: ByteOrder) -> Vec<u8> {
    let mut bytes = match scalar {
        Scalar::Int8 => (number as i8).to_le_bytes().to_vec(),
        Scalar::Uint8 => (number as u8).to_le_bytes().to_vec(),
        Scalar::Int16 => (number as i16).to_le_bytes().to_vec(),
        Scalar::Uint16 => (number as u16).to_le_bytes().to_vec(),
        Scalar::Int32 => (number as i32).to_le_bytes().to_vec(),
        Scalar::Uint32 => (number as u32).to_le_bytes().to_vec(),
        Scalar::Float32 => (number as f32).to_le_bytes().to_vec(),
        Scalar::Float64 => number.to_le_bytes().to_vec(),
    };
    if order == ByteOrder::Big {
        bytes.reverse();
    }
    bytes
}

fn write(elements: &Elements, encoding: Encoding, newline: &str) -> Vec<u8> {
    let format = match encoding {
        Encoding::Ascii => "ascii",
        Encoding::Binary(ByteOrder::Little) => "binary_little_endian",
        Encoding::Binary(ByteOrder::Big) => "binary_big_endian",
    };
    let mut lines = vec!["ply".into(), format!("format {format} 1.0"), "comment made here".into()];
    let mut body = Vec::new();
    let mut put = |scalar, number: f64| match encoding {
        Encoding::Ascii => body.extend_from_slice(format!("{number} ").as_bytes()),
        Encoding::Binary(order) => body.extend(encode(scalar, number, order)),
    };
    for (name, properties, rows) in elements {
        lines.push(format!("element {name} {}", rows.len()));
        for (name, kind) in properties {
            lines.push(match *kind {
                Kind::Single(scalar) => format!("property {} {name}", name_of(scalar)),
                Kind::List { length, item } => {
                    format!("property list {} {} {name}", name_of(length), name_of(item))
                }
            });
        }
        for (value, (_, kind)) in rows.iter().flat_map(|row| row.iter().zip(properties)) {
            match (value, *kind) {
                (Value::Single(number), Kind::Single(scalar)) => put(scalar, *number),
                (Value::List(numbers), Kind::List { length, item }) => {
                    put(length, numbers.len() as f64);
                    numbers.iter().for_each(|&number| put(item, number));
                }
                _ => panic!("a list for a number"),
            }
        }
    }
    lines.push("end_header".into());
    let header: String = lines.into_iter().map(|line| line + newline).collect();
    [header.into_bytes(), body].concat()
}

fn read(bytes: &[u8]) -> Result<Mesh, SceneError> {
    PlyFile::new(LargeFile::in_memory("a.ply", bytes.into()))?.read()
}

fn singles(names: &[&'static str], scalar: Scalar) -> Vec<(&'static str, Kind)> {
    names.iter().map(|name| (*name, Kind::Single(scalar))).collect()
}

fn row(numbers: &[f64]) -> Vec<Value> {
    numbers.iter().map(|&number| Value::Single(number)).collect()
}

fn corners(item: Scalar, name: &'static str) -> Vec<(&'static str, Kind)> {
    vec![(name, Kind::List { length: Scalar::Uint8, item })]
}

fn list(numbers: &[u32]) -> Vec<Value> {
    vec![Value::List(numbers.iter().map(|&number| f64::from(number)).collect())]
}

/// A square and a triangle, with a thin face between.
fn square(scalar: Scalar, item: Scalar) -> Elements {
    let points = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]];
    vec![
        (
            "vertex",
            singles(&["x", "y", "z"], scalar),
            points.iter().map(|p| row(&p.map(f64::from))).collect(),
        ),
        (
            "face",
            corners(item, "vertex_index"),
            vec![list(&[0, 1, 2, 3]), list(&[0, 1]), list(&[3, 2, 1])],
        ),
    ]
}

#[test]
fn all_encodings_and_types_give_the_same_mesh() {
    let types = [Scalar::Int8, Scalar::Uint16, Scalar::Int32, Scalar::Float32, Scalar::Float64];
    let items = [Scalar::Uint8, Scalar::Int16, Scalar::Uint32];
    for (encoding, newline) in ENCODINGS.into_iter().zip(["\r\n", "\n", "\r\n"]) {
        for (scalar, item) in types.into_iter().flat_map(|t| items.map(|item| (t, item))) {
            let mesh = read(&write(&square(scalar, item), encoding, newline)).unwrap();
            assert_eq!(mesh.positions[2], [1.0, 1.0, 0.0], "{encoding:?} {scalar:?}");
            let triangles: Vec<_> = mesh.triangles.iter().map(|t| t.positions).collect();
            assert_eq!(triangles, [[0, 1, 2], [0, 2, 3], [3, 2, 1]], "{encoding:?} {item:?}");
            assert_eq!((mesh.thin_faces, mesh.positions.len()), (1, 4));
            assert_eq!(mesh.triangles[0].normals, [NO_INDEX; 3]);
        }
    }
}

/// Every vertex and face has more than is used, in an odd order, and other elements lie between.
fn cluttered() -> Elements {
    let float = |name| (name, Kind::Single(Scalar::Float32));
    let byte = |name| (name, Kind::Single(Scalar::Uint8));
    let words = |name| (name, Kind::List { length: Scalar::Uint16, item: Scalar::Float64 });
    let one = Value::Single;
    let vertex = |n: f64| {
        let odd = Value::List(vec![9.0; n as usize]);
        let numbers = [n + 3.0, 7.0, n + 1.0, n, n + 4.0, n + 2.0, n + 5.0, n + 6.0];
        let mut row: Vec<Value> = numbers.into_iter().map(one).collect();
        row.insert(3, odd);
        row
    };
    let face = |numbers: &[u32]| {
        let mut row = vec![one(5.0), Value::List(vec![0.5; 6]), one(1.0)];
        row.splice(2..2, list(numbers));
        row
    };
    let index = ("vertex_indices", Kind::List { length: Scalar::Int32, item: Scalar::Int32 });
    vec![
        ("camera", vec![float("fov"), words("pose")], vec![vec![one(1.0), Value::List(vec![2.0])]]),
        (
            "face",
            vec![byte("flags"), words("texcoord"), index, byte("material")],
            vec![face(&[0, 1, 2]), face(&[2, 1, 0])],
        ),
        ("nothing", Vec::new(), vec![Vec::new(); 5]),
        (
            "vertex",
            vec![
                float("nx"),
                byte("red"),
                float("y"),
                words("odd"),
                float("x"),
                float("ny"),
                float("z"),
                float("nz"),
                float("v"),
            ],
            [0.0, 2.0, 10.0].map(vertex).to_vec(),
        ),
        ("edge", vec![byte("a"), byte("b")], vec![row(&[1.0, 2.0]); 4]),
    ]
}

#[test]
fn what_is_not_used_is_skipped() {
    for encoding in ENCODINGS {
        let mut elements = cluttered();
        let mesh = read(&write(&elements, encoding, "\n")).unwrap();
        assert_eq!(mesh.positions, [[0.0, 1.0, 2.0], [2.0, 3.0, 4.0], [10.0, 11.0, 12.0]]);
        assert_eq!(mesh.normals[1], [5.0, 6.0, 7.0], "{encoding:?}");
        assert_eq!(mesh.triangles[1].normals, [2, 1, 0]);
        assert!(mesh.texcoords.is_empty(), "v alone is no texture coordinate");
        elements[3].1[1].0 = "u";
        let mesh = read(&write(&elements, encoding, "\n")).unwrap();
        assert_eq!(mesh.texcoords[2], [7.0, 16.0]);
        assert_eq!(mesh.triangles[0].texcoords, [0, 1, 2]);
    }
}

fn ascii(header: &str, body: &str) -> String {
    let text = format!("ply\nformat ascii 1.0\n{header}end_header\n{body}");
    read(text.as_bytes()).unwrap_err().to_string()
}

const VERTEX: &str = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
const FACE: &str = "element face 1\nproperty list char int vertex_index\n";
const POINTS: &str = "0 0 0 1 0 0 0 1 0 ";

#[test]
fn bad_headers_are_named_with_their_line() {
    let both = format!("{VERTEX}{FACE}");
    for (header, wanted) in [
        ("elephant 3\n", "a.ply:3: \"elephant 3\" means nothing"),
        ("format utf-8 1.0\n", "a.ply:3: format \"utf-8 1.0\" is none of \"ascii\""),
        ("element vertex many\n", "a.ply:3: \"many\" is not a count"),
        ("element vertex -1\n", "a.ply:3: \"-1\" is not a count"),
        ("element vertex\n", "a.ply:3: write \"element NAME COUNT\""),
        ("property float x\n", "a.ply:3: a property before the first element"),
        (
            "element vertex 3\nproperty flaot x\n",
            "a.ply:4: there is no type of numbers \"flaot\"; \
          did you mean \"float\"?",
        ),
        ("element vertex 3\nproperty list float int x\n", "a.ply:4: the length of a list"),
        ("element vertex 3\nproperty x\n", "a.ply:4: write \"property TYPE NAME\""),
        (&format!("{VERTEX}property int x\n"), "a.ply:7: property \"x\" is there twice"),
        (&format!("{VERTEX}{VERTEX}"), "a.ply:7: element \"vertex\" is there twice"),
        (FACE, "a.ply: has no element \"vertex\""),
        (VERTEX, "a.ply: has no element \"face\"; points alone"),
        (&both.replace(" z", " w"), "a.ply:3: a vertex needs the properties x, y and z"),
        (&both.replace("vertex_index", "indices"), "a.ply:7: a face needs the property list"),
        (&both.replace("char int", "char float"), "a.ply:8: the corners of a face must be"),
        (&both.replace("list char", ""), "a.ply:8: the corners of a face must be"),
        (
            &both.replace("vertex 3", "vertex 4000000000000000000"),
            "a.ply:3: 4000000000000000000 \
          × \"vertex\" take 24000000000000000000 bytes or more",
        ),
        (&both.replace("vertex 3", "vertex 9"), "a.ply:3: 9 × \"vertex\" take 54 bytes or more"),
        (&both.replace("face 1", "face 99"), "a.ply:7: 99 × \"face\" take 198 bytes"),
        (&both.replace("face 1", "face 0"), "a.ply:10: 8 bytes follow the last element"),
    ] {
        let error = ascii(header, &format!("{POINTS}3 0 1 2\n"));
        assert!(error.starts_with(wanted), "{header}: {error}");
    }
    let error = read(b"solid cube\n").unwrap_err().to_string();
    assert!(error.starts_with("a.ply: is not a PLY file"), "{error}");
    let error = read(b"ply\nformat ascii 1.0\n").unwrap_err().to_string();
    assert!(error.starts_with("a.ply:3: the header does not end"), "{error}");
    let error = read(b"ply\nend_header\n").unwrap_err().to_string();
    assert!(error.starts_with("a.ply:2: no line \"format …\""), "{error}");
}

#[test]
fn bad_bodies_are_named_with_their_element() {
    let both = format!("{VERTEX}{FACE}");
    for (body, wanted) in [
        ("3 0 1 3", "a.ply:10: face 0 (counted from 0): vertex 3 is out of range: by its header"),
        ("3 0\n1 -1", "a.ply:11: face 0 (counted from 0): vertex -1 is out of range"),
        ("3 0 1 1.5\n", "a.ply:10: face 0 (counted from 0): 1.5 is not a whole number"),
        ("\n3 0 1 x2", "a.ply:11: face 0 (counted from 0): \"x2\" is not a number"),
        ("3 0 1", "a.ply:10: face 0 (counted from 0): the file ends here"),
        ("-3 0 1 2", "a.ply:10: face 0 (counted from 0): a list of -3 items cannot be"),
        ("70000 0 1 2", "a.ply:10: face 0 (counted from 0): a face of 70000 corners; cut it"),
        ("3 0 1 2\n3 0 1 2", "a.ply:11: 7 bytes follow the last element"),
        ("2 0 1\n3 0 1 2", "a.ply:11: 7 bytes follow the last element"),
        ("2 0 1", "a.ply:7: has no face of three corners or more"),
    ] {
        let error = ascii(&both, &format!("{POINTS}{body}"));
        assert!(error.starts_with(wanted), "{body}: {error}");
    }
    let error = ascii(&both, "0 0 0 1 0 nil 0 1 0 3 0 1 2");
    assert!(error.starts_with("a.ply:10: vertex 1 (counted from 0): \"nil\" is not"), "{error}");
}

#[test]
fn a_binary_file_must_have_just_the_length_that_it_claims() {
    for encoding in &ENCODINGS[1..] {
        for elements in [square(Scalar::Float32, Scalar::Int32), cluttered()] {
            let bytes = write(&elements, *encoding, "\n");
            read(&[&bytes[..], b"\r\n"].concat()).unwrap();
            let long = read(&[&bytes[..], b"\0"].concat()).unwrap_err().to_string();
            assert!(
                long.starts_with("a.ply: 1 bytes follow the last element, from byte"),
                "{long}"
            );
            let body = bytes.len() - 60;
            for length in body..bytes.len() {
                let short = read(&bytes[..length]).unwrap_err().to_string();
                assert!(short.contains("get the whole file"), "{length}: {short}");
            }
        }
    }
    let mut bytes = write(&square(Scalar::Float32, Scalar::Int32), ENCODINGS[1], "\n");
    let last = bytes.len() - 4;
    bytes[last..].copy_from_slice(&(-1i32).to_le_bytes());
    let error = read(&bytes).unwrap_err().to_string();
    let face = format!("a.ply: face 2 (counted from 0) at byte {}: vertex -1 is out", last - 9);
    assert!(error.starts_with(&face), "{error}");
}

#[test]
fn headers_with_wrong_counts_are_blamed() {
    let square = square(Scalar::Float32, Scalar::Int32);
    for encoding in ENCODINGS {
        let bytes = write(&square, encoding, "\n");
        for (element, count) in [("vertex 4", 3), ("vertex 4", 5), ("face 3", 2), ("face 3", 4)] {
            let name = element.split(' ').next().unwrap();
            let wrong = format!("element {name} {count}\n");
            let at = bytes.windows(element.len()).position(|it| it == element.as_bytes()).unwrap();
            let (before, after) = (&bytes[..at - 8], &bytes[at + element.len() + 1..]);
            let error = read(&[before, wrong.as_bytes(), after].concat()).unwrap_err().to_string();
            let is_blamed = error.contains("header") && error.contains("make");
            assert!(is_blamed, "{encoding:?}, {count} for {element}: {error}");
        }
    }
}

proptest! {
    #[test]
    fn arbitrary_bodies_never_panic(
        format in prop::sample::select(vec!["ascii", "binary_little_endian", "binary_big_endian"]),
        header in "((element (vertex|face|x) [0-9]{1,3}|property (char|int|double) (x|y|z|nx|s)\
                   |property list (uchar|int|char) (int|uint8|short) vertex_ind(ex|ices))\n){3,9}",
        is_whole: bool,
        body in prop::collection::vec(any::<u8>(), 0..200),
    ) {
        let header = if is_whole { format!("{VERTEX}{FACE}") } else { header };
        let text = format!("ply\nformat {format} 1.0\n{header}end_header\n");
        let _ = read(&[text.as_bytes(), &body].concat());
    }

    #[test]
    fn changed_files_never_panic(
        encoding in 0usize..3,
        is_cluttered: bool,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6),
        cut in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let square = square(Scalar::Float32, Scalar::Int32);
        let elements = if is_cluttered { cluttered() } else { square };
        let mut bytes = write(&elements, ENCODINGS[encoding], "\n");
        for (at, value) in changes {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        bytes.truncate(cut.map_or(bytes.len(), |cut| cut.index(bytes.len())));
        let _ = read(&bytes);
    }

    #[test]
    fn meshes_round_trip(
        points in prop::collection::vec(any::<[f32; 3]>(), 3..20),
        faces in prop::collection::vec(prop::collection::vec(any::<prop::sample::Index>(), 3), 1..9),
        encoding in 0usize..3,
    ) {
        let faces: Vec<Vec<u32>> = faces.iter()
            .map(|face| face.iter().map(|index| index.index(points.len()) as u32).collect())
            .collect();
        let elements = vec![
            (
                "vertex",
                singles(&["x", "y", "z"], Scalar::Float32),
                points.iter().map(|p| row(&p.map(f64::from))).collect(),
            ),
            (
                "face",
                corners(Scalar::Uint32, "vertex_indices"),
                faces.iter().map(|face| list(face)).collect(),
            ),
        ];
        let mesh = read(&write(&elements, ENCODINGS[encoding], "\n")).unwrap();
        let bits = |points: &[[f32; 3]]| -> Vec<_> {
            let shown = |x: f32| if x.is_nan() { None } else { Some(x.to_bits()) };
            points.iter().map(|p| p.map(shown)).collect()
        };
        prop_assert_eq!(bits(&mesh.positions), bits(&points));
        let triangles: Vec<Vec<u32>> =
            mesh.triangles.iter().map(|triangle| triangle.positions.to_vec()).collect();
        prop_assert_eq!(triangles, faces);
    }
}
