//! `equilux bench`: the paper's table 1 and figure 2, measured on this machine, and the speed of
//! its kernel.
//!
//! For the paper's, workers are processes of one thread each that talk gRPC over loopback. A
//! measured job is submitted when every worker has the scene and all links stand.

mod calibration;
mod kernel;
mod measurement;
mod overhead;
mod processor;
mod subjects;

use std::process::ExitCode;
use std::time::Duration;

use serde_json::json;

use crate::args::{BenchArgs, BenchCommand, Figure2Args, MeasuredArgs, Table1Args, WORKERS_MAX};
use crate::bench::calibration::{Calibrated, Calibration};
use crate::bench::measurement::{Measurement, Runs};
use crate::bench::overhead::{IdleWakes, Overhead};
use crate::bench::subjects::{MeasuredScene, Scenes};
use crate::comparison::{self, Comparison, make_directory, write_picture};
use crate::interrupt::{INTERRUPTED, Interrupt};
use crate::jobs::print_line;
use crate::subject::Subject;
use crate::table::{self, Row, time};

/// `equilux bench`. An interrupt ends it and all workers with it.
pub(crate) async fn run(args: BenchArgs) -> anyhow::Result<ExitCode> {
    let mut interrupt = Interrupt::listen()?;
    let work = async {
        match args.command {
            BenchCommand::Table1(args) => table1(args).await,
            BenchCommand::Figure2(args) => figure2(args).await,
            BenchCommand::Kernel(args) => kernel::run(args).await,
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
    scenes.check_sizes(&args.sizes.0)?;
    let counts = worker_counts(&args.measured);
    let calibrations = calibrations(&scenes, &args.measured).await?;
    announce(&calibrations, &counts, &args.sizes.0);
    let mut measured = Measured::default();
    for scene in &scenes.all {
        measured.add(scene, &args.measured, &counts, &args.sizes.0).await?;
    }
    let Measured { compared, overheads } = measured;
    let workers = counts.last().copied().unwrap_or(1);
    let idle = IdleWakes::count(&scenes.all[0], &args.measured, workers).await?;
    let calibrated = Calibrated::all(&calibrations, &compared, &args.measured);
    print(&args, &compared, &calibrated, &overheads, &idle)?;
    if let Some(directory) = &args.outdir {
        write_picture(&comparison::figure2(&compared, workers), directory)?;
        write_picture(&comparison::efficiencies(&compared, "measured"), directory)?;
    }
    Ok(())
}

fn print(
    args: &Table1Args,
    compared: &[Comparison],
    calibrated: &[Calibrated],
    overheads: &[Overhead],
    idle: &IdleWakes,
) -> anyhow::Result<()> {
    let rows: Vec<Row> = compared.iter().map(Row::new).collect();
    let below = format!("{}\n{}", calibration::text(calibrated), overhead::text(overheads, idle));
    let text = match (args.json, args.details) {
        (true, true) => serde_json::to_string_pretty(&json!({
            "rows": rows,
            "calibration": calibrated,
            "overhead": overheads,
            "idle_wakes": idle,
        }))?,
        (true, false) => {
            eprintln!("{}", below.trim_end());
            serde_json::to_string_pretty(&rows)?
        }
        (false, _) => format!("{}\n{}", table::text(&rows), below.trim_end()),
    };
    Ok(print_line(&text)?)
}

async fn figure2(args: Figure2Args) -> anyhow::Result<()> {
    make_directory(&args.outdir)?;
    let scenes = Scenes::gather(&args.measured.scenes)?;
    let most = worker_counts(&args.measured).last().copied().unwrap_or(1);
    let mut measured = Measured::default();
    for scene in &scenes.all {
        let counts: &[u32] = if most > 1 { &[1, most] } else { &[1] };
        measured.add(scene, &args.measured, counts, &[1]).await?;
    }
    write_picture(&comparison::figure2(&measured.compared, most), &args.outdir)
}

/// What was measured so far.
#[derive(Default)]
struct Measured {
    compared: Vec<Comparison>,
    overheads: Vec<Overhead>,
}

impl Measured {
    /// Measures all sizes and numbers of workers of a scene, and orders them by size.
    async fn add(
        &mut self,
        scene: &MeasuredScene,
        args: &MeasuredArgs,
        counts: &[u32],
        sizes: &[u32],
    ) -> anyhow::Result<()> {
        let mut by_size: Vec<Vec<(u32, Runs)>> = sizes.iter().map(|_| Vec::new()).collect();
        for &workers in counts {
            let mut measurement = Measurement::start(scene, args, workers).await?;
            for (&size, runs) in sizes.iter().zip(&mut by_size) {
                runs.push((workers, measurement.runs(size).await?));
            }
            measurement.end().await;
        }
        for (&size, runs) in sizes.iter().zip(by_size) {
            // The first count is that of one worker.
            let alone = runs[0].1.with.outcome.elapsed;
            for (workers, runs) in runs {
                self.push(scene.subject(size), workers, alone, runs);
            }
        }
        Ok(())
    }

    fn push(&mut self, subject: Subject, workers: u32, alone: Duration, runs: Runs) {
        for run in [Some(&runs.with), runs.without.as_ref()].into_iter().flatten() {
            let overhead = Overhead::new(subject.clone(), workers, run.balance, run.spent);
            self.overheads.push(overhead);
        }
        let with = runs.with.outcome;
        // One worker has nobody to exchange work with.
        let without = runs.without.map_or_else(|| with.clone(), |run| run.outcome);
        self.compared.push(Comparison { subject, workers, alone, without, with });
    }
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
