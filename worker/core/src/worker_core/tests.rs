//! A worker's core from outside: events in, actions out.

use bytemuck::Zeroable;
use equilux_common::balancing::{Balance, Balancing, DiffusionStep, Exchange};
use equilux_common::bundle::{Bundle, Share, Stage};
use equilux_common::film::TileSums;
use equilux_common::ids::PartitionId;
use equilux_common::job::{Filter, JobSpec, PerDepth, SceneRef, Settings};
use equilux_common::message::Load;
use equilux_common::ray::Ray;
use equilux_common::scene::camera::Camera;
use equilux_common::unit::Granularity;
use equilux_common::work::{RayCounts, Samples, Work};
use equilux_mapping::Object;

use super::*;
use crate::forwarding::WINDOW_FORWARDS;

mod room;

const ME: WorkerId = WorkerId(1);
const PEER: WorkerId = WorkerId(2);
const LIFE: Incarnation = Incarnation(0);
const SECOND: Duration = Duration::from_secs(1);

/// 16 units of 256 paths each.
fn spec(id: u64) -> JobSpec {
    let settings = Settings {
        width: 64,
        height: 64,
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
    JobSpec {
        id: JobId(id),
        scene: SceneRef { hash: [0; 32], pack_bytes: 0, entry: "scene.json".into() },
        camera,
        settings,
        granularity: Granularity { tile_side_pixels: 16, samples_per_unit: 1 },
    }
}

fn address(worker: u32) -> PeerAddress {
    PeerAddress {
        worker: WorkerId(worker),
        incarnation: LIFE,
        address: format!("host{worker}:1").into(),
    }
}

/// A core and what it has said so far.
struct Bench {
    core: WorkerCore,
    now: Time,
}

impl Bench {
    fn new(threads: u32) -> Self {
        let config = Config { worker: ME, incarnation: LIFE, threads, speed: 1000, memory: None };
        Self { core: WorkerCore::new(config), now: Time::ZERO }
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

    fn start(&mut self, id: u64, units: std::ops::Range<u32>) -> Vec<Action> {
        self.after(Event::CoordinatorSaid(ToWorker::JobStarted(Box::new(JobStart {
            spec: spec(id),
            neighbors: [0, 2].map(address).to_vec(),
            homes: Vec::new(),
            balancing: Balancing { step: DiffusionStep::Explicit, ..Balancing::default() },
            units: units.map(|unit| (UnitId(unit), Attempt(0))).collect(),
            pack_from: [None, Some(address(1))],
        }))))
    }

    fn load(&mut self, id: u64) -> Vec<Action> {
        self.after(Event::SceneLoaded { job: JobId(id), partitions: None })
    }

    fn link(&mut self) -> Vec<Action> {
        self.after(Event::PeerLinked { peer: PEER, incarnation: LIFE })
    }

    fn peer_says(&mut self, id: u64, message: PeerMessage) -> Vec<Action> {
        let (peer, incarnation, job) = (PEER, LIFE, JobId(id));
        self.after(Event::PeerSaid { peer, incarnation, job, message, bytes: 10 })
    }

    /// A thread is done with a piece: every path was one ray of 1 ms.
    fn trace(&mut self, (piece, work): &(PieceId, Work)) -> Vec<Action> {
        let Work::Samples(samples) = work else { panic!("only samples are traced here") };
        let paths = u64::from(samples.path_count);
        let tile = spec(1).grid().unit(samples.share.unit).expect("16 units").tile;
        let outcome = Outcome {
            retired: vec![(samples.share.clone(), TileSums::new(tile))],
            successors: Vec::new(),
            counts: RayCounts { camera: paths, retired: paths, ..RayCounts::default() },
        };
        let elapsed = Duration::from_millis(paths);
        let (job, piece, outcome) = (JobId(1), *piece, Box::new(outcome));
        self.after(Event::Traced { job, piece, outcome, elapsed })
    }
}

fn pieces(actions: &[Action]) -> Vec<(PieceId, Work)> {
    let piece = |action: &Action| match action {
        Action::Trace { piece, work, .. } => Some((*piece, work.clone())),
        _ => None,
    };
    actions.iter().filter_map(piece).collect()
}

fn said(actions: &[Action]) -> Vec<PeerMessage> {
    let message = |action: &Action| match action {
        Action::TellPeer { message, .. } => Some(message.clone()),
        _ => None,
    };
    actions.iter().filter_map(message).collect()
}

fn told(actions: &[Action]) -> Vec<ToCoordinator> {
    let message = |action: &Action| match action {
        Action::Tell(message) => Some(message.clone()),
        _ => None,
    };
    actions.iter().filter_map(message).collect()
}

fn failure(actions: &[Action]) -> Option<String> {
    told(actions).into_iter().find_map(|message| match message {
        ToCoordinator::Failed { reason, .. } => Some(reason),
        _ => None,
    })
}

fn given(actions: &[Action]) -> Vec<Work> {
    let gift = |message| match message {
        PeerMessage::Given { work } => Some(work),
        _ => None,
    };
    said(actions).into_iter().filter_map(gift).collect()
}

#[test]
fn a_job_is_traced_only_once_its_scene_is_loaded() {
    let mut bench = Bench::new(2);
    let actions = bench.start(1, 0..8);
    assert!(matches!(&actions[0], Action::LoadScene { spec, .. } if spec.id == JobId(1)));
    assert!(matches!(&actions[1], Action::Link(peers) if *peers == [address(0), address(2)]));
    assert_eq!(actions.len(), 2);
    let actions = bench.load(1);
    assert_eq!(told(&actions), [ToCoordinator::Ready { job: JobId(1) }]);
    assert_eq!(pieces(&actions).len(), 4, "two for each of two threads");
}

#[test]
fn a_worker_that_falls_idle_does_not_report_it() {
    let mut bench = Bench::new(1);
    bench.start(1, 0..1);
    let mut pending = pieces(&bench.load(1));
    let mut last = Vec::new();
    while let Some(piece) = pending.pop() {
        last = bench.trace(&piece);
        pending.extend(pieces(&last));
    }
    let [ToCoordinator::Delivered { share, .. }] = &told(&last)[..] else {
        panic!("credit alone, not {last:?}");
    };
    assert!(share.credit.is_whole());
    assert_eq!(bench.core.next_deadline(), None, "nor does it wake up for it");
    let actions = bench.after(Event::CoordinatorSaid(ToWorker::JobEnded { job: JobId(1) }));
    let [ToCoordinator::Reported { figures, .. }] = &told(&actions)[..] else {
        panic!("the last figures, not {actions:?}");
    };
    assert_eq!(figures.rays.camera, 256);
}

#[test]
fn what_comes_too_early_is_answered_later_and_what_comes_too_late_never() {
    let mut bench = Bench::new(1);
    let asked = PeerMessage::LoadAsked { round: 7 };
    assert!(bench.peer_says(1, asked.clone()).is_empty(), "no job has started");
    assert!(said(&bench.start(1, 0..8)).is_empty(), "no link stands");
    assert!(matches!(said(&bench.link())[..], [PeerMessage::Load { round: 7, .. }]));
    let ended = Event::CoordinatorSaid(ToWorker::JobEnded { job: JobId(1) });
    let actions = bench.after(ended);
    assert!(matches!(told(&actions)[..], [ToCoordinator::Reported { .. }]));
    assert!(matches!(actions.last(), Some(Action::DropScene { job: JobId(1) })));
    assert!(bench.peer_says(1, asked.clone()).is_empty());
    assert!(bench.peer_says(2, asked).is_empty());
    assert!(matches!(said(&bench.start(2, 0..1))[..], [PeerMessage::Load { .. }]));
    assert!(bench.start(1, 0..8).is_empty(), "the job is over");
}

#[test]
fn a_bad_scene_and_a_broken_protocol_fail_the_job_once() {
    let mut bench = Bench::new(1);
    bench.start(1, 0..8);
    let failed = Event::SceneFailed { job: JobId(1), reason: "no such file".into() };
    assert_eq!(failure(&bench.after(failed.clone())).as_deref(), Some("no such file"));
    assert!(bench.after(failed).is_empty());
    assert!(bench.load(1).is_empty(), "it has failed");

    let mut bench = Bench::new(1);
    assert!(failure(&bench.start(1, 10..17)).is_some_and(|reason| reason.contains("unit 16")));

    let share = |unit| Share { unit: UnitId(unit), attempt: Attempt(0), credit: Credit::whole() };
    for (unit, path_count, word) in [(3, 300, "unit 3"), (20, 1, "unit 20"), (0, 256, "unit 0")] {
        let mut bench = Bench::new(1);
        bench.start(1, 0..1);
        bench.link();
        let work = Work::Samples(Samples { share: share(unit), first_path: 0, path_count });
        let actions = bench.peer_says(1, PeerMessage::Given { work });
        assert!(failure(&actions).is_some_and(|reason| reason.contains(word)), "{word}");
    }
}

#[test]
fn an_older_attempt_is_dropped_wherever_it_turns_up() {
    let mut bench = Bench::new(1);
    bench.start(1, 0..1);
    let old = pieces(&bench.load(1));
    let units = vec![(UnitId(0), Attempt(1))];
    let raised = ToWorker::AttemptsRaised { job: JobId(1), units: units.clone() };
    bench.after(Event::CoordinatorSaid(raised));
    for piece in &old {
        assert!(
            told(&bench.trace(piece))
                .iter()
                .all(|message| { !matches!(message, ToCoordinator::Delivered { .. }) })
        );
    }
    let issued = ToWorker::UnitsIssued { job: JobId(1), units };
    let mut pending = pieces(&bench.after(Event::CoordinatorSaid(issued)));
    let mut delivered = Vec::new();
    while let Some(piece) = pending.pop() {
        let actions = bench.trace(&piece);
        pending.extend(pieces(&actions));
        delivered.extend(told(&actions).into_iter().filter_map(|message| match message {
            ToCoordinator::Delivered { share, .. } => Some(share),
            _ => None,
        }));
    }
    assert_eq!(delivered.len(), 1);
    assert!(delivered[0].attempt == Attempt(1) && delivered[0].credit.is_whole());
}

#[test]
fn an_idle_worker_asks_once_and_gives_what_it_does_not_need() {
    let mut bench = Bench::new(1);
    bench.start(1, 0..0);
    bench.link();
    let actions = bench.load(1);
    let [PeerMessage::LoadAsked { round }] = said(&actions)[..] else { panic!("{actions:?}") };
    let actions = bench.peer_says(1, PeerMessage::Load { round, load: SECOND, capacity: 1000 });
    assert_eq!(said(&actions), [PeerMessage::WorkAsked { amount: SECOND / 2 }]);
    let units = (0..16).map(|unit| (UnitId(unit), Attempt(0))).collect();
    let issued = ToWorker::UnitsIssued { job: JobId(1), units };
    assert_eq!(pieces(&bench.after(Event::CoordinatorSaid(issued))).len(), 2);
    // 256 paths are taken to cost about 5 ms, of which it keeps one in the queue.
    let amount = Duration::from_millis(26);
    let gifts = given(&bench.peer_says(1, PeerMessage::WorkAsked { amount }));
    let units: Vec<u32> = gifts.iter().map(|gift| gift.shares()[0].unit.0).collect();
    assert_eq!(units[..5], [15, 14, 13, 12, 11]);
    let gifts = given(&bench.peer_says(1, PeerMessage::WorkAsked { amount: SECOND }));
    assert!((9..=11).contains(&gifts.len()), "{} gifts", gifts.len());
    assert!(!bench.core.is_quiet(), "gifts are on their way");
}

#[test]
fn a_request_that_cannot_be_met_is_kept_in_mind() {
    let mut bench = Bench::new(1);
    bench.start(1, 0..0);
    bench.load(1);
    bench.link();
    assert!(given(&bench.peer_says(1, PeerMessage::WorkAsked { amount: SECOND })).is_empty());
    let units = (0..16).map(|unit| (UnitId(unit), Attempt(0))).collect();
    let issued = ToWorker::UnitsIssued { job: JobId(1), units };
    assert!(!given(&bench.after(Event::CoordinatorSaid(issued))).is_empty());
}

#[test]
fn work_lost_with_a_link_fails_the_job_unless_the_peer_itself_is_lost() {
    for is_peer_lost in [false, true] {
        let mut bench = Bench::new(1);
        bench.start(1, 0..16);
        bench.link();
        assert!(!given(&bench.peer_says(1, PeerMessage::WorkAsked { amount: SECOND })).is_empty());
        bench.after(Event::PeerLost { peer: PEER, incarnation: LIFE });
        if is_peer_lost {
            let (job, gone) = (JobId(1), vec![(PEER, LIFE)]);
            let neighbors = [0, 2].map(address).to_vec();
            let changed = ToWorker::NeighborsChanged { job, neighbors, gone };
            bench.after(Event::CoordinatorSaid(changed));
        }
        let mut failed = None;
        while bench.core.next_deadline().is_some() && failed.is_none() {
            failed = failure(&bench.wake());
        }
        assert_eq!(failed.is_none(), is_peer_lost, "{failed:?}");
    }
}

#[test]
fn nothing_is_asked_or_given_without_balancing() {
    let mut bench = Bench::new(1);
    let start = JobStart {
        spec: spec(1),
        neighbors: [0, 2].map(address).to_vec(),
        homes: Vec::new(),
        balancing: Balancing { balance: Balance::None, ..Balancing::default() },
        units: Vec::new(),
        pack_from: [None, None],
    };
    bench.after(Event::CoordinatorSaid(ToWorker::JobStarted(Box::new(start))));
    bench.link();
    assert!(said(&bench.load(1)).is_empty());
    assert!(bench.peer_says(1, PeerMessage::WorkAsked { amount: Load::MAX }).is_empty());
}

/// A worker that is home to the first of two partitions; the second is at home with the peer.
/// There is room for one.
fn at_home(balancing: Balancing) -> Bench {
    let mut bench = Bench::new(1);
    let memory = Some(140);
    bench.core = WorkerCore::new(Config { memory, ..bench.core.config });
    let home = |worker| Home { peer: address(worker), memory, is_late: false, is_lost: false };
    let start = JobStart {
        spec: spec(1),
        neighbors: vec![address(2)],
        homes: [1, 2].map(home).to_vec(),
        balancing,
        units: Vec::new(),
        pack_from: [None, None],
    };
    bench.after(Event::CoordinatorSaid(ToWorker::JobStarted(Box::new(start))));
    bench.link();
    let object = Object { bytes: 100, position: [0.0; 3] };
    let partitions = Some(Guest::new(vec![object; 2], Vec::new()).expect("two of them"));
    bench.after(Event::SceneLoaded { job: JobId(1), partitions });
    bench
}

fn rays(partition: u32, attempt: u32) -> Bundle {
    let (unit, attempt, credit) = (UnitId(3), Attempt(attempt), Credit::whole());
    Bundle {
        stage: Stage::Intersect,
        partition: PartitionId(partition),
        shares: vec![Share { unit, attempt, credit }],
        rays: vec![Ray::zeroed(); 4],
    }
}

fn loads(actions: &[Action]) -> Vec<u32> {
    let load = |action: &Action| match action {
        Action::LoadPartition { partition, .. } => Some(partition.0),
        _ => None,
    };
    actions.iter().filter_map(load).collect()
}

#[test]
fn rays_go_to_the_home_of_their_partition() {
    let mut bench = at_home(Balancing { balance: Balance::None, ..Balancing::default() });
    let forwarded = |partition| PeerMessage::Forwarded { bundles: vec![rays(partition, 0)] };
    assert_eq!(loads(&bench.peer_says(1, forwarded(0))), [0]);
    let actions = bench.after(Event::PartitionLoaded { job: JobId(1), partition: PartitionId(0) });
    let [(piece, Work::Rays(bundle))] = &pieces(&actions)[..] else { panic!("{actions:?}") };
    let outcome = Outcome {
        successors: vec![Bundle { partition: PartitionId(1), ..bundle.clone() }],
        ..Outcome::default()
    };
    let (job, piece, outcome) = (JobId(1), *piece, Box::new(outcome));
    let actions = bench.after(Event::Traced { job, piece, outcome, elapsed: SECOND });
    assert_eq!(said(&actions), [forwarded(1)], "its threads have nothing else to do");
    let acknowledged = PeerMessage::ForwardsAcknowledged { count: 1 };
    assert_eq!(said(&bench.wake()), std::slice::from_ref(&acknowledged));
    assert!(!bench.core.is_quiet(), "nobody knows whether they have arrived");
    bench.peer_says(1, acknowledged);
    assert!(bench.core.is_quiet());
}

#[test]
fn a_copy_is_taken_if_the_work_that_comes_with_it_lasts_longer() {
    let mut bench = at_home(Balancing::default());
    let partition = PartitionId(1);
    let offered = |load| PeerMessage::Offered { partition, load };
    let refused = said(&bench.peer_says(1, offered(Duration::from_nanos(100))));
    assert!(refused.contains(&PeerMessage::OfferRefused { partition }), "{refused:?}");
    let taken = said(&bench.peer_says(1, offered(SECOND)));
    assert!(taken.contains(&PeerMessage::OfferTaken { partition }), "{taken:?}");
    let work = Work::Rays(rays(1, 0));
    assert_eq!(loads(&bench.peer_says(1, PeerMessage::Given { work })), [1]);
    let actions = bench.after(Event::PartitionLoaded { job: JobId(1), partition });
    assert_eq!(pieces(&actions).len(), 1);
    let is_failed = |action: &Action| matches!(action, Action::Tell(ToCoordinator::Failed { .. }));
    let work = Work::Rays(rays(7, 0));
    let actions = bench.peer_says(1, PeerMessage::Given { work });
    assert!(actions.iter().any(is_failed), "there is no such partition: {actions:?}");
}

#[test]
fn rays_for_a_home_that_takes_no_more_are_traced_by_a_copy() {
    for exchange in [Exchange::On, Exchange::Off] {
        let mut bench = at_home(Balancing { exchange, ..Balancing::default() });
        let come = || PeerMessage::Forwarded { bundles: vec![rays(0, 0)] };
        bench.peer_says(1, come());
        let here = PartitionId(0);
        let actions = bench.after(Event::PartitionLoaded { job: JobId(1), partition: here });
        let (mut sent, mut loaded, mut pending) = (0, Vec::new(), pieces(&actions));
        // Some more than it takes to close the window, for a copy has to be worth its load.
        for _ in 0..64 * WINDOW_FORWARDS {
            let actions = if let Some((piece, Work::Rays(bundle))) = pending.pop() {
                let onward = Bundle { partition: PartitionId(1), ..bundle };
                let outcome = Box::new(Outcome { successors: vec![onward], ..Outcome::default() });
                let elapsed = SECOND;
                bench.after(Event::Traced { job: JobId(1), piece, outcome, elapsed })
            } else {
                bench.peer_says(1, come())
            };
            let is_sent = |message: &&PeerMessage| matches!(message, PeerMessage::Forwarded { .. });
            sent += said(&actions).iter().filter(is_sent).count();
            loaded.extend(loads(&actions));
            pending.extend(pieces(&actions));
            if !loaded.is_empty() {
                break;
            }
        }
        assert_eq!(sent, WINDOW_FORWARDS, "then the window is closed");
        if exchange == Exchange::Off {
            assert!(loaded.is_empty(), "nobody may copy: {loaded:?}");
            continue;
        }
        assert_eq!(loaded, [1]);
        let partition = PartitionId(1);
        let actions = bench.after(Event::PartitionLoaded { job: JobId(1), partition });
        let Some((_, Work::Rays(bundle))) = pieces(&actions).pop() else { panic!("{actions:?}") };
        assert_eq!(bundle.partition, partition);
    }
}

#[test]
fn work_of_an_attempt_that_the_coordinator_has_not_told_of_waits() {
    let mut bench = at_home(Balancing { balance: Balance::None, ..Balancing::default() });
    let forwarded = PeerMessage::Forwarded { bundles: vec![rays(0, 1)] };
    assert!(bench.peer_says(1, forwarded).is_empty());
    let raised = ToWorker::AttemptsRaised { job: JobId(1), units: vec![(UnitId(3), Attempt(1))] };
    assert_eq!(loads(&bench.after(Event::CoordinatorSaid(raised))), [0]);
}
