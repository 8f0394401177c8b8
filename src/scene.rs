//! `equilux scene`: looks into scenes, cuts them into partitions, and makes the ones that programs
//! make.

mod build;
mod city;
mod outdir;
mod store_description;

use std::fmt::Display;
use std::path::Path;
use std::process::ExitCode;

use anyhow::ensure;
use equilux_common::image::write_atomically;
use equilux_common::scene::describe::Description;
use equilux_common::scene::files::Directory;
use equilux_common::scene::load::load;
use equilux_store::is_store;
use serde::Serialize;

use crate::args::{GenerateArgs, GeneratedScene, SceneArgs, SceneCommand};
use crate::jobs::print_line;

use outdir::Outdir;
use store_description::StoreDescription;

/// `equilux scene`.
pub(crate) async fn run(args: SceneArgs) -> anyhow::Result<ExitCode> {
    match args.command {
        SceneCommand::Check { scene, json } => check(&scene, json)?,
        SceneCommand::Build(args) => return build::run(args).await,
        SceneCommand::Generate(args) => return generate(args).await,
    }
    Ok(ExitCode::SUCCESS)
}

fn check(scene: &Path, is_json: bool) -> anyhow::Result<()> {
    if is_store(scene) {
        return describe(&StoreDescription::of(scene)?, is_json);
    }
    let (directory, entry) = Directory::of(scene)?;
    describe(&Description::of(&load(&directory, &entry)?), is_json)
}

fn describe<T: Serialize + Display>(description: &T, is_json: bool) -> anyhow::Result<()> {
    let text =
        if is_json { serde_json::to_string_pretty(description)? } else { description.to_string() };
    Ok(print_line(text.trim_end())?)
}

async fn generate(args: GenerateArgs) -> anyhow::Result<ExitCode> {
    let is_city = matches!(args.name, GeneratedScene::City);
    ensure!(is_city || args.triangles.is_none(), "--triangles goes with a city only; give --size");
    ensure!(!is_city || args.size.is_none(), "--size does not go with a city; give --triangles");
    let size = args.size.unwrap_or(1);
    let (default, files) = match args.name {
        GeneratedScene::Office => ("office", equilux_generator::office(size)?),
        GeneratedScene::Bathroom => ("bathroom", equilux_generator::bathroom(size)?),
        GeneratedScene::CornellBox => ("cornell-box", equilux_generator::cornell_box()),
        GeneratedScene::City => return city::generate(args).await,
    };
    let outdir = args.outdir.unwrap_or_else(|| default.into());
    let _unless_empty = Outdir::make(&outdir)?;
    for file in files.iter() {
        write_atomically(&outdir.join(&file.name), file.text.as_bytes())?;
    }
    print_line(&format!("{}", outdir.join("scene.json").display()))?;
    Ok(ExitCode::SUCCESS)
}
