//! The driver: the loop that feeds a worker's core and does what it asks.
//!
//! One task owns the core. All that happens reaches it as an [`Input`]; it never waits for anybody
//! but its inputs, so that it cannot be part of a ring of waiters. It runs unchanged over channels
//! in one process and over gRPC.

use std::collections::BTreeMap;
use std::io;
use std::sync::Arc;

use equilux_common::ids::{Incarnation, JobId, PartitionId, WorkerId};
use equilux_common::job::JobSpec;
use equilux_common::message::{PeerAddress, PeerMessage, ToCoordinator, ToWorker};
use equilux_common::spread::PackSources;
use equilux_mapping::Guest;
use equilux_worker_core::action::Action;
use equilux_worker_core::event::Event;
use equilux_worker_core::{Config, WorkerCore};
use futures::future::BoxFuture;
use tokio::sync::mpsc;

use crate::clock::Clock;
use crate::compute::{Compute, Task, Traced, Tracer};
use crate::loading;
use crate::peers::{Heard, Peers};
use crate::residence::peak_rss_bytes;

/// Most inputs that wait for the driver; whoever has another one waits, and with it the socket that
/// it reads from.
const INPUTS_MAX: usize = 1024;

/// Where scenes come from.
pub trait SceneSource: Send + Sync {
    /// Makes a job's scene ready to be traced, or says what is wrong and what to do about it.
    /// If it is not here, those pass it on. Nothing that takes long may be done on the calling
    /// thread.
    fn load(
        &self,
        spec: JobSpec,
        from: PackSources,
    ) -> BoxFuture<'static, Result<Prepared, String>>;
}

/// A job's scene, ready to be traced.
#[derive(Clone)]
pub struct Prepared {
    /// Traces through what is in memory.
    pub tracer: Arc<dyn Tracer>,
    /// The partitions of a model that is cut; none of a replicated one, which is in memory.
    pub partitions: Option<Arc<dyn Partitions>>,
}

/// The partitions of a job's model, which come into memory and go.
pub trait Partitions: Send + Sync {
    /// The bytes of memory that each takes, where it lies, and how much they have to do with one
    /// another; none if there are no partitions.
    fn guest(&self) -> Option<Guest>;

    /// Brings one into memory: what is traced afterwards is traced through it. If it is not here,
    /// that peer passes it on. Nothing that takes long may be done on the calling thread.
    fn load(
        &self,
        partition: PartitionId,
        from: Option<PeerAddress>,
    ) -> BoxFuture<'static, Result<(), String>>;

    /// Lets go of one: what is traced afterwards is not traced through it.
    fn release(&self, partition: PartitionId);
}

impl Prepared {
    /// A replicated model.
    #[must_use]
    pub fn replicated(tracer: Arc<dyn Tracer>) -> Self {
        Self { tracer, partitions: None }
    }
}

/// The closed list of what reaches the driver, but for what the coordinator says.
pub(crate) enum Input {
    /// About a peer.
    Peer(Heard),
    /// A scene is ready, or cannot be had.
    Loaded { job: JobId, scene: Result<Prepared, String> },
    /// A partition is in memory, or cannot be had.
    PartitionLoaded { job: JobId, partition: PartitionId, outcome: Result<(), String> },
    /// A thread has done something.
    Traced(Traced),
}

/// What leads to the coordinator and back.
#[derive(Debug)]
pub struct CoordinatorLink {
    /// What the coordinator says; when it ends, so does the driver.
    pub incoming: mpsc::Receiver<ToWorker>,
    /// What it is told; when nobody listens any more, the driver ends.
    pub outgoing: mpsc::Sender<ToCoordinator>,
}

/// What a driver starts from.
pub(crate) struct Parts {
    pub(crate) config: Config,
    pub(crate) scenes: Arc<dyn SceneSource>,
    pub(crate) peers: Peers,
    /// The same channel that `peers` writes to.
    pub(crate) inputs: (mpsc::Sender<Input>, mpsc::Receiver<Input>),
}

/// A channel for inputs.
pub(crate) fn inputs() -> (mpsc::Sender<Input>, mpsc::Receiver<Input>) {
    mpsc::channel(INPUTS_MAX)
}

