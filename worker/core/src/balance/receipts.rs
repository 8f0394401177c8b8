//! Receipts: gifts that have arrived and are not acknowledged yet.
//!
//! Many gifts come at once, and one receipt does for all of them. It goes out when the giver has
//! waited long enough, or its window would fill otherwise. What has not gone out at the end of the
//! job need not.

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
const RECEIPT_DELAY: Duration = Duration::from_millis(50);

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

    /// When the next receipt cannot be put off any more.
    pub(crate) fn deadline(&self) -> Option<Time> {
        self.gifts.values().map(|gifts| gifts.since + RECEIPT_DELAY).min()
    }

    /// How many to acknowledge to whom now.
    pub(crate) fn take(&mut self, now: Time) -> Vec<(WorkerId, u32)> {
        let is_due = |gifts: &Arrived| {
            now >= gifts.since + RECEIPT_DELAY || gifts.count >= RECEIPT_GIFTS_MAX
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
            assert!(receipts.take(now).is_empty());
            receipts.add(now, near);
        }
        assert_eq!(receipts.take(now), [(near, RECEIPT_GIFTS_MAX)]);
        receipts.add(now + RECEIPT_DELAY / 2, near);
        let later = now + RECEIPT_DELAY;
        assert_eq!(receipts.deadline(), Some(later));
        assert_eq!(receipts.take(later), [(far, 1)], "it has waited for long");
        let latest = receipts.deadline().expect("the other has not");
        assert_eq!(receipts.take(latest), [(near, 1)]);
        assert_eq!(receipts.deadline(), None);
    }
}
