//! The sizes that the simulator gives messages, held against the bytes that are really written.

use std::time::Duration;

use equilux_common::balancing::Balancing;
use equilux_common::bundle::{Bundle, Share, Stage};
use equilux_common::credit::Credit;
use equilux_common::film::{PixelSums, TileSums};
use equilux_common::ids::{Attempt, Incarnation, JobId, PartitionId, UnitId, WorkerId};
use equilux_common::job::{Filter, JobSpec, PerDepth, SceneRef, Settings};
use equilux_common::message::{
    Home, JobStart, PeerAddress, PeerMessage, ToCoordinator, ToWorker, WorkerFigures,
};
use equilux_common::scene::camera::Camera;
use equilux_common::unit::{Granularity, Rect};
use equilux_common::work::{RayCounts, Samples, Work};
use equilux_proto::peer::PeerFrame;
use equilux_proto::session::{FromCoordinator, FromWorker};
use equilux_proto::{tile, v1};
use equilux_simulator::wire;
use prost::Message;

const JOB: JobId = JobId(3);

fn near(name: &str, estimated: u64, written: usize) {
    let ratio = estimated as f64 / written as f64;
    assert!((0.75..=1.25).contains(&ratio), "{name}: {estimated} estimated, {written} written");
}

fn to_worker(name: &str, message: ToWorker) {
    let estimated = wire::to_worker_bytes(&message);
    let wire = v1::CoordinatorToWorker::from(FromCoordinator::Said(message));
    near(name, estimated, wire.encoded_len());
}

fn to_coordinator(name: &str, message: ToCoordinator) {
    let estimated = wire::to_coordinator_bytes(&message);
    let wire = v1::WorkerToCoordinator::from(FromWorker::Said(message));
    near(name, estimated, wire.encoded_len());
}

fn to_peer(name: &str, message: PeerMessage) {
    let estimated = wire::peer_bytes(JOB, &message);
    let wire = v1::PeerFrame::from(PeerFrame::Said { job: JOB, message });
    near(name, estimated, wire.encoded_len());
}

fn share(unit: u32) -> Share {
    Share { unit: UnitId(unit), attempt: Attempt(0), credit: Credit::whole().split(5) }
}

fn neighbors() -> Vec<PeerAddress> {
    let peer = |bit: u32| PeerAddress {
        worker: WorkerId(900 ^ 1 << bit),
        incarnation: Incarnation(0),
        address: format!("10.0.{bit}.17:7000").into(),
    };
    (0..10).map(peer).collect()
}

fn homes() -> Vec<Home> {
    let home = |peer| Home { peer, memory: Some(1 << 30), is_late: true, is_lost: false };
    neighbors().into_iter().map(home).collect()
}

fn start() -> JobStart {
    let settings = Settings {
        width: 640,
        height: 480,
        crop: None,
        filter: Filter::Box,
        samples_per_pixel: 64,
        max_depth: 8,
        light_samples: PerDepth::default(),
        indirect_samples: PerDepth::default(),
        roulette_depth: Some(4),
        seed: 7,
    };
    let camera = Camera {
        eye: [1.0, 2.0, 3.0],
        target: [0.5, 0.6, 0.7],
        up: [0.0, 1.0, 0.0],
        vfov: 40.0,
        aperture: 0.0,
        focus_distance: 2.0,
    };
    let scene = SceneRef { hash: [9; 32], pack_bytes: 40_000_000, entry: "scene.json".into() };
    let granularity = Granularity { tile_side_pixels: 16, samples_per_unit: 16 };
    let spec = JobSpec { id: JOB, scene, camera, settings, granularity };
    let units = (700..718).map(|unit| (UnitId(unit), Attempt(0))).collect();
    let pack_from = [None, None];
    JobStart {
        spec,
        pack_from,
        neighbors: neighbors(),
        homes: homes(),
        balancing: Balancing::default(),
        units,
    }
}

