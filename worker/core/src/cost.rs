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

/// Work that took so many times longer than the mean says is of another kind than what was measured
/// before, of which the mean then remembers no more than of the new. Otherwise many cheap paths
/// would hide for long that those that are left are dear.
const SURPRISE: u64 = 4;

/// A block of pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Region(u64);

/// What work is like, as far as its cost goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Whole paths that begin in a region.
    Paths(Region),
    /// Rays in the middle of their paths.
    Rays,
}

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
}

impl Costs {
    /// So much work of a kind took so long, to the paths' ends.
    pub(crate) fn learn(&mut self, kind: Kind, elapsed: Duration, count: u64) {
        match kind {
            Kind::Paths(region) => {
                self.regions.entry(region).or_default().add(elapsed, count, REGION_MEMORY_PATHS);
                self.path.add(elapsed, count, MEMORY_RAYS);
            }
            Kind::Rays => self.ray.add(elapsed, count, MEMORY_RAYS),
        }
    }

    /// What a path through a region was measured to cost.
    pub(crate) fn measured(&self, region: Region) -> Option<u64> {
        self.regions.get(&region).and_then(Mean::get)
    }

    /// Whether any path has been measured.
    pub(crate) const fn is_any_measured(&self) -> bool {
        self.path.count > 0
    }

    /// What a path costs where none has been measured.
    pub(crate) fn path(&self) -> u64 {
        self.path.get().unwrap_or(PATH_NANOS)
    }

    /// What a path or ray of a kind costs. Rays in the middle of their paths are taken to cost what
    /// whole paths do until one has been traced here.
    pub(crate) fn of(&self, kind: Kind) -> u64 {
        let measured = match kind {
            Kind::Paths(region) => self.measured(region),
            Kind::Rays => self.ray.get(),
        };
        measured.unwrap_or(self.path())
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
        if self.get().is_some_and(|mean| nanos / SURPRISE > mean.saturating_mul(count + 1)) {
            self.forget(count.max(1));
        }
        self.nanos = self.nanos.saturating_add(nanos);
        self.count += count;
        self.forget(2 * memory - 1);
    }

    /// Halves what is remembered until it is of no more than `most` things.
    const fn forget(&mut self, most: u64) {
        while self.count > most {
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
        let [wall, mirror, unseen] = [0, 8, 16].map(|x0| Kind::Paths(regions.of(tile(x0, 0))));
        let mut costs = Costs::default();
        assert_eq!(costs.of(unseen), PATH_NANOS);
        costs.learn(wall, MS, 100);
        costs.learn(mirror, 9 * MS, 100);
        assert_eq!((costs.of(wall), costs.of(mirror)), (10_000, 90_000));
        assert_eq!((costs.of(unseen), costs.of(Kind::Rays)), (50_000, 50_000));
        costs.learn(Kind::Rays, MS, 50);
        assert_eq!(costs.of(Kind::Rays), 20_000);
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

    #[test]
    fn few_dear_paths_are_not_hidden_by_many_cheap_ones() {
        let mut mean = Mean::default();
        (0..100).for_each(|_| mean.add(MS, 16, 2048));
        mean.add(12 * MS, 4, 2048);
        let nanos = mean.get().expect("measured");
        assert!(nanos > 1_000_000, "{nanos} ns, of 62,500 once and 3 ms now");
    }
}