/// The loop and all that it owns.
pub(crate) struct Driver {
    core: WorkerCore,
    clock: Clock,
    compute: Compute,
    scenes: Arc<dyn SceneSource>,
    /// Scenes of running jobs; none while one is being loaded.
    prepared: BTreeMap<JobId, Option<Prepared>>,
    peers: Peers,
    inputs: mpsc::Receiver<Input>,
    own_inputs: mpsc::Sender<Input>,
    incoming: mpsc::Receiver<ToWorker>,
    /// What the coordinator has yet to be told. Not bounded, for waiting here would stop all; it
    /// holds what would otherwise lie in the core.
    telling: mpsc::UnboundedSender<ToCoordinator>,
}

impl Driver {
    /// Starts the compute threads.
    ///
    /// # Errors
    /// If the system gives no more threads.
    pub(crate) fn start(parts: Parts, link: CoordinatorLink) -> io::Result<Self> {
        let Parts { config, scenes, peers, inputs: (own_inputs, inputs) } = parts;
        let reports = own_inputs.clone();
        let report = move |traced| {
            // Nobody listens once the driver has ended.
            let _late = reports.blocking_send(Input::Traced(traced));
        };
        let (telling, told) = mpsc::unbounded_channel();
        tokio::spawn(forward(told, link.outgoing));
        Ok(Self {
            core: WorkerCore::new(config),
            clock: Clock::start(),
            compute: Compute::start(config.threads, report)?,
            scenes,
            prepared: BTreeMap::new(),
            peers,
            inputs,
            own_inputs,
            incoming: link.incoming,
            telling,
        })
    }

    /// Runs until the link to the coordinator is gone.
    pub(crate) async fn run(mut self) {
        loop {
            let deadline = self.core.next_deadline();
            tokio::select! {
                said = self.incoming.recv() => match said {
                    Some(message) => self.handle(Event::CoordinatorSaid(message)),
                    None => return,
                },
                Some(input) = self.inputs.recv() => self.take(input),
                () = self.clock.sleep_until(deadline) => self.core.wake(self.clock.now()),
                () = self.telling.closed() => return,
            }
            while let Some(action) = self.core.poll_action() {
                self.perform(action);
            }
        }
    }

    fn handle(&mut self, event: Event) {
        self.core.handle(self.clock.now(), event);
    }

    /// Turns an input into an event.
    fn take(&mut self, input: Input) {
        match input {
            Input::Peer(heard) => {
                if let Some(event) = self.peers.hear(heard) {
                    self.handle(event);
                }
            }
            Input::Loaded { job, scene } => self.take_scene(job, scene),
            Input::PartitionLoaded { job, partition, outcome } => self.handle(match outcome {
                Ok(()) => Event::PartitionLoaded { job, partition },
                Err(reason) => Event::SceneFailed { job, reason },
            }),
            Input::Traced(traced) => self.take_traced(traced),
        }
    }

    /// The one place that matches actions.
    fn perform(&mut self, action: Action) {
        match action {
            Action::LoadScene { spec, pack_from } => self.load(*spec, pack_from),
            Action::Trace { job, piece, work } => {
                let prepared = self.prepared.get(&job).and_then(Option::as_ref);
                let prepared = prepared.expect("the core traces what has been loaded");
                let tracer = Arc::downgrade(&prepared.tracer);
                self.compute.trace(Task { job, piece, tracer, work });
            }
            Action::LoadPartition { job, partition, from } => {
                self.load_partition(job, partition, from);
            }
            Action::DropPartition { job, partition } => self.partitions(job).release(partition),
            Action::Interrupt => self.compute.interrupt(),
            Action::DropScene { job } => self.drop_scene(job),
            Action::Link(peers) => self.peers.keep(&peers),
            Action::TellPeer { peer, incarnation, job, message } => {
                self.tell_peer(peer, incarnation, job, message);
            }
            Action::Tell(message) => self.tell(message),
        }
    }

    fn load(&mut self, spec: JobSpec, from: PackSources) {
        let job = spec.id;
        self.prepared.insert(job, None);
        let loading = self.scenes.load(spec, from);
        let inputs = self.own_inputs.clone();
        tokio::spawn(async move {
            let scene = loading::outcome(tokio::spawn(loading)).await;
            // Nobody listens once the driver has ended.
            let _late = inputs.send(Input::Loaded { job, scene }).await;
        });
    }

