//! A job: one image to render. What it is does not depend on who renders it.

use serde::{Deserialize, Serialize};

use crate::ids::JobId;
use crate::scene::camera::Camera;
use crate::unit::{Granularity, Rect, UnitGrid};

/// Largest width or height of an image in pixels.
pub const SIDE_PIXELS_MAX: u32 = 65_536;

/// Most pixels of an image: a little more than 8K. Film and layers then take some 11 GiB while the
/// image is encoded.
pub const IMAGE_PIXELS_MAX: u64 = 1 << 25;

/// Most samples per pixel.
pub const SAMPLES_MAX: u32 = 1 << 24;

/// Most path segments.
pub const DEPTH_MAX: u32 = 1024;

/// Most rays of one kind spawned at one hit.
pub const SPLIT_MAX: u32 = 1024;

/// How camera samples are spread about a pixel's center. All have weight 1: the filter is drawn
/// from, so that a sample touches its own pixel alone (Ernst et al. 2006, filter importance
/// sampling).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Filter {
    /// Evenly over the pixel.
    #[default]
    Box,
    /// A tent of radius 1 pixel.
    Tent,
    /// A Gaussian of standard deviation ½ pixel, cut at 2 pixels.
    Gaussian,
}

/// A number for each depth; the last one holds for all deeper ones.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "Vec<u32>", into = "Vec<u32>")]
pub struct PerDepth(Vec<u32>);

/// A list that gives no number for any depth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a list of counts per depth must not be empty, and each at most {SPLIT_MAX}")]
pub struct InvalidPerDepth;

impl PerDepth {
    /// Takes the numbers of depth 0, 1, ….
    ///
    /// # Errors
    /// If there is none, or one exceeds [`SPLIT_MAX`].
    pub fn new(numbers: Vec<u32>) -> Result<Self, InvalidPerDepth> {
        if numbers.is_empty() || numbers.iter().any(|&number| number > SPLIT_MAX) {
            return Err(InvalidPerDepth);
        }
        Ok(Self(numbers))
    }

    /// The number at `depth`.
    #[must_use]
    pub fn at(&self, depth: usize) -> u32 {
        self.0[depth.min(self.0.len() - 1)]
    }

    /// The numbers as given.
    #[must_use]
    pub fn as_slice(&self) -> &[u32] {
        &self.0
    }
}

impl TryFrom<Vec<u32>> for PerDepth {
    type Error = InvalidPerDepth;

    fn try_from(numbers: Vec<u32>) -> Result<Self, InvalidPerDepth> {
        Self::new(numbers)
    }
}

impl From<PerDepth> for Vec<u32> {
    fn from(numbers: PerDepth) -> Self {
        numbers.0
    }
}

impl Default for PerDepth {
    fn default() -> Self {
        Self(vec![1])
    }
}

/// How to render: everything of a job but the scene. Checked by [`Settings::check`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// Width of the full image in pixels.
    pub width: u32,
    /// Height of the full image in pixels.
    pub height: u32,
    /// The part that is rendered; the rest stays black.
    pub crop: Option<Rect>,
    /// Pixel filter.
    pub filter: Filter,
    /// Camera samples per pixel.
    pub samples_per_pixel: u32,
    /// Most path segments from the camera to a light: 1 shows emitters only, 2 adds direct light.
    pub max_depth: u32,
    /// The paper's n: shadow rays at a hit, by its depth.
    pub light_samples: PerDepth,
    /// The paper's m: indirect rays at a hit, by its depth.
    pub indirect_samples: PerDepth,
    /// Depth from which Russian roulette ends paths of low throughput; none: never.
    pub roulette_depth: Option<u32>,
    /// Names the random numbers.
    pub seed: u64,
}

/// Settings that cannot be rendered.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{field}: {problem}")]
pub struct InvalidSettings {
    /// The field, as the scene file names it.
    pub field: &'static str,
    /// What is wrong and what to do.
    pub problem: String,
}

impl Settings {
    /// The pixels that are rendered.
    #[must_use]
    pub fn region(&self) -> Rect {
        self.crop.unwrap_or(Rect { x0: 0, y0: 0, x1: self.width, y1: self.height })
    }

    /// Makes sure that everything is within its limits.
    ///
    /// # Errors
    /// Names the first field that is not.
    pub fn check(&self) -> Result<(), InvalidSettings> {
        let invalid = |field, problem: String| Err(InvalidSettings { field, problem });
        for (field, side) in [("film.width", self.width), ("film.height", self.height)] {
            if !(1..=SIDE_PIXELS_MAX).contains(&side) {
                return invalid(field, format!("{side} is not from 1 to {SIDE_PIXELS_MAX} pixels"));
            }
        }
        let pixels = u64::from(self.width) * u64::from(self.height);
        if pixels > IMAGE_PIXELS_MAX {
            let problem =
                format!("{pixels} pixels are more than {IMAGE_PIXELS_MAX}; render smaller");
            return invalid("film", problem);
        }
        if let Some(crop) = self.crop
            && !(crop.x0 < crop.x1
                && crop.x1 <= self.width
                && crop.y0 < crop.y1
                && crop.y1 <= self.height)
        {
            return invalid(
                "crop",
                "must be x0,y0,x1,y1 with x0 < x1 and y0 < y1 within the image".into(),
            );
        }
        if !(1..=SAMPLES_MAX).contains(&self.samples_per_pixel) {
            let problem = format!("{} is not from 1 to {SAMPLES_MAX}", self.samples_per_pixel);
            return invalid("integrator.spp", problem);
        }
        if !(1..=DEPTH_MAX).contains(&self.max_depth) {
            let problem = format!("{} is not from 1 to {DEPTH_MAX}", self.max_depth);
            return invalid("integrator.max_depth", problem);
        }
        Ok(())
    }
}

/// Where a job's scene is found: in a pack of files, named by what it holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SceneRef {
    /// BLAKE3 hash of the pack.
    pub hash: [u8; 32],
    /// Size of the pack.
    pub pack_bytes: u64,
    /// Path of the scene file in the pack.
    pub entry: String,
}

/// Everything a worker must know to take part in a job.
#[derive(Clone, Debug, PartialEq)]
pub struct JobSpec {
    /// Its number.
    pub id: JobId,
    /// Its scene.
    pub scene: SceneRef,
    /// Its camera.
    pub camera: Camera,
    /// How to render.
    pub settings: Settings,
    /// How finely it is cut.
    pub granularity: Granularity,
}

impl JobSpec {
    /// How many units the job has.
    #[must_use]
    pub fn unit_count(&self) -> u32 {
        self.granularity.unit_count(self.settings.region(), self.settings.samples_per_pixel)
    }

    /// The job's units.
    #[must_use]
    pub fn grid(&self) -> UnitGrid {
        let settings = &self.settings;
        UnitGrid::new(
            settings.width,
            settings.region(),
            settings.samples_per_pixel,
            self.granularity,
        )
    }
}
