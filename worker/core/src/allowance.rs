//! Allowance: how many rays may wait with a worker, by its memory, whatever they wait for.
//!
//! Paths are begun until a little less than that waits here. The rest is for rays of others, so
//! that whoever has begun all that may be still lets those pass. Beyond it, forwards are not
//! acknowledged, so no more can come than windows are open already: the allowance and all windows
//! together bound what waits, times how many rays come of one where paths branch.
//!
//! Nobody waits for ever then, though all may wait for one another. A worker that has used up its
//! allowance has something to trace, or rays that can go, or rays that are stuck behind closed
//! windows; of these it copies the partitions, whatever that costs, and traces them itself. So it
//! never needs anybody else to have room again. Networks have *escape channels* for this
//! (J. Duato, *A New Theory of Deadlock-Free Adaptive Routing in Wormhole Networks*, IEEE
//! Transactions on Parallel and Distributed Systems 4 (12), 1993); here the way out leads to the
//! worker's own threads.

use equilux_common::job::Settings;

/// Of a memory budget, one part in so many is for rays that wait; as much is for film values.
const RAYS_PART: u64 = 8;

/// Memory that a ray takes while it waits, its bundle's share of credit included.
const WAITING_RAY_BYTES: u64 = 96;

/// Most rays that wait if memory is not limited: enough for any number of partitions.
const WAITING_RAYS_MAX: u64 = 1 << 21;

/// Fewest, however small the memory: enough for threads and the way to other homes to be busy.
const WAITING_RAYS_MIN: u64 = 1 << 14;

/// Of the rays that may wait, one part in so many is room that is kept for those of others.
const GUESTS_PART: u64 = 8;

/// Of the rays that may wait, one part in so many may be on their way here.
const WINDOW_PART: u64 = 4;

/// Most and fewest rays that may be on their way from one sender: enough for the round trip of a
/// network, and for a few bundles.
const WINDOW_RAYS_MAX: u64 = 1 << 14;
const WINDOW_RAYS_MIN: u64 = 1 << 8;

/// Rays that come of one where it is shaded, as a rule: one to the light, and one that goes on.
const PLAIN_GROWTH: u64 = 2;

/// How many rays may wait with one worker.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Allowance {
    rays: u64,
    /// How many workers there are that rays may come from, this one included.
    homes: u64,
}

impl Allowance {
    /// That of a worker that may use so many bytes, one of so many homes, where a ray grows to so
    /// many ([`growth`]).
    pub(crate) fn new(memory: Option<u64>, growth: u64, homes: usize) -> Self {
        let rays = memory.map_or(WAITING_RAYS_MAX, |memory| memory / RAYS_PART / WAITING_RAY_BYTES);
        let rays = rays.saturating_mul(PLAIN_GROWTH) / growth.max(PLAIN_GROWTH);
        Self { rays: rays.clamp(WAITING_RAYS_MIN, WAITING_RAYS_MAX), homes: homes.max(1) as u64 }
    }

    /// While more wait, none may come.
    pub(crate) const fn rays(&self) -> u64 {
        self.rays
    }

    /// While more wait, no paths are begun.
    pub(crate) const fn begun_rays(&self) -> u64 {
        if self.homes > 1 { self.rays - self.rays / GUESTS_PART } else { self.rays }
    }

    /// How many rays may be on their way here from each other home.
    pub(crate) fn window(&self) -> u64 {
        (self.rays / WINDOW_PART / self.homes).clamp(WINDOW_RAYS_MIN, WINDOW_RAYS_MAX)
    }
}

/// The most rays that come of one where it is shaded.
pub(crate) fn growth(settings: &Settings) -> u64 {
    let Settings { light_samples, indirect_samples, .. } = settings;
    let depths = light_samples.as_slice().len().max(indirect_samples.as_slice().len());
    let at = |depth| u64::from(light_samples.at(depth)) + u64::from(indirect_samples.at(depth));
    (0..depths).map(at).max().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use equilux_common::job::{Filter, PerDepth};
    use proptest::prelude::*;

    fn settings(light_samples: &[u32], indirect_samples: &[u32]) -> Settings {
        let per_depth = |numbers: &[u32]| PerDepth::new(numbers.to_vec()).expect("some numbers");
        Settings {
            width: 1,
            height: 1,
            crop: None,
            filter: Filter::Box,
            samples_per_pixel: 1,
            max_depth: 9,
            light_samples: per_depth(light_samples),
            indirect_samples: per_depth(indirect_samples),
            roulette_depth: None,
            seed: 0,
        }
    }

    #[test]
    fn a_ray_grows_to_the_most_that_are_asked_for_at_any_depth() {
        assert_eq!(growth(&settings(&[1], &[1])), PLAIN_GROWTH);
        assert_eq!(growth(&settings(&[1, 4], &[16, 8, 1])), 17);
        assert_eq!(growth(&settings(&[0, 3], &[2, 2, 5])), 8);
    }

    #[test]
    fn the_more_come_of_a_ray_the_fewer_may_wait() {
        let rays = |growth| Allowance::new(Some(1 << 30), growth, 4).rays();
        assert_eq!(rays(0), (1 << 30) / RAYS_PART / WAITING_RAY_BYTES);
        assert_eq!((rays(PLAIN_GROWTH), rays(8)), (rays(0), rays(0) / 4));
        assert_eq!(rays(1 << 20), WAITING_RAYS_MIN);
    }

    #[test]
    fn who_is_alone_needs_no_room_for_others() {
        let alone = Allowance::new(Some(1 << 30), 2, 1);
        assert_eq!(alone.begun_rays(), alone.rays());
        let one_of_two = Allowance::new(Some(1 << 30), 2, 2);
        assert_eq!(one_of_two.begun_rays() + one_of_two.rays() / GUESTS_PART, alone.rays());
    }

    proptest! {
        #[test]
        fn all_windows_are_a_part_of_the_allowance_if_that_is_enough_for_a_few_bundles(
            memory in prop::option::of(any::<u64>()), growth in 0u64..2000, homes in 0usize..5000,
        ) {
            let allowance = Allowance::new(memory, growth, homes);
            let windows = allowance.window() * homes as u64;
            let least = WINDOW_RAYS_MIN * homes as u64;
            prop_assert!(windows <= (allowance.rays() / WINDOW_PART).max(least));
            prop_assert!((WAITING_RAYS_MIN..=WAITING_RAYS_MAX).contains(&allowance.rays()));
        }
    }
}
