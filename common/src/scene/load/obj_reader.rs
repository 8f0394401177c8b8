//! Reading OBJ files line by line: who is who, and whether every line makes sense.
//!
//! The lines of a file are shown to an [`ObjSink`], which keeps them in memory or on disk, so that
//! both ways of keeping a model share every rule and every complaint. Nothing is held here that
//! grows with the file, apart from names. Faces may refer to vertices that come after them, so only
//! at the end is it known whether all indices are in range.

use super::mesh::{CORNERS_MAX, DEFAULT_OBJECT, MaterialNames, Part};
use crate::scene::NO_INDEX;
use crate::scene::error::{Place, SceneError};
use crate::scene::files::{OpenFile, Scan};

/// Longest line, with the lines that continue it: a face of the most corners has room.
const LINE_BYTES_MAX: usize = 1 << 24;

/// Which kind of vertex data an index points into.
const KINDS: [&str; 3] = ["v", "vt", "vn"];

/// A corner of a face: its position, texture coordinate and normal, counted from 0; [`NO_INDEX`]
/// where there is none.
pub(super) type Corner = [u32; 3];

/// Keeps what an OBJ file says.
pub(super) trait ObjSink {
    /// Keeps a position.
    fn position(&mut self, position: [f32; 3]) -> Result<(), SceneError>;
    /// Keeps a texture coordinate.
    fn texcoord(&mut self, texcoord: [f32; 2]) -> Result<(), SceneError>;
    /// Keeps a normal, of any length.
    fn normal(&mut self, normal: [f32; 3]) -> Result<(), SceneError>;
    /// Takes note of what the following faces have in common.
    fn part(&mut self, part: &Part) -> Result<(), SceneError>;
    /// Keeps a face; all of its corners have texture coordinates or none has, and so with normals.
    fn face(&mut self, corners: &[Corner]) -> Result<(), SceneError>;
}

/// What else an OBJ file says.
#[derive(Debug, Default)]
pub(super) struct ObjOutline {
    pub(super) materials: MaterialNames,
    /// How many positions, texture coordinates and normals there are.
    pub(super) counts: [u64; 3],
    /// How many triangles its faces are cut into.
    pub(super) triangle_count: u64,
    /// Faces with fewer than three corners.
    pub(super) thin_faces: u64,
}

/// Goes over the file called `file`.
pub(super) fn read_obj(
    file: &str,
    opened: &OpenFile<'_>,
    sink: &mut dyn ObjSink,
) -> Result<ObjOutline, SceneError> {
    let mut scan = Scan::new(opened, 0);
    if scan.peek(3)?.starts_with(b"\xef\xbb\xbf") {
        scan.skip(3);
    }
    let mut reader = ObjReader::new(file, sink);
    let (mut line, mut joined) = (0, String::new());
    while let Some(bytes) = scan.line(LINE_BYTES_MAX)? {
        line += 1;
        if joined.is_empty() {
            reader.line = line;
        }
        if bytes.len() + joined.len() > LINE_BYTES_MAX {
            let problem = format!("a line of more than {LINE_BYTES_MAX} bytes; is this an OBJ?");
            return Err(reader.malformed(problem));
        }
        let text = String::from_utf8_lossy(bytes);
        if let Some(head) = text.strip_suffix('\\') {
            joined.push_str(head);
            joined.push(' ');
        } else if joined.is_empty() {
            reader.statement(text.trim())?;
        } else {
            joined.push_str(&text);
            reader.statement(joined.trim())?;
            joined.clear();
        }
    }
    reader.statement(joined.trim())?;
    reader.finish()
}

/// Where the reading stands.
struct ObjReader<'a> {
    file: &'a str,
    sink: &'a mut dyn ObjSink,
    line: usize,
    outline: ObjOutline,
    /// The largest index of each kind, and the line that has it.
    largest: [(u64, usize); 3],
    part: Part,
    /// Whether there is an object yet.
    has_object: bool,
    /// Whether the sink knows of the part.
    is_part_known: bool,
    /// Positions of materials by name.
    known_materials: std::collections::BTreeMap<String, u32>,
    corners: Vec<Corner>,
    /// The first line whose face has fewer than three corners.
    first_thin_line: Option<usize>,
}

