//! Receipts: gifts that have arrived and are not acknowledged yet.
//!
//! Many gifts come at once, and one receipt does for all of them. It goes out when the giver has
//! waited long enough, or its window would fill otherwise; at once if this worker has nothing to
//! do, for then nothing may happen here for long.

use std::collections::BTreeMap;
use std::time::Duration;

use equilux_common::ids::WorkerId;
use equilux_common::time::Time;

use crate::balance::giving::WINDOW_GIFTS;

/// So many gifts of one peer are acknowledged at once: the window stays open while the receipt
/// travels.
const RECEIPT_GIFTS_MAX: u32 = WINDOW_GIFTS / 4;

/// So long a receipt is put off for more gifts to come. If a link breaks, work on it counts as lost
/// until it is acknowledged, so it should not be long.
const RECEIPT_DELAY: Duration = Duration::from_millis(20);

/// Gifts by giver.
#[derive(Debug, Default)]
pub(crate) struct Receipts {
    gifts: BTreeMap<WorkerId, Arrived>,
}

/// Gifts of one giver.
#[derive(Clone, Copy, Debug)]
struct Arrived {
    count: u32,
    /// When the first of them came.
    since: Time,
}

impl Receipts {
    /// A gift has arrived.
    pub(crate) fn add(&mut self, now: Time, peer: WorkerId) {
        self.gifts.entry(peer).or_insert(Arrived { count: 0, since: now }).count += 1;
    }

    /// A peer is gone.
    pub(crate) fn forget(&mut self, peer: WorkerId) {
        self.gifts.remove(&peer);
    }

    /// How many to acknowledge to whom: all if this worker is idle, otherwise those that cannot be
    /// put off.
    pub(crate) fn take(&mut self, now: Time, is_idle: bool) -> Vec<(WorkerId, u32)> {
        let is_due = |gifts: &Arrived| {
            let is_old = now.since(gifts.since) >= RECEIPT_DELAY;
            is_idle || is_old || gifts.count >= RECEIPT_GIFTS_MAX
        };
        let due = self.gifts.iter().filter(|(_, gifts)| is_due(gifts));
        let due = due.map(|(&peer, gifts)| (peer, gifts.count)).collect();
        self.gifts.retain(|_, gifts| !is_due(gifts));
        due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_receipt_does_for_many_gifts() {
        let mut receipts = Receipts::default();
        let [near, far] = [WorkerId(1), WorkerId(2)];
        let now = Time::from_nanos(5);
        receipts.add(now, far);
        for _ in 0..RECEIPT_GIFTS_MAX {
            assert!(receipts.take(now, false).is_empty());
            receipts.add(now, near);
        }
        assert_eq!(receipts.take(now, false), [(near, RECEIPT_GIFTS_MAX)]);
        receipts.add(now + RECEIPT_DELAY / 2, near);
        let later = now + RECEIPT_DELAY;
        assert_eq!(receipts.take(later, false), [(far, 1)], "it has waited for long");
        assert_eq!(receipts.take(later, true), [(near, 1)]);
        assert!(receipts.take(later, true).is_empty());
    }
}
