//! The scenes' packs as they come to this worker and go on to others.
//!
//! ```text
//!   parents, or the coordinator ──fetching──▶ Arriving ──passing──▶ children
//!                                                │ whole, and of the right hash
//!                                                ▼
//!                                            PackCache ──passing──▶ children
//! ```
//!
//! A pack comes in two halves at once, the pieces of each tree in order. What has come is passed on
//! at once, to whoever asks. A parent that is dead, silent or wrong costs time and nothing else:
//! the coordinator has everything. Nothing is believed until the hash of the whole is right.

mod arriving;
mod fetching;
mod passing;

use std::collections::BTreeMap;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use equilux_common::job::SceneRef;
use equilux_common::spread::{PackSources, Tree};
use equilux_proto::v1::coordinator_client::CoordinatorClient;
use futures::future::try_join_all;
use tokio::sync::watch;
use tokio::task::spawn_blocking;
use tonic::transport::Channel;

pub(crate) use passing::{PackStream, Passing};

use crate::log::Log;
use crate::pack_cache::{PackCache, PackFile};
use arriving::Arriving;
use fetching::{COORDINATOR_PATIENCE, Fetching, PARENT_PATIENCE, Patience};

/// A pack that cannot be had.
#[derive(Clone, Debug, thiserror::Error)]
pub(crate) enum PackError {
    /// The coordinator has none, or does not give it.
    #[error("the coordinator does not hand out the scene: {0}; submit the job again")]
    Refused(String),
    /// It gave another one.
    #[error(
        "the coordinator handed out something else than the scene of {0} bytes that it named; \
         submit the job again"
    )]
    Other(u64),
    /// It is there, and gives nothing.
    #[error(
        "the coordinator has sent nothing of the scene for {0} s; see what holds it or the network \
         up, and submit the job again"
    )]
    Silent(u64),
    /// It is too large for this machine.
    #[error("the scene's {0} bytes do not fit the memory; use a machine with more")]
    Memory(u64),
}

/// The packs of one life of a worker. Clones share them.
#[derive(Clone, Debug)]
pub(crate) struct Packs {
    cache: PackCache,
    /// Whether the last pack could not be cached.
    is_cache_failing: Arc<AtomicBool>,
    client: CoordinatorClient<Channel>,
    log: Log,
    with_parent: Patience,
    with_coordinator: Patience,
    /// By hash, what is being fetched.
    arriving: Arc<watch::Sender<BTreeMap<[u8; 32], Arc<Arriving>>>>,
}

/// A place among those that arrive, which is free again when this is dropped.
struct Place<'a> {
    packs: &'a Packs,
    hash: [u8; 32],
    arriving: Arc<Arriving>,
}

impl Drop for Place<'_> {
    fn drop(&mut self) {
        self.packs.arriving.send_modify(|all| drop(all.remove(&self.hash)));
        self.arriving.end();
    }
}

impl Packs {
    /// Packs that are in the cache, or come from peers and the coordinator.
    pub(crate) fn new(cache: PackCache, client: CoordinatorClient<Channel>, log: Log) -> Self {
        let arriving = Arc::new(watch::Sender::default());
        let (with_parent, with_coordinator) = (PARENT_PATIENCE, COORDINATOR_PATIENCE);
        let is_cache_failing = Arc::default();
        Self { cache, is_cache_failing, client, log, with_parent, with_coordinator, arriving }
    }

    /// What passes packs on to peers.
    pub(crate) fn passing(&self) -> Passing {
        Passing::new(self.cache.clone(), self.arriving.subscribe())
    }

    /// The file of a pack in the cache, if it is there in full length. It may be damaged.
    pub(crate) fn cached(&self, scene: &SceneRef) -> Option<PackFile> {
        self.cache.open_pack(scene.hash).filter(|file| file.byte_count() == scene.pack_bytes)
    }

