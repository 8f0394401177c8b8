//! Any message that a correct program may send, for the tests of the conversions.

use std::time::Duration;

use bytemuck::Zeroable;
use equilux_common::balancing::{
    Balance, Balancing, DiffusionStep, Exchange, GiveFirst, Mapping, Word,
};
use equilux_common::bundle::{Bundle, Share, Stage};
use equilux_common::credit::Credit;
use equilux_common::film::{PIXEL_SUMS, PixelSums, TileSums};
use equilux_common::ids::{Attempt, Incarnation, JobId, PartitionId, UnitId, WorkerId};
use equilux_common::job::{Filter, JobSpec, PerDepth, SceneRef, Settings};
use equilux_common::message::{
    Home, JobStart, PeerAddress, PeerMessage, ToCoordinator, ToWorker, WorkerFigures,
};
use equilux_common::ray::Ray;
use equilux_common::scene::camera::Camera;
use equilux_common::unit::{Granularity, Rect};
use equilux_common::work::{RayCounts, Samples, Work};
use proptest::prelude::*;
use proptest::{collection::vec, option, sample::Index, sample::select};

use crate::hello::{Hello, PeerHello, Welcome};
use crate::peer::PeerFrame;
use crate::session::{FromCoordinator, FromWorker};

pub(crate) fn share() -> impl Strategy<Value = Share> {
    let credit = (vec(any::<u64>(), 0..3), 1u64..).prop_map(|(mut words, last)| {
        words.push(last);
        words[0] = if words.len() == 1 { words[0] >> 1 | 1 } else { words[0] >> 1 };
        Credit::from_words(&words).expect("below the whole, and the last word is not zero")
    });
    (any::<u32>(), any::<u32>(), credit).prop_map(|(unit, attempt, credit)| Share {
        unit: UnitId(unit),
        attempt: Attempt(attempt),
        credit,
    })
}

pub(crate) fn samples() -> impl Strategy<Value = Samples> {
    (share(), 0..1u32 << 30, 1..1u32 << 30).prop_map(|(share, first_path, path_count)| Samples {
        share,
        first_path,
        path_count,
    })
}

fn finite() -> impl Strategy<Value = f32> {
    any::<f32>().prop_filter("finite", |number| number.is_finite())
}

fn vector() -> impl Strategy<Value = [f32; 3]> {
    [finite(), finite(), finite()]
}

fn ray(shares: u8) -> impl Strategy<Value = Ray> {
    let distance = prop_oneof![finite().prop_map(f32::abs), Just(f32::INFINITY)];
    let place = (any::<[u32; 5]>(), any::<u16>(), 0..shares, any::<u8>());
    (vector(), vector(), vector(), distance, finite(), place).prop_map(
        |(origin, direction, throughput, distance, pdf, (names, depth, share, flags))| {
            let [hit_primitive, hit_partition, pixel, sample_index, branch] = names;
            let pdf = pdf.abs();
            #[rustfmt::skip]
            let ray = Ray {
                origin, direction, throughput, distance, hit_primitive, hit_partition, pixel,
                sample_index, branch, pdf, depth, share, flags,
            };
            ray
        },
    )
}

pub(crate) fn bundle() -> impl Strategy<Value = Bundle> {
    let stage = prop_oneof![Just(Stage::Intersect), Just(Stage::Shade), Just(Stage::Shadow)];
    let content = vec(share(), 1..6)
        .prop_flat_map(|shares| (vec(ray(shares.len() as u8), 1..10), Just(shares)));
    (stage, any::<u32>(), content).prop_map(|(stage, partition, (rays, shares))| Bundle {
        stage,
        partition: PartitionId(partition),
        shares,
        rays,
    })
}

/// One share, two rays.
pub(crate) fn plain_bundle() -> Bundle {
    let share = Share { unit: UnitId(3), attempt: Attempt(0), credit: Credit::whole() };
    let rays = vec![Ray::zeroed(); 2];
    Bundle { stage: Stage::Intersect, partition: PartitionId(0), shares: vec![share], rays }
}

fn sums() -> impl Strategy<Value = PixelSums> {
    let number = prop_oneof![Just(0), any::<i64>(), -100i64..100];
    vec(number, PIXEL_SUMS).prop_map(|numbers| {
        let array = numbers.try_into().expect("as many as asked for");
        let sums = PixelSums::from_array(array);
        let count = |number: i64| number & i64::MAX;
        let (even_samples, odd_samples) = (count(sums.even_samples), count(sums.odd_samples));
        PixelSums { even_samples, odd_samples, hits: count(sums.hits), ..sums }
    })
}

