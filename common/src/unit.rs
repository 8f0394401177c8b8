//! Units: tiles of pixels × ranges of sample numbers, in the order of a space-filling curve.

use serde::{Deserialize, Serialize};

use crate::hilbert;
use crate::ids::UnitId;

/// A rectangle of pixels: `x0 ≤ x < x1`, `y0 ≤ y < y1`; row 0 is at the top.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rect {
    /// Leftmost column.
    pub x0: u32,
    /// Topmost row.
    pub y0: u32,
    /// One past the rightmost column.
    pub x1: u32,
    /// One past the bottom row.
    pub y1: u32,
}

impl Rect {
    /// Columns.
    #[must_use]
    pub const fn width(&self) -> u32 {
        self.x1 - self.x0
    }

    /// Rows.
    #[must_use]
    pub const fn height(&self) -> u32 {
        self.y1 - self.y0
    }

    /// Pixels.
    #[must_use]
    pub const fn pixel_count(&self) -> usize {
        self.width() as usize * self.height() as usize
    }

    /// Whether all pixels of another rectangle are in this one.
    #[must_use]
    pub const fn contains(&self, other: &Self) -> bool {
        self.x0 <= other.x0 && other.x1 <= self.x1 && self.y0 <= other.y0 && other.y1 <= self.y1
    }

    /// Position of the pixel (`x`, `y`) in the rectangle's row-major order.
    #[must_use]
    pub const fn index_of(&self, x: u32, y: u32) -> usize {
        (x - self.x0) as usize + (y - self.y0) as usize * self.width() as usize
    }
}

/// What is issued, counted, retried and shown as progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unit {
    /// Its position in the order of the curve.
    pub id: UnitId,
    /// Its pixels.
    pub tile: Rect,
    /// The first of its sample numbers.
    pub first_sample: u32,
    /// How many sample numbers each pixel gets.
    pub sample_count: u32,
}

impl Unit {
    /// Camera samples in the unit.
    #[must_use]
    pub const fn path_count(&self) -> u32 {
        self.tile.width() * self.tile.height() * self.sample_count
    }

    /// The `number`-th path: column, row and sample number. All samples of a pixel follow one
    /// another; pixels go row by row.
    #[must_use]
    pub const fn path(&self, number: u32) -> (u32, u32, u32) {
        let pixel = number / self.sample_count;
        let x = self.tile.x0 + pixel % self.tile.width();
        let y = self.tile.y0 + pixel / self.tile.width();
        (x, y, self.first_sample + number % self.sample_count)
    }
}

/// How finely a job is cut. Part of the job, so that all who take part agree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Granularity {
    /// Side of a tile in pixels.
    pub tile_side_pixels: u32,
    /// Sample numbers per unit.
    pub samples_per_unit: u32,
}

/// Sides that tiles may have. The largest that gives enough units is taken: more pixels together
/// mean fewer messages home.
const TILE_SIDES_PIXELS: [u32; 3] = [16, 8, 4];

/// Units wanted for each compute thread, so that initial shares come out even, and something whole
/// can be given away until near the end.
const UNITS_PER_THREAD: u64 = 8;

/// Tiles are not made smaller if units had fewer paths then: parts of units can be given away, too.
const UNIT_PATHS_MIN: u64 = 256;

/// Least sample numbers of a unit where the job has as many: fewer are not worth their film values'
/// way home.
const SAMPLES_PER_UNIT_MIN: u32 = 16;

/// Most sample numbers of a unit, so that its paths are counted in 32 bits.
const SAMPLES_PER_UNIT_MAX: u32 = 1 << 20;

/// Most ranges of sample numbers that a tile is cut into: passes over the image, in which it is
/// refined while it is rendered.
const PASSES_MAX: u32 = 256;

/// Every pass brings all film values home once: some 70 bytes a pixel, of which a gigabit link
/// takes 1.8 million a second. A thread traces some 150,000 paths a second. So that the values take
/// no more than a quarter of the time, a sample may be in a pass of its own only at a third of a
/// thread.
const PASSES_PER_SAMPLE_OF_A_THREAD: u64 = 3;

