//! A partition as it lies in a file.

use super::SECTION_COUNT;
use crate::geometry::Bounds;
use crate::geometry::hierarchy::{self, Node};

/// A partition as it lies in a file.
#[derive(Clone, Copy, Debug)]
pub struct PartitionImage<'a> {
    pub(super) sections: [&'a [u8]; SECTION_COUNT],
    pub(super) triangle_count: usize,
    pub(super) primitive_count: u64,
    /// The tree over triangles that are where they are.
    pub(super) loose: &'a [Node],
    /// The tree over places of objects.
    pub(super) placed: &'a [Node],
}

impl<'a> PartitionImage<'a> {
    /// How many triangles there are, those of objects counted once.
    #[must_use]
    pub const fn triangle_count(&self) -> usize {
        self.triangle_count
    }

    /// How many triangles there are, those of objects counted at each place.
    #[must_use]
    pub const fn primitive_count(&self) -> u64 {
        self.primitive_count
    }

    /// Bytes of memory that the partition takes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.sections.iter().map(|section| section.len()).sum()
    }

    /// Boxes that hold all triangles, and little else: at most `most`, at least one if there are
    /// triangles.
    #[must_use]
    pub fn boxes(&self, most: usize) -> Vec<Bounds> {
        if self.placed.is_empty() {
            return hierarchy::boxes(self.loose, most);
        }
        let loose = hierarchy::boxes(self.loose, most / 2);
        let placed = hierarchy::boxes(self.placed, most.saturating_sub(loose.len()));
        let both = loose.into_iter().chain(placed);
        if most > 1 {
            both.collect()
        } else {
            both.reduce(|a, b| a.joined(&b)).into_iter().collect()
        }
    }

    /// Its tables as bytes, to be written one after another, as
    /// [`Partition::from_sections`](super::Partition::from_sections) takes them.
    #[must_use]
    pub const fn sections(&self) -> [&'a [u8]; SECTION_COUNT] {
        self.sections
    }
}
