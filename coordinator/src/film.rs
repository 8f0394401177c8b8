//! The film of a job while it is gathered: tiles that are there so far, shared with readers.
//!
//! A reader (an image asked for while rendering) takes a copy of the list of tiles, not of their
//! values, so that it never holds up the driver. A tile that is added to while a reader holds it is
//! copied then. Tiles that nothing was gathered for take no memory.

use std::collections::BTreeMap;
use std::sync::Arc;

use equilux_common::film::TileSums;
use equilux_common::unit::Rect;

/// A job's committed values, tile by tile. Cloning it is cheap.
#[derive(Clone, Debug)]
pub struct GatheredFilm {
    region: Rect,
    tiles: BTreeMap<(u32, u32), Arc<TileSums>>,
}

impl GatheredFilm {
    /// Nothing gathered yet for the pixels of `region`.
    #[must_use]
    pub const fn new(region: Rect) -> Self {
        Self { region, tiles: BTreeMap::new() }
    }

    /// Adds a unit's values.
    ///
    /// # Panics
    /// If the unit's tile is none of the job's: the core commits whole units of the job alone.
    pub fn add(&mut self, sums: TileSums) {
        let tile = sums.tile;
        match self.tiles.entry((tile.y0, tile.x0)) {
            std::collections::btree_map::Entry::Vacant(vacant) => {
                let inside = tile.x0 >= self.region.x0 && tile.x1 <= self.region.x1;
                assert!(inside && tile.y0 >= self.region.y0 && tile.y1 <= self.region.y1);
                vacant.insert(Arc::new(sums));
            }
            std::collections::btree_map::Entry::Occupied(mut occupied) => {
                assert_eq!(occupied.get().tile, tile, "units of one place have one tile");
                Arc::make_mut(occupied.get_mut()).merge(&sums);
            }
        }
    }

    /// The values of all pixels in one piece; what is not there yet is zero.
    #[must_use]
    pub fn assemble(&self) -> TileSums {
        let mut whole = TileSums::new(self.region);
        for tile in self.tiles.values() {
            whole.merge(tile);
        }
        whole
    }

    /// Channels of contributions that were clamped, and contributions that were left out because
    /// they were not finite.
    #[must_use]
    pub fn flaws(&self) -> (u64, u64) {
        self.tiles.values().fold((0, 0), |(saturated, invalid), tile| {
            (saturated + tile.saturated, invalid + tile.invalid)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const REGION: Rect = Rect { x0: 2, y0: 1, x1: 6, y1: 5 };

    fn tile(x0: u32, y0: u32, value: f32) -> TileSums {
        let mut sums = TileSums::new(Rect { x0, y0, x1: x0 + 2, y1: y0 + 2 });
        for index in 0..4 {
            sums.add_radiance(index, 0, [value; 3]);
        }
        sums
    }

    #[test]
    fn a_snapshot_is_not_changed_by_what_is_added_later() {
        let mut film = GatheredFilm::new(REGION);
        film.add(tile(2, 1, 1.0));
        let snapshot = film.clone();
        film.add(tile(2, 1, 2.0));
        film.add(tile(4, 3, 3.0));
        let mut expected = TileSums::new(REGION);
        expected.merge(&tile(2, 1, 1.0));
        assert_eq!(snapshot.assemble(), expected);
        expected.merge(&tile(2, 1, 2.0));
        expected.merge(&tile(4, 3, 3.0));
        assert_eq!(film.assemble(), expected);
    }
}
