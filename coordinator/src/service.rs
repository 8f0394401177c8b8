//! The gRPC service: workers' sessions and the scenes' packs.
//!
//! A session is a worker's membership: it begins with a greeting, carries messages both ways, and
//! when it ends, however it ends, the worker is lost. Whatever does not pass the wire's checks ends
//! the session with a status that names the field, and harms nobody else.

use std::pin::Pin;
use std::sync::Arc;

use equilux_common::spread::{Pieces, Tree};
use equilux_coordinator_core::event::Hello;
use equilux_proto::hello::{InvalidHello, InvalidVersions, Welcome};
use equilux_proto::limits::{
    GREETING_TIMEOUT, KEEPALIVE_INTERVAL, KEEPALIVE_TIMEOUT, SESSION_MESSAGE_BYTES_MAX,
};
use equilux_proto::pack::{self, PackRequest};
use equilux_proto::session::{FromCoordinator, FromWorker, InvalidFromWorker};
use equilux_proto::v1::coordinator_server::{self, CoordinatorServer};
use equilux_proto::v1::{self, CoordinatorToWorker, PackChunk, WorkerToCoordinator};
use futures::stream::{self, Stream};
use tokio::net::TcpListener;
use tokio::sync::{Semaphore, mpsc, watch};
use tokio_stream::wrappers::ReceiverStream;
use tonic::transport::server::TcpIncoming;
use tonic::{Request, Response, Status, Streaming};

use crate::attachments::Blob;
use crate::connection::{ConnectError, Connection};
use crate::driver::WORKERS_MAX;
use crate::handle::Handle;
use crate::session::Session;

/// Messages that wait in a session for the socket.
const SESSION_OUTGOING_MAX: usize = 16;

/// Streams of pieces at a time, each at its own pace from shared memory. Should no worker hear from
/// its peers, all of them ask here for the pieces of both trees.
const PACK_STREAMS_MAX: usize = 2 * WORKERS_MAX;

/// Calls that one worker's connection carries at a time; it needs a session and some packs.
const GRPC_STREAMS_MAX: u32 = 64;

/// Serves workers until `stopping` turns true.
///
/// # Errors
/// If the listener fails.
pub(crate) async fn serve_workers(
    handle: Handle,
    listener: TcpListener,
    stopping: watch::Receiver<bool>,
) -> Result<(), tonic::transport::Error> {
    tonic::transport::Server::builder()
        .http2_keepalive_interval(Some(KEEPALIVE_INTERVAL))
        .http2_keepalive_timeout(Some(KEEPALIVE_TIMEOUT))
        .max_concurrent_streams(GRPC_STREAMS_MAX)
        .add_service(Service::server(handle, stopping.clone()))
        .serve_with_incoming_shutdown(
            TcpIncoming::from(listener).with_nodelay(Some(true)),
            stopped(&stopping),
        )
        .await
}

/// Comes when the coordinator is told to stop.
pub(crate) fn stopped(
    stopping: &watch::Receiver<bool>,
) -> impl Future<Output = ()> + Send + 'static {
    let mut stopping = stopping.clone();
    async move {
        // An error means that nobody can say so any more, which says the same.
        let _stopped_or_gone = stopping.wait_for(|is_stopping| *is_stopping).await;
    }
}

/// The service on a coordinator.
pub(crate) struct Service {
    handle: Handle,
    /// One for each session, however far it has come.
    sessions: Arc<Semaphore>,
    pack_streams: Arc<Semaphore>,
    stopping: watch::Receiver<bool>,
}

impl Service {
    /// The service, ready to be served; sessions end when `stopping` turns true.
    pub(crate) fn server(
        handle: Handle,
        stopping: watch::Receiver<bool>,
    ) -> CoordinatorServer<Self> {
        let sessions = Arc::new(Semaphore::new(WORKERS_MAX));
        let pack_streams = Arc::new(Semaphore::new(PACK_STREAMS_MAX));
        CoordinatorServer::new(Self { handle, sessions, pack_streams, stopping })
            .max_decoding_message_size(SESSION_MESSAGE_BYTES_MAX)
            .max_encoding_message_size(SESSION_MESSAGE_BYTES_MAX)
    }
}

type Answers<T> = Pin<Box<dyn Stream<Item = Result<T, Status>> + Send>>;

#[tonic::async_trait]
impl coordinator_server::Coordinator for Service {
    type SessionStream = Answers<CoordinatorToWorker>;
    type FetchPackStream = Answers<PackChunk>;

