//! Building a store: two passes over the model, then partition by partition.
//!
//! 1. The *survey* counts triangles and sorts them into [`cells`].
//! 2. The cells are [bisected](bisection) into parts.
//! 3. The *distribution* puts each triangle into the [`spool`] file of its part, and those that
//!    emit into a file of their own.
//! 4. Of each part a partition is [made](parts): its tree built, the file written. A part that is
//!    still too large is taken for a model of its own, and goes through 1 to 4 again.
//!
//! So memory holds the cells and two partitions, whatever the model's size, and the disk the model
//! twice. What is built depends on the scene and the cut alone.

mod bisection;
mod cells;
mod error;
mod parts;
mod pass;
mod spool;
mod staging;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::ops::ControlFlow;
use std::path::Path;

use equilux_common::job::Settings;
use equilux_common::scene::camera::Camera;
use equilux_common::scene::triangles::TriangleSource;
use equilux_common::scene::{Material, Tables, WorldTriangle};

use self::bisection::bisect;
pub use self::error::BuildError;
use self::parts::Parts;
use self::pass::{Pass, ScenePass, Survey};
use self::spool::{PARTS_MAX, SpooledPart};
use self::staging::Staging;
use crate::luminaires::LuminairesFile;
use crate::manifest::{LuminairesEntry, Manifest, STORE_VERSION, TextureEntry};
use crate::{MANIFEST_FILE, texture_file};

/// The file with the triangles that emit.
const LUMINAIRES_FILE: &str = "luminaires.bin";

/// The directory of the partitions' files.
const PARTITIONS_DIRECTORY: &str = "partitions";

/// The directory of the textures' files, if there are any.
const TEXTURES_DIRECTORY: &str = "textures";

/// Least size of partitions that can be asked for: smaller ones are all overhead, and there would
/// be millions of them.
pub const PARTITION_BYTES_MIN: u64 = 64 << 10;

/// Most partitions that can be asked for: a store then has as many files in one directory.
pub const PARTITIONS_MAX: u32 = 1 << 16;

/// How finely a scene is cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cut {
    /// Into partitions that take at most so many bytes of memory each, unless it be a single
    /// triangle. At least [`PARTITION_BYTES_MIN`].
    Size(u64),
    /// Into so many partitions of about equal size; if there are more than triangles, some are
    /// empty. From 1 to [`PARTITIONS_MAX`].
    Count(u32),
}

/// All of a scene but its triangles.
#[derive(Clone, Copy, Debug)]
pub struct Overture<'a> {
    /// Materials, textures and the environment.
    pub tables: &'a Tables,
    /// The camera that is used unless another one is asked for.
    pub camera: &'a Camera,
    /// More cameras by name.
    pub cameras: &'a BTreeMap<String, Camera>,
    /// How to render unless told otherwise.
    pub settings: &'a Settings,
}

/// Where things go.
#[derive(Clone, Copy, Debug)]
pub struct Places<'a> {
    /// The store. If there is one already, it is replaced when the new one is whole.
    pub store: &'a Path,
    /// A directory for files that the building needs for a while, together about as large as the
    /// store; beside the store unless given.
    pub spool: Option<&'a Path>,
}

/// A part of the work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Looking at the triangles.
    Survey,
    /// Putting them into the parts.
    Distribution,
    /// Making partitions.
    Partitions,
}

/// How far the building is.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// What is going on.
    pub phase: Phase,
    /// Triangles that are through with it.
    pub triangles: u64,
    /// Of how many; not known in the survey.
    pub total: Option<u64>,
}

/// Whom to tell how far the building is, many times a second; who may break it off.
pub type Observer<'a> = dyn FnMut(Progress) -> ControlFlow<()> + 'a;

