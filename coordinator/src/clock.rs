//! The one clock of the coordinator: time since its start, as its core wants it.

use std::time::{Duration, Instant};

use equilux_common::time::Time;

/// Counts from the moment it was made.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Clock {
    start: Instant,
}

impl Clock {
    /// A clock that starts now.
    #[expect(clippy::disallowed_methods, reason = "the edge reads the clock for the core")]
    pub(crate) fn new() -> Self {
        Self { start: Instant::now() }
    }

    /// Time since the start.
    pub(crate) fn now(&self) -> Time {
        Time::ZERO + self.start.elapsed()
    }

    /// When `time` is, for the runtime's timer.
    pub(crate) fn instant(&self, time: Time) -> tokio::time::Instant {
        let since_start = time.since(Time::ZERO);
        let latest = Duration::from_secs(60 * 60 * 24 * 365);
        tokio::time::Instant::from_std(self.start + since_start.min(latest))
    }
}
