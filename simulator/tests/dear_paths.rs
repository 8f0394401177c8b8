//! Paths that take milliseconds are shared, though there are few of them and no worker knows at
//! first which they are.

use std::time::Duration;

use equilux_common::balancing::Balancing;
use equilux_common::costs::{COSTS_VERSION, CellCosts, SceneCosts};
use equilux_common::topology::Topology;
use equilux_simulator::forecast::{Amount, Forecast, Scenario, SimulatedWorker, forecast};
use equilux_simulator::network::NetworkModel;

const COLUMNS: u32 = 20;
const ROWS: u32 = 15;

const SEEDS: std::ops::Range<u64> = 1..13;

/// Paths of the cells in milliseconds, by column and row; each cell has so many pixels a side, with
/// one sample each. A path is a chain of three rays.
fn costs(cell_side_pixels: u32, millis: impl Fn(u32, u32) -> f32) -> SceneCosts {
    let cell = |number: u32| CellCosts {
        rays_per_path: vec![1.0; 3],
        nanos_per_ray: vec![millis(number % COLUMNS, number / COLUMNS) * 1e6 / 3.0; 3],
    };
    SceneCosts {
        equilux_costs: COSTS_VERSION,
        scene: "dear paths".into(),
        width: COLUMNS * cell_side_pixels,
        height: ROWS * cell_side_pixels,
        samples_per_pixel: 1,
        cell_side_pixels,
        prepare_s: 0.001,
        bytes_per_pixel: 70.0,
        cells: (0..COLUMNS * ROWS).map(cell).collect(),
        partitioned: None,
    }
}

/// What it comes to on so many workers of so many threads.
fn render(costs: &SceneCosts, worker_count: usize, threads: u32, seed: u64) -> Forecast {
    let worker = SimulatedWorker {
        threads,
        speed: 1000,
        memory: None,
        joins: Duration::ZERO,
        changes: Vec::new(),
    };
    let scenario = Scenario {
        seed,
        network: NetworkModel::ethernet(),
        workers: vec![worker; worker_count],
        topology: Topology::Hypercube,
        balancing: Balancing::default(),
        amount: Amount::Size(1),
    };
    forecast(costs, &scenario)
}

/// The mean efficiency over some seeds: where few paths decide, it varies by a tenth from one to
/// the next.
fn mean_efficiency(costs: &SceneCosts, worker_count: usize, threads: u32) -> f64 {
    let efficiency = |seed| render(costs, worker_count, threads, seed).efficiency();
    SEEDS.map(efficiency).sum::<f64>() / SEEDS.count() as f64
}

/// From 5 to 20 ms, in blocks of 5 by 5 cells.
fn uneven(column: u32, row: u32) -> f32 {
    let block = column / 5 + row / 5 * 4;
    5.0 + 15.0 * (block * 7 % 10) as f32 / 9.0
}

#[test]
fn three_hundred_dear_paths_a_worker_end_together() {
    let forecast = render(&costs(8, uneven), 64, 1, 1);
    assert!(forecast.efficiency() > 0.985, "{}", forecast.efficiency());
    assert!(forecast.spread() < forecast.elapsed / 50, "{:?}", forecast.spread());
}

#[test]
fn nineteen_dear_paths_a_worker_are_shared_one_by_one() {
    // 18.75 each: where one does three too many, the others wait.
    let efficiency = mean_efficiency(&costs(2, |_, _| 15.0), 64, 1);
    assert!(efficiency > 18.75 / 22.0, "{efficiency}");
}

/// A few dear paths among cheap ones.
fn glass(column: u32, row: u32) -> f32 {
    let is_glass = (column + COLUMNS * row) % 37 == 5;
    if is_glass { 15.0 } else { uneven(column, row) / 100.0 }
}

#[test]
fn dear_paths_among_cheap_ones_are_found() {
    let efficiency = mean_efficiency(&costs(8, glass), 64, 1);
    assert!(efficiency > 0.72, "{efficiency}");
}

#[test]
fn a_thread_with_a_dear_path_does_not_keep_the_others_of_its_worker_from_asking() {
    let efficiency = mean_efficiency(&costs(8, glass), 8, 8);
    assert!(efficiency > 0.85, "{efficiency}");
}
