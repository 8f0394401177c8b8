//! The film: sums of contributions in fixed point, so that no order of adding can change a bit.
//!
//! A contribution is rounded once, to a multiple of 2⁻³² (depth: 2⁻²⁴), and added as an integer.
//! Integer addition is associative and commutative, so any number of workers may add in any order
//! and merge in any way. A channel of one contribution is limited to ±2²⁰ and a sum to ±2³¹ (depth:
//! 2³⁹ both); what exceeds a limit is clamped and counted.
//!
//! Why sums that clamp still have no order: radiance, albedo and depth are never negative, so a
//! saturated sum stays saturated; normals are at most 1, and 2³¹ samples of them do not fit a job.

use bytemuck::{Pod, Zeroable};

use crate::unit::Rect;

/// One unit of radiance, albedo or normal in the film.
const ONE: f64 = 4_294_967_296.0;

/// One scene unit of depth in the film.
const ONE_DEPTH: f64 = 16_777_216.0;

/// Largest magnitude of one channel of one contribution (about 10⁶).
pub const CONTRIBUTION_MAX: f64 = 1_048_576.0;

/// Largest depth of one contribution.
const DEPTH_MAX: f64 = 549_755_813_888.0;

/// What one pixel has gathered. 16 integers, in the order of the wire.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct PixelSums {
    /// Radiance of samples with even numbers, per channel.
    pub even: [i64; 3],
    /// Radiance of samples with odd numbers, per channel.
    pub odd: [i64; 3],
    /// Albedo at the first hit, per channel.
    pub albedo: [i64; 3],
    /// Shading normal at the first hit, in world space.
    pub normal: [i64; 3],
    /// Depth of the first hit along the camera's axis.
    pub depth: i64,
    /// Camera samples with even numbers.
    pub even_samples: i64,
    /// Camera samples with odd numbers.
    pub odd_samples: i64,
    /// Camera samples that hit something.
    pub hits: i64,
}

/// Number of integers in [`PixelSums`].
pub const PIXEL_SUMS: usize = size_of::<PixelSums>() / size_of::<i64>();

impl PixelSums {
    /// The sums as plain integers.
    #[must_use]
    pub fn as_array(&self) -> &[i64; PIXEL_SUMS] {
        bytemuck::cast_ref(self)
    }

    /// The sums from plain integers.
    #[must_use]
    pub fn from_array(array: [i64; PIXEL_SUMS]) -> Self {
        bytemuck::cast(array)
    }

    fn merge(&mut self, other: &Self) {
        let sums: &mut [i64; PIXEL_SUMS] = bytemuck::cast_mut(self);
        for (sum, addend) in sums.iter_mut().zip(other.as_array()) {
            *sum = sum.saturating_add(*addend);
        }
    }
}

/// What the camera sees first through a sample: the feature layers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Features {
    /// Fraction of light reflected, per channel.
    pub albedo: [f32; 3],
    /// Shading normal, unit length, world space, on the camera's side.
    pub normal: [f32; 3],
    /// Distance along the camera's axis.
    pub depth: f32,
}

/// The film values of some pixels: of a unit's tile, or of the whole image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TileSums {
    /// Which pixels.
    pub tile: Rect,
    /// Their sums, row by row.
    pub pixels: Vec<PixelSums>,
    /// Channels of contributions that were clamped.
    pub saturated: u64,
    /// Contributions that were not finite and were left out.
    pub invalid: u64,
}

impl TileSums {
    /// Nothing gathered yet for the pixels of `tile`.
    #[must_use]
    pub fn new(tile: Rect) -> Self {
        let pixels = vec![PixelSums::zeroed(); tile.pixel_count()];
        Self { tile, pixels, saturated: 0, invalid: 0 }
    }

    /// Counts a camera sample of the pixel with row-major position `index` in the tile.
    pub fn add_sample(&mut self, index: usize, sample_index: u32) {
        let pixel = &mut self.pixels[index];
        if sample_index.is_multiple_of(2) {
            pixel.even_samples += 1;
        } else {
            pixel.odd_samples += 1;
        }
    }

    /// Adds a contribution (W·m⁻²·sr⁻¹ per channel) to a pixel.
    pub fn add_radiance(&mut self, index: usize, sample_index: u32, radiance: [f32; 3]) {
        let Some(fixed) = self.fixed(radiance) else { return };
        let pixel = &mut self.pixels[index];
        let sums = if sample_index.is_multiple_of(2) { &mut pixel.even } else { &mut pixel.odd };
        add(sums, fixed);
    }

    /// Adds what a camera sample saw first.
    pub fn add_features(&mut self, index: usize, features: &Features) {
        let albedo = self.fixed(features.albedo);
        let normal = self.fixed(features.normal);
        let (Some(albedo), Some(normal), true) = (albedo, normal, features.depth.is_finite())
        else {
            return;
        };
        let depth = f64::from(features.depth);
        self.saturated += u64::from(depth.abs() > DEPTH_MAX);
        let pixel = &mut self.pixels[index];
        add(&mut pixel.albedo, albedo);
        add(&mut pixel.normal, normal);
        let fixed_depth = round(depth.clamp(-DEPTH_MAX, DEPTH_MAX) * ONE_DEPTH);
        pixel.depth = pixel.depth.saturating_add(fixed_depth);
        pixel.hits += 1;
    }

    /// Adds what `other` gathered; its pixels must all lie in this tile.
    pub fn merge(&mut self, other: &Self) {
        let width = other.tile.width() as usize;
        for (row, source) in other.pixels.chunks_exact(width).enumerate() {
            let y = other.tile.y0 + u32::try_from(row).expect("rows are counted in 32 bits");
            let start = self.tile.index_of(other.tile.x0, y);
            for (pixel, addend) in self.pixels[start..start + width].iter_mut().zip(source) {
                pixel.merge(addend);
            }
        }
        self.saturated = self.saturated.saturating_add(other.saturated);
        self.invalid = self.invalid.saturating_add(other.invalid);
    }

