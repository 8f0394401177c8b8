//! Spool files: the triangles of each part, put down while the model passes by.
//!
//! They are [records](super::record), one after another. Files are open only while something is
//! appended to them, so there may be thousands; what is yet to be appended waits in memory within
//! a limit.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use equilux_common::scene::WorldTriangle;

use super::error::BuildError;
use super::record::{Memory, RECORD_BYTES_MAX};

/// Bytes that wait to be written, over all parts.
const BUFFERS_BYTES_MAX: usize = 64 << 20;

/// Most bytes that wait to be written to one file: appending more at once gains nothing.
const BUFFER_BYTES_MAX: usize = 1 << 20;

/// Most parts of one spool: each one's buffer then still has 16 KiB.
pub(super) const PARTS_MAX: u32 = 4096;

/// How much of a spool file is read at once.
const READ_BYTES: usize = 1 << 20;

/// Parts that are being filled.
pub(super) struct Spool {
    parts: Vec<Filling>,
    buffer_bytes: usize,
}

struct Filling {
    path: PathBuf,
    buffer: Vec<u8>,
    memory: Memory,
    triangle_count: u64,
}

/// A part whose triangles are all on disk. The file goes when this does.
#[derive(Debug)]
pub(super) struct SpooledPart {
    path: PathBuf,
    /// How many triangles it has.
    pub(super) triangle_count: u64,
}

impl Spool {
    /// Files in `directory`, whose names begin with `prefix`, for so many parts.
    pub(super) fn new(directory: &Path, prefix: &str, part_count: usize) -> Self {
        let path = |part: usize| directory.join(format!("{prefix}{part:05}.spool"));
        let part = |part| Filling {
            path: path(part),
            buffer: Vec::new(),
            memory: Memory::default(),
            triangle_count: 0,
        };
        let buffer_bytes = (BUFFERS_BYTES_MAX / part_count.max(1)).min(BUFFER_BYTES_MAX);
        Self { parts: (0..part_count).map(part).collect(), buffer_bytes }
    }

    /// Puts down a triangle of a part.
    pub(super) fn push(
        &mut self,
        part: usize,
        primitive: u32,
        triangle: &WorldTriangle,
    ) -> Result<(), BuildError> {
        let part = &mut self.parts[part];
        if part.buffer.capacity() == 0 {
            part.buffer.reserve_exact(self.buffer_bytes);
        }
        part.memory.write(&mut part.buffer, primitive, triangle);
        part.triangle_count += 1;
        if part.buffer.len() + RECORD_BYTES_MAX > self.buffer_bytes { part.flush() } else { Ok(()) }
    }

    /// Writes what still waits.
    pub(super) fn finish(self) -> Result<Vec<SpooledPart>, BuildError> {
        let finish = |mut part: Filling| {
            part.flush()?;
            Ok(SpooledPart { path: part.path, triangle_count: part.triangle_count })
        };
        self.parts.into_iter().map(finish).collect()
    }
}

impl Filling {
    fn flush(&mut self) -> Result<(), BuildError> {
        let append = || OpenOptions::new().append(true).create(true).open(&self.path);
        let written = append().and_then(|mut file| file.write_all(&self.buffer));
        written.map_err(|cause| BuildError::unwritable(&self.path, cause))?;
        self.buffer.clear();
        Ok(())
    }
}

impl SpooledPart {
    /// Shows all triangles with their primitive ids, in the order in which they were put down.
    pub(super) fn for_each(
        &self,
        visit: &mut dyn FnMut(u32, &WorldTriangle) -> Result<(), BuildError>,
    ) -> Result<(), BuildError> {
        let failed = |cause| BuildError::unreadable(&self.path, cause);
        let mut file = File::open(&self.path).map_err(failed)?;
        let mut buffer = Vec::with_capacity(READ_BYTES + RECORD_BYTES_MAX);
        let mut memory = Memory::default();
        let mut count = 0;
        loop {
            let is_last =
                (&mut file).take(READ_BYTES as u64).read_to_end(&mut buffer).map_err(failed)? == 0;
            let mut records = buffer.as_slice();
            // A record may go on in what is read next.
            while records.len() >= RECORD_BYTES_MAX || (is_last && !records.is_empty()) {
                let (primitive, triangle) = memory.read(&mut records).map_err(failed)?;
                visit(primitive, &triangle)?;
                count += 1;
            }
            if is_last {
                break;
            }
            let rest = records.len();
            let begin = buffer.len() - rest;
            buffer.copy_within(begin.., 0);
            buffer.truncate(rest);
        }
        if count == self.triangle_count { Ok(()) } else { Err(failed(cut_short())) }
    }
}

impl Drop for SpooledPart {
    fn drop(&mut self) {
        // The directory goes later, with whatever is left in it.
        let _ = std::fs::remove_file(&self.path);
    }
}

fn cut_short() -> io::Error {
    io::Error::new(io::ErrorKind::UnexpectedEof, "it is not what was written")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A triangle with the attributes that its number tells.
    fn triangle(number: u32) -> WorldTriangle {
        let value = number as f32;
        WorldTriangle {
            corners: [[value; 3], [value + 0.25; 3], [-value; 3]],
            normals: number.is_multiple_of(3).then_some([[value, 0.0, 1.0]; 3]),
            texcoords: number.is_multiple_of(5).then_some([[value, -value]; 3]),
            material: number % 7,
        }
    }

    #[test]
    fn what_is_written_in_many_goes_comes_back_in_order() {
        let directory = tempfile::tempdir().unwrap();
        let mut spool = Spool::new(directory.path(), "", 2);
        let count = 4 * BUFFER_BYTES_MAX as u32 / 38;
        for number in 0..count {
            spool.push((number % 2) as usize, number, &triangle(number)).unwrap();
        }
        let parts = spool.finish().unwrap();
        for (first, part) in (0..).zip(&parts) {
            assert!(part.path.metadata().unwrap().len() > 2 * BUFFER_BYTES_MAX as u64);
            let mut expected = (first..count).step_by(2);
            let mut check = |primitive, found: &WorldTriangle| {
                assert_eq!(Some(primitive), expected.next());
                assert_eq!(*found, triangle(primitive));
                Ok(())
            };
            part.for_each(&mut check).unwrap();
            assert_eq!(expected.next(), None);
        }
        let path = parts[0].path.clone();
        drop(parts);
        assert!(!path.exists());
    }
}
