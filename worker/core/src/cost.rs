//! What work costs on this worker: moving means of what it did cost.
//!
//! A path through a mirror costs ten times one that ends at a wall, so the means are kept per
//! region of the image: a block of pixels that is about as large as a tile. Where nothing has been
//! measured yet, the mean of all that was stands in. Rays in the middle of their paths have a mean
//! of their own. All costs are nanoseconds of one compute thread.

use std::collections::BTreeMap;
use std::time::Duration;

use equilux_common::unit::Rect;

/// Assumed of a camera path until one has been traced here.
const PATH_NANOS: u64 = 20_000;

/// Most regions of an image: the means of a worker that sees all of it stay within the caches.
const REGIONS_MAX: u64 = 8192;

/// Least side of a region: below, a mean would stand on too few paths.
const REGION_SIDE_PIXELS_MIN: u32 = 8;

/// Paths that a region's mean remembers: the noise of single paths is gone, a mean of another
/// machine load is soon forgotten.
const REGION_MEMORY_PATHS: u64 = 2048;

/// Paths and rays that the means over the whole image remember.
const MEMORY_RAYS: u64 = 1 << 14;

/// Pieces that the mean of pieces remembers: their size follows the load.
const MEMORY_PIECES: u64 = 8;

/// A block of pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Region(u64);

/// How an image is divided.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Regions {
    side_pixels: u32,
}

impl Regions {
    /// The regions of these pixels.
    pub(crate) fn new(pixels: Rect) -> Self {
        let blocks = |side: u32| {
            u64::from(pixels.width().div_ceil(side)) * u64::from(pixels.height().div_ceil(side))
        };
        let mut side_pixels = REGION_SIDE_PIXELS_MIN;
        while blocks(side_pixels) > REGIONS_MAX {
            side_pixels *= 2;
        }
        Self { side_pixels }
    }

    /// The region of a tile: that of its first pixel.
    pub(crate) const fn of(self, tile: Rect) -> Region {
        let (column, row) = (tile.x0 / self.side_pixels, tile.y0 / self.side_pixels);
        Region((row as u64) << 32 | column as u64)
    }
}

/// Moving means; none where nothing has been measured.
#[derive(Debug, Default)]
pub(crate) struct Costs {
    regions: BTreeMap<Region, Mean>,
    path: Mean,
    ray: Mean,
    piece: Mean,
}

impl Costs {
    /// So many paths through a region took so long.
    pub(crate) fn learn_paths(&mut self, region: Region, elapsed: Duration, count: u64) {
        self.regions.entry(region).or_default().add(elapsed, count, REGION_MEMORY_PATHS);
        self.path.add(elapsed, count, MEMORY_RAYS);
    }

    /// So many rays in the middle of their paths took so long, to the paths' ends.
    pub(crate) fn learn_rays(&mut self, elapsed: Duration, count: u64) {
        self.ray.add(elapsed, count, MEMORY_RAYS);
    }

    /// A compute thread was busy so long with a piece.
    pub(crate) fn learn_piece(&mut self, elapsed: Duration) {
        self.piece.add(elapsed, 1, MEMORY_PIECES);
    }

    /// What a path through a region was measured to cost.
    pub(crate) fn measured(&self, region: Region) -> Option<u64> {
        self.regions.get(&region).and_then(Mean::get)
    }

    /// What a path costs where none has been measured.
    pub(crate) fn path(&self) -> u64 {
        self.path.get().unwrap_or(PATH_NANOS)
    }

    /// What a path through a region costs.
    pub(crate) fn path_in(&self, region: Region) -> u64 {
        self.measured(region).unwrap_or(self.path())
    }

    /// What a ray in the middle of its path costs: until one has been traced here, what a whole
    /// path does.
    pub(crate) fn ray(&self) -> u64 {
        self.ray.get().unwrap_or(self.path())
    }

    /// What a piece on a compute thread costs, as pieces went lately; nothing before the first.
    pub(crate) fn piece(&self) -> u64 {
        self.piece.get().unwrap_or(0)
    }
}

/// A mean that forgets: time and number of what was measured, halved now and then.
#[derive(Clone, Copy, Debug, Default)]
struct Mean {
    nanos: u64,
    count: u64,
}

impl Mean {
    /// Adds a measurement of `count` things; remembers about `memory` of them.
    fn add(&mut self, elapsed: Duration, count: u64, memory: u64) {
        let nanos = u64::try_from(elapsed.as_nanos()).unwrap_or(u64::MAX);
        self.nanos = self.nanos.saturating_add(nanos);
        self.count += count;
        while self.count >= 2 * memory {
            (self.nanos, self.count) = (self.nanos / 2, self.count / 2);
        }
    }

    /// The mean, never 0.
    fn get(&self) -> Option<u64> {
        self.nanos.checked_div(self.count).map(|mean| mean.max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    fn tile(x0: u32, y0: u32) -> Rect {
        Rect { x0, y0, x1: x0 + 4, y1: y0 + 4 }
    }

    #[test]
    fn tiles_side_by_side_share_a_region_and_large_images_have_larger_ones() {
        let small = Regions::new(Rect { x0: 0, y0: 0, x1: 640, y1: 480 });
        assert_eq!(small.of(tile(0, 0)), small.of(tile(4, 4)));
        assert_ne!(small.of(tile(0, 0)), small.of(tile(8, 0)));
        assert_ne!(small.of(tile(8, 0)), small.of(tile(0, 8)));
        let large = Regions::new(Rect { x0: 0, y0: 0, x1: 1 << 14, y1: 1 << 14 });
        assert_eq!(large.of(tile(0, 0)), large.of(tile(128, 128)));
    }

    #[test]
    fn every_region_has_its_mean_and_the_others_that_of_all() {
        let regions = Regions::new(tile(0, 0));
        let [wall, mirror, unseen] = [0, 8, 16].map(|x0| regions.of(tile(x0, 0)));
        let mut costs = Costs::default();
        assert_eq!(costs.path_in(unseen), PATH_NANOS);
        costs.learn_paths(wall, MS, 100);
        costs.learn_paths(mirror, 9 * MS, 100);
        assert_eq!((costs.path_in(wall), costs.path_in(mirror)), (10_000, 90_000));
        assert_eq!((costs.path_in(unseen), costs.ray()), (50_000, 50_000));
        costs.learn_rays(MS, 50);
        assert_eq!(costs.ray(), 20_000);
    }

    #[test]
    fn a_mean_forgets_what_was() {
        let mut mean = Mean::default();
        assert_eq!(mean.get(), None);
        for millis in [9, 1] {
            for _ in 0..200 {
                mean.add(MS * millis, 10, 100);
            }
        }
        let nanos = mean.get().expect("measured");
        assert!(nanos.abs_diff(100_000) < 1000, "{nanos}");
    }
}
