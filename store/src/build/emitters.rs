//! The triangles that emit, on their way into a file of their own.

use std::path::{Path, PathBuf};

use equilux_common::scene::triangles::Placement;
use equilux_common::scene::{Luminaire, Tables, WorldTriangle};

use super::error::BuildError;
use crate::luminaires::LuminairesFile;
use crate::manifest::LuminairesEntry;

/// The file while it is written.
pub(super) struct Emitters<'a> {
    tables: &'a Tables,
    path: PathBuf,
    file: LuminairesFile,
}

impl<'a> Emitters<'a> {
    /// Makes the file, which must not be there yet.
    pub(super) fn create(path: &Path, tables: &'a Tables) -> Result<Self, BuildError> {
        let file = LuminairesFile::create(path);
        let file = file.map_err(|cause| BuildError::unwritable(path, cause))?;
        Ok(Self { tables, path: path.to_owned(), file })
    }

    /// Takes a triangle down if it emits. Ids must ascend.
    pub(super) fn gather(
        &mut self,
        primitive: u32,
        triangle: &WorldTriangle,
    ) -> Result<(), BuildError> {
        match self.luminaire(primitive, triangle)? {
            Some(luminaire) => self.push(&luminaire),
            None => Ok(()),
        }
    }

    /// Takes the triangles of a prototype that emit down at all its places.
    pub(super) fn gather_placed(
        &mut self,
        luminaires: &[Luminaire],
        placements: impl Iterator<Item = Placement>,
    ) -> Result<(), BuildError> {
        if luminaires.is_empty() {
            return Ok(());
        }
        for placement in placements {
            luminaires.iter().try_for_each(|it| self.push(&it.placed(&placement)))?;
        }
        Ok(())
    }

    /// A triangle, if it emits.
    pub(super) fn luminaire(
        &self,
        primitive: u32,
        triangle: &WorldTriangle,
    ) -> Result<Option<Luminaire>, BuildError> {
        let WorldTriangle { material, corners, .. } = *triangle;
        let count = self.tables.materials.len();
        if material as usize >= count {
            return Err(BuildError::NoMaterial { primitive, material, count });
        }
        let is_luminous = self.tables.is_luminous(material);
        Ok(is_luminous.then_some(Luminaire { primitive, material, corners }))
    }

    /// Completes the file, which is called `name` in the store.
    pub(super) fn finish(self, name: &str) -> Result<LuminairesEntry, BuildError> {
        let finished = self.file.finish(name.to_owned());
        finished.map_err(|cause| BuildError::unwritable(&self.path, cause))
    }

    fn push(&mut self, luminaire: &Luminaire) -> Result<(), BuildError> {
        let pushed = self.file.push(luminaire);
        pushed.map_err(|cause| BuildError::unwritable(&self.path, cause))
    }
}
