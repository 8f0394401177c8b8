//! Files with the hash of what went into them or came out of them.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::path::Path;

use blake3::{Hash, Hasher};

/// How much is read or written and hashed at once: small enough to be still in the cache.
const PIECE_BYTES: usize = 1 << 18;

/// A file being written, its hash and its length.
pub(crate) struct HashedFile {
    file: File,
    hasher: Hasher,
    bytes: u64,
}

impl HashedFile {
    /// Makes a file that must not be there yet.
    pub(crate) fn create(path: &Path) -> io::Result<Self> {
        let file = OpenOptions::new().write(true).create_new(true).open(path)?;
        Ok(Self { file, hasher: Hasher::new(), bytes: 0 })
    }

    /// Makes sure that the bytes are on the disk; tells their hash and number.
    pub(crate) fn finish(self) -> io::Result<(Hash, u64)> {
        let (file, hash, bytes) = self.into_parts();
        file.sync_all()?;
        Ok((hash, bytes))
    }

    /// The file, whose bytes may not be on the disk yet, their hash and their number.
    pub(crate) fn into_parts(self) -> (File, Hash, u64) {
        (self.file, self.hasher.finalize(), self.bytes)
    }
}

impl Write for HashedFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.write_all(bytes)?;
        Ok(bytes.len())
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        for piece in bytes.chunks(PIECE_BYTES) {
            self.file.write_all(piece)?;
            self.hasher.update(piece);
        }
        self.bytes += bytes.len() as u64;
        Ok(())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// A reader that knows the hash and the number of the bytes that came out of it.
pub(crate) struct HashedReader<R> {
    reader: R,
    hasher: Hasher,
    bytes: u64,
}

impl<R: Read> HashedReader<R> {
    pub(crate) fn new(reader: R) -> Self {
        Self { reader, hasher: Hasher::new(), bytes: 0 }
    }

    /// Reads as much as there is of what is asked for; tells how much.
    pub(crate) fn fill(&mut self, target: &mut [u8]) -> io::Result<usize> {
        let mut filled = 0;
        for piece in target.chunks_mut(PIECE_BYTES) {
            let count = read_fully(&mut self.reader, piece)?;
            self.hasher.update(&piece[..count]);
            filled += count;
            if count < piece.len() {
                break;
            }
        }
        self.bytes += filled as u64;
        Ok(filled)
    }

    /// How many bytes came out so far.
    pub(crate) const fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Their hash.
    pub(crate) fn hash(&self) -> Hash {
        self.hasher.finalize()
    }
}

/// Reads until `target` is full or there is no more.
fn read_fully(reader: &mut impl Read, target: &mut [u8]) -> io::Result<usize> {
    let mut filled = 0;
    while filled < target.len() {
        match reader.read(&mut target[filled..]) {
            Ok(0) => break,
            Ok(count) => filled += count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(filled)
}
