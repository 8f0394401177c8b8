//! Which partitions of the model are in memory: what is loaded next, and what has to go for it.
//!
//! Rays pile up for partitions that are not in memory. As long as there is room, the partition that
//! most rays wait for is loaded. When there is none left, one that fewer rays wait for makes room;
//! not before the threads are about to run out of rays for what is in memory, and of paths that
//! may be begun: the fuller the piles, the more a load is worth. The load is begun while there is
//! still enough to trace for as long as it takes, and a second one beside it if that is not enough
//! either.
//!
//! A partition that is dropped is out of memory when all pieces that were handed out before have
//! come back. Only then does another one take its room.

use std::time::Duration;

use equilux_common::ids::PartitionId;
use equilux_common::time::Time;

use crate::pieces::PieceId;
use crate::violation::Violation;

/// Of a memory budget, one part in so many is for work that is under way, the rest for partitions.
const WORK_PART: u64 = 4;

/// What a load is taken to cost before there has been one, in nanoseconds per byte: a disk of
/// 500 MB/s.
const LOAD_NANOS_PER_BYTE: f64 = 2.0;

/// How much of the measured speed of loads the last one makes up.
const LAST_LOAD_WEIGHT: f64 = 0.3;

/// Most partitions that are on their way at a time: one thread does not take all that a disk gives,
/// and while threads of a machine have nothing to trace there is more than one to spare.
const LOADS_MAX: usize = 2;

/// Of the room for partitions, several that are on their way take at most one part in so many, for
/// no ray can be traced there meanwhile.
const LOADING_PART: u64 = 4;

/// The least memory of a worker that holds a partition of so many bytes, with the rays that wait.
#[must_use]
pub const fn memory_for(partition_bytes: u64) -> u64 {
    partition_bytes.saturating_mul(WORK_PART) / (WORK_PART - 1) + WORK_PART
}

/// What is to be done to a partition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Order {
    /// Bring it into memory.
    Load(PartitionId),
    /// Let go of it.
    Drop(PartitionId),
}

/// Where a partition is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    Away,
    /// It was asked for then.
    Loading(Time),
    Here,
    /// Dropped, but pieces before this one may still be traced through it.
    Leaving(PieceId),
}

#[derive(Clone, Copy, Debug)]
struct Partition {
    bytes: u64,
    place: Place,
}

/// What there is to do at the moment.
#[derive(Clone, Copy)]
pub(crate) struct Outlook<'a> {
    /// How many rays wait for a partition.
    pub(crate) rays_at: &'a dyn Fn(PartitionId) -> u64,
    /// Nanoseconds that a ray takes a thread.
    pub(crate) ray_nanos: u64,
    /// Nanoseconds that a thread has to do with paths that may be begun, as far as there is room
    /// for the rays that come of them.
    pub(crate) path_nanos: u64,
    /// The oldest piece that is out.
    pub(crate) oldest_piece: Option<PieceId>,
    /// What the next piece will be.
    pub(crate) next_piece: PieceId,
    /// Compute threads.
    pub(crate) threads: u32,
}

/// The partitions of a job's model, as far as this worker has them in memory.
#[derive(Debug)]
pub(crate) struct Residency {
    /// By number; of a replicated model, which is in memory whatever happens, there are none.
    partitions: Vec<Partition>,
    bytes_max: u64,
    /// Taken by what is here, on its way or not quite gone.
    bytes: u64,
    nanos_per_byte: f64,
}

impl Residency {
    /// A replicated model.
    pub(crate) const fn replicated() -> Self {
        Self { partitions: Vec::new(), bytes_max: 0, bytes: 0, nanos_per_byte: LOAD_NANOS_PER_BYTE }
    }

    /// Partitions of these sizes, none of which is in memory, where `budget` bytes may be used.
    pub(crate) fn new(sizes: &[u64], budget: Option<u64>) -> Result<Self, Violation> {
        let bytes_max = partition_bytes_max(budget);
        let largest = sizes.iter().copied().max().unwrap_or(0);
        if largest > bytes_max {
            let least = memory_for(largest);
            return Err(Violation::TooLittleMemory { largest, least });
        }
        Ok(Self {
            partitions: sizes
                .iter()
                .map(|&bytes| Partition { bytes, place: Place::Away })
                .collect(),
            bytes_max,
            ..Self::replicated()
        })
    }

