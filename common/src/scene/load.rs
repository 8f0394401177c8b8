//! Reading scenes: a JSON scene file with its models, or an OBJ file alone.
//!
//! `load` reads through a [`FileSource`], so a scene on disk and a scene in a pack are read by the
//! same code. What comes out depends on the files alone. What is odd but can be rendered is a
//! warning; what cannot is a [`SceneError`] that names the file, the line and the remedy.

mod assembly;
mod framing;
mod json;
mod material;
mod mtl;
mod obj;
mod obj_survey;
mod polygon;
mod scene_file;
pub(in crate::scene) mod texture;
mod transform;
mod warnings;

use std::collections::BTreeMap;
use std::rc::Rc;

use assembly::{Assembly, Placement};
pub use framing::Bounds;
use material::{MaterialEntry, Override};
use mtl::MtlFile;
use obj::ObjModel;
use scene_file::{EnvironmentEntry, ModelEntry, SceneFile, default_settings};
use texture::{Role, TextureTable};
use transform::Transform;
use warnings::Warnings;

use super::camera::Camera;
pub use super::error::SceneError;
use super::error::{Place, nearest};
use super::files::{FileSource, ReadError, beside};
use super::{Environment, Material, Scene, Surface};
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

impl Loaded {
    /// The camera called `name`.
    ///
    /// # Errors
    /// If there is none; the error names the nearest.
    pub fn camera_named(&self, name: &str) -> Result<Camera, SceneError> {
        self.cameras.get(name).copied().ok_or_else(|| SceneError::UnknownName {
            place: Place::file("--camera"),
            kind: "camera",
            name: name.to_owned(),
            nearest: nearest(name, self.cameras.keys().map(String::as_str)),
        })
    }
}

/// Loads the scene called `entry`: a `.json` or an `.obj` file.
///
/// # Errors
/// Names the file, the line and what to do about it.
pub fn load(files: &dyn FileSource, entry: &str) -> Result<Loaded, SceneError> {
    let loader = Loader::new(files);
    match extension(entry).as_str() {
        "json" => loader.load_described(entry),
        "obj" => loader.load_alone(entry),
        _ => {
            files.read(entry)?;
            Err(SceneError::UnknownFormat { place: Place::file(entry), file: entry.to_owned() })
        }
    }
}

fn extension(name: &str) -> String {
    name.rsplit_once('.').map_or_else(String::new, |(_, extension)| extension.to_lowercase())
}

/// Gathers the parts of a scene.
struct Loader<'a> {
    files: &'a dyn FileSource,
    warnings: Warnings,
    assembly: Assembly,
    textures: TextureTable,
    materials: Vec<Material>,
    /// Scene materials by library (or model, if no library has them) and name.
    material_indices: BTreeMap<(String, String), u32>,
    overrides: BTreeMap<String, Override>,
    /// Names of all materials that some model or library has, for overrides.
    material_names: std::collections::BTreeSet<String>,
    models: BTreeMap<String, Rc<ObjModel>>,
    libraries: BTreeMap<String, Rc<MtlFile>>,
}

/// The libraries of a model with their names, the last one first.
type Libraries = Vec<(String, Rc<MtlFile>)>;

impl<'a> Loader<'a> {
    fn new(files: &'a dyn FileSource) -> Self {
        Self {
            files,
            warnings: Warnings::default(),
            assembly: Assembly::default(),
            textures: TextureTable::default(),
            materials: Vec::new(),
            material_indices: BTreeMap::new(),
            overrides: BTreeMap::new(),
            material_names: std::collections::BTreeSet::new(),
            models: BTreeMap::new(),
            libraries: BTreeMap::new(),
        }
    }

