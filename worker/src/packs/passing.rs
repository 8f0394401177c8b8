//! Packs on their way out, to peers that ask for them: from the cache, or as they arrive.
//!
//! A peer may ask a little earlier than this worker hears of the job, so it is made to wait.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use equilux_common::spread::{Pieces, Tree};
use equilux_proto::pack::{self, PackRequest};
use equilux_proto::v1;
use futures::StreamExt;
use futures::stream::{self, BoxStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};
use tokio::task::spawn_blocking;
use tokio::time::timeout;
use tonic::Status;

use super::arriving::{Arriving, Found};
use super::fetching::PARENT_SILENCE_MAX;
use crate::pack_cache::{PackCache, PackFile};

/// Most streams at a time. A tree gives a worker two children; others may have joined meanwhile.
/// Who is turned away asks the coordinator.
const STREAMS_MAX: usize = 32;

/// How long a peer waits for a pack that nobody has told this worker of. Shorter than a peer's
/// patience.
const UNKNOWN_WAIT_MAX: Duration = Duration::from_secs(5);

/// How often a peer hears that there is nothing new.
const NONE_YET_INTERVAL: Duration = Duration::from_secs(1);

const _: () = assert!(2 * UNKNOWN_WAIT_MAX.as_secs() <= PARENT_SILENCE_MAX.as_secs());
const _: () = assert!(10 * NONE_YET_INTERVAL.as_secs() <= PARENT_SILENCE_MAX.as_secs());

/// What a peer is sent.
pub(crate) type PackStream = BoxStream<'static, Result<v1::PackChunk, Status>>;

/// Passes packs on.
#[derive(Clone, Debug)]
pub(crate) struct Passing {
    cache: PackCache,
    arriving: watch::Receiver<BTreeMap<[u8; 32], Arc<Arriving>>>,
    streams: Arc<Semaphore>,
}

/// Where pieces come from.
#[derive(Clone, Debug)]
enum Source {
    Arriving(Arc<Arriving>),
    Cached(Arc<PackFile>),
}

/// A peer's way through a tree's pieces.
struct Passage {
    /// For the next piece.
    request: PackRequest,
    source: Source,
    cache: PackCache,
    _place: OwnedSemaphorePermit,
}

impl Passing {
    /// Passes on what is in the cache or arrives.
    pub(super) fn new(
        cache: PackCache,
        arriving: watch::Receiver<BTreeMap<[u8; 32], Arc<Arriving>>>,
    ) -> Self {
        Self { cache, arriving, streams: Arc::new(Semaphore::new(STREAMS_MAX)) }
    }

    /// The pieces that a peer asks for, as soon as this worker knows their pack.
    pub(crate) async fn pass(&self, request: PackRequest) -> Result<PackStream, Status> {
        let Ok(place) = Arc::clone(&self.streams).try_acquire_owned() else {
            return Err(Status::resource_exhausted("it has no room for another child"));
        };
        let source = self.source(request.hash).await;
        let source = source.ok_or_else(|| Status::not_found("it does not have the scene"))?;
        let passage = Passage { request, source, cache: self.cache.clone(), _place: place };
        Ok(stream::unfold(Some(passage), |passage| async { passage?.next().await }).boxed())
    }

    async fn source(&self, hash: [u8; 32]) -> Option<Source> {
        let arriving = self.arriving.borrow().get(&hash).cloned();
        if let Some(arriving) = arriving {
            return Some(Source::Arriving(arriving));
        }
        if let Some(file) = open(&self.cache, hash).await {
            return Some(file);
        }
        let mut arriving = self.arriving.clone();
        let waiting = timeout(UNKNOWN_WAIT_MAX, arriving.wait_for(|all| all.contains_key(&hash)));
        waiting.await.ok()?.ok()?.get(&hash).cloned().map(Source::Arriving)
    }
}

impl Passage {
    /// What the peer is sent next, and how it goes on; none at the end.
    async fn next(mut self) -> Option<(Result<v1::PackChunk, Status>, Option<Self>)> {
        match timeout(NONE_YET_INTERVAL, self.piece()).await {
            Err(_) => Some((Ok(pack::none_yet()), Some(self))),
            Ok(Found::Piece(piece)) => {
                self.request.skip += 1;
                Some((Ok(pack::chunk(piece)), Some(self)))
            }
            Ok(Found::Beyond) => None,
            Ok(Found::Ended) => Some((Err(Status::unavailable("it has lost the scene")), None)),
        }
    }

    async fn piece(&mut self) -> Found {
        let PackRequest { hash, tree, skip: index } = self.request;
        if let Source::Arriving(arriving) = &self.source {
            match arriving.piece(tree, index).await {
                Found::Ended => match open(&self.cache, hash).await {
                    Some(cached) => self.source = cached,
                    None => return Found::Ended,
                },
                found => return found,
            }
        }
        let Source::Cached(file) = &self.source else { return Found::Ended };
        let file = Arc::clone(file);
        spawn_blocking(move || read(&file, tree, index)).await.unwrap_or(Found::Ended)
    }
}

/// A pack in the cache.
async fn open(cache: &PackCache, hash: [u8; 32]) -> Option<Source> {
    let cache = cache.clone();
    let file = spawn_blocking(move || cache.open_pack(hash)).await.ok()??;
    Some(Source::Cached(Arc::new(file)))
}

fn read(file: &PackFile, tree: Tree, index: u64) -> Found {
    match Pieces::of(file.byte_count()).range(tree, index).map(|range| file.read_range(range)) {
        None => Found::Beyond,
        Some(Ok(piece)) => Found::Piece(piece),
        Some(Err(_)) => Found::Ended,
    }
}
