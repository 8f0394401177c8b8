//! PLY files, the format of scanned and of very large models: binary in both byte orders, and text.
//!
//! A PLY file describes itself: a header of text lists elements, how many there are of each and
//! which properties each has, and the elements follow in that order. Of them all, the vertices and
//! the faces are used, and of these the properties with names that are in common use; whatever else
//! is there is skipped. The format is Greg Turk's of 1994; its texts say nothing of texture
//! coordinates, for which there are three pairs of names.
//!
//! Nothing in a header is believed that the length of the file speaks against, so what is allocated
//! is bounded by what is there.

mod body;
mod faces;
mod header;
mod layout;
mod row;
mod scalar;
mod vertices;

use body::Body;
use faces::Faces;
use header::{Encoding, Header};
use layout::Layout;
pub(super) use row::RowFormat;
use vertices::for_each_vertex;

use super::mesh::{DEFAULT_OBJECT, Face, MaterialNames, Mesh, MeshTriangle, Part, Reply};
use super::polygon;
use crate::scene::NO_INDEX;
use crate::scene::error::{Place, SceneError};
use crate::scene::files::{FILE_BYTES_MAX, LargeFile, OpenFile, ReadError};

/// What faces there were.
struct Shown {
    /// How many had fewer than three corners.
    thin: u64,
    /// Whether any had more.
    has_surface: bool,
}

/// A PLY file whose header has been understood.
#[derive(Debug)]
pub(super) struct PlyFile {
    file: LargeFile,
    header: Header,
    layout: Layout,
}

impl PlyFile {
    /// Reads the header and checks that what it claims can be there.
    pub(super) fn new(file: LargeFile) -> Result<Self, SceneError> {
        let opened = file.open()?;
        let header = Header::read(file.name(), &opened)?;
        let layout = Layout::new(file.name(), &header)?;
        drop(opened);
        Ok(Self { file, header, layout })
    }

    /// Reads all of it into memory.
    pub(super) fn read(&self) -> Result<Mesh, SceneError> {
        let (name, bytes) = (self.file.name(), self.file.byte_count());
        if bytes > FILE_BYTES_MAX {
            return Err(ReadError::TooLarge { name: name.to_owned(), bytes }.into());
        }
        let opened = self.file.open()?;
        let mut body = Body::new(name, &self.header, &opened);
        let mut mesh = Mesh {
            objects: vec![DEFAULT_OBJECT.to_owned()],
            materials: Self::material_names(),
            ..Mesh::default()
        };
        self.read_vertices(&mut body, &mut mesh)?;
        let shown = self.read_faces(&mut body, &mut mesh)?;
        self.finish(body, &opened, &shown)?;
        mesh.thin_faces = shown.thin;
        Ok(mesh)
    }

