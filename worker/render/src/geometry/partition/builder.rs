//! Triangles on their way into a partition.

use equilux_common::scene::{Geometry, NO_INDEX, WorldTriangle};
use glam::Vec3;
use obvhs::BvhBuildParams;

use super::{Attributes, Partition};
use crate::geometry::Bounds;
use crate::geometry::tree::{CAREFUL, LeafTriangle, SWIFT, Tree};

/// Gathers triangles for a partition.
#[derive(Debug, Default)]
pub struct PartitionBuilder {
    triangles: Vec<LeafTriangle>,
    /// In the order of the triangles.
    attributes: Lists,
    recent_normals: Recent<3>,
    recent_texcoords: Recent<2>,
}

/// What [`Attributes`] will have.
#[derive(Debug, Default)]
struct Lists {
    materials: Vec<u32>,
    normals: Vec<[u32; 3]>,
    texcoords: Vec<[u32; 3]>,
    normal_table: Vec<[f32; 3]>,
    texcoord_table: Vec<[f32; 2]>,
}

impl PartitionBuilder {
    /// Nothing has been added; so many triangles will be.
    #[must_use]
    pub fn with_capacity(triangle_count: usize) -> Self {
        let mut builder = Self::default();
        builder.triangles.reserve_exact(triangle_count);
        builder.attributes.materials.reserve_exact(triangle_count);
        builder
    }

    /// Adds a triangle: its primitive id in the whole model, and what it is.
    pub fn push(&mut self, primitive: u32, triangle: &WorldTriangle) {
        let corners = triangle.corners.map(Vec3::from);
        self.triangles.push(LeafTriangle { corners, primitive });
        let before = self.attributes.materials.len();
        self.attributes.materials.push(triangle.material);
        let (recent, table) = (&mut self.recent_normals, &mut self.attributes.normal_table);
        let normals = triangle.normals.map(|normals| normals.map(|n| recent.index_of(n, table)));
        extend(&mut self.attributes.normals, before, normals);
        let (recent, table) = (&mut self.recent_texcoords, &mut self.attributes.texcoord_table);
        let texcoords = triangle.texcoords.map(|all| all.map(|t| recent.index_of(t, table)));
        extend(&mut self.attributes.texcoords, before, texcoords);
    }

    /// All of a model.
    pub(crate) fn of_model(geometry: Geometry) -> Self {
        let Geometry { positions, normals, texcoords, triangles, .. } = geometry;
        let place = |index: u32| Vec3::from(positions[index as usize]);
        let leaf = |(primitive, triangle): (u32, &equilux_common::scene::Triangle)| LeafTriangle {
            corners: triangle.positions.map(place),
            primitive,
        };
        let has = |any: bool, of: Vec<[u32; 3]>| if any { of } else { Vec::new() };
        let attributes = Lists {
            materials: triangles.iter().map(|triangle| triangle.material).collect(),
            normals: has(!normals.is_empty(), triangles.iter().map(|t| t.normals).collect()),
            texcoords: has(!texcoords.is_empty(), triangles.iter().map(|t| t.texcoords).collect()),
            normal_table: normals,
            texcoord_table: texcoords,
        };
        let triangles = (0u32..).zip(&triangles).map(leaf).collect();
        Self { triangles, attributes, ..Self::default() }
    }

    /// How many triangles have been added.
    #[must_use]
    pub const fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    /// Builds the tree over what has been added, which may be nothing. `model_bounds` are those of
    /// the whole model: what is hit then depends on the model alone, not on how it is cut.
    #[must_use]
    pub fn build(self, model_bounds: &Bounds) -> Partition {
        self.build_with(CAREFUL, model_bounds)
    }

    /// Builds it in less time, so that rays take a little more of it.
    #[must_use]
    pub fn build_swiftly(self, model_bounds: &Bounds) -> Partition {
        self.build_with(SWIFT, model_bounds)
    }

    fn build_with(self, quality: BvhBuildParams, model_bounds: &Bounds) -> Partition {
        let (tree, order) = Tree::build(&self.triangles, quality);
        drop(self.triangles);
        let Lists { materials, normals, texcoords, normal_table, texcoord_table } = self.attributes;
        let attributes = Attributes {
            materials: in_order(&materials, &order).into(),
            normals: in_order(&normals, &order).into(),
            texcoords: in_order(&texcoords, &order).into(),
            normal_table: normal_table.into(),
            texcoord_table: texcoord_table.into(),
        };
        Partition { tree, attributes, model_bounds: *model_bounds }
    }
}

impl Partition {
    /// A whole model in one partition.
    #[must_use]
    pub fn new(geometry: Geometry) -> Self {
        let model_bounds = Bounds::of_model(&geometry);
        PartitionBuilder::of_model(geometry).build(&model_bounds)
    }
}

/// Adds a triangle's indices to a list that stays empty as long as no triangle has any.
fn extend(list: &mut Vec<[u32; 3]>, before: usize, indices: Option<[u32; 3]>) {
    if indices.is_some() && list.is_empty() {
        list.resize(before, [NO_INDEX; 3]);
    }
    if indices.is_some() || !list.is_empty() {
        list.push(indices.unwrap_or([NO_INDEX; 3]));
    }
}

fn in_order<T: Copy>(list: &[T], order: &[u32]) -> Vec<T> {
    if list.is_empty() {
        return Vec::new();
    }
    order.iter().map(|&index| list[index as usize]).collect()
}

/// Entries of [`Recent`]: corners of neighboring triangles come close after one another.
const RECENT: usize = 1 << 14;

/// Where values of a table were put lately, so that most are put there once: a place for each hash.
#[derive(Debug)]
struct Recent<const N: usize> {
    /// Indices into the table; empty until the first value comes.
    places: Vec<u32>,
}

impl<const N: usize> Default for Recent<N> {
    fn default() -> Self {
        Self { places: Vec::new() }
    }
}

impl<const N: usize> Recent<N> {
    /// The index of a value in the table; adds it unless it is known.
    fn index_of(&mut self, value: [f32; N], table: &mut Vec<[f32; N]>) -> u32 {
        if self.places.is_empty() {
            self.places.resize(RECENT, NO_INDEX);
        }
        let bits = value.map(f32::to_bits);
        let place = &mut self.places[place_of(&bits)];
        let is_known = |known: &[f32; N]| known.map(f32::to_bits) == bits;
        if !table.get(*place as usize).is_some_and(is_known) {
            *place = u32::try_from(table.len()).expect("three for each of less than 2³⁰ triangles");
            table.push(value);
        }
        *place
    }
}

fn place_of(bits: &[u32]) -> usize {
    let mixed = bits.iter().fold(0u64, |hash, &bits| {
        (hash ^ u64::from(bits)).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(23)
    });
    mixed as usize % RECENT
}
