//! What the coordinator's core takes for a delivery: the figure that forecasts use.
//!
//! `cargo bench --bench cores` lets one core gather an image of 640 × 480 pixels, each of its tiles
//! of 8 × 8 pixels in four deliveries of two rows, ROUNDS times, and prints the median.

#![expect(clippy::print_stdout, reason = "a benchmark's figures are its output")]

use std::time::{Duration, Instant};

use equilux_common::balancing::Balancing;
use equilux_common::bundle::Share;
use equilux_common::credit::Credit;
use equilux_common::film::TileSums;
use equilux_common::ids::{Attempt, Incarnation, JobId, UnitId, WorkerId};
use equilux_common::job::{Filter, JobSpec, PerDepth, SceneRef, Settings};
use equilux_common::message::ToCoordinator;
use equilux_common::scene::camera::Camera;
use equilux_common::time::Time;
use equilux_common::topology::Topology;
use equilux_common::unit::{Granularity, Rect};
use equilux_coordinator_core::event::{Event, Hello, JobOrder, LinkId};
use equilux_coordinator_core::{Config, CoordinatorCore};

/// How often the image is gathered.
const ROUNDS: usize = 21;

/// Deliveries of a tile.
const PARTS: u32 = 4;

/// Side of a tile in pixels.
const SIDE: u32 = 8;

fn main() {
    let mut rounds: Vec<Duration> = (0..ROUNDS).map(|_| round()).collect();
    rounds.sort_unstable();
    println!("a delivery of {SIDE} × {} pixels, median of {ROUNDS} rounds", SIDE / PARTS);
    println!("coordinator's core {:.3} µs", rounds[ROUNDS / 2].as_secs_f64() * 1e6);
}

/// Gathers the image; gives the time of a delivery.
fn round() -> Duration {
    let order = order();
    let deliveries = deliveries(&order);
    let count = u32::try_from(deliveries.len()).expect("some thousands");
    let mut core = CoordinatorCore::new(Config::default());
    let hello = Hello { name: "one".into(), address: "one:1".into(), threads: 1, speed: 1000 };
    handle(&mut core, Event::Knocked { link: LinkId(0), hello });
    handle(&mut core, Event::Submitted(Box::new(order)));
    let started = now();
    for message in deliveries {
        let (worker, incarnation) = (WorkerId(0), Incarnation(0));
        handle(&mut core, Event::WorkerSaid { worker, incarnation, message });
    }
    let elapsed = started.elapsed();
    assert_eq!(core.job(), None, "the image is whole");
    elapsed / count
}

fn handle(core: &mut CoordinatorCore, event: Event) {
    core.handle(Time::ZERO, event);
    while core.poll_action().is_some() {}
}

fn deliveries(order: &JobOrder) -> Vec<ToCoordinator> {
    let grid = order.spec.grid();
    let units = (0..grid.unit_count()).map(UnitId);
    let of_unit = |unit: UnitId| {
        let tile = grid.unit(unit).expect("within the count").tile;
        let mut credit = Credit::whole();
        let rows = SIDE / PARTS;
        (0..PARTS).map(move |part| {
            let left = (PARTS - part) as usize;
            let credit = if left == 1 { std::mem::take(&mut credit) } else { credit.split(left) };
            let share = Share { unit, attempt: Attempt(0), credit };
            let y0 = tile.y0 + part * rows;
            let sums = TileSums::new(Rect { y0, y1: y0 + rows, ..tile });
            ToCoordinator::Delivered { job: JobId(1), share, sums }
        })
    };
    units.flat_map(of_unit).collect()
}

fn order() -> JobOrder {
    let settings = Settings {
        width: 640,
        height: 480,
        crop: None,
        filter: Filter::Box,
        samples_per_pixel: 1,
        max_depth: 4,
        light_samples: PerDepth::default(),
        indirect_samples: PerDepth::default(),
        roulette_depth: None,
        seed: 1,
    };
    let camera = Camera {
        eye: [0.0, 0.0, 1.0],
        target: [0.0; 3],
        up: [0.0, 1.0, 0.0],
        vfov: 40.0,
        aperture: 0.0,
        focus_distance: 1.0,
    };
    let scene = SceneRef { hash: [0; 32], pack_bytes: 0, entry: "scene.json".into() };
    let granularity = Granularity { tile_side_pixels: SIDE, samples_per_unit: 1 };
    JobOrder {
        spec: JobSpec { id: JobId(1), scene, camera, settings, granularity },
        balancing: Balancing::default(),
        topology: Topology::Hypercube,
        workers_min: 1,
    }
}

#[expect(clippy::disallowed_methods, reason = "a benchmark reads the clock")]
fn now() -> Instant {
    Instant::now()
}
