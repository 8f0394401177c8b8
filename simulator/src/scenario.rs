//! A scenario turned into a run: the job, the machines and what its paths cost.

use std::time::Duration;

use equilux_common::costs::SceneCosts;
use equilux_common::ids::JobId;
use equilux_common::itinerary::PartitionedCosts;
use equilux_common::job::{
    Filter, IMAGE_PIXELS_MAX, JobSpec, PerDepth, SAMPLES_MAX, SIDE_PIXELS_MAX, SceneRef, Settings,
};
use equilux_common::unit::{Granularity, Rect};
use equilux_mapping::{Guest, Object, Tie};

use crate::cells::pass_cost;
use crate::forecast::{Amount, Scenario, SimulatedWorker};
use crate::plan::{Machine, Plan, camera};

/// Steps of a forecast; the largest foreseen take some ten million.
const STEPS_MAX: u64 = 10_000_000_000;

/// The image that is rendered when an amount of work is asked for.
const WIDTH: u32 = 640;
const HEIGHT: u32 = 480;

/// Workers do not measure their speed, and say so by this number.
const SPEED_UNMEASURED: u32 = 1000;

/// What is rendered, and the factor of the recorded costs.
pub(crate) fn job(costs: &SceneCosts, scenario: &Scenario) -> (JobSpec, f64) {
    let threads = present(scenario).map(|worker| worker.threads).sum();
    match scenario.amount {
        Amount::Size(size) => {
            let (width, height) = sides(costs, size);
            (spec(width, height, costs.samples_per_pixel, threads), 1.0)
        }
        Amount::Work(work) => {
            let passes = work.as_secs_f64() / pass_cost(costs, WIDTH, HEIGHT).as_secs_f64();
            let samples = passes.round().clamp(1.0, f64::from(SAMPLES_MAX));
            (spec(WIDTH, HEIGHT, samples as u32, threads), passes / samples)
        }
    }
}

/// The recorded image's sides with so many times as many pixels, within the limits of images.
fn sides(costs: &SceneCosts, size: u32) -> (u32, u32) {
    let recorded = f64::from(costs.width) * f64::from(costs.height);
    let factor = f64::from(size.max(1)).min(IMAGE_PIXELS_MAX as f64 / recorded).sqrt();
    let side = |side: u32| (f64::from(side) * factor).floor().clamp(1.0, SIDE_PIXELS_MAX.into());
    (side(costs.width) as u32, side(costs.height) as u32)
}

/// The workers that are there when the job is submitted.
pub(crate) fn present(scenario: &Scenario) -> impl Iterator<Item = &SimulatedWorker> {
    scenario.workers.iter().filter(|worker| worker.joins.is_zero())
}

/// A job of this size, for so many threads in all.
pub(crate) fn spec(width: u32, height: u32, samples_per_pixel: u32, threads: u32) -> JobSpec {
    let region = Rect { x0: 0, y0: 0, x1: width, y1: height };
    let settings = Settings {
        width,
        height,
        crop: None,
        filter: Filter::Box,
        samples_per_pixel,
        max_depth: 4,
        light_samples: PerDepth::default(),
        indirect_samples: PerDepth::default(),
        roulette_depth: None,
        seed: 1,
    };
    let scene = SceneRef { hash: [0; 32], pack_bytes: 0, entry: "scene.json".into() };
    let granularity = Granularity::for_job(region, samples_per_pixel, threads);
    JobSpec { id: JobId(1), scene, camera: camera(), settings, granularity }
}

/// The run up to the submission: only those are there who come before it.
pub(crate) fn plan(costs: &SceneCosts, scenario: &Scenario) -> Plan {
    let machines = scenario.workers.iter().enumerate();
    let load = Duration::from_secs_f64(costs.prepare_s);
    Plan {
        seed: scenario.seed,
        network: scenario.network,
        copied_percent: 0,
        machines: machines.map(|(number, worker)| machine(number, worker)).collect(),
        jobs: Vec::new(),
        cancelled: None,
        guest: cut(costs, scenario).map(guest),
        load: load..=load,
        partition_load: Duration::ZERO..=Duration::ZERO,
        pixel_bytes: costs.bytes_per_pixel,
        is_checked: false,
        steps_max: STEPS_MAX,
    }
}

