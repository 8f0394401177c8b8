//! The first pass over an OBJ file: who is who, and whether every line makes sense.
//!
//! The crate `tobj` parses geometry well, but it tells no line when something is wrong, invents
//! normals and texture coordinates for faces that have none, takes polylines for faces and stumbles
//! over comments, continued lines and vertex colours. So the file is surveyed first. The survey
//! checks every statement, notes objects, materials and what each face has, and writes the geometry
//! down again in the plain form that `tobj` reads right.

use std::borrow::Cow;
use std::fmt::Write;

use crate::scene::error::{Place, SceneError};

/// Name of what comes before any `o` or `g`.
const DEFAULT_OBJECT: &str = "default";

/// Most corners of a face; a polygon with more was meant to be a mesh.
const CORNERS_MAX: usize = 65_536;

/// Which kind of vertex data an index points into.
const KINDS: [&str; 3] = ["v", "vt", "vn"];

/// What an OBJ file says, apart from coordinates.
#[derive(Debug, Default)]
pub(super) struct ObjSurvey {
    /// `v`, `vt`, `vn` and `f` statements, in order, for `tobj`.
    pub(super) text: String,
    /// What the faces have, in order.
    pub(super) runs: Vec<FaceRun>,
    /// Objects by [`FaceRun::object`]; not all have faces.
    pub(super) objects: Vec<String>,
    /// Materials by [`FaceRun::material`], each with the first line that names it.
    pub(super) materials: Vec<(String, Option<usize>)>,
    /// Material libraries with the lines that name them.
    pub(super) libraries: Vec<(String, usize)>,
    /// Faces with fewer than three corners.
    pub(super) thin_faces: usize,
}

/// Successive faces that have the same in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FaceRun {
    pub(super) face_count: usize,
    pub(super) object: usize,
    /// None before the first `usemtl`.
    pub(super) material: Option<usize>,
    pub(super) has_texcoords: bool,
    pub(super) has_normals: bool,
}

impl ObjSurvey {
    /// Goes over the text of the file called `file`.
    pub(super) fn new(file: &str, text: &str) -> Result<Self, SceneError> {
        let mut surveyor = Surveyor::new(file, text.len());
        let mut lines = text.lines().enumerate();
        while let Some((index, line)) = lines.next() {
            surveyor.line = index + 1;
            let mut line = Cow::Borrowed(line);
            while line.ends_with('\\') {
                let Some((_, next)) = lines.next() else { break };
                let joined = format!("{} {next}", &line[..line.len() - 1]);
                line = Cow::Owned(joined);
            }
            surveyor.statement(line.trim())?;
        }
        surveyor.finish()
    }
}

/// Where the survey stands.
struct Surveyor<'a> {
    file: &'a str,
    line: usize,
    survey: ObjSurvey,
    /// How many `v`, `vt`, `vn` there are so far.
    counts: [usize; 3],
    /// The largest index into each, and the line that has it.
    largest: [(usize, usize); 3],
    object: Option<usize>,
    material: Option<usize>,
    /// Positions of materials by name.
    known_materials: std::collections::BTreeMap<String, usize>,
    corners: Vec<[Option<usize>; 3]>,
    /// The first line whose face has fewer than three corners.
    first_thin_line: Option<usize>,
}

