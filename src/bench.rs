//! `equilux bench`: the paper's table 1 and figure 2, measured on this machine.
//!
//! Workers are processes of one thread each that talk gRPC over loopback. A measured job is
//! submitted when every worker has the scene and all links stand.

mod calibration;
mod measurement;
mod subjects;

use std::process::ExitCode;
use std::time::Duration;

use crate::args::{BenchArgs, BenchCommand, Figure2Args, MeasuredArgs, Table1Args, WORKERS_MAX};
use crate::bench::calibration::Calibration;
use crate::bench::measurement::Measurement;
use crate::bench::subjects::{MeasuredScene, Scenes};
use crate::comparison::{self, Comparison, make_directory, write_picture};
use crate::interrupt::{INTERRUPTED, Interrupt};
use crate::jobs::print_line;
use crate::table::{self, Row, time};

/// `equilux bench`. An interrupt ends it and all workers with it.
pub(crate) async fn run(args: BenchArgs) -> anyhow::Result<ExitCode> {
    let mut interrupt = Interrupt::listen()?;
    let work = async {
        match args.command {
            BenchCommand::Table1(args) => table1(args).await,
            BenchCommand::Figure2(args) => figure2(args).await,
        }
    };
    tokio::select! {
        done = work => done.map(|()| ExitCode::SUCCESS),
        () = interrupt.asked() => Ok(ExitCode::from(INTERRUPTED)),
    }
}

async fn table1(args: Table1Args) -> anyhow::Result<()> {
    args.outdir.iter().try_for_each(|directory| make_directory(directory))?;
    let scenes = Scenes::gather(&args.measured.scenes)?;
    let counts = worker_counts(&args.measured);
    let calibrations = calibrations(&scenes, &args.measured).await?;
    announce(&calibrations, &counts, &args.sizes.0);
    let mut compared = Vec::new();
    for scene in &scenes.all {
        compared.extend(measure(scene, &args.measured, &counts, &args.sizes.0).await?);
    }
    let rows: Vec<Row> = compared.iter().map(Row::new).collect();
    let checked = calibration::text(&calibrations, &compared, &args.measured);
    if args.json {
        eprintln!("{}", checked.trim_end());
        print_line(&serde_json::to_string_pretty(&rows)?)?;
    } else {
        print_line(&format!("{}\n{}", table::text(&rows), checked.trim_end()))?;
    }
    if let Some(directory) = &args.outdir {
        let workers = counts.last().copied().unwrap_or(1);
        write_picture(&comparison::figure2(&compared, workers), directory)?;
        write_picture(&comparison::efficiencies(&compared, "measured"), directory)?;
    }
    Ok(())
}

async fn figure2(args: Figure2Args) -> anyhow::Result<()> {
    make_directory(&args.outdir)?;
    let scenes = Scenes::gather(&args.measured.scenes)?;
    let most = worker_counts(&args.measured).last().copied().unwrap_or(1);
    let mut compared = Vec::new();
    for scene in &scenes.all {
        let counts: &[u32] = if most > 1 { &[1, most] } else { &[1] };
        compared.extend(measure(scene, &args.measured, counts, &[1]).await?);
    }
    write_picture(&comparison::figure2(&compared, most), &args.outdir)
}

/// All sizes and numbers of workers of a scene, sizes first.
async fn measure(
    scene: &MeasuredScene,
    args: &MeasuredArgs,
    counts: &[u32],
    sizes: &[u32],
) -> anyhow::Result<Vec<Comparison>> {
    let mut by_count = Vec::new();
    for &workers in counts {
        let mut measurement = Measurement::start(scene, args, workers).await?;
        by_count.push(measurement.pairs(sizes).await?);
        measurement.end().await;
    }
    let mut compared = Vec::new();
    for (index, &size) in sizes.iter().enumerate() {
        let alone = by_count[0][index][1].elapsed;
        for (&workers, pairs) in counts.iter().zip(&by_count) {
            let [without, with] = pairs[index].clone();
            let subject = scene.subject(size);
            compared.push(Comparison { subject, workers, alone, without, with });
        }
    }
    Ok(compared)
}

async fn calibrations(scenes: &Scenes, args: &MeasuredArgs) -> anyhow::Result<Vec<Calibration>> {
    let mut calibrations = Vec::new();
    for scene in &scenes.all {
        eprintln!("{}: rendering it in one thread, to predict what is measured", scene.name);
        calibrations.push(Calibration::record(scene, args.spp).await?);
    }
    Ok(calibrations)
}

/// Says how long all will take: each size twice for each number of workers, once for one.
fn announce(calibrations: &[Calibration], counts: &[u32], sizes: &[u32]) {
    let alone: Duration = calibrations.iter().map(Calibration::work).sum();
    let per_size: f64 =
        counts.iter().map(|&count| if count == 1 { 1.0 } else { 2.0 / f64::from(count) }).sum();
    let all = f64::from(sizes.iter().sum::<u32>()) * per_size * alone.as_secs_f64();
    eprintln!("measuring will take about {}", time(all));
}

/// A single worker, and as many as the command line says: doubled up to this machine's cores.
fn worker_counts(args: &MeasuredArgs) -> Vec<u32> {
    if let Some(counts) = &args.workers {
        return counts.with_one();
    }
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let powers = std::iter::successors(Some(1_u32), |count| count.checked_mul(2));
    powers.take_while(|&count| count as usize <= cores.min(WORKERS_MAX as usize)).collect()
}