    /// Only the rows from the first to the last in which something was gathered; the first row if
    /// there is none.
    #[must_use]
    pub fn cropped(mut self) -> Self {
        let width = self.tile.width() as usize;
        let is_touched = |row: &[PixelSums]| row.iter().any(|pixel| *pixel != PixelSums::zeroed());
        let rows = || self.pixels.chunks_exact(width).map(is_touched);
        let first = rows().position(|is_touched| is_touched).unwrap_or(0);
        let last = rows().rposition(|is_touched| is_touched).unwrap_or(0);
        let row = |row: usize| u32::try_from(row).expect("rows are counted in 32 bits");
        let (y0, y1) = (self.tile.y0 + row(first), self.tile.y0 + row(last) + 1);
        self.pixels.truncate((last + 1) * width);
        self.pixels.drain(..first * width);
        Self { tile: Rect { y0, y1, ..self.tile }, ..self }
    }

    /// The same values among the pixels of a tile that contains theirs.
    #[must_use]
    pub fn widened(self, tile: Rect) -> Self {
        if self.tile == tile {
            return self;
        }
        let mut wide = Self::new(tile);
        wide.merge(&self);
        wide
    }

    fn fixed(&mut self, channels: [f32; 3]) -> Option<[i64; 3]> {
        if !channels.iter().all(|channel| channel.is_finite()) {
            self.invalid += 1;
            return None;
        }
        Some(channels.map(|channel| {
            let value = f64::from(channel);
            self.saturated += u64::from(value.abs() > CONTRIBUTION_MAX);
            round(value.clamp(-CONTRIBUTION_MAX, CONTRIBUTION_MAX) * ONE)
        }))
    }
}

/// Radiance, albedo or normal as a number again.
#[must_use]
pub const fn from_fixed(sum: i64) -> f64 {
    sum as f64 / ONE
}

/// Depth as a number again.
#[must_use]
pub const fn depth_from_fixed(sum: i64) -> f64 {
    sum as f64 / ONE_DEPTH
}

fn add(sums: &mut [i64; 3], addends: [i64; 3]) {
    for (sum, addend) in sums.iter_mut().zip(addends) {
        *sum = sum.saturating_add(addend);
    }
}

#[expect(clippy::cast_possible_truncation, reason = "the limits above keep it within 64 bits")]
const fn round(value: f64) -> i64 {
    value.round_ties_even() as i64
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TILE: Rect = Rect { x0: 0, y0: 0, x1: 3, y1: 2 };

    type Contribution = (usize, u32, [f32; 3]);

    fn contributions() -> impl Strategy<Value = Vec<Contribution>> {
        let channel = prop_oneof![0f32..10.0, 0f32..1e-6, 0f32..1e9, Just(f32::NAN)];
        prop::collection::vec(
            (0usize..6, 0u32..4, [channel.clone(), channel.clone(), channel]),
            0..60,
        )
    }

    fn sum<'a>(of: impl IntoIterator<Item = &'a Contribution>) -> TileSums {
        let mut sums = TileSums::new(TILE);
        for &(index, sample_index, radiance) in of {
            sums.add_sample(index, sample_index);
            sums.add_radiance(index, sample_index, radiance);
        }
        sums
    }

    proptest! {
        #[test]
        fn any_order_and_any_partition_give_the_same_sums(
            (given, shuffled) in contributions()
                .prop_flat_map(|c| (Just(c.clone()), Just(c).prop_shuffle())),
            cut in any::<prop::sample::Index>(),
        ) {
            let (left, right) = shuffled.split_at(cut.index(shuffled.len() + 1));
            let mut merged = sum(right);
            merged.merge(&sum(left));
            prop_assert_eq!(merged, sum(&given));
        }
    }

    #[test]
    fn what_exceeds_the_range_is_counted() {
        let mut sums = TileSums::new(TILE);
        sums.add_radiance(0, 0, [2e6, 1.0, f32::NAN]);
        sums.add_radiance(0, 0, [2e6, 1.0, 0.0]);
        assert_eq!((sums.saturated, sums.invalid), (1, 1));
        assert_eq!(from_fixed(sums.pixels[0].even[0]), CONTRIBUTION_MAX);
        assert_eq!(from_fixed(sums.pixels[0].even[1]), 1.0);
    }

    #[test]
    fn a_tile_lands_where_it_belongs() {
        let mut film = TileSums::new(Rect { x0: 0, y0: 0, x1: 4, y1: 4 });
        let mut tile = TileSums::new(Rect { x0: 1, y0: 2, x1: 3, y1: 4 });
        tile.add_radiance(tile.tile.index_of(2, 3), 1, [1.0, 2.0, 3.0]);
        film.merge(&tile);
        assert_eq!(film.pixels[film.tile.index_of(2, 3)].odd.map(from_fixed), [1.0, 2.0, 3.0]);
    }

    #[test]
    fn cropped_sums_keep_all_that_was_gathered_and_few_rows_besides() {
        let tile = Rect { x0: 3, y0: 5, x1: 6, y1: 11 };
        let mut sums = TileSums::new(tile);
        sums.add_sample(4, 0);
        sums.add_radiance(10, 1, [1.0; 3]);
        let cropped = sums.clone().cropped();
        assert_eq!(cropped.tile, Rect { y0: 6, y1: 9, ..tile });
        let mut back = TileSums::new(tile);
        back.merge(&cropped);
        assert_eq!(back, sums);
        assert_eq!(TileSums::new(tile).cropped().pixels.len(), 3, "one row");
    }
}