impl<'a> ObjReader<'a> {
    fn new(file: &'a str, sink: &'a mut dyn ObjSink) -> Self {
        Self {
            file,
            sink,
            line: 0,
            outline: ObjOutline::default(),
            largest: [(0, 0); 3],
            part: Part { material: NO_INDEX, ..Part::default() },
            has_object: false,
            is_part_known: false,
            known_materials: std::collections::BTreeMap::new(),
            corners: Vec::new(),
            first_thin_line: None,
        }
    }

    fn malformed(&self, problem: String) -> SceneError {
        SceneError::Malformed { place: Place::line(self.file, self.line), problem }
    }

    fn statement(&mut self, line: &str) -> Result<(), SceneError> {
        let (key, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        match key {
            "v" => self.vertex(0, rest)?,
            "vt" => self.vertex(1, rest)?,
            "vn" => self.vertex(2, rest)?,
            "f" => self.face(rest)?,
            "o" | "g" => self.begin_object(rest.trim()),
            "usemtl" => self.use_material(rest.trim()),
            "mtllib" if rest.trim().is_empty() => {
                return Err(self.malformed("\"mtllib\" needs the name of a file".into()));
            }
            "mtllib" => {
                let libraries = &mut self.outline.materials.libraries;
                libraries.push((rest.trim().to_owned(), self.line));
            }
            _ => {}
        }
        Ok(())
    }

    /// Reads the numbers that count: of positions three and a weight (colours are left out), of
    /// texture coordinates two, of normals three.
    fn vertex(&mut self, kind: usize, rest: &str) -> Result<(), SceneError> {
        let (mut numbers, mut count) = ([0.0f32; 4], 0);
        let words = without_comment(rest);
        let word_count = words.split_whitespace().count();
        let (least, kept) = match (kind, word_count) {
            (0, 4) => (3, 4),
            (1, _) => (1, 2),
            _ => (3, 3),
        };
        if word_count < least {
            let key = KINDS[kind];
            let problem = format!("\"{key}\" needs {least} numbers and has {word_count}");
            return Err(self.malformed(problem));
        }
        for word in words.split_whitespace().take(kept) {
            let number = word.parse();
            numbers[count] =
                number.map_err(|_| self.malformed(format!("\"{word}\" is not a number")))?;
            count += 1;
        }
        let [x, y, z, weight] = numbers;
        self.outline.counts[kind] += 1;
        if self.outline.counts[kind] >= u64::from(NO_INDEX) {
            return Err(self.too_large(kind));
        }
        match kind {
            0 if count < 4 => self.sink.position([x, y, z]),
            0 if weight == 0.0 => {
                Err(self.malformed("the weight of a vertex must not be 0".into()))
            }
            0 => self.sink.position([x, y, z].map(|component| component / weight)),
            1 => self.sink.texcoord([x, y]),
            _ => self.sink.normal([x, y, z]),
        }
    }

    fn too_large(&self, kind: usize) -> SceneError {
        SceneError::TooLarge {
            place: Place::line(self.file, self.line),
            problem: format!(
                "more than {} × \"{}\"; cut the model into files",
                NO_INDEX - 1,
                KINDS[kind]
            ),
        }
    }

    fn face(&mut self, rest: &str) -> Result<(), SceneError> {
        self.corners.clear();
        for word in without_comment(rest).split_whitespace() {
            let corner = self.corner(word)?;
            self.corners.push(corner);
        }
        let corner_count = self.corners.len();
        if corner_count < 3 {
            self.outline.thin_faces += 1;
            self.first_thin_line.get_or_insert(self.line);
            return Ok(());
        }
        if corner_count > CORNERS_MAX {
            let problem = format!(
                "a face of {corner_count} corners; cut it into faces of at most {CORNERS_MAX}"
            );
            return Err(self.malformed(problem));
        }
        for kind in 1..KINDS.len() {
            if self.corners.iter().any(|corner| corner[kind] == NO_INDEX) {
                self.corners.iter_mut().for_each(|corner| corner[kind] = NO_INDEX);
            }
        }
        self.begin_part()?;
        self.outline.triangle_count += corner_count as u64 - 2;
        self.sink.face(&self.corners)
    }

    /// Reads `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    fn corner(&mut self, word: &str) -> Result<Corner, SceneError> {
        let mut corner = [NO_INDEX; 3];
        for (kind, part) in word.split('/').enumerate() {
            if kind >= KINDS.len() {
                return Err(self.malformed(format!("\"{word}\" has more than three indices")));
            }
            if !part.is_empty() {
                corner[kind] = self.index(kind, part, word)?;
            }
        }
        if word.is_empty() || word.starts_with('/') {
            return Err(self.malformed(format!("\"{word}\" lacks the index of a vertex")));
        }
        Ok(corner)
    }

