//! Triangles as they lie under a leaf: eight of them are tested at a time.
//!
//! A leaf of n triangles is ten rows of n entries: the nine coordinates of the corners, and the
//! primitive ids. So one coordinate of all triangles is loaded at once, and nothing is padded.

use std::ops::Range;

use glam::Vec3;

use super::hierarchy::{Hierarchy, WIDTH};

/// What a triangle takes in a block: [`ROWS`] entries. They are not its own, but some of its
/// leaf's: bits of floats, and ids.
pub(super) type BlockWords = [u32; ROWS];

/// Rows of a block: three coordinates of the first corner, of the second, of the third, the id.
const ROWS: usize = 10;

/// The row of primitive ids.
const PRIMITIVES: usize = ROWS - 1;

/// A triangle on its way to its leaf.
#[derive(Clone, Copy, Debug)]
pub(super) struct LeafTriangle {
    pub(super) corners: [Vec3; 3],
    pub(super) primitive: u32,
}

/// The triangles of a leaf.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block<'a> {
    words: &'a [u32],
    count: usize,
}

/// A triangle's place in its block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Lane {
    pub(super) number: u8,
    /// Triangles of the block.
    pub(super) count: u8,
}

impl<'a> Block<'a> {
    /// The triangles of a leaf; they must be there, and as many as a leaf may have.
    #[inline(always)]
    pub(super) fn new(triangles: &'a [BlockWords], leaf: Range<usize>) -> Self {
        Self { count: leaf.len(), words: triangles[leaf].as_flattened() }
    }

    #[inline(always)]
    pub(super) const fn len(&self) -> usize {
        self.count
    }

    /// A coordinate of a corner, of all triangles.
    #[inline(always)]
    pub(super) fn coordinates(&self, corner: usize, axis: usize) -> &'a [f32] {
        let row = corner * 3 + axis;
        bytemuck::cast_slice(&self.words[row * self.count..][..self.count])
    }

    /// The ids of the triangles.
    #[inline(always)]
    pub(super) fn primitives(&self) -> &'a [u32] {
        &self.words[PRIMITIVES * self.count..][..self.count]
    }

    #[inline(always)]
    fn corner(&self, corner: usize, lane: usize) -> Vec3 {
        let at = |axis| self.coordinates(corner, axis)[lane];
        Vec3::new(at(0), at(1), at(2))
    }

    #[inline(always)]
    pub(super) fn corners(&self, lane: usize) -> [Vec3; 3] {
        [self.corner(0, lane), self.corner(1, lane), self.corner(2, lane)]
    }
}

impl Lane {
    #[expect(clippy::cast_possible_truncation, reason = "a leaf has few triangles")]
    pub(super) const fn new(number: usize, count: usize) -> Self {
        debug_assert!(count <= WIDTH);
        Self { number: number as u8, count: count as u8 }
    }
}

/// Puts triangles where a tree has them; `order` says which come one after another there.
pub(super) fn lay_blocks(
    leaves: impl Iterator<Item = Range<usize>>,
    triangles: &[LeafTriangle],
    order: &[u32],
    blocks: &mut Vec<BlockWords>,
) {
    blocks.clear();
    blocks.resize(order.len(), [0; ROWS]);
    for leaf in leaves {
        let count = leaf.len();
        let words = blocks[leaf.clone()].as_flattened_mut();
        for (lane, &index) in order[leaf].iter().enumerate() {
            let LeafTriangle { corners, primitive } = &triangles[index as usize];
            for (row, coordinate) in corners.iter().flat_map(Vec3::to_array).enumerate() {
                words[row * count + lane] = coordinate.to_bits();
            }
            words[PRIMITIVES * count + lane] = *primitive;
        }
    }
}

/// The ids of all triangles under a tree.
pub(super) fn primitives<'a>(
    hierarchy: &'a Hierarchy,
    triangles: &'a [BlockWords],
) -> impl Iterator<Item = u32> + 'a {
    hierarchy.leaves().flat_map(|leaf| Block::new(triangles, leaf).primitives()).copied()
}
