//! The vertices of a model that is streamed: one table of all they have, or a table of each.

use super::table::{RowTable, TableFile};
use crate::scene::files::ReadError;
use crate::scene::placing::Placing;

/// Memory for all tables of a model together.
const CACHE_BYTES: usize = 96 << 20;

/// Memory for vertices as they are in the file, if they are needed.
const RAW_CACHE_BYTES: usize = 32 << 20;

/// Where the vertices of a model are.
#[derive(Debug)]
pub(super) struct VertexFiles {
    pub(super) tables: Vec<TableFile>,
    pub(super) positions: Column,
    pub(super) normals: Column,
    pub(super) texcoords: Column,
}

/// Some columns of a table.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Column {
    /// Which table.
    pub(super) table: usize,
    /// Where in its rows.
    pub(super) at: usize,
}

/// Vertices that can be read, in their place in the scene.
#[derive(Debug)]
pub(super) struct Vertices<'a> {
    files: &'a VertexFiles,
    tables: Vec<RowTable<'a>>,
    /// Whether positions that can be used are in the scene what they are in the model.
    stays: bool,
    /// Positions in the coordinates of the model, once they have been asked for.
    raw: Option<RowTable<'a>>,
}

impl<'a> Vertices<'a> {
    /// Opens the vertices of a model that is placed so.
    pub(super) fn open(files: &'a VertexFiles, placing: Placing) -> Result<Self, ReadError> {
        let open = |table: &'a TableFile| {
            RowTable::open(table, Some(placing), CACHE_BYTES / 8 * table.cache_eighths)
        };
        let tables = files.tables.iter().map(open).collect::<Result<_, _>>()?;
        Ok(Self { files, tables, stays: placing.is_identity(), raw: None })
    }

    /// Where a vertex lies in the scene, unless it cannot be used.
    #[inline(always)]
    pub(super) fn position(&mut self, index: u32) -> Result<Option<[f32; 3]>, ReadError> {
        let position = self.numbers(self.files.positions, index)?;
        Ok(Some(position).filter(|position| !position[0].is_nan()))
    }

    /// Where a vertex lies in the coordinates of the model.
    pub(super) fn raw_position(&mut self, index: u32) -> Result<[f32; 3], ReadError> {
        if self.stays
            && let Some(position) = self.position(index)?
        {
            return Ok(position);
        }
        let column = self.files.positions;
        let raw = match &mut self.raw {
            Some(raw) => raw,
            raw @ None => {
                let table = &self.files.tables[column.table];
                raw.insert(RowTable::open(table, None, RAW_CACHE_BYTES)?)
            }
        };
        raw.numbers(index, column.at)
    }

    /// A normal of unit length, unless it cannot be used.
    #[inline(always)]
    pub(super) fn normal(&mut self, index: u32) -> Result<Option<[f32; 3]>, ReadError> {
        let normal = self.numbers(self.files.normals, index)?;
        Ok(Some(normal).filter(|normal| !normal[0].is_nan()))
    }

    #[inline(always)]
    pub(super) fn texcoord(&mut self, index: u32) -> Result<[f32; 2], ReadError> {
        self.numbers(self.files.texcoords, index)
    }

    #[inline(always)]
    fn numbers<const N: usize>(
        &mut self,
        column: Column,
        index: u32,
    ) -> Result<[f32; N], ReadError> {
        self.tables[column.table].numbers(index, column.at)
    }

    /// How many texture coordinates cannot be used, once all faces have been seen.
    pub(super) fn count_lost_texcoords(&mut self) -> Result<u64, ReadError> {
        self.tables.iter_mut().map(RowTable::count_lost_texcoords).sum()
    }
}
