//! The ledger of rays: received + spawned = retired + sent + dropped + held.
//!
//! What threads hold is known from what went to them and came back; what waits is counted by the
//! queue. The two never see each other's numbers, so that their sum is a check on both.

use equilux_common::work::RayCounts;

/// Rays of one job that this worker has had to do with.
#[derive(Debug, Default)]
pub(crate) struct Ledger {
    received: u64,
    spawned: u64,
    retired: u64,
    sent: u64,
    dropped: u64,
    in_threads: u64,
}

impl Ledger {
    /// Rays came from a peer.
    pub(crate) const fn receive(&mut self, rays: u64) {
        self.received += rays;
    }

    /// Rays went to a peer.
    pub(crate) const fn send(&mut self, rays: u64) {
        self.sent += rays;
    }

    /// Rays of an older attempt were dropped from the queue.
    pub(crate) const fn drop_rays(&mut self, rays: u64) {
        self.dropped += rays;
    }

    /// Rays went to a compute thread.
    pub(crate) const fn dispatch(&mut self, rays: u64) {
        self.in_threads += rays;
    }

    /// A compute thread is done with a piece of work; `returned` rays came back.
    ///
    /// # Panics
    /// If more came out of the threads than can be in them: light has lost count.
    pub(crate) fn trace(&mut self, counts: &RayCounts, returned: u64) {
        self.spawned += counts.spawned();
        self.retired += counts.retired;
        let present = self.in_threads + counts.spawned();
        let gone = counts.retired + returned;
        assert!(gone <= present, "{gone} rays left the threads, which held {present}");
        self.in_threads = present - gone;
    }

    /// Checks the balance.
    ///
    /// # Panics
    /// If it does not balance: rays were lost or doubled.
    pub(crate) fn check(&self, waiting: u64, traces: u32) {
        let came = self.received + self.spawned;
        let held = waiting + self.in_threads;
        let went = self.retired + self.sent + self.dropped;
        assert_eq!(came, went + held, "{self:?} with {waiting} rays waiting");
        assert!(traces > 0 || self.in_threads == 0, "{self:?}, but no thread traces");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(camera: u64, retired: u64) -> RayCounts {
        RayCounts { camera, retired, ..RayCounts::default() }
    }

    #[test]
    fn rays_that_go_round_balance() {
        let mut ledger = Ledger::default();
        ledger.receive(8);
        ledger.check(8, 0);
        ledger.dispatch(8);
        ledger.trace(&counts(3, 6), 5);
        ledger.send(2);
        ledger.drop_rays(1);
        ledger.check(2, 0);
    }

    #[test]
    #[should_panic(expected = "rays waiting")]
    fn a_lost_ray_shows() {
        let mut ledger = Ledger::default();
        ledger.receive(8);
        ledger.check(7, 0);
    }

    #[test]
    #[should_panic(expected = "no thread traces")]
    fn a_ray_that_no_thread_gives_back_shows() {
        let mut ledger = Ledger::default();
        ledger.trace(&counts(3, 2), 0);
        ledger.check(0, 0);
    }
}