pub(crate) fn tile_sums() -> impl Strategy<Value = TileSums> {
    let tile = (0u32..65_500, 0u32..65_500, 1u32..9, 1u32..9);
    let pixel = prop_oneof![Just(PixelSums::default()), sums()];
    tile.prop_flat_map(move |(x0, y0, width, height)| {
        let tile = Rect { x0, y0, x1: x0 + width, y1: y0 + height };
        let pixels = vec(pixel.clone(), tile.pixel_count());
        (Just(tile), pixels, any::<u64>(), any::<u64>())
    })
    .prop_map(|(tile, pixels, saturated, invalid)| TileSums {
        tile,
        pixels,
        saturated,
        invalid,
    })
}

/// As many bytes as a tile can take.
pub(crate) fn largest_tile() -> TileSums {
    let mut sums = TileSums::new(Rect { x0: 0, y0: 0, x1: 64, y1: 64 });
    sums.pixels.fill(PixelSums::from_array([i64::MAX; PIXEL_SUMS]));
    sums
}

/// Units of a job that has `count`.
pub(crate) fn units(count: u32) -> impl Strategy<Value = Vec<(UnitId, Attempt)>> {
    let run = (0..count, 1u32..5, any::<u32>());
    vec(run, 0..6).prop_map(move |runs| {
        let of_run = |(first, length, attempt): (u32, u32, u32)| {
            let end = count.min(first + length);
            (first..end).map(move |id| (UnitId(id), Attempt(attempt)))
        };
        runs.into_iter().flat_map(of_run).take(count as usize).collect()
    })
}

pub(crate) fn roster() -> impl Strategy<Value = Vec<PeerAddress>> {
    let entry = (any::<u64>(), "[a-z][a-z0-9.-]{0,10}:[1-9][0-9]{0,3}");
    prop::collection::btree_map(any::<u32>(), entry, 0..6).prop_map(|roster| {
        let entry = |(worker, (incarnation, address)): (_, (_, String))| PeerAddress {
            worker: WorkerId(worker),
            incarnation: Incarnation(incarnation),
            address: address.into(),
        };
        roster.into_iter().map(entry).collect()
    })
}

/// An ordinary job.
pub(crate) fn plain_job() -> JobSpec {
    JobSpec {
        id: JobId(1),
        scene: SceneRef { hash: [7; 32], pack_bytes: 1000, entry: "scene.json".into() },
        camera: Camera {
            eye: [0.0; 3],
            target: [0.0, 0.0, -1.0],
            up: [0.0, 1.0, 0.0],
            vfov: 40.0,
            aperture: 0.0,
            focus_distance: 1.0,
        },
        settings: Settings {
            width: 64,
            height: 48,
            crop: None,
            filter: Filter::Box,
            samples_per_pixel: 16,
            max_depth: 5,
            light_samples: PerDepth::default(),
            indirect_samples: PerDepth::default(),
            roulette_depth: None,
            seed: 0,
        },
        granularity: Granularity { tile_side_pixels: 16, samples_per_unit: 16 },
    }
}

/// An ordinary job as it is started.
pub(crate) fn plain_start() -> JobStart {
    JobStart {
        spec: plain_job(),
        neighbors: vec![],
        homes: vec![],
        balancing: Balancing::default(),
        units: vec![],
        pack_from: [None, None],
    }
}

/// An ordinary worker.
pub(crate) fn plain_peer() -> PeerAddress {
    let (worker, incarnation) = (WorkerId(3), Incarnation(2));
    PeerAddress { worker, incarnation, address: "localhost:7000".into() }
}

fn camera() -> impl Strategy<Value = Camera> {
    (vector(), vector(), vector(), 0.1f32..179.9, 0f32..1e9, finite()).prop_map(
        |(eye, target, up, vfov, aperture, focus_distance)| Camera {
            eye,
            target,
            up,
            vfov,
            aperture,
            focus_distance,
        },
    )
}

