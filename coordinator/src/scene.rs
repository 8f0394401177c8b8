//! Scenes as jobs start from them: files, and what holds unless the job says otherwise.
//!
//! This package knows what attachments are, and nothing of how geometry is cut: whoever starts a
//! service that takes scenes in partitions hands over a [`StoreReader`].

use std::collections::BTreeMap;
use std::sync::Arc;

use equilux_common::job::Settings;
use equilux_common::scene::Scene;
use equilux_common::scene::camera::Camera;
use equilux_common::scene::files::{Directory, Gathered, Pack, ReadError};
use equilux_common::scene::load::Loaded;

use crate::attachments::Attachments;

/// A scene that jobs can be ordered on.
#[derive(Clone, Debug)]
pub struct JobScene {
    /// Its files, but for those attached.
    pub pack: Arc<Pack>,
    /// The scene file, or the manifest, among them.
    pub entry: String,
    /// Its partitions, if its geometry is in partitions.
    pub attachments: Attachments,
    /// The camera unless another one is chosen.
    pub camera: Camera,
    /// More cameras by name.
    pub cameras: BTreeMap<String, Camera>,
    /// How to render unless told otherwise.
    pub settings: Settings,
    /// What its readers had to say.
    pub warnings: Vec<String>,
}

/// Reads the scene in partitions that is called `path` in a directory whose files may be served;
/// none if what is there is something else. Nothing may be attached that the directory would not
/// give out.
pub type StoreReader = fn(&Directory, &str) -> Result<Option<JobScene>, StoreProblem>;

/// A scene in partitions that is not taken.
#[derive(Debug, thiserror::Error)]
pub enum StoreProblem {
    /// There is nothing of this name, or nothing that may be read.
    #[error(transparent)]
    Unreadable(#[from] ReadError),
    /// It is there, and cannot be rendered: the file, what is wrong with it, and what to do.
    #[error("{0}")]
    Invalid(String),
}

impl JobScene {
    /// A scene that was read whole, and its geometry.
    #[must_use]
    pub fn of(Gathered { pack, entry, loaded }: Gathered) -> (Self, Scene) {
        let Loaded { scene, camera, cameras, settings, warnings, .. } = loaded;
        let (pack, attachments) = (Arc::new(pack), Attachments::default());
        (Self { pack, entry, attachments, camera, cameras, settings, warnings }, scene)
    }
}
