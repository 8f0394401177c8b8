//! What workers fetch of a job: its pack, which is in memory, and the files of its attachments,
//! which are partitions of a store and stay on disk.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::PathBuf;

use bytes::Bytes;

/// BLAKE3 hash of what is fetched.
pub type BlobHash = [u8; 32];

/// Files beside a job's pack, by the hashes of what they hold.
#[derive(Clone, Debug, Default)]
pub struct Attachments {
    /// Each file and its length.
    pub files: BTreeMap<BlobHash, (PathBuf, u64)>,
}

/// Something that is fetched.
#[derive(Clone, Debug)]
pub enum Blob {
    /// A pack.
    Memory(Bytes),
    /// A file of this length.
    File(PathBuf, u64),
}

impl Blob {
    /// How many bytes there are.
    #[must_use]
    pub fn len(&self) -> u64 {
        match self {
            Self::Memory(bytes) => bytes.len() as u64,
            Self::File(_, bytes) => *bytes,
        }
    }

    /// What to call it in messages; where it lies is nobody's business but this machine's.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Memory(_) => "a pack".into(),
            Self::File(path, _) => {
                path.file_name().unwrap_or_default().to_string_lossy().into_owned()
            }
        }
    }

    /// Whether there is nothing in it.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Some of the bytes; may wait for a disk.
    ///
    /// # Errors
    /// If there are not as many, or they cannot be read.
    pub fn read(&self, range: &Range<u64>) -> io::Result<Vec<u8>> {
        match self {
            Self::Memory(bytes) => {
                let place = |offset: u64| usize::try_from(offset).unwrap_or(usize::MAX);
                let part = bytes.get(place(range.start)..place(range.end));
                part.map(<[u8]>::to_vec).ok_or_else(|| io::ErrorKind::UnexpectedEof.into())
            }
            Self::File(path, _) => {
                let mut file = File::open(path)?;
                file.seek(SeekFrom::Start(range.start))?;
                let mut bytes = Vec::new();
                file.take(range.end - range.start).read_to_end(&mut bytes)?;
                let is_all = bytes.len() as u64 == range.end - range.start;
                if is_all { Ok(bytes) } else { Err(io::ErrorKind::UnexpectedEof.into()) }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_the_same_from_memory_and_from_disk() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("0.part");
        let bytes: Vec<u8> = (0..100).collect();
        std::fs::write(&path, &bytes).unwrap();
        for blob in [Blob::Memory(bytes.clone().into()), Blob::File(path, 100)] {
            assert_eq!(blob.len(), 100);
            assert!(["a pack", "0.part"].contains(&&*blob.name()));
            assert_eq!(blob.read(&(10..90)).unwrap(), bytes[10..90]);
            assert!(blob.read(&(100..100)).unwrap().is_empty());
            assert!(blob.read(&(90..101)).is_err());
        }
    }
}
