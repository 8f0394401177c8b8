//! Files that are read piece by piece, because they may be larger than memory.
//!
//! A [`LargeFile`] remembers where a file is, how long it is and when it was last written, but
//! holds nothing open: a scene may have more models than a process may have open files. Whoever
//! reads opens it for the time that this takes, and a file that is no longer what it was is an
//! error then, not nonsense later.

use std::fs::{File, Metadata};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

use super::{ReadError, read_error};

/// A file to be read at any place, any number of times.
#[derive(Clone, Debug)]
pub struct LargeFile {
    name: String,
    byte_count: u64,
    content: Content,
}

#[derive(Clone, Debug)]
enum Content {
    Disk { path: PathBuf, modified: Option<SystemTime> },
    Memory(Arc<[u8]>),
}

impl LargeFile {
    /// The file at `path`, which the user calls `name`.
    ///
    /// # Errors
    /// If there is none, or it is no file.
    pub fn on_disk(name: &str, path: &Path) -> Result<Self, ReadError> {
        let metadata = std::fs::metadata(path).map_err(|cause| read_error(name, cause))?;
        if !metadata.is_file() {
            return Err(ReadError::NotAFile { name: name.to_owned() });
        }
        let content = Content::Disk { path: path.to_owned(), modified: metadata.modified().ok() };
        Ok(Self { name: name.to_owned(), byte_count: metadata.len(), content })
    }

    /// Bytes in memory, which the user calls `name`.
    #[must_use]
    pub fn in_memory(name: &str, bytes: Arc<[u8]>) -> Self {
        let byte_count = bytes.len() as u64;
        Self { name: name.to_owned(), byte_count, content: Content::Memory(bytes) }
    }

    /// What the user calls it.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// How long it is.
    #[must_use]
    pub const fn byte_count(&self) -> u64 {
        self.byte_count
    }

    /// Opens it for reading.
    ///
    /// # Errors
    /// If it is gone, cannot be read, or has been written to since this value was made.
    pub fn open(&self) -> Result<OpenFile<'_>, ReadError> {
        let bytes = match &self.content {
            Content::Disk { path, .. } => {
                Bytes::Disk(File::open(path).map_err(|cause| read_error(&self.name, cause))?)
            }
            Content::Memory(bytes) => Bytes::Memory(bytes),
        };
        let opened = OpenFile { file: self, bytes };
        opened.check_unchanged()?;
        Ok(opened)
    }

    fn is_as_before(&self, metadata: &Metadata) -> bool {
        let Content::Disk { modified, .. } = &self.content else { return true };
        metadata.len() == self.byte_count && metadata.modified().ok() == *modified
    }
}

/// A file that is open for reading at any place.
#[derive(Debug)]
pub struct OpenFile<'a> {
    file: &'a LargeFile,
    bytes: Bytes<'a>,
}

#[derive(Debug)]
enum Bytes<'a> {
    Disk(File),
    Memory(&'a [u8]),
}

impl OpenFile<'_> {
    /// How long it is.
    #[must_use]
    pub const fn byte_count(&self) -> u64 {
        self.file.byte_count
    }

    /// Fills `piece` with the bytes from `offset` on.
    ///
    /// # Errors
    /// If the system does not give them; [`ReadError::Changed`] if they are no longer there.
    pub fn read_at(&self, offset: u64, piece: &mut [u8]) -> Result<(), ReadError> {
        let read = match &self.bytes {
            Bytes::Disk(file) => read_exact_at(file, offset, piece),
            Bytes::Memory(bytes) => copy_from(bytes, offset, piece),
        };
        read.map_err(|cause| match cause.kind() {
            io::ErrorKind::UnexpectedEof => self.changed(),
            _ => read_error(&self.file.name, cause),
        })
    }

    /// Checks that nobody has written to the file since it was first looked at.
    ///
    /// # Errors
    /// [`ReadError::Changed`] if somebody has.
    pub fn check_unchanged(&self) -> Result<(), ReadError> {
        let Bytes::Disk(file) = &self.bytes else { return Ok(()) };
        let metadata = file.metadata().map_err(|cause| read_error(&self.file.name, cause))?;
        if self.file.is_as_before(&metadata) { Ok(()) } else { Err(self.changed()) }
    }

    fn changed(&self) -> ReadError {
        ReadError::Changed { name: self.file.name.clone() }
    }
}

#[cfg(unix)]
fn read_exact_at(file: &File, offset: u64, piece: &mut [u8]) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, piece, offset)
}

#[cfg(not(unix))]
fn read_exact_at(mut file: &File, offset: u64, piece: &mut [u8]) -> io::Result<()> {
    use std::io::{Read, Seek, SeekFrom};
    file.seek(SeekFrom::Start(offset))?;
    file.read_exact(piece)
}

fn copy_from(bytes: &[u8], offset: u64, piece: &mut [u8]) -> io::Result<()> {
    let start = usize::try_from(offset).unwrap_or(usize::MAX);
    let end = start.checked_add(piece.len());
    let found = end.and_then(|end| bytes.get(start..end)).ok_or(io::ErrorKind::UnexpectedEof)?;
    piece.copy_from_slice(found);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(file: &LargeFile, offset: u64, count: usize) -> Result<Vec<u8>, ReadError> {
        let mut piece = vec![0; count];
        file.open()?.read_at(offset, &mut piece)?;
        Ok(piece)
    }

    #[test]
    fn pieces_are_the_same_on_disk_and_in_memory() {
        let here = tempfile::tempdir().unwrap();
        let path = here.path().join("a");
        std::fs::write(&path, b"0123456789").unwrap();
        let on_disk = LargeFile::on_disk("a", &path).unwrap();
        let in_memory = LargeFile::in_memory("a", b"0123456789".as_slice().into());
        for file in [on_disk, in_memory] {
            assert_eq!(file.byte_count(), 10);
            assert_eq!(read(&file, 3, 4).unwrap(), b"3456");
            assert_eq!(read(&file, 10, 0).unwrap(), b"");
            for (offset, count) in [(8, 3), (11, 1), (1 << 40, 1)] {
                assert!(matches!(read(&file, offset, count), Err(ReadError::Changed { .. })));
            }
        }
        assert!(matches!(LargeFile::on_disk("d", here.path()), Err(ReadError::NotAFile { .. })));
    }

    #[test]
    fn a_file_that_was_written_to_is_refused() {
        let here = tempfile::tempdir().unwrap();
        let path = here.path().join("a");
        std::fs::write(&path, b"0123456789").unwrap();
        let file = LargeFile::on_disk("a", &path).unwrap();
        let opened = file.open().unwrap();
        std::fs::write(&path, b"01234").unwrap();
        assert!(matches!(opened.check_unchanged(), Err(ReadError::Changed { .. })));
        let mut piece = [0; 8];
        assert!(matches!(opened.read_at(0, &mut piece), Err(ReadError::Changed { .. })));
        assert!(matches!(file.open(), Err(ReadError::Changed { .. })));
        std::fs::remove_file(&path).unwrap();
        assert!(matches!(file.open(), Err(ReadError::Missing { .. })));
    }
}
