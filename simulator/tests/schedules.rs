//! Schedules of delay, disorder, second deliveries, late comers and deaths, each from its seed.
//!
//! A job must end neither early nor never, in the film that is known beforehand. After every step
//! the credit of all units is added up: if it were more than whole, the job could end early; if
//! less, it would never end.
//!
//! Messages of one link arrive in order; those of different links overtake each other at will. A
//! message may come twice, the second time at any later moment, if its receiver promises to bear
//! it: questions for load and their answers, requests for work, the start and the end of a job,
//! raised attempts, `Ready`, `Failed`, figures, and deliveries of an attempt that is over. What
//! cannot come twice, and need not, since links are streams that deliver once or break: gifts,
//! issued units and deliveries of a current attempt, for they are credit itself, and twice the
//! credit is a violation that is noticed; acknowledgements, of which each opens the window by its
//! count; changes of neighbors and refusals, which hold until the next such message.
//!
//! Two thousand seeds run each time; ten thousand by `cargo test --release -p equilux-simulator
//! --test schedules -- --ignored`, some minutes. A seed that fails is printed first and last;
//! `EQUILUX_SEED=… cargo test --release -p equilux-simulator` replays it alone, and
//! `EQUILUX_SEEDS=1000..100000` tries others.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use std::time::Duration;

use equilux_common::balancing::Balance;
use equilux_common::time::Time;
use equilux_common::topology::Topology;
use equilux_coordinator_core::action::JobState;
use equilux_simulator::counts::Counts;
use equilux_simulator::network::NetworkModel;
use equilux_simulator::plan::Plan;
use equilux_simulator::simulation::Simulation;
use equilux_simulator::stub::StubTracer;
use equilux_simulator::view::JobView;

/// The shortest and the longest pause of who steals in vain.
const PAUSE_MIN_NANOS: u64 = 100_000;
const PAUSE_MAX_NANOS: u64 = 10_000_000;

fn seeds(default: std::ops::Range<u64>) -> std::ops::Range<u64> {
    let number = |text: &str| text.parse::<u64>().expect("seeds are numbers");
    if let Ok(seed) = std::env::var("EQUILUX_SEED") {
        return number(&seed)..number(&seed) + 1;
    }
    let Ok(seeds) = std::env::var("EQUILUX_SEEDS") else { return default };
    let (first, end) = seeds.split_once("..").expect("EQUILUX_SEEDS is FIRST..END");
    number(first)..number(end)
}

fn for_each_seed(default: std::ops::Range<u64>, run: impl Fn(u64)) {
    for seed in seeds(default) {
        if catch_unwind(AssertUnwindSafe(|| run(seed))).is_err() {
            eprintln!("EQUILUX_SEED={seed} fails; once more:");
            let panic = catch_unwind(AssertUnwindSafe(|| run(seed)));
            eprintln!("EQUILUX_SEED={seed} replays it");
            resume_unwind(panic.expect_err("a schedule depends on nothing but its seed"));
        }
    }
}

/// Runs a plan and checks what must hold; gives what was counted.
fn run(plan: Plan) -> Counts {
    let stub = plan.stub();
    let delay_max = delay_max(&plan);
    let cancelled = plan.cancelled.map(|(_, job)| job);
    let is_stealing =
        plan.jobs.iter().any(|(_, order)| order.balancing.balance == Balance::Stealing);
    let is_diffusing =
        plan.jobs.iter().any(|(_, order)| order.balancing.balance == Balance::Diffusion);
    let is_partitioned = plan.guest.is_some();
    let mut simulation = Simulation::new(plan, stub);
    simulation.run();
    assert!(simulation.is_quiet(), "something is left to do");
    if !is_stealing {
        check_counts(&simulation);
    } else if !is_diffusing {
        check_thefts(&simulation);
    }
    for (id, view) in simulation.jobs() {
        let state = view.report.as_ref().map(|report| report.state.clone());
        if Some(*id) == cancelled && state == Some(JobState::Cancelled) {
            continue;
        }
        assert_eq!(state, Some(JobState::Done), "{id}");
        // What has retired where rays come and go has waited for more, and so have receipts.
        let waiting = u64::from(view.task.grid.unit_count()) + 4 * simulation.life_count();
        let units_max = if is_partitioned { waiting } else { 1 };
        check_end(&simulation, view, delay_max, is_stealing, units_max);
        assert!(view.film.sums == stub.expected(&view.task), "{id} has another film");
    }
    simulation.counts()
}

