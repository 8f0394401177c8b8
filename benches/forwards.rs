//! How many rays are forwarded per path when each of some workers holds its part of a store, and
//! what the tight boxes of partitions and the mapping do for it.
//!
//! Rays are traced as workers trace them: through all partitions of a home, then on to the next
//! home. Beside it there is what a single box around each partition costs, and a ring that every
//! ray goes round, whatever it meets. Partitions get homes by bisection, and by diffusion with
//! affinities as their boxes tell, and as rays do that were counted on their way from one partition
//! to another. Where METIS's program `gpmetis` is on the path, it maps by the same affinities.
//!
//! `cargo bench --bench forwards -- STORE [WORKERS…]`

#![expect(clippy::print_stdout, reason = "a benchmark's figures are its output")]

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use anyhow::{Context, ensure};
use equilux_common::bundle::{Bundle, Share, Stage};
use equilux_common::credit::Credit;
use equilux_common::ids::{Attempt, WorkerId};
use equilux_common::unit::Granularity;
use equilux_common::work::{Outcome, RayCounts, Samples, Work};
use equilux_mapping::{Guest, Host, Mapping, Seat, Tie, bisect, diffuse};
use equilux_render::geometry::{Bounds, Partition, PartitionSet};
use equilux_render::model::{Model, ModelParts};
use equilux_render::renderer::Renderer;
use equilux_render::scratch::Scratch;
use equilux_store::{Manifest, Store, manifest_path, read_partition};
use equilux_worker::affinity;

#[path = "../mapping/benches/mapping/metis.rs"]
mod metis;

/// Enough paths that chance does not show in the first two digits.
const WIDTH: u32 = 240;
const SAMPLES: u32 = 2;

/// What was counted of all paths.
#[derive(Default)]
struct Forwards {
    paths: u64,
    rays: u64,
    forwards: u64,
    /// Forwards back to where the nearest hit is, to be shaded.
    to_shade: u64,
    bytes: u64,
    /// Rays that went from one home to another, by both.
    passages: BTreeMap<[WorkerId; 2], u64>,
}

fn main() -> anyhow::Result<()> {
    let mut args = std::env::args().skip(1).filter(|arg| !arg.starts_with("--"));
    let path = args.next().context("name a store: `cargo bench --bench forwards -- STORE`")?;
    let workers = args.map(|count| count.parse()).collect::<Result<Vec<usize>, _>>()?;
    let workers = if workers.is_empty() { vec![2, 4, 16] } else { workers };
    let (tight, manifest) = model(&path, |boxes| boxes)?;
    let (loose, _) = model(&path, |boxes| vec![hull(&boxes)])?;
    let directory = manifest_path(Path::new(&path));
    let directory = directory.parent().context("the manifest lies in a directory")?;
    let partitions = (0..manifest.partitions.len()).map(|number| {
        let file = directory.join(&manifest.partitions[number].file.name);
        Ok(Arc::new(read_partition(&file, &manifest, number)?))
    });
    let partitions = partitions.collect::<anyhow::Result<Vec<_>>>()?;
    let guest = affinity::guest(&manifest)?.context("the store has no partitions")?;
    let apart: Vec<WorkerId> = (0..).map(WorkerId).take(partitions.len()).collect();
    let Forwards { passages, .. } = forwards(&tight, &manifest, &partitions, &apart)?;
    let measured = with_ties(&guest, &passages)?;
    println!("{} partitions", partitions.len());
    println!(
        "| workers | mapping | fullest/share | forwards/path | to shade | bytes/path | one box | \
         ring |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for count in workers {
        for (name, homes) in mappings(&guest, &measured, count)? {
            let tight = forwards(&tight, &manifest, &partitions, &homes)?;
            let loose = forwards(&loose, &manifest, &partitions, &homes)?;
            let per_path = |number: u64| number as f64 / tight.paths as f64;
            println!(
                "| {count} | {name} | {:.2} | {:.2} | {:.0}% | {:.0} | {:.2} | {:.2} |",
                fullest(&guest, &homes) * count as f64,
                per_path(tight.forwards),
                100.0 * tight.to_shade as f64 / tight.forwards.max(1) as f64,
                per_path(tight.bytes),
                per_path(loose.forwards),
                per_path(tight.rays * (count as u64 - 1)),
            );
        }
    }
    Ok(())
}

/// The part of all bytes that the home has that has most.
fn fullest(guest: &Guest, homes: &[WorkerId]) -> f64 {
    let mut bytes: BTreeMap<WorkerId, u64> = BTreeMap::new();
    for (object, &home) in guest.objects().iter().zip(homes) {
        *bytes.entry(home).or_default() += object.bytes;
    }
    let most = bytes.values().max().copied().unwrap_or(0);
    most as f64 / bytes.values().sum::<u64>().max(1) as f64
}

/// The same partitions with the affinities that rays have shown, each of which was at a home of its
/// own.
fn with_ties(guest: &Guest, passages: &BTreeMap<[WorkerId; 2], u64>) -> anyhow::Result<Guest> {
    let mut affinities: BTreeMap<[usize; 2], u64> = BTreeMap::new();
    for ([from, to], rays) in passages {
        let mut objects = [from.0 as usize, to.0 as usize];
        objects.sort_unstable();
        *affinities.entry(objects).or_default() += rays;
    }
    let ties = affinities.into_iter().map(|(objects, affinity)| Tie { objects, affinity });
    Ok(Guest::new(guest.objects().to_vec(), ties.collect())?)
}

