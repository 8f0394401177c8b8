//! The roster: who takes part, under which number and in which life.
//!
//! A worker is known by its name. Its number is given when the name first appears and stays; each
//! time it comes back it begins a new life, and what an older life still sends is refused.

use std::collections::BTreeMap;

use equilux_common::ids::{Incarnation, WorkerId};
use equilux_common::message::{Home, PeerAddress};
use equilux_common::spread::{PackSources, Tree};
use equilux_common::topology::Topology;

use crate::event::Hello;

/// Most names that are remembered. A worker beyond is not let in.
const NAMES_MAX: usize = 1 << 16;

/// A worker that takes part.
#[derive(Clone, Debug)]
pub(crate) struct Member {
    /// In which life.
    pub(crate) incarnation: Incarnation,
    /// As it introduced itself.
    pub(crate) hello: Hello,
}

impl Member {
    /// How much it computes per second, relative to others; at least 1.
    pub(crate) fn capacity(&self) -> u64 {
        (u64::from(self.hello.threads) * u64::from(self.hello.speed)).max(1)
    }
}

/// Who takes part.
#[derive(Debug, Default)]
pub(crate) struct Roster {
    /// Number and number of lives of every name that ever appeared.
    names: BTreeMap<String, (WorkerId, Incarnation)>,
    /// By number; where they stand here is their place in a topology.
    members: Vec<(WorkerId, Member)>,
}

impl Roster {
    /// The number and the life that a name would get now; none if there are too many names.
    pub(crate) fn next_life(&self, name: &str) -> Option<(WorkerId, Incarnation)> {
        if let Some(&(worker, Incarnation(last))) = self.names.get(name) {
            return Some((worker, Incarnation(last + 1)));
        }
        let next = u32::try_from(self.names.len()).ok().filter(|_| self.names.len() < NAMES_MAX)?;
        Some((WorkerId(next), Incarnation(0)))
    }

    /// Lets a worker in, in the life that [`Self::next_life`] gave.
    pub(crate) fn admit(&mut self, worker: WorkerId, incarnation: Incarnation, hello: Hello) {
        self.names.insert(hello.name.clone(), (worker, incarnation));
        let member = Member { incarnation, hello };
        match self.place(worker) {
            Ok(place) => self.members[place].1 = member,
            Err(place) => self.members.insert(place, (worker, member)),
        }
    }

    /// Takes a worker out; gives it back if it was in.
    pub(crate) fn remove(&mut self, worker: WorkerId, incarnation: Incarnation) -> Option<Member> {
        if !self.has(worker, incarnation) {
            return None;
        }
        let place = self.place(worker).ok()?;
        Some(self.members.remove(place).1)
    }

    /// Whether this life of the worker takes part.
    pub(crate) fn has(&self, worker: WorkerId, incarnation: Incarnation) -> bool {
        self.member(worker).is_some_and(|member| member.incarnation == incarnation)
    }

    /// A worker that takes part.
    pub(crate) fn member(&self, worker: WorkerId) -> Option<&Member> {
        self.place(worker).ok().map(|place| &self.members[place].1)
    }

    /// All who take part, by number.
    pub(crate) fn members(&self) -> impl Iterator<Item = (WorkerId, &Member)> {
        self.members.iter().map(|(worker, member)| (*worker, member))
    }

    /// How many take part.
    pub(crate) fn len(&self) -> usize {
        self.members.len()
    }

    /// Where those are found with whom a worker exchanges work, by number; nobody if it does not
    /// take part.
    pub(crate) fn neighbors(&self, worker: WorkerId, topology: &Topology) -> Vec<PeerAddress> {
        let Ok(place) = self.place(worker) else { return Vec::new() };
        let places = topology.neighbors(place, self.members.len());
        places.into_iter().map(|place| self.address(place)).collect()
    }

    /// A worker as a home of partitions, if it takes part.
    pub(crate) fn home(&self, worker: WorkerId) -> Option<Home> {
        let place = self.place(worker).ok()?;
        let memory = self.members[place].1.hello.memory;
        Some(Home { peer: self.address(place), memory, is_late: false, is_lost: false })
    }

    /// Who passes packs on to a worker, by its place among those who take part now. They came
    /// before it or with it, so nobody waits for himself in a ring.
    pub(crate) fn pack_sources(&self, worker: WorkerId) -> PackSources {
        let Ok(place) = self.place(worker) else { return [None, None] };
        let parent = |tree: Tree| tree.parent(place, self.members.len());
        Tree::ALL.map(|tree| parent(tree).map(|place| self.address(place)))
    }

    /// Where a worker stands among the members, or would.
    fn place(&self, worker: WorkerId) -> Result<usize, usize> {
        self.members.binary_search_by_key(&worker, |&(worker, _)| worker)
    }

    fn address(&self, place: usize) -> PeerAddress {
        let (worker, Member { incarnation, hello }) = &self.members[place];
        let (worker, incarnation, address) = (*worker, *incarnation, hello.address.clone());
        PeerAddress { worker, incarnation, address }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hello(name: &str) -> Hello {
        let address = format!("{name}:1").into();
        Hello { name: name.into(), address, threads: 2, speed: 1000, memory: None }
    }

    #[test]
    fn a_name_keeps_its_number_and_begins_a_new_life_each_time() {
        let mut roster = Roster::default();
        for name in ["anna", "bert"] {
            let (worker, incarnation) = roster.next_life(name).expect("few names");
            roster.admit(worker, incarnation, hello(name));
        }
        assert_eq!(roster.next_life("anna"), Some((WorkerId(0), Incarnation(1))));
        assert!(roster.remove(WorkerId(0), Incarnation(0)).is_some());
        assert!(roster.remove(WorkerId(0), Incarnation(0)).is_none());
        roster.admit(WorkerId(0), Incarnation(1), hello("anna"));
        assert!(
            roster.has(WorkerId(0), Incarnation(1)) && !roster.has(WorkerId(0), Incarnation(0))
        );
        let (worker, incarnation) = roster.next_life("carl").expect("few names");
        roster.admit(worker, incarnation, hello("carl"));
        let neighbors = |worker| {
            let neighbors = roster.neighbors(WorkerId(worker), &Topology::Hypercube);
            neighbors.into_iter().map(|peer| peer.address.to_string()).collect::<Vec<_>>()
        };
        assert_eq!(neighbors(0), ["bert:1", "carl:1"]);
        assert_eq!(neighbors(2), ["anna:1"]);
        assert!(neighbors(3).is_empty());
        let sources = |worker| {
            roster
                .pack_sources(WorkerId(worker))
                .map(|from| from.map(|peer| peer.address.to_string()))
        };
        let [anna, bert] = ["anna:1", "bert:1"].map(|address| Some(address.to_owned()));
        assert_eq!(sources(0), [bert.clone(), None]);
        assert_eq!(sources(1), [None, anna.clone()]);
        assert_eq!(sources(2), [bert, anna]);
        assert_eq!(sources(3), [None, None]);
    }
}
