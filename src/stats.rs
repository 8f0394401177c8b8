//! The stats file: a run in figures, for people and for benchmarks.

use std::time::Duration;

use equilux_common::ids::WorkerId;
use equilux_common::message::WorkerFigures;
use equilux_common::work::RayCounts;
use serde::Serialize;

/// A run in figures. Times in seconds; everything that differs from run to run goes here and never
/// into an image.
#[derive(Debug, Serialize)]
pub(crate) struct Stats {
    /// From the start of the program to the image being whole.
    pub(crate) elapsed_s: f64,
    /// Of these, until the first rays were cast.
    pub(crate) startup_s: f64,
    /// Camera samples.
    pub(crate) paths: u64,
    /// Rays by kind.
    pub(crate) rays: Rays,
    /// Units of the job.
    pub(crate) units: u32,
    /// Parts of the model.
    pub(crate) partitions: u32,
    /// Channels of contributions that exceeded the film's range.
    pub(crate) saturated: u64,
    /// Contributions that were no numbers and were left out.
    pub(crate) invalid: u64,
    /// Relative noise of the image, estimated from its two halves.
    pub(crate) noise: f64,
    /// Each worker's part.
    pub(crate) workers: Vec<Worker>,
}

/// Rays spawned, by kind.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Rays {
    camera: u64,
    indirect: u64,
    specular: u64,
    shadow: u64,
}

/// A worker's part in a run.
#[derive(Debug, Serialize)]
pub(crate) struct Worker {
    worker: u32,
    busy_s: f64,
    idle_s: f64,
    finish_s: f64,
    rays: u64,
    bundles_in: u64,
    bundles_out: u64,
    rays_in: u64,
    rays_out: u64,
    forwards: u64,
    bytes_in: u64,
    bytes_out: u64,
    balance_requests: u64,
    partition_loads: u64,
    peak_rss_bytes: u64,
}

impl Rays {
    /// All workers' rays together.
    pub(crate) fn of(workers: &[(WorkerId, WorkerFigures)]) -> Self {
        let mut sum = RayCounts::default();
        workers.iter().for_each(|(_, figures)| sum.add(&figures.rays));
        Self {
            camera: sum.camera,
            indirect: sum.indirect,
            specular: sum.specular,
            shadow: sum.shadow,
        }
    }

    /// Camera samples begun.
    pub(crate) const fn paths(&self) -> u64 {
        self.camera
    }
}

impl Worker {
    /// The figures of one worker, in the units of the file.
    pub(crate) fn new(worker: WorkerId, figures: &WorkerFigures) -> Self {
        let seconds = |duration: Duration| duration.as_secs_f64();
        Self {
            worker: worker.0,
            busy_s: seconds(figures.busy),
            idle_s: seconds(figures.idle),
            finish_s: seconds(figures.finish),
            rays: figures.rays.spawned(),
            bundles_in: figures.bundles_in,
            bundles_out: figures.bundles_out,
            rays_in: figures.rays_in,
            rays_out: figures.rays_out,
            forwards: figures.forwards,
            bytes_in: figures.bytes_in,
            bytes_out: figures.bytes_out,
            balance_requests: figures.balance_requests,
            partition_loads: figures.partition_loads,
            peak_rss_bytes: figures.peak_rss_bytes,
        }
    }
}
