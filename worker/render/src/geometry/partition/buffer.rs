//! A partition as plain bytes, and back.
//!
//! A partition is some tables of numbers, so it is written and read without being taken apart: its
//! sections are the tables' memory, little-endian. What comes in is checked, for a walk through a
//! tree that leads astray might never end.

use bytemuck::Pod;
use equilux_common::scene::NO_INDEX;

use super::{Attributes, Partition};
use crate::geometry::Bounds;
use crate::geometry::hierarchy::{InvalidTree, Node};
use crate::geometry::tree::{LeafTriangle, Tree};

/// Sections of a partition: nodes, triangles, materials, normals and texture coordinates of the
/// triangles, and the tables of both.
pub const SECTION_COUNT: usize = 7;

/// Largest section that is believed.
const SECTION_BYTES_MAX: u64 = 1 << 36;

/// A partition that is about to be read.
#[derive(Debug)]
pub struct PartitionBuffer {
    nodes: Vec<Node>,
    triangles: Vec<LeafTriangle>,
    attributes: Attributes,
}

/// Bytes that are no partition.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidPartition {
    /// A section does not hold whole entries, or is too large to be true.
    #[error("its section {section} has {bytes} bytes, which cannot be")]
    SectionSize {
        /// Which.
        section: usize,
        /// Its size.
        bytes: u64,
    },
    /// Tables with an entry per triangle differ in length.
    #[error("its tables do not have the same number of triangles")]
    Lengths,
    /// A triangle names a normal, texture coordinates or a material that are not there.
    #[error("one of its triangles names what is not in its tables")]
    Index,
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
            bytemuck::cast_slice(self.tree.hierarchy().nodes()),
            bytemuck::cast_slice(self.tree.triangles()),
            bytemuck::cast_slice(materials),
            bytemuck::cast_slice(normals),
            bytemuck::cast_slice(texcoords),
            bytemuck::cast_slice(normal_table),
            bytemuck::cast_slice(texcoord_table),
        ]
    }
}

impl PartitionBuffer {
    /// Room for sections of these sizes in bytes.
    ///
    /// # Errors
    /// If a size is not a number of whole entries.
    pub fn with_section_bytes(bytes: [u64; SECTION_COUNT]) -> Result<Self, InvalidPartition> {
        Ok(Self {
            nodes: room(0, bytes)?,
            triangles: room(1, bytes)?,
            attributes: Attributes {
                materials: room(2, bytes)?,
                normals: room(3, bytes)?,
                texcoords: room(4, bytes)?,
                normal_table: room(5, bytes)?,
                texcoord_table: room(6, bytes)?,
            },
        })
    }

    /// Where the sections are to be read into.
    pub fn sections_mut(&mut self) -> [&mut [u8]; SECTION_COUNT] {
        let Attributes { materials, normals, texcoords, normal_table, texcoord_table } =
            &mut self.attributes;
        [
            bytemuck::cast_slice_mut(&mut self.nodes),
            bytemuck::cast_slice_mut(&mut self.triangles),
            bytemuck::cast_slice_mut(materials),
            bytemuck::cast_slice_mut(normals),
            bytemuck::cast_slice_mut(texcoords),
            bytemuck::cast_slice_mut(normal_table),
            bytemuck::cast_slice_mut(texcoord_table),
        ]
    }

    /// The partition that has been read, of a model with these bounds and so many materials.
    ///
    /// # Errors
    /// If it is none.
    pub fn finish(
        self,
        model_bounds: &Bounds,
        material_count: usize,
    ) -> Result<Partition, InvalidPartition> {
        let Self { nodes, triangles, attributes } = self;
        let count = triangles.len();
        let is_per_triangle = |length: usize| length == count || length == 0;
        let Attributes { materials, normals, texcoords, normal_table, texcoord_table } =
            &attributes;
        if materials.len() != count
            || !is_per_triangle(normals.len())
            || !is_per_triangle(texcoords.len())
            || (nodes.is_empty() != triangles.is_empty())
        {
            return Err(InvalidPartition::Lengths);
        }
        let is_sound = is_within(normals, normal_table.len())
            && is_within(texcoords, texcoord_table.len())
            && materials.iter().all(|&material| (material as usize) < material_count);
        if !is_sound {
            return Err(InvalidPartition::Index);
        }
        let tree = Tree::from_parts(nodes, triangles)?;
        Ok(Partition { tree, attributes, model_bounds: *model_bounds })
    }
}

/// Zeros in place of a section's entries.
fn room<T: Pod>(section: usize, sizes: [u64; SECTION_COUNT]) -> Result<Vec<T>, InvalidPartition> {
    let (bytes, entry) = (sizes[section], size_of::<T>() as u64);
    if bytes % entry != 0 || bytes > SECTION_BYTES_MAX {
        return Err(InvalidPartition::SectionSize { section, bytes });
    }
    Ok(vec![T::zeroed(); (bytes / entry) as usize])
}

/// Whether all triangles that have indices have such as are in a table of this length.
fn is_within(triangles: &[[u32; 3]], length: usize) -> bool {
    triangles.iter().all(|indices| {
        indices[0] == NO_INDEX || indices.iter().all(|&index| (index as usize) < length)
    })
}
