//! Stores as jobs take them: their partitions go to workers straight from disk. For `render`, and
//! for the service, whose package does not know the format.

use equilux_common::scene::files::{Directory, FileSource, Pack, Recording, beside};
use equilux_coordinator::attachments::Attachments;
use equilux_coordinator::scene::{JobScene, StoreProblem};
use equilux_store::{PartitionEntry, Store, StoreError, manifest_in};

/// Opens the store whose manifest is called `entry` in a directory. Of the partitions, places and
/// lengths are looked at here; who reads them checks what is in them.
pub(crate) fn open(directory: &Directory, entry: &str) -> Result<(JobScene, Store), StoreError> {
    let recording = Recording::new(directory);
    let store = Store::open(&recording, entry)?;
    let manifest = store.manifest();
    let attachments = attachments(directory, entry, &manifest.partitions)?;
    let pack = Pack::from_files(recording.into_files()).map_err(|error| StoreError::Malformed {
        file: entry.to_owned(),
        problem: error.to_string(),
    })?;
    let scene = JobScene {
        pack: pack.into(),
        entry: entry.to_owned(),
        attachments,
        camera: manifest.camera,
        cameras: manifest.cameras.clone(),
        settings: manifest.settings.clone(),
        warnings: Vec::new(),
    };
    Ok((scene, store))
}

/// Opens the store called `path` below the root of a service, if that is one.
pub(crate) fn open_served(root: &Directory, path: &str) -> Result<Option<JobScene>, StoreProblem> {
    let Some(entry) = manifest_in(root, path)? else { return Ok(None) };
    match open(root, &entry) {
        Ok((scene, _)) => Ok(Some(scene)),
        Err(error) => Err(StoreProblem::Invalid(error.to_string())),
    }
}

fn attachments(
    directory: &Directory,
    entry: &str,
    partitions: &[PartitionEntry],
) -> Result<Attachments, StoreError> {
    let attach = |PartitionEntry { file, .. }: &PartitionEntry| {
        let name = beside(entry, &file.name);
        let found = directory.large(&name)?.byte_count();
        if found != file.bytes {
            return Err(StoreError::WrongLength { file: name, found, expected: file.bytes });
        }
        Ok((file.hash.into(), (directory.locate(&name)?, file.bytes)))
    };
    let files = partitions.iter().map(attach).collect::<Result<_, _>>()?;
    Ok(Attachments { files })
}
