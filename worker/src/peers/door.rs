//! The door for peers: lets in those that the coordinator has named, in the life that it has named,
//! and hands their streams to the tasks that wait for them.
//!
//! A peer may hear of a job a little earlier than this worker does, so somebody unknown waits at
//! the door for a while before he is sent away.

use std::collections::BTreeMap;
use std::net::TcpListener;
use std::sync::Arc;

use equilux_common::ids::{Incarnation, WorkerId};
use equilux_proto::hello::{InvalidPeerHello, PeerHello};
use equilux_proto::limits::{
    GREETING_TIMEOUT, KEEPALIVE_INTERVAL, KEEPALIVE_TIMEOUT, PEER_FRAME_BYTES_MAX,
};
use equilux_proto::pack::PackRequest;
use equilux_proto::peer::{InvalidPeerFrame, PeerFrame};
use equilux_proto::v1;
use equilux_proto::v1::peer_server::{Peer, PeerServer};
use futures::StreamExt;
use futures::stream::BoxStream;
use tokio::sync::{Semaphore, mpsc, oneshot, watch};
use tokio::time::timeout;
use tokio_stream::wrappers::ReceiverStream;
use tonic::transport::Server;
use tonic::transport::server::TcpIncoming;
use tonic::{Request, Response, Status, Streaming};

use super::LINK_FRAMES_MAX;
use super::stream::Connection;
use crate::packs::{PackStream, Passing};

/// Most peers that wait at the door at a time.
const WAITING_MAX: usize = 4096;

/// Whom a task waits for.
#[derive(Clone, Debug)]
struct Expected {
    incarnation: Incarnation,
    place: mpsc::Sender<Connection>,
}

/// Who is let in.
#[derive(Debug)]
pub(crate) struct Door {
    expected: watch::Sender<BTreeMap<WorkerId, Expected>>,
}

impl Door {
    /// Nobody is expected yet.
    pub(crate) fn new() -> Self {
        Self { expected: watch::Sender::new(BTreeMap::new()) }
    }

    /// Lets a peer in from now on; its streams come out of the channel.
    pub(super) fn expect(
        &self,
        peer: WorkerId,
        incarnation: Incarnation,
    ) -> mpsc::Receiver<Connection> {
        let (place, connections) = mpsc::channel(1);
        let expected = Expected { incarnation, place };
        self.expected.send_modify(|all| drop(all.insert(peer, expected)));
        connections
    }

    /// Lets a peer in no longer.
    pub(super) fn dismiss(&self, peer: WorkerId) {
        self.expected.send_modify(|all| drop(all.remove(&peer)));
    }
}

/// The server behind a door. It ends when this is dropped.
#[derive(Debug)]
pub(crate) struct Entrance {
    _open: oneshot::Sender<()>,
}

impl Entrance {
    /// Lets peers in through `listener`, and anybody who asks for packs.
    ///
    /// # Errors
    /// If the system refuses the socket.
    pub(crate) fn open(
        listener: TcpListener,
        own: PeerHello,
        door: &Door,
        packs: Passing,
    ) -> std::io::Result<Self> {
        listener.set_nonblocking(true)?;
        let listener = tokio::net::TcpListener::from_std(listener)?;
        let incoming = TcpIncoming::from(listener).with_nodelay(Some(true));
        let service = Service {
            own,
            expected: door.expected.subscribe(),
            waiting: Arc::new(Semaphore::new(WAITING_MAX)),
            packs,
        };
        let service = PeerServer::new(service)
            .max_decoding_message_size(PEER_FRAME_BYTES_MAX)
            .max_encoding_message_size(PEER_FRAME_BYTES_MAX);
        let (open, closed) = oneshot::channel::<()>();
        let serving = Server::builder()
            .http2_keepalive_interval(Some(KEEPALIVE_INTERVAL))
            .http2_keepalive_timeout(Some(KEEPALIVE_TIMEOUT))
            .add_service(service)
            .serve_with_incoming_shutdown(incoming, async move {
                // It is dropped, never sent to.
                let _dropped = closed.await;
            });
        tokio::spawn(serving);
        Ok(Self { _open: open })
    }
}

struct Service {
    own: PeerHello,
    expected: watch::Receiver<BTreeMap<WorkerId, Expected>>,
    waiting: Arc<Semaphore>,
    packs: Passing,
}

#[tonic::async_trait]
impl Peer for Service {
    type ExchangeStream = BoxStream<'static, Result<v1::PeerFrame, Status>>;
    type PassPackStream = PackStream;

    async fn exchange(
        &self,
        request: Request<Streaming<v1::PeerFrame>>,
    ) -> Result<Response<Self::ExchangeStream>, Status> {
        let _place = self
            .waiting
            .try_acquire()
            .map_err(|_| Status::resource_exhausted("too many peers wait at this door"))?;
        let mut incoming = request.into_inner();
        let first = timeout(GREETING_TIMEOUT, incoming.message()).await;
        let first = first.map_err(|_| Status::deadline_exceeded("no greeting came"))??;
        let hello = greeting(first)?;
        if hello.worker >= self.own.worker {
            return Err(Status::invalid_argument(format!(
                "hello.worker: {} opens no link to {}; the lower one does",
                hello.worker, self.own.worker
            )));
        }
        let place = self.await_place(hello).await?;
        let (outgoing, frames) = mpsc::channel(LINK_FRAMES_MAX);
        let own = PeerFrame::Hello(self.own).into();
        outgoing.try_send(own).map_err(|_| Status::internal("a new channel has no room"))?;
        let gone = |_| Status::unavailable("this worker is about to leave");
        place.send(Connection { incoming, outgoing }).await.map_err(gone)?;
        Ok(Response::new(ReceiverStream::new(frames).map(Ok).boxed()))
    }

    async fn pass_pack(
        &self,
        request: Request<v1::PackRequest>,
    ) -> Result<Response<PackStream>, Status> {
        let request = PackRequest::try_from(request.into_inner())
            .map_err(|error| Status::invalid_argument(error.to_string()))?;
        Ok(Response::new(self.packs.pass(request).await?))
    }
}

impl Service {
    /// The place of a peer that is expected, or will be soon.
    async fn await_place(&self, hello: PeerHello) -> Result<mpsc::Sender<Connection>, Status> {
        let mut expected = self.expected.clone();
        let is_expected = |all: &BTreeMap<WorkerId, Expected>| {
            all.get(&hello.worker).is_some_and(|peer| peer.incarnation == hello.incarnation)
        };
        let unknown = || {
            let PeerHello { worker, incarnation } = hello;
            Status::not_found(format!("{worker}, {incarnation}, is no neighbor of this worker"))
        };
        let found = timeout(GREETING_TIMEOUT, expected.wait_for(is_expected)).await;
        let found = found.map_err(|_| unknown())?.map_err(|_| unknown())?;
        found.get(&hello.worker).map(|peer| peer.place.clone()).ok_or_else(unknown)
    }
}

/// The greeting in the first frame of a stream.
pub(super) fn greeting(first: Option<v1::PeerFrame>) -> Result<PeerHello, Status> {
    let first = first.ok_or_else(|| Status::invalid_argument("frame: no greeting came"))?;
    match PeerFrame::try_from(first) {
        Ok(PeerFrame::Hello(hello)) => Ok(hello),
        Ok(PeerFrame::Said { .. }) => Err(Status::invalid_argument("hello: must come first")),
        Err(InvalidPeerFrame::Hello(error @ InvalidPeerHello::Version(_))) => {
            Err(Status::failed_precondition(error.to_string()))
        }
        Err(error) => Err(Status::invalid_argument(error.to_string())),
    }
}
