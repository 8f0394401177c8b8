//! The one clock of a worker: time since its driver started, as its core wants it.

use std::time::{Duration, Instant};

use equilux_common::time::Time;

/// Farthest that a timer is set; the core is asked again after it.
const TIMER_MAX: Duration = Duration::from_secs(24 * 60 * 60);

/// Counts from the moment it was made.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Clock {
    start: Instant,
}

impl Clock {
    #[expect(clippy::disallowed_methods, reason = "the edge reads the clock for the core")]
    pub(crate) fn start() -> Self {
        Self { start: Instant::now() }
    }

    /// Time since the start.
    pub(crate) fn now(&self) -> Time {
        Time::ZERO + self.start.elapsed()
    }

    /// Sleeps until `deadline`, or for ever if there is none.
    pub(crate) async fn sleep_until(&self, deadline: Option<Time>) {
        match deadline {
            Some(deadline) => tokio::time::sleep(deadline.since(self.now()).min(TIMER_MAX)).await,
            None => std::future::pending().await,
        }
    }
}
