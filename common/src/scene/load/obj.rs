//! OBJ files in memory: objects, and triangles with what they have.

use std::borrow::Cow;

use super::mesh::{Mesh, MeshTriangle, Part};
use super::obj_reader::{Corner, ObjSink, read_obj};
use super::polygon;
use crate::scene::NO_INDEX;
use crate::scene::error::{Place, SceneError};
use crate::scene::files::{FILE_BYTES_MAX, LargeFile, ReadError};

/// Reads an OBJ file.
pub(super) fn read(file: &LargeFile) -> Result<Mesh, SceneError> {
    let (name, bytes) = (file.name(), file.byte_count());
    if bytes > FILE_BYTES_MAX {
        return Err(ReadError::TooLarge { name: name.to_owned(), bytes }.into());
    }
    let opened = file.open()?;
    let mut faces = MeshFaces::default();
    let outline = read_obj(name, &opened, &mut faces)?;
    opened.check_unchanged()?;
    let mut mesh = faces.cut(name)?;
    (mesh.materials, mesh.thin_faces) = (outline.materials, outline.thin_faces);
    Ok(mesh)
}

/// The text without a byte order mark. Names in other encodings than UTF-8 turn into replacement
/// characters, in OBJ and MTL alike, so that they still match.
pub(super) fn text_of(bytes: &[u8]) -> Cow<'_, str> {
    String::from_utf8_lossy(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes))
}

/// A mesh whose faces are still to be cut: the vertices may come after them.
#[derive(Default)]
struct MeshFaces {
    mesh: Mesh,
    corners: Vec<Corner>,
    runs: Vec<Run>,
    /// The number of the object that came last.
    object: u64,
}

/// Successive faces that have the same in common.
struct Run {
    /// Into [`Mesh::objects`].
    object: u32,
    material: u32,
    /// How many corners each has.
    arities: Vec<u32>,
}

impl ObjSink for MeshFaces {
    fn position(&mut self, position: [f32; 3]) -> Result<(), SceneError> {
        self.mesh.positions.push(position);
        Ok(())
    }

    fn texcoord(&mut self, texcoord: [f32; 2]) -> Result<(), SceneError> {
        self.mesh.texcoords.push(texcoord);
        Ok(())
    }

    fn normal(&mut self, normal: [f32; 3]) -> Result<(), SceneError> {
        self.mesh.normals.push(normal);
        Ok(())
    }

    fn part(&mut self, part: &Part) -> Result<(), SceneError> {
        if self.object != part.object {
            self.object = part.object;
            self.mesh.objects.push(part.name.clone());
        }
        let object = u32::try_from(self.mesh.objects.len() - 1).unwrap_or(NO_INDEX);
        self.runs.push(Run { object, material: part.material, arities: Vec::new() });
        Ok(())
    }

    fn face(&mut self, corners: &[Corner]) -> Result<(), SceneError> {
        self.corners.extend_from_slice(corners);
        if let Some(run) = self.runs.last_mut() {
            run.arities.push(u32::try_from(corners.len()).unwrap_or(u32::MAX));
        }
        Ok(())
    }
}

impl MeshFaces {
    /// Cuts all faces of the file called `file` into triangles.
    fn cut(self, file: &str) -> Result<Mesh, SceneError> {
        let Self { mut mesh, corners, runs, .. } = self;
        let (mut rest, mut cut) = (&corners[..], Vec::new());
        for run in &runs {
            for &arity in &run.arities {
                let (face, others) = rest.split_at(arity as usize);
                rest = others;
                cut.clear();
                let corner =
                    |number: usize| mesh.positions[face[number][0] as usize].map(f64::from);
                if !polygon::triangulate(face.len(), corner, &mut cut) {
                    return Err(too_concave(file, face.len()));
                }
                mesh.triangles.extend(cut.iter().map(|numbers| triangle(run, face, *numbers)));
            }
        }
        Ok(mesh)
    }
}

/// Says that a face has more corners than can be cut.
pub(super) fn too_concave(file: &str, corner_count: usize) -> SceneError {
    SceneError::Malformed { place: Place::file(file), problem: polygon::too_concave(corner_count) }
}

fn triangle(run: &Run, face: &[Corner], numbers: [usize; 3]) -> MeshTriangle {
    let pick = |kind: usize| numbers.map(|number| face[number][kind]);
    MeshTriangle {
        positions: pick(0),
        texcoords: pick(1),
        normals: pick(2),
        object: run.object,
        material: run.material,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read_bytes(bytes: &[u8]) -> Result<Mesh, SceneError> {
        read(&LargeFile::in_memory("a.obj", bytes.into()))
    }

    fn mesh(text: &str) -> Mesh {
        read_bytes(text.as_bytes()).unwrap()
    }

    #[test]
    fn faces_have_their_own_attributes_or_none() {
        let model = mesh(
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
        let model = mesh("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\nf -4 -3 -2\n");
        let corners: Vec<_> = model.triangles.iter().map(|t| t.positions).collect();
        assert_eq!(corners, [[0, 1, 2], [0, 2, 3], [0, 1, 2]]);
    }

    proptest! {
        #[test]
        fn arbitrary_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            let _ = read_bytes(&bytes);
        }

        #[test]
        fn arbitrary_statements_never_panic(
            text in "((v|vt|vn|f|l|o|g|usemtl|mtllib)(( [0-9/.-]{1,4}){1,5}|\\PC{0,3})\r?\n){0,30}"
        ) {
            let _ = read_bytes(text.as_bytes());
        }

        #[test]
        fn faces_of_any_indices_never_panic(
            indices in prop::collection::vec(any::<i64>(), 3..9), mask in 0usize..4
        ) {
            let forms = ["{}", "{}/{}", "1/{}/{}", "-1//{}"];
            let join = |i: &i64| forms[mask].replace("{}", &i.to_string());
            let face: Vec<String> = indices.iter().map(join).collect();
            let text = format!("v 0 0 0\nvt 1 1\nvn 0 0 1\nf {}\n", face.join(" "));
            let _ = read_bytes(text.as_bytes());
        }
    }
}
