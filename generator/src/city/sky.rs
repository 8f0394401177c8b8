//! The sky late on a clear day, as an EXR image in latitude and longitude: a warm low sun in a
//! haze, blue above, thin clouds.
//!
//! The sun is some texels of the image, which renderers sample by their brightness. It is a few
//! times as wide as the real one, as behind a thin haze, so that shadows have soft edges.
//!
//! The image is written without compression, after the OpenEXR file layout
//! (<https://openexr.com/en/latest/OpenEXRFileLayout.html>): a header of attributes, an offset per
//! line, and lines with one channel after the other in alphabetical order.

use crate::vector::{Vector, vector};

/// Its name in the scene's directory.
pub(super) const FILE: &str = "sky.exr";

/// Texels from left to right and from top to bottom.
const SIZE: (u32, u32) = (512, 256);

/// Towards the sun, before it is made a unit vector: behind the camera's left shoulder.
const SUN: Vector = vector(-0.78, 0.47, 0.5);
/// Cosine of the sun's angular radius: 0.9 degrees, so that it has a handful of texels.
const SUN_COSINE: f64 = 0.999_877;
/// Radiance of the sun.
const SUN_RADIANCE: [f64; 3] = [7400.0, 5300.0, 3200.0];

const ZENITH: [f64; 3] = [0.1, 0.2, 0.44];
const HORIZON: [f64; 3] = [0.62, 0.6, 0.6];
/// Added around the sun.
const GLOW: [f64; 3] = [0.95, 0.55, 0.24];
const CLOUD: [f64; 3] = [0.86, 0.68, 0.56];
const BELOW: [f64; 3] = [0.1, 0.095, 0.09];

/// The file.
pub(super) fn exr() -> Vec<u8> {
    let (width, height) = SIZE;
    let mut file = header();
    let line_bytes = 4 * 3 * width;
    let first = file.len() as u64 + 8 * u64::from(height);
    for row in 0..height {
        let offset = first + u64::from(row) * u64::from(line_bytes + 8);
        file.extend(offset.to_le_bytes());
    }
    for row in 0..height {
        file.extend(row.to_le_bytes());
        file.extend(line_bytes.to_le_bytes());
        let line: Vec<[f64; 3]> = (0..width).map(|column| texel(column, row)).collect();
        for channel in [2, 1, 0] {
            line.iter().for_each(|color| file.extend((color[channel] as f32).to_le_bytes()));
        }
    }
    file
}

fn header() -> Vec<u8> {
    let mut bytes = vec![0x76, 0x2F, 0x31, 0x01, 2, 0, 0, 0];
    let mut attribute = |name: &str, kind: &str, value: &[u8]| {
        for text in [name, kind] {
            bytes.extend(text.as_bytes());
            bytes.push(0);
        }
        bytes.extend((value.len() as u32).to_le_bytes());
        bytes.extend(value);
    };
    // A channel: its name, 2 for 32-bit floats, four bytes that say nothing, and no subsampling.
    let mut channels: Vec<u8> = ["B", "G", "R"]
        .into_iter()
        .flat_map(|name| [name.as_bytes()[0], 0, 2, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0])
        .collect();
    channels.push(0);
    let window = [0, 0, SIZE.0 - 1, SIZE.1 - 1].map(u32::to_le_bytes).concat();
    let one = 1.0_f32.to_le_bytes();
    attribute("channels", "chlist", &channels);
    attribute("compression", "compression", &[0]);
    attribute("dataWindow", "box2i", &window);
    attribute("displayWindow", "box2i", &window);
    attribute("lineOrder", "lineOrder", &[0]);
    attribute("pixelAspectRatio", "float", &one);
    attribute("screenWindowCenter", "v2f", &[0; 8]);
    attribute("screenWindowWidth", "float", &one);
    bytes.push(0);
    bytes
}