/// Messages have causes: no round of asking without work or rays that came in or a change of the
/// roster, no request without a question or a gift that is used up, and next to nothing once a job
/// is over. Threads are interrupted for a request once, and then once for each piece that overruns.
fn check_counts(simulation: &Simulation<StubTracer>) {
    let (counts, lives) = (simulation.counts(), simulation.life_count());
    let jobs = simulation.jobs().len() as u64;
    // Per life: the start, reissues and changes of the roster, each worth a round.
    let changes = jobs * lives * (2 + 3 * lives);
    let neighbors = lives - 1;
    let arrivals = counts.given + counts.forwarded;
    assert!(counts.load_asked <= neighbors * (arrivals + changes), "{counts:?}");
    assert!(counts.work_asked <= neighbors * (arrivals + changes), "{counts:?}");
    let requests = counts.work_asked + counts.copies;
    let overruns = if requests > 0 { counts.pieces } else { 0 };
    assert!(counts.interrupts <= requests + overruns, "{counts:?}");
    assert!(counts.late <= 4 * jobs * lives * neighbors, "{counts:?}");
}

/// Who steals asks for work alone, one neighbor at a time. After as many refusals as it has
/// neighbors it pauses, and twice as long each time until it gets something: from 100 µs to 10 ms,
/// which takes seven pauses. So attempts are bounded by gifts and by time.
fn check_thefts(simulation: &Simulation<StubTracer>) {
    let (counts, lives) = (simulation.counts(), simulation.life_count());
    let neighbors = lives - 1;
    let jobs = simulation.jobs().len() as u64;
    let long_pauses = lives * (simulation.now().as_nanos() / PAUSE_MAX_NANOS + 1);
    let arrivals = counts.given + counts.forwarded;
    let pauses = 7 * (arrivals + jobs * lives) + long_pauses;
    assert_eq!((counts.load_asked, counts.interrupts), (0, 0), "{counts:?}");
    assert!(counts.work_asked <= neighbors * (pauses + arrivals), "{counts:?}");
}

/// The job ends in the message that makes the last credit whole: nobody asks whether it has. What
/// is said meanwhile are the last rounds of workers who ran out of work, and, where work is stolen,
/// the attempts between pauses for as long as that message takes; and the last piece of each life
/// may be the last of several units, of which each is a delivery. If nobody died, the end comes no
/// later than a message can be.
fn check_end(
    simulation: &Simulation<StubTracer>,
    view: &JobView,
    delay_max: Option<Duration>,
    is_stealing: bool,
    units_max: u64,
) {
    let (end, lives) = (view.end.expect("it ended"), simulation.life_count());
    let delay = end.time.since(end.last_ray);
    let pauses = if is_stealing { delay.as_nanos() as u64 / PAUSE_MIN_NANOS } else { 0 };
    let questions = (4 + 2 * pauses) * (lives - 1);
    let deliveries = units_max - 1;
    let messages_max = 2 + lives * (2 + questions + deliveries);
    assert!(end.messages_after <= messages_max, "{end:?} with {lives} lives");
    assert!(delay_max.is_none_or(|most| delay <= most), "{end:?}");
}

/// The longest time that a message of a plan without deaths can take, with those before it.
fn delay_max(plan: &Plan) -> Option<Duration> {
    let is_calm = plan.machines.iter().all(|machine| machine.turns.len() <= 1);
    let NetworkModel { latency, jitter, resend, .. } = plan.network;
    // Where rays come and go, what has retired waits a little for more.
    let patience = if plan.guest.is_none() { 0 } else { 20 };
    let message = latency + jitter + resend + Duration::from_micros(1);
    is_calm.then_some(message + Duration::from_millis(patience))
}

