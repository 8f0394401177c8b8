//! An alarm: one core's deadline, of which at most one counts on the agenda.
//!
//! A deadline that moves away leaves the earlier entry in its place: when that rings, the alarm is
//! set anew. So a core whose deadline changes with every event does not flood the agenda.

use equilux_common::time::Time;

/// When a core is to be woken.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Alarm {
    pending: Option<Time>,
}

impl Alarm {
    /// The core wants to be woken at `deadline`; gives the time if it must be put on the agenda.
    pub(crate) fn set(&mut self, deadline: Option<Time>) -> Option<Time> {
        let deadline = deadline?;
        if self.pending.is_some_and(|pending| pending <= deadline) {
            return None;
        }
        self.pending = Some(deadline);
        Some(deadline)
    }

    /// An entry of the agenda has come; says whether it is the one that counts.
    pub(crate) fn ring(&mut self, now: Time) -> bool {
        self.pending.take_if(|pending| *pending == now).is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_entry_counts_and_a_later_deadline_needs_no_other() {
        let (mut alarm, at) = (Alarm::default(), Time::from_nanos);
        assert_eq!(alarm.set(Some(at(50))), Some(at(50)));
        assert_eq!(alarm.set(Some(at(70))), None);
        assert_eq!(alarm.set(Some(at(20))), Some(at(20)));
        assert!(alarm.ring(at(20)) && !alarm.ring(at(50)));
        assert_eq!(alarm.set(None), None);
        assert_eq!(alarm.set(Some(at(70))), Some(at(70)));
    }
}
