//! A pack on its way in: what has come so far, to be added to and to be passed on.

use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use equilux_common::job::SceneRef;
use equilux_common::spread::{Pieces, Tree};
use equilux_proto::pack::PackRequest;
use tokio::sync::watch;

use super::PackError;

/// A pack, of each tree the first so many pieces.
#[derive(Debug)]
pub(super) struct Arriving {
    hash: [u8; 32],
    pieces: Pieces,
    /// All there is room for, with holes as long as it is not whole. Shared, and not to be changed
    /// any more, once it is.
    bytes: Mutex<Arc<Vec<u8>>>,
    progress: watch::Sender<Progress>,
}

/// How far an arrival has come.
#[derive(Clone, Copy, Debug, Default)]
struct Progress {
    /// Pieces of each tree that are here.
    arrived: [u64; 2],
    /// Whether no more will come.
    has_ended: bool,
}

/// What becomes of a request for a piece.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Found {
    /// Here it is.
    Piece(Vec<u8>),
    /// There are no more in this tree.
    Beyond,
    /// It will not come here.
    Ended,
}

/// A piece of another length than it must have, or one too many.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct InvalidPiece;

impl Arriving {
    /// Nothing has come yet. Room for all is set aside, which takes memory only as it is filled.
    pub(super) fn new(scene: &SceneRef) -> Result<Self, PackError> {
        let too_large = || PackError::Memory(scene.pack_bytes);
        let room = usize::try_from(scene.pack_bytes).map_err(|_| too_large())?;
        let mut bytes = Vec::new();
        bytes.try_reserve_exact(room).map_err(|_| too_large())?;
        Ok(Self {
            hash: scene.hash,
            pieces: Pieces::of(scene.pack_bytes),
            bytes: Mutex::new(Arc::new(bytes)),
            progress: watch::Sender::default(),
        })
    }

    /// Asks for what is missing of a tree.
    pub(super) fn request(&self, tree: Tree) -> PackRequest {
        let skip = self.progress.borrow().arrived[tree.index()];
        PackRequest { hash: self.hash, tree, skip }
    }

    /// Whether nothing is missing of a tree.
    pub(super) fn has_all(&self, tree: Tree) -> bool {
        self.request(tree).skip == self.pieces.count(tree)
    }

    /// The next piece of a tree has come.
    pub(super) fn add(&self, tree: Tree, piece: &[u8]) -> Result<(), InvalidPiece> {
        let range = self.range(tree, self.request(tree).skip).ok_or(InvalidPiece)?;
        if range.len() != piece.len() {
            return Err(InvalidPiece);
        }
        {
            let mut bytes = self.lock();
            let bytes = Arc::get_mut(&mut bytes).ok_or(InvalidPiece)?;
            bytes.resize(bytes.len().max(range.end), 0);
            bytes[range].copy_from_slice(piece);
        }
        self.progress.send_modify(|progress| progress.arrived[tree.index()] += 1);
        Ok(())
    }

    /// All that has come.
    pub(super) fn bytes(&self) -> Arc<Vec<u8>> {
        Arc::clone(&self.lock())
    }

    /// No more will come, and what is here is let go.
    pub(super) fn end(&self) {
        // First of all, so that nobody who hears of the end takes a hole for a piece.
        *self.lock() = Arc::default();
        self.progress.send_modify(|progress| progress.has_ended = true);
    }

    /// How many bytes the pack has.
    pub(super) const fn pack_bytes(&self) -> u64 {
        self.pieces.pack_bytes()
    }

    /// A piece of a tree, as soon as it is here.
    pub(super) async fn piece(&self, tree: Tree, index: u64) -> Found {
        let Some(range) = self.range(tree, index) else { return Found::Beyond };
        let mut progress = self.progress.subscribe();
        let is_here =
            |progress: &Progress| progress.has_ended || progress.arrived[tree.index()] > index;
        // The channel lives as long as this.
        drop(progress.wait_for(is_here).await);
        match self.lock().get(range) {
            Some(piece) => Found::Piece(piece.to_vec()),
            None => Found::Ended,
        }
    }

    fn range(&self, tree: Tree, index: u64) -> Option<Range<usize>> {
        let range = self.pieces.range(tree, index)?;
        Some(usize::try_from(range.start).ok()?..usize::try_from(range.end).ok()?)
    }

    fn lock(&self) -> MutexGuard<'_, Arc<Vec<u8>>> {
        self.bytes.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
