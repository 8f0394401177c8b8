//! A model as its file has it, whatever the format, cut into triangles.

/// Name of what no object is named around.
pub(super) const DEFAULT_OBJECT: &str = "default";

/// Most corners of a face; a polygon with more was meant to be a mesh.
pub(super) const CORNERS_MAX: usize = 65_536;

/// A model in the coordinates of its file.
#[derive(Debug, Default)]
pub(super) struct Mesh {
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) normals: Vec<[f32; 3]>,
    pub(super) texcoords: Vec<[f32; 2]>,
    pub(super) triangles: Vec<MeshTriangle>,
    /// Objects by [`MeshTriangle::object`].
    pub(super) objects: Vec<String>,
    /// What it says about materials.
    pub(super) materials: MaterialNames,
    /// Faces with fewer than three corners, which are no surface.
    pub(super) thin_faces: u64,
}

/// A triangle; indices are into the tables of the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct MeshTriangle {
    pub(super) positions: [u32; 3],
    /// [`NO_INDEX`](crate::scene::NO_INDEX) thrice where there are none.
    pub(super) normals: [u32; 3],
    /// [`NO_INDEX`](crate::scene::NO_INDEX) thrice where there are none.
    pub(super) texcoords: [u32; 3],
    pub(super) object: u32,
    /// Into [`MaterialNames::names`]; [`NO_INDEX`](crate::scene::NO_INDEX) where none is named.
    pub(super) material: u32,
}

/// A face of three corners or more, as it comes by.
#[derive(Clone, Copy, Debug)]
pub(super) struct Face<'a> {
    /// Its corners, into the tables of the model.
    pub(super) positions: &'a [u32],
    /// As many, or none.
    pub(super) normals: &'a [u32],
    /// As many, or none.
    pub(super) texcoords: &'a [u32],
    pub(super) part: &'a Part,
}

/// What faces that follow one another have in common.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Part {
    /// The number of the object, which grows from face to face.
    pub(super) object: u64,
    /// Its name.
    pub(super) name: String,
    /// Into [`MaterialNames::names`]; [`NO_INDEX`](crate::scene::NO_INDEX) where none is named.
    pub(super) material: u32,
}

/// What whoever is shown faces says to each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reply {
    /// Go on.
    Next,
    /// That is enough.
    Enough,
    /// It is [too concave](super::polygon::too_concave).
    TooConcave,
}

/// What a model says about materials.
#[derive(Clone, Debug, Default)]
pub(super) struct MaterialNames {
    /// The names that it uses, each with the first line that does.
    pub(super) names: Vec<(String, usize)>,
    /// Material libraries with the lines that name them.
    pub(super) libraries: Vec<(String, usize)>,
    /// Whether some face names no material.
    pub(super) is_partial: bool,
}
