//! Zip archives: stored or deflated files, without passwords.

use std::io::{Read, Seek};

use zip::result::ZipError;
use zip::{CompressionMethod, ZipArchive};

use super::{ArchiveError, Unpacked, names};

/// Takes in all files of a zip archive.
pub(super) fn unpack(
    archive: impl Read + Seek,
    unpacked: &mut Unpacked,
) -> Result<(), ArchiveError> {
    let mut archive = ZipArchive::new(archive).map_err(|error| archive_error(&error))?;
    let entries_max = unpacked.limits.entries_max;
    if archive.len() > entries_max {
        return Err(ArchiveError::TooManyEntries { entries_max });
    }
    for index in 0..archive.len() {
        add_entry(&mut archive, index, unpacked)?;
    }
    Ok(())
}

fn add_entry(
    archive: &mut ZipArchive<impl Read + Seek>,
    index: usize,
    unpacked: &mut Unpacked,
) -> Result<(), ArchiveError> {
    let name = checked_entry(archive, index)?;
    unpacked.count_entry()?;
    let file = archive.by_index(index).map_err(|error| entry_error(&name, &error))?;
    if file.is_dir() {
        return names::checked(&name).map(|_| ());
    }
    unpacked.add(&name, file.size(), file)
}

/// The name of an entry that is a plain file or a directory and needs no password.
fn checked_entry(
    archive: &mut ZipArchive<impl Read + Seek>,
    index: usize,
) -> Result<String, ArchiveError> {
    let file = archive.by_index_raw(index).map_err(|error| archive_error(&error))?;
    let name = file.name().map_err(|error| archive_error(&error))?.into_owned();
    if file.encrypted() {
        return Err(ArchiveError::Encrypted { entry: name });
    }
    if let Some(kind) = file.unix_mode().and_then(special_kind) {
        return Err(ArchiveError::NotAFile { entry: name, kind });
    }
    match file.compression() {
        CompressionMethod::Stored | CompressionMethod::Deflated => Ok(name),
        other => {
            Err(ArchiveError::Unsupported { entry: name, problem: format!("it uses {other}") })
        }
    }
}

/// What a Unix mode says besides "plain file" and "directory"; the type is in its top four bits.
const fn special_kind(mode: u32) -> Option<&'static str> {
    match mode & 0o170_000 {
        0 | 0o100_000 | 0o040_000 => None,
        0o120_000 => Some("symbolic link"),
        0o020_000 | 0o060_000 => Some("device"),
        0o010_000 => Some("pipe"),
        _ => Some("special file"),
    }
}

fn archive_error(error: &ZipError) -> ArchiveError {
    match error {
        ZipError::Io(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => {
            ArchiveError::Truncated { entry: None }
        }
        // The directory of a zip archive is at its end: without it, the end is missing.
        ZipError::InvalidArchive(problem) if problem.contains("EOCD") => {
            ArchiveError::Truncated { entry: None }
        }
        other => ArchiveError::Damaged { problem: other.to_string() },
    }
}

fn entry_error(name: &str, error: &ZipError) -> ArchiveError {
    let entry = name.to_owned();
    match error {
        ZipError::UnsupportedArchive(problem) => {
            ArchiveError::Unsupported { entry, problem: (*problem).to_owned() }
        }
        other => archive_error(other),
    }
}