fn settings() -> impl Strategy<Value = Settings> {
    let filter = prop_oneof![Just(Filter::Box), Just(Filter::Tent), Just(Filter::Gaussian)];
    let lists = (vec(0u32..1025, 1..5), vec(0u32..1025, 1..5));
    let crop = option::of((0u32..10, 0u32..10, 11u32..20, 11u32..20));
    let size = (20u32..4000, 20u32..4000, 1u32..5000, 1u32..1025);
    (filter, lists, crop, size, option::of(any::<u32>()), any::<u64>()).prop_map(
        |(filter, (light, indirect), crop, (width, height, samples, depth), roulette, seed)| {
            Settings {
                width,
                height,
                crop: crop.map(|(x0, y0, x1, y1)| Rect { x0, y0, x1, y1 }),
                filter,
                samples_per_pixel: samples,
                max_depth: depth,
                light_samples: PerDepth::new(light).expect("within the limits"),
                indirect_samples: PerDepth::new(indirect).expect("within the limits"),
                roulette_depth: roulette,
                seed,
            }
        },
    )
}

pub(crate) fn job_spec() -> impl Strategy<Value = JobSpec> {
    let scene = (any::<[u8; 32]>(), 0u64..1 << 36, ".{1,20}")
        .prop_map(|(hash, pack_bytes, entry)| SceneRef { hash, pack_bytes, entry });
    let granularity = (8u32..65, 64u32..200).prop_map(|(tile_side_pixels, samples_per_unit)| {
        Granularity { tile_side_pixels, samples_per_unit }
    });
    (any::<u64>(), scene, camera(), settings(), granularity).prop_map(
        |(id, scene, camera, settings, granularity)| JobSpec {
            id: JobId(id),
            scene,
            camera,
            settings,
            granularity,
        },
    )
}

fn start() -> impl Strategy<Value = JobStart> {
    let spec = job_spec().prop_flat_map(|spec| {
        let count = spec.grid().unit_count();
        (Just(spec), units(count))
    });
    let from = (roster(), roster()).prop_map(|(mut even, mut odd)| [even.pop(), odd.pop()]);
    (spec, roster(), homes(), balancing(), from).prop_map(
        |((spec, units), neighbors, homes, balancing, pack_from)| JobStart {
            spec,
            neighbors,
            homes,
            balancing,
            units,
            pack_from,
        },
    )
}

pub(crate) fn balancing() -> impl Strategy<Value = Balancing> {
    let step = select(DiffusionStep::ALL);
    let homes = (select(Exchange::ALL), select(Mapping::ALL));
    (select(Balance::ALL), step, select(GiveFirst::ALL), homes).prop_map(
        |(balance, step, give_first, (exchange, mapping))| Balancing {
            balance,
            step,
            give_first,
            exchange,
            mapping,
        },
    )
}

fn figures() -> impl Strategy<Value = WorkerFigures> {
    any::<[u64; 18]>().prop_map(|numbers| WorkerFigures {
        busy: Duration::from_nanos(numbers[0]),
        idle: Duration::from_nanos(numbers[1]),
        finish: Duration::from_nanos(numbers[2]),
        rays: RayCounts {
            camera: numbers[3],
            indirect: numbers[4],
            specular: numbers[5],
            shadow: numbers[6],
            retired: numbers[7],
        },
        bundles_in: numbers[8],
        bundles_out: numbers[9],
        rays_in: numbers[10],
        rays_out: numbers[11],
        bytes_in: numbers[12],
        bytes_out: numbers[13],
        balance_requests: numbers[14],
        partition_loads: numbers[15],
        peak_rss_bytes: numbers[16],
        forwards: numbers[17],
    })
}

