//! Rows of numbers in a file, read at random through a cache of blocks.
//!
//! Rows of vertices are placed as they come into memory, so that this is done once for a vertex and
//! not once for every triangle around it.
//!
//! Faces refer to vertices that were written not long before or after one another, as programs
//! go over surfaces piece by piece. So blocks of neighboring rows are kept decoded, as many as fit
//! the table's share of memory; a table that fits is read once. Which block makes room is decided
//! by a clock: the first that was not used since the hand last passed it.

use crate::scene::files::{LargeFile, OpenFile, ReadError};
use crate::scene::load::judging::is_good_texcoord;
use crate::scene::load::ply::RowFormat;
use crate::scene::placing::Placing;

/// Rows of a block, as a power of two: some kilobytes, so that a miss costs about as much as the
/// call that mends it.
const BLOCK_BITS: u32 = 10;
const BLOCK_ROWS: usize = 1 << BLOCK_BITS;

/// A block that is not in memory.
const ABSENT: u32 = u32::MAX;

/// Where a table is.
#[derive(Clone, Debug)]
pub(super) struct TableFile {
    pub(super) file: LargeFile,
    /// Where in the file it begins.
    pub(super) offset: u64,
    pub(super) format: RowFormat,
    pub(super) row_count: u64,
    /// Its share of the memory for tables, in eighths.
    pub(super) cache_eighths: usize,
    /// Where in a row positions, normals and texture coordinates begin, as far as it has them.
    pub(super) positions_at: Option<usize>,
    pub(super) normals_at: Option<usize>,
    pub(super) texcoords_at: Option<usize>,
}

/// A table that is open.
#[derive(Debug)]
pub(super) struct RowTable<'a> {
    table: &'a TableFile,
    file: OpenFile<'a>,
    /// How its rows are placed; none if they are shown as they are.
    placing: Option<Placing>,
    row_numbers: usize,
    /// Rows by slot.
    numbers: Vec<f32>,
    slot_of_block: Vec<u32>,
    block_of_slot: Vec<usize>,
    slots_max: usize,
    /// Whether a slot was used since the hand passed it.
    is_recent: Vec<bool>,
    hand: usize,
    /// Blocks that have been read at least once.
    is_known: Vec<bool>,
    /// Texture coordinates among them that cannot be used.
    lost_texcoords: u64,
    bytes: Vec<u8>,
}

impl<'a> RowTable<'a> {
    /// Opens a table for which there are so many bytes of memory.
    pub(super) fn open(
        table: &'a TableFile,
        placing: Option<Placing>,
        cache_bytes: usize,
    ) -> Result<Self, ReadError> {
        let row_numbers = table.format.number_count();
        let blocks = usize::try_from(table.row_count.div_ceil(BLOCK_ROWS as u64));
        let blocks = blocks.unwrap_or(usize::MAX);
        let block_bytes = BLOCK_ROWS * row_numbers * size_of::<f32>();
        let slots_max = (cache_bytes / block_bytes).clamp(1, blocks.max(1));
        Ok(Self {
            table,
            file: table.file.open()?,
            placing,
            row_numbers,
            numbers: Vec::with_capacity(slots_max * BLOCK_ROWS * row_numbers),
            slot_of_block: vec![ABSENT; blocks],
            block_of_slot: Vec::new(),
            slots_max,
            is_recent: Vec::new(),
            hand: 0,
            is_known: vec![false; blocks],
            lost_texcoords: 0,
            bytes: Vec::new(),
        })
    }

    /// The numbers from `at` on of the row `index`, which is there. Inlined wherever it is called:
    /// a result as wide as this one, passed through memory, costs more than the look-up itself.
    #[inline(always)]
    pub(super) fn numbers<const N: usize>(
        &mut self,
        index: u32,
        at: usize,
    ) -> Result<[f32; N], ReadError> {
        let block = (index >> BLOCK_BITS) as usize;
        let slot = match self.slot_of_block.get(block) {
            Some(&slot) if slot != ABSENT => slot as usize,
            _ => self.load(block)?,
        };
        self.is_recent[slot] = true;
        let row = slot * BLOCK_ROWS + index as usize % BLOCK_ROWS;
        let start = row * self.row_numbers + at;
        let mut numbers = [0.0; N];
        numbers.copy_from_slice(&self.numbers[start..start + N]);
        Ok(numbers)
    }

