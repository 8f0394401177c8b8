//! Stores against the scenes that they were built from.

mod damage;
mod placed;
mod scenes;
mod whole;

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use equilux_common::job::{Filter, PerDepth, Settings};
use equilux_common::scene::camera::Camera;
use equilux_common::scene::error::SceneError;
use equilux_common::scene::triangles::TriangleSource;
use equilux_common::scene::{Environment, Material, Surface, Tables, WorldTriangle};
use tempfile::TempDir;

use crate::{BuildError, Cut, Manifest, Overture, Places, Progress, build};

/// Triangles in memory, shown a few at a time.
#[derive(Clone, Debug)]
struct Loose(Vec<WorldTriangle>);

impl TriangleSource for Loose {
    fn for_each(
        &mut self,
        visit: &mut dyn FnMut(&[WorldTriangle]) -> ControlFlow<()>,
    ) -> Result<(), SceneError> {
        let _ = self.0.chunks(100).try_for_each(visit);
        Ok(())
    }
}

/// A store in a directory that goes with it.
struct Built {
    home: TempDir,
    manifest: Manifest,
}

impl Built {
    fn new(source: &mut dyn TriangleSource, cut: Cut) -> Self {
        let home = tempfile::tempdir().unwrap();
        let store = home.path().join("store");
        let manifest = build_in(source, cut, &store, &mut |_| ControlFlow::Continue(())).unwrap();
        Self { home, manifest }
    }

    fn path(&self) -> PathBuf {
        self.home.path().join("store")
    }

    fn partition_path(&self, number: usize) -> PathBuf {
        self.path().join(&self.manifest.partitions[number].file.name)
    }
}

fn build_in(
    source: &mut dyn TriangleSource,
    cut: Cut,
    store: &Path,
    observer: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Manifest, BuildError> {
    let (tables, camera, cameras, settings) = (tables(), camera(), cameras(), settings());
    let overture =
        Overture { tables: &tables, camera: &camera, cameras: &cameras, settings: &settings };
    build(source, &overture, cut, &Places { store, spool: None }, observer)
}

/// Material 1 emits, others do not.
fn tables() -> Tables {
    let material = |number: u32| Material {
        name: format!("m{number}"),
        emission: [if number == 1 { 0.1 } else { 0.0 }; 3],
        surface: Surface::Glass { ior: 1.1, transmittance: [0.3, 1.0 / 3.0, 1e-30] },
        opacity: 1.0,
    };
    Tables {
        materials: (0..3).map(material).collect(),
        textures: Vec::new(),
        environment: Environment::Constant { radiance: [0.7; 3] },
    }
}

fn camera() -> Camera {
    Camera {
        eye: [0.1, 0.2, -0.0],
        target: [1.0; 3],
        up: [0.0, 1.0, 0.0],
        vfov: 38.0,
        aperture: 0.0,
        focus_distance: 1e-40,
    }
}

fn cameras() -> BTreeMap<String, Camera> {
    BTreeMap::from([("behind the \"door\"".to_owned(), camera())])
}

fn settings() -> Settings {
    Settings {
        width: 640,
        height: 480,
        crop: None,
        filter: Filter::Tent,
        samples_per_pixel: 64,
        max_depth: 8,
        light_samples: PerDepth::new(vec![2, 1]).unwrap(),
        indirect_samples: PerDepth::default(),
        roulette_depth: Some(3),
        seed: u64::MAX,
    }
}
