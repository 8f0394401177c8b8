//! What the tests of the edges share: a coordinator that does as it is told, on a real socket, and
//! a job that is quickly done.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use equilux_common::balancing::Balancing;
use equilux_common::credit::Credit;
use equilux_common::ids::{Attempt, Incarnation, JobId, UnitId, WorkerId};
use equilux_common::job::{JobSpec, SceneRef};
use equilux_common::message::{JobStart, PeerAddress, ToCoordinator, ToWorker};
use equilux_common::scene::files::Pack;
use equilux_common::scene::load::load;
use equilux_common::spread::{Pieces, Tree};
use equilux_common::unit::Granularity;
use equilux_proto::hello::{Hello, Welcome};
use equilux_proto::pack::{self, PackRequest};
use equilux_proto::session::{FromCoordinator, FromWorker};
use equilux_proto::v1;
use equilux_proto::v1::coordinator_client::CoordinatorClient;
use equilux_proto::v1::coordinator_server::{Coordinator, CoordinatorServer};
use futures::StreamExt;
use futures::stream::{self, BoxStream};
use tokio::net::TcpListener;
use tokio::sync::mpsc;
use tokio::task::JoinSet;
use tokio_stream::wrappers::ReceiverStream;
use tonic::transport::server::TcpIncoming;
use tonic::transport::{Channel, Endpoint, Server};
use tonic::{Request, Response, Status, Streaming};

use crate::log::Log;
use crate::pack_cache::{CACHE_BYTES_MAX, PackCache};
use crate::packs::{Packs, Passing};

/// How long a test waits for what must happen.
pub(crate) const PATIENCE: Duration = Duration::from_secs(30);

/// Waits for what must happen.
pub(crate) async fn soon<T>(future: impl Future<Output = T>) -> T {
    tokio::time::timeout(PATIENCE, future).await.expect("it must happen soon")
}

/// What a log is told.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lines(Arc<Mutex<Vec<String>>>);

impl Lines {
    /// The log that is told it.
    pub(crate) fn log(&self) -> Log {
        let lines = Arc::clone(&self.0);
        Log::new(move |line| lines.lock().unwrap().push(line.to_owned()))
    }

    /// All that was said.
    pub(crate) fn all(&self) -> Vec<String> {
        self.0.lock().unwrap().clone()
    }

    /// Whether some line has this part.
    pub(crate) fn contain(&self, part: &str) -> bool {
        self.0.lock().unwrap().iter().any(|line| line.contains(part))
    }
}

/// Lets all go on that can, but for other threads.
pub(crate) async fn settle() {
    for _ in 0..100 {
        tokio::task::yield_now().await;
    }
}

/// A triangle before a sky, in a pack.
pub(crate) fn pack() -> Pack {
    Pack::from_files([("model.obj".to_owned(), model())]).unwrap()
}

/// That triangle.
pub(crate) fn model() -> Vec<u8> {
    b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".to_vec()
}

/// Bytes enough for many pieces.
pub(crate) fn content() -> Vec<u8> {
    (0u32..1_200_000).map(|index| (index.wrapping_mul(2_654_435_761) >> 21) as u8).collect()
}

/// The pieces of a tree as they are sent, but for some.
pub(crate) fn chunks(
    bytes: &[u8],
    tree: Tree,
    skip: u64,
) -> impl Iterator<Item = v1::PackChunk> + '_ {
    let pieces = Pieces::of(bytes.len() as u64);
    let ranges = (skip..).map_while(move |index| pieces.range(tree, index));
    ranges.map(|range| pack::chunk(bytes[range.start as usize..range.end as usize].to_vec()))
}

/// All pieces of a pack of so many bytes.
pub(crate) fn piece_count(bytes: usize) -> usize {
    let pieces = Pieces::of(bytes as u64);
    Tree::ALL.iter().map(|&tree| pieces.count(tree) as usize).sum()
}

/// Nothing to pass on.
pub(crate) fn no_packs() -> Passing {
    let directory = tempfile::tempdir().unwrap();
    let cache = PackCache::open(directory.path(), CACHE_BYTES_MAX, Log::silent()).unwrap();
    Packs::new(cache, no_coordinator(), Log::silent()).passing()
}

/// Nobody to ask.
pub(crate) fn no_coordinator() -> CoordinatorClient<Channel> {
    CoordinatorClient::new(Endpoint::from_static("http://127.0.0.1:1").connect_lazy())
}

