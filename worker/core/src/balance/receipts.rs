//! Receipts: gifts that have arrived and are not acknowledged yet.
//!
//! Many gifts come at once, and one receipt does for all of them. It goes out when there is
//! something else to do anyway, or when the giver's window would fill otherwise.

use std::collections::BTreeMap;

use equilux_common::ids::WorkerId;

use crate::balance::giving::WINDOW_GIFTS;

/// So many gifts of one peer are acknowledged at once: the window stays open while the receipt
/// travels.
const RECEIPT_GIFTS_MAX: u32 = WINDOW_GIFTS / 4;

/// Gifts by giver.
#[derive(Debug, Default)]
pub(crate) struct Receipts {
    gifts: BTreeMap<WorkerId, u32>,
}

impl Receipts {
    /// A gift has arrived.
    pub(crate) fn add(&mut self, peer: WorkerId) {
        *self.gifts.entry(peer).or_default() += 1;
    }

    /// A peer is gone.
    pub(crate) fn forget(&mut self, peer: WorkerId) {
        self.gifts.remove(&peer);
    }

    /// How many to acknowledge to whom: all if `is_time`, otherwise only to those whose windows
    /// fill.
    pub(crate) fn take(&mut self, is_time: bool) -> Vec<(WorkerId, u32)> {
        let is_due = |gifts: u32| is_time || gifts >= RECEIPT_GIFTS_MAX;
        let due = self.gifts.iter().filter(|&(_, &gifts)| is_due(gifts));
        let due = due.map(|(&peer, &gifts)| (peer, gifts)).collect();
        self.gifts.retain(|_, gifts| !is_due(*gifts));
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
        receipts.add(far);
        for _ in 0..RECEIPT_GIFTS_MAX {
            assert!(receipts.take(false).is_empty());
            receipts.add(near);
        }
        assert_eq!(receipts.take(false), [(near, RECEIPT_GIFTS_MAX)]);
        assert_eq!(receipts.take(true), [(far, 1)]);
        assert!(receipts.take(true).is_empty());
    }
}
