//! The giving side of balancing: who wants work, and how much is on its way to whom.
//!
//! A request that cannot be met is kept in mind (a lifeline: Saraswat et al., *Lifeline-based
//! global load balancing*, 2011). Its amount is that of a moment that is gone; when there is
//! something to give, those who wait get their share of it, in proportion to what they named. Every
//! gift takes a place in the window of its receiver until it is acknowledged.

use std::collections::BTreeMap;
use std::time::Duration;

use equilux_common::ids::{PartitionId, WorkerId};
use equilux_common::time::Time;

/// Most gifts that a peer may have received without saying so. Enough for a round trip's worth of
/// bundles on a fast network; few enough to bound what a broken link can lose.
pub(crate) const WINDOW_GIFTS: u32 = 64;

/// What is offered after a refusal is worth so many times as much: costs are estimates, and to ask
/// again for a little more is not worth the messages.
const OFFER_GROWTH: u64 = 2;

/// Requests and windows.
#[derive(Debug, Default)]
pub(crate) struct Giving {
    requests: BTreeMap<WorkerId, Request>,
    unacknowledged: BTreeMap<WorkerId, u32>,
    /// Partitions that peers have taken copies of last.
    copies: BTreeMap<WorkerId, PartitionId>,
    interrupted: Option<Time>,
}

#[derive(Debug)]
struct Request {
    /// Nanoseconds of one thread of this worker that are still wanted.
    nanos: u64,
    /// Whether it could not be met when it came.
    is_waiting: bool,
    /// Whether threads were interrupted for it.
    has_interrupted: bool,
    /// Whether a copy of a partition was offered, and there is no answer yet.
    is_offered: bool,
    /// Nanoseconds that an offer has to be worth: more than what was refused.
    offer_min: u64,
}

impl Giving {
    /// A peer wants work; what it wanted before does not count any more.
    pub(crate) fn ask(&mut self, peer: WorkerId, nanos: u64) {
        let earlier = self.requests.get(&peer);
        let is_offered = earlier.is_some_and(|request| request.is_offered);
        let offer_min = earlier.map_or(0, |request| request.offer_min);
        // By now it may have let go of it.
        self.copies.remove(&peer);
        let request =
            Request { nanos, is_waiting: false, has_interrupted: false, is_offered, offer_min };
        self.requests.insert(peer, request);
    }

    /// How many nanoseconds rays must be worth at least that are offered to a peer with a copy of
    /// their partition; none if nothing may be offered now.
    pub(crate) fn offer_min(&self, peer: WorkerId) -> Option<u64> {
        let request = self.requests.get(&peer).filter(|request| !request.is_offered);
        request.map(|request| request.offer_min)
    }

    /// A copy of a partition was offered to a peer, with rays of so many nanoseconds.
    pub(crate) fn offer(&mut self, peer: WorkerId, nanos: u64) {
        if let Some(request) = self.requests.get_mut(&peer) {
            (request.is_offered, request.offer_min) = (true, nanos.saturating_mul(OFFER_GROWTH));
        }
    }

    /// A peer has a copy of a partition.
    pub(crate) fn take_offer(&mut self, peer: WorkerId, partition: PartitionId) {
        self.copies.insert(peer, partition);
        if let Some(request) = self.requests.get_mut(&peer) {
            (request.is_offered, request.is_waiting) = (false, false);
        }
    }

    /// A peer does not want what it was offered.
    pub(crate) fn refuse_offer(&mut self, peer: WorkerId) {
        if let Some(request) = self.requests.get_mut(&peer) {
            request.is_offered = false;
        }
    }

    /// The partition that a peer has taken a copy of last.
    pub(crate) fn copy_at(&self, peer: WorkerId) -> Option<PartitionId> {
        self.copies.get(&peer).copied()
    }

    /// A peer says that gifts have arrived.
    pub(crate) fn acknowledge(&mut self, peer: WorkerId, count: u32) {
        if let Some(gifts) = self.unacknowledged.get_mut(&peer) {
            *gifts = gifts.saturating_sub(count);
        }
    }

    /// A peer is gone; says whether gifts were on their way to it.
    pub(crate) fn forget(&mut self, peer: WorkerId) -> bool {
        self.requests.remove(&peer);
        self.copies.remove(&peer);
        self.unacknowledged.remove(&peer).is_some_and(|gifts| gifts > 0)
    }

    /// A peer has work by now; what it wanted does not count any more.
    pub(crate) fn withdraw(&mut self, peer: WorkerId) {
        self.requests.remove(&peer);
    }

