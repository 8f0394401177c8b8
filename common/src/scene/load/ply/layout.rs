//! Which of a PLY file's elements and properties are used, and for what.

use super::header::{Element, Encoding, Header, Kind, Property};
use super::row::RowFormat;
use crate::scene::NO_INDEX;
use crate::scene::error::{Place, SceneError};

/// Names of texture coordinates: of Blender's and MeshLab's files and of others.
const TEXCOORDS: [[&str; 2]; 3] = [["s", "t"], ["u", "v"], ["texture_u", "texture_v"]];

/// Names of the list of a face's corners.
const CORNERS: [&str; 2] = ["vertex_indices", "vertex_index"];

/// Most numbers that are used of a vertex: position, normal, texture coordinates.
pub(super) const ROW_NUMBERS_MAX: usize = 8;

/// Where to find what is used. A vertex is read as a row of numbers, its position first.
#[derive(Debug)]
pub(super) struct Layout {
    /// Positions of the elements in the header.
    pub(super) vertex_element: usize,
    pub(super) face_element: usize,
    pub(super) vertex_count: u64,
    /// The line of the header that announces the faces.
    pub(super) face_line: usize,
    /// How many numbers of a vertex are used.
    pub(super) row_numbers: usize,
    /// Where in the row normals and texture coordinates begin, if there are any.
    pub(super) normals_at: Option<usize>,
    pub(super) texcoords_at: Option<usize>,
    /// For each property of a vertex, where in the row it goes.
    pub(super) vertex_properties: Vec<Option<usize>>,
    /// Which property of a face is the list of its corners.
    pub(super) corners_property: usize,
    /// How long each of its items is in a binary file.
    pub(super) corner_bytes: u64,
    /// How vertices of fixed length are read.
    pub(super) fixed_row: Option<RowFormat>,
}

impl Layout {
    /// Looks for vertices and faces in the header of the file called `file`.
    pub(super) fn new(file: &str, header: &Header) -> Result<Self, SceneError> {
        let find = |name: &str, remedy: &str| {
            let found = header.elements.iter().position(|element| element.name == name);
            found.ok_or_else(|| SceneError::Malformed {
                place: Place::file(file),
                problem: format!("has no element \"{name}\"; {remedy}"),
            })
        };
        let vertex_element = find("vertex", "a model needs vertices and faces")?;
        let face_element = find("face", "points alone are no surface: make a mesh of them")?;
        let (vertex, face) = (&header.elements[vertex_element], &header.elements[face_element]);
        check_vertex_count(file, vertex)?;
        let mut rows = RowPlan { file, vertex, properties: vec![None; vertex.properties.len()] };
        rows.take_positions()?;
        let normals_at = rows.take(&["nx", "ny", "nz"], 3).then_some(3);
        let next = normals_at.map_or(3, |at| at + 3);
        let texcoords_at = TEXCOORDS.iter().any(|names| rows.take(names, next)).then_some(next);
        let row_numbers = texcoords_at.map_or(next, |at| at + 2);
        let vertex_properties = rows.properties;
        let (corners_property, corner_bytes) = corners(file, face)?;
        Ok(Self {
            vertex_element,
            face_element,
            vertex_count: vertex.count,
            face_line: face.line,
            row_numbers,
            normals_at,
            texcoords_at,
            fixed_row: row_format(header.encoding, vertex, &vertex_properties),
            vertex_properties,
            corners_property,
            corner_bytes,
        })
    }
}

fn check_vertex_count(file: &str, vertex: &Element) -> Result<(), SceneError> {
    if vertex.count < u64::from(NO_INDEX) {
        return Ok(());
    }
    Err(SceneError::TooLarge {
        place: Place::line(file, vertex.line),
        problem: format!("more than {} vertices; cut the model into files", NO_INDEX - 1),
    })
}

/// Finds out which property of a vertex goes where.
struct RowPlan<'a> {
    file: &'a str,
    vertex: &'a Element,
    properties: Vec<Option<usize>>,
}

impl RowPlan<'_> {
    fn take_positions(&mut self) -> Result<(), SceneError> {
        if self.take(&["x", "y", "z"], 0) {
            return Ok(());
        }
        Err(SceneError::Malformed {
            place: Place::line(self.file, self.vertex.line),
            problem: "a vertex needs the properties x, y and z, a number each".into(),
        })
    }

    /// Puts these properties into the row from `at` on, if all are there.
    fn take(&mut self, names: &[&str], at: usize) -> bool {
        let find = |name: &&str| {
            let is_it = |property: &Property| {
                property.name == *name && matches!(property.kind, Kind::Single(_))
            };
            self.vertex.properties.iter().position(is_it)
        };
        let Some(found) = names.iter().map(find).collect::<Option<Vec<usize>>>() else {
            return false;
        };
        for (number, property) in found.into_iter().enumerate() {
            self.properties[property] = Some(at + number);
        }
        true
    }
}

/// Which property of a face is the list of its corners, and how long each is in a binary file.
fn corners(file: &str, face: &Element) -> Result<(usize, u64), SceneError> {
    let named = |name: &&str| face.properties.iter().position(|property| property.name == *name);
    let Some(found) = CORNERS.iter().find_map(named) else {
        return Err(SceneError::Malformed {
            place: Place::line(file, face.line),
            problem: "a face needs the property list \"vertex_indices\" (or \"vertex_index\")"
                .into(),
        });
    };
    match face.properties[found].kind {
        Kind::List { item, .. } if item.is_whole() => Ok((found, item.byte_count() as u64)),
        _ => Err(SceneError::Malformed {
            place: Place::line(file, face.properties[found].line),
            problem: "the corners of a face must be a list of a whole type, as in \"property \
                      list uchar int vertex_indices\""
                .into(),
        }),
    }
}

/// How vertices are read if all have the same length.
fn row_format(encoding: Encoding, vertex: &Element, places: &[Option<usize>]) -> Option<RowFormat> {
    let Encoding::Binary(order) = encoding else { return None };
    let mut format = RowFormat::new(order);
    for (property, place) in vertex.properties.iter().zip(places) {
        let Kind::Single(scalar) = property.kind else { return None };
        format.push(scalar, *place);
    }
    Some(format)
}
