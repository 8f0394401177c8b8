//! Where a store is while it is not whole: beside its final name, under one that tells so.

use std::fs;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use super::error::BuildError;
use super::{LUMINAIRES_FILE, PARTITIONS_DIRECTORY, Places, TEXTURES_DIRECTORY};
use crate::{MANIFEST_FILE, is_store};

/// All that is in a store. Whatever else a user keeps there must not go with it.
const STORE_ENTRIES: [&str; 4] =
    [MANIFEST_FILE, LUMINAIRES_FILE, PARTITIONS_DIRECTORY, TEXTURES_DIRECTORY];

/// A store in the making. What is left of it goes when this does, however that comes about.
pub(super) struct Staging {
    /// Where the store will be.
    target: PathBuf,
    /// Beside it; has the store, the one that it replaces, and spool files unless told otherwise.
    beside: TempDir,
    spool: TempDir,
}

impl Staging {
    /// Makes the directories.
    pub(super) fn new(places: &Places<'_>) -> Result<Self, BuildError> {
        let target = places.store.to_owned();
        check_vacant(&target)?;
        let name = target.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let parent = match target.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        let beside = directory_in(parent, &format!("{name}.partial-"))?;
        let spool = match places.spool {
            Some(spool) => directory_in(spool, "equilux-spool-")?,
            None => directory_in(beside.path(), "spool-")?,
        };
        let staging = Self { target, beside, spool };
        // Within the temporary directory, whose permissions are narrower than what users want.
        for directory in [staging.store(), staging.store().join(PARTITIONS_DIRECTORY)] {
            fs::create_dir(&directory)
                .map_err(|cause| BuildError::unwritable(&directory, cause))?;
        }
        Ok(staging)
    }

    /// The directory that becomes the store.
    pub(super) fn store(&self) -> PathBuf {
        self.beside.path().join("store")
    }

    /// The directory of spool files.
    pub(super) fn spool(&self) -> &Path {
        self.spool.path()
    }

    /// Gives the store, which is whole now, its name; another store of that name goes.
    pub(super) fn publish(self) -> Result<(), BuildError> {
        let unwritable = |cause| BuildError::unwritable(&self.target, cause);
        check_vacant(&self.target)?;
        let replaced = self.beside.path().join("replaced");
        let is_replacement = self.target.exists();
        if is_replacement {
            fs::rename(&self.target, &replaced).map_err(unwritable)?;
        }
        fs::rename(self.store(), &self.target).map_err(|cause| {
            if is_replacement {
                // The error that matters is the first one.
                let _ = fs::rename(&replaced, &self.target);
            }
            unwritable(cause)
        })
    }
}

/// Makes sure that there is nothing, an empty directory or a store.
fn check_vacant(target: &Path) -> Result<(), BuildError> {
    let is_vacant = match fs::symlink_metadata(target) {
        Err(_) => true,
        Ok(metadata) if metadata.is_dir() => has_only_a_store(target),
        Ok(_) => false,
    };
    let occupied = || BuildError::Occupied { path: target.to_owned() };
    is_vacant.then_some(()).ok_or_else(occupied)
}

/// Whether there is a store in a directory and nothing else, or not even that.
fn has_only_a_store(directory: &Path) -> bool {
    let Ok(entries) = fs::read_dir(directory) else { return false };
    let names: Vec<_> = entries.flatten().map(|entry| entry.file_name()).collect();
    names.is_empty()
        || is_store(directory)
            && names.iter().all(|name| STORE_ENTRIES.iter().any(|entry| name == entry))
}

fn directory_in(parent: &Path, prefix: &str) -> Result<TempDir, BuildError> {
    let made = tempfile::Builder::new().prefix(prefix).tempdir_in(parent);
    made.map_err(|cause| BuildError::unwritable(parent, cause))
}
