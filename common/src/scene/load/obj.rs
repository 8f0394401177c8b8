//! OBJ files: objects, and triangles with what they have.

use std::borrow::Cow;

use super::obj_survey::{FaceRun, ObjSurvey};
use super::polygon;
use crate::scene::NO_INDEX;
use crate::scene::error::{Place, SceneError};

/// A model as its file has it, cut into triangles.
#[derive(Debug)]
pub(super) struct ObjModel {
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) normals: Vec<[f32; 3]>,
    pub(super) texcoords: Vec<[f32; 2]>,
    pub(super) triangles: Vec<ObjTriangle>,
    /// Objects by [`ObjTriangle::object`].
    pub(super) objects: Vec<String>,
    /// Materials by [`ObjTriangle::material`], each with the first line that names it.
    pub(super) materials: Vec<(String, Option<usize>)>,
    /// Material libraries with the lines that name them.
    pub(super) libraries: Vec<(String, usize)>,
    /// Faces with fewer than three corners, which are no surface.
    pub(super) thin_faces: usize,
}

/// A triangle; indices are into the tables of the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ObjTriangle {
    pub(super) positions: [u32; 3],
    /// [`NO_INDEX`] thrice where there are none.
    pub(super) normals: [u32; 3],
    /// [`NO_INDEX`] thrice where there are none.
    pub(super) texcoords: [u32; 3],
    pub(super) object: u32,
    /// Into [`ObjModel::materials`]; [`NO_INDEX`] where no material is named.
    pub(super) material: u32,
}

impl ObjModel {
    /// Reads the bytes of the file called `file`.
    pub(super) fn read(file: &str, bytes: &[u8]) -> Result<Self, SceneError> {
        let text = text_of(bytes);
        let survey = ObjSurvey::new(file, &text)?;
        let mesh = parse(file, &survey.text)?;
        let triangles = triangles_of(file, &survey.runs, &mesh)?;
        Ok(Self {
            positions: mesh.positions.as_chunks().0.to_vec(),
            normals: mesh.normals.as_chunks().0.to_vec(),
            texcoords: mesh.texcoords.as_chunks().0.to_vec(),
            triangles,
            objects: survey.objects,
            materials: survey.materials,
            libraries: survey.libraries,
            thin_faces: survey.thin_faces,
        })
    }
}

/// The text without a byte order mark. Names in other encodings than UTF-8 turn into replacement
/// characters, in OBJ and MTL alike, so that they still match.
pub(super) fn text_of(bytes: &[u8]) -> Cow<'_, str> {
    String::from_utf8_lossy(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes))
}

fn parse(file: &str, text: &str) -> Result<tobj::Mesh, SceneError> {
    let options = tobj::LoadOptions::default();
    let no_library = |_: &std::path::Path| Ok(Default::default());
    let malformed = |problem: String| SceneError::Malformed { place: Place::file(file), problem };
    let (mut models, _) = tobj::load_obj_buf(&mut text.as_bytes(), &options, no_library)
        .map_err(|error| malformed(format!("cannot be parsed: {error}")))?;
    match models.pop() {
        Some(model) if models.is_empty() => Ok(model.mesh),
        _ => Err(malformed("cannot be parsed as one mesh".into())),
    }
}

/// Cuts faces into triangles and gives each what the survey found out about it.
fn triangles_of(
    file: &str,
    runs: &[FaceRun],
    mesh: &tobj::Mesh,
) -> Result<Vec<ObjTriangle>, SceneError> {
    let mut faces = Faces { mesh, face: 0, corner: 0 };
    let mut triangles = Vec::with_capacity(mesh.indices.len() / 3);
    let mut cut = Vec::new();
    for run in runs {
        for _ in 0..run.face_count {
            let (first, arity) = faces.next_face();
            cut.clear();
            let corner = |number: usize| position(mesh, first + number);
            if !polygon::triangulate(arity, corner, &mut cut) {
                return Err(SceneError::Malformed {
                    place: Place::file(file),
                    problem: format!(
                        "a concave face of {arity} corners; cut faces of more than {} corners \
                         into triangles in the program that made them",
                        polygon::CONCAVE_CORNERS_MAX
                    ),
                });
            }
            triangles.extend(cut.iter().map(|numbers| triangle(run, mesh, first, *numbers)));
        }
    }
    Ok(triangles)
}

