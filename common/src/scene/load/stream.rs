//! Scenes that are streamed: triangle by triangle, from models of any size, in little memory.
//!
//! What is streamed is to the bit what [`load`](super::load) puts together in memory, for both ask
//! the same functions; they differ in where vertices and faces are kept. A PLY file is read where
//! it is: the faces from front to back, the vertices through a cache of blocks. An OBJ file is
//! first written down in binary form, for its text says neither where a vertex is nor whether a
//! later line is wrong.

mod model;
mod placer;
mod spool;
mod spooled_faces;
mod table;
mod vertices;

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use model::StreamedModel;
use placer::{Placer, Showing, Tally};
use vertices::Vertices;

use super::framing::Bounds;
use super::materials::ModelMaterials;
use super::mesh::{MaterialNames, Reply};
use super::setting::{Admission, ModelFormat, Setting, Stage, darkness};
use super::warnings::{self, Warnings, lost_texcoords};
use super::{check_placings, emits, nothing_left};
use crate::job::Settings;
use crate::scene::camera::Camera;
use crate::scene::error::{Place, SceneError};
use crate::scene::files::FileSource;
use crate::scene::placing::{Placing, Transform};
use crate::scene::triangles::{BATCH_TRIANGLES, TRIANGLES_MAX, TriangleSource};
use crate::scene::{Tables, WorldTriangle};

/// The part of a [`SceneStream`] that comes before its prototypes.
const LOOSE: usize = 0;

/// The geometry of a scene, to be gone over any number of times. Its temporary files go with it.
#[derive(Debug)]
pub struct SceneStream {
    entry: String,
    models: Vec<StreamedModel>,
    loose: Vec<Placed>,
    /// In their own coordinates.
    prototypes: Vec<Placed>,
    /// Where each is placed.
    placings: Vec<Vec<Placing>>,
    emits: Vec<bool>,
    /// Whether it is said if nothing emits.
    is_dark_without: bool,
    /// What was come upon when the parts were shown: the loose models, then each prototype.
    tallies: Vec<Tally>,
    warnings: Vec<String>,
    degenerate_count: u64,
}

/// Everything of a scene but its geometry.
#[derive(Clone, Debug)]
pub struct Overture {
    /// What all parts of the geometry share.
    pub tables: Tables,
    /// The camera that is used unless another one is asked for.
    pub camera: Camera,
    /// More cameras by name.
    pub cameras: BTreeMap<String, Camera>,
    /// How to render unless told otherwise.
    pub settings: Settings,
    /// What is odd about the files apart from their geometry; see [`SceneStream::warnings`].
    pub warnings: Vec<String>,
    /// About how many triangles will be shown. Usually it is the number of those that the faces are
    /// cut into, of which some may be left out; text, and lists other than those of the faces' own
    /// corners, make it a guess.
    pub triangle_count: u64,
    /// How many bytes of models are read to show them.
    pub model_bytes: u64,
}

/// A model at its place.
#[derive(Debug)]
struct Placed {
    /// Into [`SceneStream::models`].
    model: usize,
    placing: Placing,
    materials: ModelMaterials,
}

