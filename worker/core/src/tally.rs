//! The worker in figures, and when the coordinator is told of them.
//!
//! Figures go out at intervals while they change. The last ones go when the job has ended: many
//! workers fall idle many times before, and nobody waits for their figures.

use std::time::Duration;

use equilux_common::message::WorkerFigures;
use equilux_common::time::Time;
use equilux_common::work::RayCounts;

/// Figures go out at most this often.
const REPORT_INTERVAL: Duration = Duration::from_millis(500);

/// A worker's part in a job so far.
#[derive(Debug)]
pub(crate) struct Tally {
    figures: WorkerFigures,
    threads: u32,
    started: Time,
    /// When the scene was loaded.
    ready: Option<Time>,
    reported: Time,
    is_changed: bool,
}

impl Tally {
    /// The job has just started.
    pub(crate) fn new(now: Time, threads: u32) -> Self {
        Self {
            figures: WorkerFigures::default(),
            threads,
            started: now,
            ready: None,
            reported: now,
            is_changed: false,
        }
    }

    /// The scene is loaded; from now on threads are busy or idle.
    pub(crate) const fn begin(&mut self, now: Time) {
        self.ready = Some(now);
    }

    /// A piece was traced.
    pub(crate) fn trace(&mut self, now: Time, elapsed: Duration, counts: &RayCounts) {
        self.figures.busy += elapsed;
        self.figures.finish = now.since(self.started);
        self.figures.rays.add(counts);
        self.is_changed = true;
    }

    /// A partition was loaded.
    pub(crate) const fn load_partition(&mut self) {
        self.figures.partition_loads += 1;
        self.is_changed = true;
    }

    /// Work came from a peer.
    pub(crate) const fn receive(&mut self, rays: u64) {
        self.figures.bundles_in += 1;
        self.figures.rays_in += rays;
        self.is_changed = true;
    }

    /// Work went to a peer.
    pub(crate) const fn give(&mut self, rays: u64) {
        self.figures.bundles_out += 1;
        self.figures.rays_out += rays;
        self.is_changed = true;
    }

    /// Rays went to another home.
    pub(crate) const fn forward(&mut self, rays: u64) {
        self.give(rays);
        self.figures.forwards += rays;
    }

    /// A message of so many bytes came from a peer.
    pub(crate) const fn hear(&mut self, bytes: u64) {
        self.figures.bytes_in = self.figures.bytes_in.saturating_add(bytes);
    }

    /// The neighbors were asked for their load.
    pub(crate) const fn ask(&mut self) {
        self.figures.balance_requests += 1;
    }

    /// The figures as of now.
    pub(crate) fn figures(&self, now: Time) -> WorkerFigures {
        let since_ready = self.ready.map_or(Duration::ZERO, |ready| now.since(ready));
        let idle = since_ready.saturating_mul(self.threads).saturating_sub(self.figures.busy);
        WorkerFigures { idle, ..self.figures }
    }

    /// The figures, if it is time to report them.
    pub(crate) fn take_due(&mut self, now: Time) -> Option<WorkerFigures> {
        let is_due = self.deadline().is_some_and(|deadline| deadline <= now);
        is_due.then(|| {
            (self.reported, self.is_changed) = (now, false);
            self.figures(now)
        })
    }

    /// When to report what has changed.
    pub(crate) fn deadline(&self) -> Option<Time> {
        self.is_changed.then(|| self.reported + REPORT_INTERVAL)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn figures_go_out_at_intervals_while_they_change() {
        let mut tally = Tally::new(Time::ZERO, 2);
        tally.begin(Time::from_nanos(10 * MS));
        assert_eq!(tally.take_due(Time::from_nanos(900 * MS)), None, "nothing has changed");
        tally.trace(Time::from_nanos(20 * MS), Duration::from_millis(7), &RayCounts::default());
        assert_eq!(tally.take_due(Time::from_nanos(30 * MS)), None, "too soon");
        let figures = tally.take_due(Time::from_nanos(510 * MS)).expect("it is time");
        assert_eq!(figures.busy, Duration::from_millis(7));
        assert_eq!(figures.idle, Duration::from_millis(2 * 500 - 7));
        assert_eq!(figures.finish, Duration::from_millis(20));
        tally.give(3);
        assert_eq!(tally.deadline(), Some(Time::from_nanos(1010 * MS)));
        assert!(tally.take_due(Time::from_nanos(1010 * MS)).is_some());
        assert_eq!(tally.deadline(), None);
    }
}
