//! Decoding of PNG, JPEG and EXR files, with limits before memory is taken.

use std::io::Cursor;

use exr::prelude::{ReadChannels, ReadLayers};
use image::{DynamicImage, ImageDecoder};
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::super::json::single;
use super::super::scene_file::RADIANCE_MAX;
use super::{Role, SIDE_TEXELS_MAX};
use crate::scene::{Texels, Texture};

/// Decodes a file that may take `room` bytes of memory. Gives also the number of channels that had
/// to be clamped.
///
/// # Errors
/// Says what is wrong and what to do.
pub(super) fn decode(bytes: &[u8], role: Role, room: u64) -> Result<(Texture, usize), String> {
    let (mut texture, mut changed) = match bytes {
        [0x89, b'P', b'N', b'G', ..] => (decode_png(bytes, room)?, 0),
        [0xff, 0xd8, 0xff, ..] => (decode_jpeg(bytes, room)?, 0),
        [0x76, 0x2f, 0x31, 0x01, ..] => (decode_exr(bytes, room)?, 0),
        _ => return Err("is neither PNG, JPEG nor EXR; convert it to one of them".into()),
    };
    if let (Texels::Srgb8(texels), Role::Radiance) = (&texture.texels, role) {
        check_size(texture.width, texture.height, size_of::<[f32; 3]>(), room)?;
        let curve = linear_values(u8::MAX.into());
        let linear = texels.iter().map(|texel| texel.map(|value| curve[usize::from(value)]));
        texture.texels = Texels::Linear(linear.collect());
    }
    if let Texels::Linear(texels) = &mut texture.texels {
        changed = clamp(texels, role);
    }
    Ok((texture, changed))
}

fn check_size(width: u32, height: u32, texel_bytes: usize, room: u64) -> Result<(), String> {
    if width == 0 || height == 0 {
        return Err("has no texels".into());
    }
    if width > SIDE_TEXELS_MAX || height > SIDE_TEXELS_MAX {
        return Err(format!(
            "{width}×{height} texels; make it at most {SIDE_TEXELS_MAX} on a side"
        ));
    }
    if u64::from(width) * u64::from(height) * texel_bytes as u64 > room {
        return Err(format!(
            "{width}×{height} texels do not fit the memory that textures may take together; \
             make some of them smaller"
        ));
    }
    Ok(())
}

fn decode_png(bytes: &[u8], room: u64) -> Result<Texture, String> {
    let corrupt = |cause: image::ImageError| format!("truncated or corrupt PNG: {cause}");
    let decoder = image::codecs::png::PngDecoder::new(Cursor::new(bytes)).map_err(corrupt)?;
    let (width, height) = decoder.dimensions();
    let is_deep = decoder.color_type().bytes_per_pixel() / decoder.color_type().channel_count() > 1;
    let texel_bytes = if is_deep { size_of::<[f32; 3]>() } else { size_of::<[u8; 3]>() };
    check_size(width, height, texel_bytes, room)?;
    let image = DynamicImage::from_decoder(decoder).map_err(corrupt)?;
    let texels = if is_deep {
        let curve = linear_values(u16::MAX.into());
        let texel = |pixel: &image::Rgb<u16>| pixel.0.map(|value| curve[usize::from(value)]);
        Texels::Linear(image.into_rgb16().pixels().map(texel).collect())
    } else {
        Texels::Srgb8(image.into_rgb8().pixels().map(|pixel| pixel.0).collect())
    };
    Ok(Texture { name: String::new(), width, height, texels })
}

fn decode_jpeg(bytes: &[u8], room: u64) -> Result<Texture, String> {
    let corrupt = |cause| format!("truncated or corrupt JPEG: {cause:?}");
    if !bytes.windows(2).any(|pair| pair == [0xff, 0xd9]) {
        return Err("truncated JPEG: its end is missing".into());
    }
    let side = SIDE_TEXELS_MAX as usize;
    let options = DecoderOptions::default()
        .set_max_width(side)
        .set_max_height(side)
        .set_strict_mode(true)
        .jpeg_set_out_colorspace(ColorSpace::RGB);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(corrupt)?;
    let (width, height) = decoder.dimensions().ok_or("JPEG without dimensions")?;
    let narrow = |side: usize| u32::try_from(side).unwrap_or(u32::MAX);
    let (width, height) = (narrow(width), narrow(height));
    check_size(width, height, size_of::<[u8; 3]>(), room)?;
    let channels = decoder.decode().map_err(corrupt)?;
    let texels = channels.as_chunks::<3>().0.to_vec();
    if texels.len() as u64 != u64::from(width) * u64::from(height) {
        return Err("JPEG in colours that are not read; convert it to RGB".into());
    }
    Ok(Texture { name: String::new(), width, height, texels: Texels::Srgb8(texels) })
}

