//! A mapping: each object's home, and what it is worth.

use std::collections::BTreeMap;

use equilux_common::ids::WorkerId;

use crate::guest::Guest;
use crate::host::Host;

/// The home of every object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mapping {
    homes: Vec<WorkerId>,
}

/// What a mapping is worth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figures {
    /// Affinity of ties between objects of different workers: the edge cut.
    pub edge_cut: u128,
    /// What the worker with the most has beyond its share, as a part of its share: 0.03 is three
    /// percent. Infinite if one without capacity has anything.
    pub imbalance: f64,
}

impl Mapping {
    /// The mapping in which the objects, by their number, are at home with these workers.
    #[must_use]
    pub const fn new(homes: Vec<WorkerId>) -> Self {
        Self { homes }
    }

    /// Of workers by their position in `host`.
    pub(crate) fn from_positions(host: &Host, positions: &[u32]) -> Self {
        Self::new(positions.iter().map(|&at| host.seats()[at as usize].worker).collect())
    }

    /// Position in `host` of each object's home; none for an object whose home is not there any
    /// more.
    pub(crate) fn positions(&self, host: &Host) -> Vec<Option<u32>> {
        let seats: BTreeMap<_, _> = host.seats().iter().map(|seat| seat.worker).zip(0..).collect();
        self.homes.iter().map(|home| seats.get(home).copied()).collect()
    }

    /// The home of each object, by the objects' numbers.
    #[must_use]
    pub fn homes(&self) -> &[WorkerId] {
        &self.homes
    }

    /// What it is worth for these objects and workers.
    ///
    /// # Panics
    /// If it is not a mapping of these objects.
    #[must_use]
    pub fn figures(&self, guest: &Guest, host: &Host) -> Figures {
        assert_eq!(self.homes.len(), guest.objects().len(), "a home for every object");
        let [a, b] = [0, 1].map(|end| move |objects: [usize; 2]| objects[end]);
        let ties = guest.ties().iter();
        let cut = ties.filter(|tie| self.homes[a(tie.objects)] != self.homes[b(tie.objects)]);
        let edge_cut = cut.map(|tie| u128::from(tie.affinity)).sum();
        let loads = self.loads(guest);
        let excess = host.seats().iter().filter_map(|seat| {
            let load = *loads.get(&seat.worker)?;
            let share = guest.bytes() as f64 * (seat.capacity as f64 / host.capacity() as f64);
            Some(load as f64 / share - 1.0)
        });
        Figures { edge_cut, imbalance: excess.fold(0.0, f64::max) }
    }

    /// Bytes of the objects that have another home here than in `other`.
    ///
    /// # Panics
    /// If one of the two is not a mapping of these objects.
    #[must_use]
    pub fn moved_bytes(&self, other: &Self, guest: &Guest) -> u64 {
        let count = guest.objects().len();
        assert_eq!([self.homes.len(), other.homes.len()], [count; 2], "a home for every object");
        let pairs = self.homes.iter().zip(&other.homes).zip(guest.objects());
        pairs.filter(|((a, b), _)| a != b).map(|(_, object)| object.bytes).sum()
    }

    /// Bytes that each worker has of these objects; those that have none are left out.
    #[must_use]
    pub fn loads(&self, guest: &Guest) -> BTreeMap<WorkerId, u64> {
        let mut loads = BTreeMap::new();
        for (home, object) in self.homes.iter().zip(guest.objects()) {
            *loads.entry(*home).or_default() += object.bytes;
        }
        loads
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::guest::{Object, Tie};
    use crate::host::Seat;

    #[test]
    fn figures_are_those_of_the_cut_and_the_fullest() {
        let object = |bytes| Object { bytes, position: [0.0; 3] };
        let tie = |objects, affinity| Tie { objects, affinity };
        let ties = vec![tie([0, 1], 3), tie([1, 2], 5), tie([2, 2], 7)];
        let guest = Guest::new(vec![object(10), object(20), object(30)], ties).expect("a guest");
        let seat = |worker, capacity| Seat { worker: WorkerId(worker), capacity };
        let host = Host::new(vec![seat(4, 1), seat(2, 2), seat(9, 0)]).expect("a host");
        let figures = |homes: [u32; 3]| {
            let mapping = Mapping::new(homes.map(WorkerId).to_vec());
            let Figures { edge_cut, imbalance } = mapping.figures(&guest, &host);
            (edge_cut, imbalance)
        };
        assert_eq!(figures([4, 2, 2]), (3, 0.25));
        assert_eq!(figures([4, 2, 4]), (8, 1.0));
        assert_eq!(figures([4, 4, 9]), (5, f64::INFINITY));
        let [a, b] = [[4, 2, 2], [4, 4, 9]].map(|homes| Mapping::new(homes.map(WorkerId).to_vec()));
        assert_eq!([a.moved_bytes(&b, &guest), a.moved_bytes(&a, &guest)], [50, 0]);
    }
}
