//! The manifest: what a store holds, and the names and hashes of its files.
//!
//! It is JSON, a line per table entry and partition, so that people can read it; camera and
//! settings may well be edited. Every number comes back to the bit. Since it has the hashes of all
//! other files, its own hash names the store.

mod json;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use blake3::Hash;
use equilux_common::job::Settings;
use equilux_common::scene::camera::Camera;
use equilux_common::scene::files::{FileSource, ReadError, is_absolute, normalize};
use equilux_common::scene::{Environment, Material, Surface};
use equilux_render::geometry::{Bounds, COORDINATE_MAX, PARTITION_BOXES_MAX};
use serde::{Deserialize, Serialize};

use crate::error::StoreError;

/// The version of the manifest and of what it refers to.
pub const STORE_VERSION: u32 = 3;

/// The key with the version; the first of the manifest.
const VERSION_KEY: &str = "\"equilux_store\"";

/// How far from its beginning a manifest must have that key.
const PEEK_BYTES: u64 = 64;

/// What a store holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// [`STORE_VERSION`].
    #[serde(rename = "equilux_store")]
    pub version: u32,
    /// Triangles in all partitions, those of models that are placed several times counted at each
    /// place; their primitive ids are below it.
    pub triangle_count: u64,
    /// Bounds of all triangles; a point at zero if there is none.
    #[serde(with = "json::corners")]
    pub bounds: Bounds,
    /// The camera that is used unless another one is asked for.
    pub camera: Camera,
    /// More cameras by name.
    pub cameras: BTreeMap<String, Camera>,
    /// How to render unless told otherwise.
    pub settings: Settings,
    /// Materials, by the numbers in triangles.
    pub materials: Vec<Material>,
    /// Light from everywhere.
    pub environment: Environment,
    /// Textures, by the numbers in materials.
    pub textures: Vec<TextureEntry>,
    /// The triangles that emit.
    pub luminaires: LuminairesEntry,
    /// The partitions, by their number.
    pub partitions: Vec<PartitionEntry>,
}

/// A file of a store.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FileEntry {
    /// Relative to the manifest, with `/` between the parts.
    pub name: String,
    /// BLAKE3 of all of it.
    #[serde(with = "json::hex")]
    pub hash: Hash,
    /// Its length.
    pub bytes: u64,
}

/// A texture; its file has the texels row by row, the top row first.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TextureEntry {
    /// What the scene calls it, for messages.
    pub name: String,
    /// Width in texels.
    pub width: u32,
    /// Height in texels.
    pub height: u32,
    /// What a texel is.
    pub kind: TexelKind,
    /// Where they are.
    pub file: FileEntry,
}

/// What a texel is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TexelKind {
    /// Three bytes with the sRGB transfer curve.
    Srgb8,
    /// Three little-endian floats, linear.
    Linear,
}

/// The triangles that emit.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LuminairesEntry {
    /// How many there are.
    pub count: u64,
    /// Where they are.
    pub file: FileEntry,
}

/// A partition.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PartitionEntry {
    /// How many triangles it has; there may be none.
    pub triangle_count: u64,
    /// How many it has where those of models that are placed several times are counted at each
    /// place.
    pub placed_count: u64,
    /// Memory that it takes.
    pub memory_bytes: u64,
    /// Where it is.
    pub file: FileEntry,
    /// At most [`PARTITION_BOXES_MAX`] boxes that hold all of it, tighter than one; none if it is
    /// empty.
    #[serde(with = "json::boxes")]
    pub boxes: Vec<Bounds>,
}

impl Manifest {
    /// Takes the manifest called `name`.
    ///
    /// # Errors
    /// If it is none, of another version, or makes no sense.
    pub fn from_json(name: &str, bytes: &[u8]) -> Result<Self, StoreError> {
        #[derive(Deserialize)]
        struct Versioned {
            equilux_store: Option<u32>,
        }
        let file = || name.to_owned();
        let malformed = |error: serde_json::Error| StoreError::Malformed {
            file: format!("{name}:{}", error.line()),
            problem: format!("{error}; build the store again"),
        };
        let Versioned { equilux_store } = serde_json::from_slice(bytes).map_err(malformed)?;
        let known = STORE_VERSION;
        match equilux_store {
            None => return Err(StoreError::Foreign { file: file(), kind: "a store's manifest" }),
            Some(found) if found != known => {
                return Err(StoreError::OtherVersion { file: file(), found, known });
            }
            Some(_) => {}
        }
        let manifest: Self = serde_json::from_slice(bytes).map_err(malformed)?;
        manifest.check().map_err(|problem| StoreError::Malformed { file: file(), problem })?;
        Ok(manifest)
    }

    /// The manifest as it is written.
    ///
    /// # Panics
    /// If a name cannot be written; all can.
    #[must_use]
    pub fn to_json(&self) -> Vec<u8> {
        json::write(self).expect("it has no keys but strings, and memory takes all bytes")
    }

    /// Triangles that are kept, those of models that are placed several times counted once, or once
    /// for each partition that some of their places are in.
    #[must_use]
    pub fn kept_count(&self) -> u64 {
        self.partitions.iter().map(|partition| partition.triangle_count).sum()
    }

    /// Bytes of all partitions' files.
    #[must_use]
    pub fn partition_bytes(&self) -> u64 {
        self.partitions.iter().map(|partition| partition.file.bytes).sum()
    }

    /// Bytes of all files but the manifest.
    #[must_use]
    pub fn file_bytes(&self) -> u64 {
        let textures: u64 = self.textures.iter().map(|texture| texture.file.bytes).sum();
        self.partition_bytes() + textures + self.luminaires.file.bytes
    }