    /// Whether rays can be traced through a partition now.
    pub(crate) fn is_here(&self, partition: PartitionId) -> bool {
        self.is_replicated() || self.place(partition) == Some(Place::Here)
    }

    /// Whether the model is in memory whatever happens.
    pub(crate) const fn is_replicated(&self) -> bool {
        self.partitions.is_empty()
    }

    /// How long it would take to have a partition in memory.
    pub(crate) fn load_time(&self, partition: PartitionId) -> Duration {
        let away = self.partitions.get(partition.0 as usize).filter(|p| p.place != Place::Here);
        away.map_or(Duration::ZERO, |away| {
            Duration::from_nanos((away.bytes as f64 * self.nanos_per_byte) as u64)
        })
    }

    /// A partition that was asked for is in memory.
    pub(crate) fn loaded(&mut self, now: Time, partition: PartitionId) {
        let Some(known) = self.partitions.get_mut(partition.0 as usize) else { return };
        if let Place::Loading(since) = known.place {
            known.place = Place::Here;
            let nanos = now.since(since).as_nanos() as f64 / known.bytes.max(1) as f64;
            self.nanos_per_byte += (nanos - self.nanos_per_byte) * LAST_LOAD_WEIGHT;
        }
    }

    /// What is to be done now.
    pub(crate) fn arrange(&mut self, now: Time, outlook: &Outlook<'_>) -> Vec<Order> {
        if self.is_replicated() {
            return Vec::new();
        }
        self.sweep(outlook.oldest_piece);
        let mut orders = Vec::new();
        while let Some(wanted) = self.wanted(outlook) {
            if !self.may_load_beside(wanted) {
                break;
            }
            if !self.has_room(wanted) {
                let leavers = self.leavers(wanted, outlook);
                for &partition in &leavers {
                    self.partitions[partition].place = Place::Leaving(outlook.next_piece);
                }
                orders.extend(leavers.into_iter().map(|index| Order::Drop(id(index))));
                self.sweep(outlook.oldest_piece);
            }
            // What most rays wait for is not overtaken by something smaller.
            if !self.has_room(wanted) {
                break;
            }
            self.partitions[wanted].place = Place::Loading(now);
            self.bytes += self.partitions[wanted].bytes;
            orders.push(Order::Load(id(wanted)));
        }
        orders
    }

    /// Whether a partition may be loaded while others are on their way.
    fn may_load_beside(&self, wanted: usize) -> bool {
        let count = self.loading().count();
        let bytes: u64 = self.loading().map(|index| self.partitions[index].bytes).sum();
        let is_in_part = (bytes + self.partitions[wanted].bytes) <= self.bytes_max / LOADING_PART;
        count == 0 || (count < LOADS_MAX && is_in_part)
    }

    /// Partitions that are on their way.
    fn loading(&self) -> impl Iterator<Item = usize> {
        let is_loading = |index: &usize| matches!(self.partitions[*index].place, Place::Loading(_));
        (0..self.partitions.len()).filter(is_loading)
    }

    /// The partition that most rays wait for of those that are away.
    fn wanted(&self, outlook: &Outlook<'_>) -> Option<usize> {
        let away = (0..self.partitions.len()).filter(|&index| {
            self.partitions[index].place == Place::Away && (outlook.rays_at)(id(index)) > 0
        });
        away.rev().max_by_key(|&index| (outlook.rays_at)(id(index)))
    }

    /// Which partitions make room for `wanted`: none if there soon will be room, if it is not worth
    /// it yet, or if more rays wait for what is here.
    fn leavers(&self, wanted: usize, outlook: &Outlook<'_>) -> Vec<usize> {
        let is_any_leaving = self.partitions.iter().any(|p| matches!(p.place, Place::Leaving(_)));
        if is_any_leaving || !self.is_hungry(wanted, outlook) {
            return Vec::new();
        }
        let rays = |index: usize| (outlook.rays_at)(id(index));
        let mut here: Vec<usize> = (0..self.partitions.len())
            .filter(|&index| self.partitions[index].place == Place::Here)
            .filter(|&index| rays(index) < rays(wanted))
            .collect();
        here.sort_by_key(|&index| rays(index));
        let mut bytes = self.bytes;
        let mut leavers = Vec::new();
        for index in here {
            if self.bytes_max.saturating_sub(bytes) >= self.partitions[wanted].bytes {
                break;
            }
            bytes -= self.partitions[index].bytes;
            leavers.push(index);
        }
        let is_enough = self.bytes_max.saturating_sub(bytes) >= self.partitions[wanted].bytes;
        if is_enough { leavers } else { Vec::new() }
    }