pub(crate) fn peer_frame() -> impl Strategy<Value = PeerFrame> {
    let load = || any::<u64>().prop_map(Duration::from_nanos);
    let partition = || any::<u32>().prop_map(PartitionId);
    let work = prop_oneof![samples().prop_map(Work::Samples), bundle().prop_map(Work::Rays)];
    let message = prop_oneof![
        any::<u32>().prop_map(|round| PeerMessage::LoadAsked { round }),
        (any::<u32>(), load(), 1u64..).prop_map(|(round, load, capacity)| PeerMessage::Load {
            round,
            load,
            capacity
        }),
        Just(PeerMessage::Declined),
        load().prop_map(|amount| PeerMessage::WorkAsked { amount }),
        work.prop_map(|work| PeerMessage::Given { work }),
        vec(bundle(), 1..4).prop_map(|bundles| PeerMessage::Forwarded { bundles }),
        (1u32..).prop_map(|count| PeerMessage::ForwardsAcknowledged { count }),
        (partition(), load())
            .prop_map(|(partition, load)| PeerMessage::Offered { partition, load }),
        partition().prop_map(|partition| PeerMessage::OfferTaken { partition }),
        partition().prop_map(|partition| PeerMessage::OfferRefused { partition }),
        (1u32..).prop_map(|count| PeerMessage::Acknowledged { count }),
    ];
    let hello = (any::<u32>(), any::<u64>()).prop_map(|(worker, incarnation)| PeerHello {
        worker: WorkerId(worker),
        incarnation: Incarnation(incarnation),
    });
    prop_oneof![
        1 => hello.prop_map(PeerFrame::Hello),
        5 => (any::<u64>(), message)
            .prop_map(|(job, message)| PeerFrame::Said { job: JobId(job), message }),
    ]
}

pub(crate) fn from_worker() -> impl Strategy<Value = FromWorker> {
    let job = || any::<u64>().prop_map(JobId);
    let memory = option::of(any::<u64>());
    let hello = (".{1,20}", 1u32..9, 1u32.., memory);
    let hello = hello.prop_map(|(name, threads, speed, memory)| Hello {
        name,
        address: "[::1]:7".into(),
        threads,
        speed,
        memory,
    });
    prop_oneof![
        hello.prop_map(FromWorker::Hello),
        job().prop_map(|job| FromWorker::Said(ToCoordinator::Ready { job })),
        (job(), ".{0,40}")
            .prop_map(|(job, reason)| FromWorker::Said(ToCoordinator::Failed { job, reason })),
        (job(), share(), tile_sums()).prop_map(|(job, share, sums)| {
            FromWorker::Said(ToCoordinator::Delivered { job, share, sums })
        }),
        (job(), figures().prop_map(Box::new))
            .prop_map(|(job, figures)| FromWorker::Said(ToCoordinator::Reported { job, figures })),
    ]
}

pub(crate) fn from_coordinator() -> impl Strategy<Value = FromCoordinator> {
    let job = || any::<u64>().prop_map(JobId);
    let welcome = (any::<u32>(), any::<u64>()).prop_map(|(worker, incarnation)| Welcome {
        worker: WorkerId(worker),
        incarnation: Incarnation(incarnation),
    });
    let said = prop_oneof![
        start().prop_map(|start| ToWorker::JobStarted(Box::new(start))),
        (job(), roster(), vec(any::<(u32, u64)>(), 0..4)).prop_map(|(job, neighbors, gone)| {
            let life = |(worker, incarnation)| (WorkerId(worker), Incarnation(incarnation));
            let gone = gone.into_iter().map(life).collect();
            ToWorker::NeighborsChanged { job, neighbors, gone }
        }),
        (job(), homes()).prop_map(|(job, homes)| ToWorker::HomesChanged { job, homes }),
        (job(), units(900)).prop_map(|(job, units)| ToWorker::AttemptsRaised { job, units }),
        (job(), units(900)).prop_map(|(job, units)| ToWorker::UnitsIssued { job, units }),
        job().prop_map(|job| ToWorker::JobEnded { job }),
    ];
    prop_oneof![
        1 => welcome.prop_map(FromCoordinator::Welcome),
        5 => said.prop_map(FromCoordinator::Said),
    ]
}

fn homes() -> impl Strategy<Value = Vec<Home>> {
    let home = (option::of(any::<u64>()), any::<bool>(), any::<bool>());
    (roster(), vec(home, 6)).prop_map(|(roster, homes)| {
        let home = |(peer, (memory, is_late, is_lost))| Home { peer, memory, is_late, is_lost };
        roster.into_iter().zip(homes).map(home).collect()
    })
}

/// Where to spoil bytes, and how.
pub(crate) fn spots() -> impl Strategy<Value = Vec<(Index, u8)>> {
    vec((any::<Index>(), any::<u8>()), 1..4)
}

/// Bytes with some of them replaced.
pub(crate) fn spoil(mut bytes: Vec<u8>, spots: &[(Index, u8)]) -> Vec<u8> {
    let length = bytes.len();
    for (position, byte) in spots.iter().filter(|_| length > 0) {
        bytes[position.index(length)] = *byte;
    }
    bytes
}
