//! The file of the triangles that emit: every machine needs all of them, whichever partitions it
//! has.
//!
//! It is 16 bytes of header (magic, version) and 44 bytes per triangle: primitive id, material, the
//! corners' nine coordinates, all little-endian, by ascending primitive id.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use bytemuck::{bytes_of, pod_read_unaligned};
use equilux_common::scene::Luminaire;

use crate::checksum::HashedFile;
use crate::error::StoreError;
use crate::manifest::{FileEntry, LuminairesEntry, Manifest};

/// What the file begins with.
const MAGIC: [u8; 12] = *b"EQXLUMINAIRE";

/// The version of the layout.
const VERSION: u32 = 1;

const HEADER_BYTES: usize = 16;

/// The file while it is written.
pub(crate) struct LuminairesFile {
    writer: BufWriter<HashedFile>,
    count: u64,
}

impl LuminairesFile {
    /// Makes the file, which must not be there yet.
    pub(crate) fn create(path: &Path) -> io::Result<Self> {
        let mut writer = BufWriter::new(HashedFile::create(path)?);
        writer.write_all(&MAGIC)?;
        writer.write_all(&VERSION.to_le_bytes())?;
        Ok(Self { writer, count: 0 })
    }

    /// Appends a triangle; its id must be larger than those before.
    pub(crate) fn push(&mut self, luminaire: &Luminaire) -> io::Result<()> {
        self.count += 1;
        self.writer.write_all(bytes_of(luminaire))
    }

    /// Completes the file, which is called `name` in the store.
    pub(crate) fn finish(self, name: String) -> io::Result<LuminairesEntry> {
        let file = self.writer.into_inner().map_err(io::IntoInnerError::into_error)?;
        let (hash, bytes) = file.finish()?;
        Ok(LuminairesEntry { count: self.count, file: FileEntry { name, hash, bytes } })
    }
}

/// Takes the file's bytes, whose hash is right.
pub(crate) fn decode(
    name: &str,
    bytes: &[u8],
    manifest: &Manifest,
) -> Result<Vec<Luminaire>, StoreError> {
    let file = || name.to_owned();
    let version = bytes.strip_prefix(&MAGIC).and_then(|rest| rest.first_chunk());
    let Some(version) = version else {
        return Err(StoreError::Foreign { file: file(), kind: "a list of luminaires" });
    };
    let (found, known) = (u32::from_le_bytes(*version), VERSION);
    if found != known {
        return Err(StoreError::OtherVersion { file: file(), found, known });
    }
    let (records, rest) = bytes[HEADER_BYTES..].as_chunks::<{ size_of::<Luminaire>() }>();
    let luminaires: Vec<Luminaire> =
        records.iter().map(|record| pod_read_unaligned(record)).collect();
    let is_right = rest.is_empty()
        && luminaires.len() as u64 == manifest.luminaires.count
        && luminaires.is_sorted_by(|a, b| a.primitive < b.primitive)
        && luminaires.iter().all(|luminaire| is_valid(luminaire, manifest));
    let problem = || "does not fit its manifest; build the store again".to_owned();
    is_right
        .then_some(luminaires)
        .ok_or_else(|| StoreError::Malformed { file: file(), problem: problem() })
}

fn is_valid(luminaire: &Luminaire, manifest: &Manifest) -> bool {
    u64::from(luminaire.primitive) < manifest.triangle_count
        && (luminaire.material as usize) < manifest.materials.len()
        && luminaire.corners.as_flattened().iter().all(|coordinate| coordinate.is_finite())
}
