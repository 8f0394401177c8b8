//! A plan: everything about a run that is decided before it starts, drawn from its seed.

use std::ops::RangeInclusive;
use std::time::Duration;

use equilux_common::balancing::{
    Balance, Balancing, DiffusionStep, Exchange, GiveFirst, Mapping, Word,
};
use equilux_common::ids::JobId;
use equilux_common::job::{Filter, JobSpec, PerDepth, SceneRef, Settings};
use equilux_common::scene::camera::Camera;
use equilux_common::topology::Topology;
use equilux_common::unit::Granularity;
use equilux_coordinator_core::event::JobOrder;
use equilux_mapping::{Guest, Object, Tie};

use crate::network::{BANDWIDTH_UNLIMITED, NetworkModel};
use crate::random::Random;
use crate::stub::StubTracer;

/// A schedule of more steps than this will never end.
const STEPS_MAX: u64 = 1_000_000;

/// Bytes on the wire of a touched pixel that holds all layers.
const PIXEL_BYTES: f64 = 70.0;

/// A machine with a worker on it.
#[derive(Clone, Debug)]
pub struct Machine {
    /// The worker's name.
    pub name: String,
    /// Compute threads.
    pub threads: u32,
    /// Speed of a thread, 1000 being that of the tracer's costs.
    pub speed: u32,
    /// Speed that the worker names when it introduces itself.
    pub claimed_speed: u32,
    /// Bytes of memory for partitions; none: as many as are needed.
    pub memory: Option<u64>,
    /// When the worker comes, dies and comes again, in turn.
    pub turns: Vec<Duration>,
}

/// A whole run.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Where it comes from, and what all that is random in the run comes from.
    pub seed: u64,
    /// The network.
    pub network: NetworkModel,
    /// Of a hundred messages whose receivers must bear it, how many come twice.
    pub copied_percent: u64,
    /// The machines.
    pub machines: Vec<Machine>,
    /// The jobs, in order of submission, and when they are submitted.
    pub jobs: Vec<(Duration, JobOrder)>,
    /// When a job is cancelled, if one is.
    pub cancelled: Option<(Duration, JobId)>,
    /// The partitions of the model, if it is cut into some.
    pub guest: Option<Guest>,
    /// How long it takes to load a scene.
    pub load: RangeInclusive<Duration>,
    /// How long it takes to load a partition, beside what the disk takes.
    pub partition_load: RangeInclusive<Duration>,
    /// Bytes on the wire of a touched pixel of film values.
    pub pixel_bytes: f64,
    /// Whether what must hold at any moment is checked after every step.
    pub is_checked: bool,
    /// A run of more steps than this will never end.
    pub steps_max: u64,
}

impl Plan {
    /// A random plan without faults: workers may only come late.
    #[must_use]
    pub fn calm(seed: u64) -> Self {
        let mut random = Random::new(seed);
        let machine_count = random.within_u32(1..=16);
        let ms = Duration::from_millis;
        let machines = (0..machine_count).map(|number| machine(&mut random, number)).collect();
        let workers_min = random.within_u32(1..=machine_count);
        let job_count = if random.chance(25) { 2 } else { 1 };
        let jobs = (1..=job_count)
            .map(|id| {
                (random.duration(Duration::ZERO..=ms(20)), order(&mut random, id, workers_min))
            })
            .collect();
        let load = Duration::ZERO..=random.pick(&[ms(1), ms(50)]);
        let network = network(&mut random);
        Self {
            seed,
            network,
            copied_percent: random.pick(&[0, 0, 5, 50]),
            machines,
            jobs,
            cancelled: None,
            guest: None,
            partition_load: load.clone(),
            load,
            pixel_bytes: PIXEL_BYTES,
            is_checked: true,
            steps_max: STEPS_MAX,
        }
    }

    /// A random plan in which workers die, come again and come late. One worker never dies.
    #[must_use]
    pub fn stormy(seed: u64) -> Self {
        let mut plan = Self::calm(seed);
        let mut random = Random::new(!seed);
        for machine in plan.machines.iter_mut().skip(1) {
            let turn_count = random.pick(&[0, 0, 0, 0, 1, 2, 3, 4]);
            for _ in 0..turn_count {
                let last = machine.turns.last().copied().unwrap_or_default();
                let stay = random.duration(Duration::ZERO..=Duration::from_millis(60));
                machine.turns.push(last + stay);
            }
        }
        for (_, order) in &mut plan.jobs {
            order.workers_min = 1;
        }
        if random.chance(10) {
            let when = random.duration(Duration::ZERO..=Duration::from_millis(100));
            plan.cancelled = Some((when, JobId(1)));
        }
        plan
    }