/// The homes of all partitions, by each way.
fn mappings(
    guest: &Guest,
    measured: &Guest,
    count: usize,
) -> anyhow::Result<Vec<(&'static str, Vec<WorkerId>)>> {
    ensure!(count > 0, "there is at least one worker");
    let seat = |worker| Seat { worker: WorkerId(worker), capacity: 1 << 30 };
    let host = Host::new((0..u32::try_from(count)?).map(seat).collect())?;
    let homes = |mapping: Mapping| mapping.homes().to_vec();
    let mut mappings = vec![
        ("bisection", homes(bisect(guest, &host))),
        ("diffusion", homes(diffuse(guest, &host, None).mapping)),
        ("diffusion, measured", homes(diffuse(measured, &host, None).mapping)),
    ];
    if metis::is_there() {
        mappings.push(("METIS", homes(metis::map(guest, &host))));
        mappings.push(("METIS, measured", homes(metis::map(measured, &host))));
    }
    Ok(mappings)
}

/// The model of a store, with other boxes around its partitions.
fn model(
    path: &str,
    change: impl Fn(Vec<Bounds>) -> Vec<Bounds>,
) -> anyhow::Result<(Arc<Model>, Manifest)> {
    let (manifest, tables, luminaires) = Store::open_path(Path::new(path))?.into_parts();
    let parts = ModelParts {
        bounds: manifest.bounds,
        triangle_count: manifest.triangle_count,
        boxes: manifest.partitions.iter().map(|entry| change(entry.boxes.clone())).collect(),
        tables,
        luminaires,
    };
    Ok((Arc::new(Model::of_parts(parts)?), manifest))
}

fn hull(boxes: &[Bounds]) -> Bounds {
    boxes.iter().fold(Bounds::EMPTY, |hull, other| hull.joined(other))
}

/// Traces all paths, home by home.
fn forwards(
    model: &Arc<Model>,
    manifest: &Manifest,
    partitions: &[Arc<Partition>],
    homes: &[WorkerId],
) -> anyhow::Result<Forwards> {
    let mut settings = manifest.settings.clone();
    settings.height = (u64::from(WIDTH) * u64::from(settings.height) / u64::from(settings.width))
        .try_into()
        .context("an image of an ordinary shape")?;
    (settings.width, settings.crop, settings.samples_per_pixel) = (WIDTH, None, SAMPLES);
    let granularity = Granularity { tile_side_pixels: 16, samples_per_unit: SAMPLES };
    let grid = equilux_common::unit::UnitGrid::new(
        settings.width,
        settings.region(),
        settings.samples_per_pixel,
        granularity,
    );
    let whole = Renderer::of_model(Arc::clone(model), &manifest.camera, &settings, grid.clone())?;
    let at_home = |worker: WorkerId| {
        let resident = partitions.iter().zip(homes);
        let resident = resident.map(|(p, &home)| (home == worker).then(|| Arc::clone(p)));
        whole.with_partitions(PartitionSet::new(resident.collect()))
    };
    let workers: BTreeMap<WorkerId, Renderer> =
        homes.iter().map(|&worker| (worker, at_home(worker))).collect();
    let names: Vec<WorkerId> = workers.keys().copied().collect();
    let (mut counted, mut scratch) = (Forwards::default(), Scratch::default());
    let mut waiting: BTreeMap<WorkerId, Vec<Bundle>> = BTreeMap::new();
    for (id, unit) in (0..grid.unit_count()).filter_map(|id| {
        let id = equilux_common::ids::UnitId(id);
        Some((id, grid.unit(id)?))
    }) {
        let share = Share { unit: id, attempt: Attempt(0), credit: Credit::whole() };
        let path_count = unit.path_count();
        counted.paths += u64::from(path_count);
        let work = Work::Samples(Samples { share, first_path: 0, path_count });
        let worker = names[id.0 as usize % names.len()];
        let outcome = workers[&worker].trace(work, &AtomicBool::new(false), &mut scratch)?;
        send_on(outcome, None, homes, &mut waiting, &mut counted);
    }
    while let Some((worker, bundles)) = waiting.pop_first() {
        for bundle in bundles {
            let work = Work::Rays(bundle);
            let outcome = workers[&worker].trace(work, &AtomicBool::new(false), &mut scratch)?;
            send_on(outcome, Some(worker), homes, &mut waiting, &mut counted);
        }
    }
    Ok(counted)
}

/// Rays that need a partition of another home go there, from one if they have been at home at all.
fn send_on(
    outcome: Outcome,
    from: Option<WorkerId>,
    homes: &[WorkerId],
    waiting: &mut BTreeMap<WorkerId, Vec<Bundle>>,
    counted: &mut Forwards,
) {
    let RayCounts { camera, indirect, specular, shadow, .. } = outcome.counts;
    counted.rays += camera + indirect + specular + shadow;
    for bundle in outcome.successors {
        let rays = bundle.rays.len() as u64;
        counted.forwards += rays;
        counted.bytes += bundle.wire_bytes();
        if bundle.stage == Stage::Shade {
            counted.to_shade += rays;
        }
        let to = homes[bundle.partition.0 as usize];
        if let Some(from) = from {
            *counted.passages.entry([from, to]).or_default() += rays;
        }
        waiting.entry(to).or_default().push(bundle);
    }
}