/// A small image of the pack's scene.
pub(crate) fn spec(job: u64) -> JobSpec {
    let pack = pack();
    let loaded = load(&pack, "model.obj").unwrap();
    let mut settings = loaded.settings;
    (settings.width, settings.height, settings.samples_per_pixel) = (48, 32, 4);
    let scene = SceneRef {
        hash: pack.hash(),
        pack_bytes: pack.to_bytes().len() as u64,
        entry: "model.obj".into(),
    };
    let granularity = Granularity::for_job(settings.region(), 4, 2);
    JobSpec { id: JobId(job), scene, camera: loaded.camera, settings, granularity }
}

/// The start of that job, with all of its units.
pub(crate) fn start(job: u64, neighbors: Vec<PeerAddress>) -> JobStart {
    let spec = spec(job);
    let units = (0..spec.grid().unit_count()).map(|id| (UnitId(id), Attempt(0))).collect();
    let (balancing, pack_from) = (Balancing::default(), [None, None]);
    JobStart { spec, neighbors, homes: vec![], balancing, units, pack_from }
}

/// What has come home of a job.
#[derive(Debug, Default)]
pub(crate) struct Home {
    units: BTreeMap<UnitId, Credit>,
    pub(crate) ready: usize,
    pub(crate) failed: Vec<String>,
    pub(crate) samples: i64,
}

impl Home {
    /// Takes note of what a worker said.
    pub(crate) fn take(&mut self, message: ToCoordinator) {
        match message {
            ToCoordinator::Ready { .. } => self.ready += 1,
            ToCoordinator::Failed { reason, .. } => self.failed.push(reason),
            ToCoordinator::Delivered { share, sums, .. } => {
                self.units.entry(share.unit).or_default().merge(&share.credit).unwrap();
                let samples = |pixel: &equilux_common::film::PixelSums| {
                    pixel.even_samples + pixel.odd_samples
                };
                self.samples += sums.pixels.iter().map(samples).sum::<i64>();
            }
            ToCoordinator::Reported { figures, .. } => {
                assert!(figures.peak_rss_bytes > 0 || !cfg!(target_os = "linux"));
            }
        }
    }

    /// Whether all of the job is here.
    pub(crate) fn is_whole(&self, spec: &JobSpec) -> bool {
        self.units.len() == spec.grid().unit_count() as usize
            && self.units.values().all(Credit::is_whole)
    }
}

/// A coordinator for tests.
pub(crate) struct FakeCoordinator {
    /// `host:port`.
    pub(crate) address: String,
    /// Who came.
    pub(crate) sessions: mpsc::Receiver<FakeSession>,
    /// How many pieces of packs were handed out.
    pub(crate) pieces: Arc<AtomicUsize>,
    /// Bytes that are handed out whatever is asked for.
    pub(crate) handed_out: Arc<Mutex<Vec<u8>>>,
    /// How often it will say that it is busy.
    pub(crate) busy: Arc<Mutex<u32>>,
    /// How it does so.
    pub(crate) manner: Arc<Mutex<Manner>>,
    _server: JoinSet<()>,
}

/// How a coordinator hands out the pieces of a tree.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) enum Manner {
    /// All of them.
    #[default]
    Whole,
    /// So many and then nothing more; if none, it does not even answer.
    FallsSilent(usize),
    /// It says that it has none yet.
    HasNothing,
}

/// A worker at the door.
pub(crate) struct FakeSession {
    pub(crate) hello: Hello,
    pub(crate) said: Streaming<v1::WorkerToCoordinator>,
    pub(crate) answers: mpsc::Sender<Result<v1::CoordinatorToWorker, Status>>,
}

impl FakeCoordinator {
    /// Listens on `address`.
    pub(crate) async fn listen(address: &str) -> Self {
        Self::serve(address, None).await
    }

    /// Turns everybody away.
    pub(crate) async fn refusing(status: Status) -> Self {
        Self::serve("127.0.0.1:0", Some(status)).await
    }

    async fn serve(address: &str, refusal: Option<Status>) -> Self {
        let listener = TcpListener::bind(address).await.unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let (arrivals, sessions) = mpsc::channel(16);
        let (pieces, handed_out) = (Arc::default(), Arc::new(Mutex::new(pack().to_bytes())));
        let busy: Arc<Mutex<u32>> = Arc::default();
        let manner: Arc<Mutex<Manner>> = Arc::default();
        let service = FakeService {
            refusal,
            busy: Arc::clone(&busy),
            manner: Arc::clone(&manner),
            arrivals,
            pieces: Arc::clone(&pieces),
            handed_out: Arc::clone(&handed_out),
        };
        let mut server = JoinSet::new();
        server.spawn(async move {
            let server = Server::builder().add_service(CoordinatorServer::new(service));
            server.serve_with_incoming(TcpIncoming::from(listener)).await.unwrap();
        });
        Self { address, sessions, pieces, handed_out, busy, manner, _server: server }
    }

