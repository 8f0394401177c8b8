//! A partition as plain bytes, and back.
//!
//! A partition is some tables of numbers, so it is written and read without being taken apart: its
//! sections are the tables' memory, little-endian. What comes in is checked, for a walk through a
//! tree that leads astray might never end.

use bytemuck::Pod;
use bytes::Bytes;
use equilux_common::scene::NO_INDEX;

use super::{Attributes, Partition, PartitionImage, Trees};
use crate::geometry::Bounds;
use crate::geometry::hierarchy::{Hierarchy, InvalidTree, Node};
use crate::geometry::placed::{Place, PlacedObject, PlacedObjects};
use crate::geometry::table::Table;
use crate::geometry::tree::Tree;

/// Sections of a partition: nodes, triangles, materials, normals and texture coordinates of the
/// triangles, and the tables of both; and, if there are objects, how many nodes and triangles each
/// tree has, their places, and the nodes of the tree over these.
pub const SECTION_COUNT: usize = 10;

/// What a partition that is read must know of the model that it belongs to.
#[derive(Clone, Copy, Debug)]
pub struct ModelLimits {
    /// Bounds of the whole model.
    pub bounds: Bounds,
    /// Triangles of the whole model: primitive ids are below it.
    pub triangle_count: u64,
    /// Materials of the model.
    pub material_count: usize,
}

/// Bytes that are no partition.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidPartition {
    /// A section does not hold whole entries.
    #[error("its section {section} has {bytes} bytes, which cannot be")]
    SectionSize {
        /// Which.
        section: usize,
        /// Its size.
        bytes: usize,
    },
    /// Tables with an entry per triangle differ in length.
    #[error("its tables do not have the same number of triangles")]
    Lengths,
    /// A triangle names a normal, texture coordinates or a material that are not there.
    #[error("one of its triangles names what is not in its tables")]
    Index,
    /// A triangle has the id of none.
    #[error("one of its triangles has an id that is not of the model")]
    Primitive,
    /// A place of an object is none.
    #[error("place {0} of its objects cannot be")]
    Place(usize),
    /// The tree is none.
    #[error(transparent)]
    Tree(#[from] InvalidTree),
}

impl Partition {
    /// It as it lies in a file.
    #[must_use]
    pub fn image(&self) -> PartitionImage<'_> {
        let Attributes { materials, normals, texcoords, normal_table, texcoord_table } =
            &self.attributes;
        let (places, place_nodes) = self.placed.as_ref().map_or_else(Default::default, |placed| {
            (placed.places.as_bytes(), &**placed.hierarchy.nodes())
        });
        PartitionImage {
            sections: [
                self.trees.nodes.as_bytes(),
                self.trees.triangles.as_bytes(),
                materials.as_bytes(),
                normals.as_bytes(),
                texcoords.as_bytes(),
                normal_table.as_bytes(),
                texcoord_table.as_bytes(),
                self.trees.runs.as_bytes(),
                places,
                bytemuck::cast_slice(place_nodes),
            ],
            triangle_count: self.triangle_count(),
            primitive_count: self.primitive_count(),
            loose: self.tree.hierarchy().nodes(),
            placed: place_nodes,
        }
    }

    /// The partition whose sections these are: it stays in their memory. Each is to begin at a
    /// multiple of 64.
    ///
    /// # Errors
    /// If it is none.
    pub fn from_sections(
        sections: [Bytes; SECTION_COUNT],
        model: &ModelLimits,
    ) -> Result<Self, InvalidPartition> {
        let [
            nodes,
            triangles,
            materials,
            normals,
            texcoords,
            normal_table,
            texcoord_table,
            runs,
            places,
            place_nodes,
        ] = sections;
        let trees = Trees {
            nodes: table(0, nodes)?,
            triangles: table(1, triangles)?,
            runs: table(7, runs)?,
        };
        let attributes = Attributes {
            materials: table(2, materials)?,
            normals: table(3, normals)?,
            texcoords: table(4, texcoords)?,
            normal_table: table(5, normal_table)?,
            texcoord_table: table(6, texcoord_table)?,
        };
        let all = trees.split()?;
        attributes.check(&all, model)?;
        let mut all = all.into_iter();
        let tree = all.next().unwrap_or_default();
        let (places, place_nodes) = (table(8, places)?, table(9, place_nodes)?);
        let is_placed = !trees.runs.is_empty();
        let has_places = !places.is_empty() || !place_nodes.is_empty();
        if has_places && !is_placed {
            return Err(InvalidPartition::Lengths);
        }
        let objects = PlacedObject::of_trees(tree.len(), all.collect());
        let placed = is_placed.then(|| PlacedObjects::read(objects, places, place_nodes, model));
        Ok(Self {
            trees,
            tree,
            placed: placed.transpose()?,
            attributes,
            model_bounds: model.bounds,
        })
    }
}