    /// Whether the threads may run out of work before `wanted` could be here, after what is on its
    /// way already.
    fn is_hungry(&self, wanted: usize, outlook: &Outlook<'_>) -> bool {
        let here = (0..self.partitions.len()).filter(|&index| self.is_here(id(index)));
        let rays: u64 = here.chain(self.loading()).map(|index| (outlook.rays_at)(id(index))).sum();
        let bytes: u64 =
            self.loading().chain([wanted]).map(|index| self.partitions[index].bytes).sum();
        let load = Duration::from_nanos((bytes as f64 * self.nanos_per_byte) as u64);
        let nanos = rays.saturating_mul(outlook.ray_nanos).saturating_add(outlook.path_nanos);
        nanos == 0 || Duration::from_nanos(nanos) < load * outlook.threads
    }

    /// Takes note of what is out of memory by now.
    fn sweep(&mut self, oldest_piece: Option<PieceId>) {
        for partition in &mut self.partitions {
            if let Place::Leaving(piece) = partition.place
                && oldest_piece.is_none_or(|oldest| oldest >= piece)
            {
                partition.place = Place::Away;
                self.bytes -= partition.bytes;
            }
        }
    }

    fn has_room(&self, index: usize) -> bool {
        self.bytes_max.saturating_sub(self.bytes) >= self.partitions[index].bytes
    }

    fn place(&self, partition: PartitionId) -> Option<Place> {
        self.partitions.get(partition.0 as usize).map(|known| known.place)
    }
}

/// Most bytes that partitions may take together, where so much memory may be used.
pub(crate) fn partition_bytes_max(budget: Option<u64>) -> u64 {
    budget.map_or(u64::MAX, |budget| budget - budget / WORK_PART)
}

