//! Whole workers against a scripted coordinator, over real sockets on loopback.

use super::*;
use crate::testing::{
    FakeCoordinator, FakeSession, Home, PATIENCE, content, model, soon, spec, start,
};
use equilux_common::ids::JobId;
use equilux_common::message::{JobStart, ToCoordinator, ToWorker};
use equilux_common::scene::files::Pack;
use equilux_common::spread::Tree;
use equilux_proto::hello::{InvalidVersions, OtherVersion, Versions};
use std::sync::Mutex;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use tonic::Status;

/// A worker that runs until this is dropped or stopped.
struct Running {
    result: JoinHandle<Result<(), WorkerError>>,
    stop: oneshot::Sender<()>,
    lines: Arc<Mutex<Vec<String>>>,
    cache: tempfile::TempDir,
}

fn options(coordinator: &str) -> (Options, tempfile::TempDir) {
    let cache = tempfile::tempdir().unwrap();
    let options = Options {
        threads: 1,
        cache: Some(cache.path().into()),
        log: Log::silent(),
        ..Options::new(coordinator)
    };
    (options, cache)
}

fn launch(coordinator: &str) -> Running {
    let (mut options, cache) = options(coordinator);
    let lines: Arc<Mutex<Vec<String>>> = Arc::default();
    let kept = Arc::clone(&lines);
    options.log = Log::new(move |line| kept.lock().unwrap().push(line.to_owned()));
    let (stop, stopped) = oneshot::channel::<()>();
    let result = tokio::spawn(run(options, async move { drop(stopped.await) }));
    Running { result, stop, lines, cache }
}

impl Running {
    async fn stop(self) {
        self.stop.send(()).unwrap();
        soon(self.result).await.unwrap().unwrap();
    }

    fn has_said(&self, part: &str) -> bool {
        self.lines.lock().unwrap().iter().any(|line| line.contains(part))
    }

    async fn says(&self, part: &str) {
        soon(async {
            while !self.has_said(part) {
                sleep(Duration::from_millis(5)).await;
            }
        })
        .await;
    }
}

async fn render(session: &mut FakeSession, job: u64) -> Home {
    render_from(session, start(job, vec![])).await
}

async fn render_from(session: &mut FakeSession, start: JobStart) -> Home {
    let (mut home, spec, job) = (Home::default(), start.spec.clone(), start.spec.id);
    session.tell(ToWorker::JobStarted(Box::new(start))).await;
    while !home.is_whole(&spec) {
        home.take(session.hear().await.expect("the worker goes on"));
        assert_eq!(home.failed, Vec::<String>::new());
    }
    session.tell(ToWorker::JobEnded { job }).await;
    home
}

#[tokio::test]
async fn a_worker_renders_over_grpc_and_fetches_a_scene_once() {
    let mut coordinator = FakeCoordinator::listen("127.0.0.1:0").await;
    let worker = launch(&format!("http://{}", coordinator.address));
    let mut session = coordinator.arrival().await;
    assert!(session.hello.address.starts_with("127.0.0.1:"), "{}", session.hello.address);
    assert_eq!(session.hello.threads, 1);
    assert!(session.hello.speed > 0);
    session.welcome(0, 1).await;
    let pack_bytes = spec(1).scene.pack_bytes as usize;
    for job in 1..3 {
        let home = render(&mut session, job).await;
        assert_eq!((home.ready, home.samples), (1, 48 * 32 * 4));
    }
    assert_eq!(coordinator.piece_count(), crate::testing::piece_count(pack_bytes));
    worker.stop().await;
    while session.hear().await.is_some() {}
}

#[tokio::test]
async fn workers_pass_a_scene_on_and_the_coordinator_hands_it_out_once() {
    let mut coordinator = FakeCoordinator::listen("127.0.0.1:0").await;
    let (mut workers, mut sessions, mut places) = (vec![], vec![], vec![]);
    let (filling, model) = (content(), ("model.obj".to_owned(), model()));
    let pack = Pack::from_files([model, ("filling".to_owned(), filling)]).unwrap();
    *coordinator.handed_out.lock().unwrap() = pack.to_bytes();
    for worker in 0..3 {
        workers.push(launch(&coordinator.address));
        let session = coordinator.arrival().await;
        places.push(session.welcome(worker, 1).await);
        sessions.push(session);
    }
    let pack_bytes = pack.to_bytes().len();
    let rendering = sessions.iter_mut().enumerate().map(|(index, session)| {
        let mut start = start(1, vec![]);
        (start.spec.scene.hash, start.spec.scene.pack_bytes) = (pack.hash(), pack_bytes as u64);
        let from = |tree: Tree| tree.parent(index, 3).map(|parent| places[parent].clone());
        start.pack_from = Tree::ALL.map(from);
        render_from(session, start)
    });
    for home in futures::future::join_all(rendering).await {
        assert_eq!(home.samples, 48 * 32 * 4);
    }
    assert_eq!(coordinator.piece_count(), crate::testing::piece_count(pack_bytes));
    for worker in workers {
        assert!(!worker.has_said("the coordinator is asked"));
        worker.stop().await;
    }
}

