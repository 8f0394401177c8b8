//! Tar archives, as `tar` and `git archive` make them.

use std::io::{self, Read};

use tar::EntryType;

use super::{ArchiveError, Unpacked, names};

/// Headers and padding may take this much besides the files.
const OVERHEAD_BYTES: u64 = 64 << 20;

/// Takes in all files of a tar stream.
pub(super) fn unpack(stream: impl Read, unpacked: &mut Unpacked) -> Result<(), ArchiveError> {
    let bytes_left = unpacked.limits.unpacked_bytes_max.saturating_add(OVERHEAD_BYTES);
    let mut archive = tar::Archive::new(Limited { stream, bytes_left });
    let entries = archive.entries().map_err(|error| unpacked.stream_error(&error))?;
    for entry in entries {
        let entry = entry.map_err(|error| unpacked.stream_error(&error))?;
        unpacked.count_entry()?;
        let name = String::from_utf8(entry.path_bytes().into_owned()).map_err(|error| {
            let entry = String::from_utf8_lossy(error.as_bytes()).into_owned();
            ArchiveError::BadName { entry, problem: "has a name that is not UTF-8" }
        })?;
        match entry.header().entry_type() {
            EntryType::Regular | EntryType::Continuous | EntryType::GNUSparse => {
                unpacked.add(&name, entry.size(), entry)?;
            }
            EntryType::Directory => check_directory(&name)?,
            EntryType::XGlobalHeader => (),
            other => return Err(ArchiveError::NotAFile { entry: name, kind: kind(other) }),
        }
    }
    Ok(())
}

/// `./` stands for the archive's root and is harmless.
fn check_directory(name: &str) -> Result<(), ArchiveError> {
    if matches!(name, "." | "./") { Ok(()) } else { names::checked(name).map(|_| ()) }
}

const fn kind(entry_type: EntryType) -> &'static str {
    match entry_type {
        EntryType::Symlink => "symbolic link",
        EntryType::Link => "hard link",
        EntryType::Char | EntryType::Block => "device",
        EntryType::Fifo => "pipe",
        _ => "special file",
    }
}

impl Unpacked {
    /// Tells the ways apart in which the stream of headers can fail.
    fn stream_error(&self, error: &io::Error) -> ArchiveError {
        match error.kind() {
            io::ErrorKind::UnexpectedEof => ArchiveError::Truncated { entry: None },
            io::ErrorKind::FileTooLarge => self.too_large(),
            _ if error.to_string().contains("unexpected EOF") => {
                ArchiveError::Truncated { entry: None }
            }
            _ => ArchiveError::Damaged { problem: error.to_string() },
        }
    }
}

/// A stream that fails at a limit: the long names and extensions that the reader of tar gathers by
/// itself are bounded by it too.
struct Limited<R> {
    stream: R,
    bytes_left: u64,
}

impl<R: Read> Read for Limited<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.stream.read(buffer)?;
        self.bytes_left = self
            .bytes_left
            .checked_sub(count as u64)
            .ok_or_else(|| io::Error::from(io::ErrorKind::FileTooLarge))?;
        Ok(count)
    }
}
