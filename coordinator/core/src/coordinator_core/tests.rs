//! The coordinator's core from outside: events in, actions out.

use equilux_common::balancing::Balancing;
use equilux_common::job::{Filter, JobSpec, PerDepth, SceneRef, Settings};
use equilux_common::scene::camera::Camera;
use equilux_common::topology::Topology;
use equilux_common::unit::Granularity;

use super::*;

/// 16 units along a curve.
fn order(id: u64, workers_min: u32) -> JobOrder {
    let settings = Settings {
        width: 4,
        height: 4,
        crop: None,
        filter: Filter::Box,
        samples_per_pixel: 1,
        max_depth: 4,
        light_samples: PerDepth::default(),
        indirect_samples: PerDepth::default(),
        roulette_depth: None,
        seed: 0,
    };
    let camera = Camera {
        eye: [0.0; 3],
        target: [1.0; 3],
        up: [0.0, 1.0, 0.0],
        vfov: 40.0,
        aperture: 0.0,
        focus_distance: 1.0,
    };
    let spec = JobSpec {
        id: JobId(id),
        scene: SceneRef { hash: [0; 32], pack_bytes: 0, entry: "scene.json".into() },
        camera,
        settings,
        granularity: Granularity { tile_side_pixels: 1, samples_per_unit: 1 },
    };
    let balancing = Balancing::default();
    JobOrder { spec, balancing, topology: Topology::Ring, workers_min, is_partitioned: false }
}

/// A core at a time.
struct Bench {
    core: CoordinatorCore,
    now: Time,
    link: u64,
}

impl Bench {
    fn new() -> Self {
        Self { core: CoordinatorCore::new(Config::default()), now: Time::ZERO, link: 0 }
    }

    fn after(&mut self, event: Event) -> Vec<Action> {
        self.now = self.now + Duration::from_millis(1);
        self.core.handle(self.now, event);
        std::iter::from_fn(|| self.core.poll_action()).collect()
    }

    fn wake(&mut self) -> Vec<Action> {
        self.now = self.core.next_deadline().expect("a deadline");
        self.core.wake(self.now);
        std::iter::from_fn(|| self.core.poll_action()).collect()
    }

    fn knock(&mut self, name: &str, threads: u32) -> Vec<Action> {
        self.link += 1;
        let (name, address) = (name.to_owned(), format!("{name}:1"));
        let address = address.into();
        let hello = Hello { name, address, threads, speed: 1000, memory: None };
        self.after(Event::Knocked { link: LinkId(self.link), hello })
    }

    fn submit(&mut self, id: u64, workers_min: u32) -> Vec<Action> {
        self.after(Event::Submitted(Box::new(order(id, workers_min))))
    }

    fn says(&mut self, worker: u32, message: ToCoordinator) -> Vec<Action> {
        let (worker, incarnation) = (WorkerId(worker), Incarnation(0));
        self.after(Event::WorkerSaid { worker, incarnation, message })
    }

    fn lose(&mut self, worker: u32) -> Vec<Action> {
        let (worker, incarnation) = (WorkerId(worker), Incarnation(0));
        self.after(Event::WorkerLost { worker, incarnation })
    }

    fn deliver(&mut self, worker: u32, unit: u32, attempt: u32) -> Vec<Action> {
        let tile = order(1, 1).spec.grid().unit(UnitId(unit)).expect("16 units").tile;
        let credit = Credit::whole();
        let share = Share { unit: UnitId(unit), attempt: Attempt(attempt), credit };
        let sums = TileSums::new(tile);
        self.says(worker, ToCoordinator::Delivered { job: JobId(1), share, sums })
    }
}

fn told(actions: &[Action], to: u32) -> Vec<&ToWorker> {
    let message = |action| match action {
        &Action::Tell { worker: WorkerId(worker), ref message, .. } if worker == to => {
            Some(message)
        }
        _ => None,
    };
    actions.iter().filter_map(message).collect()
}