    /// Shows all faces of three corners or more, without keeping them, and checks the rest of the
    /// file unless told that it is enough. The number of faces that have fewer corners.
    pub(super) fn for_each_face(
        &self,
        visit: &mut dyn FnMut(&Face<'_>) -> Result<Reply, SceneError>,
    ) -> Result<u64, SceneError> {
        let opened = self.file.open()?;
        let mut body = Body::new(self.file.name(), &self.header, &opened);
        let mut is_enough = false;
        let shown = self.show_faces(&mut body, &mut |face| {
            let reply = visit(face)?;
            is_enough = reply == Reply::Enough;
            Ok(reply)
        })?;
        if !is_enough {
            self.finish(body, &opened, &shown)?;
        }
        Ok(shown.thin)
    }

    /// Shows all vertices as rows of numbers: the position first, then what else there is.
    pub(super) fn for_each_vertex(
        &self,
        visit: &mut dyn FnMut(&[f32]) -> Result<(), SceneError>,
    ) -> Result<(), SceneError> {
        let opened = self.file.open()?;
        let mut body = Body::new(self.file.name(), &self.header, &opened);
        for_each_vertex(&mut body, &self.layout, visit)?;
        Ok(opened.check_unchanged()?)
    }

    /// How many vertices there are.
    pub(super) const fn vertex_count(&self) -> u64 {
        self.layout.vertex_count
    }

    /// How many numbers a row of a vertex has.
    pub(super) const fn row_numbers(&self) -> usize {
        self.layout.row_numbers
    }

    /// Where in the row of a vertex normals and texture coordinates begin, if there are any.
    pub(super) const fn attributes(&self) -> (Option<usize>, Option<usize>) {
        (self.layout.normals_at, self.layout.texcoords_at)
    }

    /// Where in the file the vertices begin and how they are read, if all have the same length.
    pub(super) fn vertex_rows(&self) -> Result<Option<(u64, RowFormat)>, SceneError> {
        let Some(format) = &self.layout.fixed_row else { return Ok(None) };
        let opened = self.file.open()?;
        let mut body = Body::new(self.file.name(), &self.header, &opened);
        body.enter(self.layout.vertex_element)?;
        Ok(Some((body.scan.offset(), format.clone())))
    }

    /// How many triangles the faces are cut into, as far as the header tells: exact for a binary
    /// file that has no other lists than those of the faces, none with fewer than three corners.
    pub(super) fn triangle_estimate(&self) -> u64 {
        let Header { elements, encoding, body_offset } = &self.header;
        let face = &elements[self.layout.face_element];
        let fixed: u128 = elements
            .iter()
            .map(|element| u128::from(element.count) * u128::from(element.least_bytes(*encoding)))
            .sum();
        let listed = u128::from(self.file.byte_count() - body_offset).saturating_sub(fixed);
        let corners = u64::try_from(listed).unwrap_or(u64::MAX) / self.layout.corner_bytes;
        match encoding {
            Encoding::Ascii => face.count,
            Encoding::Binary(_) => corners.saturating_sub(2 * face.count),
        }
    }

    /// What a PLY file says about materials: nothing.
    pub(super) fn material_names() -> MaterialNames {
        MaterialNames { is_partial: true, ..MaterialNames::default() }
    }

    fn read_vertices(&self, body: &mut Body<'_>, mesh: &mut Mesh) -> Result<(), SceneError> {
        let layout = &self.layout;
        let count = usize::try_from(layout.vertex_count).unwrap_or(usize::MAX);
        let size = |is_there: bool| if is_there { count } else { 0 };
        mesh.positions.reserve_exact(count);
        mesh.normals.reserve_exact(size(layout.normals_at.is_some()));
        mesh.texcoords.reserve_exact(size(layout.texcoords_at.is_some()));
        for_each_vertex(body, layout, |row| {
            mesh.positions.push([row[0], row[1], row[2]]);
            if let Some(at) = layout.normals_at {
                mesh.normals.push([row[at], row[at + 1], row[at + 2]]);
            }
            if let Some(at) = layout.texcoords_at {
                mesh.texcoords.push([row[at], row[at + 1]]);
            }
            Ok(())
        })
    }

    fn read_faces(&self, body: &mut Body<'_>, mesh: &mut Mesh) -> Result<Shown, SceneError> {
        let Mesh { positions, triangles, .. } = mesh;
        let mut cut = Vec::new();
        self.show_faces(body, &mut |face| {
            cut.clear();
            let corners = face.positions;
            let corner = |number: usize| positions[corners[number] as usize].map(f64::from);
            if !polygon::triangulate(corners.len(), corner, &mut cut) {
                return Ok(Reply::TooConcave);
            }
            let indices = cut.iter().map(|numbers| numbers.map(|number| corners[number]));
            triangles.extend(indices.map(|indices| self.triangle(indices)));
            Ok(Reply::Next)
        })
    }

    /// Shows all faces but those that are too thin. What follows the faces is not looked at.
    fn show_faces(
        &self,
        body: &mut Body<'_>,
        visit: &mut dyn FnMut(&Face<'_>) -> Result<Reply, SceneError>,
    ) -> Result<Shown, SceneError> {
        let layout = &self.layout;
        let part = Part { object: 0, name: DEFAULT_OBJECT.to_owned(), material: NO_INDEX };
        let mut faces = Faces::new(body, layout)?;
        let mut shown = Shown { thin: 0, has_surface: false };
        while let Some(corners) = faces.next()? {
            if corners.len() < 3 {
                shown.thin += 1;
                continue;
            }
            shown.has_surface = true;
            let when = |place: Option<usize>| if place.is_some() { corners } else { &[] };
            let face = Face {
                positions: corners,
                normals: when(layout.normals_at),
                texcoords: when(layout.texcoords_at),
                part: &part,
            };
            let arity = corners.len();
            match visit(&face)? {
                Reply::Next => {}
                Reply::Enough => return Ok(shown),
                Reply::TooConcave => return Err(faces.malformed(&polygon::too_concave(arity))),
            }
        }
        Ok(shown)
    }

    /// Checks the rest of the file, and that there is anything to render. The rest comes first: a
    /// header with wrong counts may be why there seems to be nothing.
    fn finish(
        &self,
        body: Body<'_>,
        opened: &OpenFile<'_>,
        shown: &Shown,
    ) -> Result<(), SceneError> {
        body.finish()?;
        opened.check_unchanged()?;
        if shown.has_surface { Ok(()) } else { Err(self.empty()) }
    }

    fn triangle(&self, positions: [u32; 3]) -> MeshTriangle {
        let when = |is_there: bool| if is_there { positions } else { [NO_INDEX; 3] };
        MeshTriangle {
            positions,
            normals: when(self.layout.normals_at.is_some()),
            texcoords: when(self.layout.texcoords_at.is_some()),
            object: 0,
            material: NO_INDEX,
        }
    }

    fn empty(&self) -> SceneError {
        SceneError::Empty {
            place: Place::line(self.file.name(), self.layout.face_line),
            problem: "has no face of three corners or more, so there is nothing to render".into(),
        }
    }
}

#[cfg(test)]
mod tests;
