//! A partition as plain bytes, and back.
//!
//! A partition is some tables of numbers, so it is written and read without being taken apart: its
//! sections are the tables' memory, little-endian. What comes in is checked, for a walk through a
//! tree that leads astray might never end.

use bytemuck::Pod;
use bytes::Bytes;
use equilux_common::scene::NO_INDEX;

use super::{Attributes, Partition};
use crate::geometry::Bounds;
use crate::geometry::hierarchy::InvalidTree;
use crate::geometry::table::Table;
use crate::geometry::tree::{LeafTriangle, Tree};

/// Sections of a partition: nodes, triangles, materials, normals and texture coordinates of the
/// triangles, and the tables of both.
pub const SECTION_COUNT: usize = 7;

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
    /// The tree is none.
    #[error(transparent)]
    Tree(#[from] InvalidTree),
}

impl Partition {
    /// Its tables as bytes, to be written one after another.
    #[must_use]
    pub fn sections(&self) -> [&[u8]; SECTION_COUNT] {
        let Attributes { materials, normals, texcoords, normal_table, texcoord_table } =
            &self.attributes;
        [
            self.tree.hierarchy().nodes().as_bytes(),
            self.tree.triangles().as_bytes(),
            materials.as_bytes(),
            normals.as_bytes(),
            texcoords.as_bytes(),
            normal_table.as_bytes(),
            texcoord_table.as_bytes(),
        ]
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
        let [nodes, triangles, materials, normals, texcoords, normal_table, texcoord_table] =
            sections;
        let (nodes, triangles) = (table(0, nodes)?, table(1, triangles)?);
        let attributes = Attributes {
            materials: table(2, materials)?,
            normals: table(3, normals)?,
            texcoords: table(4, texcoords)?,
            normal_table: table(5, normal_table)?,
            texcoord_table: table(6, texcoord_table)?,
        };
        attributes.check(&triangles, model)?;
        if nodes.is_empty() != triangles.is_empty() {
            return Err(InvalidPartition::Lengths);
        }
        let tree = Tree::from_parts(nodes, triangles)?;
        Ok(Self { tree, attributes, model_bounds: model.bounds })
    }
}

impl Attributes {
    /// Makes sure that they are those of the triangles, and that these are the model's.
    fn check(
        &self,
        triangles: &[LeafTriangle],
        model: &ModelLimits,
    ) -> Result<(), InvalidPartition> {
        let Self { materials, normals, texcoords, normal_table, texcoord_table } = self;
        let count = triangles.len();
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
        let primitives = triangles.iter().map(|triangle| triangle.primitive);
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