/// More units than this are avoided: the coordinator keeps some hundred bytes for each.
const UNITS_WANTED_MAX: u32 = 1 << 20;

impl Granularity {
    /// How to cut a job of so many samples for each pixel of `region`, for so many compute threads
    /// in all.
    #[must_use]
    pub fn for_job(region: Rect, samples_per_pixel: u32, threads: u32) -> Self {
        let threads = u64::from(threads.max(1));
        let tiles = |side: u32| {
            let tiles = u64::from(region.width().div_ceil(side))
                * u64::from(region.height().div_ceil(side));
            u32::try_from(tiles).unwrap_or(u32::MAX).max(1)
        };
        let passes = u64::from(samples_per_pixel) * PASSES_PER_SAMPLE_OF_A_THREAD / threads;
        let passes = u32::try_from(passes).unwrap_or(u32::MAX).clamp(1, PASSES_MAX);
        let passes = passes.min(samples_per_pixel.div_ceil(SAMPLES_PER_UNIT_MIN)).max(1);
        let ranges_min = samples_per_pixel.div_ceil(SAMPLES_PER_UNIT_MAX);
        let is_enough = |&side: &u32| {
            let units = u64::from(tiles(side)) * u64::from(passes);
            let paths = u64::from(side) * u64::from(side) * u64::from(samples_per_pixel / passes);
            units >= threads * UNITS_PER_THREAD
                || paths / 4 <= UNIT_PATHS_MIN
                || tiles(side / 2) > UNITS_WANTED_MAX / ranges_min
        };
        let [.., smallest] = TILE_SIDES_PIXELS;
        let side = TILE_SIDES_PIXELS.into_iter().find(is_enough).unwrap_or(smallest);
        let ranges = passes.min(UNITS_WANTED_MAX / tiles(side)).max(1);
        let samples = samples_per_pixel.div_ceil(ranges);
        let samples_per_unit = samples.clamp(SAMPLES_PER_UNIT_MIN, SAMPLES_PER_UNIT_MAX);
        Self { tile_side_pixels: side, samples_per_unit }
    }

    /// How many units a job of so many samples for each pixel of `region` is cut into.
    #[must_use]
    pub const fn unit_count(self, region: Rect, samples_per_pixel: u32) -> u32 {
        let (columns, rows) = self.tile_counts(region);
        columns * rows * self.ranges(samples_per_pixel)
    }

    /// Columns and rows of tiles.
    const fn tile_counts(self, region: Rect) -> (u32, u32) {
        let side = self.tile_side_pixels;
        (region.width().div_ceil(side), region.height().div_ceil(side))
    }

    /// Ranges of sample numbers of each tile.
    const fn ranges(self, samples_per_pixel: u32) -> u32 {
        samples_per_pixel.div_ceil(self.samples_per_unit)
    }
}

/// All units of a job.
///
/// The tiles follow a Hilbert curve, so that a run of units is compact on the image; the units of
/// one tile follow one another by sample number.
#[derive(Clone, Debug)]
pub struct UnitGrid {
    width: u32,
    samples_per_pixel: u32,
    granularity: Granularity,
    /// Ranges of sample numbers of each tile.
    ranges: u32,
    tiles: Vec<Rect>,
}

impl UnitGrid {
    /// Cuts the pixels of `region`, part of an image `width` pixels wide, into units.
    ///
    /// # Panics
    /// If the granularity or the number of samples is zero; settings are checked at the door.
    #[must_use]
    pub fn new(width: u32, region: Rect, samples_per_pixel: u32, granularity: Granularity) -> Self {
        assert!(granularity.tile_side_pixels > 0 && granularity.samples_per_unit > 0);
        assert!(samples_per_pixel > 0);
        let side = granularity.tile_side_pixels;
        let (columns, rows) = granularity.tile_counts(region);
        let tiles = hilbert::cells(columns, rows)
            .into_iter()
            .map(|(column, row)| {
                let (x0, y0) = (region.x0 + column * side, region.y0 + row * side);
                Rect { x0, y0, x1: region.x1.min(x0 + side), y1: region.y1.min(y0 + side) }
            })
            .collect();
        let ranges = granularity.ranges(samples_per_pixel);
        Self { width, samples_per_pixel, granularity, ranges, tiles }
    }