/// Eight hosts and one path that takes so long.
fn idle_cluster(path: Duration, balance: Balance) -> (Counts, Time) {
    let mut plan = Plan::calm(4);
    plan.machines.resize(8, plan.machines[0].clone());
    for (number, machine) in plan.machines.iter_mut().enumerate() {
        machine.name = format!("host{number}");
        machine.turns = vec![Duration::ZERO];
    }
    plan.network = NetworkModel::cluster();
    plan.jobs.truncate(1);
    let order = &mut plan.jobs[0].1;
    (order.balancing.balance, order.topology, order.workers_min) =
        (balance, Topology::Hypercube, 8);
    let settings = &mut order.spec.settings;
    (settings.width, settings.height, settings.samples_per_pixel) = (1, 1, 1);
    let stub = StubTracer { ray_cost: path, parked_percent: 0, ..plan.stub() };
    let mut simulation = Simulation::new(plan, stub);
    simulation.run();
    assert!(simulation.is_quiet() && simulation.now() > Time::ZERO + path / 20);
    (Counts { steps: 0, ..simulation.counts() }, simulation.now())
}

#[test]
fn an_idle_cluster_is_silent_however_long_it_waits() {
    let (short, _) = idle_cluster(Duration::from_secs(100), Balance::Diffusion);
    assert_eq!(short, idle_cluster(Duration::from_secs(100_000), Balance::Diffusion).0);
    // Of two neighbors that run dry at least one asks the other, who knows then that it has none.
    assert!((8 * 3 / 2..=2 * 8 * 3).contains(&short.load_asked), "{short:?}");
    let (none, _) = idle_cluster(Duration::from_secs(1), Balance::None);
    assert_eq!((none.load_asked, none.work_asked, none.given, none.late), (0, 0, 0, 0));
}

#[test]
fn idle_thieves_pause_for_long() {
    let (counts, time) = idle_cluster(Duration::from_secs(1), Balance::Stealing);
    // All eight ask their three neighbors after each pause, and seven times before the longest.
    let pauses = 7 + time.as_nanos() / PAUSE_MAX_NANOS + 1;
    assert!(counts.work_asked <= 8 * 3 * pauses, "{counts:?} in {time:?}");
}

#[test]
fn calm_schedules_end_in_the_expected_film() {
    for_each_seed(0..1200, |seed| {
        run(Plan::calm(seed));
    });
}

#[test]
fn stormy_schedules_end_in_the_expected_film() {
    for_each_seed(1200..2000, |seed| {
        run(Plan::stormy(seed));
    });
}

/// Rays wait for partitions that come into memories too small for all of them, and go again; they
/// travel to the homes of others, and copies of these go to who has no work.
fn run_partitioned(seeds: std::ops::Range<u64>) {
    let (forwards, copies) = (Cell::new(0), Cell::new(0));
    let count = seeds.end - seeds.start;
    for_each_seed(seeds, |seed| {
        let plan = if seed % 5 < 3 { Plan::calm(seed) } else { Plan::stormy(seed) };
        let counts = run(plan.partitioned());
        forwards.set(forwards.get() + counts.rays_forwarded);
        copies.set(copies.get() + counts.copies_loaded);
    });
    if std::env::var_os("EQUILUX_SEED").is_none() {
        assert!(forwards.get() > 1000 * count && copies.get() > count / 10, "{copies:?} copies");
    }
}

#[test]
fn partitioned_schedules_end_in_the_expected_film() {
    run_partitioned(2000..2500);
}

#[test]
fn more_partitioned_schedules_end_in_the_expected_film() {
    run_partitioned(2500..3000);
}

#[test]
#[ignore = "takes minutes; see the head of this file"]
fn ten_thousand_schedules_end_in_the_expected_film() {
    for_each_seed(0..10_000, |seed| {
        let plan = if seed % 5 < 3 { Plan::calm(seed) } else { Plan::stormy(seed) };
        run(if seed % 10 < 7 { plan } else { plan.partitioned() });
    });
}
