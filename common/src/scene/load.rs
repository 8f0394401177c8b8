//! Reading scenes: a JSON scene file with its models, or a model alone.
//!
//! `load` reads through a [`FileSource`], so a scene on disk and a scene in a pack are read by the
//! same code. What comes out depends on the files alone. What is odd but can be rendered is a
//! warning; what cannot is a [`SceneError`] that names the file, the line and the remedy.

mod assembly;
mod framing;
mod json;
mod material;
mod materials;
mod mesh;
mod mtl;
mod obj;
mod obj_reader;
mod placing;
mod ply;
mod polygon;
mod scene_file;
mod setting;
pub mod stream;
pub(in crate::scene) mod texture;
mod transform;
mod warnings;

use std::collections::BTreeMap;
use std::rc::Rc;

use assembly::{Assembly, Placement};
pub use framing::Bounds;
use materials::ModelMaterials;
use mesh::{MaterialNames, Mesh};
use placing::Placing;
use ply::PlyFile;
use setting::{Admission, ModelFormat, Setting, Stage};
use warnings::Warnings;

use super::camera::Camera;
pub use super::error::SceneError;
use super::error::{Place, nearest};
use super::files::FileSource;
use super::{Geometry, Scene, Tables};
use crate::job::Settings;

/// Largest coordinate: products of four such lengths still fit single precision, with room.
pub const COORDINATE_MAX: f64 = 1e9;

/// A scene with everything that its files say.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// What is rendered.
    pub scene: Scene,
    /// The camera that is used unless another one is asked for.
    pub camera: Camera,
    /// More cameras by name.
    pub cameras: BTreeMap<String, Camera>,
    /// How to render unless told otherwise.
    pub settings: Settings,
    /// What is odd about the files, for the user.
    pub warnings: Vec<String>,
    /// How many objects have at least one triangle that emits.
    pub light_object_count: usize,
    /// How many triangles were dropped because they have no area.
    pub degenerate_count: usize,
}

/// The camera called `name` among those of a scene.
///
/// # Errors
/// If there is none; the error names the nearest.
pub fn camera_named(cameras: &BTreeMap<String, Camera>, name: &str) -> Result<Camera, SceneError> {
    cameras.get(name).copied().ok_or_else(|| SceneError::UnknownName {
        place: Place::file("--camera"),
        kind: "camera",
        name: name.to_owned(),
        nearest: nearest(name, cameras.keys().map(String::as_str)),
    })
}

/// Loads the scene called `entry`: a `.json`, an `.obj` or a `.ply` file.
///
/// # Errors
/// Names the file, the line and what to do about it.
pub fn load(files: &dyn FileSource, entry: &str) -> Result<Loaded, SceneError> {
    let mut stage = InMemory::default();
    let mut setting = Setting::gather(files, entry, &mut stage)?;
    let InMemory { assembly: Assembly { geometry, degenerate_count }, .. } = stage;
    let bounds = Bounds::of(&geometry).ok_or_else(|| nothing_left(entry))?;
    setting.warnings.extend(warnings::degenerate(degenerate_count));
    let light_object_count = light_object_count(&geometry, &setting.tables);
    setting.complete(entry, &bounds, light_object_count > 0);
    let Setting { tables, camera, cameras, settings, warnings, .. } = setting;
    Ok(Loaded {
        scene: Scene { geometry, tables },
        camera,
        cameras,
        settings,
        warnings: warnings.into_messages(),
        light_object_count,
        degenerate_count: usize::try_from(degenerate_count).unwrap_or(usize::MAX),
    })
}

/// Says that there is no triangle in the scene called `entry`.
fn nothing_left(entry: &str) -> SceneError {
    SceneError::Empty {
        place: Place::file(entry),
        problem: "no triangle is left to render: all are degenerate or have bad vertices".into(),
    }
}

/// Puts models together in memory.
#[derive(Default)]
struct InMemory {
    meshes: BTreeMap<String, Rc<Mesh>>,
    assembly: Assembly,
}

impl Stage for InMemory {
    fn admit(&mut self, model: &Admission<'_>) -> Result<MaterialNames, SceneError> {
        if let Some(mesh) = self.meshes.get(model.file) {
            return Ok(mesh.materials.clone());
        }
        let large = model.large()?;
        let mesh = match model.format {
            ModelFormat::Obj => obj::read(&large)?,
            ModelFormat::Ply => PlyFile::new(large)?.read()?,
        };
        let names = mesh.materials.clone();
        self.meshes.insert(model.file.to_owned(), Rc::new(mesh));
        Ok(names)
    }

    fn place(
        &mut self,
        file: &str,
        placing: Placing,
        materials: ModelMaterials,
        warnings: &mut Warnings,
    ) -> Result<(), SceneError> {
        let mesh = Rc::clone(&self.meshes[file]);
        self.assembly.add(&Placement { file, mesh: &mesh, placing, materials }, warnings)
    }
}

fn light_object_count(geometry: &Geometry, tables: &Tables) -> usize {
    let triangles = |object: &super::Object| {
        let first = object.first_triangle as usize;
        &geometry.triangles[first..first + object.triangle_count as usize]
    };
    let objects = geometry.objects.iter();
    objects
        .filter(|object| triangles(object).iter().any(|t| tables.is_luminous(t.material)))
        .count()
}

/// Which materials emit.
fn emits(tables: &Tables) -> Vec<bool> {
    tables.materials.iter().map(|material| material.emission != [0.0; 3]).collect()
}

#[cfg(test)]
mod tests;