#[tokio::test]
async fn two_workers_share_a_job_over_a_link() {
    let mut coordinator = FakeCoordinator::listen("127.0.0.1:0").await;
    let workers = [launch(&coordinator.address), launch(&coordinator.address)];
    let mut busy = coordinator.arrival().await;
    let mut idle = coordinator.arrival().await;
    assert_ne!(busy.hello.name, idle.hello.name);
    // The one with work has the higher id, so the link is opened to it.
    let (idle_address, busy_address) = (idle.welcome(3, 1).await, busy.welcome(5, 2).await);
    let mut whole = start(1, vec![idle_address]);
    whole.spec.settings.samples_per_pixel = 4000;
    whole.spec.granularity.samples_per_unit = 4000;
    let none = JobStart { units: vec![], neighbors: vec![busy_address], ..whole.clone() };
    let spec = whole.spec.clone();
    idle.tell(ToWorker::JobStarted(Box::new(none))).await;
    busy.tell(ToWorker::JobStarted(Box::new(whole))).await;
    let (mut home, mut from_idle) = (Home::default(), 0);
    while !home.is_whole(&spec) {
        let message = tokio::select! {
            message = busy.hear() => message,
            message = idle.hear() => { from_idle += 1; message }
        };
        home.take(message.expect("both go on"));
        assert_eq!(home.failed, Vec::<String>::new());
    }
    assert_eq!(home.samples, 48 * 32 * 4000);
    assert!(from_idle > 2, "the idle worker has got work: {from_idle}");
    for worker in workers {
        worker.stop().await;
    }
}

#[tokio::test]
async fn a_worker_that_starts_first_waits_for_its_coordinator_and_says_so() {
    let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = free.local_addr().unwrap().to_string();
    drop(free);
    let worker = launch(&address);
    worker.says("trying again").await;
    assert!(worker.has_said("cannot be reached") && worker.has_said(&address));
    let mut coordinator = FakeCoordinator::listen(&address).await;
    let mut session = coordinator.arrival().await;
    session.welcome(0, 1).await;
    render(&mut session, 1).await;
    worker.stop().await;
}

#[tokio::test]
async fn another_version_is_refused_for_good_and_both_are_named() {
    let theirs = Versions { program: "9.8.7".into(), protocol: 99 };
    let other = InvalidVersions::Other(OtherVersion { theirs, ours: Versions::own() });
    let refusal = Status::failed_precondition(other.to_string());
    let coordinator = FakeCoordinator::refusing(refusal).await;
    let (options, _cache) = options(&coordinator.address);
    let error = soon(run(options, std::future::pending())).await.unwrap_err();
    assert!(matches!(error, WorkerError::Refused { .. }));
    for part in ["9.8.7", "99", env!("CARGO_PKG_VERSION"), &coordinator.address] {
        assert!(error.to_string().contains(part), "{error}");
    }
}

#[tokio::test]
async fn a_broken_session_begins_a_new_life_under_the_same_name() {
    let mut coordinator = FakeCoordinator::listen("127.0.0.1:0").await;
    let worker = launch(&coordinator.address);
    let first = coordinator.arrival().await;
    first.welcome(4, 1).await;
    first.tell(ToWorker::JobStarted(Box::new(start(1, vec![])))).await;
    let name = first.hello.name.clone();
    first.answers.send(Err(Status::aborted("you are fenced"))).await.unwrap();
    drop(first);
    let mut second = coordinator.arrival().await;
    worker.says("you are fenced").await;
    assert_eq!(second.hello.name, name);
    second.welcome(4, 2).await;
    render(&mut second, 2).await;
    worker.stop().await;
}