fn decode_exr(bytes: &[u8], room: u64) -> Result<Texture, String> {
    let corrupt = |cause: exr::error::Error| format!("truncated or corrupt EXR: {cause}");
    let meta = exr::meta::MetaData::read_from_buffered(bytes, false).map_err(corrupt)?;
    let narrow = |side: usize| u32::try_from(side).unwrap_or(u32::MAX);
    for header in &meta.headers {
        let size = header.layer_size;
        check_size(narrow(size.0), narrow(size.1), size_of::<[f32; 3]>(), room)?;
    }
    let rows = |size: exr::math::Vec2<usize>, _: &_| (size.0, vec![[0f32; 3]; size.area()]);
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(rows, |(width, texels), at, (red, green, blue): (f32, f32, f32)| {
            texels[at.1 * *width + at.0] = [red, green, blue];
        })
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(corrupt)?;
    let size = image.layer_data.size;
    Ok(Texture {
        name: String::new(),
        width: narrow(size.0),
        height: narrow(size.1),
        texels: Texels::Linear(image.layer_data.channel_data.pixels.1),
    })
}

/// Makes values finite and within the range of their role; gives the number that were not.
fn clamp(texels: &mut [[f32; 3]], role: Role) -> usize {
    let most = match role {
        Role::Reflectance => 1.0,
        Role::Radiance => single(RADIANCE_MAX),
    };
    let mut changed = 0;
    for channel in texels.as_flattened_mut() {
        if !(0.0..=most).contains(channel) {
            *channel = if channel.is_nan() { 0.0 } else { channel.clamp(0.0, most) };
            changed += 1;
        }
    }
    changed
}