    fn load_described(mut self, entry: &str) -> Result<Loaded, SceneError> {
        let bytes = self.files.read(entry)?;
        let text = std::str::from_utf8(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes))
            .map_err(|error| not_utf8(entry, &bytes[..error.valid_up_to()]))?;
        let file = SceneFile::read(entry, text)?;
        self.overrides = file.materials;
        for model in &file.models {
            self.add_model(entry, model)?;
        }
        self.check_overrides()?;
        let environment = self.environment(file.environment)?;
        self.check_not_empty(entry)?;
        let mut loaded = self.finish(file.camera, file.settings);
        loaded.cameras = file.cameras;
        loaded.scene.environment = environment;
        if loaded.light_object_count == 0 && loaded.scene.environment == Environment::Black {
            loaded.warnings.push(format!("{entry}: there is no light, so the image will be black"));
        }
        Ok(loaded)
    }

    fn load_alone(mut self, entry: &str) -> Result<Loaded, SceneError> {
        let model = ModelEntry {
            file: entry.rsplit('/').next().unwrap_or(entry).to_owned(),
            place: Place::file(entry),
            transform: Transform::IDENTITY,
        };
        self.add_model(entry, &model)?;
        let bounds = self.check_not_empty(entry)?;
        let settings = default_settings();
        let mut loaded = self.finish(framing::frame(&bounds, &settings), settings);
        if loaded.light_object_count == 0 {
            loaded.scene.environment = framing::sky();
        }
        Ok(loaded)
    }

    fn add_model(&mut self, entry: &str, model: &ModelEntry) -> Result<(), SceneError> {
        if extension(&model.file) != "obj" {
            let (place, file) = (model.place.clone(), model.file.clone());
            return Err(SceneError::UnknownFormat { place, file });
        }
        let file = beside(entry, &model.file);
        let obj = self.model(&file, &model.place)?;
        let libraries = self.libraries_of(&file, &obj)?;
        let mut materials = Vec::with_capacity(obj.materials.len());
        for (name, line) in &obj.materials {
            materials.push(self.material(&file, name, *line, &libraries)?);
        }
        let names_none = obj.triangles.iter().any(|t| t.material == super::NO_INDEX);
        let default_material =
            if names_none { self.material(&file, "default", None, &Vec::new())? } else { 0 };
        let placement = Placement {
            file: &file,
            model: &obj,
            transform: model.transform,
            materials: &materials,
            default_material,
        };
        self.assembly.add(&placement, &mut self.warnings)
    }

    fn model(&mut self, file: &str, place: &Place) -> Result<Rc<ObjModel>, SceneError> {
        if let Some(model) = self.models.get(file) {
            return Ok(Rc::clone(model));
        }
        let bytes = self.files.read(file).map_err(|cause| match place.line {
            Some(_) => SceneError::Unreachable { place: place.clone(), cause },
            None => SceneError::Unreadable(cause),
        })?;
        let model = Rc::new(ObjModel::read(file, &bytes)?);
        self.models.insert(file.to_owned(), Rc::clone(&model));
        Ok(model)
    }

    fn libraries_of(&mut self, file: &str, obj: &ObjModel) -> Result<Libraries, SceneError> {
        let mut libraries = Vec::new();
        for (names, line) in &obj.libraries {
            for name in self.library_names(file, names) {
                libraries.insert(0, (name.clone(), self.library(&name, file, *line)?));
            }
        }
        Ok(libraries)
    }

    /// A statement may name one file with spaces in its name, or several.
    fn library_names(&self, file: &str, names: &str) -> Vec<String> {
        let whole = beside(file, names);
        let is_one = !names.contains(char::is_whitespace)
            || self.libraries.contains_key(&whole)
            || self.files.read(&whole).is_ok();
        if is_one {
            return vec![whole];
        }
        names.split_whitespace().map(|name| beside(file, name)).collect()
    }

    fn library(&mut self, name: &str, obj: &str, line: usize) -> Result<Rc<MtlFile>, SceneError> {
        if let Some(library) = self.libraries.get(name) {
            return Ok(Rc::clone(library));
        }
        let bytes = self.files.read(name).map_err(|cause| match cause {
            ReadError::Missing { .. } => SceneError::Malformed {
                place: Place::line(obj, line),
                problem: format!(
                    "mtllib: {cause}; put the file there, or remove the line to render in grey"
                ),
            },
            cause => SceneError::Unreachable { place: Place::line(obj, line), cause },
        })?;
        let library = MtlFile::read(name, &obj::text_of(&bytes), &mut self.warnings)?;
        self.material_names.extend(library.names().map(str::to_owned));
        let library = Rc::new(library);
        self.libraries.insert(name.to_owned(), Rc::clone(&library));
        Ok(library)
    }

    /// The index of a model's material in the scene; `line` names it, if any does.
    fn material(
        &mut self,
        file: &str,
        name: &str,
        line: Option<usize>,
        libraries: &Libraries,
    ) -> Result<u32, SceneError> {
        let found = libraries.iter().find_map(|(library, mtl)| Some((library, mtl.get(name)?)));
        let home = found.map_or(file, |(library, _)| library);
        let key = (home.to_owned(), name.to_owned());
        if let Some(&index) = self.material_indices.get(&key) {
            return Ok(index);
        }
        self.material_names.insert(name.to_owned());
        let change = self.overrides.get(name);
        let mut entry = match found {
            Some((_, mtl)) => MaterialEntry::from_mtl(mtl, &mut self.warnings),
            None => {
                if let (Some(line), None) = (line, change) {
                    let place = Place::line(file, line);
                    let problem = "is in no material library and is rendered grey";
                    self.warnings.push(format!("{place}: material \"{name}\" {problem}"));
                }
                MaterialEntry::grey(name)
            }
        };
        if let Some(change) = change {
            entry.change(change, &mut self.warnings);
        }
        let index = self.add_material(entry)?;
        self.material_indices.insert(key, index);
        Ok(index)
    }

    fn add_material(&mut self, mut entry: MaterialEntry) -> Result<u32, SceneError> {
        if let Some(reference) = &entry.texture {
            let (files, role) = (self.files, Role::Reflectance);
            let index = self.textures.index_of(files, reference, role, &mut self.warnings)?;
            match &mut entry.material.surface {
                Surface::Plain { diffuse_texture, .. } => *diffuse_texture = Some(index),
                Surface::Pbr { base_texture, .. } => *base_texture = Some(index),
                Surface::Mirror { .. } | Surface::Glass { .. } => {}
            }
        }
        self.materials.push(entry.material);
        u32::try_from(self.materials.len() - 1).map_err(|_| SceneError::TooLarge {
            place: Place::file("scene"),
            problem: "too many materials".into(),
        })
    }

    fn check_overrides(&self) -> Result<(), SceneError> {
        for (name, change) in &self.overrides {
            if !self.material_names.contains(name) {
                return Err(SceneError::UnknownName {
                    place: change.place.clone(),
                    kind: "material",
                    name: name.clone(),
                    nearest: nearest(name, self.material_names.iter().map(String::as_str)),
                });
            }
        }
        Ok(())
    }

    fn environment(&mut self, entry: EnvironmentEntry) -> Result<Environment, SceneError> {
        Ok(match entry {
            EnvironmentEntry::Black => Environment::Black,
            EnvironmentEntry::Constant { radiance } => Environment::Constant { radiance },
            EnvironmentEntry::Image { image, scale, rotation } => {
                let (files, role) = (self.files, Role::Radiance);
                let texture = self.textures.index_of(files, &image, role, &mut self.warnings)?;
                Environment::Image { texture, scale, rotation }
            }
        })
    }

    fn check_not_empty(&self, entry: &str) -> Result<Bounds, SceneError> {
        Bounds::of(&self.assembly.geometry).ok_or_else(|| SceneError::Empty {
            place: Place::file(entry),
            problem: "no triangle is left to render: all are degenerate or have bad vertices"
                .to_owned(),
        })
    }

    fn finish(mut self, camera: Camera, settings: Settings) -> Loaded {
        let degenerate_count = self.assembly.degenerate_count;
        if degenerate_count > 0 {
            self.warnings.push(format!("{degenerate_count} degenerate triangles are left out"));
        }
        let scene = Scene {
            geometry: self.assembly.geometry,
            materials: self.materials,
            textures: self.textures.into_textures(),
            environment: Environment::Black,
        };
        Loaded {
            light_object_count: light_object_count(&scene),
            scene,
            camera,
            cameras: BTreeMap::new(),
            settings,
            warnings: self.warnings.into_messages(),
            degenerate_count,
        }
    }
}

fn light_object_count(scene: &Scene) -> usize {
    let emits: Vec<bool> =
        scene.materials.iter().map(|material| material.emission != [0.0; 3]).collect();
    let triangles = |object: &super::Object| {
        let first = object.first_triangle as usize;
        &scene.geometry.triangles[first..first + object.triangle_count as usize]
    };
    let objects = scene.geometry.objects.iter();
    objects.filter(|object| triangles(object).iter().any(|t| emits[t.material as usize])).count()
}

fn not_utf8(file: &str, valid: &[u8]) -> SceneError {
    let line = 1 + valid.iter().filter(|&&byte| byte == b'\n').count();
    SceneError::Malformed {
        place: Place::line(file, line),
        problem: "is not valid UTF-8; save the file as UTF-8".into(),
    }
}

#[cfg(test)]
mod tests;
