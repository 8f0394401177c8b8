//! The pace of reports: at once when something has not changed for a while, else at intervals.

use std::time::Duration;

use equilux_common::time::Time;

/// Tells when a change is to be reported.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pace {
    interval: Duration,
    reported: Option<Time>,
    is_changed: bool,
}

impl Pace {
    /// Reports follow one another by at least `interval`.
    pub(crate) const fn new(interval: Duration) -> Self {
        Self { interval, reported: None, is_changed: false }
    }

    /// There is something to report.
    pub(crate) const fn change(&mut self) {
        self.is_changed = true;
    }

    /// All there was has just been reported.
    pub(crate) const fn report(&mut self, now: Time) {
        self.reported = Some(now);
        self.is_changed = false;
    }

    /// When to report; none if there is nothing.
    pub(crate) fn deadline(&self) -> Option<Time> {
        self.is_changed.then(|| self.reported.map_or(Time::ZERO, |last| last + self.interval))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_between_two_reports_wait_for_the_interval() {
        let mut pace = Pace::new(Duration::from_nanos(100));
        assert_eq!(pace.deadline(), None);
        pace.change();
        assert_eq!(pace.deadline(), Some(Time::ZERO));
        pace.report(Time::from_nanos(7));
        assert_eq!(pace.deadline(), None);
        pace.change();
        assert_eq!(pace.deadline(), Some(Time::from_nanos(107)));
    }
}
