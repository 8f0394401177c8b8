//! What an OBJ file says, in temporary files: a table of each kind of vertex, and the faces.
//!
//! The file of faces is a sequence of records of 32-bit numbers, little end first. One that begins
//! with 0 says what the faces after it have in common: the number of the object in two halves, the
//! material, the length of the object's name, and then the name. Any other begins with the number
//! of a face's corners and a set of bits for what it has; then come the indices of the positions,
//! of the texture coordinates, if any, and of the normals, if any.

use std::path::Path;

use super::spool::{Spool, SpoolWriter};
use crate::scene::NO_INDEX;
use crate::scene::error::SceneError;
use crate::scene::files::{LargeFile, ReadError, Scan};
use crate::scene::load::mesh::{Face, Part, Reply};
use crate::scene::load::obj::too_concave;
use crate::scene::load::obj_reader::{Corner, ObjSink};

/// Bits of what a face has.
const HAS_TEXCOORDS: u32 = 1;
const HAS_NORMALS: u32 = 2;

/// Writes down what an OBJ file says.
#[derive(Debug)]
pub(super) struct ObjSpools {
    positions: SpoolWriter,
    texcoords: SpoolWriter,
    normals: SpoolWriter,
    faces: SpoolWriter,
}

impl ObjSpools {
    /// Files for a model in `directory`.
    pub(super) fn new(directory: &Path, number: usize) -> Result<Self, SceneError> {
        let create = |what: &str| SpoolWriter::new(directory, &format!("model-{number}-{what}"));
        Ok(Self {
            positions: create("positions")?,
            texcoords: create("texcoords")?,
            normals: create("normals")?,
            faces: create("faces")?,
        })
    }

    /// Positions, texture coordinates, normals and faces, to be read.
    pub(super) fn finish(self) -> Result<[Spool; 4], SceneError> {
        Ok([
            self.positions.finish()?,
            self.texcoords.finish()?,
            self.normals.finish()?,
            self.faces.finish()?,
        ])
    }

    fn write_words(&mut self, words: impl IntoIterator<Item = u32>) -> Result<(), SceneError> {
        words.into_iter().try_for_each(|word| self.faces.write(&word.to_le_bytes()))
    }
}

impl ObjSink for ObjSpools {
    fn position(&mut self, position: [f32; 3]) -> Result<(), SceneError> {
        self.positions.write_row(&position)
    }

    fn texcoord(&mut self, texcoord: [f32; 2]) -> Result<(), SceneError> {
        self.texcoords.write_row(&texcoord)
    }

    fn normal(&mut self, normal: [f32; 3]) -> Result<(), SceneError> {
        self.normals.write_row(&normal)
    }

    fn part(&mut self, part: &Part) -> Result<(), SceneError> {
        let (low, high) = (part.object as u32, (part.object >> 32) as u32);
        let name = part.name.as_bytes();
        self.write_words([0, low, high, part.material, name.len() as u32])?;
        self.faces.write(name)
    }

    fn face(&mut self, corners: &[Corner]) -> Result<(), SceneError> {
        let has = |kind: usize, bit| if corners[0][kind] == NO_INDEX { 0 } else { bit };
        let bits = has(1, HAS_TEXCOORDS) | has(2, HAS_NORMALS);
        self.write_words([corners.len() as u32, bits])?;
        for kind in (0..3).filter(|&kind| corners[0][kind] != NO_INDEX) {
            self.write_words(corners.iter().map(|corner| corner[kind]))?;
        }
        Ok(())
    }
}

/// Shows the faces that were written to `file` for the model called `name`.
pub(super) fn for_each_face(
    file: &LargeFile,
    name: &str,
    visit: &mut dyn FnMut(&Face<'_>) -> Result<Reply, SceneError>,
) -> Result<(), SceneError> {
    let opened = file.open()?;
    let mut records = Records { file, scan: Scan::new(&opened, 0) };
    let mut part = Part::default();
    let mut indices = Vec::new();
    while records.scan.remaining() > 0 {
        let count = records.word()?;
        if count == 0 {
            records.part(&mut part)?;
            continue;
        }
        let bits = records.word()?;
        let kinds = 1 + bits.count_ones() as usize;
        let count = count as usize;
        records.indices(count * kinds, &mut indices)?;
        let (positions, rest) = indices.split_at(count);
        let has_texcoords = bits & HAS_TEXCOORDS != 0;
        let (texcoords, rest) = rest.split_at(if has_texcoords { count } else { 0 });
        let normals = if bits & HAS_NORMALS != 0 { rest } else { &[] };
        match visit(&Face { positions, normals, texcoords, part: &part })? {
            Reply::Next => {}
            Reply::Enough => return Ok(()),
            Reply::TooConcave => return Err(too_concave(name, count)),
        }
    }
    Ok(opened.check_unchanged()?)
}

/// Reads the records of a file of faces.
struct Records<'a> {
    file: &'a LargeFile,
    scan: Scan<'a>,
}

impl Records<'_> {
    fn bytes(&mut self, count: usize) -> Result<&[u8], ReadError> {
        let changed = || ReadError::Changed { name: self.file.name().to_owned() };
        self.scan.take(count)?.ok_or_else(changed)
    }

    fn word(&mut self) -> Result<u32, ReadError> {
        let mut word = [0; 4];
        word.copy_from_slice(self.bytes(4)?);
        Ok(u32::from_le_bytes(word))
    }

    fn part(&mut self, part: &mut Part) -> Result<(), ReadError> {
        let (low, high) = (self.word()?, self.word()?);
        part.object = u64::from(low) | u64::from(high) << 32;
        part.material = self.word()?;
        let length = self.word()? as usize;
        part.name.clear();
        part.name.push_str(&String::from_utf8_lossy(self.bytes(length)?));
        Ok(())
    }

    fn indices(&mut self, count: usize, indices: &mut Vec<u32>) -> Result<(), ReadError> {
        let bytes = self.bytes(count * 4)?;
        let words = bytes.as_chunks().0.iter().map(|word| u32::from_le_bytes(*word));
        indices.clear();
        indices.extend(words);
        Ok(())
    }
}