    /// Whose requests can be met as far as their windows go, with the nanoseconds that each should
    /// get: what it asked for; if it waits, its share of the `excess`, of which `kept` is this
    /// worker's measure.
    pub(crate) fn takers(&self, excess: u64, kept: u64) -> Vec<(WorkerId, u64)> {
        let wanted = self.requests.values().map(|request| u128::from(request.nanos));
        let sum = (wanted.sum::<u128>() + u128::from(kept)).max(1);
        let share = |nanos: u64| {
            let share = u128::from(nanos) * u128::from(excess) / sum;
            u64::try_from(share).unwrap_or(u64::MAX)
        };
        let amount = |request: &Request| {
            if request.is_waiting { request.nanos.max(share(request.nanos)) } else { request.nanos }
        };
        let requests = self.requests.iter().filter(|&(&peer, _)| self.has_room(peer));
        requests.map(|(&peer, request)| (peer, amount(request))).collect()
    }

    /// Whether a peer's window has a place left.
    pub(crate) fn has_room(&self, peer: WorkerId) -> bool {
        self.unacknowledged.get(&peer).is_none_or(|&gifts| gifts < WINDOW_GIFTS)
    }

    /// Something was given to a peer.
    pub(crate) fn give(&mut self, peer: WorkerId) {
        *self.unacknowledged.entry(peer).or_default() += 1;
    }

    /// A request was met up to `rest`. What cannot be given although the window has room is let go:
    /// the peer has something now, and asks again when it needs to.
    pub(crate) fn settle(&mut self, peer: WorkerId, rest: u64) {
        if rest == 0 || self.has_room(peer) {
            self.requests.remove(&peer);
        } else if let Some(request) = self.requests.get_mut(&peer) {
            (request.nanos, request.is_waiting) = (rest, false);
        }
    }

    /// Nothing could be given to a peer: it waits.
    pub(crate) fn keep_waiting(&mut self, peer: WorkerId) {
        if let Some(request) = self.requests.get_mut(&peer) {
            request.is_waiting = true;
        }
    }

    /// When threads may be interrupted for somebody who waits, not more often than in `interval`,
    /// and whether they have not been already for one of them.
    pub(crate) fn interrupt_time(&self, interval: Duration) -> Option<(Time, bool)> {
        let mut waiting = self.requests.iter().filter(|&(&peer, _)| self.has_room(peer)).peekable();
        waiting.peek()?;
        let is_news = waiting.any(|(_, request)| !request.has_interrupted);
        Some((self.interrupted.map_or(Time::ZERO, |last| last + interval), is_news))
    }

    /// Threads are interrupted now, for all who wait.
    pub(crate) fn interrupt(&mut self, now: Time) {
        self.interrupted = Some(now);
        for request in self.requests.values_mut() {
            request.has_interrupted = true;
        }
    }

    /// The fullest window.
    pub(crate) fn unacknowledged_max(&self) -> u32 {
        self.unacknowledged.values().copied().max().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PEER: WorkerId = WorkerId(3);
    const OTHER: WorkerId = WorkerId(5);

    #[test]
    fn a_window_fills_and_the_rest_is_kept_in_mind() {
        let mut giving = Giving::default();
        giving.ask(PEER, 1000);
        for _ in 0..WINDOW_GIFTS {
            assert!(giving.has_room(PEER));
            giving.give(PEER);
        }
        giving.settle(PEER, 300);
        assert!(giving.takers(9999, 0).is_empty(), "the window is full");
        giving.acknowledge(PEER, 2);
        assert_eq!(giving.takers(9999, 0), [(PEER, 300)]);
        giving.settle(PEER, 100);
        assert!(giving.takers(9999, 0).is_empty(), "there was room, but nothing to give");
        assert!(giving.forget(PEER), "gifts were on their way");
    }

    #[test]
    fn who_waits_gets_a_share_of_what_there_is_and_who_has_just_asked_what_it_asked_for() {
        let mut giving = Giving::default();
        giving.ask(PEER, 1000);
        giving.keep_waiting(PEER);
        giving.ask(OTHER, 2000);
        assert_eq!(giving.takers(40_000, 1000), [(PEER, 10_000), (OTHER, 2000)]);
        assert_eq!(giving.takers(2000, 1000), [(PEER, 1000), (OTHER, 2000)]);
        giving.withdraw(PEER);
        assert_eq!(giving.takers(40_000, 1000), [(OTHER, 2000)]);
    }

    #[test]
    fn an_interrupt_is_news_once_per_request_and_not_too_often() {
        let (mut giving, interval) = (Giving::default(), Duration::from_millis(2));
        assert_eq!(giving.interrupt_time(interval), None);
        giving.ask(PEER, 1000);
        assert_eq!(giving.interrupt_time(interval), Some((Time::ZERO, true)));
        giving.interrupt(Time::from_nanos(50));
        let soonest = Time::from_nanos(50) + interval;
        assert_eq!(giving.interrupt_time(interval), Some((soonest, false)));
        giving.ask(PEER, 1000);
        assert_eq!(giving.interrupt_time(interval), Some((soonest, true)));
    }
}
