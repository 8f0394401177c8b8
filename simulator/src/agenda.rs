//! The agenda: what will happen, in the order of time. What falls on the same instant happens in
//! the order in which it was put down. The clock is that of what happened last.

use std::collections::BTreeMap;

use equilux_common::time::Time;

use crate::happening::Happening;

/// Everything that waits to happen.
#[derive(Debug, Default)]
pub(crate) struct Agenda {
    now: Time,
    happenings: BTreeMap<(Time, u64), Happening>,
    sequence: u64,
}

impl Agenda {
    /// When the last thing happened.
    pub(crate) const fn now(&self) -> Time {
        self.now
    }

    /// Puts something down.
    pub(crate) fn put(&mut self, time: Time, happening: Happening) {
        self.sequence += 1;
        self.happenings.insert((time.max(self.now), self.sequence), happening);
    }

    /// Takes out what is next.
    pub(crate) fn pop(&mut self) -> Option<Happening> {
        let ((time, _), happening) = self.happenings.pop_first()?;
        self.now = time;
        Some(happening)
    }

    /// When the next thing will happen.
    pub(crate) fn next_time(&self) -> Option<Time> {
        self.happenings.first_key_value().map(|(&(time, _), _)| time)
    }

    /// Takes out what will not happen after all.
    pub(crate) fn strike(&mut self, is_struck: impl Fn(&Happening) -> bool) -> Vec<Happening> {
        let all = std::mem::take(&mut self.happenings);
        let (struck, kept): (Vec<_>, _) =
            all.into_iter().partition(|(_, happening)| is_struck(happening));
        self.happenings = kept.into_iter().collect();
        struck.into_iter().map(|(_, happening)| happening).collect()
    }

    /// All that waits.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &Happening> {
        self.happenings.values()
    }
}