/// The numbers of the units that a worker is told to begin or to render too, and their attempt.
fn issued(actions: &[Action], to: u32) -> Vec<(u32, u32)> {
    let units = |message: &&ToWorker| match message {
        ToWorker::JobStarted(start) => start.units.clone(),
        ToWorker::UnitsIssued { units, .. } => units.clone(),
        _ => Vec::new(),
    };
    let numbers = |(unit, attempt): (UnitId, Attempt)| (unit.0, attempt.0);
    told(actions, to).iter().flat_map(units).map(numbers).collect()
}

fn states(actions: &[Action]) -> Vec<(u64, JobState)> {
    let state = |action: &Action| match action {
        Action::Report(report) => Some((report.job.0, report.state.clone())),
        _ => None,
    };
    actions.iter().filter_map(state).collect()
}

fn numbers(range: std::ops::Range<u32>, attempt: u32) -> Vec<(u32, u32)> {
    range.map(|unit| (unit, attempt)).collect()
}

#[test]
fn a_job_starts_when_enough_workers_are_there_with_shares_by_their_threads() {
    let mut bench = Bench::new();
    assert_eq!(states(&bench.submit(1, 2)), [(1, JobState::Queued)]);
    bench.knock("anna", 1);
    let actions = bench.knock("bert", 3);
    assert_eq!(states(&actions), [(1, JobState::Preparing)]);
    assert_eq!(issued(&actions, 0), numbers(0..4, 0));
    assert_eq!(issued(&actions, 1), numbers(4..16, 0));
    let actions = bench.knock("carl", 9);
    assert!(issued(&actions, 2).is_empty(), "who comes late begins with nothing");
    assert!(
        matches!(told(&actions, 2)[..], [ToWorker::JobStarted(start)] if start.neighbors.len() == 2)
    );
    assert!(matches!(told(&actions, 0)[..], [ToWorker::NeighborsChanged { .. }]));
    let actions = bench.knock("dora", 1);
    assert!(matches!(told(&actions, 2)[..], [ToWorker::NeighborsChanged { .. }]));
    assert!(told(&actions, 1).is_empty(), "the neighbors of 1 on the ring are the same");
}

#[test]
fn a_job_is_done_in_the_delivery_of_its_last_unit_and_the_next_one_starts() {
    let mut bench = Bench::new();
    bench.knock("anna", 1);
    bench.submit(1, 1);
    bench.submit(2, 1);
    let ready = bench.says(0, ToCoordinator::Ready { job: JobId(1) });
    assert_eq!(states(&ready), [(1, JobState::Rendering)]);
    for unit in 0..15 {
        let actions = bench.deliver(0, unit, 0);
        assert!(matches!(&actions[0], Action::Commit { unit: id, .. } if id.0 == unit));
        assert!(states(&actions).len() <= usize::from(unit == 0), "reports have a pace");
    }
    assert_eq!(states(&bench.wake()), [(1, JobState::Rendering)]);
    let actions = bench.deliver(0, 15, 0);
    assert_eq!(states(&actions), [(1, JobState::Done), (2, JobState::Preparing)]);
    let [ToWorker::JobEnded { .. }, ToWorker::JobStarted(_)] = told(&actions, 0)[..] else {
        panic!("the end and the next start, not {actions:?}");
    };
    let figures = Box::new(WorkerFigures { bundles_in: 5, ..WorkerFigures::default() });
    let actions = bench.says(0, ToCoordinator::Reported { job: JobId(1), figures });
    let Action::Report(report) = &actions[0] else { panic!("{actions:?}") };
    assert_eq!((report.job, &report.state), (JobId(1), &JobState::Done));
    assert_eq!(report.workers[0].1.bundles_in, 5);
}

