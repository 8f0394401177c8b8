//! Models of a simulation: what their paths cost, from files or by rendering them now.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, bail};
use equilux_common::costs::SceneCosts;
use equilux_common::scene::files::Directory;
use equilux_common::scene::load::load;
use equilux_store::{Store, is_store};
use equilux_worker_core::memory_for;

use crate::args::{SettingsArgs, SimulateArgs};
use crate::subject::{check_models, check_sizes, model_name};
use crate::{outputs, record};

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
    check_unique(&recorded)?;
    let mut all = Vec::new();
    if args.scenes.is_empty() {
        all.extend(recorded.drain(..).map(|recorded| recorded.costs));
    }
    // What belongs nowhere is told before anything is rendered.
    let names: Vec<_> = args.scenes.iter().map(|scene| outputs::scene_name(scene)).collect();
    let of_costs = all.iter().map(|costs| &costs.scene);
    let models: Vec<_> = of_costs.chain(&names).map(|name| model_name(name)).collect();
    check_models(models.iter().map(String::as_str))?;
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

/// Refuses two files for one scene: which of them holds?
fn check_unique(recorded: &[Recorded]) -> anyhow::Result<()> {
    for (index, Recorded { path, costs }) in recorded.iter().enumerate() {
        let first = recorded[..index].iter().find(|other| other.costs.scene == costs.scene);
        if let Some(Recorded { path: other, .. }) = first {
            bail!(
                "--costs {}: holds the costs of `{}`, as {} does; leave one of them out",
                path.display(),
                costs.scene,
                other.display()
            );
        }
    }
    Ok(())
}

fn model(args: &SimulateArgs, mut costs: SceneCosts) -> anyhow::Result<Model> {
    // An amount of work has an image of its own.
    if args.work.is_none() {
        check_sizes(&args.sizes.0, (costs.width, costs.height))?;
    }
    check_memory(args, &costs)?;
    costs.samples_per_pixel = args.spp.unwrap_or(costs.samples_per_pixel);
    Ok(Model { name: model_name(&costs.scene), costs: Arc::new(costs) })
}

/// Refuses memories that are of no use.
fn check_memory(args: &SimulateArgs, costs: &SceneCosts) -> anyhow::Result<()> {
    let (Some(memory), name) = (args.memory, &costs.scene) else { return Ok(()) };
    let Some(partitioned) = &costs.partitioned else {
        bail!(
            "--memory: the costs of `{name}` are of a model that is whole; cut it with `equilux \
             scene build`, and record costs of the store with `equilux render STORE \
             --record-costs FILE`"
        );
    };
    let largest = partitioned.partitions.iter().map(|it| it.memory_bytes).max().unwrap_or(0);
    let (given, least) = (memory.bytes(partitioned.bytes()), memory_for(largest));
    if given < least {
        bail!(
            "--memory: {given} bytes do not hold the largest partition of `{name}`; give at least \
             --memory {least}, or cut the model into smaller partitions"
        );
    }
    Ok(())
}

/// The costs of a scene, with the samples per pixel that it says.
async fn costs_of(scene: &Path, recorded: &mut Vec<Recorded>) -> anyhow::Result<SceneCosts> {
    let samples_per_pixel = samples_of(scene)?;
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

/// The samples per pixel that a scene or a store says.
fn samples_of(scene: &Path) -> anyhow::Result<u32> {
    if is_store(scene) {
        return Ok(Store::open_path(scene)?.manifest().settings.samples_per_pixel);
    }
    let (directory, entry) = Directory::of(scene)?;
    Ok(load(&directory, &entry)?.settings.samples_per_pixel)
}

fn read(path: &Path) -> anyhow::Result<Recorded> {
    let text = std::fs::read_to_string(path).with_context(|| {
        format!("{}: record it with `equilux render SCENE --record-costs FILE`", path.display())
    })?;
    let costs = SceneCosts::from_json(&text).with_context(|| format!("{}", path.display()))?;
    Ok(Recorded { path: path.to_path_buf(), costs })
}
