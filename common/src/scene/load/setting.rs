//! Everything of a scene but its geometry: what loading and streaming have in common.
//!
//! The scene file is read and its models are handed, one after another, to a [`Stage`], which
//! keeps them in its own way.

use std::collections::BTreeMap;

use super::framing::{self, Bounds};
use super::materials::{MaterialTable, ModelMaterials};
use super::mesh::MaterialNames;
use super::scene_file::{ModelEntry, SceneFile, default_settings};
use super::warnings::Warnings;
use crate::job::Settings;
use crate::scene::camera::Camera;
use crate::scene::error::{Place, SceneError};
use crate::scene::files::{FileSource, LargeFile, beside};
use crate::scene::placing::Placing;
use crate::scene::{Environment, Tables};

/// Keeps models.
pub(super) trait Stage {
    /// Takes a model in, unless that has been done, and tells what it says about materials.
    fn admit(&mut self, model: &Admission<'_>) -> Result<MaterialNames, SceneError>;

    /// Places the model called `file`, which has been admitted.
    fn place(
        &mut self,
        file: &str,
        placing: Placing,
        materials: ModelMaterials,
        warnings: &mut Warnings,
    ) -> Result<(), SceneError>;

    /// Places it several times as it is.
    fn place_prototype(
        &mut self,
        file: &str,
        placings: Vec<Placing>,
        materials: ModelMaterials,
        warnings: &mut Warnings,
    ) -> Result<(), SceneError>;
}

/// A model that is to be taken in.
pub(super) struct Admission<'a> {
    files: &'a dyn FileSource,
    /// Its name.
    pub(super) file: &'a str,
    /// What names it.
    place: &'a Place,
    pub(super) format: ModelFormat,
}

/// The formats of models.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ModelFormat {
    Obj,
    Ply,
}

impl ModelFormat {
    /// The format that a file's name says.
    fn of(file: &str) -> Option<Self> {
        match extension(file).as_str() {
            "obj" => Some(Self::Obj),
            "ply" => Some(Self::Ply),
            _ => None,
        }
    }
}

impl Admission<'_> {
    /// The model's file.
    pub(super) fn large(&self) -> Result<LargeFile, SceneError> {
        self.files.large(self.file).map_err(|cause| match self.place.line {
            Some(_) => SceneError::Unreachable { place: self.place.clone(), cause },
            None => SceneError::Unreadable(cause),
        })
    }
}

/// What a scene says apart from its geometry.
pub(super) struct Setting {
    pub(super) tables: Tables,
    /// Without meaning where `is_alone`, until it is completed.
    pub(super) camera: Camera,
    pub(super) cameras: BTreeMap<String, Camera>,
    pub(super) settings: Settings,
    pub(super) warnings: Warnings,
    /// Whether it is a model without a scene file.
    pub(super) is_alone: bool,
}

impl Setting {
    /// Reads the scene called `entry` and has its models put on a stage.
    pub(super) fn gather(
        files: &dyn FileSource,
        entry: &str,
        stage: &mut dyn Stage,
    ) -> Result<Self, SceneError> {
        if extension(entry) == "json" {
            return gather_described(files, entry, stage);
        }
        if ModelFormat::of(entry).is_some() {
            return gather_alone(files, entry, stage);
        }
        files.large(entry)?;
        Err(SceneError::UnknownFormat { place: Place::file(entry), file: entry.to_owned() })
    }

    /// Frames a model that is alone, puts it under a sky if it has no light, and warns of darkness,
    /// once the geometry is known.
    pub(super) fn complete(&mut self, entry: &str, bounds: &Bounds, has_light: bool) {
        if self.is_alone {
            self.camera = framing::frame(bounds, &self.settings);
            if !has_light {
                self.tables.environment = framing::sky();
            }
        } else {
            self.warnings.extend(darkness(entry, &self.tables, has_light));
        }
    }
}

/// Says that a scene is dark, if it is.
pub(super) fn darkness(entry: &str, tables: &Tables, has_light: bool) -> Option<String> {
    let is_dark = !has_light && tables.environment == Environment::Black;
    is_dark.then(|| format!("{entry}: there is no light, so the image will be black"))
}

