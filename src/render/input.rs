//! What is rendered: a scene in memory, or a store whose partitions come into memory one by one.

use std::path::Path;

use equilux_common::scene::Scene;
use equilux_common::scene::files::{Directory, Pack};
use equilux_coordinator::scene::JobScene;
use equilux_store::{Cut, PARTITION_BYTES_MIN, directory_path, is_store, manifest_path};
use equilux_worker::StoredScene;
use tempfile::TempDir;

use crate::args::CutArgs;
use crate::interrupt::Interrupt;
use crate::overrides::Defaults;
use crate::spool;
use crate::store_build::{self, Built, Request};
use crate::stores;

/// Of a memory budget, a partition takes one part in so many, so that some are there to choose
/// from, and another one can be on its way.
const PARTITIONS_IN_MEMORY: u64 = 12;

/// A scene with all that a job on it starts from.
pub(crate) struct Input {
    pub(crate) scene: JobScene,
    pub(crate) body: Body,
}

/// The geometry of a scene.
pub(crate) enum Body {
    /// In memory.
    Whole(Scene),
    /// In a store; if that was made for this job alone, it goes with this.
    Stored { scene: StoredScene, partitions: u32, made: Option<TempDir> },
}

impl Input {
    /// Reads a scene, and cuts it into partitions if that is asked for.
    pub(crate) fn read(
        scene: &Path,
        args: &CutArgs,
        is_quiet: bool,
        interrupt: Option<&Interrupt>,
    ) -> anyhow::Result<Self> {
        if is_store(scene) {
            return Self::open(scene, None);
        }
        match cut(args) {
            Some(cut) => Self::cut(scene, cut, args.spool.as_deref(), is_quiet, interrupt),
            None => {
                let (scene, geometry) = JobScene::of(Pack::gather(scene)?);
                Ok(Self { scene, body: Body::Whole(geometry) })
            }
        }
    }

    /// What holds unless the command line says otherwise.
    pub(crate) const fn defaults(&self) -> Defaults<'_> {
        let JobScene { camera, cameras, settings, .. } = &self.scene;
        Defaults { camera, cameras, settings }
    }

    /// How many parts the geometry is in.
    pub(crate) const fn partitions(&self) -> u32 {
        match &self.body {
            Body::Whole(_) => 1,
            Body::Stored { partitions, .. } => *partitions,
        }
    }

    /// Makes a store of a scene for this job alone.
    fn cut(
        scene: &Path,
        cut: Cut,
        place: Option<&Path>,
        is_quiet: bool,
        interrupt: Option<&Interrupt>,
    ) -> anyhow::Result<Self> {
        let made = spool::make(place)?;
        let store = made.path().join("store");
        let request = Request { scene, cut, store: &store, spool: None, is_quiet };
        let Built { warnings, .. } = store_build::build(&request, interrupt)?;
        let mut input = Self::open(&store, Some(made))?;
        input.scene.warnings = warnings;
        Ok(input)
    }

    fn open(path: &Path, made: Option<TempDir>) -> anyhow::Result<Self> {
        let (directory, entry) = Directory::of(&manifest_path(path))?;
        let place = directory_path(path);
        let opened = stores::open(&directory, &entry);
        let (job_scene, store) = opened.map_err(|error| error.below(&place))?;
        let partitions = u32::try_from(store.manifest().partitions.len()).unwrap_or(u32::MAX);
        let scene = StoredScene::new(store, &place);
        Ok(Self { scene: job_scene, body: Body::Stored { scene, partitions, made } })
    }
}

/// How a scene is to be cut, if at all.
fn cut(args: &CutArgs) -> Option<Cut> {
    let by_memory = |bytes: u64| Cut::Size((bytes / PARTITIONS_IN_MEMORY).max(PARTITION_BYTES_MIN));
    match (args.partitions, args.memory) {
        (Some(1) | None, None) => None,
        (Some(count), _) => Some(Cut::Count(count)),
        (None, Some(memory)) => Some(by_memory(memory.0)),
    }
}