    /// The next worker that comes.
    pub(crate) async fn arrival(&mut self) -> FakeSession {
        soon(self.sessions.recv()).await.expect("somebody comes")
    }

    pub(crate) fn piece_count(&self) -> usize {
        self.pieces.load(Ordering::SeqCst)
    }
}

impl FakeSession {
    /// Lets the worker in; gives its place on a roster.
    pub(crate) async fn welcome(&self, worker: u32, incarnation: u64) -> PeerAddress {
        let (worker, incarnation) = (WorkerId(worker), Incarnation(incarnation));
        let welcome = Welcome { worker, incarnation };
        self.answers.send(Ok(FromCoordinator::Welcome(welcome).into())).await.unwrap();
        PeerAddress { worker, incarnation, address: self.hello.address.as_str().into() }
    }

    pub(crate) async fn tell(&self, message: ToWorker) {
        self.answers.send(Ok(FromCoordinator::Said(message).into())).await.unwrap();
    }

    /// The next thing that the worker says; none when it has left.
    pub(crate) async fn hear(&mut self) -> Option<ToCoordinator> {
        let wire = soon(self.said.message()).await.ok()??;
        match FromWorker::try_from(wire).expect("a worker says what is right") {
            FromWorker::Said(message) => Some(message),
            FromWorker::Hello(_) => panic!("a worker greets once"),
        }
    }
}

struct FakeService {
    refusal: Option<Status>,
    busy: Arc<Mutex<u32>>,
    manner: Arc<Mutex<Manner>>,
    arrivals: mpsc::Sender<FakeSession>,
    pieces: Arc<AtomicUsize>,
    handed_out: Arc<Mutex<Vec<u8>>>,
}

#[tonic::async_trait]
impl Coordinator for FakeService {
    type SessionStream = BoxStream<'static, Result<v1::CoordinatorToWorker, Status>>;
    type FetchPackStream = BoxStream<'static, Result<v1::PackChunk, Status>>;

    async fn session(
        &self,
        request: Request<Streaming<v1::WorkerToCoordinator>>,
    ) -> Result<Response<Self::SessionStream>, Status> {
        if let Some(status) = &self.refusal {
            return Err(status.clone());
        }
        let mut said = request.into_inner();
        let first = said.message().await?.expect("a worker greets");
        let Ok(FromWorker::Hello(hello)) = FromWorker::try_from(first) else {
            panic!("a worker greets first");
        };
        let (answers, messages) = mpsc::channel(16);
        // A test that does not look at who comes lets them in no more.
        let _not_looked_at = self.arrivals.send(FakeSession { hello, said, answers }).await;
        Ok(Response::new(ReceiverStream::new(messages).boxed()))
    }

    async fn fetch_pack(
        &self,
        request: Request<v1::PackRequest>,
    ) -> Result<Response<Self::FetchPackStream>, Status> {
        let request = PackRequest::try_from(request.into_inner()).expect("a right request");
        let left = self.busy.lock().unwrap().checked_sub(1);
        if let Some(left) = left {
            *self.busy.lock().unwrap() = left;
            return Err(Status::resource_exhausted("ask again"));
        }
        let bytes = self.handed_out.lock().unwrap().clone();
        let mut chunks: Vec<_> = chunks(&bytes, request.tree, request.skip).map(Ok).collect();
        let manner = *self.manner.lock().unwrap();
        match manner {
            Manner::Whole => {}
            Manner::FallsSilent(0) => return std::future::pending().await,
            Manner::FallsSilent(count) => chunks.truncate(count),
            Manner::HasNothing => chunks = vec![Ok(pack::none_yet())],
        }
        self.pieces.fetch_add(chunks.len(), Ordering::SeqCst);
        let chunks = stream::iter(chunks);
        let chunks = match manner {
            Manner::Whole => chunks.boxed(),
            Manner::FallsSilent(_) | Manner::HasNothing => chunks.chain(stream::pending()).boxed(),
        };
        Ok(Response::new(chunks))
    }
}