impl SceneStream {
    /// Opens the scene called `entry`. What does not fit memory goes to temporary files in `spool`,
    /// a directory that is there and that nobody else uses. A model alone is gone over once,
    /// to frame it.
    ///
    /// # Errors
    /// As [`load`](super::load), but that what is wrong with the faces of a PLY file, or a scene
    /// without a triangle that can be rendered, is an error of [`TriangleSource::for_each`]; and if
    /// the temporary files cannot be written.
    pub fn open(
        files: &dyn FileSource,
        entry: &str,
        spool: &Path,
    ) -> Result<(Self, Overture), SceneError> {
        let mut stage = OnDisk { spool: spool.to_owned(), ..OnDisk::default() };
        let mut setting = Setting::gather(files, entry, &mut stage)?;
        let OnDisk { models, loose, prototypes, placings, .. } = stage;
        let is_dark_without =
            !setting.is_alone && darkness(entry, &setting.tables, false).is_some();
        let mut stream = Self {
            entry: entry.to_owned(),
            models,
            loose,
            prototypes,
            placings,
            emits: emits(&setting.tables),
            is_dark_without,
            tallies: Vec::new(),
            warnings: Vec::new(),
            degenerate_count: 0,
        };
        if setting.is_alone {
            let (bounds, has_light) = stream.survey()?;
            setting.complete(entry, &bounds, has_light);
        }
        let sum = |of: fn(&StreamedModel) -> u64| {
            let all = stream.loose.iter().chain(&stream.prototypes);
            all.map(|placed| of(&stream.models[placed.model])).sum()
        };
        let overture = Overture {
            tables: setting.tables,
            camera: setting.camera,
            cameras: setting.cameras,
            settings: setting.settings,
            warnings: setting.warnings.into_messages(),
            triangle_count: sum(|model| model.triangle_count),
            model_bytes: sum(|model| model.file.byte_count()),
        };
        Ok((stream, overture))
    }

    /// What is odd about the geometry. Complete once all triangles have been shown for the first
    /// time; nothing before.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// How many triangles are left out because they have no area; known once all triangles have
    /// been shown.
    #[must_use]
    pub const fn degenerate_count(&self) -> u64 {
        self.degenerate_count
    }

    /// The box around all triangles, and whether any of them emits.
    fn survey(&mut self) -> Result<(Bounds, bool), SceneError> {
        let mut bounds: Option<Bounds> = None;
        self.show(LOOSE, &mut |triangles| {
            let points = triangles.iter().flat_map(|triangle| triangle.corners);
            bounds = Bounds::around(bounds, points);
            ControlFlow::Continue(())
        })?;
        let bounds = bounds.ok_or_else(|| nothing_left(&self.entry))?;
        Ok((bounds, self.tallies.iter().any(|tally| tally.has_light)))
    }

    /// Shows a part: the loose models, or the prototype before it by number.
    fn show(
        &mut self,
        part: usize,
        visit: &mut dyn FnMut(&[WorldTriangle]) -> ControlFlow<()>,
    ) -> Result<(), SceneError> {
        let models = match part.checked_sub(1) {
            None => self.loose.as_slice(),
            Some(prototype) => std::slice::from_ref(&self.prototypes[prototype]),
        };
        let mut showing = Showing {
            visit,
            emits: &self.emits,
            waiting: Vec::with_capacity(BATCH_TRIANGLES),
            tally: Tally::default(),
        };
        let mut flow = ControlFlow::Continue(());
        for placed in models {
            if flow.is_continue() {
                flow = show_model(&self.models[placed.model], placed, &mut showing)?;
            }
        }
        if flow.is_continue() {
            flow = showing.flush();
        }
        if showing.tally.is_overfull {
            return Err(self.too_large());
        }
        let tally = showing.tally;
        if flow.is_continue() && part == self.tallies.len() {
            self.tallies.push(tally);
            self.conclude()?;
        }
        Ok(())
    }

    /// Tells what was odd, once all parts have been shown.
    fn conclude(&mut self) -> Result<(), SceneError> {
        if self.tallies.len() <= self.prototypes.len() {
            return Ok(());
        }
        if self.tallies.iter().all(|tally| tally.kept == 0) {
            return Err(nothing_left(&self.entry));
        }
        let mut warnings = Warnings::default();
        for tally in &mut self.tallies {
            self.degenerate_count += tally.degenerate;
            warnings.extend(std::mem::take(&mut tally.warnings).into_messages());
        }
        warnings.extend(warnings::degenerate(self.degenerate_count));
        let has_light = self.tallies.iter().any(|tally| tally.has_light);
        if self.is_dark_without && !has_light {
            let entry = &self.entry;
            warnings.push(format!("{entry}: there is no light, so the image will be black"));
        }
        self.warnings = warnings.into_messages();
        Ok(())
    }

