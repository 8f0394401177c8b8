//! `equilux bench kernel`: how many rays a second one thread traces, kind by kind.

mod agreement;
mod kind;
mod own;
mod rays;
mod report;
mod targets;
mod timing;
mod yardstick;

use std::path::Path;
use std::time::Duration;

use anyhow::{bail, ensure};
use equilux_common::ids::PartitionId;
use equilux_common::ray::Ray;
use equilux_common::scene::Scene;
use equilux_common::scene::files::Directory;
use equilux_common::scene::load::{Loaded, load};
use equilux_render::geometry::Partition;
use equilux_render::model::Model;
use equilux_store::is_store;

use self::agreement::Agreement;
use self::kind::ByKind;
use self::rays::RayMaker;
use self::report::{KernelRow, Report, YardstickBuild};
use self::targets::Targets;
use self::timing::{Kernel, Timing, now};
use self::yardstick::Built;
use crate::args::KernelArgs;
use crate::jobs::print_line;
use crate::outputs;

/// Most triangles that yardsticks are built over: there they have each triangle at each of its
/// places, which takes some 250 bytes for each.
const YARDSTICK_TRIANGLES_MAX: u64 = 1 << 25;

/// `equilux bench kernel`.
pub(super) async fn run(args: KernelArgs) -> anyhow::Result<()> {
    let is_json = args.json;
    let report = tokio::task::spawn_blocking(move || measure(&args)).await??;
    let text = if is_json { serde_json::to_string_pretty(&report)? } else { report.text() };
    Ok(print_line(text.trim_end())?)
}

fn measure(args: &KernelArgs) -> anyhow::Result<Report> {
    let name = outputs::scene_name(&args.scene);
    let Loaded { scene, camera, settings, .. } = read(&args.scene)?;
    let triangles = scene.triangle_count();
    eprintln!("{name}: building trees over {triangles} triangles");
    let yardsticks = yardsticks(&scene);
    let luminaires = scene.luminaires();
    let (model, elapsed) = build(scene)?;
    let partition = whole(&model);
    let targets = Targets::new(&luminaires, model.bounds());
    let primary = rays::primary(&camera, &settings, args.rays)?;
    let maker = RayMaker { partition, targets: &targets, seed: settings.seed };
    let rays = maker.all(primary);
    ensure!(
        !rays.0[1].is_empty(),
        "{}: no ray of its camera hits anything; set `camera` to look at the model",
        args.scene.display()
    );
    let mut kernels: Vec<Box<dyn Kernel + '_>> = own::kernels(partition).collect();
    let own = kernels.len();
    let mut builds = Vec::new();
    for Built { kernel, elapsed } in yardsticks {
        builds.push(YardstickBuild { name: kernel.name(), build_s: elapsed.as_secs_f64() });
        kernels.push(kernel);
    }
    let Agreement { hits, differences } = Agreement::find(&mut kernels, own, &rays)?;
    eprintln!("{name}: tracing {} rays with {} kernels in turn", count(&rays), kernels.len());
    let Timing { rounds, speeds } = Timing::measure(&mut kernels, &rays, args.rounds);
    let rows = kernels.iter().zip(speeds).map(|(kernel, speeds)| KernelRow {
        name: kernel.name(),
        mrays: speeds.map(|speed| speed.map(|it| it / 1e6)),
    });
    Ok(Report {
        scene: name,
        triangles,
        build_s: elapsed.as_secs_f64(),
        bytes_per_triangle: partition.tree_bytes() as f64 / partition.triangle_count() as f64,
        kernels: rows.collect(),
        rounds,
        rays: rays.map(Vec::len),
        hits,
        yardsticks: builds,
        differences,
        has_lights: targets.is_light(),
    })
}

fn read(path: &Path) -> anyhow::Result<Loaded> {
    if is_store(path) {
        bail!(
            "{}: is a store, whose partitions come into memory one by one; name the scene that it \
             was built from",
            path.display()
        );
    }
    let (directory, entry) = Directory::of(path)?;
    let loaded = load(&directory, &entry)?;
    loaded.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
    Ok(loaded)
}

/// The trees to compare with; none if they would take too much memory.
fn yardsticks(scene: &Scene) -> Vec<Built> {
    let count = scene.triangle_count();
    if count > YARDSTICK_TRIANGLES_MAX {
        eprintln!(
            "warning: there are no yardsticks, since {count} triangles are more than \
             {YARDSTICK_TRIANGLES_MAX}"
        );
        return Vec::new();
    }
    yardstick::build(&yardstick::triangles(scene)).into()
}

/// Makes a scene ready as a job does.
fn build(scene: Scene) -> anyhow::Result<(Model, Duration)> {
    let started = now();
    let model = Model::new(scene)?;
    Ok((model, started.elapsed()))
}

/// The only partition of a model that has been built in memory.
fn whole(model: &Model) -> &Partition {
    model.partitions().get(PartitionId(0)).expect("a model that is built is whole")
}

fn count(rays: &ByKind<Vec<Ray>>) -> usize {
    rays.0.iter().map(Vec::len).sum()
}
