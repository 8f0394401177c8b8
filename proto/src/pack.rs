//! A scene's pack on its way, in pieces: from the coordinator to a worker, and on to other workers.

use equilux_common::spread::{PIECE_BYTES_MAX, Tree};

use crate::v1;

/// Asks for some pieces of a pack.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PackRequest {
    /// BLAKE3 hash of the pack.
    pub hash: [u8; 32],
    /// Those that go down this tree.
    pub tree: Tree,
    /// But for so many of the first.
    pub skip: u64,
}

/// A request for no pack.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidPackRequest {
    /// No hash.
    #[error("hash: has {0} bytes instead of 32")]
    Hash(usize),
    /// No tree.
    #[error("tree: {0} names no tree")]
    Tree(i32),
}

/// A piece of no pack.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("data: has {0} bytes; at most {PIECE_BYTES_MAX} are allowed")]
pub struct InvalidPackChunk(pub usize);

impl From<PackRequest> for v1::PackRequest {
    fn from(request: PackRequest) -> Self {
        let tree = match request.tree {
            Tree::Even => v1::Tree::Even,
            Tree::Odd => v1::Tree::Odd,
        };
        Self { hash: request.hash.to_vec(), tree: tree.into(), skip: request.skip }
    }
}

impl TryFrom<v1::PackRequest> for PackRequest {
    type Error = InvalidPackRequest;

    fn try_from(wire: v1::PackRequest) -> Result<Self, InvalidPackRequest> {
        let tree = match v1::Tree::try_from(wire.tree) {
            Ok(v1::Tree::Even) => Tree::Even,
            Ok(v1::Tree::Odd) => Tree::Odd,
            Ok(v1::Tree::Unspecified) | Err(_) => return Err(InvalidPackRequest::Tree(wire.tree)),
        };
        let hash = wire.hash.try_into();
        let hash = hash.map_err(|hash: Vec<u8>| InvalidPackRequest::Hash(hash.len()))?;
        Ok(Self { hash, tree, skip: wire.skip })
    }
}

/// The wire's form of a piece.
#[must_use]
pub const fn chunk(piece: Vec<u8>) -> v1::PackChunk {
    v1::PackChunk { data: piece }
}

/// Says that there is no piece yet, and that somebody is there.
#[must_use]
pub const fn none_yet() -> v1::PackChunk {
    chunk(Vec::new())
}

/// A piece; none if there is none yet.
///
/// # Errors
/// If it is too large.
pub fn piece(wire: v1::PackChunk) -> Result<Option<Vec<u8>>, InvalidPackChunk> {
    match wire.data.len() {
        0 => Ok(None),
        bytes if bytes as u64 <= PIECE_BYTES_MAX => Ok(Some(wire.data)),
        bytes => Err(InvalidPackChunk(bytes)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use prost::Message;

    proptest! {
        #[test]
        fn requests_round_trip_through_their_bytes(
            hash in any::<[u8; 32]>(), tree in prop::sample::select(&Tree::ALL), skip in any::<u64>(),
        ) {
            let request = PackRequest { hash, tree, skip };
            let bytes = v1::PackRequest::from(request).encode_to_vec();
            let wire = v1::PackRequest::decode(&bytes[..]).expect("as encoded");
            prop_assert_eq!(PackRequest::try_from(wire), Ok(request));
        }
    }

    #[test]
    fn what_asks_for_nothing_is_refused_by_field() {
        let good = v1::PackRequest::from(PackRequest { hash: [7; 32], tree: Tree::Odd, skip: 0 });
        let short = v1::PackRequest { hash: vec![0; 33], ..good.clone() };
        assert_eq!(PackRequest::try_from(short), Err(InvalidPackRequest::Hash(33)));
        for tree in [0, 3, -1] {
            let none = v1::PackRequest { tree, ..good.clone() };
            assert_eq!(PackRequest::try_from(none), Err(InvalidPackRequest::Tree(tree)));
        }
    }

    #[test]
    fn a_piece_is_as_it_was_and_none_is_too_large() {
        let longest = PIECE_BYTES_MAX as usize;
        assert_eq!(piece(chunk(vec![7; longest])), Ok(Some(vec![7; longest])));
        assert_eq!(piece(chunk(vec![7; longest + 1])), Err(InvalidPackChunk(longest + 1)));
        assert_eq!(piece(none_yet()), Ok(None));
    }
}
