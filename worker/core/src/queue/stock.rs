//! How much waits in the queue, and what it will cost: the load.
//!
//! Paths are counted per region of the image, so that the cost of all that waits follows from the
//! regions' means. It is kept up to date with every change of either, for it is asked for at every
//! event.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::cost::{Costs, Kind, Region};

/// What waits.
#[derive(Debug, Default)]
pub(crate) struct Stock {
    costs: Costs,
    paths: BTreeMap<Region, u64>,
    /// Of the paths through regions that have a mean of their own.
    measured_nanos: u128,
    /// Paths through the others.
    unmeasured_paths: u64,
    path_count: u64,
    /// In the middle of their paths.
    ray_count: u64,
}

impl Stock {
    /// Work came in.
    pub(crate) fn add(&mut self, kind: Kind, count: u64) {
        match kind {
            Kind::Paths(region) => self.add_paths(region, count),
            Kind::Rays => self.ray_count += count,
        }
    }

    /// Work went out.
    pub(crate) fn take(&mut self, kind: Kind, count: u64) {
        match kind {
            Kind::Paths(region) => self.take_paths(region, count),
            Kind::Rays => self.ray_count -= count,
        }
    }

    /// Forgets all that waits: it is counted anew.
    pub(crate) fn clear(&mut self) {
        self.paths.clear();
        (self.measured_nanos, self.unmeasured_paths) = (0, 0);
        (self.path_count, self.ray_count) = (0, 0);
    }

    /// So much work of a kind took so long.
    pub(crate) fn learn(&mut self, kind: Kind, elapsed: Duration, count: u64) {
        let waiting = match kind {
            Kind::Paths(region) => self.paths.get(&region).copied().unwrap_or(0),
            Kind::Rays => 0,
        };
        if waiting > 0 {
            self.take(kind, waiting);
        }
        self.costs.learn(kind, elapsed, count);
        if waiting > 0 {
            self.add(kind, waiting);
        }
    }

    /// What things cost.
    pub(crate) const fn costs(&self) -> &Costs {
        &self.costs
    }

    /// Paths that wait to be begun.
    pub(crate) const fn path_count(&self) -> u64 {
        self.path_count
    }

    /// Whether nothing waits.
    pub(crate) fn is_empty(&self) -> bool {
        self.paths.is_empty() && self.ray_count == 0
    }

    /// Nanoseconds that all that waits would take one thread.
    pub(crate) fn nanos(&self) -> u64 {
        let unmeasured = u128::from(self.unmeasured_paths) * u128::from(self.costs.path());
        let rays = u128::from(self.ray_count) * u128::from(self.costs.of(Kind::Rays));
        u64::try_from(self.measured_nanos + unmeasured + rays).unwrap_or(u64::MAX)
    }

    fn add_paths(&mut self, region: Region, count: u64) {
        *self.paths.entry(region).or_default() += count;
        self.path_count += count;
        match self.costs.measured(region) {
            Some(nanos) => self.measured_nanos += u128::from(nanos) * u128::from(count),
            None => self.unmeasured_paths += count,
        }
    }

    fn take_paths(&mut self, region: Region, count: u64) {
        let waiting = self.paths.get_mut(&region).expect("paths that go were here");
        *waiting = waiting.checked_sub(count).expect("no more paths go than were here");
        self.path_count -= count;
        if *waiting == 0 {
            self.paths.remove(&region);
        }
        match self.costs.measured(region) {
            Some(nanos) => self.measured_nanos -= u128::from(nanos) * u128::from(count),
            None => self.unmeasured_paths -= count,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cost::Regions;
    use equilux_common::unit::Rect;
    use proptest::prelude::*;

    #[derive(Clone, Debug)]
    enum Change {
        Add(u32, u64),
        Take(u32),
        Learn(u32, u64),
    }

    fn change() -> impl Strategy<Value = Change> {
        prop_oneof![
            (0u32..5, 1u64..500).prop_map(|(region, count)| Change::Add(region, count)),
            (0u32..5).prop_map(Change::Take),
            (0u32..5, 1u64..1 << 40).prop_map(|(region, nanos)| Change::Learn(region, nanos)),
        ]
    }

    proptest! {
        #[test]
        fn the_cost_is_that_of_all_paths_by_their_regions_means(
            changes in prop::collection::vec(change(), 0..60),
        ) {
            let pixels = Rect { x0: 0, y0: 0, x1: 64, y1: 8 };
            let kind = |which: u32| match which {
                0 => Kind::Rays,
                _ => Kind::Paths(Regions::new(pixels).of(Rect { x0: which * 8, ..pixels })),
            };
            let mut stock = Stock::default();
            let mut counts = [0u64; 5];
            for change in changes {
                match change {
                    Change::Add(which, count) => {
                        stock.add(kind(which), count);
                        counts[which as usize] += count;
                    }
                    Change::Take(which) => {
                        let count = std::mem::take(&mut counts[which as usize]);
                        if count > 0 {
                            stock.take(kind(which), count);
                        }
                    }
                    Change::Learn(which, nanos) => {
                        stock.learn(kind(which), Duration::from_nanos(nanos), 10);
                    }
                }
            }
            let cost = (0..).zip(counts).map(|(which, count)| {
                count * stock.costs().of(kind(which))
            });
            prop_assert_eq!(stock.nanos(), cost.sum::<u64>());
            prop_assert_eq!(stock.is_empty(), counts == [0; 5]);
        }
    }
}
