//! The file of a texture: its texels as they lie in memory, and nothing else; what they mean is
//! said in the manifest.

use std::io::{self, Write};
use std::path::Path;

use equilux_common::scene::{Texels, Texture};

use crate::checksum::HashedFile;
use crate::error::StoreError;
use crate::manifest::{FileEntry, TexelKind, TextureEntry};

/// Writes the texels to a file that must not be there yet, and is called `name` in the store.
pub(crate) fn write(path: &Path, name: String, texture: &Texture) -> io::Result<TextureEntry> {
    let mut file = HashedFile::create(path)?;
    let kind = match &texture.texels {
        Texels::Srgb8(texels) => {
            file.write_all(texels.as_flattened())?;
            TexelKind::Srgb8
        }
        Texels::Linear(texels) => {
            for row in texels.chunks(texture.width.max(1) as usize) {
                let bytes = row.as_flattened().iter().flat_map(|channel| channel.to_le_bytes());
                file.write_all(&bytes.collect::<Vec<u8>>())?;
            }
            TexelKind::Linear
        }
    };
    let (hash, bytes) = file.finish()?;
    Ok(TextureEntry {
        name: texture.name.clone(),
        width: texture.width,
        height: texture.height,
        kind,
        file: FileEntry { name, hash, bytes },
    })
}

/// Takes the file's bytes, whose hash and number are right.
pub(crate) fn decode(
    name: &str,
    bytes: &[u8],
    entry: &TextureEntry,
) -> Result<Texture, StoreError> {
    let texels = match entry.kind {
        TexelKind::Srgb8 => Texels::Srgb8(bytes.as_chunks().0.to_vec()),
        TexelKind::Linear => {
            let channels: Vec<f32> =
                bytes.as_chunks().0.iter().copied().map(f32::from_le_bytes).collect();
            if !channels.iter().all(|channel| channel.is_finite()) {
                let problem = "has texels that are no numbers; build the store again".to_owned();
                return Err(StoreError::Malformed { file: name.to_owned(), problem });
            }
            Texels::Linear(channels.as_chunks().0.to_vec())
        }
    };
    Ok(Texture { name: entry.name.clone(), width: entry.width, height: entry.height, texels })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texels_come_back_to_the_bit() {
        let home = tempfile::tempdir().unwrap();
        let srgb = Texels::Srgb8(vec![[0, 127, 255]; 6]);
        let linear = Texels::Linear(vec![[0.1, -0.0, 1e30]; 6]);
        for (number, texels) in [srgb, linear].into_iter().enumerate() {
            let texture = Texture { name: "wood.png".into(), width: 3, height: 2, texels };
            let path = home.path().join(format!("{number}"));
            let entry = write(&path, "t".into(), &texture).unwrap();
            let mut bytes = std::fs::read(&path).unwrap();
            entry.file.check("t", &bytes).unwrap();
            let read = decode("t", &bytes, &entry).unwrap();
            assert_eq!(format!("{read:?}"), format!("{texture:?}"));
            bytes[4] ^= 1;
            assert!(entry.file.check("t", &bytes).is_err());
        }
    }

    #[test]
    fn what_is_no_number_is_refused() {
        let home = tempfile::tempdir().unwrap();
        let texels = Texels::Linear(vec![[0.0, f32::NAN, 0.0]]);
        let texture = Texture { name: "sky".into(), width: 1, height: 1, texels };
        let path = home.path().join("t");
        let entry = write(&path, "t".into(), &texture).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        assert!(matches!(decode("t", &bytes, &entry), Err(StoreError::Malformed { .. })));
    }
}
