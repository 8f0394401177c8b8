//! An exchange between two regions that touch: clusters change sides until no sequence of moves
//! makes the cut between the two smaller.
//!
//! This is the move-based improvement of Kernighan & Lin (1970) in the form of Fiduccia &
//! Mattheyses (1982). The cluster that gains most goes first, also at a loss, each once; of all
//! states on the way the best one stays. Nothing but the two regions is looked at, so pairs without
//! a region in common may do it at the same time, each between two workers.

use std::collections::BinaryHeap;

use crate::regions::Regions;

/// Moves without a better state after which an exchange gives up. With 150, cuts are the same, and
/// mapping takes a quarter longer.
const PATIENCE_MOVES: usize = 64;

/// A state on the way: bytes beyond what the two may have, and the affinity cut between them, less
/// that at the beginning. Smaller is better.
type Worth = (u64, i64);

/// Exchanges clusters between the regions of `pair`. `flow` bytes are to go from the first to the
/// second, so far as the first has them beyond its limit. `notes` has one for each cluster, all of
/// them blank before and after. Says whether anything moved.
pub(crate) fn exchange(
    regions: &mut Regions<'_>,
    pair: [usize; 2],
    flow: u64,
    notes: &mut [Note],
) -> bool {
    let members = pair.map(|region| std::mem::take(&mut regions.members[region]));
    let moves = Exchange::new(regions, pair, flow, &members, notes).run();
    members.iter().flatten().for_each(|&member| notes[member as usize] = Note::Blank);
    let members = if moves.is_empty() { members } else { sides(regions, pair, &members.concat()) };
    for (region, members) in pair.into_iter().zip(members) {
        regions.members[region] = members;
    }
    !moves.is_empty()
}

/// The members of each of the two, ascending.
fn sides(regions: &Regions<'_>, pair: [usize; 2], members: &[u32]) -> [Vec<u32>; 2] {
    pair.map(|region| {
        let is_here = |&member: &u32| regions.homes.of(member as usize) as usize == region;
        let mut side: Vec<_> = members.iter().copied().filter(is_here).collect();
        side.sort_unstable();
        side
    })
}

/// What is known of a cluster during an exchange.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Note {
    /// It does not take part.
    Blank,
    /// What the cut loses if it changes sides.
    Gain(i64),
    /// It has changed sides, or there was no room.
    Done,
}

struct Exchange<'e, 'r> {
    regions: &'e mut Regions<'r>,
    pair: [usize; 2],
    /// What each may have in the end.
    limits: [u64; 2],
    notes: &'e mut [Note],
    /// For each side, clusters by their gain; those whose gain has changed are out of date. If
    /// nothing is to flow, those inside come in only when one that they are tied to has moved.
    queues: [BinaryHeap<(i64, u32)>; 2],
}

impl<'e, 'r> Exchange<'e, 'r> {
    fn new(
        regions: &'e mut Regions<'r>,
        pair: [usize; 2],
        flow: u64,
        members: &[Vec<u32>; 2],
        notes: &'e mut [Note],
    ) -> Self {
        let flow = flow.min(regions.excess(pair[0]));
        let [from, to] = pair.map(|region| (regions.loads[region], regions.limits[region]));
        let limits = [from.1.max(from.0 - flow), to.1.max(to.0 + flow)];
        let queues = [0, 1].map(|side| {
            let mut queue = Vec::new();
            for &member in &members[side] {
                let (gain, is_at_border) = gain(regions, pair, side, member);
                notes[member as usize] = Note::Gain(gain);
                if flow > 0 || is_at_border {
                    queue.push((gain, member));
                }
            }
            BinaryHeap::from(queue)
        });
        Self { regions, pair, limits, notes, queues }
    }

    /// Moves clusters, back again those after the best state, and gives the others.
    fn run(&mut self) -> Vec<u32> {
        let mut moves = Vec::new();
        let mut cut = 0;
        let (mut best, mut best_count): (Worth, _) = ((self.violation(), 0), 0);
        while moves.len() < best_count + PATIENCE_MOVES {
            let Some((gain, cluster)) = self.next() else { break };
            self.change_sides(cluster);
            moves.push(cluster);
            cut -= gain;
            let worth = (self.violation(), cut);
            if worth < best {
                (best, best_count) = (worth, moves.len());
            }
        }
        for cluster in moves.drain(best_count..) {
            let to = self.opposite(cluster);
            self.regions.rehome(cluster, to);
        }
        moves
    }