impl PlacedObjects {
    /// Objects at these places.
    fn read(
        objects: Vec<PlacedObject>,
        places: Table<Place>,
        nodes: Table<Node>,
        model: &ModelLimits,
    ) -> Result<Self, InvalidPartition> {
        if nodes.is_empty() != places.is_empty() {
            return Err(InvalidPartition::Lengths);
        }
        let hierarchy = Hierarchy::from_nodes(nodes, places.len())?;
        let last = |object: &PlacedObject| object.tree.primitives().max();
        let last: Vec<Option<u32>> = objects.iter().map(last).collect();
        let is_sound = |place: &Place| {
            let last = last.get(place.object as usize).copied().flatten();
            last.is_some_and(|last| place.is_within(last, model.triangle_count)) && place.is_sound()
        };
        if let Some(place) = places.iter().position(|place| !is_sound(place)) {
            return Err(InvalidPartition::Place(place));
        }
        Ok(Self { hierarchy, places, objects })
    }
}

impl Attributes {
    /// Makes sure that they are those of the triangles, and that these are the model's.
    fn check(&self, trees: &[Tree], model: &ModelLimits) -> Result<(), InvalidPartition> {
        let Self { materials, normals, texcoords, normal_table, texcoord_table } = self;
        let count: usize = trees.iter().map(Tree::len).sum();
        let is_per_triangle = |length: usize| length == count || length == 0;
        if materials.len() != count
            || !is_per_triangle(normals.len())
            || !is_per_triangle(texcoords.len())
        {
            return Err(InvalidPartition::Lengths);
        }
        let is_sound = is_within(normals, normal_table.len())
            && is_within(texcoords, texcoord_table.len())
            && is_below(materials.iter().copied(), model.material_count as u64);
        if !is_sound {
            return Err(InvalidPartition::Index);
        }
        let primitives = trees.iter().flat_map(Tree::primitives);
        is_below(primitives, model.triangle_count).then_some(()).ok_or(InvalidPartition::Primitive)
    }
}

fn table<T: Pod>(section: usize, bytes: Bytes) -> Result<Table<T>, InvalidPartition> {
    let invalid = InvalidPartition::SectionSize { section, bytes: bytes.len() };
    Table::in_bytes(bytes).ok_or(invalid)
}

/// Whether all numbers are below a count. All are looked at, for then several are at a time.
fn is_below(numbers: impl Iterator<Item = u32>, count: u64) -> bool {
    numbers.map(|number| u64::from(number) < count).fold(true, |all, it| all & it)
}

/// Whether all triangles that have indices have such as are in a table of this length.
fn is_within(triangles: &[[u32; 3]], length: usize) -> bool {
    let is_there = |index: u32| (index as usize) < length;
    let is_sound =
        |[a, b, c]: [u32; 3]| (a == NO_INDEX) | (is_there(a) & is_there(b) & is_there(c));
    triangles.iter().fold(true, |all, &indices| all & is_sound(indices))
}