/// The partitions, if not everybody has all of the model in memory from the start.
pub(crate) fn cut<'a>(costs: &'a SceneCosts, scenario: &Scenario) -> Option<&'a PartitionedCosts> {
    let is_limited = scenario.workers.iter().any(|worker| worker.memory.is_some());
    costs.partitioned.as_ref().filter(|_| is_limited)
}

/// The recorded partitions.
fn guest(costs: &PartitionedCosts) -> Guest {
    let objects = costs
        .partitions
        .iter()
        .map(|partition| Object { bytes: partition.memory_bytes, position: partition.position });
    let ties = costs.ties.iter().map(|&(first, second, affinity)| Tie {
        objects: [first as usize, second as usize],
        affinity,
    });
    Guest::new(objects.collect(), ties.collect()).expect("costs are checked when they are read")
}

fn machine(number: usize, worker: &SimulatedWorker) -> Machine {
    Machine {
        name: format!("host{number}"),
        threads: worker.threads,
        speed: worker.speed,
        claimed_speed: SPEED_UNMEASURED,
        memory: worker.memory,
        turns: worker.joins.is_zero().then_some(Duration::ZERO).into_iter().collect(),
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::network::NetworkModel;
    use equilux_common::balancing::Balancing;
    use equilux_common::costs::{COSTS_VERSION, CellCosts};
    use equilux_common::topology::Topology;

    /// Large blocks whose paths cost from once to ten times as much, at 640 × 480.
    pub(crate) fn costs() -> SceneCosts {
        let cell = |number: u32| {
            let block = number % 20 / 5 + number / 20 / 5 * 4;
            let nanos = 1000.0 * (1 + block * 7 % 10) as f32;
            CellCosts {
                rays_per_path: vec![1.0, 0.9, 1.2, 0.3, 0.0],
                nanos_per_ray: vec![nanos, 0.8 * nanos, 0.5 * nanos, 0.4 * nanos, 1.0],
            }
        };
        SceneCosts {
            equilux_costs: COSTS_VERSION,
            scene: "blocks".into(),
            width: 640,
            height: 480,
            samples_per_pixel: 4,
            cell_side_pixels: 32,
            prepare_s: 0.001,
            bytes_per_pixel: 70.0,
            cells: (0..300).map(cell).collect(),
            partitioned: None,
        }
    }

    /// One worker on a fast network.
    pub(crate) fn scenario(amount: Amount) -> Scenario {
        let worker = SimulatedWorker {
            threads: 1,
            speed: 1000,
            memory: None,
            joins: Duration::ZERO,
            changes: vec![],
        };
        Scenario {
            seed: 1,
            network: NetworkModel::cluster(),
            workers: vec![worker],
            topology: Topology::Hypercube,
            balancing: Balancing::default(),
            amount,
        }
    }

    #[test]
    fn work_is_exact_and_sizes_are_numbers_of_pixels() {
        let (spec, factor) = job(&costs(), &scenario(Amount::Work(Duration::from_secs(30))));
        let pass = pass_cost(&costs(), WIDTH, HEIGHT).as_secs_f64();
        let work = pass * factor * f64::from(spec.settings.samples_per_pixel);
        assert!((work - 30.0).abs() < 1e-6 && (factor - 1.0).abs() < 0.1, "{work} {factor}");
        let (spec, factor) = job(&costs(), &scenario(Amount::Size(9)));
        assert_eq!((spec.settings.width, spec.settings.height, factor), (1920, 1440, 1.0));
    }
}