    /// An index counted from 0. One that is too large is clamped, and complained of at the end.
    fn index(&mut self, kind: usize, part: &str, word: &str) -> Result<u32, SceneError> {
        let (key, count) = (KINDS[kind], self.outline.counts[kind]);
        let Ok(number) = part.parse::<i64>() else {
            return Err(self.malformed(format!("\"{word}\" is not a corner of a face")));
        };
        let distance = number.unsigned_abs();
        let narrow = |index: u64| u32::try_from(index).unwrap_or(NO_INDEX - 1);
        if number > 0 {
            if distance > self.largest[kind].0 {
                self.largest[kind] = (distance, self.line);
            }
            return Ok(narrow(distance - 1));
        }
        if number == 0 || distance > count {
            return Err(self.malformed(format!(
                "face index {number} is out of range: {count} \"{key}\" stand above it, \
                 counted from 1, or backwards from -1"
            )));
        }
        Ok(narrow(count - distance))
    }

    /// Tells the sink of the part that a face belongs to, if that is a new one.
    fn begin_part(&mut self) -> Result<(), SceneError> {
        if !self.has_object {
            self.begin_object(DEFAULT_OBJECT);
        }
        if self.is_part_known {
            return Ok(());
        }
        self.is_part_known = true;
        self.outline.materials.is_partial |= self.part.material == NO_INDEX;
        self.sink.part(&self.part)
    }

    fn begin_object(&mut self, name: &str) {
        let name = if name.is_empty() { DEFAULT_OBJECT } else { name };
        if self.has_object && self.part.name == name {
            return;
        }
        self.part.object += 1;
        name.clone_into(&mut self.part.name);
        (self.has_object, self.is_part_known) = (true, false);
    }

    fn use_material(&mut self, name: &str) {
        self.is_part_known = false;
        if name.is_empty() {
            self.part.material = NO_INDEX;
            return;
        }
        let names = &mut self.outline.materials.names;
        let known = self.known_materials.get(name).copied();
        self.part.material = known.unwrap_or_else(|| {
            let number = u32::try_from(names.len()).unwrap_or(NO_INDEX);
            names.push((name.to_owned(), self.line));
            self.known_materials.insert(name.to_owned(), number);
            number
        });
    }

    fn finish(mut self) -> Result<ObjOutline, SceneError> {
        for (kind, key) in KINDS.into_iter().enumerate() {
            let ((largest, line), count) = (self.largest[kind], self.outline.counts[kind]);
            if largest > count {
                self.line = line;
                return Err(self.malformed(format!(
                    "face index {largest} is out of range: the file has {count} \"{key}\""
                )));
            }
        }
        if self.outline.triangle_count > 0 {
            return Ok(self.outline);
        }
        Err(match self.first_thin_line {
            None => SceneError::Empty {
                place: Place::file(self.file),
                problem: "has no faces, so there is nothing to render".into(),
            },
            Some(line) => SceneError::Empty {
                place: Place::line(self.file, line),
                problem: "a face needs three corners or more, and no other is there".into(),
            },
        })
    }
}