    /// How many texture coordinates of the whole table cannot be used; whatever has not been read
    /// is read for it.
    pub(super) fn count_lost_texcoords(&mut self) -> Result<u64, ReadError> {
        if self.table.texcoords_at.is_some() {
            for block in 0..self.is_known.len() {
                if !self.is_known[block] {
                    self.load(block)?;
                }
            }
        }
        self.file.check_unchanged()?;
        Ok(self.lost_texcoords)
    }

    /// Brings a block into memory; its slot.
    #[cold]
    fn load(&mut self, block: usize) -> Result<usize, ReadError> {
        let TableFile { file, offset, format, row_count, .. } = self.table;
        let first = (block * BLOCK_ROWS) as u64;
        if first >= *row_count {
            return Err(ReadError::Changed { name: file.name().to_owned() });
        }
        let rows = (*row_count - first).min(BLOCK_ROWS as u64) as usize;
        let row_bytes = format.byte_count();
        self.bytes.resize(rows * row_bytes, 0);
        self.file.read_at(offset + first * row_bytes as u64, &mut self.bytes)?;
        let slot = self.free_slot();
        (self.slot_of_block[block], self.block_of_slot[slot]) = (slot as u32, block);
        let start = slot * BLOCK_ROWS * self.row_numbers;
        let numbers = &mut self.numbers[start..start + rows * self.row_numbers];
        format.decode_all(&self.bytes, numbers);
        if let Some(placing) = self.placing {
            let lost = place(numbers.chunks_exact_mut(self.row_numbers), self.table, &placing);
            let is_known = std::mem::replace(&mut self.is_known[block], true);
            self.lost_texcoords += if is_known { 0 } else { lost };
        }
        Ok(slot)
    }

    /// A slot that is not in use any more.
    fn free_slot(&mut self) -> usize {
        let slot = self.block_of_slot.len();
        if slot < self.slots_max {
            self.numbers.resize((slot + 1) * BLOCK_ROWS * self.row_numbers, 0.0);
            self.block_of_slot.push(0);
            self.is_recent.push(true);
            return slot;
        }
        while std::mem::replace(&mut self.is_recent[self.hand], false) {
            self.hand = (self.hand + 1) % self.slots_max;
        }
        let slot = self.hand;
        self.hand = (self.hand + 1) % self.slots_max;
        self.slot_of_block[self.block_of_slot[slot]] = ABSENT;
        slot
    }
}

/// Places rows: positions and normals that cannot be used become NaN, texture coordinates 0 0; the
/// number of the latter.
fn place<'r>(
    rows: impl Iterator<Item = &'r mut [f32]>,
    table: &TableFile,
    placing: &Placing,
) -> u64 {
    let mut lost = 0;
    for row in rows {
        if let Some(position) = column::<3>(row, table.positions_at) {
            *position = placing.position(*position).unwrap_or([f32::NAN; 3]);
        }
        if let Some(normal) = column::<3>(row, table.normals_at) {
            *normal = placing.normal(*normal).unwrap_or([f32::NAN; 3]);
        }
        if let Some(texcoord) = column::<2>(row, table.texcoords_at)
            && !is_good_texcoord(*texcoord)
        {
            *texcoord = [0.0; 2];
            lost += 1;
        }
    }
    lost
}

#[inline]
fn column<const N: usize>(row: &mut [f32], at: Option<usize>) -> Option<&mut [f32; N]> {
    row.get_mut(at?..)?.first_chunk_mut()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn rows_are_right_however_few_blocks_fit(
            indices in prop::collection::vec(0u32..5000, 1..200), slots in 1usize..4,
        ) {
            let rows = (0..5000u16).flat_map(|row| [f32::from(row), f32::from(row) + 0.5]);
            let bytes: Vec<u8> =
                [7; 3].into_iter().chain(rows.flat_map(f32::to_le_bytes)).collect();
            let table = TableFile {
                file: LargeFile::in_memory("t", bytes.as_slice().into()),
                offset: 3,
                format: RowFormat::packed(2),
                row_count: 5000,
                cache_eighths: 8,
                positions_at: None,
                normals_at: None,
                texcoords_at: None,
            };
            let mut opened = RowTable::open(&table, None, slots * BLOCK_ROWS * 8).unwrap();
            for index in indices {
                let number = index as f32;
                prop_assert_eq!(opened.numbers(index, 0).unwrap(), [number, number + 0.5]);
                prop_assert_eq!(opened.numbers(index, 1).unwrap(), [number + 0.5]);
            }
            prop_assert!(opened.block_of_slot.len() <= slots);
            prop_assert!(opened.numbers::<2>(5120, 0).is_err());
        }
    }
}