#[tokio::test]
async fn a_scene_stays_in_memory_over_jobs_and_sessions_until_another_one_comes() {
    let mut coordinator = FakeCoordinator::listen("127.0.0.1:0").await;
    let worker = launch(&coordinator.address);
    let mut first = coordinator.arrival().await;
    first.welcome(0, 1).await;
    render(&mut first, 1).await;
    // From here on, only memory has it.
    std::fs::remove_dir_all(worker.cache.path().join("packs")).unwrap();
    first.answers.send(Err(Status::aborted("come back"))).await.unwrap();
    drop(first);
    let mut second = coordinator.arrival().await;
    second.welcome(0, 2).await;
    render(&mut second, 2).await;
    let pieces = coordinator.piece_count();
    let mut other = start(3, vec![]);
    other.spec.scene.entry = "absent.json".into();
    second.tell(ToWorker::JobStarted(Box::new(other))).await;
    while !matches!(second.hear().await, Some(ToCoordinator::Failed { .. })) {}
    assert_eq!(coordinator.piece_count(), 2 * pieces, "another scene file is another scene");
    worker.stop().await;
}

#[tokio::test]
async fn a_coordinator_that_breaks_the_protocol_is_left_and_tried_again() {
    let mut coordinator = FakeCoordinator::listen("127.0.0.1:0").await;
    let worker = launch(&coordinator.address);
    let first = coordinator.arrival().await;
    first.tell(ToWorker::JobEnded { job: JobId(1) }).await;
    worker.says("its welcome must come first").await;
    let second = coordinator.arrival().await;
    second.welcome(1, 1).await;
    let mut start = start(1, vec![]);
    start.spec.settings.width = 0;
    second.tell(ToWorker::JobStarted(Box::new(start))).await;
    worker.says("settings.film.width").await;
    let third = coordinator.arrival().await;
    third.welcome(1, 3).await;
    worker.stop().await;
}

#[tokio::test]
async fn a_scene_that_cannot_be_read_fails_the_job_and_the_worker_goes_on() {
    let mut coordinator = FakeCoordinator::listen("127.0.0.1:0").await;
    let worker = launch(&coordinator.address);
    let mut session = coordinator.arrival().await;
    session.welcome(0, 1).await;
    let mut bad = start(1, vec![]);
    bad.spec.scene.entry = "absent.json".into();
    session.tell(ToWorker::JobStarted(Box::new(bad))).await;
    let mut home = Home::default();
    while home.failed.is_empty() {
        home.take(session.hear().await.expect("the worker goes on"));
    }
    assert!(home.failed[0].contains("absent.json"), "{:?}", home.failed);
    session.tell(ToWorker::JobEnded { job: JobId(1) }).await;
    render(&mut session, 2).await;
    worker.stop().await;
}

#[tokio::test]
async fn options_that_cannot_be_are_refused_with_a_remedy() {
    let refusal = |change: fn(&mut Options)| async move {
        let (mut options, _cache) = options("127.0.0.1:1");
        change(&mut options);
        let stopped = std::future::ready(());
        tokio::time::timeout(PATIENCE, run(options, stopped))
            .await
            .unwrap()
            .unwrap_err()
            .to_string()
    };
    for bad in ["", "host", "host:0", "https://host:1", "http://host:1/x", "a@b:1", "h h:1"] {
        let (mut options, _cache) = options("127.0.0.1:1");
        options.coordinator = bad.into();
        let error = run(options, std::future::ready(())).await.unwrap_err();
        assert!(error.to_string().contains("http://HOST:PORT"), "{error}");
    }
    assert!(refusal(|options| options.threads = 0).await.contains("--threads 0"));
    assert!(
        refusal(|options| options.advertise = Some("a b".into())).await.contains("--advertise")
    );
    let no_port = |options: &mut Options| options.advertise = Some("box:http".into());
    assert!(refusal(no_port).await.contains("--advertise"));
    let absent = |options: &mut Options| options.cache = Some("/proc/nowhere".into());
    assert!(refusal(absent).await.contains("--cache"));
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let (mut options, _cache) = options("127.0.0.1:1");
    options.listen = Some(taken.local_addr().unwrap());
    let error = run(options, std::future::ready(())).await.unwrap_err().to_string();
    assert!(error.contains("another program uses that port"), "{error}");
}

#[test]
fn peers_are_told_where_they_find_this_worker() {
    let bound: SocketAddr = "0.0.0.0:7000".parse().unwrap();
    let local: IpAddr = "10.1.2.3".parse().unwrap();
    assert_eq!(advertised(None, bound, local), "10.1.2.3:7000");
    assert_eq!(advertised(None, "127.0.0.1:9".parse().unwrap(), local), "127.0.0.1:9");
    assert_eq!(advertised(Some("box"), bound, local), "box:7000");
    assert_eq!(advertised(Some("box:80"), bound, local), "box:80");
    assert_eq!(advertised(Some("[::1]"), bound, local), "[::1]:7000");
    assert_eq!(advertised(None, "[::]:9".parse().unwrap(), "::1".parse().unwrap()), "[::1]:9");
}