/// The sRGB transfer curve (IEC 61966-2-1), decoded for every integer from 0 to `most`.
fn linear_values(most: u32) -> Vec<f32> {
    let decode = |value: u32| {
        let encoded = f64::from(value) / f64::from(most);
        single(if encoded <= 0.04045 {
            encoded / 12.92
        } else {
            libm::pow((encoded + 0.055) / 1.055, 2.4)
        })
    };
    (0..=most).map(decode).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ROOM: u64 = 1 << 30;

    /// 16×8 texels, red on the left and blue on the right.
    const JPEG: &[u8] = include_bytes!("two.jpg");

    fn encode(image: impl Into<DynamicImage>) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        image.into().write_to(&mut bytes, image::ImageFormat::Png).unwrap();
        bytes.into_inner()
    }

    fn exr(value: f32) -> Vec<u8> {
        let channels = exr::prelude::SpecificChannels::rgb(|at: exr::prelude::Vec2<usize>| {
            (value, at.0 as f32, at.1 as f32)
        });
        let mut bytes = Cursor::new(Vec::new());
        let image = exr::prelude::Image::from_channels((3, 2), channels);
        exr::prelude::WritableImage::write(&image).to_buffered(&mut bytes).unwrap();
        bytes.into_inner()
    }

    fn texels(bytes: &[u8]) -> Texels {
        decode(bytes, Role::Reflectance, ROOM).unwrap().0.texels
    }

    #[test]
    fn grey_alpha_and_depth_are_handled() {
        let rgba = image::RgbaImage::from_pixel(1, 1, image::Rgba([1, 2, 3, 0]));
        assert_eq!(texels(&encode(rgba)), Texels::Srgb8(vec![[1, 2, 3]]));
        let grey = image::GrayAlphaImage::from_pixel(1, 1, image::LumaA([9, 0]));
        assert_eq!(texels(&encode(grey)), Texels::Srgb8(vec![[9; 3]]));
        let deep = image::ImageBuffer::from_pixel(1, 1, image::Rgb([0u16, 65535, 32896]));
        let Texels::Linear(linear) = texels(&encode(deep)) else { panic!() };
        assert_eq!(linear[0][..2], [0.0, 1.0]);
        let half = libm::pow((32896.0 / 65535.0 + 0.055) / 1.055, 2.4);
        assert_eq!(linear[0][2], half as f32);
    }

    #[test]
    fn jpeg_is_decoded_to_the_same_bits_everywhere() {
        let (texture, _) = decode(JPEG, Role::Reflectance, ROOM).unwrap();
        assert_eq!((texture.width, texture.height), (16, 8));
        let Texels::Srgb8(texels) = texture.texels else { panic!() };
        assert_eq!([texels[0], texels[127]], [[200, 40, 40], [20, 60, 220]]);
        let cut = decode(&JPEG[..600], Role::Reflectance, ROOM).unwrap_err();
        assert!(cut.contains("truncated JPEG"), "{cut}");
        let mut cut = JPEG[..600].to_vec();
        cut.extend([0xff, 0xd9]);
        assert!(decode(&cut, Role::Reflectance, ROOM).unwrap_err().contains("JPEG"));
    }

    #[test]
    fn exr_is_linear_and_clamped_by_its_role() {
        let (texture, changed) = decode(&exr(f32::NAN), Role::Radiance, ROOM).unwrap();
        assert_eq!((texture.width, texture.height, changed), (3, 2, 6));
        let Texels::Linear(linear) = texture.texels else { panic!() };
        assert_eq!(linear[5], [0.0, 2.0, 1.0]);
        let Texels::Linear(linear) = texels(&exr(7.0)) else { panic!() };
        assert_eq!(linear[5], [1.0, 1.0, 1.0]);
    }

    #[test]
    fn a_sky_from_eight_bits_is_linear() {
        let image = image::RgbImage::from_pixel(1, 1, image::Rgb([0, 255, 10]));
        let (texture, _) = decode(&encode(image), Role::Radiance, ROOM).unwrap();
        let Texels::Linear(linear) = texture.texels else { panic!() };
        assert_eq!(linear[0][..2], [0.0, 1.0]);
        assert_eq!(linear[0][2], (10.0 / 255.0 / 12.92) as f32);
    }

    #[test]
    fn cut_files_and_bombs_are_refused() {
        let png = encode(image::RgbImage::new(50, 50));
        let message = |bytes: &[u8], room| decode(bytes, Role::Reflectance, room).unwrap_err();
        assert!(message(&png[..png.len() / 2], ROOM).contains("truncated or corrupt PNG"));
        assert!(message(&png, 100).contains("do not fit the memory"));
        let exr = exr(1.0);
        assert!(message(&exr[..exr.len() - 20], ROOM).contains("truncated or corrupt EXR"));
        let mut wide = png.clone();
        wide[16..20].copy_from_slice(&100_000u32.to_be_bytes());
        let error = message(&wide, ROOM);
        assert!(error.contains("PNG") || error.contains("at most"), "{error}");
    }

    proptest! {
        #[test]
        fn changed_files_never_panic(
            which in 0usize..3,
            changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
            length in any::<prop::sample::Index>(),
        ) {
            let png = encode(image::RgbImage::new(9, 9));
            let mut bytes = [png, exr(1.0), JPEG.to_vec()][which].clone();
            for (at, value) in changes {
                let count = bytes.len();
                bytes[at.index(count)] = value;
            }
            let _ = decode(&bytes, Role::Reflectance, ROOM);
            let _ = decode(&bytes[..length.index(bytes.len())], Role::Radiance, ROOM);
        }

        #[test]
        fn arbitrary_bytes_never_panic(
            magic in prop::sample::select(
                vec![&b"\x89PNG\r\n\x1a\n"[..], b"\xff\xd8\xff", b"\x76\x2f\x31\x01"],
            ),
            rest in prop::collection::vec(any::<u8>(), 0..200),
        ) {
            let _ = decode(&[magic, &rest].concat(), Role::Reflectance, ROOM);
        }
    }
}
