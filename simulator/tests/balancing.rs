//! Nobody starves: who is idle while a neighbor has more than it needs is not idle for long.

use std::time::Duration;

use equilux_common::balancing::{Balance, Balancing, DiffusionStep, GiveFirst};
use equilux_common::bundle::BUNDLE_RAYS_MAX;
use equilux_common::time::Time;
use equilux_common::topology::Topology;
use equilux_simulator::network::{BANDWIDTH_UNLIMITED, NetworkModel};
use equilux_simulator::plan::Plan;
use equilux_simulator::random::Random;
use equilux_simulator::simulation::Simulation;
use equilux_simulator::stub::StubTracer;

/// Longest way of a message.
const LATENCY_MAX: Duration = Duration::from_micros(300);

/// A round and a request, an answer to both, and a gift that is half used up when it arrives, so
/// that all starts again: eight ways; and a piece that the other's core must wait for.
const STARVATION_MAX: Duration = Duration::from_micros(8 * 300 + 16_000);

/// The least flow that is asked for, unless two low-water marks are more.
const GIFT_MIN: Duration = Duration::from_micros(300);

/// A piece is expected to take no longer, if its paths do not, and may take twice as long before
/// anybody is surprised.
const PIECE_MAX: Duration = Duration::from_millis(2 * 16);

/// Rays of the longest path: it cannot be shared, as long as it takes.
const PATH_RAYS: u32 = 60;

/// The longest ray over the mean one, on the slowest worker: an interrupt has to wait for it.
const RAY_MAX: u32 = 6;

/// How much dearer than usual rays are in some clusters: up to 4 ms each.
const DEAR: u32 = 50;

/// A random cluster that is complete when the job starts, on a network with little jitter and no
/// loss.
fn plan(seed: u64) -> Plan {
    let mut random = Random::new(seed ^ 0xba1a);
    let mut plan = Plan::calm(seed);
    // One after another, so that workers are numbered like machines; the job waits for the last.
    for (number, machine) in (0..).zip(&mut plan.machines) {
        machine.turns = vec![LATENCY_MAX * number];
    }
    plan.jobs.truncate(1);
    plan.load = Duration::ZERO..=Duration::ZERO;
    plan.is_checked = false;
    plan.network = NetworkModel {
        latency: random.duration(Duration::from_micros(1)..=LATENCY_MAX * 2 / 3),
        jitter: LATENCY_MAX / 3,
        bandwidth: BANDWIDTH_UNLIMITED,
        is_shared: false,
        core: Duration::ZERO,
        message_processor: Duration::ZERO,
        kilobyte_processor: Duration::ZERO,
        disk: BANDWIDTH_UNLIMITED,
        loss: 0,
        resend: Duration::ZERO,
    };
    let order = &mut plan.jobs[0].1;
    order.workers_min = u32::try_from(plan.machines.len()).expect("few");
    order.balancing = Balancing {
        balance: Balance::Diffusion,
        step: random.pick(&[DiffusionStep::Explicit, DiffusionStep::Implicit]),
        give_first: random.pick(&[GiveFirst::Samples, GiveFirst::Rays]),
        ..Balancing::default()
    };
    plan
}

/// Since when each worker has been idle beside plenty.
struct Watch {
    topology: Topology,
    /// A bundle beyond the mark and the least gift.
    bundle: Duration,
    /// What a thread may be busy with, whoever waits.
    piece: Duration,
    since: Vec<Option<Time>>,
    longest: Duration,
}

impl Watch {
    fn look(&mut self, simulation: &Simulation<StubTracer>) {
        let now = simulation.now();
        for since in self.since.iter().flatten() {
            self.longest = self.longest.max(now.since(*since));
        }
        let cores: Vec<_> = simulation.cores().collect();
        let pieces: Vec<_> = simulation.longest_pieces().collect();
        let has_plenty = |index: usize| {
            let (core, low) = (cores[index], cores[index].low_water());
            core.load() > low + GIFT_MIN.max(low * 2) + self.bundle || pieces[index] > self.piece
        };
        self.since.resize(cores.len(), None);
        for (index, since) in self.since.iter_mut().enumerate() {
            let is_starving = cores[index].is_idle()
                && cores[index].job().is_some()
                && self.topology.neighbors(index, cores.len()).into_iter().any(has_plenty);
            *since = is_starving.then(|| since.unwrap_or(now));
        }
    }
}

/// How long the unluckiest worker was idle beside plenty, and how much was given, where rays cost
/// so many times what is usual.
fn starve(seed: u64, factor: u32) -> (Duration, u64) {
    let plan = plan(seed);
    let stub = plan.stub();
    let stub = StubTracer { parked_percent: 0, ray_cost: stub.ray_cost * factor, ..stub };
    let topology = plan.jobs[0].1.topology.clone();
    let bundle = 2 * stub.ray_cost * u32::try_from(BUNDLE_RAYS_MAX).expect("few");
    let piece = PIECE_MAX + PATH_RAYS * stub.ray_cost;
    let mut watch = Watch { topology, bundle, piece, since: Vec::new(), longest: Duration::ZERO };
    let mut simulation = Simulation::new(plan, stub);
    while simulation.step() {
        watch.look(&simulation);
    }
    (watch.longest, simulation.counts().given)
}

#[test]
fn nobody_is_idle_for_long_beside_a_neighbor_with_plenty() {
    let mut given = 0;
    for seed in 0..400 {
        let (longest, gifts) = starve(seed, 1);
        assert!(longest <= STARVATION_MAX, "seed {seed}: {longest:?}");
        given += gifts;
    }
    assert!(given > 1000, "{given} gifts");
}

#[test]
fn nobody_is_idle_for_long_beside_a_neighbor_with_a_long_piece() {
    for seed in 0..200 {
        let (longest, _) = starve(seed, DEAR);
        let ray = plan(seed).stub().ray_cost * DEAR;
        assert!(longest <= STARVATION_MAX + RAY_MAX * ray, "seed {seed}: {longest:?}, {ray:?}");
    }
}
