//! PNG files: the beauty layer as one sees it.

use std::io::Cursor;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use super::{Image, ImageError};

/// Up to here the tone curve changes nothing.
const KNEE: f64 = 0.5;

/// The tone curve: linear radiance to a linear fraction of white.
///
/// Up to ½ it is the identity, so that what is not bright looks as in any other viewer; above, it
/// bends over smoothly and nears 1 as radiance nears infinity, so that highlights keep their shape:
/// ½ + ½·t/(1 + t) with t = (x − ½)/½. It has one slope at the knee, takes no exponential or
/// power, and acts on each channel alone, so that bright colours turn white, as on photographs.
#[must_use]
pub fn tone(radiance: f64) -> f64 {
    // The maximum of NaN and a number is the number: NaN counts as black.
    let radiance = radiance.max(0.0);
    if radiance <= KNEE {
        return radiance;
    }
    let excess = (radiance - KNEE) / (1.0 - KNEE);
    if excess.is_infinite() { 1.0 } else { KNEE + (1.0 - KNEE) * (excess / (1.0 + excess)) }
}

pub(super) fn encode(image: &Image) -> Result<Vec<u8>, ImageError> {
    let pixels: Vec<u8> =
        image.beauty.as_flattened().iter().map(|&value| srgb(tone(f64::from(value)))).collect();
    let mut bytes = Cursor::new(Vec::new());
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Default, FilterType::Adaptive)
        .write_image(&pixels, image.width, image.height, ExtendedColorType::Rgb8)
        .map_err(|error| ImageError::Encoding { format: "PNG", problem: error.to_string() })?;
    Ok(bytes.into_inner())
}

/// The sRGB transfer curve (IEC 61966-2-1) in 8 bits.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the tone curve gives 0 to 1"
)]
fn srgb(linear: f64) -> u8 {
    let encoded = if linear <= 0.003_130_8 {
        linear * 12.92
    } else {
        1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055
    };
    (encoded * 255.0 + 0.5).floor() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_rises_from_black_to_white_without_a_kink() {
        let curve: Vec<f64> = (0..4000).map(|step| tone(f64::from(step) / 1000.0)).collect();
        assert_eq!(curve[200], 0.2);
        assert_eq!(tone(1.0), 0.75);
        assert!(curve.windows(2).all(|pair| pair[0] < pair[1] && pair[1] < 1.0));
        let slopes: Vec<f64> = curve.windows(2).map(|pair| pair[1] - pair[0]).collect();
        assert!(slopes.windows(2).all(|pair| (pair[0] - pair[1]).abs() < 1e-5));
        assert_eq!([f64::NAN, -1.0, f64::INFINITY, f64::MAX].map(tone), [0.0, 0.0, 1.0, 1.0]);
    }

    #[test]
    fn pixels_are_encoded_in_srgb() {
        assert_eq!([0.0, 1.0, 0.215_860_5].map(srgb), [0, 255, 128]);
        let mut image = Image::black(2, 1);
        image.beauty[1] = [0.215_860_5, f32::INFINITY, f32::NAN];
        let bytes = encode(&image).unwrap();
        let decoded = image::load_from_memory(&bytes).unwrap().into_rgb8();
        assert_eq!(decoded.into_raw(), [0, 0, 0, 128, 255, 0]);
        assert_eq!(bytes, encode(&image).unwrap());
    }
}
