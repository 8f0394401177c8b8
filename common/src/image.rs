//! The image: what a film is developed into, and the files that it is written to.
//!
//! Sums become means in double precision, pixel by pixel, in a fixed order; files hold nothing that
//! differs from run to run. So equal films give equal files.

mod exr;
mod file;
mod png;

use std::io;
use std::path::PathBuf;

pub use file::write_atomically;

use crate::film::{PixelSums, TileSums, depth_from_fixed, from_fixed};
use crate::job::Settings;

/// A developed image with all its layers, row by row from the top.
///
/// Pixels that no sample fell into are black; their depth is infinite.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Mean radiance of all samples (W·m⁻²·sr⁻¹ per channel).
    pub beauty: Vec<[f32; 3]>,
    /// Mean radiance of the samples with even numbers.
    pub half_a: Vec<[f32; 3]>,
    /// Mean radiance of the samples with odd numbers.
    pub half_b: Vec<[f32; 3]>,
    /// Mean albedo at the first hit, over all samples: one that hit nothing counts as black.
    pub albedo: Vec<[f32; 3]>,
    /// Mean shading normal at the first hit, over all samples; not of unit length at edges.
    pub normal: Vec<[f32; 3]>,
    /// Mean depth of the samples that hit something; infinite where none did.
    pub depth: Vec<f32>,
    /// Samples taken.
    pub samples: Vec<f32>,
}

/// An image that cannot be made into a file.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The encoder refused it.
    #[error("cannot encode the image as {format}: {problem}")]
    Encoding {
        /// `EXR` or `PNG`.
        format: &'static str,
        /// What the encoder says.
        problem: String,
    },
    /// The directory that the file is to lie in does not exist.
    #[error("{}: its directory does not exist; create it first", .path.display())]
    NoDirectory {
        /// The file.
        path: PathBuf,
    },
    /// There is a directory of that name.
    #[error("{}: is a directory; name a file in it", .path.display())]
    IsDirectory {
        /// The name.
        path: PathBuf,
    },
    /// The operating system said no.
    #[error("{}: cannot be written: {cause}", .path.display())]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: io::Error,
    },
}

impl Image {
    /// Develops a film. Where the film covers a part of the image only, the rest stays black.
    ///
    /// # Panics
    /// If the film reaches beyond the image; only a bug can make one.
    #[must_use]
    pub fn develop(film: &TileSums, settings: &Settings) -> Self {
        let (tile, width) = (film.tile, settings.width as usize);
        assert!(
            tile.x1 <= settings.width && tile.y1 <= settings.height,
            "the film {tile:?} lies within {}×{}",
            settings.width,
            settings.height
        );
        let mut image = Self::black(settings.width, settings.height);
        let columns = tile.width() as usize;
        for (row, pixels) in film.pixels.chunks_exact(columns.max(1)).enumerate() {
            let start = (tile.y0 as usize + row) * width + tile.x0 as usize;
            for (column, sums) in pixels.iter().enumerate() {
                image.set(start + column, sums);
            }
        }
        image
    }

    fn black(width: u32, height: u32) -> Self {
        let count = width as usize * height as usize;
        let layer = || vec![[0.0; 3]; count];
        Self {
            width,
            height,
            beauty: layer(),
            half_a: layer(),
            half_b: layer(),
            albedo: layer(),
            normal: layer(),
            depth: vec![f32::INFINITY; count],
            samples: vec![0.0; count],
        }
    }

    fn set(&mut self, index: usize, sums: &PixelSums) {
        let samples = sums.even_samples.saturating_add(sums.odd_samples);
        let both = std::array::from_fn(|channel| {
            mean(from_fixed(sums.even[channel]) + from_fixed(sums.odd[channel]), samples)
        });
        let layer = |sums: [i64; 3], count| sums.map(|sum| mean(from_fixed(sum), count));
        self.beauty[index] = both;
        self.half_a[index] = layer(sums.even, sums.even_samples);
        self.half_b[index] = layer(sums.odd, sums.odd_samples);
        self.albedo[index] = layer(sums.albedo, samples);
        self.normal[index] = layer(sums.normal, samples);
        if sums.hits > 0 {
            self.depth[index] = mean(depth_from_fixed(sums.depth), sums.hits);
        }
        self.samples[index] = single(samples as f64);
    }