fn gather_described(
    files: &dyn FileSource,
    entry: &str,
    stage: &mut dyn Stage,
) -> Result<Setting, SceneError> {
    let bytes = files.read(entry)?;
    let text = std::str::from_utf8(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes))
        .map_err(|error| not_utf8(entry, &bytes[..error.valid_up_to()]))?;
    let file = SceneFile::read(entry, text)?;
    let mut warnings = Warnings::default();
    let mut materials = MaterialTable::new(files, file.materials);
    for group in group(entry, &file.models) {
        add_group(files, &group, stage, &mut materials, &mut warnings)?;
    }
    materials.check_overrides()?;
    let environment = materials.environment(file.environment, &mut warnings)?;
    Ok(Setting {
        tables: materials.into_tables(environment),
        camera: file.camera,
        cameras: file.cameras,
        settings: file.settings,
        warnings,
        is_alone: false,
    })
}

fn gather_alone(
    files: &dyn FileSource,
    entry: &str,
    stage: &mut dyn Stage,
) -> Result<Setting, SceneError> {
    let mut warnings = Warnings::default();
    let mut materials = MaterialTable::new(files, BTreeMap::new());
    let model = ModelEntry::alone(entry);
    let file = beside(entry, &model.file);
    let group = Group { file, model: &model, placings: vec![Placing::new(model.transform)] };
    add_group(files, &group, stage, &mut materials, &mut warnings)?;
    let settings = default_settings();
    let unknown = Bounds { min: [0.0; 3], max: [1.0; 3] };
    Ok(Setting {
        tables: materials.into_tables(Environment::Black),
        camera: framing::frame(&unknown, &settings),
        cameras: BTreeMap::new(),
        settings,
        warnings,
        is_alone: true,
    })
}

/// A model and everywhere that it is placed.
struct Group<'a> {
    file: String,
    /// The first entry of the scene file that places it.
    model: &'a ModelEntry,
    /// Several are of one prototype.
    placings: Vec<Placing>,
}

/// The models of a scene file: those that are of one file and one material belong together, but for
/// those into whose coordinates rays cannot be moved.
fn group<'a>(entry: &str, models: &'a [ModelEntry]) -> Vec<Group<'a>> {
    let mut groups: Vec<Group<'a>> = Vec::new();
    let mut numbers = BTreeMap::new();
    for model in models {
        let file = beside(entry, &model.file);
        let placing = Placing::new(model.transform);
        if !model.transform.is_reversible() {
            groups.push(Group { file, model, placings: vec![placing] });
            continue;
        }
        let material = model.material.as_ref().map(|material| &material.name);
        let number = *numbers.entry((file.clone(), material)).or_insert(groups.len());
        if number == groups.len() {
            groups.push(Group { file, model, placings: Vec::new() });
        }
        groups[number].placings.push(placing);
    }
    groups
}

fn add_group(
    files: &dyn FileSource,
    group: &Group<'_>,
    stage: &mut dyn Stage,
    materials: &mut MaterialTable<'_>,
    warnings: &mut Warnings,
) -> Result<(), SceneError> {
    let Group { file, model, placings } = group;
    let place = &model.place;
    let format = ModelFormat::of(file).ok_or_else(|| SceneError::UnknownFormat {
        place: place.clone(),
        file: model.file.clone(),
    })?;
    let names = stage.admit(&Admission { files, file, place, format })?;
    let materials = materials.of_model(file, &names, model.material.as_ref(), warnings)?;
    match placings.as_slice() {
        [placing] => stage.place(file, *placing, materials, warnings),
        _ => stage.place_prototype(file, placings.clone(), materials, warnings),
    }
}

fn extension(name: &str) -> String {
    name.rsplit_once('.').map_or_else(String::new, |(_, extension)| extension.to_lowercase())
}

fn not_utf8(file: &str, valid: &[u8]) -> SceneError {
    let line = 1 + valid.iter().filter(|&&byte| byte == b'\n').count();
    SceneError::Malformed {
        place: Place::line(file, line),
        problem: "is not valid UTF-8; save the file as UTF-8".into(),
    }
}
