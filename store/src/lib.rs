//! The store: a scene cut into partitions on disk, made by streaming.
//!
//! A store is a directory. Its manifest tells what the scene is and names all other files with
//! their hashes; each partition is a file that is read in one go, tree included. So a machine can
//! take the partitions that it needs, one by one, and never the model. [`build()`] makes a store in
//! a memory that does not grow with the model; [`Store`] opens one. The formats are described in
//! `docs/partitioned-models.md`.

pub mod build;
pub mod error;
pub mod manifest;
pub mod partition_file;

mod block;
mod checksum;
mod luminaires;
mod texture_file;

use std::path::{Path, PathBuf};

use equilux_common::scene::files::{
    Directory, FileSource, ReadError, SCENE_FILE, beside, normalize, within,
};
use equilux_common::scene::{Luminaire, Tables};

pub use self::build::{
    BuildError, Cut, Overture, PARTITION_BYTES_MIN, PARTITIONS_MAX, Phase, Places, Progress, build,
};
pub use self::error::StoreError;
pub use self::manifest::{FileEntry, Manifest, PartitionEntry};
pub use self::partition_file::read_partition;

/// The file of a store that tells of all others.
pub const MANIFEST_FILE: &str = "manifest.json";

/// What everyone must have of a store: all but the partitions.
#[derive(Clone, Debug)]
pub struct Store {
    manifest: Manifest,
    tables: Tables,
    luminaires: Vec<Luminaire>,
}

impl Store {
    /// Opens the store whose manifest is called `entry`, with its tables and lights.
    ///
    /// # Errors
    /// Names the file that is missing, of another version or damaged, and the remedy.
    pub fn open(files: &dyn FileSource, entry: &str) -> Result<Self, StoreError> {
        let manifest = Manifest::from_json(entry, &files.read(entry)?)?;
        let read = |file: &FileEntry| {
            let name = beside(entry, &file.name);
            let bytes = files.read(&name)?;
            file.check(&name, &bytes)?;
            Ok::<_, StoreError>((name, bytes))
        };
        let (name, bytes) = read(&manifest.luminaires.file)?;
        let luminaires = luminaires::decode(&name, &bytes, &manifest)?;
        let mut textures = Vec::with_capacity(manifest.textures.len());
        for texture in &manifest.textures {
            let (name, bytes) = read(&texture.file)?;
            textures.push(texture_file::decode(&name, &bytes, texture)?);
        }
        let (materials, environment) = (manifest.materials.clone(), manifest.environment.clone());
        let tables = Tables { materials, textures, environment };
        Ok(Self { manifest, tables, luminaires })
    }

    /// Whether a file is the manifest of a store.
    #[must_use]
    pub fn is_in(files: &dyn FileSource, entry: &str) -> bool {
        manifest::begins_in(files, entry).unwrap_or(false)
    }

    /// Opens the store in a directory, or the one whose manifest this is.
    ///
    /// # Errors
    /// As [`Store::open`].
    pub fn open_path(path: &Path) -> Result<Self, StoreError> {
        let (directory, entry) = Directory::of(&manifest_path(path))?;
        Self::open(&directory, &entry).map_err(|error| error.below(&directory_path(path)))
    }

    /// All of it: what it holds, the tables, and the triangles that emit.
    #[must_use]
    pub fn into_parts(self) -> (Manifest, Tables, Vec<Luminaire>) {
        (self.manifest, self.tables, self.luminaires)
    }

    /// What the store holds.
    #[must_use]
    pub const fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Materials, textures and the environment.
    #[must_use]
    pub const fn tables(&self) -> &Tables {
        &self.tables
    }

    /// The triangles that emit, by ascending primitive id.
    #[must_use]
    pub fn luminaires(&self) -> &[Luminaire] {
        &self.luminaires
    }
}

/// Whether `path` is a store, or the manifest of one, of any version.
#[must_use]
pub fn is_store(path: &Path) -> bool {
    manifest::begins(&manifest_path(path))
}

/// The manifest of the store at `path`: a directory, or the manifest itself.
#[must_use]
pub fn manifest_path(path: &Path) -> PathBuf {
    if path.is_dir() { path.join(MANIFEST_FILE) } else { path.to_owned() }
}

/// The directory of the store at `path`, as that is written.
#[must_use]
pub fn directory_path(path: &Path) -> PathBuf {
    manifest_path(path).parent().map(Path::to_owned).unwrap_or_default()
}

/// The manifest of the store called `path` in a directory that others may name files in: that of
/// a directory, or `path` itself; none if it is something else. A directory with a manifest and no
/// scene file is taken for a store, however damaged its manifest is.
///
/// # Errors
/// If there is nothing called `path`, or nothing that may be read.
pub fn manifest_in(directory: &Directory, path: &str) -> Result<Option<String>, ReadError> {
    if !directory.has_directory(path)? {
        let is_manifest = manifest::begins_in(directory, path)?;
        return Ok(is_manifest.then(|| normalize(path)));
    }
    let entry = within(path, MANIFEST_FILE);
    let is_store = directory.has_file(&entry)?
        && (manifest::begins_in(directory, &entry)?
            || !directory.has_file(&within(path, SCENE_FILE))?);
    Ok(is_store.then_some(entry))
}
