//! The host: workers that take the objects in, each in proportion to its memory.
//!
//! There is no graph of workers. Regions of the model's space belong to workers, and workers whose
//! regions touch are neighbors: they are the ones that rays pass between. Every worker can reach
//! every other, so a fixed topology would only keep apart what the model puts side by side.

use std::collections::BTreeSet;

use equilux_common::ids::WorkerId;

/// Bytes of all workers together, at most: products with those of a guest stay exact in 128 bits.
pub const HOST_BYTES_MAX: u64 = 1 << 62;

/// Part of its share, in percent, that a worker may get beyond it.
pub const TOLERANCE_PERCENT: u64 = 3;

/// A worker and its memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seat {
    /// Who.
    pub worker: WorkerId,
    /// What it can hold, in bytes; 0 for one that takes nothing, or is about to leave.
    pub capacity: u64,
}

/// All workers that objects are mapped to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Host {
    seats: Vec<Seat>,
    capacity: u64,
}

/// Workers that make no host.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidHost {
    /// Nobody has room.
    #[error("no worker has any capacity; give one of them memory at least")]
    NoCapacity,
    /// Too much together.
    #[error(
        "the workers have more than {HOST_BYTES_MAX} bytes together; give capacities in a larger unit"
    )]
    TooLarge,
    /// There twice.
    #[error("{0} comes twice; name each once")]
    Twice(WorkerId),
}

impl Host {
    /// These workers. Their order is the one in which bisection deals out objects.
    ///
    /// # Errors
    /// If none has capacity, all have too much, or one comes twice.
    pub fn new(seats: Vec<Seat>) -> Result<Self, InvalidHost> {
        let mut seen = BTreeSet::new();
        if let Some(seat) = seats.iter().find(|seat| !seen.insert(seat.worker)) {
            return Err(InvalidHost::Twice(seat.worker));
        }
        let capacity = seats.iter().fold(0u64, |sum, seat| sum.saturating_add(seat.capacity));
        match capacity {
            0 => Err(InvalidHost::NoCapacity),
            HOST_BYTES_MAX.. if capacity > HOST_BYTES_MAX => Err(InvalidHost::TooLarge),
            _ => Ok(Self { seats, capacity }),
        }
    }

    /// All workers.
    #[must_use]
    pub fn seats(&self) -> &[Seat] {
        &self.seats
    }

    /// Bytes that all can hold together; above zero.
    #[must_use]
    pub const fn capacity(&self) -> u64 {
        self.capacity
    }

    /// What each worker should get of so many bytes, by its capacity, rounded up: so who has any
    /// capacity has a share, and all shares together are no less than all bytes.
    pub(crate) fn shares(&self, bytes: u64) -> Vec<u64> {
        let share = |seat: &Seat| {
            let share = u128::from(bytes) * u128::from(seat.capacity);
            let share = share.div_ceil(u128::from(self.capacity));
            u64::try_from(share).expect("no more than all bytes")
        };
        self.seats.iter().map(share).collect()
    }
}

/// The most that a worker with this share may get.
pub(crate) const fn limit(share: u64) -> u64 {
    share + share / 100 * TOLERANCE_PERCENT + share % 100 * TOLERANCE_PERCENT / 100
}

#[cfg(test)]
mod tests {
    use super::*;

    fn host(capacities: &[u64]) -> Result<Host, InvalidHost> {
        let seat = |(&capacity, worker)| Seat { worker: WorkerId(worker), capacity };
        Host::new(capacities.iter().zip(0..).map(seat).collect())
    }

    #[test]
    fn mistakes_are_named() {
        assert_eq!(host(&[]), Err(InvalidHost::NoCapacity));
        assert_eq!(host(&[0, 0]), Err(InvalidHost::NoCapacity));
        assert_eq!(host(&[u64::MAX, u64::MAX]), Err(InvalidHost::TooLarge));
        let seat = Seat { worker: WorkerId(7), capacity: 1 };
        let twice = Host::new(vec![seat, seat]).expect_err("twice").to_string();
        assert_eq!(twice, "worker 7 comes twice; name each once");
    }

    #[test]
    fn shares_are_in_proportion_however_large() {
        let host = host(&[1 << 60, 0, 3 << 60]).expect("a host");
        assert_eq!(host.shares(1 << 62), [1 << 60, 0, 3 << 60]);
        assert_eq!(host.shares(5), [2, 0, 4]);
        assert_eq!([limit(0), limit(99), limit(1000)], [0, 101, 1030]);
    }
}