    /// Bytes beyond what the two may have in the end.
    fn violation(&self) -> u64 {
        let [a, b] = [0, 1].map(|side| self.load(side).saturating_sub(self.limits[side]));
        a + b
    }

    fn load(&self, side: usize) -> u64 {
        self.regions.loads[self.pair[side]]
    }

    fn opposite(&self, cluster: u32) -> usize {
        let is_first = self.regions.homes.of(cluster as usize) as usize == self.pair[0];
        self.pair[usize::from(is_first)]
    }

    /// The cluster that gains most where it has room; from a side that has too much, the one that
    /// gains most. If none has room, one goes all the same: so two change places where clusters are
    /// larger than what limits leave (Fiduccia & Mattheyses let balance be off by a cell).
    fn next(&mut self) -> Option<(i64, u32)> {
        loop {
            let tops = [0, 1].map(|side| self.top(side));
            let over = [0, 1].map(|side| self.load(side) > self.limits[side]);
            let side = match (over, tops) {
                (_, [None, None]) => return None,
                ([true, false], [top, _]) => return self.taken(top, 0),
                ([false, true], [_, top]) => return self.taken(top, 1),
                (_, [Some(a), Some(b)]) if a.0 == b.0 => {
                    usize::from(self.regions.is_fuller(self.pair[1], self.pair[0]))
                }
                (_, [a, b]) => usize::from(b.map(|it| it.0) > a.map(|it| it.0)),
            };
            for side in [side, 1 - side] {
                if tops[side].is_some_and(|(_, cluster)| self.has_room(1 - side, cluster)) {
                    return self.taken(tops[side], side);
                }
            }
            if over == [false, false] {
                // The other side gives something back next.
                return self.taken(tops[side], side);
            }
            self.taken(tops[side], side);
        }
    }

    fn has_room(&self, side: usize, cluster: u32) -> bool {
        let bytes = self.regions.clusters.bytes(cluster as usize);
        self.load(side) + bytes <= self.limits[side]
    }

    /// The first of a queue that is up to date.
    fn top(&mut self, side: usize) -> Option<(i64, u32)> {
        while let Some(&(gain, cluster)) = self.queues[side].peek() {
            if self.notes[cluster as usize] == Note::Gain(gain) {
                return Some((gain, cluster));
            }
            self.queues[side].pop();
        }
        None
    }

    /// Takes the first of a queue out, for good.
    fn taken(&mut self, top: Option<(i64, u32)>, side: usize) -> Option<(i64, u32)> {
        let (_, cluster) = top?;
        self.queues[side].pop();
        self.notes[cluster as usize] = Note::Done;
        top
    }

    fn change_sides(&mut self, cluster: u32) {
        let to = self.opposite(cluster);
        self.regions.rehome(cluster, to);
        let clusters = self.regions.clusters;
        for &(other, affinity) in clusters.ties(cluster as usize) {
            // A pin takes no part, and has no note.
            if let Some(Note::Gain(gain)) = self.notes.get_mut(other as usize) {
                let home = self.regions.homes.of(other as usize) as usize;
                *gain += if home == to { -2 * affinity } else { 2 * affinity };
                self.queues[usize::from(home == self.pair[1])].push((*gain, other));
            }
        }
    }
}

/// What the cut between the two loses if `cluster` goes from its side to the other, and whether it
/// is tied to that.
fn gain(regions: &Regions<'_>, pair: [usize; 2], side: usize, cluster: u32) -> (i64, bool) {
    let [own, other] = [pair[side], pair[1 - side]];
    let mut sums = (0, false);
    for &(end, affinity) in regions.clusters.ties(cluster as usize) {
        let home = regions.homes.of(end as usize) as usize;
        if home == own {
            sums.0 -= affinity;
        } else if home == other {
            sums = (sums.0 + affinity, true);
        }
    }
    sums
}
