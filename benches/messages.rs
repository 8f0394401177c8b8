//! What a message between workers costs each end's processor besides its core: the figures that
//! forecasts use.
//!
//! `cargo bench --bench messages` runs both ends of a link, as workers have it, on a thread each.
//! Questions for load and their answers go to and fro, one at a time, so that each wakes the other
//! end (the dearest way: what comes in numbers shares its system calls); then bundles, which are
//! acknowledged. All processors are busy with other threads meanwhile, as a worker's are: to wake
//! an idle one is dearer, but then time is not short. It prints the processor time that an end
//! takes for a message and for a thousand bytes, medians of ROUNDS rounds. Linux only.

#![expect(clippy::print_stdout, reason = "a benchmark's figures are its output")]

use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use bytemuck::Zeroable;
use equilux_common::bundle::{BUNDLE_RAYS_MAX, Bundle, Share, Stage};
use equilux_common::credit::Credit;
use equilux_common::ids::{Attempt, JobId, PartitionId, UnitId};
use equilux_common::message::{Load, PeerMessage};
use equilux_common::ray::Ray;
use equilux_common::work::Work;
use equilux_proto::peer::PeerFrame;
use equilux_proto::v1;
use equilux_proto::v1::peer_client::PeerClient;
use equilux_proto::v1::peer_server::{Peer, PeerServer};
use futures::{Stream, StreamExt};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::transport::{Endpoint, Server, server::TcpIncoming};
use tonic::{Request, Response, Status, Streaming};

/// How often each figure is measured.
const ROUNDS: usize = 7;

/// Messages there, and as many back, of a round.
const TRIPS: u32 = 10_000;

/// Of the size of a bundle of [`BUNDLE_RAYS_MAX`] rays.
const BUNDLE_KILOBYTES: f64 = (BUNDLE_RAYS_MAX * size_of::<Ray>()) as f64 / 1000.0;

type Frames = Pin<Box<dyn Stream<Item = Result<v1::PeerFrame, Status>> + Send>>;

/// The other end: answers what it is asked.
struct Answering;

#[tonic::async_trait]
impl Peer for Answering {
    type ExchangeStream = Frames;
    type PassPackStream = Pin<Box<dyn Stream<Item = Result<v1::PackChunk, Status>> + Send>>;

    async fn exchange(
        &self,
        request: Request<Streaming<v1::PeerFrame>>,
    ) -> Result<Response<Frames>, Status> {
        let answers = request.into_inner().map(|frame| Ok(answer(frame?)));
        Ok(Response::new(Box::pin(answers)))
    }

    async fn pass_pack(
        &self,
        _: Request<v1::PackRequest>,
    ) -> Result<Response<Self::PassPackStream>, Status> {
        Err(Status::unimplemented("only messages are measured"))
    }
}

fn main() {
    let busy = Busy::new();
    let mut rounds = (0..ROUNDS).map(|_| round()).collect::<Vec<_>>();
    drop(busy);
    println!("processor time of an end besides its core, median of {ROUNDS} rounds");
    rounds.sort_by(|a, b| a.0.total_cmp(&b.0));
    println!("a message       {:.2} µs", rounds[ROUNDS / 2].0 * 1e6);
    rounds.sort_by(|a, b| a.1.total_cmp(&b.1));
    println!("a thousand bytes {:.2} µs", rounds[ROUNDS / 2].1 * 1e6);
}

/// Threads that keep all processors busy until this is dropped.
struct Busy(Arc<AtomicBool>);

impl Busy {
    #[expect(clippy::disallowed_methods, reason = "compute threads stand beside the ends")]
    fn new() -> Self {
        let is_over = Arc::new(AtomicBool::new(false));
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            let is_over = is_over.clone();
            std::thread::spawn(move || {
                while !is_over.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            });
        }
        Self(is_over)
    }
}

impl Drop for Busy {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Seconds of an end for a message, and for a thousand bytes besides.
fn round() -> (f64, f64) {
    let small = ends_time(|| PeerMessage::LoadAsked { round: 7 });
    let large = ends_time(|| PeerMessage::Given { work: Work::Rays(bundle()) });
    // A trip is two messages, and both ends handle both.
    let message = small.as_secs_f64() / f64::from(TRIPS) / 4.0;
    let bundle = (large.as_secs_f64() - small.as_secs_f64()) / f64::from(TRIPS) / 2.0;
    (message, bundle / BUNDLE_KILOBYTES)
}

/// Processor time of both ends for all trips of a round.
#[expect(clippy::disallowed_methods, reason = "each end has a thread, whose time is its own")]
fn ends_time(message: impl Fn() -> PeerMessage) -> Duration {
    let (address, listening) = std::sync::mpsc::channel();
    let (stop, stopped) = tokio::sync::oneshot::channel();
    let other = std::thread::spawn(move || {
        runtime().block_on(async {
            let incoming = TcpIncoming::bind(SocketAddr::from(([127, 0, 0, 1], 0)))
                .expect("a port of this machine")
                .with_nodelay(Some(true));
            address.send(incoming.local_addr().expect("it is bound")).expect("it is awaited");
            let server = Server::builder().add_service(PeerServer::new(Answering));
            let until = async { stopped.await.unwrap_or_default() };
            server.serve_with_incoming_shutdown(incoming, until).await.expect("it serves");
        });
        processor_time()
    });
    let address = listening.recv().expect("the other end listens");
    let before = processor_time();
    runtime().block_on(ask(address, message));
    let own = processor_time() - before;
    stop.send(()).expect("the other end still serves");
    own + other.join().expect("the other end ends well")
}

async fn ask(address: SocketAddr, message: impl Fn() -> PeerMessage) {
    let endpoint = Endpoint::from_shared(format!("http://{address}")).expect("an address");
    let channel = endpoint.tcp_nodelay(true).connect().await.expect("the other end listens");
    let (outgoing, frames) = mpsc::channel(16);
    let exchange = PeerClient::new(channel).exchange(ReceiverStream::new(frames)).await;
    let mut incoming = exchange.expect("the other end answers").into_inner();
    for _ in 0..TRIPS {
        outgoing.send(said(message())).await.expect("the stream stands");
        let answer = incoming.message().await.expect("the stream stands").expect("an answer");
        PeerFrame::try_from(answer).expect("a frame");
    }
}

fn answer(frame: v1::PeerFrame) -> v1::PeerFrame {
    match PeerFrame::try_from(frame).expect("a frame") {
        PeerFrame::Said { message: PeerMessage::LoadAsked { round }, .. } => {
            said(PeerMessage::Load { round, load: Load::from_millis(3), capacity: 1000 })
        }
        _ => said(PeerMessage::Acknowledged { count: 1 }),
    }
}

fn said(message: PeerMessage) -> v1::PeerFrame {
    PeerFrame::Said { job: JobId(1), message }.into()
}

fn bundle() -> Bundle {
    Bundle {
        stage: Stage::Intersect,
        partition: PartitionId(0),
        shares: vec![Share { unit: UnitId(5), attempt: Attempt(0), credit: Credit::whole() }],
        rays: vec![Ray::zeroed(); BUNDLE_RAYS_MAX],
    }
}

fn runtime() -> tokio::runtime::Runtime {
    tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime")
}

/// Processor time of this thread.
fn processor_time() -> Duration {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").expect("Linux");
    let nanos = text.split_whitespace().next().and_then(|nanos| nanos.parse().ok());
    Duration::from_nanos(nanos.expect("nanoseconds on a processor"))
}
