//! A job as the coordinator's driver sees it: its film, and what was last reported.

use std::collections::BTreeSet;
use std::rc::Rc;

use equilux_common::film::TileSums;
use equilux_common::ids::UnitId;
use equilux_common::job::JobSpec;
use equilux_common::time::Time;
use equilux_coordinator_core::action::{JobReport, JobState};

use crate::film::Film;
use crate::tracer::Task;

/// A job as it was seen from outside.
#[derive(Debug)]
pub struct JobView {
    /// What is rendered.
    pub task: Rc<Task>,
    /// What was committed.
    pub film: Film,
    /// The last report.
    pub report: Option<JobReport>,
    /// When it was submitted.
    pub submitted: Time,
    /// How it ended, if it has.
    pub end: Option<JobEnd>,
}

/// The moment in which the coordinator knew that a job was over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JobEnd {
    /// When that was.
    pub time: Time,
    /// When the last ray had ended, anywhere.
    pub last_ray: Time,
    /// Messages that were sent from then on.
    pub messages_after: u64,
}

impl JobView {
    /// The job was submitted.
    pub(crate) fn new(spec: JobSpec, now: Time) -> Self {
        let task = Rc::new(Task { grid: spec.grid(), spec, resident: BTreeSet::new() });
        let film = Film::new(&task);
        Self { task, film, report: None, submitted: now, end: None }
    }

    /// A unit was committed.
    pub(crate) fn commit(&mut self, unit: UnitId, sums: &TileSums) {
        assert!(!self.is_over(), "{unit} was committed after the end");
        self.film.commit(unit, sums);
    }

    /// The job is over.
    pub(crate) fn end(&mut self, time: Time, last_ray: Time, messages_after: u64) {
        self.end = Some(JobEnd { time, last_ray, messages_after });
    }

    /// The job was reported on.
    pub(crate) fn report(&mut self, report: JobReport) {
        let is_done = report.state == JobState::Done;
        assert!(!is_done || self.film.is_whole(), "{} ended too early", report.job);
        let is_same = self.report.as_ref().is_some_and(|last| last.state == report.state);
        assert!(is_same || !self.is_over(), "{} went on after its end", report.job);
        self.report = Some(report);
    }

    fn is_over(&self) -> bool {
        self.report.as_ref().is_some_and(|report| {
            matches!(report.state, JobState::Done | JobState::Failed { .. } | JobState::Cancelled)
        })
    }
}
