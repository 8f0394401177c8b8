//! What the cores take for a message: the figures that forecasts use.
//!
//! `cargo bench --bench cores` measures each kind of message ROUNDS times and prints the medians:
//!
//! - deliveries to the coordinator's core, which gathers an image of 640 × 480 pixels, of whole
//!   units of 4 × 4 pixels, and of units of 4 × 4 and of 8 × 8 pixels in four parts each;
//! - starting a job with 4,096 workers, for each of them;
//! - a question for load in a worker's core, and its answer.

#![expect(clippy::print_stdout, reason = "a benchmark's figures are its output")]

use std::hint::black_box;
use std::time::{Duration, Instant};

use equilux_common::balancing::Balancing;
use equilux_common::bundle::Share;
use equilux_common::credit::Credit;
use equilux_common::film::TileSums;
use equilux_common::ids::{Attempt, Incarnation, JobId, UnitId, WorkerId};
use equilux_common::job::{Filter, JobSpec, PerDepth, SceneRef, Settings};
use equilux_common::message::{JobStart, PeerAddress, PeerMessage, ToCoordinator, ToWorker};
use equilux_common::scene::camera::Camera;
use equilux_common::time::Time;
use equilux_common::topology::Topology;
use equilux_common::unit::{Granularity, Rect};
use equilux_coordinator_core::event::{Event, Hello, JobOrder, LinkId};
use equilux_coordinator_core::{Config, CoordinatorCore};
use equilux_worker_core::WorkerCore;
use equilux_worker_core::event::Event as WorkerEvent;

/// How often each figure is measured.
const ROUNDS: usize = 21;

/// Workers that a job is started with.
const WORKERS: u32 = 4096;

/// Questions that a worker answers in a round.
const QUESTIONS: u32 = 10_000;

fn main() {
    println!("time of a core for a message, median of {ROUNDS} rounds");
    print("delivery of a whole unit of 4 × 4 pixels", || deliver(4, 1));
    print("delivery of a part of 4 × 1 pixels", || deliver(4, 4));
    print("delivery of a part of 8 × 2 pixels", || deliver(8, 4));
    print("start of a job, for each worker", start);
    print("question for load and its answer", answer);
}

fn print(what: &str, measure: impl Fn() -> Duration) {
    let mut rounds: Vec<Duration> = (0..ROUNDS).map(|_| measure()).collect();
    rounds.sort_unstable();
    println!("{what:40}  {:.3} µs", rounds[ROUNDS / 2].as_secs_f64() * 1e6);
}

/// Gathers the image of tiles with this side, each in so many parts; gives the time of a delivery.
fn deliver(side: u32, parts: u32) -> Duration {
    let order = order(side);
    let deliveries = deliveries(&order, side, parts);
    let count = u32::try_from(deliveries.len()).expect("some thousands");
    let mut core = CoordinatorCore::new(Config::default());
    handle(&mut core, Event::Knocked { link: LinkId(0), hello: hello(0) });
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

/// Starts a job; gives the time for each worker.
fn start() -> Duration {
    let mut core = CoordinatorCore::new(Config::default());
    for worker in 0..WORKERS {
        handle(&mut core, Event::Knocked { link: LinkId(worker.into()), hello: hello(worker) });
    }
    let order = order(4);
    let started = now();
    handle(&mut core, Event::Submitted(Box::new(order)));
    started.elapsed() / WORKERS
}

/// Answers questions for load; gives the time for each.
fn answer() -> Duration {
    let (worker, incarnation) = (WorkerId(0), Incarnation(0));
    let config =
        equilux_worker_core::Config { worker, incarnation, threads: 1, speed: 1000, memory: None };
    let mut core = WorkerCore::new(config);
    let order = order(4);
    let peers = (1..=10).map(|peer| PeerAddress {
        worker: WorkerId(peer),
        incarnation,
        address: format!("worker-{peer}:7000").into(),
    });
    let start = JobStart {
        units: (0..1000).map(|unit| (UnitId(unit), Attempt(0))).collect(),
        neighbors: peers.collect(),
        homes: Vec::new(),
        spec: order.spec,
        balancing: order.balancing,
        pack_from: Default::default(),
    };
    let said = ToWorker::JobStarted(Box::new(start));
    tell(&mut core, WorkerEvent::CoordinatorSaid(said));
    tell(&mut core, WorkerEvent::SceneLoaded { job: JobId(1), partitions: None });
    let peer = WorkerId(3);
    tell(&mut core, WorkerEvent::PeerLinked { peer, incarnation });
    let started = now();
    for round in 0..QUESTIONS {
        let message = PeerMessage::LoadAsked { round };
        let (job, bytes) = (JobId(1), 10);
        let event = WorkerEvent::PeerSaid { peer, incarnation, job, message, bytes };
        tell(&mut core, event);
    }
    started.elapsed() / QUESTIONS
}

fn handle(core: &mut CoordinatorCore, event: Event) {
    core.handle(Time::ZERO, event);
    while core.poll_action().is_some() {}
}

fn tell(core: &mut WorkerCore, event: WorkerEvent) {
    core.handle(Time::ZERO, event);
    while let Some(action) = core.poll_action() {
        black_box(action);
    }
}

fn deliveries(order: &JobOrder, side: u32, parts: u32) -> Vec<ToCoordinator> {
    let grid = order.spec.grid();
    let units = (0..grid.unit_count()).map(UnitId);
    let of_unit = |unit: UnitId| {
        let tile = grid.unit(unit).expect("within the count").tile;
        let mut credit = Credit::whole();
        let rows = side / parts;
        (0..parts).map(move |part| {
            let left = (parts - part) as usize;
            let credit = if left == 1 { std::mem::take(&mut credit) } else { credit.split(left) };
            let share = Share { unit, attempt: Attempt(0), credit };
            let y0 = tile.y0 + part * rows;
            let sums = TileSums::new(Rect { y0, y1: y0 + rows, ..tile });
            ToCoordinator::Delivered { job: JobId(1), share, sums }
        })
    };
    units.flat_map(of_unit).collect()
}

fn hello(worker: u32) -> Hello {
    let (name, address) = (format!("worker-{worker}"), format!("worker-{worker}:7000"));
    Hello { name, address: address.into(), threads: 1, speed: 1000, memory: None }
}

fn order(tile_side_pixels: u32) -> JobOrder {
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
    let granularity = Granularity { tile_side_pixels, samples_per_unit: 1 };
    JobOrder {
        spec: JobSpec { id: JobId(1), scene, camera, settings, granularity },
        balancing: Balancing::default(),
        topology: Topology::Hypercube,
        workers_min: 1,
        is_partitioned: false,
    }
}

#[expect(clippy::disallowed_methods, reason = "a benchmark reads the clock")]
fn now() -> Instant {
    Instant::now()
}