    /// How many units there are.
    #[must_use]
    pub fn unit_count(&self) -> u32 {
        u32::try_from(self.tiles.len()).expect("tiles are counted in 32 bits") * self.ranges
    }

    /// The unit `id`, or nothing if the job has no such unit.
    #[must_use]
    pub fn unit(&self, id: UnitId) -> Option<Unit> {
        let tile = *self.tiles.get(self.tile_number(id) as usize)?;
        let first_sample = id.0 % self.ranges * self.granularity.samples_per_unit;
        let left = self.samples_per_pixel - first_sample;
        let sample_count = left.min(self.granularity.samples_per_unit);
        Some(Unit { id, tile, first_sample, sample_count })
    }

    /// The place of a unit's tile along the curve.
    #[must_use]
    pub const fn tile_number(&self, id: UnitId) -> u32 {
        id.0 / self.ranges
    }

    /// Width of the full image, by which pixels are numbered.
    #[must_use]
    pub const fn image_width(&self) -> u32 {
        self.width
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_sample_of_every_pixel_is_in_exactly_one_path(
            width in 1u32..40, height in 1u32..40, samples in 1u32..9,
            tile_side_pixels in 1u32..20, samples_per_unit in 1u32..12,
        ) {
            let granularity = Granularity { tile_side_pixels, samples_per_unit };
            let region = Rect { x0: 3, y0: 2, x1: 3 + width, y1: 2 + height };
            let grid = UnitGrid::new(50, region, samples, granularity);
            let mut seen = vec![0u32; region.pixel_count() * samples as usize];
            for id in 0..grid.unit_count() {
                let unit = grid.unit(UnitId(id)).expect("within the count");
                for number in 0..unit.path_count() {
                    let (x, y, sample) = unit.path(number);
                    seen[region.index_of(x, y) * samples as usize + sample as usize] += 1;
                }
            }
            prop_assert!(seen.iter().all(|&count| count == 1));
            prop_assert_eq!(grid.unit(UnitId(grid.unit_count())), None);
            prop_assert_eq!(granularity.unit_count(region, samples), grid.unit_count());
        }
    }

    #[test]
    fn units_are_few_enough_to_be_kept_and_small_enough_to_be_counted() {
        for (side, samples) in [(1, 1), (640, 64), (4096, 1 << 24), (5792, 1 << 24), (640, 1 << 24)]
        {
            for threads in [0, 1, 64, 4096, u32::MAX] {
                let region = Rect { x0: 0, y0: 0, x1: side, y1: side };
                let granularity = Granularity::for_job(region, samples, threads);
                let tiles = u64::from(side.div_ceil(granularity.tile_side_pixels)).pow(2);
                let ranges = u64::from(samples.div_ceil(granularity.samples_per_unit));
                assert!(tiles * ranges <= 1 << 22, "{side} pixels, {samples} samples");
                let pixels = u64::from(granularity.tile_side_pixels).pow(2);
                let paths = pixels * u64::from(granularity.samples_per_unit);
                assert!(u32::try_from(paths).is_ok(), "{side} pixels, {samples} samples");
            }
        }
    }

    #[test]
    fn more_threads_get_smaller_tiles_in_fewer_passes() {
        let region = Rect { x0: 0, y0: 0, x1: 640, y1: 480 };
        let cut = |samples, threads| {
            let Granularity { tile_side_pixels, samples_per_unit } =
                Granularity::for_job(region, samples, threads);
            (tile_side_pixels, samples_per_unit)
        };
        assert_eq!(cut(64, 2), (16, 16));
        assert_eq!(cut(29, 64), (16, 29));
        assert_eq!(cut(281, 1024), (4, 281));
    }
}
