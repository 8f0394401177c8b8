//! A scene's pack on its way from the coordinator to a worker.

use crate::limits::PACK_CHUNK_BYTES;
use crate::v1;

/// A request for no pack.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("hash: has {0} bytes instead of 32")]
pub struct InvalidPackRequest(pub usize);

/// A piece of no pack.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("data: has {0} bytes, not from 1 to {PACK_CHUNK_BYTES}")]
pub struct InvalidPackChunk(pub usize);

/// Asks for the pack of that hash.
#[must_use]
pub fn request(hash: [u8; 32]) -> v1::PackRequest {
    v1::PackRequest { hash: hash.to_vec() }
}

/// The hash of the pack that is asked for.
///
/// # Errors
/// If it is none.
pub fn requested(wire: v1::PackRequest) -> Result<[u8; 32], InvalidPackRequest> {
    wire.hash.try_into().map_err(|hash: Vec<u8>| InvalidPackRequest(hash.len()))
}

/// A pack in pieces, in order.
pub fn chunks(pack: &[u8]) -> impl Iterator<Item = v1::PackChunk> {
    pack.chunks(PACK_CHUNK_BYTES).map(|data| v1::PackChunk { data: data.to_vec() })
}

/// The bytes of a piece.
///
/// # Errors
/// If it is empty or too large.
pub fn chunk(wire: v1::PackChunk) -> Result<Vec<u8>, InvalidPackChunk> {
    let length = wire.data.len();
    if (1..=PACK_CHUNK_BYTES).contains(&length) {
        Ok(wire.data)
    } else {
        Err(InvalidPackChunk(length))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pack_comes_together_again() {
        let pack: Vec<u8> = (0..PACK_CHUNK_BYTES + 77).map(|index| (index % 251) as u8).collect();
        let whole: Vec<u8> = chunks(&pack).flat_map(|wire| chunk(wire).expect("a piece")).collect();
        assert_eq!(whole, pack);
        assert_eq!(requested(request([7; 32])), Ok([7; 32]));
    }

    #[test]
    fn wrong_lengths_are_refused() {
        assert_eq!(requested(v1::PackRequest { hash: vec![0; 33] }), Err(InvalidPackRequest(33)));
        assert_eq!(chunk(v1::PackChunk { data: vec![] }), Err(InvalidPackChunk(0)));
        let long = vec![0; PACK_CHUNK_BYTES + 1];
        assert_eq!(chunk(v1::PackChunk { data: long }), Err(InvalidPackChunk(1 << 20 | 1)));
    }
}
