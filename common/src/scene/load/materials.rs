//! The materials of a scene as its models come to need them, and the textures of these.
//!
//! A material is looked up by its name in the libraries of the model that uses it, is grey where no
//! library has it, and then is changed by what the scene file says of that name.

use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

use super::material::{MaterialEntry, Override};
use super::mesh::MaterialNames;
use super::mtl::MtlFile;
use super::obj;
use super::scene_file::{EnvironmentEntry, NamedMaterial};
use super::texture::{Role, TextureTable};
use super::warnings::Warnings;
use crate::scene::error::{Place, SceneError, nearest};
use crate::scene::files::{FileSource, ReadError, beside};
use crate::scene::{Environment, Material, Surface, Tables};

/// Name of the material of faces that name none.
const DEFAULT_MATERIAL: &str = "default";

/// Gathers the materials and textures of a scene.
pub(super) struct MaterialTable<'a> {
    files: &'a dyn FileSource,
    textures: TextureTable,
    materials: Vec<Material>,
    /// Scene materials by library (or file that names them, if no library has them) and name.
    indices: BTreeMap<(String, String), u32>,
    overrides: BTreeMap<String, Override>,
    /// Names of all materials that some model or library has, for overrides.
    names: BTreeSet<String>,
    libraries: BTreeMap<String, Rc<MtlFile>>,
}

/// The libraries of a model with their names, the last one first.
type Libraries = Vec<(String, Rc<MtlFile>)>;

/// The scene materials of a model.
#[derive(Clone, Debug)]
pub(super) struct ModelMaterials {
    /// By the model's material numbers.
    named: Vec<u32>,
    /// Of faces that name none.
    default: u32,
}

impl ModelMaterials {
    /// The same for all faces.
    #[cfg(test)]
    pub(super) const fn uniform(material: u32) -> Self {
        Self { named: Vec::new(), default: material }
    }

    /// The scene material of the model's material; none is [`NO_INDEX`](crate::scene::NO_INDEX).
    pub(super) fn of(&self, material: u32) -> u32 {
        self.named.get(material as usize).copied().unwrap_or(self.default)
    }
}

impl<'a> MaterialTable<'a> {
    /// No materials yet; `overrides` are what the scene file says about them.
    pub(super) fn new(files: &'a dyn FileSource, overrides: BTreeMap<String, Override>) -> Self {
        Self {
            files,
            textures: TextureTable::default(),
            materials: Vec::new(),
            indices: BTreeMap::new(),
            overrides,
            names: BTreeSet::new(),
            libraries: BTreeMap::new(),
        }
    }

    /// Adds the materials of the model called `file`; `unnamed` is the material that the scene file
    /// gives to faces that name none.
    pub(super) fn of_model(
        &mut self,
        file: &str,
        model: &MaterialNames,
        unnamed: Option<&NamedMaterial>,
        warnings: &mut Warnings,
    ) -> Result<ModelMaterials, SceneError> {
        let libraries = self.libraries_of(file, model, warnings)?;
        let mut named = Vec::with_capacity(model.names.len());
        for (name, line) in &model.names {
            named.push(self.used(file, name, *line, &libraries, warnings)?);
        }
        let home = match unnamed {
            None => file.to_owned(),
            Some(unnamed) => self.home_of(unnamed, &libraries)?,
        };
        if !model.is_partial {
            return Ok(ModelMaterials { named, default: 0 });
        }
        let name = unnamed.map_or(DEFAULT_MATERIAL, |unnamed| &unnamed.name);
        let libraries = if unnamed.is_some() { libraries } else { Vec::new() };
        Ok(ModelMaterials { named, default: self.index_of(&home, name, &libraries, warnings)? })
    }

