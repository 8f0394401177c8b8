//! Uploaded archives: what a stranger sends, made into named files or refused.
//!
//! Nothing is ever written to a disk under a name from an archive; files are read into memory,
//! counted while they are unpacked, so that a bomb ends at the limit and not at the end of memory.
//! Whatever is not a plain file or a directory is refused: a scene has no use for it.

mod names;
mod tarball;
mod zipped;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read, Seek};

/// How much an archive may hold.
#[derive(Clone, Copy, Debug)]
pub struct ArchiveLimits {
    /// Most bytes of all files together, unpacked.
    pub unpacked_bytes_max: u64,
    /// Most files and directories.
    pub entries_max: usize,
}

impl Default for ArchiveLimits {
    /// 2 GiB hold the largest scenes whose geometry fits a common machine; 65,536 files are more
    /// than any scene has textures.
    fn default() -> Self {
        Self { unpacked_bytes_max: 2 << 30, entries_max: 65_536 }
    }
}

/// An archive that is not accepted.
#[derive(Debug, thiserror::Error)]
pub enum ArchiveError {
    /// It is neither zip nor tar.
    #[error("the archive's format is unknown; send a zip, tar or tar.gz file")]
    UnknownFormat,
    /// It ends too early.
    #[error("the archive is truncated{}; send it again, whole", of(.entry))]
    Truncated {
        /// The file in which it ends, where known.
        entry: Option<String>,
    },
    /// Its bytes contradict its format.
    #[error("the archive is damaged: {problem}; pack it anew")]
    Damaged {
        /// What does not fit.
        problem: String,
    },
    /// A name that points outside.
    #[error("the archive's entry `{entry}` {problem}; pack files under relative names only")]
    BadName {
        /// The name as it stands in the archive.
        entry: String,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// Something that is not a plain file.
    #[error("the archive's entry `{entry}` is a {kind}; pack plain files only")]
    NotAFile {
        /// Its name.
        entry: String,
        /// What it is.
        kind: &'static str,
    },
    /// A file that needs a password.
    #[error("the archive's entry `{entry}` is encrypted; pack it without a password")]
    Encrypted {
        /// Its name.
        entry: String,
    },
    /// A file packed in a way that is not supported.
    #[error("the archive's entry `{entry}` cannot be unpacked: {problem}; use deflate or store")]
    Unsupported {
        /// Its name.
        entry: String,
        /// What is not supported.
        problem: String,
    },
    /// The same name twice.
    #[error("the archive has two entries `{entry}`; give each file a name of its own")]
    Duplicate {
        /// The name.
        entry: String,
    },
    /// More files than the limit.
    #[error("the archive has more than {entries_max} entries; send only what the scene needs")]
    TooManyEntries {
        /// The limit.
        entries_max: usize,
    },
    /// More bytes than the limit.
    #[error(
        "the archive unpacks to more than {unpacked_bytes_max} bytes; \
         send only what the scene needs"
    )]
    TooLarge {
        /// The limit.
        unpacked_bytes_max: u64,
    },
    /// No file at all.
    #[error("the archive holds no file; pack the scene file and all that it refers to")]
    Empty,
    /// The disk on which the upload lies failed us.
    #[error("the uploaded archive cannot be read back: {0}")]
    Io(#[source] io::Error),
}

fn of(entry: &Option<String>) -> String {
    entry.as_ref().map_or_else(String::new, |name| format!(" in `{name}`"))
}

/// The files of an archive, by name; names are relative, without `.` and `..`, with `/` between.
///
/// # Errors
/// If the archive is not accepted; nothing is kept then.
pub fn unpack(
    archive: File,
    limits: ArchiveLimits,
) -> Result<BTreeMap<String, Vec<u8>>, ArchiveError> {
    let mut archive = io::BufReader::new(archive);
    let format = Format::of(&mut archive)?;
    let mut unpacked = Unpacked::new(limits);
    match format {
        Format::Zip => zipped::unpack(archive, &mut unpacked)?,
        Format::Tar => tarball::unpack(archive, &mut unpacked)?,
        Format::TarGz => {
            tarball::unpack(flate2::read::MultiGzDecoder::new(archive), &mut unpacked)?;
        }
    }
    if unpacked.files.is_empty() { Err(ArchiveError::Empty) } else { Ok(unpacked.files) }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Zip,
    Tar,
    TarGz,
}

impl Format {
    /// Recognizes an archive by its first block, and goes back to its start.
    fn of(archive: &mut (impl Read + Seek)) -> Result<Self, ArchiveError> {
        let mut head = Vec::with_capacity(512);
        archive.by_ref().take(512).read_to_end(&mut head).map_err(ArchiveError::Io)?;
        archive.rewind().map_err(ArchiveError::Io)?;
        if head.starts_with(b"PK\x03\x04") || head.starts_with(b"PK\x05\x06") {
            Ok(Self::Zip)
        } else if head.starts_with(b"\x1f\x8b") {
            Ok(Self::TarGz)
        } else if head.get(257..262) == Some(b"ustar") {
            Ok(Self::Tar)
        } else {
            Err(ArchiveError::UnknownFormat)
        }
    }
}

/// What has been unpacked so far, and what is left of the limits.
struct Unpacked {
    files: BTreeMap<String, Vec<u8>>,
    entry_count: usize,
    bytes: u64,
    limits: ArchiveLimits,
}

impl Unpacked {
    const fn new(limits: ArchiveLimits) -> Self {
        Self { files: BTreeMap::new(), entry_count: 0, bytes: 0, limits }
    }

    /// Counts an entry of any kind.
    const fn count_entry(&mut self) -> Result<(), ArchiveError> {
        self.entry_count += 1;
        let entries_max = self.limits.entries_max;
        if self.entry_count > entries_max {
            return Err(ArchiveError::TooManyEntries { entries_max });
        }
        Ok(())
    }

    /// Takes a file in. Its size as declared is compared, never trusted.
    fn add(
        &mut self,
        entry: &str,
        declared_bytes: u64,
        content: impl Read,
    ) -> Result<(), ArchiveError> {
        let name = names::checked(entry)?;
        let bytes_left = self.limits.unpacked_bytes_max - self.bytes;
        let mut bytes = Vec::new();
        content
            .take(bytes_left.saturating_add(1))
            .read_to_end(&mut bytes)
            .map_err(|error| self.read_error(entry, &error))?;
        let read_bytes = bytes.len() as u64;
        if read_bytes > bytes_left {
            return Err(self.too_large());
        }
        if read_bytes < declared_bytes {
            return Err(ArchiveError::Truncated { entry: Some(entry.into()) });
        }
        self.bytes += read_bytes;
        match self.files.insert(name, bytes) {
            Some(_) => Err(ArchiveError::Duplicate { entry: entry.into() }),
            None => Ok(()),
        }
    }

    const fn too_large(&self) -> ArchiveError {
        ArchiveError::TooLarge { unpacked_bytes_max: self.limits.unpacked_bytes_max }
    }

    /// Tells the ways apart in which reading an entry can fail.
    fn read_error(&self, entry: &str, error: &io::Error) -> ArchiveError {
        match error.kind() {
            io::ErrorKind::UnexpectedEof => ArchiveError::Truncated { entry: Some(entry.into()) },
            io::ErrorKind::FileTooLarge => self.too_large(),
            _ => ArchiveError::Damaged { problem: format!("`{entry}`: {error}") },
        }
    }
}

#[cfg(test)]
mod tests;
