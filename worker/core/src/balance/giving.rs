//! The giving side of balancing: who wants work, and how much is on its way to whom.
//!
//! A request that cannot be met is kept in mind (a lifeline: Saraswat et al., *Lifeline-based
//! global load balancing*, 2011) until something can be given for it. Every gift takes a place in
//! the window of its receiver until it is acknowledged.

use std::collections::BTreeMap;
use std::time::Duration;

use equilux_common::ids::WorkerId;
use equilux_common::time::Time;

/// Most gifts that a peer may have received without saying so. Enough for a round trip's worth of
/// bundles on a fast network; few enough to bound what a broken link can lose.
pub(crate) const WINDOW_GIFTS: u32 = 64;

/// Threads are interrupted at most this often, so that giving up work never becomes the work.
const INTERRUPT_INTERVAL_MIN: Duration = Duration::from_millis(2);

/// Requests and windows.
#[derive(Debug, Default)]
pub(crate) struct Giving {
    requests: BTreeMap<WorkerId, Request>,
    unacknowledged: BTreeMap<WorkerId, u32>,
    interrupted: Option<Time>,
}

#[derive(Debug)]
struct Request {
    /// Nanoseconds of one thread of this worker that are still wanted.
    nanos: u64,
    /// Whether threads were interrupted for it.
    has_interrupted: bool,
}

impl Giving {
    /// A peer wants work; what it wanted before does not count any more.
    pub(crate) fn ask(&mut self, peer: WorkerId, amount: Duration) {
        let nanos = u64::try_from(amount.as_nanos()).unwrap_or(u64::MAX);
        self.requests.insert(peer, Request { nanos, has_interrupted: false });
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
        self.unacknowledged.remove(&peer).is_some_and(|gifts| gifts > 0)
    }

    /// Whose requests can be met as far as their windows go, with the nanoseconds wanted.
    pub(crate) fn takers(&self) -> Vec<(WorkerId, u64)> {
        let requests = self.requests.iter().filter(|&(&peer, _)| self.has_room(peer));
        requests.map(|(&peer, request)| (peer, request.nanos)).collect()
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
            request.nanos = rest;
        }
    }

    /// When threads may be interrupted for somebody who waits; none if nobody waits for whom they
    /// have not been already.
    pub(crate) fn interrupt_deadline(&self) -> Option<Time> {
        let is_waiting = |(&peer, request): (&WorkerId, &Request)| {
            !request.has_interrupted && self.has_room(peer)
        };
        self.requests
            .iter()
            .any(is_waiting)
            .then(|| self.interrupted.map_or(Time::ZERO, |last| last + INTERRUPT_INTERVAL_MIN))
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

    #[test]
    fn a_window_fills_and_the_rest_is_kept_in_mind() {
        let mut giving = Giving::default();
        giving.ask(PEER, Duration::from_nanos(1000));
        for _ in 0..WINDOW_GIFTS {
            assert!(giving.has_room(PEER));
            giving.give(PEER);
        }
        giving.settle(PEER, 300);
        assert!(giving.takers().is_empty(), "the window is full");
        giving.acknowledge(PEER, 2);
        assert_eq!(giving.takers(), [(PEER, 300)]);
        giving.settle(PEER, 100);
        assert!(giving.takers().is_empty(), "there was room, but nothing to give");
        assert!(giving.forget(PEER), "gifts were on their way");
    }

    #[test]
    fn threads_are_interrupted_once_per_request_and_not_too_often() {
        let mut giving = Giving::default();
        assert_eq!(giving.interrupt_deadline(), None);
        giving.ask(PEER, Duration::from_nanos(1000));
        assert_eq!(giving.interrupt_deadline(), Some(Time::ZERO));
        giving.interrupt(Time::from_nanos(50));
        assert_eq!(giving.interrupt_deadline(), None);
        giving.ask(PEER, Duration::from_nanos(1000));
        let soonest = Time::from_nanos(50) + INTERRUPT_INTERVAL_MIN;
        assert_eq!(giving.interrupt_deadline(), Some(soonest));
    }
}