#[test]
fn a_lost_worker_costs_only_units_that_are_not_committed() {
    let mut bench = Bench::new();
    bench.knock("anna", 1);
    bench.knock("bert", 1);
    bench.submit(1, 2);
    bench.deliver(0, 2, 0);
    let actions = bench.lose(1);
    let expected: Vec<_> = numbers(0..16, 1).into_iter().filter(|&(unit, _)| unit != 2).collect();
    assert_eq!(issued(&actions, 0), expected);
    let [ToWorker::NeighborsChanged { .. }, ToWorker::AttemptsRaised { units, .. }, _] =
        told(&actions, 0)[..]
    else {
        panic!("{actions:?}");
    };
    assert_eq!(units.len(), 15);
    assert!(bench.deliver(0, 3, 0).is_empty(), "an older attempt");
    assert!(bench.deliver(1, 3, 1).is_empty(), "fenced");
    assert!(bench.lose(1).is_empty(), "known");
}

#[test]
fn a_job_without_workers_waits_for_the_next_one() {
    let mut bench = Bench::new();
    bench.knock("anna", 1);
    bench.submit(1, 1);
    bench.deliver(0, 7, 0);
    bench.lose(0);
    let actions = bench.knock("anna", 1);
    assert!(matches!(actions[0], Action::Admit { worker: WorkerId(0), incarnation, .. }
        if incarnation == Incarnation(1)));
    assert_eq!(issued(&actions, 0).len(), 15);
}

#[test]
fn the_same_worker_in_a_new_life_replaces_the_old_one() {
    let mut bench = Bench::new();
    bench.knock("anna", 1);
    bench.knock("bert", 1);
    bench.submit(1, 1);
    let actions = bench.knock("anna", 1);
    assert!(matches!(actions[0], Action::Expel { worker: WorkerId(0), .. }));
    assert_eq!(issued(&actions, 1), numbers(0..16, 1));
    assert!(issued(&actions, 0).is_empty());
}

#[test]
fn who_breaks_the_protocol_is_expelled_and_its_work_redone() {
    let mut bench = Bench::new();
    bench.knock("anna", 1);
    bench.knock("bert", 1);
    bench.submit(1, 2);
    bench.deliver(0, 0, 0);
    let actions = bench.deliver(0, 0, 0);
    let Action::Expel { reason, .. } = &actions[0] else { panic!("{actions:?}") };
    assert!(reason.contains("more credit of unit 0"), "{reason}");
    assert_eq!(issued(&actions, 1), numbers(1..16, 1));
}

#[test]
fn a_failed_or_cancelled_job_ends_everywhere_and_names_the_reason() {
    let mut bench = Bench::new();
    bench.knock("anna", 1);
    for id in 1..=4 {
        bench.submit(id, 1);
    }
    let reason = "scene.json: no such file".to_owned();
    let actions = bench.says(0, ToCoordinator::Failed { job: JobId(1), reason });
    let reason = "worker 0 (anna): scene.json: no such file".to_owned();
    assert_eq!(states(&actions), [(1, JobState::Failed { reason }), (2, JobState::Preparing)]);
    let actions = bench.after(Event::Cancelled { job: JobId(3) });
    assert_eq!(states(&actions), [(3, JobState::Cancelled)]);
    let actions = bench.after(Event::Cancelled { job: JobId(2) });
    assert_eq!(states(&actions), [(2, JobState::Cancelled), (4, JobState::Preparing)]);
    assert!(matches!(told(&actions, 0)[0], ToWorker::JobEnded { job: JobId(2) }));
    assert!(bench.after(Event::Cancelled { job: JobId(9) }).is_empty());
}

#[test]
fn too_many_jobs_are_refused() {
    let mut bench = Bench::new();
    for id in 1..=QUEUED_JOBS_MAX as u64 {
        bench.submit(id, 1);
    }
    let refused = bench.submit(5000, 1);
    assert!(matches!(&states(&refused)[..], [(5000, JobState::Failed { .. })]));
}