    /// The same plan with a model that is cut into partitions, and machines whose memories hold
    /// some of them or all.
    #[must_use]
    pub fn partitioned(mut self) -> Self {
        let mut random = Random::new(self.seed ^ 0x9a27);
        let count = random.within_u32(1..=12);
        let sizes: Vec<u64> = (0..count).map(|_| random.within(1..=1_000_000)).collect();
        let largest = sizes.iter().max().copied().unwrap_or(0);
        let all: u64 = sizes.iter().sum();
        self.guest = Some(side_by_side(&sizes));
        for machine in &mut self.machines {
            // Rays that wait take a part of the memory.
            let memory = random.within(largest..=all) * 4 / 3 + 100_000;
            machine.memory = random.chance(80).then_some(memory);
        }
        for (_, order) in &mut self.jobs {
            order.is_partitioned = true;
            order.balancing.exchange = random.pick(Exchange::ALL);
            order.balancing.mapping = random.pick(Mapping::ALL);
        }
        self
    }

    /// The same plan with one job, which renders this.
    #[must_use]
    pub fn rendering(mut self, spec: JobSpec) -> Self {
        self.cancelled = None;
        self.jobs.truncate(1);
        for (_, order) in &mut self.jobs {
            order.spec = spec.clone();
        }
        self
    }

    /// The stub tracer of this plan.
    #[must_use]
    pub fn stub(&self) -> StubTracer {
        let mut random = Random::new(self.seed ^ 0x57ab);
        StubTracer {
            seed: random.bits(),
            ray_cost: random.duration(Duration::from_micros(2)..=Duration::from_micros(80)),
            parked_percent: random.pick(&[0, 1, 10]),
            partition_count: self.guest.as_ref().map_or(0, partition_count),
        }
    }
}

/// Partitions of these sizes in a row.
fn side_by_side(sizes: &[u64]) -> Guest {
    let place = |(at, &bytes): (usize, &u64)| Object { bytes, position: [at as f32, 0.0, 0.0] };
    let ties = (1..sizes.len()).map(|at| Tie { objects: [at - 1, at], affinity: 1 });
    let objects = sizes.iter().enumerate().map(place).collect();
    Guest::new(objects, ties.collect()).expect("there are some, of ordinary sizes")
}

fn partition_count(guest: &Guest) -> u32 {
    u32::try_from(guest.objects().len()).expect("a few")
}

fn machine(random: &mut Random, number: u32) -> Machine {
    let comes = if random.chance(70) { 1 } else { 80_000 };
    let threads = random.within_u32(1..=4);
    let speed = random.pick(&[1000, 1000, 500, 2000]);
    Machine {
        name: format!("host{number}"),
        threads,
        speed,
        claimed_speed: speed,
        memory: None,
        turns: vec![Duration::from_micros(random.within(0..=comes))],
    }
}

/// Nothing but delays: the cores' answers come at once, and only chance makes messages late.
fn network(random: &mut Random) -> NetworkModel {
    let us = Duration::from_micros;
    NetworkModel {
        latency: us(random.pick(&[1, 10, 200])),
        jitter: us(random.pick(&[1, 50, 2000])),
        bandwidth: BANDWIDTH_UNLIMITED,
        is_shared: false,
        core: Duration::ZERO,
        message_processor: Duration::ZERO,
        kilobyte_processor: Duration::ZERO,
        disk: BANDWIDTH_UNLIMITED,
        loss: random.pick(&[0, 0, 20_000, 200_000]),
        resend: us(20_000),
    }
}

fn order(random: &mut Random, id: u64, workers_min: u32) -> JobOrder {
    let topologies = [
        Topology::Complete,
        Topology::Ring,
        Topology::Torus2d,
        Topology::Torus3d,
        Topology::Hypercube,
    ];
    let balancing = Balancing {
        balance: random.pick(&[
            Balance::Diffusion,
            Balance::Diffusion,
            Balance::Diffusion,
            Balance::Stealing,
            Balance::None,
        ]),
        step: random.pick(DiffusionStep::ALL),
        give_first: random.pick(GiveFirst::ALL),
        exchange: Exchange::On,
        mapping: Mapping::Bisection,
    };
    let topology = topologies[random.within_u32(0..=4) as usize].clone();
    JobOrder { spec: spec(random, id), balancing, topology, workers_min, is_partitioned: false }
}

fn spec(random: &mut Random, id: u64) -> JobSpec {
    let settings = Settings {
        width: random.within_u32(4..=40),
        height: random.within_u32(4..=24),
        crop: None,
        filter: Filter::Box,
        samples_per_pixel: random.pick(&[1, 3, 8, 16]),
        max_depth: 4,
        light_samples: PerDepth::default(),
        indirect_samples: PerDepth::default(),
        roulette_depth: None,
        seed: 1,
    };
    let granularity = Granularity {
        tile_side_pixels: random.within_u32(3..=12),
        samples_per_unit: random.pick(&[1, 4, 16]),
    };
    let scene = SceneRef { hash: [0; 32], pack_bytes: 0, entry: "scene.json".into() };
    JobSpec { id: JobId(id), scene, camera: camera(), settings, granularity }
}

/// Any camera: nothing is looked at.
pub(crate) const fn camera() -> Camera {
    Camera {
        eye: [0.0, 0.0, 1.0],
        target: [0.0; 3],
        up: [0.0, 1.0, 0.0],
        vfov: 40.0,
        aperture: 0.0,
        focus_distance: 1.0,
    }
}