    async fn session(
        &self,
        request: Request<Streaming<WorkerToCoordinator>>,
    ) -> Result<Response<Self::SessionStream>, Status> {
        let Ok(permit) = Arc::clone(&self.sessions).try_acquire_owned() else {
            return Err(connect_status(&ConnectError::TooMany(WORKERS_MAX)));
        };
        let mut heard = request.into_inner();
        let hello = greeting(&mut heard).await?;
        let connected = self.handle.connect(hello).await;
        let connection = connected.map_err(|error| connect_status(&error))?;
        let (answers, outgoing) = mpsc::channel(SESSION_OUTGOING_MAX);
        let welcome = welcome(&connection);
        let session = Session { connection, heard, answers, stopping: self.stopping.clone() };
        tokio::spawn(async move {
            session.run(welcome).await;
            drop(permit);
        });
        Ok(Response::new(Box::pin(ReceiverStream::new(outgoing))))
    }

    async fn fetch_pack(
        &self,
        request: Request<v1::PackRequest>,
    ) -> Result<Response<Self::FetchPackStream>, Status> {
        let PackRequest { hash, tree, skip } = PackRequest::try_from(request.into_inner())
            .map_err(|error| Status::invalid_argument(error.to_string()))?;
        let blob = self.handle.blob(&hash).ok_or_else(|| {
            Status::not_found("no job that is queued or runs has a pack of this hash")
        })?;
        let Ok(permit) = Arc::clone(&self.pack_streams).try_acquire_owned() else {
            return Err(Status::resource_exhausted("too many packs are being sent; ask again"));
        };
        let sending = (blob, skip, permit);
        let pieces = stream::try_unfold(sending, move |(blob, index, permit)| async move {
            let Some((chunk, blob)) = piece(blob, tree, index).await? else { return Ok(None) };
            Ok(Some((chunk, (blob, index + 1, permit))))
        });
        Ok(Response::new(Box::pin(pieces)))
    }
}

/// The first message, which must introduce a worker of this very version.
async fn greeting(heard: &mut Streaming<WorkerToCoordinator>) -> Result<Hello, Status> {
    let first = tokio::time::timeout(GREETING_TIMEOUT, heard.message()).await;
    let first = first.map_err(|_| Status::deadline_exceeded("no greeting came in time"))??;
    let first =
        first.ok_or_else(|| Status::invalid_argument("the session ended before it began"))?;
    match FromWorker::try_from(first) {
        Ok(FromWorker::Hello(hello)) => Ok(Hello {
            name: hello.name,
            address: hello.address.into(),
            threads: hello.threads,
            speed: hello.speed,
            memory: hello.memory,
        }),
        Ok(FromWorker::Said(_)) => {
            Err(Status::invalid_argument("hello: must be the first message of a session"))
        }
        Err(error) => Err(refusal(&error)),
    }
}

/// The status for a message that does not pass the wire's checks.
pub(crate) fn refusal(error: &InvalidFromWorker) -> Status {
    match error {
        InvalidFromWorker::Hello(InvalidHello::Version(InvalidVersions::Other(error))) => {
            Status::failed_precondition(error.to_string())
        }
        _ => Status::invalid_argument(error.to_string()),
    }
}

fn connect_status(error: &ConnectError) -> Status {
    match error {
        ConnectError::TooMany(_) | ConnectError::Refused => {
            Status::resource_exhausted(error.to_string())
        }
        ConnectError::Stopping => Status::unavailable(error.to_string()),
    }
}

fn welcome(connection: &Connection) -> CoordinatorToWorker {
    let Connection { worker, incarnation, .. } = *connection;
    FromCoordinator::Welcome(Welcome { worker, incarnation }).into()
}

/// The `index`-th piece of a tree; none beyond the last.
async fn piece(blob: Blob, tree: Tree, index: u64) -> Result<Option<(PackChunk, Blob)>, Status> {
    let Some(range) = Pieces::of(blob.len()).range(tree, index) else { return Ok(None) };
    let reading = tokio::task::spawn_blocking(move || (blob.read(&range), blob));
    let (bytes, blob) = reading.await.map_err(|error| Status::internal(error.to_string()))?;
    let bytes = bytes.map_err(|error| {
        let name = blob.name();
        Status::data_loss(format!("{name} cannot be read: {error}; see what became of the file"))
    })?;
    Ok(Some((pack::chunk(bytes), blob)))
}
