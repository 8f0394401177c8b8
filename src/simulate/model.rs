//! Models of a simulation: what their paths cost, from files or by rendering them now.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, bail};
use equilux_common::costs::SceneCosts;
use equilux_common::job::{IMAGE_PIXELS_MAX, SIDE_PIXELS_MAX};
use equilux_common::scene::files::Directory;
use equilux_common::scene::load::load;

use crate::args::{SettingsArgs, SimulateArgs};
use crate::{outputs, record, table};

/// A model that can be simulated.
pub(crate) struct Model {
    /// As the table has it.
    pub(crate) name: String,
    /// What its paths cost, with the samples per pixel that are to be simulated.
    pub(crate) costs: Arc<SceneCosts>,
}

/// Costs that were read from a file.
struct Recorded {
    path: PathBuf,
    costs: SceneCosts,
}

/// All models that the command line asks for.
pub(crate) async fn all(args: &SimulateArgs) -> anyhow::Result<Vec<Model>> {
    let mut recorded = args.costs.iter().map(|path| read(path)).collect::<Result<Vec<_>, _>>()?;
    let mut all = Vec::new();
    if args.scenes.is_empty() {
        all.extend(recorded.drain(..).map(|recorded| recorded.costs));
    }
    // What belongs nowhere is told before anything is rendered.
    let names: Vec<_> = args.scenes.iter().map(|scene| outputs::scene_name(scene)).collect();
    let stray = recorded.iter().find(|recorded| !names.contains(&recorded.costs.scene));
    if let Some(Recorded { path, costs }) = stray {
        bail!(
            "{}: holds the costs of `{}`, which is none of the scenes; leave it out, or the scenes",
            path.display(),
            costs.scene
        );
    }
    for scene in &args.scenes {
        all.push(costs_of(scene, &mut recorded).await?);
    }
    all.into_iter().map(|costs| model(args, costs)).collect()
}

fn model(args: &SimulateArgs, mut costs: SceneCosts) -> anyhow::Result<Model> {
    let largest = args.sizes.0.iter().max().copied().unwrap_or(1);
    check_size(&costs, largest)?;
    costs.samples_per_pixel = args.spp.unwrap_or(costs.samples_per_pixel);
    Ok(Model { name: table::model_name(&costs.scene), costs: Arc::new(costs) })
}

/// The costs of a scene, with the samples per pixel that it says.
async fn costs_of(scene: &Path, recorded: &mut Vec<Recorded>) -> anyhow::Result<SceneCosts> {
    let (directory, entry) = Directory::of(scene)?;
    let samples_per_pixel = load(&directory, &entry)?.settings.samples_per_pixel;
    let name = outputs::scene_name(scene);
    let costs = match recorded.iter().position(|recorded| recorded.costs.scene == name) {
        Some(index) => recorded.remove(index).costs,
        None => {
            eprintln!("{name}: rendering it on one thread to record what its paths cost");
            record::record(scene, SettingsArgs::default(), false).await?
        }
    };
    Ok(SceneCosts { samples_per_pixel, ..costs })
}

fn read(path: &Path) -> anyhow::Result<Recorded> {
    let text = std::fs::read_to_string(path).with_context(|| {
        format!("{}: record it with `equilux render SCENE --record-costs FILE`", path.display())
    })?;
    let costs = SceneCosts::from_json(&text).with_context(|| format!("{}", path.display()))?;
    Ok(Recorded { path: path.to_path_buf(), costs })
}

fn check_size(costs: &SceneCosts, size: u32) -> anyhow::Result<()> {
    let (width, height) = (u64::from(costs.width), u64::from(costs.height));
    let size = u64::from(size);
    let side = width.max(height);
    if width * height * size > IMAGE_PIXELS_MAX
        || side * side * size > u64::from(SIDE_PIXELS_MAX).pow(2)
    {
        bail!(
            "--sizes {size}: {width}x{height} pixels times {size} are more than an image may have; \
             choose a smaller size"
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use equilux_common::costs::COSTS_VERSION;

    #[test]
    fn sizes_beyond_the_largest_image_are_refused() {
        let costs = |width, height| SceneCosts {
            equilux_costs: COSTS_VERSION,
            scene: "a".into(),
            width,
            height,
            samples_per_pixel: 1,
            cell_side_pixels: 8,
            prepare_s: 0.0,
            bytes_per_pixel: 1.0,
            cells: Vec::new(),
        };
        assert!(check_size(&costs(640, 480), 9).is_ok());
        assert!(check_size(&costs(640, 480), 1000).is_err());
        assert!(check_size(&costs(60_000, 1), 2).is_err());
    }
}