fn without_comment(text: &str) -> &str {
    text.split('#').next().unwrap_or("")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::files::LargeFile;

    const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

    /// Writes down all that it is told.
    #[derive(Default)]
    struct Notes(Vec<String>);

    impl Notes {
        fn note(&mut self, text: String) -> Result<(), SceneError> {
            self.0.push(text);
            Ok(())
        }
    }

    impl ObjSink for Notes {
        fn position(&mut self, position: [f32; 3]) -> Result<(), SceneError> {
            self.note(format!("v {position:?}"))
        }
        fn texcoord(&mut self, texcoord: [f32; 2]) -> Result<(), SceneError> {
            self.note(format!("vt {texcoord:?}"))
        }
        fn normal(&mut self, normal: [f32; 3]) -> Result<(), SceneError> {
            self.note(format!("vn {normal:?}"))
        }
        fn part(&mut self, part: &Part) -> Result<(), SceneError> {
            let material = part.material as i32;
            self.note(format!("{} {} {material}", part.object, part.name))
        }
        fn face(&mut self, corners: &[Corner]) -> Result<(), SceneError> {
            self.note(format!(
                "f {:?}",
                corners.iter().map(|c| c.map(|i| i as i32)).collect::<Vec<_>>()
            ))
        }
    }

    fn notes(rest: &str) -> Result<(Vec<String>, ObjOutline), SceneError> {
        let text = format!("{TRIANGLE}{rest}");
        let file = LargeFile::in_memory("a.obj", text.as_bytes().into());
        let mut notes = Notes::default();
        let outline = read_obj("a.obj", &file.open()?, &mut notes)?;
        Ok((notes.0.split_off(3), outline))
    }

    #[test]
    fn objects_materials_and_attributes_are_told_apart() {
        let text = "vn 0 0 1\r\nf 1 2 3\r\ng a b\r\nusemtl red wood\r\nf 1//1 2//1 -1//1 # c\r\n\
                    f 1//1 2//1 3\r\ng a b\r\nf 1 2 \\\r\n 3\r\no c\r\nf 1 2 3\r\n";
        let (notes, outline) = notes(text).unwrap();
        let plain = "f [[0, -1, -1], [1, -1, -1], [2, -1, -1]]";
        let expected = [
            "vn [0.0, 0.0, 1.0]",
            "1 default -1",
            plain,
            "2 a b 0",
            "f [[0, -1, 0], [1, -1, 0], [2, -1, 0]]",
            plain,
            plain,
            "3 c 0",
            plain,
        ];
        assert_eq!(notes, expected);
        assert_eq!(outline.materials.names, [("red wood".to_owned(), 7)]);
        assert!(outline.materials.is_partial);
        assert_eq!((outline.counts, outline.triangle_count), ([3, 0, 1], 5));
    }

    #[test]
    fn odd_statements_mean_what_they_should() {
        let text =
            "v 1 2 3 .5 .5 .5\nv 2 4 6 2\nvt 0.5\nl 1 2 3\np 1\nvp 1\nf 1/1 2/1 6/1\nv 1 2 3";
        let (notes, _) = notes(text).unwrap();
        let expected = [
            "v [1.0, 2.0, 3.0]",
            "v [1.0, 2.0, 3.0]",
            "vt [0.5, 0.0]",
            "1 default -1",
            "f [[0, 0, -1], [1, 0, -1], [5, 0, -1]]",
            "v [1.0, 2.0, 3.0]",
        ];
        assert_eq!(notes, expected);
    }

    #[test]
    fn bad_lines_are_named() {
        for (text, wanted) in [
            ("f 1 2 9\n", "a.obj:4: face index 9 is out of range: the file has 3 \"v\""),
            ("f 1 2 -9\n", "a.obj:4: face index -9 is out of range: 3 \"v\" stand above it"),
            ("f 0 1 2\n", "a.obj:4: face index 0 is out of range"),
            ("f 1//1 2//1 3//1\n", "a.obj:4: face index 1 is out of range: the file has 0 \"vn\""),
            ("f 1 2 x\n", "a.obj:4: \"x\" is not a corner of a face"),
            ("f 1/1/1/1 2 3\n", "a.obj:4: \"1/1/1/1\" has more than three indices"),
            ("f /1 2 3\n", "a.obj:4: \"/1\" lacks the index of a vertex"),
            ("v 1 2\n", "a.obj:4: \"v\" needs 3 numbers and has 2"),
            ("v 1 2 y\n", "a.obj:4: \"y\" is not a number"),
            ("v 1 2 3 0\n", "a.obj:4: the weight of a vertex must not be 0"),
            ("mtllib\n", "a.obj:4: \"mtllib\" needs the name of a file"),
            ("f 1 2\n", "a.obj:4: a face needs three corners"),
            ("", "a.obj: has no faces"),
        ] {
            let error = notes(text).unwrap_err().to_string();
            assert!(error.starts_with(wanted), "{text}: {error}");
        }
    }
}