    fn libraries_of(
        &mut self,
        file: &str,
        model: &MaterialNames,
        warnings: &mut Warnings,
    ) -> Result<Libraries, SceneError> {
        let mut libraries = Vec::new();
        for (names, line) in &model.libraries {
            let place = Place::line(file, *line);
            for name in self.library_names(file, names) {
                libraries.insert(0, (name.clone(), self.library(&name, &place, warnings)?));
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

    fn library(
        &mut self,
        name: &str,
        place: &Place,
        warnings: &mut Warnings,
    ) -> Result<Rc<MtlFile>, SceneError> {
        if let Some(library) = self.libraries.get(name) {
            return Ok(Rc::clone(library));
        }
        let bytes = self.files.read(name).map_err(|cause| match cause {
            ReadError::Missing { .. } => SceneError::Malformed {
                place: place.clone(),
                problem: format!(
                    "mtllib: {cause}; put the file there, or remove the line to render in grey"
                ),
            },
            cause => SceneError::Unreachable { place: place.clone(), cause },
        })?;
        let library = MtlFile::read(name, &obj::text_of(&bytes), warnings)?;
        self.names.extend(library.names().map(str::to_owned));
        let library = Rc::new(library);
        self.libraries.insert(name.to_owned(), Rc::clone(&library));
        Ok(library)
    }

    /// The scene material that a line of a model names.
    fn used(
        &mut self,
        file: &str,
        name: &str,
        line: usize,
        libraries: &Libraries,
        warnings: &mut Warnings,
    ) -> Result<u32, SceneError> {
        let is_known = find(libraries, name).is_some() || self.overrides.contains_key(name);
        if !is_known && !self.indices.contains_key(&(file.to_owned(), name.to_owned())) {
            let place = Place::line(file, line);
            let problem = "is in no material library and is rendered grey";
            warnings.push(format!("{place}: material \"{name}\" {problem}"));
        }
        self.index_of(file, name, libraries, warnings)
    }

    /// What describes the material that the scene file gives to a model: the model itself, if a
    /// library of its has it, else the scene file.
    fn home_of(
        &mut self,
        unnamed: &NamedMaterial,
        libraries: &Libraries,
    ) -> Result<String, SceneError> {
        let name = &unnamed.name;
        if find(libraries, name).is_none() && !self.overrides.contains_key(name) {
            let known = libraries.iter().flat_map(|(_, mtl)| mtl.names());
            let known = known.chain(self.overrides.keys().map(String::as_str));
            return Err(SceneError::UnknownName {
                place: unnamed.place.clone(),
                kind: "material",
                name: name.clone(),
                nearest: nearest(name, known),
            });
        }
        self.names.insert(name.clone());
        Ok(unnamed.place.file.clone())
    }

    /// The index of a material in the scene; `home` is the file that answers for it if no library
    /// has it.
    fn index_of(
        &mut self,
        home: &str,
        name: &str,
        libraries: &Libraries,
        warnings: &mut Warnings,
    ) -> Result<u32, SceneError> {
        let found = find(libraries, name);
        let home = found.map_or(home, |(library, _)| library);
        let key = (home.to_owned(), name.to_owned());
        if let Some(&index) = self.indices.get(&key) {
            return Ok(index);
        }
        self.names.insert(name.to_owned());
        let mut entry = match found {
            Some((_, mtl)) => MaterialEntry::from_mtl(mtl, warnings),
            None => MaterialEntry::grey(name),
        };
        if let Some(change) = self.overrides.get(name) {
            entry.change(change, warnings);
        }
        let index = self.add(entry, warnings)?;
        self.indices.insert(key, index);
        Ok(index)
    }

    fn add(
        &mut self,
        mut entry: MaterialEntry,
        warnings: &mut Warnings,
    ) -> Result<u32, SceneError> {
        if let Some(reference) = &entry.texture {
            let (files, role) = (self.files, Role::Reflectance);
            let index = self.textures.index_of(files, reference, role, warnings)?;
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

    /// Checks that all that the scene file says is said of materials that are there.
    pub(super) fn check_overrides(&self) -> Result<(), SceneError> {
        for (name, change) in &self.overrides {
            if !self.names.contains(name) {
                return Err(SceneError::UnknownName {
                    place: change.place.clone(),
                    kind: "material",
                    name: name.clone(),
                    nearest: nearest(name, self.names.iter().map(String::as_str)),
                });
            }
        }
        Ok(())
    }

    /// The light from everywhere, with its image read.
    pub(super) fn environment(
        &mut self,
        entry: EnvironmentEntry,
        warnings: &mut Warnings,
    ) -> Result<Environment, SceneError> {
        Ok(match entry {
            EnvironmentEntry::Black => Environment::Black,
            EnvironmentEntry::Constant { radiance } => Environment::Constant { radiance },
            EnvironmentEntry::Image { image, scale, rotation } => {
                let (files, role) = (self.files, Role::Radiance);
                let texture = self.textures.index_of(files, &image, role, warnings)?;
                Environment::Image { texture, scale, rotation }
            }
        })
    }

    /// All of it, to be used under this environment.
    pub(super) fn into_tables(self, environment: Environment) -> Tables {
        let textures = self.textures.into_textures();
        Tables { materials: self.materials, textures, environment }
    }
}

fn find<'l>(
    libraries: &'l Libraries,
    name: &str,
) -> Option<(&'l str, &'l super::mtl::MtlMaterial)> {
    libraries.iter().find_map(|(library, mtl)| Some((library.as_str(), mtl.get(name)?)))
}
