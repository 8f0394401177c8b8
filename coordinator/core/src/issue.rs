//! Issue: who begins with which units.
//!
//! Shares are runs of tiles along the space-filling curve, so that each is compact on the image, in
//! proportion to what its worker can compute.

use equilux_common::ids::UnitId;
use equilux_common::unit::UnitGrid;

/// All numbers below `count`, in an order that takes those close to each other far apart: multiples
/// of the golden ratio (Knuth, *The Art of Computer Programming*, volume 3, section 6.4).
///
/// In this order workers lie along the curve. Regions of the image cost more or less, and neighbors
/// in a topology have close numbers: so every neighborhood has its part of dear and cheap regions,
/// and what one of its members lacks another one has.
pub(crate) fn scattered(count: usize) -> impl Iterator<Item = usize> {
    let golden = count.saturating_mul(618_034) / 1_000_000;
    let is_coprime = |step: &usize| greatest_common_divisor(*step, count) == 1;
    let step = (golden.max(1)..).find(is_coprime).unwrap_or(1);
    (0..count).map(move |place| place * step % count)
}

const fn greatest_common_divisor(a: usize, b: usize) -> usize {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

/// Deals out `units` (ascending) in proportion to `capacities` (each more than 0), in their order.
/// Units of one tile stay together.
pub(crate) fn shares(grid: &UnitGrid, units: &[UnitId], capacities: &[u64]) -> Vec<Vec<UnitId>> {
    if capacities.is_empty() {
        return Vec::new();
    }
    let likely = units.len() / capacities.len() + 1;
    let mut shares: Vec<_> = capacities.iter().map(|_| Vec::with_capacity(likely)).collect();
    let total: u128 = capacities.iter().copied().map(u128::from).sum();
    let is_same_tile = |a: &UnitId, b: &UnitId| grid.tile_number(*a) == grid.tile_number(*b);
    let (mut begin, mut receiver, mut reached) = (0, 0, 0);
    for run in units.chunk_by(is_same_tile) {
        // The run goes to the worker whose part of the curve its middle lies in.
        let middle = (2 * begin + run.len()) as u128 * total;
        while receiver + 1 < capacities.len()
            && middle >= 2 * units.len() as u128 * (reached + u128::from(capacities[receiver]))
        {
            reached += u128::from(capacities[receiver]);
            receiver += 1;
        }
        shares[receiver].extend_from_slice(run);
        begin += run.len();
    }
    shares
}

#[cfg(test)]
mod tests {
    use super::*;
    use equilux_common::unit::{Granularity, Rect};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn scattered_numbers_are_all_there_and_followers_far_apart(count in 1usize..3000) {
            let order: Vec<usize> = scattered(count).collect();
            let mut sorted = order.clone();
            sorted.sort_unstable();
            prop_assert_eq!(sorted, (0..count).collect::<Vec<_>>());
            for pair in order.windows(2).filter(|_| count >= 16) {
                let apart = pair[0].abs_diff(pair[1]);
                prop_assert!(apart.min(count - apart) >= count / 4, "{pair:?}");
            }
        }

        #[test]
        fn every_unit_is_issued_once_in_order_and_in_proportion(
            side in 1u32..12, passes in 1u32..4, capacities in prop::collection::vec(1u64..9000, 1..9),
            committed in prop::collection::vec(any::<bool>(), 600),
        ) {
            let region = Rect { x0: 0, y0: 0, x1: side, y1: side };
            let granularity = Granularity { tile_side_pixels: 1, samples_per_unit: 1 };
            let grid = UnitGrid::new(side, region, passes, granularity);
            let units: Vec<UnitId> =
                (0..grid.unit_count()).filter(|&id| !committed[id as usize]).map(UnitId).collect();
            let shares = shares(&grid, &units, &capacities);
            prop_assert_eq!(shares.concat(), units.clone());
            let total: u64 = capacities.iter().sum();
            for (share, capacity) in shares.iter().zip(&capacities) {
                let fair = units.len() as f64 * *capacity as f64 / total as f64;
                prop_assert!((share.len() as f64 - fair).abs() <= f64::from(passes) + 1e-9);
            }
            let mut owned: Vec<_> = shares.iter().flat_map(|share| {
                let mut tiles: Vec<_> = share.iter().map(|&unit| grid.tile_number(unit)).collect();
                tiles.dedup();
                tiles
            }).collect();
            let count = owned.len();
            owned.sort_unstable();
            owned.dedup();
            prop_assert_eq!(owned.len(), count, "a tile was torn apart");
        }
    }
}
