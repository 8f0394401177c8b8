//! A job as the coordinator's driver sees it: its film, and what was last reported.

use std::rc::Rc;

use equilux_common::film::TileSums;
use equilux_common::ids::UnitId;
use equilux_common::job::JobSpec;
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
}

impl JobView {
    /// The job was submitted.
    pub(crate) fn new(spec: JobSpec) -> Self {
        let task = Rc::new(Task { grid: spec.grid(), spec });
        let film = Film::new(&task);
        Self { task, film, report: None }
    }

    /// A unit was committed.
    pub(crate) fn commit(&mut self, unit: UnitId, sums: &TileSums) {
        assert!(!self.is_over(), "{unit} was committed after the end");
        self.film.commit(unit, sums);
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