/// Walks over the faces of a mesh.
struct Faces<'a> {
    mesh: &'a tobj::Mesh,
    face: usize,
    corner: usize,
}

impl Faces<'_> {
    /// Where the next face's corners begin, and how many there are.
    fn next_face(&mut self) -> (usize, usize) {
        let arity = self.mesh.face_arities.get(self.face).map_or(3, |&arity| arity as usize);
        let first = self.corner;
        self.face += 1;
        self.corner += arity;
        assert!(self.corner <= self.mesh.indices.len(), "the survey counts the faces of the mesh");
        (first, arity)
    }
}

fn position(mesh: &tobj::Mesh, corner: usize) -> [f64; 3] {
    let at = mesh.indices[corner] as usize * 3;
    [mesh.positions[at], mesh.positions[at + 1], mesh.positions[at + 2]].map(f64::from)
}

fn triangle(run: &FaceRun, mesh: &tobj::Mesh, first: usize, corners: [usize; 3]) -> ObjTriangle {
    let pick = |has: bool, indices: &[u32]| {
        if has { corners.map(|corner| indices[first + corner]) } else { [NO_INDEX; 3] }
    };
    let narrow = |index: usize| u32::try_from(index).unwrap_or(NO_INDEX);
    ObjTriangle {
        positions: pick(true, &mesh.indices),
        normals: pick(run.has_normals, &mesh.normal_indices),
        texcoords: pick(run.has_texcoords, &mesh.texcoord_indices),
        object: narrow(run.object),
        material: run.material.map_or(NO_INDEX, narrow),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read(text: &str) -> ObjModel {
        ObjModel::read("a.obj", text.as_bytes()).unwrap()
    }

    #[test]
    fn faces_have_their_own_attributes_or_none() {
        let model = read(
            "\u{feff}v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvn 0 0 1\n\
             f 1 2 3\nf 1/1 2/2 3/1\nf 1//1 2//1 3//1\nf 1/2/1 2/2/1 3/2/1\n",
        );
        let has: Vec<_> = model
            .triangles
            .iter()
            .map(|t| (t.texcoords[0] != NO_INDEX, t.normals[0] != NO_INDEX))
            .collect();
        assert_eq!(has, [(false, false), (true, false), (false, true), (true, true)]);
        let corner = model.triangles[3].texcoords[0];
        assert_eq!(model.texcoords[corner as usize], [1.0, 0.0]);
        assert_eq!(model.normals[model.triangles[2].normals[0] as usize], [0.0, 0.0, 1.0]);
    }

    #[test]
    fn quads_are_cut_from_their_first_corner() {
        let model = read("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\nf -4 -3 -2\n");
        let corners: Vec<_> = model.triangles.iter().map(|t| t.positions).collect();
        assert_eq!(corners, [[0, 1, 2], [0, 2, 3], [0, 1, 2]]);
    }

    proptest! {
        #[test]
        fn arbitrary_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            let _ = ObjModel::read("a.obj", &bytes);
        }

        #[test]
        fn arbitrary_statements_never_panic(
            text in "((v|vt|vn|f|l|o|g|usemtl|mtllib)(( [0-9/.-]{1,4}){1,5}|\\PC{0,3})\r?\n){0,30}"
        ) {
            let _ = ObjModel::read("a.obj", text.as_bytes());
        }

        #[test]
        fn faces_of_any_indices_never_panic(
            indices in prop::collection::vec(any::<i64>(), 3..9), mask in 0usize..4
        ) {
            let forms = ["{}", "{}/{}", "1/{}/{}", "-1//{}"];
            let join = |i: &i64| forms[mask].replace("{}", &i.to_string());
            let face: Vec<String> = indices.iter().map(join).collect();
            let text = format!("v 0 0 0\nvt 1 1\nvn 0 0 1\nf {}\n", face.join(" "));
            let _ = ObjModel::read("a.obj", text.as_bytes());
        }
    }
}