/// Radiance from the middle of a texel: the image's middle is towards −z, its right half +x.
fn texel(column: u32, row: u32) -> [f64; 3] {
    let part = |index: u32, count: u32| (f64::from(index) + 0.5) / f64::from(count);
    let (sin, cos) = libm::sincos((part(column, SIZE.0) - 0.5) * 2.0 * std::f64::consts::PI);
    let (ring, up) = libm::sincos(part(row, SIZE.1) * std::f64::consts::PI);
    radiance(vector(sin * ring, up, -cos * ring))
}

fn radiance(towards: Vector) -> [f64; 3] {
    let cosine = towards.dot(SUN.normalized());
    if cosine > SUN_COSINE {
        return SUN_RADIANCE;
    }
    if towards.y < 0.0 {
        return mix(HORIZON, BELOW, (-towards.y * 12.0).min(1.0));
    }
    let clear = 1.0 - towards.y;
    let clear = mix(ZENITH, HORIZON, clear * clear * clear);
    let near = (0.5 + 0.5 * cosine).max(0.0);
    let glow = near * near * near * (0.25 + 0.75 * near * near * near * near);
    let lit: [f64; 3] = std::array::from_fn(|channel| clear[channel] + glow * GLOW[channel]);
    mix(lit, CLOUD.map(|channel| channel * (0.75 + 0.6 * glow)), cloudiness(towards))
}

/// How much of the sky is cloud in a direction: bands on a plane high above.
fn cloudiness(towards: Vector) -> f64 {
    let scale = 1.0 / (towards.y + 0.08);
    let (x, z) = (towards.x * scale * 0.9, towards.z * scale * 1.7);
    let octave = |factor: f64| noise(x * factor + 3.7, z * factor - 1.9) / factor;
    let density = octave(1.0) + octave(2.0) + octave(4.0) + octave(8.0);
    ((density - 0.95) * 1.5).clamp(0.0, 0.72) * (towards.y * 9.0).min(1.0)
}

/// Smooth noise between 0 and 1.
fn noise(x: f64, z: f64) -> f64 {
    let (left, near) = (x.floor(), z.floor());
    let ease = |t: f64| t * t * (3.0 - 2.0 * t);
    let (u, v) = (ease(x - left), ease(z - near));
    let lattice = |dx: f64, dz: f64| {
        let key = |coordinate: f64| (coordinate + 4096.0) as u64;
        crate::random::Random::new(0xC10D, key(left + dx) << 16 | key(near + dz)).unit()
    };
    let along = |dz: f64| lattice(0.0, dz) * (1.0 - u) + lattice(1.0, dz) * u;
    along(0.0) * (1.0 - v) + along(1.0) * v
}

fn mix(from: [f64; 3], to: [f64; 3], part: f64) -> [f64; 3] {
    std::array::from_fn(|channel| from[channel] * (1.0 - part) + to[channel] * part)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sun_has_some_texels_above_the_horizon_and_all_texels_are_finite() {
        let mut sun_count = 0;
        for row in 0..SIZE.1 {
            for column in 0..SIZE.0 {
                let color = texel(column, row);
                assert!(color.iter().all(|c| c.is_finite() && *c > 0.0), "{column}, {row}");
                sun_count += u32::from(color == SUN_RADIANCE);
                assert!(color != SUN_RADIANCE || row < SIZE.1 / 2);
            }
        }
        assert!((4..=12).contains(&sun_count), "{sun_count}");
    }

    #[test]
    fn lines_are_where_the_offsets_say() {
        let file = exr();
        let first = header().len();
        let offset = |row: usize| {
            let at = first + 8 * row;
            u64::from_le_bytes(file[at..at + 8].try_into().unwrap()) as usize
        };
        for row in [0, 1, 255] {
            assert_eq!(file[offset(row)..][..4], (row as u32).to_le_bytes());
        }
        assert_eq!(file.len(), offset(255) + 8 + 512 * 12);
    }
}
