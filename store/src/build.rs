//! Building a store: two passes over the model, then partition by partition.
//!
//! 1. The *survey* counts triangles and sorts them into [`cells`].
//! 2. The cells are [bisected](bisection) into parts.
//! 3. The *distribution* puts each triangle into the [`spool`] file of its part, and those that
//!    emit into a file of their own.
//! 4. Of each part a partition is [made](parts): its tree built, the file written. A part that is
//!    still too large is taken for a model of its own, and goes through 1 to 4 again.
//!
//! Models that are placed several times come [after](prototypes) all others.
//!
//! So memory holds the cells and two partitions, whatever the model's size, and the disk the model
//! twice. What is built depends on the scene and the cut alone.

mod bisection;
mod cells;
mod emitters;
mod error;
mod parts;
mod pass;
mod prototypes;
mod record;
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
use equilux_common::scene::{Tables, WorldTriangle};

use self::bisection::bisect;
use self::emitters::Emitters;
pub use self::error::BuildError;
use self::parts::Parts;
use self::pass::{ScenePass, Survey};
use self::prototypes::Prototypes;
use self::spool::{PARTS_MAX, SpooledPart};
use self::staging::Staging;
use crate::manifest::{Manifest, STORE_VERSION, TextureEntry};
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
    /// empty. Where models are placed several times it may come to some more or fewer, for these
    /// have partitions of their own. From 1 to [`PARTITIONS_MAX`].
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
    let mut pass = ScenePass::new(source, observer);
    let mut survey = pass::survey(&mut pass)?;
    let prototypes = Prototypes::survey(&mut pass, survey.triangle_count)?;
    let bounds = survey.bounds().joined(&prototypes.bounds()).or_origin();
    let shares = Shares::of(cut, &survey, &prototypes);
    let mut emitters = Emitters::create(&staging.store().join(LUMINAIRES_FILE), overture.tables)?;
    let kept = survey.triangle_count + prototypes.kept_count(shares.placed_mean);
    let mut partitions = Vec::new();
    if shares.loose_parts > 0 {
        let parts =
            distribute(&mut pass, &mut survey, shares.loose_parts, &mut emitters, &staging)?;
        let makes = Parts {
            cut,
            places: &[],
            prefix: "",
            before: 0,
            total: kept,
            store: &staging.store(),
            spool: staging.spool(),
        };
        partitions = makes.make_all(parts, pass.observer)?;
    }
    (pass.phase, pass.before, pass.total) = (Phase::Partitions, survey.triangle_count, Some(kept));
    drop(survey);
    let placing = prototypes::Making { cut, mean: shares.placed_mean, staging: &staging };
    partitions.extend(placing.make_all(&prototypes, &mut pass, &mut emitters)?);
    parts::number(&staging.store(), &mut partitions)?;
    let luminaires = emitters.finish(LUMINAIRES_FILE)?;
    let textures = write_textures(overture.tables, &staging)?;
    let manifest = Manifest {
        version: STORE_VERSION,
        triangle_count: prototypes.placed_end(),
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

/// How many partitions the kinds of triangles become.
struct Shares {
    /// Of those that are where they are.
    loose_parts: u32,
    /// Bytes that partitions of prototypes are to take on average.
    placed_mean: u64,
}

impl Shares {
    fn of(cut: Cut, survey: &Survey, prototypes: &Prototypes) -> Self {
        let (loose, placed) = (survey.bytes, prototypes.bytes());
        let has_loose = survey.triangle_count > 0 || prototypes.is_empty();
        match cut {
            Cut::Size(bytes) => Self {
                loose_parts: if has_loose { survey.parts_within(bytes) } else { 0 },
                placed_mean: pass::mean_within(bytes),
            },
            Cut::Count(count) => {
                let part = u64::from(count) * loose / (loose + placed).max(1);
                let part = u32::try_from(part).unwrap_or(count);
                let loose_parts = match (has_loose, prototypes.is_empty()) {
                    (true, true) => count,
                    (true, false) => part.clamp(1, count.max(2) - 1),
                    (false, _) => 0,
                };
                let rest = u64::from(count.saturating_sub(loose_parts).max(1));
                Self { loose_parts, placed_mean: placed.div_ceil(rest).max(1) }
            }
        }
    }
}

/// Sorts triangles into parts on disk.
fn distribute(
    pass: &mut ScenePass<'_, '_>,
    survey: &mut Survey,
    part_count: u32,
    emitters: &mut Emitters<'_>,
    staging: &Staging,
) -> Result<Vec<CountedPart>, BuildError> {
    let count = survey.triangle_count;
    (pass.phase, pass.expected, pass.total) = (Phase::Distribution, Some(count), Some(count));
    let (before, prototype) = (pass.before, pass.prototype);
    (pass.before, pass.prototype) = (0, None);
    let mut gather = |primitive, triangle: &WorldTriangle| emitters.gather(primitive, triangle);
    let regions = bisect(survey.cells.as_slice(), part_count, PARTS_MAX);
    let parts = pass::distribute(pass, survey, &regions, &mut gather, (staging.spool(), ""));
    (pass.before, pass.prototype) = (before, prototype);
    parts
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
}