    /// What is wrong, and where.
    fn check(&self) -> Result<(), String> {
        self.check_names()?;
        self.check_tables()?;
        self.check_cameras()?;
        self.settings.check().map_err(|error| format!("settings: {error}"))?;
        if !is_valid(&self.bounds) {
            return Err(format!("bounds: not within ±{COORDINATE_MAX}, least corner first"));
        }
        let counts = self.partitions.iter().map(|partition| partition.placed_count);
        let count = counts.fold(0, u64::saturating_add);
        if count != self.triangle_count {
            let all = self.triangle_count;
            return Err(format!("partitions: they have {count} triangles, the model has {all}"));
        }
        let boxes = |entry: &PartitionEntry| {
            entry.boxes.len() <= PARTITION_BOXES_MAX && entry.boxes.iter().all(is_valid)
        };
        match self.partitions.iter().position(|entry| !boxes(entry)) {
            Some(at) => Err(format!("partitions[{at}].boxes: too many, or least corner not first")),
            None => Ok(()),
        }
    }

    /// No file of a store lies outside of its directory.
    fn check_names(&self) -> Result<(), String> {
        let textures = self.textures.iter().map(|texture| &texture.file.name);
        let partitions = self.partitions.iter().map(|partition| &partition.file.name);
        let mut names = textures.chain(partitions).chain([&self.luminaires.file.name]);
        let leads_out = |name: &&String| {
            is_absolute(name) || normalize(name) != **name || name.starts_with("..")
        };
        match names.find(leads_out) {
            Some(name) => Err(format!("\"{name}\" is no name of a file in the store")),
            None => Ok(()),
        }
    }

    fn check_tables(&self) -> Result<(), String> {
        for (at, texture) in self.textures.iter().enumerate() {
            let texel_bytes = if texture.kind == TexelKind::Srgb8 { 3 } else { 12 };
            let texels = u64::from(texture.width) * u64::from(texture.height);
            if texels == 0 || texels.checked_mul(texel_bytes) != Some(texture.file.bytes) {
                return Err(format!("textures[{at}]: its size does not fit its file"));
            }
        }
        let image = match self.environment {
            Environment::Image { texture, .. } => Some(texture),
            Environment::Black | Environment::Constant { .. } => None,
        };
        let textures = self.materials.iter().map(|material| texture_of(&material.surface));
        if let Some(texture) = textures.chain([image]).flatten().find(|it| !self.has_texture(*it)) {
            return Err(format!("there is no texture {texture}"));
        }
        let kind = |texture: u32| self.textures[texture as usize].kind;
        if image.is_some_and(|texture| kind(texture) != TexelKind::Linear) {
            return Err("environment: its image is not linear".into());
        }
        Ok(())
    }

    fn has_texture(&self, texture: u32) -> bool {
        (texture as usize) < self.textures.len()
    }

    fn check_cameras(&self) -> Result<(), String> {
        let is_finite = |camera: &Camera| {
            let Camera { eye, target, up, vfov, aperture, focus_distance } = camera;
            let vectors = [eye, target, up].into_iter().flatten();
            vectors.chain([vfov, aperture, focus_distance]).all(|number| number.is_finite())
        };
        let mut cameras = [("camera", &self.camera)]
            .into_iter()
            .chain(self.cameras.iter().map(|(name, camera)| (name.as_str(), camera)));
        match cameras.find(|(_, camera)| !is_finite(camera)) {
            Some((name, _)) => Err(format!("{name}: a number is too large")),
            None => Ok(()),
        }
    }
}

impl FileEntry {
    /// Makes sure that these are the bytes that were written; `name` is for messages.
    ///
    /// # Errors
    /// If they are others.
    pub fn check(&self, name: &str, bytes: &[u8]) -> Result<(), StoreError> {
        let (found, expected) = (bytes.len() as u64, self.bytes);
        if found != expected {
            return Err(StoreError::WrongLength { file: name.to_owned(), found, expected });
        }
        if blake3::hash(bytes) != self.hash {
            return Err(StoreError::Damaged { file: name.to_owned() });
        }
        Ok(())
    }
}

/// Whether a file begins as the manifest of some version does.
pub(crate) fn begins(path: &Path) -> bool {
    let mut beginning = Vec::new();
    let is_read =
        File::open(path).and_then(|file| file.take(PEEK_BYTES).read_to_end(&mut beginning));
    is_read.is_ok() && is_begun_by(&beginning)
}

/// Whether a file among others begins as the manifest of some version does.
pub(crate) fn begins_in(files: &dyn FileSource, entry: &str) -> Result<bool, ReadError> {
    let file = files.large(entry)?;
    let mut beginning = vec![0; file.byte_count().min(PEEK_BYTES) as usize];
    file.open()?.read_at(0, &mut beginning)?;
    Ok(is_begun_by(&beginning))
}

/// Whether these bytes begin as the manifest of some version does.
pub(crate) fn is_begun_by(bytes: &[u8]) -> bool {
    let beginning = &bytes[..bytes.len().min(PEEK_BYTES as usize)];
    String::from_utf8_lossy(beginning).contains(VERSION_KEY)
}

const fn texture_of(surface: &Surface) -> Option<u32> {
    match surface {
        Surface::Plain { diffuse_texture, .. } => *diffuse_texture,
        Surface::Pbr { base_texture, .. } => *base_texture,
        Surface::Mirror { .. } | Surface::Glass { .. } => None,
    }
}

fn is_valid(bounds: &Bounds) -> bool {
    let Bounds { lower, upper } = bounds;
    let size = lower.abs().max(upper.abs());
    lower.cmple(*upper).all() && size.cmple(glam::Vec3::splat(COORDINATE_MAX)).all()
}
