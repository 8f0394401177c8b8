//! Scenes by their path below the served root: a scene file, a model, a store, or the directory of
//! one. Whatever is read or attached lies below the root.

use equilux_common::scene::files::{Directory, Pack, ReadError};

use super::RestOptions;
use super::problem::Problem;
use crate::scene::{JobScene, StoreProblem, StoreReader};

/// A path that has not been looked at yet.
#[derive(Debug)]
pub(crate) struct Served {
    root: Directory,
    path: String,
    store_reader: Option<StoreReader>,
}

impl Served {
    /// A path below the root that the options name.
    pub(crate) fn new(options: &RestOptions, path: String) -> Result<Self, Problem> {
        let Some(root) = &options.scenes else {
            return Err(Problem::invalid(
                "scene: this coordinator serves no scenes by path; upload an archive in the form \
                 field `scene` (multipart/form-data), or start it with --scenes DIR",
            ));
        };
        let root = Directory::confined(root).map_err(|error| {
            Problem::internal(format!("the directory of served scenes cannot be read: {error}"))
        })?;
        Ok(Self { root, path, store_reader: options.store_reader })
    }

    /// Reads the scene; takes its time, and a thread that may block.
    pub(crate) fn read(&self) -> Result<JobScene, Problem> {
        let Self { root, path, store_reader } = self;
        if let Some(read) = store_reader {
            match read(root, path) {
                Ok(Some(scene)) => return Ok(scene),
                Ok(None) => {}
                Err(StoreProblem::Unreadable(error)) => return Err(Problem::unreadable(&error)),
                Err(StoreProblem::Invalid(detail)) => return Err(Problem::scene(detail)),
            }
        }
        let unreadable = |error: ReadError| Problem::unreadable(&error);
        let entry = root.scene_file(path).map_err(unreadable)?;
        let gathered = Pack::gather_from(root, &entry);
        let (scene, _) = JobScene::of(gathered.map_err(|error| Problem::of_scene(&error))?);
        Ok(scene)
    }
}