fn figures() -> WorkerFigures {
    WorkerFigures {
        busy: Duration::from_millis(7300),
        idle: Duration::from_millis(12),
        finish: Duration::from_millis(7310),
        rays: RayCounts {
            camera: 900_000,
            indirect: 2_000_000,
            specular: 400_000,
            shadow: 2_500_000,
            retired: 5_800_000,
        },
        bundles_in: 80,
        bundles_out: 75,
        bytes_in: 6_000,
        bytes_out: 5_500,
        balance_requests: 31,
        peak_rss_bytes: 300_000_000,
        ..WorkerFigures::default()
    }
}

#[test]
fn what_coordinator_and_workers_say_is_as_long_as_estimated() {
    let (units, job) = (start().units, JOB);
    to_worker("job_started", ToWorker::JobStarted(Box::new(start())));
    to_worker("units_issued", ToWorker::UnitsIssued { job, units: units.clone() });
    to_worker("attempts_raised", ToWorker::AttemptsRaised { job, units });
    let gone = vec![(WorkerId(12), Incarnation(1))];
    let changed = ToWorker::NeighborsChanged { job, neighbors: neighbors(), gone };
    to_worker("neighbors_changed", changed);
    to_worker("homes_changed", ToWorker::HomesChanged { job, homes: homes() });
    to_worker("job_ended", ToWorker::JobEnded { job });
    to_coordinator("ready", ToCoordinator::Ready { job });
    let figures = Box::new(figures());
    to_coordinator("reported", ToCoordinator::Reported { job, figures });
}

#[test]
fn what_workers_say_to_one_another_is_as_long_as_estimated() {
    let load = Duration::from_micros(48_300);
    to_peer("load_asked", PeerMessage::LoadAsked { round: 9 });
    to_peer("load", PeerMessage::Load { round: 9, load, capacity: 4000 });
    to_peer("work_asked", PeerMessage::WorkAsked { amount: load });
    to_peer("declined", PeerMessage::Declined);
    let partition = PartitionId(300);
    to_peer("offered", PeerMessage::Offered { partition, load });
    to_peer("offer_taken", PeerMessage::OfferTaken { partition });
    to_peer("forwards_acknowledged", PeerMessage::ForwardsAcknowledged { count: 9 });
    to_peer("acknowledged", PeerMessage::Acknowledged { count: 1 });
    let samples = Samples { share: share(800), first_path: 2048, path_count: 512 };
    to_peer("samples", PeerMessage::Given { work: Work::Samples(samples) });
    let bundle = Bundle {
        stage: Stage::Intersect,
        partition: PartitionId(0),
        shares: vec![share(800), share(801)],
        rays: vec![bytemuck::Zeroable::zeroed(); 40],
    };
    to_peer("bundle", PeerMessage::Given { work: Work::Rays(bundle.clone()) });
    to_peer("forwarded", PeerMessage::Forwarded { bundles: vec![bundle; 5] });
}

#[test]
fn deliveries_are_as_long_as_their_touched_pixels_make_them() {
    let tile_of = |touched: usize| {
        let mut sums = TileSums::new(Rect { x0: 320, y0: 160, x1: 336, y1: 176 });
        let pixel = PixelSums::from_array([1 << 33; 16]);
        sums.pixels[..touched].fill(pixel);
        sums
    };
    let bytes = |touched: usize| tile::encode(&tile_of(touched)).len() as f64;
    let pixel_bytes = (bytes(256) - bytes(128)) / 128.0;
    for touched in [1, 16, 100, 256] {
        let message =
            ToCoordinator::Delivered { job: JOB, share: share(800), sums: tile_of(touched) };
        let estimated = wire::delivered_bytes(JOB, &share(800), touched, pixel_bytes);
        let wire = v1::WorkerToCoordinator::from(FromWorker::Said(message));
        near("delivered", estimated, wire.encoded_len());
    }
}