    /// How noisy the beauty layer is: the standard error of its channels, root mean square over
    /// the image, relative to the mean radiance.
    ///
    /// The two halves are independent estimates of the same image, so half their difference is a
    /// draw of the error of their mean: noise = √⟨((A − B) / 2)²⟩ / ⟨beauty⟩, over the pixels that
    /// have samples in both halves. Infinite if there is no such pixel; 0 if they are black.
    #[must_use]
    pub fn noise(&self) -> f64 {
        let (mut squares, mut radiance, mut count) = (0.0, 0.0, 0u64);
        for index in 0..self.beauty.len() {
            if self.samples[index] < 2.0 {
                continue;
            }
            for channel in 0..3 {
                let [a, b, both] = [&self.half_a, &self.half_b, &self.beauty]
                    .map(|layer| f64::from(layer[index][channel]));
                squares += ((a - b) / 2.0) * ((a - b) / 2.0);
                radiance += both;
                count += 1;
            }
        }
        match count {
            0 => f64::INFINITY,
            _ if radiance == 0.0 => 0.0,
            _ => (squares / count as f64).sqrt() / (radiance / count as f64),
        }
    }

    /// The image as an EXR file: one part with 32-bit float channels `R G B`, `albedo.R` … ,
    /// `N.X` …, `Z`, `samples`, `halfA.R` …, `halfB.R` …, losslessly compressed.
    ///
    /// # Errors
    /// If the encoder refuses it.
    pub fn to_exr(&self) -> Result<Vec<u8>, ImageError> {
        exr::encode(self)
    }

    /// The beauty layer as an 8-bit PNG file, through the tone curve of [`tone`].
    ///
    /// # Errors
    /// If the encoder refuses it.
    pub fn to_png(&self) -> Result<Vec<u8>, ImageError> {
        png::encode(self)
    }
}

pub use png::tone;

fn mean(sum: f64, count: i64) -> f32 {
    if count > 0 { single(sum / count as f64) } else { 0.0 }
}

#[expect(clippy::cast_possible_truncation, reason = "rounding to the precision of the image")]
const fn single(value: f64) -> f32 {
    value as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Features;
    use crate::job::{Filter, PerDepth};
    use crate::unit::Rect;

    fn settings() -> Settings {
        Settings {
            width: 4,
            height: 3,
            crop: None,
            filter: Filter::Box,
            samples_per_pixel: 3,
            max_depth: 1,
            light_samples: PerDepth::default(),
            indirect_samples: PerDepth::default(),
            roulette_depth: None,
            seed: 0,
        }
    }

    fn film() -> TileSums {
        let mut film = TileSums::new(Rect { x0: 1, y0: 1, x1: 3, y1: 3 });
        for (sample, radiance) in [(0, 1.0), (1, 4.0), (2, 4.0)] {
            film.add_sample(3, sample);
            film.add_radiance(3, sample, [radiance, 0.0, 2.0 * radiance]);
        }
        let features = Features { albedo: [0.75; 3], normal: [0.0, 0.0, 1.0], depth: 6.0 };
        film.add_features(3, &features);
        film.add_features(3, &Features { depth: 3.0, ..features });
        film
    }

    #[test]
    fn sums_become_means_at_their_place_in_the_frame() {
        let image = Image::develop(&film(), &settings());
        let at = 2 * 4 + 2;
        assert_eq!(image.beauty[at], [3.0, 0.0, 6.0]);
        assert_eq!(image.half_a[at], [2.5, 0.0, 5.0]);
        assert_eq!(image.half_b[at], [4.0, 0.0, 8.0]);
        assert_eq!(image.albedo[at], [0.5; 3]);
        assert_eq!(image.normal[at], [0.0, 0.0, (2.0f64 / 3.0) as f32]);
        assert_eq!((image.depth[at], image.samples[at]), (4.5, 3.0));
        assert_eq!(
            (image.depth[0], image.samples[0], image.beauty[0]),
            (f32::INFINITY, 0.0, [0.0; 3])
        );
    }

    #[test]
    fn noise_is_the_relative_error_that_the_halves_show() {
        let mut image = Image::black(2, 1);
        assert_eq!(image.noise(), f64::INFINITY);
        image.samples = vec![2.0, 0.0];
        assert_eq!(image.noise(), 0.0);
        (image.half_a[0], image.half_b[0], image.beauty[0]) = ([3.0; 3], [5.0; 3], [4.0; 3]);
        assert_eq!(image.noise(), 0.25);
    }

    #[test]
    #[should_panic(expected = "lies within")]
    fn a_film_beyond_the_frame_is_a_bug() {
        let _ = Image::develop(&film(), &Settings { width: 2, ..settings() });
    }
}
