//! The pieces of one tree, fetched from a parent, and what it does not give from the coordinator.

use std::time::Duration;

use equilux_common::message::PeerAddress;
use equilux_common::spread::Tree;
use equilux_proto::limits::{PEER_FRAME_BYTES_MAX, SESSION_MESSAGE_BYTES_MAX};
use equilux_proto::pack;
use equilux_proto::v1::coordinator_client::CoordinatorClient;
use equilux_proto::v1::peer_client::PeerClient;
use equilux_proto::v1::{self, PackChunk};
use tokio::time::{sleep, timeout};
use tonic::transport::Channel;
use tonic::{Code, Response, Status, Streaming};

use super::PackError;
use super::arriving::Arriving;
use crate::backoff::Backoff;
use crate::dial;
use crate::log::Log;

/// How long a parent may say nothing at all before it is taken for dead. One that has nothing to
/// pass on yet says so ten times as often, so that a silent worker far up a tree drives its
/// children to the coordinator, and not all that are below them.
pub(super) const PARENT_SILENCE_MAX: Duration = Duration::from_secs(10);

/// Most empty chunks one after another, of which a parent sends one a second while it has nothing
/// itself: then it waits for somebody who will not come.
const EMPTY_CHUNKS_MAX: u32 = 120;

/// How long after a coordinator that is busy is asked again at first, and at most.
const AGAIN_AFTER: (Duration, Duration) = (Duration::from_millis(100), Duration::from_secs(2));

/// How often a busy coordinator is asked.
const TRIES_MAX: usize = 30;

/// What is needed to fetch.
#[derive(Clone, Copy)]
pub(super) struct Fetching<'a> {
    /// Where the pieces go.
    pub(super) arriving: &'a Arriving,
    pub(super) client: &'a CoordinatorClient<Channel>,
    /// How long a parent may say nothing.
    pub(super) patience: Duration,
    pub(super) log: &'a Log,
}

/// Why pieces come no more.
enum Failure {
    /// The call has ended.
    Status(Status),
    /// A piece, or their number, is wrong.
    Other,
}

impl From<Status> for Failure {
    fn from(status: Status) -> Self {
        Self::Status(status)
    }
}

impl Fetching<'_> {
    /// Fetches all pieces of a tree.
    pub(super) async fn fetch(
        self,
        tree: Tree,
        parent: Option<&PeerAddress>,
    ) -> Result<(), PackError> {
        if let Some(parent) = parent {
            match self.fetch_from_peer(tree, parent).await {
                Ok(()) => return Ok(()),
                Err(failure) => self.complain(parent, &failure),
            }
        }
        self.fetch_from_coordinator(tree).await.map_err(|failure| match failure {
            Failure::Status(status) if status.code() == Code::NotFound => {
                PackError::Refused("it does not have it any more".into())
            }
            Failure::Status(status) => PackError::Refused(status.message().to_owned()),
            Failure::Other => PackError::Other(self.arriving.pack_bytes()),
        })
    }

    async fn fetch_from_peer(self, tree: Tree, parent: &PeerAddress) -> Result<(), Failure> {
        let silent = |_| Status::deadline_exceeded("it is silent");
        let opening = timeout(self.patience, self.open(tree, parent));
        let mut chunks = opening.await.map_err(silent)??;
        let mut empty_count = 0;
        while let Some(chunk) = timeout(self.patience, chunks.message()).await.map_err(silent)?? {
            empty_count = if chunk.data.is_empty() { empty_count + 1 } else { 0 };
            if empty_count > EMPTY_CHUNKS_MAX {
                return Err(Status::deadline_exceeded("it has had nothing for long").into());
            }
            self.take(tree, chunk)?;
        }
        self.finish(tree)
    }

    async fn open(self, tree: Tree, parent: &PeerAddress) -> Result<Streaming<PackChunk>, Status> {
        let channel = dial::connect(&parent.address).await.map_err(Status::unavailable)?;
        let mut client = PeerClient::new(channel).max_decoding_message_size(PEER_FRAME_BYTES_MAX);
        client.pass_pack(self.request(tree)).await.map(Response::into_inner)
    }

    async fn fetch_from_coordinator(self, tree: Tree) -> Result<(), Failure> {
        let mut chunks = self.ask(tree).await?;
        while let Some(chunk) = chunks.message().await? {
            self.take(tree, chunk)?;
        }
        self.finish(tree)
    }

    /// Asks the coordinator for what is missing; again, if it is busy with others.
    async fn ask(self, tree: Tree) -> Result<Streaming<PackChunk>, Status> {
        let mut client = self
            .client
            .clone()
            .max_decoding_message_size(SESSION_MESSAGE_BYTES_MAX)
            .max_encoding_message_size(SESSION_MESSAGE_BYTES_MAX);
        let mut backoff = Backoff::new(AGAIN_AFTER.0, AGAIN_AFTER.1);
        for _ in 1..TRIES_MAX {
            match client.fetch_pack(self.request(tree)).await {
                Err(status) if status.code() == Code::ResourceExhausted => {
                    sleep(backoff.next()).await;
                }
                answer => return answer.map(Response::into_inner),
            }
        }
        client.fetch_pack(self.request(tree)).await.map(Response::into_inner)
    }

    /// For what is missing.
    fn request(self, tree: Tree) -> v1::PackRequest {
        self.arriving.request(tree).into()
    }

    fn take(self, tree: Tree, chunk: PackChunk) -> Result<(), Failure> {
        match pack::piece(chunk) {
            Ok(Some(piece)) => self.arriving.add(tree, &piece).map_err(|_| Failure::Other),
            Ok(None) => Ok(()),
            Err(_) => Err(Failure::Other),
        }
    }

    /// The stream has ended; it must have brought everything.
    fn finish(self, tree: Tree) -> Result<(), Failure> {
        if self.arriving.has_all(tree) { Ok(()) } else { Err(Failure::Other) }
    }

    fn complain(self, parent: &PeerAddress, failure: &Failure) {
        let PeerAddress { worker, address, .. } = parent;
        let why = match failure {
            Failure::Status(status) => status.message(),
            Failure::Other => "it gives something else",
        };
        self.log.say(format_args!(
            "{worker} at {address} does not pass the scene on: {why}; the coordinator is asked"
        ));
    }
}
