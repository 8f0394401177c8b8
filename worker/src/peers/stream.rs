//! One link: opens its stream or waits for it, reads it until it breaks, and begins anew.

use std::time::Duration;

use equilux_common::message::PeerAddress;
use equilux_proto::hello::PeerHello;
use equilux_proto::limits::{GREETING_TIMEOUT, PEER_FRAME_BYTES_MAX};
use equilux_proto::peer::PeerFrame;
use equilux_proto::v1;
use equilux_proto::v1::peer_client::PeerClient;
use prost::Message;
use tokio::sync::mpsc;
use tokio::time::{sleep, timeout};
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Status, Streaming};

use super::door::greeting;
use super::{Heard, LINK_FRAMES_MAX, News, Ways};
use crate::backoff::Backoff;
use crate::dial;
use crate::driver::Input;
use crate::log::Log;

/// How long after a break a link is opened again at first, and at most.
const AGAIN_AFTER: (Duration, Duration) = (Duration::from_millis(20), Duration::from_secs(2));

/// Both directions of a stream, greetings done.
#[derive(Debug)]
pub(super) struct Connection {
    pub(super) incoming: Streaming<v1::PeerFrame>,
    pub(super) outgoing: mpsc::Sender<v1::PeerFrame>,
}

/// How the stream comes about.
enum Role {
    /// This worker has the lower id and opens it.
    Opens,
    /// The peer opens it; here it comes in.
    Waits(mpsc::Receiver<Connection>),
}

/// Who keeps a link.
pub(super) struct Caller {
    own: PeerHello,
    peer: PeerAddress,
    role: Role,
    backoff: Backoff,
    inputs: mpsc::Sender<Input>,
    log: Log,
}

impl Caller {
    pub(super) fn new(own: PeerHello, peer: &PeerAddress, ways: &Ways) -> Self {
        let role = if own.worker < peer.worker {
            Role::Opens
        } else {
            Role::Waits(ways.door.expect(peer.worker, peer.incarnation))
        };
        let backoff = Backoff::new(AGAIN_AFTER.0, AGAIN_AFTER.1);
        let (inputs, log) = (ways.inputs.clone(), ways.log.clone());
        Self { own, peer: peer.clone(), role, backoff, inputs, log }
    }
}

/// Keeps a link until it is aborted.
pub(super) async fn keep(mut caller: Caller) {
    let mut next = caller.connect().await;
    for standing in 0.. {
        let Some(connection) = next.take() else { return };
        next = caller.read(connection, standing).await;
        caller.tell(standing, News::Lost).await;
        if next.is_none() {
            caller.pause().await;
            next = caller.connect().await;
        }
    }
}

impl Caller {
    /// The stream, however long it takes; none when it can never come.
    async fn connect(&mut self) -> Option<Connection> {
        if let Role::Waits(connections) = &mut self.role {
            return connections.recv().await;
        }
        loop {
            match timeout(GREETING_TIMEOUT, self.dial()).await {
                Ok(Ok(connection)) => return Some(connection),
                Ok(Err(status)) => self.complain("cannot be reached", status.message()),
                Err(_) => self.complain("cannot be reached", "no answer in time"),
            }
            self.pause().await;
        }
    }

    /// Leaves a peer alone for a while before its door is knocked at again.
    async fn pause(&mut self) {
        if matches!(self.role, Role::Opens) {
            sleep(self.backoff.next()).await;
        }
    }

    async fn dial(&self) -> Result<Connection, Status> {
        let channel = dial::connect(&self.peer.address).await.map_err(Status::unavailable)?;
        let mut client = PeerClient::new(channel)
            .max_decoding_message_size(PEER_FRAME_BYTES_MAX)
            .max_encoding_message_size(PEER_FRAME_BYTES_MAX);
        let (outgoing, frames) = mpsc::channel(LINK_FRAMES_MAX);
        let own = PeerFrame::Hello(self.own).into();
        outgoing.try_send(own).map_err(|_| Status::internal("a new channel has no room"))?;
        let mut incoming = client.exchange(ReceiverStream::new(frames)).await?.into_inner();
        let hello = greeting(incoming.message().await?)?;
        let PeerAddress { worker, incarnation, .. } = self.peer;
        if hello != (PeerHello { worker, incarnation }) {
            let found = format!("{}, {}, answers instead", hello.worker, hello.incarnation);
            return Err(Status::not_found(found));
        }
        Ok(Connection { incoming, outgoing })
    }

    /// Hands on what the peer says until the stream breaks. If the peer opens another one, that is
    /// what it has left this one for.
    async fn read(&mut self, connection: Connection, standing: u64) -> Option<Connection> {
        let Connection { mut incoming, outgoing } = connection;
        self.tell(standing, News::Linked(outgoing)).await;
        loop {
            let message = match &mut self.role {
                Role::Opens => incoming.message().await,
                Role::Waits(connections) => tokio::select! {
                    message = incoming.message() => message,
                    Some(newer) = connections.recv() => return Some(newer),
                },
            };
            match message {
                Ok(Some(wire)) => self.hand_on(wire, standing).await?,
                Ok(None) => return None,
                Err(status) => {
                    self.complain("is lost", status.message());
                    return None;
                }
            }
        }
    }

    /// Hands on one frame; none if it is no frame that may come here.
    async fn hand_on(&mut self, wire: v1::PeerFrame, standing: u64) -> Option<()> {
        let bytes = wire.encoded_len() as u64;
        match PeerFrame::try_from(wire) {
            Ok(PeerFrame::Said { job, message }) => {
                self.backoff.reset();
                self.tell(standing, News::Said { job, message, bytes }).await;
                return Some(());
            }
            Ok(PeerFrame::Hello(_)) => self.complain("breaks the protocol", "it greets twice"),
            Err(error) => self.complain("breaks the protocol", &error.to_string()),
        }
        None
    }

    async fn tell(&self, standing: u64, news: News) {
        let PeerAddress { worker: peer, incarnation, .. } = self.peer;
        let heard = Heard { peer, incarnation, standing, news };
        // Nobody listens once the driver has ended.
        let _late = self.inputs.send(Input::Peer(heard)).await;
    }

    fn complain(&self, what: &str, why: &str) {
        let PeerAddress { worker, address, .. } = &self.peer;
        self.log.say(format_args!("{worker} at {address} {what}: {why}"));
    }
}
