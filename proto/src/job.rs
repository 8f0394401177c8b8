//! A job as the coordinator describes it: scene, camera, settings, and how it is cut into units.

use equilux_common::ids::JobId;
use equilux_common::job::{
    Filter, InvalidPerDepth, InvalidSettings, JobSpec, PerDepth, SceneRef, Settings,
};
use equilux_common::scene::camera::Camera;
use equilux_common::unit::{Granularity, Rect};

use crate::limits::{
    CURVE_CELLS_MAX, ENTRY_BYTES_MAX, PACK_BYTES_MAX, PER_DEPTH_MAX, TILE_SIDE_PIXELS_MAX,
    UNITS_MAX,
};
use crate::v1;

/// A job that cannot be rendered.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidJobSpec {
    /// Not said.
    #[error("{0}: is missing")]
    Missing(&'static str),
    /// A bad scene.
    #[error("scene.{0}")]
    Scene(#[from] InvalidSceneRef),
    /// A bad camera.
    #[error("camera.{0}")]
    Camera(#[from] InvalidCamera),
    /// Bad settings.
    #[error("settings.{0}")]
    Settings(#[from] InvalidSettings),
    /// No such filter.
    #[error("settings.filter: {0} is unknown")]
    Filter(i32),
    /// A bad list of counts.
    #[error("settings.{field}: {problem}")]
    PerDepth {
        /// Which list.
        field: &'static str,
        /// What is wrong with it.
        problem: InvalidPerDepth,
    },
    /// A list longer than any path is deep.
    #[error("settings.{field}: has {count} entries; at most {PER_DEPTH_MAX} are allowed")]
    PerDepthLength {
        /// Which list.
        field: &'static str,
        /// How many it has.
        count: usize,
    },
    /// Cut into tiles or ranges that are empty or too large.
    #[error(
        "granularity: tiles of {tile_side_pixels} pixels (from 1 to {TILE_SIDE_PIXELS_MAX}) and \
         {samples_per_unit} samples (at least 1) cannot be"
    )]
    Granularity {
        /// Side of a tile.
        tile_side_pixels: u32,
        /// Samples of a unit.
        samples_per_unit: u32,
    },
    /// Cut into too many units.
    #[error("granularity: gives {0} units; at most {UNITS_MAX} are allowed, so cut more coarsely")]
    Units(u64),
    /// Tiles so small that to order them takes too long.
    #[error("granularity: the curve has {0} cells, above {CURVE_CELLS_MAX}; use larger tiles")]
    Curve(u64),
}

/// A scene that cannot be found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidSceneRef {
    /// Not a BLAKE3 hash.
    #[error("hash: has {0} bytes instead of 32")]
    Hash(usize),
    /// A pack that no worker can hold.
    #[error("pack_bytes: {0} is more than {PACK_BYTES_MAX}")]
    PackBytes(u64),
    /// No path.
    #[error("entry: has {0} bytes, not from 1 to {ENTRY_BYTES_MAX}")]
    Entry(usize),
}

