//! What is rendered: a scene in memory, or a store whose partitions come into memory one by one.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Context;
use equilux_common::job::Settings;
use equilux_common::scene::Scene;
use equilux_common::scene::camera::Camera;
use equilux_common::scene::files::{Directory, Gathered, Pack, Recording};
use equilux_common::scene::load::Loaded;
use equilux_store::{
    Cut, Manifest, PARTITION_BYTES_MIN, PartitionEntry, Store, is_store, manifest_path,
};
use equilux_worker::StoredScene;
use tempfile::TempDir;

use crate::args::CutArgs;
use crate::interrupt::Interrupt;
use crate::overrides::Defaults;
use crate::store_build::{self, Built, Request};

/// Of a memory budget, a partition takes one part in so many, so that some are there to choose
/// from, and another one can be on its way.
const PARTITIONS_IN_MEMORY: u64 = 12;

/// A scene with all that a job on it starts from.
pub(crate) struct Input {
    /// Its files, but for partitions.
    pub(crate) pack: Arc<Pack>,
    /// The scene file, or the manifest, among them.
    pub(crate) entry: String,
    /// What holds unless the command line says otherwise.
    pub(crate) camera: Camera,
    pub(crate) cameras: BTreeMap<String, Camera>,
    pub(crate) settings: Settings,
    pub(crate) warnings: Vec<String>,
    /// Partitions by their hashes: where they are, and their lengths.
    pub(crate) files: BTreeMap<[u8; 32], (PathBuf, u64)>,
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
            None => Ok(Self::whole(Pack::gather(scene)?)),
        }
    }

    /// What holds unless the command line says otherwise.
    pub(crate) const fn defaults(&self) -> Defaults<'_> {
        Defaults { camera: &self.camera, cameras: &self.cameras, settings: &self.settings }
    }

    /// How many parts the geometry is in.
    pub(crate) const fn partitions(&self) -> u32 {
        match &self.body {
            Body::Whole(_) => 1,
            Body::Stored { partitions, .. } => *partitions,
        }
    }

    fn whole(Gathered { pack, entry, loaded }: Gathered) -> Self {
        let Loaded { scene, camera, cameras, settings, warnings, .. } = loaded;
        let (pack, body) = (Arc::new(pack), Body::Whole(scene));
        let files = BTreeMap::new();
        Self { pack, entry, camera, cameras, settings, warnings, files, body }
    }

    /// Makes a store of a scene for this job alone.
    fn cut(
        scene: &Path,
        cut: Cut,
        place: Option<&Path>,
        is_quiet: bool,
        interrupt: Option<&Interrupt>,
    ) -> anyhow::Result<Self> {
        let place = place.map_or_else(std::env::temp_dir, Path::to_owned);
        let made = tempfile::tempdir_in(&place).with_context(|| {
            format!("{}: cannot be written to; name a place that can by --spool", place.display())
        })?;
        let store = made.path().join("store");
        let request = Request { scene, cut, store: &store, spool: None, is_quiet };
        let Built { warnings, .. } = store_build::build(&request, interrupt)?;
        Ok(Self { warnings, ..Self::open(&store, Some(made))? })
    }

    fn open(path: &Path, made: Option<TempDir>) -> anyhow::Result<Self> {
        let (directory, entry) = Directory::of(&manifest_path(path))?;
        let recording = Recording::new(&directory);
        let store = Store::open(&recording, &entry)?;
        let pack = Arc::new(Pack::from_files(recording.into_files())?);
        let scene = StoredScene::new(store.clone(), directory.base());
        let (Manifest { camera, cameras, settings, partitions, .. }, ..) = store.into_parts();
        let files = partitions.iter().map(|PartitionEntry { file, .. }| {
            (file.hash.into(), (directory.base().join(&file.name), file.bytes))
        });
        let files = files.collect();
        let partitions = u32::try_from(partitions.len()).unwrap_or(u32::MAX);
        let body = Body::Stored { scene, partitions, made };
        let warnings = Vec::new();
        Ok(Self { pack, entry, camera, cameras, settings, warnings, files, body })
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