/// Builds the store of a scene and tells what it holds.
///
/// # Errors
/// If the scene cannot be read, or a file not be written. Nothing is then left of the store, and
/// what was there before still is.
///
/// # Panics
/// If `cut` is beyond its limits.
pub fn build(
    source: &mut dyn TriangleSource,
    overture: &Overture<'_>,
    cut: Cut,
    places: &Places<'_>,
    observer: &mut Observer<'_>,
) -> Result<Manifest, BuildError> {
    cut.check();
    let staging = Staging::new(places)?;
    let mut pass = ScenePass { source, observer, phase: Phase::Survey, total: None };
    let survey = pass::survey(&mut pass)?;
    let (bounds, triangle_count) = (survey.bounds(), survey.triangle_count);
    let part_count = cut.part_count(&survey);
    (pass.phase, pass.total) = (Phase::Distribution, Some(triangle_count));
    let Distributed { parts, luminaires } =
        distribute(&mut pass, survey, part_count, &overture.tables.materials, &staging)?;
    let makes = Parts { bounds, cut, store: &staging.store(), spool: staging.spool() };
    let partitions = makes.make_all(parts, pass.observer)?;
    let textures = write_textures(overture.tables, &staging)?;
    let manifest = Manifest {
        version: STORE_VERSION,
        triangle_count,
        bounds,
        camera: *overture.camera,
        cameras: overture.cameras.clone(),
        settings: overture.settings.clone(),
        materials: overture.tables.materials.clone(),
        environment: overture.tables.environment.clone(),
        textures,
        luminaires,
        partitions,
    };
    let path = staging.store().join(MANIFEST_FILE);
    write_durably(&path, &manifest.to_json())
        .map_err(|cause| BuildError::unwritable(&path, cause))?;
    staging.publish()?;
    Ok(manifest)
}

/// Writes a file that is there after a power cut, too.
fn write_durably(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let mut file = File::create(path)?;
    file.write_all(bytes)?;
    file.sync_all()
}

/// A part on disk and how many partitions it becomes.
type CountedPart = (SpooledPart, u32);

/// What comes of the distribution.
struct Distributed {
    parts: Vec<CountedPart>,
    luminaires: LuminairesEntry,
}

fn distribute(
    pass: &mut dyn Pass,
    mut survey: Survey,
    part_count: u32,
    materials: &[Material],
    staging: &Staging,
) -> Result<Distributed, BuildError> {
    let path = staging.store().join(LUMINAIRES_FILE);
    let unwritable = |cause| BuildError::unwritable(&path, cause);
    let mut luminaires = LuminairesFile::create(&path).map_err(unwritable)?;
    let mut gather = |primitive, triangle: &WorldTriangle| {
        let (material, count) = (triangle.material, materials.len());
        match materials.get(material as usize) {
            Some(material) if material.emission == [0.0; 3] => Ok(()),
            Some(_) => luminaires.push(primitive, triangle).map_err(unwritable),
            None => Err(BuildError::NoMaterial { primitive, material, count }),
        }
    };
    let regions = bisect(survey.cells.as_slice(), part_count, PARTS_MAX);
    let parts = pass::distribute(pass, &mut survey, &regions, &mut gather, (staging.spool(), ""))?;
    let luminaires = luminaires.finish(LUMINAIRES_FILE.to_owned()).map_err(unwritable)?;
    Ok(Distributed { parts, luminaires })
}

fn write_textures(tables: &Tables, staging: &Staging) -> Result<Vec<TextureEntry>, BuildError> {
    let directory = staging.store().join(TEXTURES_DIRECTORY);
    if !tables.textures.is_empty() {
        std::fs::create_dir(&directory)
            .map_err(|cause| BuildError::unwritable(&directory, cause))?;
    }
    let textures = tables.textures.iter().enumerate().map(|(number, texture)| {
        let name = format!("{TEXTURES_DIRECTORY}/{number:05}.texels");
        let path = staging.store().join(&name);
        texture_file::write(&path, name, texture)
            .map_err(|cause| BuildError::unwritable(&path, cause))
    });
    textures.collect()
}

impl Cut {
    fn check(self) {
        match self {
            Self::Size(bytes) => assert!(bytes >= PARTITION_BYTES_MIN, "{bytes} bytes"),
            Self::Count(count) => assert!((1..=PARTITIONS_MAX).contains(&count), "{count}"),
        }
    }

    /// Parts that the triangles surveyed should become.
    fn part_count(self, survey: &Survey) -> u32 {
        match self {
            Self::Count(count) => count,
            Self::Size(bytes) => survey.parts_within(bytes),
        }
    }
}
