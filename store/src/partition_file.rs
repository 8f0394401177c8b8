//! The file of a partition: a header, then the partition's memory, section by section.
//!
//! Each section begins at a multiple of 64 bytes, as it must lie in memory, so that the file could
//! as well be mapped. The hash in the manifest covers every byte, padding included: a file that
//! passes is the one that was written.

use std::fs::File;
use std::io::{self, Read, Write};
use std::path::Path;

use bytes::Bytes;
use equilux_common::scene::files::ReadError;
use equilux_render::geometry::{ModelLimits, Partition, PartitionImage, SECTION_COUNT};

use crate::block::Block;
use crate::checksum::{HashedFile, HashedReader};
use crate::error::StoreError;
use crate::manifest::{FileEntry, Manifest};

/// What a partition's file begins with.
const MAGIC: [u8; 8] = *b"EQXPART\0";

/// The version of the layout: of the header and of what the sections hold.
pub const PARTITION_VERSION: u32 = 3;

/// Each section begins at a multiple of this.
const ALIGNMENT: usize = 64;

/// Magic, version, number of sections, bytes of each, padding.
const HEADER_BYTES: usize = (16 + 8 * SECTION_COUNT).next_multiple_of(ALIGNMENT);

/// Writes a partition to a file that must not be there yet; gives the file, which may not be on the
/// disk yet, its hash and its length.
pub(crate) fn write(
    path: &Path,
    partition: PartitionImage<'_>,
) -> io::Result<(File, blake3::Hash, u64)> {
    let sections = partition.sections();
    let mut file = HashedFile::create(path)?;
    file.write_all(&header(sections.map(|section| section.len() as u64)))?;
    for section in sections {
        file.write_all(section)?;
        file.write_all(&[0; ALIGNMENT][..padding(section.len())])?;
    }
    Ok(file.into_parts())
}

/// Reads and checks the partition of this number in a store, which lies at `path`: in the store, or
/// wherever a copy was put.
///
/// # Errors
/// Names the file and tells whether it is missing, cut short, damaged, of another version or no
/// partition at all.
///
/// # Panics
/// If the manifest has no such partition.
pub fn read_partition(
    path: &Path,
    manifest: &Manifest,
    number: usize,
) -> Result<Partition, StoreError> {
    let name = path.display().to_string();
    let expected = manifest.partitions[number].file.bytes;
    let file = File::open(path).map_err(|cause| open_error(&name, cause))?;
    let found = file.metadata().map_err(|cause| failed(&name, cause))?.len();
    // Told first, as what is known of a file cut short would otherwise depend on where it ends.
    if found != expected {
        return Err(StoreError::WrongLength { file: name, found, expected });
    }
    read_partition_from(file, &name, manifest, number)
}

/// The same from wherever the bytes come; `name` is for messages.
///
/// # Errors
/// As [`read_partition`].
///
/// # Panics
/// As [`read_partition`].
pub fn read_partition_from(
    reader: impl Read,
    name: &str,
    manifest: &Manifest,
    number: usize,
) -> Result<Partition, StoreError> {
    let entry = &manifest.partitions[number];
    let mut source = Source { reader: HashedReader::new(reader), name, file: &entry.file };
    let section_bytes = source.section_bytes()?;
    let sections = cut(&source.rest()?, section_bytes);
    let model = ModelLimits {
        bounds: manifest.bounds,
        triangle_count: manifest.triangle_count,
        material_count: manifest.materials.len(),
    };
    let read = Partition::from_sections(sections, &model);
    let file = || name.to_owned();
    let partition = read.map_err(|cause| StoreError::InvalidPartition { file: file(), cause })?;
    let is_as_said = partition.triangle_count() as u64 == entry.triangle_count
        && partition.primitive_count() == entry.placed_count
        && partition.bytes() as u64 == entry.memory_bytes;
    if is_as_said {
        return Ok(partition);
    }
    let problem = "is not of the size that its manifest says; build the store again".into();
    Err(StoreError::Malformed { file: file(), problem })
}

/// A partition's file while it is read.
struct Source<'a, R> {
    reader: HashedReader<R>,
    name: &'a str,
    file: &'a FileEntry,
}