/// A camera that sees nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidCamera {
    /// Not said.
    #[error("{0}: is missing")]
    Missing(&'static str),
    /// NaN or infinite.
    #[error("{0}: is not finite")]
    NotFinite(&'static str),
    /// No angle of view.
    #[error("vfov: is not between 0 and 180 degrees")]
    Vfov,
    /// A lens of negative size.
    #[error("aperture: is negative")]
    Aperture,
}

impl From<JobSpec> for v1::JobSpec {
    fn from(spec: JobSpec) -> Self {
        Self {
            id: spec.id.0,
            scene: Some(spec.scene.into()),
            camera: Some(spec.camera.into()),
            settings: Some(spec.settings.into()),
            granularity: Some(v1::Granularity {
                tile_side_pixels: spec.granularity.tile_side_pixels,
                samples_per_unit: spec.granularity.samples_per_unit,
            }),
        }
    }
}

impl TryFrom<v1::JobSpec> for JobSpec {
    type Error = InvalidJobSpec;

    fn try_from(wire: v1::JobSpec) -> Result<Self, InvalidJobSpec> {
        let missing = InvalidJobSpec::Missing;
        let settings = settings(wire.settings.ok_or(missing("settings"))?)?;
        let granularity = wire.granularity.ok_or(missing("granularity"))?;
        Ok(Self {
            id: JobId(wire.id),
            scene: wire.scene.ok_or(missing("scene"))?.try_into()?,
            camera: wire.camera.ok_or(missing("camera"))?.try_into()?,
            granularity: check_granularity(granularity, &settings)?,
            settings,
        })
    }
}

/// Makes sure that the units can be numbered and the tiles be ordered.
fn check_granularity(
    wire: v1::Granularity,
    settings: &Settings,
) -> Result<Granularity, InvalidJobSpec> {
    let v1::Granularity { tile_side_pixels, samples_per_unit } = wire;
    if !(1..=TILE_SIDE_PIXELS_MAX).contains(&tile_side_pixels) || samples_per_unit == 0 {
        return Err(InvalidJobSpec::Granularity { tile_side_pixels, samples_per_unit });
    }
    let region = settings.region();
    let columns = region.width().div_ceil(tile_side_pixels);
    let rows = region.height().div_ceil(tile_side_pixels);
    let cells = u64::from(columns) * u64::from(rows);
    if cells > CURVE_CELLS_MAX {
        return Err(InvalidJobSpec::Curve(cells));
    }
    let ranges = settings.samples_per_pixel.div_ceil(samples_per_unit);
    match u64::from(columns) * u64::from(rows) * u64::from(ranges) {
        units if units > u64::from(UNITS_MAX) => Err(InvalidJobSpec::Units(units)),
        _ => Ok(Granularity { tile_side_pixels, samples_per_unit }),
    }
}

impl From<SceneRef> for v1::SceneRef {
    fn from(scene: SceneRef) -> Self {
        Self { hash: scene.hash.to_vec(), pack_bytes: scene.pack_bytes, entry: scene.entry }
    }
}

impl TryFrom<v1::SceneRef> for SceneRef {
    type Error = InvalidSceneRef;

    fn try_from(wire: v1::SceneRef) -> Result<Self, InvalidSceneRef> {
        let hash =
            wire.hash.try_into().map_err(|hash: Vec<u8>| InvalidSceneRef::Hash(hash.len()))?;
        if wire.pack_bytes > PACK_BYTES_MAX {
            return Err(InvalidSceneRef::PackBytes(wire.pack_bytes));
        }
        if !(1..=ENTRY_BYTES_MAX).contains(&wire.entry.len()) {
            return Err(InvalidSceneRef::Entry(wire.entry.len()));
        }
        Ok(Self { hash, pack_bytes: wire.pack_bytes, entry: wire.entry })
    }
}

impl From<Camera> for v1::Camera {
    fn from(camera: Camera) -> Self {
        let vector = |[x, y, z]: [f32; 3]| Some(v1::Vector { x, y, z });
        Self {
            eye: vector(camera.eye),
            target: vector(camera.target),
            up: vector(camera.up),
            vfov: camera.vfov,
            aperture: camera.aperture,
            focus_distance: camera.focus_distance,
        }
    }
}

impl TryFrom<v1::Camera> for Camera {
    type Error = InvalidCamera;

    fn try_from(wire: v1::Camera) -> Result<Self, InvalidCamera> {
        let finite = |field, number: f32| {
            if number.is_finite() { Ok(number) } else { Err(InvalidCamera::NotFinite(field)) }
        };
        let vector = |field, vector: Option<v1::Vector>| {
            let v1::Vector { x, y, z } = vector.ok_or(InvalidCamera::Missing(field))?;
            Ok([finite(field, x)?, finite(field, y)?, finite(field, z)?])
        };
        let camera = Self {
            eye: vector("eye", wire.eye)?,
            target: vector("target", wire.target)?,
            up: vector("up", wire.up)?,
            vfov: finite("vfov", wire.vfov)?,
            aperture: finite("aperture", wire.aperture)?,
            focus_distance: finite("focus_distance", wire.focus_distance)?,
        };
        if !(camera.vfov > 0.0 && camera.vfov < 180.0) {
            return Err(InvalidCamera::Vfov);
        }
        if camera.aperture < 0.0 { Err(InvalidCamera::Aperture) } else { Ok(camera) }
    }
}

impl From<Settings> for v1::Settings {
    fn from(settings: Settings) -> Self {
        let filter = match settings.filter {
            Filter::Box => v1::Filter::Box,
            Filter::Tent => v1::Filter::Tent,
            Filter::Gaussian => v1::Filter::Gaussian,
        };
        let rect = |Rect { x0, y0, x1, y1 }| v1::Rect { x0, y0, x1, y1 };
        Self {
            width: settings.width,
            height: settings.height,
            crop: settings.crop.map(rect),
            filter: filter.into(),
            samples_per_pixel: settings.samples_per_pixel,
            max_depth: settings.max_depth,
            light_samples: settings.light_samples.as_slice().to_vec(),
            indirect_samples: settings.indirect_samples.as_slice().to_vec(),
            roulette_depth: settings.roulette_depth,
            seed: settings.seed,
        }
    }
}

fn settings(wire: v1::Settings) -> Result<Settings, InvalidJobSpec> {
    let filter = match v1::Filter::try_from(wire.filter) {
        Ok(v1::Filter::Box) => Filter::Box,
        Ok(v1::Filter::Tent) => Filter::Tent,
        Ok(v1::Filter::Gaussian) => Filter::Gaussian,
        Ok(v1::Filter::Unspecified) | Err(_) => return Err(InvalidJobSpec::Filter(wire.filter)),
    };
    let rect = |v1::Rect { x0, y0, x1, y1 }| Rect { x0, y0, x1, y1 };
    let settings = Settings {
        width: wire.width,
        height: wire.height,
        crop: wire.crop.map(rect),
        filter,
        samples_per_pixel: wire.samples_per_pixel,
        max_depth: wire.max_depth,
        light_samples: per_depth("light_samples", wire.light_samples)?,
        indirect_samples: per_depth("indirect_samples", wire.indirect_samples)?,
        roulette_depth: wire.roulette_depth,
        seed: wire.seed,
    };
    settings.check()?;
    Ok(settings)
}

fn per_depth(field: &'static str, numbers: Vec<u32>) -> Result<PerDepth, InvalidJobSpec> {
    let count = numbers.len();
    if count > PER_DEPTH_MAX {
        return Err(InvalidJobSpec::PerDepthLength { field, count });
    }
    PerDepth::new(numbers).map_err(|problem| InvalidJobSpec::PerDepth { field, problem })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arbitrary;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn jobs_round_trip(spec in arbitrary::job_spec()) {
            prop_assert_eq!(JobSpec::try_from(v1::JobSpec::from(spec.clone())), Ok(spec));
        }
    }

    fn refusal(spoil: impl Fn(&mut v1::JobSpec)) -> String {
        let mut wire = v1::JobSpec::from(arbitrary::plain_job());
        spoil(&mut wire);
        JobSpec::try_from(wire).expect_err("it is spoilt").to_string()
    }

    #[test]
    fn what_is_wrong_is_refused_by_field() {
        let begins =
            |message: String, start: &str| assert!(message.starts_with(start), "{message}");
        begins(refusal(|job| job.scene = None), "scene: is missing");
        begins(refusal(|job| job.scene.as_mut().unwrap().hash.truncate(31)), "scene.hash: has 31");
        begins(refusal(|job| job.scene.as_mut().unwrap().entry.clear()), "scene.entry: has 0");
        begins(refusal(|job| job.camera.as_mut().unwrap().eye = None), "camera.eye: is missing");
        begins(refusal(|job| job.camera.as_mut().unwrap().vfov = f32::NAN), "camera.vfov: is not");
        begins(refusal(|job| job.camera.as_mut().unwrap().vfov = 180.0), "camera.vfov: is not b");
        begins(refusal(|job| job.settings.as_mut().unwrap().filter = 9), "settings.filter: 9");
        begins(refusal(|job| job.settings.as_mut().unwrap().width = 0), "settings.film.width: 0");
        let empty = |job: &mut v1::JobSpec| job.settings.as_mut().unwrap().light_samples.clear();
        begins(refusal(empty), "settings.light_samples: a list");
        let crop = Some(v1::Rect { x0: 4, y0: 0, x1: 3, y1: 1 });
        begins(refusal(|job| job.settings.as_mut().unwrap().crop = crop), "settings.crop: must");
    }

    #[test]
    fn a_granularity_that_exhausts_a_worker_is_refused() {
        let cut = |tile_side_pixels, samples_per_unit| {
            refusal(|job| {
                let settings = job.settings.as_mut().unwrap();
                (settings.width, settings.height) = (8192, 4096);
                settings.samples_per_pixel = 1 << 24;
                job.granularity = Some(v1::Granularity { tile_side_pixels, samples_per_unit });
            })
        };
        assert!(cut(0, 1).starts_with("granularity: tiles of 0"));
        assert!(cut(65, 1).starts_with("granularity: tiles of 65"));
        assert!(cut(16, 0).contains("0 samples"));
        assert!(cut(16, 1).contains("units"));
        assert!(cut(1, 1 << 24).contains("cells"));
    }
}
