//! Recording what the paths of a scene cost, while it is rendered in this process: for a file that
//! the user asks for, or for another command that simulates.

use std::path::Path;

use anyhow::anyhow;
use equilux_common::costs::SceneCosts;
use equilux_common::film::TileSums;
use equilux_common::image::write_atomically;
use equilux_worker::RecordedScene;

use crate::args::{RenderArgs, SettingsArgs};
use crate::outputs;
use crate::render::Run;

/// Samples per pixel where none are asked for: a thousand paths for each cell of the file, and ten
/// seconds or so for the shipped scenes.
const SAMPLES: u32 = 16;

/// Renders a scene on one thread of this process, without keeping the image, and gives what its
/// paths cost. Progress goes to standard error.
pub(crate) async fn record(
    scene: &Path,
    settings: SettingsArgs,
    is_quiet: bool,
) -> anyhow::Result<SceneCosts> {
    let settings = SettingsArgs { spp: settings.spp.or(Some(SAMPLES)), ..settings };
    let args = RenderArgs {
        scene: scene.to_path_buf(),
        settings,
        threads: Some(1),
        quiet: is_quiet,
        ..RenderArgs::default()
    };
    Run::start(args, Vec::new(), true, None).await?.into_costs().await
}

/// What the job of a scene that was recorded cost, given its finished film.
pub(crate) async fn costs_of(
    recorded: &RecordedScene,
    scene: &Path,
    film: &TileSums,
) -> anyhow::Result<SceneCosts> {
    recorded.costs(outputs::scene_name(scene), film).await.map_err(|error| anyhow!(error))
}

/// Writes costs to a file, whole or not at all.
pub(crate) fn write(costs: &SceneCosts, path: &Path) -> anyhow::Result<()> {
    Ok(write_atomically(path, costs.to_json().as_bytes())?)
}