impl<R: Read> Source<'_, R> {
    /// Reads the header, which tells of sections that fill the file.
    fn section_bytes(&mut self) -> Result<[u64; SECTION_COUNT], StoreError> {
        let mut header = [0; HEADER_BYTES];
        self.fill(&mut header)?;
        let file = || self.name.to_owned();
        if header[..8] != MAGIC {
            return Err(StoreError::Foreign { file: file(), kind: "a partition" });
        }
        let (found, known) = (word(&header, 8), PARTITION_VERSION);
        if found != known {
            return Err(StoreError::OtherVersion { file: file(), found, known });
        }
        let bytes: [u64; SECTION_COUNT] =
            std::array::from_fn(|section| long_word(&header, 16 + 8 * section));
        let total = bytes.iter().try_fold(HEADER_BYTES as u64, |total, &bytes| {
            total.checked_add(bytes.checked_next_multiple_of(ALIGNMENT as u64)?)
        });
        if word(&header, 12) as usize != SECTION_COUNT || total != Some(self.file.bytes) {
            return Err(StoreError::Damaged { file: file() });
        }
        Ok(bytes)
    }

    /// Reads all that follows the header and makes sure that all of it is what was written.
    fn rest(&mut self) -> Result<Bytes, StoreError> {
        let failed = |cause| failed(self.name, cause);
        let too_large = |_| failed(io::ErrorKind::OutOfMemory.into());
        let count = usize::try_from(self.file.bytes).map_err(too_large)? - HEADER_BYTES;
        let mut block = Block::new(count).map_err(failed)?;
        self.fill(&mut block.as_mut()[..count])?;
        self.check_end()?;
        Ok(Bytes::from_owner(block))
    }

    fn fill(&mut self, target: &mut [u8]) -> Result<(), StoreError> {
        match self.reader.fill(target) {
            Ok(count) if count == target.len() => Ok(()),
            Ok(_) => Err(StoreError::WrongLength {
                file: self.name.to_owned(),
                found: self.reader.bytes(),
                expected: self.file.bytes,
            }),
            Err(cause) => Err(failed(self.name, cause)),
        }
    }

    /// Makes sure that nothing follows, and that the hash is right.
    fn check_end(&mut self) -> Result<(), StoreError> {
        let hash = self.reader.hash();
        let more = self.reader.fill(&mut [0]).map_err(|cause| failed(self.name, cause))?;
        let is_whole = more == 0 && hash == self.file.hash;
        let damaged = || StoreError::Damaged { file: self.name.to_owned() };
        is_whole.then_some(()).ok_or_else(damaged)
    }
}

/// The sections of these sizes, one after another with their padding, which fill all of `bytes`.
fn cut(bytes: &Bytes, section_bytes: [u64; SECTION_COUNT]) -> [Bytes; SECTION_COUNT] {
    let mut begin = 0;
    section_bytes.map(|section| {
        let section = section as usize;
        let cut = bytes.slice(begin..begin + section);
        begin += section.next_multiple_of(ALIGNMENT);
        cut
    })
}

fn header(section_bytes: [u64; SECTION_COUNT]) -> [u8; HEADER_BYTES] {
    let mut header = [0; HEADER_BYTES];
    header[..8].copy_from_slice(&MAGIC);
    header[8..12].copy_from_slice(&PARTITION_VERSION.to_le_bytes());
    header[12..16].copy_from_slice(&(SECTION_COUNT as u32).to_le_bytes());
    for (place, bytes) in header[16..].chunks_exact_mut(8).zip(section_bytes) {
        place.copy_from_slice(&bytes.to_le_bytes());
    }
    header
}

/// Bytes from the end of a section to the beginning of the next.
const fn padding(bytes: usize) -> usize {
    bytes.next_multiple_of(ALIGNMENT) - bytes
}

fn word(header: &[u8; HEADER_BYTES], at: usize) -> u32 {
    u32::from_le_bytes(std::array::from_fn(|byte| header[at + byte]))
}

fn long_word(header: &[u8; HEADER_BYTES], at: usize) -> u64 {
    u64::from_le_bytes(std::array::from_fn(|byte| header[at + byte]))
}

fn open_error(name: &str, cause: io::Error) -> StoreError {
    let name = name.to_owned();
    match cause.kind() {
        io::ErrorKind::NotFound => {
            let hint = "copy the whole store, or build it again".to_owned();
            ReadError::Missing { name, hint }.into()
        }
        _ => StoreError::Failed { file: name, cause },
    }
}

fn failed(name: &str, cause: io::Error) -> StoreError {
    StoreError::Failed { file: name.to_owned(), cause }
}
