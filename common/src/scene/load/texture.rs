//! Textures: each file once, decoded to the form that takes the least memory.
//!
//! A file is told by its first bytes, not by its name. What is decoded is the same on every
//! machine: PNG and EXR are exact, and JPEG is decoded by scalar code alone, because vector code
//! that rounds otherwise on one processor would change the image.

mod decode;

use std::collections::BTreeMap;

use super::warnings::Warnings;
use crate::scene::error::{Place, SceneError};
use crate::scene::files::{FileSource, beside};
use crate::scene::{Texels, Texture};

/// Most texels along a side: what common programs and graphics cards take.
const SIDE_TEXELS_MAX: u32 = 16_384;

/// Most memory that all textures of a scene may take together, so that a few small files cannot
/// unfold into more than a machine has.
const TEXTURES_BYTES_MAX: u64 = 1 << 33;

/// An image file as some line refers to it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct TextureRef {
    /// The name as written, relative to the file that names it.
    pub(super) file: String,
    /// The line that names it.
    pub(super) place: Place,
}

/// What a texture is used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Role {
    /// Fractions of light, 0 to 1.
    Reflectance,
    /// Light, any amount; always linear.
    Radiance,
}

/// The textures read so far.
#[derive(Debug, Default)]
pub(super) struct TextureTable {
    textures: Vec<Texture>,
    indices: BTreeMap<(String, Role), u32>,
    bytes: u64,
}

impl TextureTable {
    /// The texture's index; reads the file if that has not been done.
    pub(super) fn index_of(
        &mut self,
        files: &dyn FileSource,
        reference: &TextureRef,
        role: Role,
        warnings: &mut Warnings,
    ) -> Result<u32, SceneError> {
        let place = &reference.place;
        let name = beside(&place.file, &reference.file);
        let key = (name, role);
        if let Some(&index) = self.indices.get(&key) {
            return Ok(index);
        }
        let name = &key.0;
        let unreachable = |cause| SceneError::Unreachable { place: place.clone(), cause };
        let invalid = |problem| SceneError::InvalidTexture {
            place: place.clone(),
            file: name.clone(),
            problem,
        };
        let bytes = files.read(name).map_err(unreachable)?;
        let room = TEXTURES_BYTES_MAX - self.bytes;
        let (mut texture, changed) = decode::decode(&bytes, role, room).map_err(invalid)?;
        texture.name.clone_from(name);
        if changed > 0 {
            warnings.push(format!(
                "{place}: texture \"{name}\": {changed} values were not finite or out of range \
                 and are clamped"
            ));
        }
        self.bytes += byte_count(&texture);
        self.textures.push(texture);
        let index = u32::try_from(self.textures.len() - 1).map_err(|_| SceneError::TooLarge {
            place: place.clone(),
            problem: "too many textures".into(),
        })?;
        self.indices.insert(key, index);
        Ok(index)
    }

    /// All textures by their indices.
    pub(super) fn into_textures(self) -> Vec<Texture> {
        self.textures
    }
}

/// The memory that a texture takes.
pub(in crate::scene) fn byte_count(texture: &Texture) -> u64 {
    let bytes = match &texture.texels {
        Texels::Srgb8(texels) => size_of_val(texels.as_slice()),
        Texels::Linear(texels) => size_of_val(texels.as_slice()),
    };
    bytes as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::files::Pack;

    fn png() -> Vec<u8> {
        let mut bytes = std::io::Cursor::new(Vec::new());
        let image = image::RgbImage::from_pixel(2, 1, image::Rgb([255, 128, 0]));
        image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
        bytes.into_inner()
    }

    fn read(file: &str) -> (Result<u32, SceneError>, TextureTable) {
        let cut = png()[..40].to_vec();
        let files = [("t/a.png", png()), ("t/cut.png", cut), ("t/b.png", b"GIF89a".to_vec())];
        let pack = Pack::from_files(files.map(|(name, bytes)| (name.to_owned(), bytes))).unwrap();
        let mut table = TextureTable::default();
        let reference = TextureRef { file: file.into(), place: Place::line("m/a.mtl", 3) };
        let role = Role::Reflectance;
        let first = table.index_of(&pack, &reference, role, &mut Warnings::default());
        let again = table.index_of(&pack, &reference, role, &mut Warnings::default());
        assert_eq!(first.as_ref().ok(), again.as_ref().ok());
        (first, table)
    }

    #[test]
    fn a_file_is_read_once() {
        let (index, table) = read("..\\t\\a.png");
        assert_eq!((index.unwrap(), table.textures.len(), table.bytes), (0, 1, 6));
        assert_eq!(table.textures[0].name, "t/a.png");
    }

    #[test]
    fn bad_files_are_named_together_with_the_line() {
        let error = |file: &str| read(file).0.unwrap_err().to_string();
        assert!(error("../t/none.png").starts_with("m/a.mtl:3: t/none.png: no such file"));
        assert!(error("../t/cut.png").starts_with("m/a.mtl:3: texture \"t/cut.png\": "));
        assert!(error("../t/b.png").contains("is neither PNG, JPEG nor EXR"));
    }
}