    /// The bytes of a scene's pack: from the cache, or from those who pass it on.
    pub(crate) async fn pack(
        &self,
        scene: &SceneRef,
        from: &PackSources,
    ) -> Result<Arc<Vec<u8>>, PackError> {
        loop {
            if let Some(place) = self.place(scene)? {
                // Only now, so that nobody can have cached it since.
                let (cache, hash, pack_bytes) = (self.cache.clone(), scene.hash, scene.pack_bytes);
                let finding = spawn_blocking(move || cache.find(hash, pack_bytes));
                if let Ok(Some(bytes)) = finding.await {
                    return Ok(Arc::new(bytes));
                }
                return self.fetch(scene, from, place).await;
            }
            // Another job is fetching it.
            let is_free = |all: &BTreeMap<_, _>| !all.contains_key(&scene.hash);
            // The channel lives as long as this.
            drop(self.arriving.subscribe().wait_for(is_free).await);
        }
    }

    /// Begins an arrival, unless that pack arrives already.
    fn place(&self, scene: &SceneRef) -> Result<Option<Place<'_>>, PackError> {
        let arriving = Arc::new(Arriving::new(scene)?);
        let is_new = self.arriving.send_if_modified(|all| {
            let is_new = !all.contains_key(&scene.hash);
            if is_new {
                all.insert(scene.hash, Arc::clone(&arriving));
            }
            is_new
        });
        // Made only then, for the place of another is freed by dropping it too.
        Ok(is_new.then(|| Place { packs: self, hash: scene.hash, arriving }))
    }

    /// Fetches a pack and makes sure that it is the one: if it is not, all of it comes from the
    /// coordinator.
    async fn fetch(
        &self,
        scene: &SceneRef,
        from: &PackSources,
        place: Place<'_>,
    ) -> Result<Arc<Vec<u8>>, PackError> {
        if let Some(bytes) = self.arrive(scene, from, &place.arriving).await? {
            return Ok(bytes);
        }
        drop(place);
        let is_from_peers = from.iter().any(Option::is_some);
        if !is_from_peers {
            return Err(PackError::Other(scene.pack_bytes));
        }
        self.log.say("peers have passed on something else than the scene; it is fetched again");
        let arriving = Arriving::new(scene)?;
        let bytes = self.arrive(scene, &[None, None], &arriving).await?;
        bytes.ok_or(PackError::Other(scene.pack_bytes))
    }

    /// Fetches a pack from those sources and caches it; none if it is another one.
    async fn arrive(
        &self,
        scene: &SceneRef,
        from: &PackSources,
        arriving: &Arriving,
    ) -> Result<Option<Arc<Vec<u8>>>, PackError> {
        let (with_parent, with_coordinator) = (self.with_parent, self.with_coordinator);
        let Self { client, log, .. } = self;
        let fetching = Fetching { arriving, client, with_parent, with_coordinator, log };
        let trees = Tree::ALL.map(|tree| fetching.fetch(tree, from[tree.index()].as_ref()));
        try_join_all(trees).await?;
        let (cache, hash) = (self.cache.clone(), scene.hash);
        let bytes = arriving.bytes();
        let (bytes, is_the_one, kept) = spawn_blocking(move || {
            let is_the_one = *blake3::hash(&bytes).as_bytes() == hash;
            let kept = if is_the_one { cache.keep(hash, &bytes) } else { Ok(()) };
            (bytes, is_the_one, kept)
        })
        .await
        .map_err(|error| PackError::Refused(error.to_string()))?;
        self.tell_if_not_kept(kept);
        Ok(is_the_one.then_some(bytes))
    }

    /// Says once that nothing can be cached, until something can.
    fn tell_if_not_kept(&self, kept: io::Result<()>) {
        let was_told = self.is_cache_failing.swap(kept.is_err(), Ordering::Relaxed);
        if let (Err(error), false) = (kept, was_told) {
            self.log.warn(format_args!(
                "cannot write to the cache {}: {error}; what is needed again is fetched again. \
                 Make room there, or name another directory with --cache (`equilux render`: with \
                 --spool)",
                self.cache.directory().display()
            ));
        }
    }
}

#[cfg(test)]
mod tests;