impl<'a> Surveyor<'a> {
    fn new(file: &'a str, bytes: usize) -> Self {
        let survey = ObjSurvey { text: String::with_capacity(bytes), ..ObjSurvey::default() };
        Self {
            file,
            line: 0,
            survey,
            counts: [0; 3],
            largest: [(0, 0); 3],
            object: None,
            material: None,
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
            "v" => self.vertex(0, rest),
            "vt" => self.vertex(1, rest),
            "vn" => self.vertex(2, rest),
            "f" => self.face(rest),
            "o" | "g" => {
                self.begin_object(rest.trim());
                Ok(())
            }
            "usemtl" => {
                self.use_material(rest.trim());
                Ok(())
            }
            "mtllib" if rest.trim().is_empty() => {
                Err(self.malformed("\"mtllib\" needs the name of a file".into()))
            }
            "mtllib" => {
                self.survey.libraries.push((rest.trim().to_owned(), self.line));
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Copies the numbers that count: of positions three and a weight (colours are left out), of
    /// texture coordinates two, of normals three.
    fn vertex(&mut self, kind: usize, rest: &str) -> Result<(), SceneError> {
        let key = KINDS[kind];
        let words = without_comment(rest);
        let word_count = words.split_whitespace().count();
        let (least, kept) = match (kind, word_count) {
            (0, 4) => (3, 4),
            (1, _) => (1, 2),
            _ => (3, 3),
        };
        if word_count < least {
            let problem = format!("\"{key}\" needs {least} numbers and has {word_count}");
            return Err(self.malformed(problem));
        }
        self.survey.text.push_str(key);
        for word in words.split_whitespace().take(kept) {
            match word.parse::<f32>() {
                Ok(0.0) if kept == 4 && word_count == 4 => self.check_weight(words)?,
                Ok(_) => {}
                Err(_) => return Err(self.malformed(format!("\"{word}\" is not a number"))),
            }
            self.survey.text.push(' ');
            self.survey.text.push_str(word);
        }
        if kind == 1 && word_count == 1 {
            self.survey.text.push_str(" 0");
        }
        self.survey.text.push('\n');
        self.counts[kind] += 1;
        Ok(())
    }

    fn check_weight(&self, words: &str) -> Result<(), SceneError> {
        let weight = words.split_whitespace().nth(3).and_then(|word| word.parse::<f32>().ok());
        if weight == Some(0.0) {
            return Err(self.malformed("the weight of a vertex must not be 0".into()));
        }
        Ok(())
    }

    fn face(&mut self, rest: &str) -> Result<(), SceneError> {
        self.corners.clear();
        for word in without_comment(rest).split_whitespace() {
            let corner = self.corner(word)?;
            self.corners.push(corner);
        }
        if self.corners.len() < 3 {
            self.survey.thin_faces += 1;
            self.first_thin_line.get_or_insert(self.line);
            return Ok(());
        }
        if self.corners.len() > CORNERS_MAX {
            let problem = format!(
                "a face of {} corners; cut it into faces of at most {CORNERS_MAX}",
                self.corners.len()
            );
            return Err(self.malformed(problem));
        }
        let has_all = |kind: usize| self.corners.iter().all(|corner| corner[kind].is_some());
        let (has_texcoords, has_normals) = (has_all(1), has_all(2));
        self.write_face(has_texcoords, has_normals);
        self.count_face(has_texcoords, has_normals);
        Ok(())
    }

    /// Reads `v`, `v/vt`, `v//vn` or `v/vt/vn` into positions counted from 1.
    fn corner(&mut self, word: &str) -> Result<[Option<usize>; 3], SceneError> {
        let mut corner = [None; 3];
        for (kind, part) in word.split('/').enumerate() {
            if kind >= KINDS.len() {
                return Err(self.malformed(format!("\"{word}\" has more than three indices")));
            }
            if !part.is_empty() {
                corner[kind] = Some(self.index(kind, part, word)?);
            }
        }
        if corner[0].is_none() {
            return Err(self.malformed(format!("\"{word}\" lacks the index of a vertex")));
        }
        Ok(corner)
    }

    fn index(&mut self, kind: usize, part: &str, word: &str) -> Result<usize, SceneError> {
        let (key, count) = (KINDS[kind], self.counts[kind]);
        let Ok(number) = part.parse::<i64>() else {
            return Err(self.malformed(format!("\"{word}\" is not a corner of a face")));
        };
        let distance = usize::try_from(number.unsigned_abs()).unwrap_or(usize::MAX);
        if number > 0 {
            if distance > self.largest[kind].0 {
                self.largest[kind] = (distance, self.line);
            }
            return Ok(distance);
        }
        if number == 0 || distance > count {
            return Err(self.malformed(format!(
                "face index {number} is out of range: {count} \"{key}\" stand above it, \
                 counted from 1, or backwards from -1"
            )));
        }
        Ok(count + 1 - distance)
    }

    fn write_face(&mut self, has_texcoords: bool, has_normals: bool) {
        const IN_MEMORY: &str = "writing to a string does not fail";
        let text = &mut self.survey.text;
        text.push('f');
        for [position, texcoord, normal] in &self.corners {
            write!(text, " {}", position.unwrap_or(0)).expect(IN_MEMORY);
            if has_texcoords || has_normals {
                text.push('/');
            }
            if has_texcoords {
                write!(text, "{}", texcoord.unwrap_or(0)).expect(IN_MEMORY);
            }
            if has_normals {
                write!(text, "/{}", normal.unwrap_or(0)).expect(IN_MEMORY);
            }
        }
        text.push('\n');
    }

    fn count_face(&mut self, has_texcoords: bool, has_normals: bool) {
        if self.object.is_none() {
            self.begin_object(DEFAULT_OBJECT);
        }
        let object = self.object.unwrap_or(0);
        let material = self.material;
        let run = FaceRun { face_count: 1, object, material, has_texcoords, has_normals };
        match self.survey.runs.last_mut() {
            Some(last) if (FaceRun { face_count: 1, ..*last }) == run => last.face_count += 1,
            _ => self.survey.runs.push(run),
        }
    }

    fn begin_object(&mut self, name: &str) {
        let name = if name.is_empty() { DEFAULT_OBJECT } else { name };
        if self.survey.objects.last().is_none_or(|current| current != name) {
            self.survey.objects.push(name.to_owned());
        }
        self.object = Some(self.survey.objects.len() - 1);
    }

    fn use_material(&mut self, name: &str) {
        if name.is_empty() {
            self.material = None;
            return;
        }
        let survey = &mut self.survey;
        let known = self.known_materials.get(name).copied();
        self.material = known.or_else(|| {
            survey.materials.push((name.to_owned(), Some(self.line)));
            self.known_materials.insert(name.to_owned(), survey.materials.len() - 1);
            Some(survey.materials.len() - 1)
        });
    }

    fn finish(mut self) -> Result<ObjSurvey, SceneError> {
        for (kind, key) in KINDS.into_iter().enumerate() {
            let ((largest, line), count) = (self.largest[kind], self.counts[kind]);
            if largest > count {
                self.line = line;
                return Err(self.malformed(format!(
                    "face index {largest} is out of range: the file has {count} \"{key}\""
                )));
            }
        }
        if self.survey.runs.is_empty() {
            let problem = "has no faces, so there is nothing to render".into();
            return Err(match self.first_thin_line {
                None => SceneError::Empty { place: Place::file(self.file), problem },
                Some(line) => SceneError::Empty {
                    place: Place::line(self.file, line),
                    problem: "a face needs three corners or more, and no other is there".into(),
                },
            });
        }
        Ok(self.survey)
    }
}

fn without_comment(text: &str) -> &str {
    text.split('#').next().unwrap_or("")
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

    fn survey(rest: &str) -> Result<ObjSurvey, SceneError> {
        ObjSurvey::new("a.obj", &format!("{TRIANGLE}{rest}"))
    }

    #[test]
    fn objects_materials_and_attributes_are_told_apart() {
        let text = "vn 0 0 1\r\nf 1 2 3\r\ng a b\r\nusemtl red wood\r\nf 1//1 2//1 -1//1 # c\r\n\
                    f 1//1 2//1 3\r\ng a b\r\nf 1 2 \\\r\n 3\r\no c\r\nf 1 2 3\r\n";
        let survey = survey(text).unwrap();
        assert_eq!(survey.objects, ["default", "a b", "c"]);
        assert_eq!(survey.materials, [("red wood".to_owned(), Some(7))]);
        let runs: Vec<_> = survey
            .runs
            .iter()
            .map(|run| (run.face_count, run.object, run.material, run.has_normals))
            .collect();
        let expected = [
            (1, 0, None, false),
            (1, 1, Some(0), true),
            (2, 1, Some(0), false),
            (1, 2, Some(0), false),
        ];
        assert_eq!(runs, expected);
    }

    #[test]
    fn what_tobj_misreads_does_not_reach_it() {
        let text = "v 1 2 3 .5 .5 .5\nvt 0.5\nl 1 2 3\np 1\nvp 1\nf 1/1 2/1 4/1\n";
        let survey = survey(text).unwrap();
        assert_eq!(survey.text, format!("{TRIANGLE}v 1 2 3\nvt 0.5 0\nf 1/1 2/1 4/1\n"));
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
            let error = survey(text).unwrap_err().to_string();
            assert!(error.starts_with(wanted), "{text}: {error}");
        }
    }
}
