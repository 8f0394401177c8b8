//! What is measured: the paper's two models, made anew wherever the program runs, or scenes that
//! the user names.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Context;
use equilux_common::job::Settings;
use equilux_common::scene::camera::Camera;
use equilux_common::scene::files::Pack;
use equilux_generator::Files;
use equilux_simulator::case::Case;
use tempfile::TempDir;

use crate::outputs;
use crate::subject::{Extent, Subject, check_models, check_sizes, model_name};

/// Scenes that are at hand.
pub(crate) struct Scenes {
    /// In order.
    pub(crate) all: Vec<MeasuredScene>,
    /// Where those are that were made.
    _made: TempDir,
}

/// A scene that is at hand.
pub(crate) struct MeasuredScene {
    /// As the table has it.
    pub(crate) name: String,
    /// Its file.
    pub(crate) path: PathBuf,
    /// All its files.
    pub(crate) pack: Arc<Pack>,
    /// The scene file among them.
    pub(crate) entry: String,
    /// Its camera.
    pub(crate) camera: Camera,
    /// How it says it is rendered.
    settings: Settings,
}

impl Scenes {
    /// Reads these scenes, or makes the paper's two.
    pub(crate) fn gather(paths: &[PathBuf]) -> anyhow::Result<Self> {
        let made = tempfile::tempdir().context("cannot make a directory for temporary files")?;
        let all: anyhow::Result<Vec<_>> = if paths.is_empty() {
            let office = ("office", equilux_generator::office(1)?);
            let bathroom = ("bathroom", equilux_generator::bathroom(1)?);
            let make = |(name, files): &(&str, Files)| make(&made.path().join(name), files);
            [office, bathroom].iter().map(make).collect()
        } else {
            paths.iter().map(|path| read(path)).collect()
        };
        let all = all?;
        check_models(all.iter().map(|scene| scene.name.as_str()))?;
        Ok(Self { all, _made: made })
    }

    /// Refuses sizes that are too large for one of them.
    pub(crate) fn check_sizes(&self, sizes: &[u32]) -> anyhow::Result<()> {
        let sides = |scene: &MeasuredScene| (scene.settings.width, scene.settings.height);
        self.all.iter().try_for_each(|scene| check_sizes(sizes, sides(scene)))
    }
}

impl MeasuredScene {
    /// The scene with so many times as many pixels.
    pub(crate) fn subject(&self, size: u32) -> Subject {
        Subject { model: self.name.clone(), extent: Extent::Size(size), case: Case::Even }
    }

    /// The settings for so many times as many pixels.
    pub(crate) fn settings(&self, size: u32, samples_per_pixel: u32) -> Settings {
        let side = |side: u32| (f64::from(side) * f64::from(size).sqrt()).floor() as u32;
        Settings {
            width: side(self.settings.width),
            height: side(self.settings.height),
            crop: None,
            samples_per_pixel,
            ..self.settings.clone()
        }
    }
}

fn make(directory: &Path, files: &Files) -> anyhow::Result<MeasuredScene> {
    let failed = || format!("{}", directory.display());
    std::fs::create_dir(directory).with_context(failed)?;
    for file in files.iter() {
        std::fs::write(directory.join(&file.name), &file.text).with_context(failed)?;
    }
    read(&directory.join("scene.json"))
}

fn read(path: &Path) -> anyhow::Result<MeasuredScene> {
    let gathered = Pack::gather(path)?;
    gathered.loaded.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
    Ok(MeasuredScene {
        name: model_name(&outputs::scene_name(path)),
        path: path.to_path_buf(),
        pack: Arc::new(gathered.pack),
        entry: gathered.entry,
        camera: gathered.loaded.camera,
        settings: gathered.loaded.settings,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_paper_s_models_are_there_wherever_the_program_runs() {
        let scenes = Scenes::gather(&[]).unwrap();
        let names: Vec<_> = scenes.all.iter().map(|scene| scene.name.as_str()).collect();
        assert_eq!(names, ["Office", "Bathroom"]);
        let large = scenes.all[0].settings(9, 14);
        assert_eq!((large.width, large.height, large.samples_per_pixel), (1920, 1440, 14));
    }
}
