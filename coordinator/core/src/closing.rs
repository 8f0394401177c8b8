//! Jobs that are over, but whose workers may still report their last figures.
//!
//! A job is done in the message that makes its last unit whole; nobody waits for figures. Those
//! that come within a grace time are put into its report, which is then given once more.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use equilux_common::ids::{JobId, WorkerId};
use equilux_common::message::WorkerFigures;
use equilux_common::time::Time;

use crate::action::JobReport;

/// How long figures are waited for.
const FIGURES_GRACE: Duration = Duration::from_secs(2);

/// Most jobs whose figures are waited for at a time; the oldest goes first.
const CLOSING_JOBS_MAX: usize = 16;

/// Jobs that are over.
#[derive(Debug, Default)]
pub(crate) struct Closing {
    jobs: BTreeMap<JobId, Ended>,
}

#[derive(Debug)]
struct Ended {
    report: JobReport,
    awaited: BTreeSet<WorkerId>,
    deadline: Time,
    is_changed: bool,
}

impl Closing {
    /// A job has just ended; these workers were told.
    pub(crate) fn close(&mut self, now: Time, report: JobReport, awaited: BTreeSet<WorkerId>) {
        if self.jobs.len() >= CLOSING_JOBS_MAX {
            self.jobs.pop_first();
        }
        let deadline = now + FIGURES_GRACE;
        self.jobs.insert(report.job, Ended { report, awaited, deadline, is_changed: false });
    }

    /// A worker reported on a job that is over. Gives the job's report if now all have.
    pub(crate) fn hear(
        &mut self,
        worker: WorkerId,
        job: JobId,
        figures: WorkerFigures,
    ) -> Option<JobReport> {
        let ended = self.jobs.get_mut(&job)?;
        put(&mut ended.report.workers, worker, figures);
        ended.is_changed = true;
        let is_last = ended.awaited.remove(&worker) && ended.awaited.is_empty();
        if !is_last {
            return None;
        }
        ended.is_changed = false;
        Some(ended.report.clone())
    }

    /// Forgets the jobs whose grace time is over; gives the reports that have changed.
    pub(crate) fn expire(&mut self, now: Time) -> Vec<JobReport> {
        let (over, rest) =
            std::mem::take(&mut self.jobs).into_iter().partition(|(_, job)| job.deadline <= now);
        self.jobs = rest;
        let over: BTreeMap<JobId, Ended> = over;
        over.into_values().filter(|job| job.is_changed).map(|job| job.report).collect()
    }

    /// When the next grace time is over.
    pub(crate) fn deadline(&self) -> Option<Time> {
        self.jobs.values().map(|job| job.deadline).min()
    }
}

/// Puts a worker's figures into a list that is in the order of numbers.
pub(crate) fn put(
    list: &mut Vec<(WorkerId, WorkerFigures)>,
    worker: WorkerId,
    figures: WorkerFigures,
) {
    match list.binary_search_by_key(&worker, |&(listed, _)| listed) {
        Ok(index) => list[index].1 = figures,
        Err(index) => list.insert(index, (worker, figures)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::action::JobState;

    fn report(job: u64) -> JobReport {
        JobReport {
            job: JobId(job),
            state: JobState::Done,
            units_committed: 1,
            units: 1,
            elapsed: Duration::ZERO,
            startup: Duration::ZERO,
            workers: Vec::new(),
        }
    }

    fn figures(busy: u64) -> WorkerFigures {
        WorkerFigures { busy: Duration::from_secs(busy), ..WorkerFigures::default() }
    }

    #[test]
    fn last_figures_are_reported_once_all_are_there_or_time_is_up() {
        let mut closing = Closing::default();
        closing.close(Time::ZERO, report(1), [WorkerId(0), WorkerId(1)].into());
        assert_eq!(closing.hear(WorkerId(1), JobId(1), figures(5)), None);
        let all = closing.hear(WorkerId(0), JobId(1), figures(4)).expect("all have reported");
        assert_eq!(all.workers, [(WorkerId(0), figures(4)), (WorkerId(1), figures(5))]);
        assert_eq!(closing.hear(WorkerId(1), JobId(1), figures(6)), None);
        let deadline = closing.deadline().expect("one job is closing");
        assert_eq!(closing.expire(deadline)[0].workers[1].1, figures(6));
        assert_eq!(closing.hear(WorkerId(0), JobId(1), figures(9)), None);
        assert_eq!(closing.deadline(), None);
    }
}