    fn too_large(&self) -> SceneError {
        SceneError::TooLarge {
            place: Place::file(&self.entry),
            problem: format!("the scene has more than {TRIANGLES_MAX} triangles"),
        }
    }
}

impl TriangleSource for SceneStream {
    fn for_each(
        &mut self,
        visit: &mut dyn FnMut(&[WorldTriangle]) -> ControlFlow<()>,
    ) -> Result<(), SceneError> {
        self.show(LOOSE, visit)
    }

    fn placings(&self) -> &[Vec<Placing>] {
        &self.placings
    }

    fn for_each_of(
        &mut self,
        prototype: usize,
        visit: &mut dyn FnMut(&[WorldTriangle]) -> ControlFlow<()>,
    ) -> Result<(), SceneError> {
        let mut bounds = None;
        self.show(prototype + 1, &mut |triangles| {
            bounds = Bounds::around(bounds, triangles.iter().flat_map(|triangle| triangle.corners));
            visit(triangles)
        })?;
        let file = self.models[self.prototypes[prototype].model].file.name();
        bounds.map_or(Ok(()), |bounds| check_placings(file, &bounds, &self.placings[prototype]))
    }
}

fn show_model<'a>(
    model: &'a StreamedModel,
    placed: &'a Placed,
    showing: &mut Showing<'a>,
) -> Result<ControlFlow<()>, SceneError> {
    let (file, materials) = (model.file.name(), &placed.materials);
    let vertices = Vertices::open(&model.vertices, placed.placing)?;
    let mut placer = Placer::new(file, placed.placing, materials, vertices, showing);
    let mut flow = ControlFlow::Continue(());
    let thin = model.for_each_face(&mut |face| {
        let reply = placer.face(face)?;
        if reply == Reply::Enough {
            flow = ControlFlow::Break(());
        }
        Ok(reply)
    })?;
    if flow.is_continue() {
        let lost = placer.finish()?;
        showing.tally.warnings.extend(lost_texcoords(file, lost));
        showing.tally.degenerate += thin;
    }
    Ok(flow)
}

/// Keeps models where they are, or in temporary files.
#[derive(Default)]
struct OnDisk {
    spool: PathBuf,
    models: Vec<StreamedModel>,
    numbers: BTreeMap<String, usize>,
    loose: Vec<Placed>,
    prototypes: Vec<Placed>,
    placings: Vec<Vec<Placing>>,
}

impl Stage for OnDisk {
    fn admit(&mut self, model: &Admission<'_>) -> Result<MaterialNames, SceneError> {
        if let Some(&number) = self.numbers.get(model.file) {
            return Ok(self.models[number].materials.clone());
        }
        let (large, number) = (model.large()?, self.models.len());
        let streamed = match model.format {
            ModelFormat::Obj => StreamedModel::obj(large, &self.spool, number)?,
            ModelFormat::Ply => StreamedModel::ply(large, &self.spool, number)?,
        };
        let names = streamed.materials.clone();
        self.numbers.insert(model.file.to_owned(), number);
        self.models.push(streamed);
        Ok(names)
    }

    fn place(
        &mut self,
        file: &str,
        placing: Placing,
        materials: ModelMaterials,
        _: &mut Warnings,
    ) -> Result<(), SceneError> {
        let model = self.numbers[file];
        self.loose.push(Placed { model, placing, materials });
        Ok(())
    }

    fn place_prototype(
        &mut self,
        file: &str,
        placings: Vec<Placing>,
        materials: ModelMaterials,
        _: &mut Warnings,
    ) -> Result<(), SceneError> {
        let (model, placing) = (self.numbers[file], Placing::new(Transform::IDENTITY));
        self.prototypes.push(Placed { model, placing, materials });
        self.placings.push(placings);
        Ok(())
    }
}

#[cfg(test)]
mod tests;
