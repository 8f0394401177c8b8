//! Reading scenes: a JSON scene file with its models, or a model alone.
//!
//! `load` reads through a [`FileSource`], so a scene on disk and a scene in a pack are read by the
//! same code. What comes out depends on the files alone. What is odd but can be rendered is a
//! warning; what cannot is a [`SceneError`] that names the file, the line and the remedy.

mod assembly;
mod framing;
mod json;
mod judging;
mod material;
mod materials;
mod mesh;
mod mtl;
mod obj;
mod obj_reader;
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

use assembly::{Assembly, Placement, TABLE_ENTRIES_MAX, table_lengths};
pub use framing::Bounds;
use materials::ModelMaterials;
use mesh::{MaterialNames, Mesh};
use ply::PlyFile;
use setting::{Admission, ModelFormat, Setting, Stage};
use warnings::Warnings;

use super::camera::Camera;
pub use super::error::SceneError;
use super::error::{Place, nearest};
use super::files::FileSource;
use super::placing::{COORDINATE_MAX, Placing, Transform};
use super::triangles::TRIANGLES_MAX;
use super::{Geometry, Prototype, Scene, Tables};
use crate::job::Settings;

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
    let InMemory { assembly, prototypes, .. } = stage;
    let Assembly { geometry, degenerate_count, .. } = assembly;
    let bounds = Bounds::of(&geometry, &prototypes).ok_or_else(|| nothing_left(entry))?;
    let lights = |geometry: &Geometry| light_object_count(geometry, &setting.tables);
    let placed_lights = prototypes.iter().map(|it| lights(&it.geometry) * it.placings.len());
    let light_object_count = lights(&geometry) + placed_lights.sum::<usize>();
    setting.warnings.extend(warnings::degenerate(degenerate_count));
    setting.complete(entry, &bounds, light_object_count > 0);
    let Setting { tables, camera, cameras, settings, warnings, .. } = setting;
    let scene = Scene { geometry, prototypes, tables };
    check_count(entry, "triangles", scene.triangle_count(), TRIANGLES_MAX)?;
    check_count(entry, "luminaires", scene.luminaire_count(), TABLE_ENTRIES_MAX as u64)?;
    Ok(Loaded {
        scene,
        camera,
        cameras,
        settings,
        warnings: warnings.into_messages(),
        light_object_count,
        degenerate_count: usize::try_from(degenerate_count).unwrap_or(usize::MAX),
    })
}

/// Refuses more things, counted at each place, than can be named or kept.
fn check_count(entry: &str, what: &str, count: u64, most: u64) -> Result<(), SceneError> {
    if count <= most {
        return Ok(());
    }
    Err(SceneError::TooLarge {
        place: Place::file(entry),
        problem: format!(
            "the scene has {count} {what} at all its places, more than {most}; leave some out"
        ),
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
    prototypes: Vec<Prototype>,
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

    fn place_prototype(
        &mut self,
        file: &str,
        placings: Vec<Placing>,
        materials: ModelMaterials,
        warnings: &mut Warnings,
    ) -> Result<(), SceneError> {
        let mesh = Rc::clone(&self.meshes[file]);
        let placing = Placing::new(Transform::IDENTITY);
        let (here, elsewhere) = (table_lengths(&self.assembly.geometry), self.assembly.elsewhere);
        let elsewhere = std::array::from_fn(|table| here[table] + elsewhere[table]);
        let mut assembly = Assembly { elsewhere, ..Assembly::default() };
        assembly.add(&Placement { file, mesh: &mesh, placing, materials }, warnings)?;
        let Assembly { geometry, degenerate_count, .. } = assembly;
        self.assembly.degenerate_count += degenerate_count;
        let lengths = table_lengths(&geometry);
        for (all, more) in self.assembly.elsewhere.iter_mut().zip(lengths) {
            *all += more;
        }
        let Some(bounds) = Bounds::of(&geometry, &[]) else { return Ok(()) };
        check_placings(file, &bounds, &placings)?;
        self.prototypes.push(Prototype { geometry, placings });
        Ok(())
    }
}

/// Refuses placings that would have corners where nothing can be worked with.
fn check_placings(file: &str, bounds: &Bounds, placings: &[Placing]) -> Result<(), SceneError> {
    let is_within = |placing: &Placing| {
        let corners = placing.around([bounds.min, bounds.max]);
        corners.as_flattened().iter().all(|x| f64::from(x.abs()) <= COORDINATE_MAX)
    };
    match placings.iter().position(|placing| !is_within(placing)) {
        None => Ok(()),
        Some(number) => Err(SceneError::TooLarge {
            place: Place::file(file),
            problem: format!(
                "the transform of its placing number {} takes it beyond {COORDINATE_MAX:e}; \
                 check its numbers",
                number + 1
            ),
        }),
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
