//! `equilux scene`: looks into scenes, and makes the ones that programs make.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context;
use equilux_common::image::write_atomically;
use equilux_common::scene::describe::Description;
use equilux_common::scene::files::Directory;
use equilux_common::scene::load::load;

use crate::args::{GeneratedScene, SceneArgs, SceneCommand};
use crate::jobs::print_line;

/// `equilux scene`.
pub(crate) fn run(args: SceneArgs) -> anyhow::Result<ExitCode> {
    match args.command {
        SceneCommand::Check { scene, json } => check(&scene, json)?,
        SceneCommand::Generate { name, size, outdir } => generate(name, size, outdir)?,
    }
    Ok(ExitCode::SUCCESS)
}

fn check(scene: &Path, is_json: bool) -> anyhow::Result<()> {
    let (directory, entry) = Directory::of(scene)?;
    let description = Description::of(&load(&directory, &entry)?);
    let text =
        if is_json { serde_json::to_string_pretty(&description)? } else { description.to_string() };
    Ok(print_line(text.trim_end())?)
}

fn generate(name: GeneratedScene, size: u32, outdir: Option<PathBuf>) -> anyhow::Result<()> {
    let (default, files) = match name {
        GeneratedScene::Office => ("office", equilux_generator::office(size)?),
        GeneratedScene::Bathroom => ("bathroom", equilux_generator::bathroom(size)?),
        GeneratedScene::CornellBox => ("cornell-box", equilux_generator::cornell_box()),
    };
    let outdir = outdir.unwrap_or_else(|| default.into());
    std::fs::create_dir_all(&outdir).with_context(|| format!("{}", outdir.display()))?;
    for file in files.iter() {
        write_atomically(&outdir.join(&file.name), file.text.as_bytes())?;
    }
    print_line(&format!("{}", outdir.join("scene.json").display()))?;
    Ok(())
}
