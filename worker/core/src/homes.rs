//! Homes: which worker answers for which partition.
//!
//! Those who were there at the start share the partitions among them, in proportion to their
//! memory: as runs in the order of a recursive bisection, or by diffusion (the paper's section
//! 5.1). When homes are lost, diffusion goes on from there with all who live; a bisection would
//! move nearly everything, so the partitions of the lost go over to those who have least. Whoever
//! has the same list finds the same homes; and who has not heard of a change yet does no harm, for
//! a ray that comes to the wrong door is handed on.

use equilux_common::balancing::Mapping;
use equilux_common::ids::{PartitionId, WorkerId};
use equilux_common::message::Home;
use equilux_mapping::{Guest, Host, Seat, bisect, diffuse};

/// Who is home to what.
#[derive(Debug)]
pub(crate) struct Homes {
    way: Mapping,
    list: Vec<Home>,
    /// By partition.
    of: Vec<WorkerId>,
}

impl Homes {
    /// Nobody is known yet, and no partition.
    pub(crate) const fn new(way: Mapping) -> Self {
        Self { way, list: Vec::new(), of: Vec::new() }
    }

    /// Takes note of who there is, and of the partitions if they are known.
    pub(crate) fn change(&mut self, list: Vec<Home>, partitions: Option<&Guest>) {
        self.of = partitions.map_or(Vec::new(), |partitions| assign(self.way, &list, partitions));
        self.list = list;
    }

    /// Takes note of the partitions.
    pub(crate) fn resize(&mut self, partitions: &Guest) {
        self.of = assign(self.way, &self.list, partitions);
    }

    /// Who is home to a partition, if that is known.
    pub(crate) fn of(&self, PartitionId(partition): PartitionId) -> Option<WorkerId> {
        self.of.get(partition as usize).copied()
    }

    /// All who are home to something, or may be.
    pub(crate) fn living(&self) -> impl Iterator<Item = &Home> {
        living(&self.list)
    }
}

fn living(list: &[Home]) -> impl Iterator<Item = &Home> {
    list.iter().filter(|home| !home.is_lost)
}

/// The home of each partition; none at all if nobody lives.
fn assign(way: Mapping, list: &[Home], partitions: &Guest) -> Vec<WorkerId> {
    if living(list).next().is_none() {
        return Vec::new();
    }
    let model = bytes(partitions);
    let founders = list.iter().filter(|home| !home.is_late);
    let is_any_lost = list.iter().any(|home| home.is_lost && !home.is_late);
    match (way, host(founders, model)) {
        (Mapping::Bisection, Some(host)) => {
            let homes = bisect(partitions, &host).homes().to_vec();
            adopt(list, &homes, partitions)
        }
        (Mapping::Diffusion, Some(founders)) => {
            let first = diffuse(partitions, &founders, None).mapping;
            match host(living(list), model).filter(|_| is_any_lost) {
                Some(living) => diffuse(partitions, &living, Some(&first)).mapping.homes().to_vec(),
                None => first.homes().to_vec(),
            }
        }
        (_, None) => adopt(list, &[], partitions),
    }
}

/// Workers with their memory; nothing if there are none, one is there in two lives, or they have
/// more memory than can be counted.
fn host<'a>(homes: impl Iterator<Item = &'a Home>, model: u64) -> Option<Host> {
    let seat = |home: &Home| Seat { worker: home.peer.worker, capacity: weight(home, model) };
    Host::new(homes.map(seat).collect()).ok()
}

/// Gives the partitions of the lost, and those that nobody is home to, to those who have least in
/// proportion to their memory.
fn adopt(list: &[Home], homes: &[WorkerId], partitions: &Guest) -> Vec<WorkerId> {
    let model = bytes(partitions);
    let mut loads: Vec<(&Home, u128)> = living(list).map(|home| (home, 0)).collect();
    let sizes = partitions.objects().iter().map(|object| u128::from(object.bytes));
    let mut adopted: Vec<Option<WorkerId>> = Vec::new();
    for (index, size) in sizes.clone().enumerate() {
        let home = homes.get(index);
        let load = loads.iter_mut().find(|(home_of, _)| Some(&home_of.peer.worker) == home);
        adopted.push(load.map(|(home, load)| {
            *load += size;
            home.peer.worker
        }));
    }
    let home = |(home, size): (Option<WorkerId>, u128)| {
        home.unwrap_or_else(|| {
            let fullness = |&(home, load): &(&Home, u128), other: &(&Home, u128)| {
                let [own, others] = [home, other.0].map(|home| u128::from(weight(home, model)));
                ((load + 1) * others).cmp(&((other.1 + 1) * own))
            };
            let emptiest = loads.iter_mut().min_by(|a, b| fullness(a, b));
            let (home, load) = emptiest.expect("somebody lives");
            *load += size;
            home.peer.worker
        })
    };
    adopted.into_iter().zip(sizes).map(home).collect()
}