    fn load_partition(&self, job: JobId, partition: PartitionId, from: Option<PeerAddress>) {
        let loading = self.partitions(job).load(partition, from);
        let inputs = self.own_inputs.clone();
        tokio::spawn(async move {
            let outcome = loading::outcome(tokio::spawn(loading)).await;
            // Nobody listens once the driver has ended.
            let _late = inputs.send(Input::PartitionLoaded { job, partition, outcome }).await;
        });
    }

    fn partitions(&self, job: JobId) -> &Arc<dyn Partitions> {
        let prepared = self.prepared.get(&job).and_then(Option::as_ref);
        let partitions = prepared.and_then(|prepared| prepared.partitions.as_ref());
        partitions.expect("the core was told of partitions")
    }

    fn take_scene(&mut self, job: JobId, scene: Result<Prepared, String>) {
        let Some(place) = self.prepared.get_mut(&job) else { return free(scene.ok()) };
        match scene {
            Ok(prepared) => {
                let partitions = prepared.partitions.as_ref().and_then(|p| p.guest());
                *place = Some(prepared);
                self.handle(Event::SceneLoaded { job, partitions });
            }
            Err(reason) => self.handle(Event::SceneFailed { job, reason }),
        }
    }

    fn take_traced(&mut self, Traced { job, piece, outcome, elapsed }: Traced) {
        match outcome {
            Ok(outcome) => {
                let outcome = Box::new(outcome);
                self.handle(Event::Traced { job, piece, outcome, elapsed });
            }
            // What was traced is lost, so the job cannot become whole.
            Err(error) => self.handle(Event::SceneFailed { job, reason: error.to_string() }),
        }
    }

    /// Lets go of a scene.
    fn drop_scene(&mut self, job: JobId) {
        self.compute.interrupt();
        self.peers.forget(job);
        free(self.prepared.remove(&job).flatten());
    }

    fn tell_peer(
        &mut self,
        peer: WorkerId,
        incarnation: Incarnation,
        job: JobId,
        message: PeerMessage,
    ) {
        if self.peers.tell(peer, incarnation, job, message).is_err() {
            self.handle(Event::PeerLost { peer, incarnation });
        }
    }

    /// Adds to figures what the core cannot know.
    fn tell(&mut self, mut message: ToCoordinator) {
        if let ToCoordinator::Reported { job, figures } = &mut message {
            figures.peak_rss_bytes = peak_rss_bytes();
            figures.bytes_out = self.peers.bytes_out(*job);
        }
        // Nobody listens once the link is gone, which the loop finds out by itself.
        let _late = self.telling.send(message);
    }
}

/// Frees a scene. That of a large one takes long, so it is not done where messages wait.
fn free(scene: Option<Prepared>) {
    if let Some(prepared) = scene {
        tokio::task::spawn_blocking(move || drop(prepared));
    }
}

/// Hands on what the coordinator is told, as fast as it takes it.
async fn forward(
    mut told: mpsc::UnboundedReceiver<ToCoordinator>,
    outgoing: mpsc::Sender<ToCoordinator>,
) {
    while let Some(message) = told.recv().await {
        if outgoing.send(message).await.is_err() {
            return;
        }
    }
}