fn id(index: usize) -> PartitionId {
    PartitionId(u32::try_from(index).expect("partitions are numbered in 32 bits"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SIZE: u64 = 100;

    /// So many bytes that this many partitions of 100 bytes fit.
    fn budget(partitions: u64) -> Option<u64> {
        Some((partitions * SIZE * WORK_PART).div_ceil(WORK_PART - 1))
    }

    fn residency(count: usize, fit: u64) -> Residency {
        Residency::new(&vec![SIZE; count], budget(fit)).expect("room for one")
    }

    /// What to do when so many rays wait for each, and threads have nothing else to do.
    fn arrange(
        residency: &mut Residency,
        rays: &[u64],
        path_nanos: u64,
        oldest: Option<u64>,
    ) -> Vec<Order> {
        let outlook = Outlook {
            rays_at: &|PartitionId(partition)| rays[partition as usize],
            ray_nanos: 1,
            path_nanos,
            oldest_piece: oldest.map(PieceId),
            next_piece: PieceId(10),
            threads: 2,
        };
        residency.arrange(Time::ZERO, &outlook)
    }

    fn load(residency: &mut Residency, partition: u32) {
        residency.loaded(Time::ZERO, PartitionId(partition));
        assert!(residency.is_here(PartitionId(partition)));
    }

    #[test]
    fn a_replicated_model_is_here_and_needs_nothing() {
        let mut residency = Residency::replicated();
        assert!(residency.is_here(PartitionId(0)));
        assert!(arrange(&mut residency, &[], 0, None).is_empty());
    }

    #[test]
    fn what_most_rays_wait_for_is_loaded_one_after_another_while_there_is_room() {
        let mut residency = residency(3, 2);
        assert!(arrange(&mut residency, &[0, 0, 0], u64::MAX, None).is_empty(), "nobody waits");
        assert_eq!(
            arrange(&mut residency, &[5, 9, 9], u64::MAX, None),
            [Order::Load(PartitionId(1))]
        );
        assert!(arrange(&mut residency, &[5, 9, 9], u64::MAX, None).is_empty(), "one at a time");
        load(&mut residency, 1);
        assert_eq!(
            arrange(&mut residency, &[5, 0, 9], u64::MAX, None),
            [Order::Load(PartitionId(2))]
        );
        load(&mut residency, 2);
        assert!(
            arrange(&mut residency, &[50, 0, 0], u64::MAX, None).is_empty(),
            "no room, no hunger"
        );
    }

    #[test]
    fn a_partition_goes_for_another_one_when_all_pieces_before_are_back() {
        let mut residency = residency(3, 2);
        for partition in [0, 1] {
            arrange(&mut residency, &[2, 1, 0], 0, None);
            load(&mut residency, partition);
        }
        let full = [600, 3, 500];
        assert!(arrange(&mut residency, &full, 0, None).is_empty(), "enough to trace");
        let rays = [2, 3, 500];
        assert_eq!(arrange(&mut residency, &rays, 0, Some(8)), [Order::Drop(PartitionId(0))]);
        assert!(!residency.is_here(PartitionId(0)));
        assert!(arrange(&mut residency, &rays, 0, Some(9)).is_empty(), "it is traced still");
        assert_eq!(arrange(&mut residency, &rays, 0, Some(10)), [Order::Load(PartitionId(2))]);
        load(&mut residency, 2);
        let few = [1, 9, 9];
        assert!(arrange(&mut residency, &few, 0, None).is_empty(), "more wait for both here");
    }

    #[test]
    fn two_are_loaded_at_a_time_where_they_are_a_small_part_of_what_fits() {
        let mut residency = residency(12, 8);
        let mut rays = [0; 12];
        rays[..9].copy_from_slice(&[9, 8, 7, 6, 5, 4, 3, 2, 1]);
        let (first, second) = (Order::Load(PartitionId(0)), Order::Load(PartitionId(1)));
        assert_eq!(arrange(&mut residency, &rays, u64::MAX, None), [first, second]);
        assert!(arrange(&mut residency, &rays, u64::MAX, None).is_empty(), "two are on their way");
        load(&mut residency, 1);
        assert_eq!(arrange(&mut residency, &rays, 0, None), [Order::Load(PartitionId(2))]);
        for partition in [0, 2, 3, 4, 5, 6, 7] {
            load(&mut residency, partition);
            arrange(&mut residency, &rays, 0, None);
        }
        let mut rays = [0; 12];
        (rays[0], rays[8], rays[9]) = (10, 200, 200);
        let orders = arrange(&mut residency, &rays, 0, None);
        let swapped = [Order::Drop(PartitionId(1)), Order::Load(PartitionId(8))];
        assert_eq!(orders, swapped, "those are enough for the time of another load");
    }

    #[test]
    fn too_small_a_budget_is_refused_with_the_least_that_works() {
        let sizes = [70, 100, 90];
        let Err(Violation::TooLittleMemory { largest, least }) = Residency::new(&sizes, Some(100))
        else {
            panic!("100 bytes and rays do not fit 100 bytes");
        };
        assert_eq!(largest, 100);
        assert!(Residency::new(&sizes, Some(least)).is_ok());
        assert!(Residency::new(&sizes, None).is_ok());
    }

    proptest! {
        #[test]
        fn memory_is_never_exceeded_and_every_ray_gets_its_turn(
            sizes in prop::collection::vec(1u64..100, 1..12),
            room in 100u64..400,
            rays in prop::collection::vec(0u64..50, 12),
        ) {
            let budget = (room * WORK_PART).div_ceil(WORK_PART - 1);
            let mut residency = Residency::new(&sizes, Some(budget)).expect("room for each");
            let mut rays = rays[..sizes.len()].to_vec();
            let mut here = vec![false; sizes.len()];
            while rays.iter().any(|&rays| rays > 0) {
                let orders = arrange(&mut residency, &rays, 0, None);
                for order in &orders {
                    match *order {
                        Order::Drop(PartitionId(number)) => here[number as usize] = false,
                        Order::Load(PartitionId(number)) => {
                            here[number as usize] = true;
                            residency.loaded(Time::ZERO, PartitionId(number));
                        }
                    }
                }
                let bytes: u64 =
                    sizes.iter().zip(&here).map(|(size, &is_here)| size * u64::from(is_here)).sum();
                prop_assert!(bytes <= budget - budget / WORK_PART);
                let traced = (0..rays.len()).filter(|&number| here[number] && rays[number] > 0);
                let traced: Vec<usize> = traced.collect();
                prop_assert!(!traced.is_empty() || !orders.is_empty(), "stuck with {rays:?}");
                traced.into_iter().for_each(|number| rays[number] = 0);
            }
        }
    }
}
