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
pub(super) const EMPTY_CHUNKS_MAX: u32 = 120;

/// How long the coordinator may send nothing. It has every piece in memory; but should all of its
/// 4,096 workers ask it at once for both trees, a piece for each is 2 GiB, which take a link of
/// 150 Mbit/s this long.
const COORDINATOR_SILENCE_MAX: Duration = Duration::from_secs(120);

/// How long after a coordinator that is busy is asked again at first, and at most.
const AGAIN_AFTER: (Duration, Duration) = (Duration::from_millis(100), Duration::from_secs(2));

/// How often a busy coordinator is asked.
const TRIES_MAX: usize = 30;

/// What is borne of somebody before he is given up.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patience {
    /// How long he may say nothing at all.
    pub(super) silence: Duration,
    /// How often in a row he may say that he has nothing.
    pub(super) empty_chunks: u32,
}

/// With a parent, which may wait itself.
pub(super) const PARENT_PATIENCE: Patience =
    Patience { silence: PARENT_SILENCE_MAX, empty_chunks: EMPTY_CHUNKS_MAX };

/// With the coordinator, which has everything.
pub(super) const COORDINATOR_PATIENCE: Patience =
    Patience { silence: COORDINATOR_SILENCE_MAX, empty_chunks: 0 };

/// What is needed to fetch.
#[derive(Clone, Copy)]
pub(super) struct Fetching<'a> {
    /// Where the pieces go.
    pub(super) arriving: &'a Arriving,
    pub(super) client: &'a CoordinatorClient<Channel>,
    /// With a parent.
    pub(super) with_parent: Patience,
    /// With the coordinator.
    pub(super) with_coordinator: Patience,
    pub(super) log: &'a Log,
}

/// Why pieces come no more.
enum Failure {
    /// The call has ended.
    Status(Status),
    /// Nothing was said for so long.
    Silence(Duration),
    /// It was said too often that there is nothing.
    Emptiness,
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
            Failure::Silence(silence) => PackError::Silent(silence.as_secs()),
            Failure::Emptiness | Failure::Other => PackError::Other(self.arriving.pack_bytes()),
        })
    }

    async fn fetch_from_peer(self, tree: Tree, parent: &PeerAddress) -> Result<(), Failure> {
        let patience = self.with_parent;
        let chunks = patience.hear(self.open(tree, parent)).await?;
        self.receive(tree, chunks, patience).await
    }

    async fn open(self, tree: Tree, parent: &PeerAddress) -> Result<Streaming<PackChunk>, Status> {
        let channel = dial::connect(&parent.address).await.map_err(Status::unavailable)?;
        let mut client = PeerClient::new(channel).max_decoding_message_size(PEER_FRAME_BYTES_MAX);
        client.pass_pack(self.request(tree)).await.map(Response::into_inner)
    }

    async fn fetch_from_coordinator(self, tree: Tree) -> Result<(), Failure> {
        let chunks = self.ask(tree).await?;
        self.receive(tree, chunks, self.with_coordinator).await
    }

    /// Asks the coordinator for what is missing; again, if it is busy with others.
    async fn ask(self, tree: Tree) -> Result<Streaming<PackChunk>, Failure> {
        let mut client = self
            .client
            .clone()
            .max_decoding_message_size(SESSION_MESSAGE_BYTES_MAX)
            .max_encoding_message_size(SESSION_MESSAGE_BYTES_MAX);
        let mut backoff = Backoff::new(AGAIN_AFTER.0, AGAIN_AFTER.1);
        let mut tries = 0;
        loop {
            tries += 1;
            match self.with_coordinator.hear(client.fetch_pack(self.request(tree))).await {
                Err(Failure::Status(status))
                    if status.code() == Code::ResourceExhausted && tries < TRIES_MAX =>
                {
                    sleep(backoff.next()).await;
                }
                answer => return answer.map(Response::into_inner),
            }
        }
    }

    /// Takes what a stream brings until it ends; it must have brought everything by then.
    async fn receive(
        self,
        tree: Tree,
        mut chunks: Streaming<PackChunk>,
        patience: Patience,
    ) -> Result<(), Failure> {
        let mut empty_count = 0;
        while let Some(chunk) = patience.hear(chunks.message()).await? {
            match pack::piece(chunk).map_err(|_| Failure::Other)? {
                Some(piece) => {
                    self.arriving.add(tree, &piece).map_err(|_| Failure::Other)?;
                    empty_count = 0;
                }
                None if empty_count == patience.empty_chunks => return Err(Failure::Emptiness),
                None => empty_count += 1,
            }
        }
        if self.arriving.has_all(tree) { Ok(()) } else { Err(Failure::Other) }
    }

    /// For what is missing.
    fn request(self, tree: Tree) -> v1::PackRequest {
        self.arriving.request(tree).into()
    }

    fn complain(self, parent: &PeerAddress, failure: &Failure) {
        let PeerAddress { worker, address, .. } = parent;
        let why = match failure {
            Failure::Status(status) => status.message(),
            Failure::Silence(_) => "it is silent",
            Failure::Emptiness => "it has had nothing for long",
            Failure::Other => "it gives something else",
        };
        self.log.say(format_args!(
            "{worker} at {address} does not pass the scene on: {why}; the coordinator is asked"
        ));
    }
}

impl Patience {
    /// What somebody says, unless he is silent for too long.
    async fn hear<T>(self, saying: impl Future<Output = Result<T, Status>>) -> Result<T, Failure> {
        match timeout(self.silence, saying).await {
            Ok(said) => Ok(said?),
            Err(_) => Err(Failure::Silence(self.silence)),
        }
    }
}