/// Runs a worker in this process, over channels, without peers of its own.
///
/// Ends when the link to the coordinator does.
///
/// # Errors
/// If the system gives no more threads.
pub async fn drive_local(
    config: Config,
    link: CoordinatorLink,
    scenes: Arc<dyn SceneSource>,
) -> io::Result<()> {
    let inputs = inputs();
    let peers = Peers::none(config.worker, config.incarnation);
    Driver::start(Parts { config, scenes, peers, inputs }, link)?.run().await;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes::LoadedScene;
    use crate::testing::{Home, pack, soon, start};
    use equilux_common::scene::load::load;
    use equilux_common::work::{Outcome, Work};
    use equilux_render::home::InvalidWork;
    use equilux_render::scratch::Scratch;
    use std::sync::atomic::AtomicBool;

    const CONFIG: Config = Config {
        worker: WorkerId(0),
        incarnation: Incarnation(1),
        threads: 2,
        speed: 1000,
        memory: None,
    };

    /// The coordinator's end of a worker in this process.
    struct Bench {
        told: mpsc::Sender<ToWorker>,
        said: mpsc::Receiver<ToCoordinator>,
        worker: tokio::task::JoinHandle<io::Result<()>>,
    }

    fn bench(scenes: Arc<dyn SceneSource>) -> Bench {
        let (told, incoming) = mpsc::channel(4);
        let (outgoing, said) = mpsc::channel(1);
        let link = CoordinatorLink { incoming, outgoing };
        Bench { told, said, worker: tokio::spawn(drive_local(CONFIG, link, scenes)) }
    }

    impl Bench {
        async fn start(&self, job: u64) {
            let start = Box::new(start(job, vec![]));
            self.told.send(ToWorker::JobStarted(start)).await.unwrap();
        }

        async fn hear_into(&mut self, home: &mut Home) {
            home.take(soon(self.said.recv()).await.expect("the worker goes on"));
        }

        async fn leave(self) {
            drop(self.told);
            soon(self.worker).await.unwrap().unwrap();
        }
    }

    struct Ready(Arc<dyn Tracer>);

    impl SceneSource for Ready {
        fn load(&self, _: JobSpec, _: PackSources) -> BoxFuture<'static, Result<Prepared, String>> {
            let tracer = Arc::clone(&self.0);
            Box::pin(async move { Ok(Prepared::replicated(tracer)) })
        }
    }

    /// Does nothing but panic.
    struct Panics;

    impl Tracer for Panics {
        fn trace(&self, _: Work, _: &AtomicBool, _: &mut Scratch) -> Result<Outcome, InvalidWork> {
            panic!("as planned")
        }
    }

    #[tokio::test]
    async fn a_worker_alone_renders_jobs_on_one_scene_over_channels() {
        let scene = load(&pack(), "model.obj").unwrap().scene;
        let mut bench = bench(Arc::new(LoadedScene::new(scene)));
        for job in 1..3 {
            bench.start(job).await;
            let (mut home, spec) = (Home::default(), crate::testing::spec(job));
            while !home.is_whole(&spec) {
                bench.hear_into(&mut home).await;
            }
            assert_eq!((home.ready, home.failed.len()), (1, 0));
            assert_eq!(home.samples, 48 * 32 * 4);
            bench.told.send(ToWorker::JobEnded { job: JobId(job) }).await.unwrap();
        }
        bench.leave().await;
    }

    #[tokio::test]
    async fn a_panic_while_tracing_fails_the_job_and_not_the_worker() {
        let mut bench = bench(Arc::new(Ready(Arc::new(Panics))));
        for job in 1..3 {
            bench.start(job).await;
            let mut home = Home::default();
            while home.failed.is_empty() {
                bench.hear_into(&mut home).await;
            }
            assert!(home.failed[0].contains("as planned"), "{:?}", home.failed);
            bench.told.send(ToWorker::JobEnded { job: JobId(job) }).await.unwrap();
        }
        bench.leave().await;
    }

    impl SceneSource for Panics {
        fn load(&self, _: JobSpec, _: PackSources) -> BoxFuture<'static, Result<Prepared, String>> {
            Box::pin(async { panic!("as planned") })
        }
    }

    #[tokio::test]
    async fn a_panic_while_loading_fails_the_job_and_not_the_worker() {
        let mut bench = bench(Arc::new(Panics));
        for job in 1..3 {
            bench.start(job).await;
            let mut home = Home::default();
            while home.failed.is_empty() {
                bench.hear_into(&mut home).await;
            }
            assert!(home.failed[0].contains("as planned"), "{:?}", home.failed);
            bench.told.send(ToWorker::JobEnded { job: JobId(job) }).await.unwrap();
        }
        bench.leave().await;
    }

    #[tokio::test]
    async fn a_scene_that_cannot_be_had_fails_the_job() {
        let mut scene = load(&pack(), "model.obj").unwrap().scene;
        scene.geometry.positions[0] = [1e30; 3];
        let mut bench = bench(Arc::new(LoadedScene::new(scene)));
        for job in 1..3 {
            bench.start(job).await;
            let mut home = Home::default();
            while home.failed.is_empty() {
                bench.hear_into(&mut home).await;
            }
            assert!(home.failed[0].contains("scale the models down"), "{:?}", home.failed);
            bench.told.send(ToWorker::JobEnded { job: JobId(job) }).await.unwrap();
        }
        bench.leave().await;
    }
}