fn weight(home: &Home, model: u64) -> u64 {
    home.memory.unwrap_or(model).clamp(1, model)
}

fn bytes(partitions: &Guest) -> u64 {
    partitions.objects().iter().map(|object| object.bytes).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use equilux_common::balancing::Word;
    use equilux_common::ids::Incarnation;
    use equilux_common::message::PeerAddress;
    use equilux_mapping::{Object, Tie};
    use proptest::prelude::*;

    fn home(worker: u32, memory: Option<u64>) -> Home {
        let peer = PeerAddress {
            worker: WorkerId(worker),
            incarnation: Incarnation(0),
            address: "".into(),
        };
        Home { peer, memory, is_late: false, is_lost: false }
    }

    /// Partitions of these sizes, side by side.
    fn guest(sizes: &[u64]) -> Guest {
        let place = |(at, &bytes): (usize, &u64)| Object { bytes, position: [at as f32, 0.0, 0.0] };
        let ties = (1..sizes.len()).map(|at| Tie { objects: [at - 1, at], affinity: 5 });
        Guest::new(sizes.iter().enumerate().map(place).collect(), ties.collect()).expect("a row")
    }

    fn homes_by(way: Mapping, list: &[Home], sizes: &[u64]) -> Vec<u32> {
        let mut homes = Homes::new(way);
        homes.change(list.to_vec(), Some(&guest(sizes)));
        homes.of.iter().map(|worker| worker.0).collect()
    }

    fn homes(list: &[Home], sizes: &[u64]) -> Vec<u32> {
        homes_by(Mapping::Bisection, list, sizes)
    }

    #[test]
    fn those_who_were_there_get_runs_in_proportion_to_their_memory() {
        let list = [home(3, Some(200)), home(5, Some(100)), home(8, Some(300))];
        assert_eq!(homes(&list, &[100; 6]), [3, 3, 5, 8, 8, 8]);
        assert_eq!(homes(&list[..2], &[300, 100, 50]), [3, 5, 5]);
        let all = [home(0, None), home(1, Some(20)), home(2, None)];
        assert_eq!(homes(&all, &[10; 11]), [0, 0, 0, 0, 0, 1, 2, 2, 2, 2, 2]);
        assert!(homes(&[], &[10; 10]).is_empty());
    }

    #[test]
    fn diffusion_goes_on_from_where_it_was_when_a_home_is_lost() {
        let mut list = vec![home(0, Some(100)), home(1, Some(100)), home(2, Some(100))];
        let before = homes_by(Mapping::Diffusion, &list, &[50; 30]);
        let parts = before.windows(2).filter(|pair| pair[0] != pair[1]).count();
        assert_eq!(parts, 2, "three runs: {before:?}");
        list[1].is_lost = true;
        let after = homes_by(Mapping::Diffusion, &list, &[50; 30]);
        assert!(after.iter().all(|&home| home != 1), "{after:?}");
        let moved = before.iter().zip(&after).filter(|(before, after)| before != after).count();
        assert!(moved < 15, "{before:?} {after:?}");
    }

    #[test]
    fn what_a_lost_home_had_goes_over_to_all_that_live() {
        let mut list = vec![home(0, Some(100)), home(1, Some(100)), home(2, Some(100))];
        list[1].is_lost = true;
        assert_eq!(homes(&list, &[50; 6]), [0, 0, 0, 2, 2, 2]);
        list.push(Home { is_late: true, ..home(7, Some(100)) });
        assert_eq!(homes(&list, &[50; 6]), [0, 0, 7, 7, 2, 2]);
        list.iter_mut().for_each(|home| home.is_lost = true);
        assert!(homes(&list, &[50; 6]).is_empty());
    }

    proptest! {
        #[test]
        fn every_partition_is_at_home_with_somebody_who_lives(
            sizes in prop::collection::vec(prop_oneof![1u64..9, 1u64..1 << 50], 1..40),
            way in prop::sample::select(Mapping::ALL),
            memories in prop::collection::vec(prop::option::of(any::<u64>()), 1..9),
            lost in any::<u8>(), late in any::<u8>(),
        ) {
            let flag = |bits: u8, index: usize| bits >> (index % 8) & 1 == 1;
            let list = memories.iter().enumerate().map(|(index, &memory)| Home {
                is_lost: flag(lost, index), is_late: flag(late, index), ..home(index as u32, memory)
            });
            let list: Vec<Home> = list.collect();
            let homes = homes_by(way, &list, &sizes);
            if list.iter().all(|home| home.is_lost) {
                prop_assert!(homes.is_empty());
                return Ok(());
            }
            prop_assert_eq!(homes.len(), sizes.len());
            prop_assert!(homes.iter().all(|&home| !list[home as usize].is_lost));
        }
    }
}
