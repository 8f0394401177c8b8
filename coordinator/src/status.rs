//! What can be known of jobs and workers at a moment.

use std::sync::Arc;
use std::time::Duration;

use equilux_common::balancing::Balancing;
use equilux_common::ids::{Incarnation, JobId, WorkerId};
use equilux_common::job::Settings;
use equilux_common::message::WorkerFigures;
use equilux_common::time::Time;
use equilux_common::topology::Topology;
use equilux_coordinator_core::action::{JobReport, JobState};

/// What of a job does not change while it runs.
#[derive(Clone, Debug, PartialEq)]
pub struct JobPlan {
    /// What people call the job.
    pub name: String,
    /// The scene file in its pack.
    pub scene: String,
    /// The camera, if it was chosen by name.
    pub camera: Option<String>,
    /// How it is rendered.
    pub settings: Settings,
    /// How work is spread.
    pub balancing: Balancing,
    /// Who exchanges work with whom.
    pub topology: Topology,
    /// It does not start with fewer workers than this.
    pub workers_min: u32,
    /// What the readers of the scene had to say.
    pub warnings: Vec<String>,
}

/// A job at a moment.
#[derive(Clone, Debug, PartialEq)]
pub struct JobStatus {
    /// Which job.
    pub id: JobId,
    /// What does not change.
    pub plan: Arc<JobPlan>,
    /// Where it stands.
    pub state: JobState,
    /// Units committed.
    pub units_committed: u32,
    /// Units in all.
    pub units: u32,
    /// Since workers were told of it; until its end if it has ended.
    pub elapsed: Duration,
    /// From then until the first worker cast rays.
    pub startup: Duration,
    /// Each worker's figures as last reported, by ascending id.
    pub workers: Vec<(WorkerId, WorkerFigures)>,
    /// Why the image could not be stored, if it could not.
    pub store_error: Option<String>,
    /// When all this was so, by the coordinator's clock.
    pub as_of: Time,
}

impl JobStatus {
    /// A job that has just been submitted; its units are counted by the core's first report.
    #[must_use]
    pub const fn queued(id: JobId, plan: Arc<JobPlan>, now: Time) -> Self {
        Self {
            id,
            plan,
            state: JobState::Queued,
            units_committed: 0,
            units: 0,
            elapsed: Duration::ZERO,
            startup: Duration::ZERO,
            workers: Vec::new(),
            store_error: None,
            as_of: now,
        }
    }

    /// Takes over what the core reports.
    pub fn update(&mut self, report: JobReport, now: Time) {
        self.state = report.state;
        self.units_committed = report.units_committed;
        self.units = report.units;
        self.elapsed = report.elapsed;
        self.startup = report.startup;
        self.workers = report.workers;
        self.as_of = now;
    }

    /// The same job at a later moment without news: time alone has passed.
    #[must_use]
    pub fn at(&self, now: Time) -> Self {
        let is_running = matches!(self.state, JobState::Preparing | JobState::Rendering);
        let passed = if is_running { now.since(self.as_of) } else { Duration::ZERO };
        Self { elapsed: self.elapsed + passed, as_of: self.as_of + passed, ..self.clone() }
    }

    /// Whether the job will not change any more.
    #[must_use]
    pub const fn has_ended(&self) -> bool {
        matches!(self.state, JobState::Done | JobState::Failed { .. } | JobState::Cancelled)
    }

    /// Units committed, from 0 to 1.
    #[must_use]
    pub fn progress(&self) -> f64 {
        if self.units == 0 { 0.0 } else { f64::from(self.units_committed) / f64::from(self.units) }
    }

    /// An estimate of the time until the image is whole, as if units went on at the rate so far;
    /// zero if the job has ended, nothing while nothing is known.
    #[must_use]
    pub fn remaining(&self) -> Option<Duration> {
        if self.has_ended() {
            return Some(Duration::ZERO);
        }
        if self.units_committed == 0 {
            return None;
        }
        let rendering = self.elapsed.saturating_sub(self.startup);
        Some(rendering.mul_f64((1.0 - self.progress()) / self.progress()))
    }
}

/// A worker that is connected.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WorkerStatus {
    /// Who.
    pub worker: WorkerId,
    /// In which life.
    pub incarnation: Incarnation,
    /// What it calls itself.
    pub name: String,
    /// `host:port` at which it answers its peers.
    pub address: String,
    /// Compute threads.
    pub threads: u32,
    /// When it was let in, by the coordinator's clock.
    pub since: Time,
}

/// Sums over all jobs since the coordinator's start; they never fall.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Totals {
    /// Units committed.
    pub units_committed: u64,
    /// Rays of every kind.
    pub rays: u64,
    /// Bytes that workers sent to one another.
    pub bytes: u64,
    /// Jobs submitted.
    pub jobs: u64,
}

impl Totals {
    /// Counts the difference that a report makes.
    pub(crate) fn count(&mut self, before: &JobStatus, report: &JobReport) {
        let units = report.units_committed.saturating_sub(before.units_committed);
        self.units_committed += u64::from(units);
        let [rays, bytes] = sums(&report.workers);
        let [rays_before, bytes_before] = sums(&before.workers);
        self.rays = self.rays.saturating_add(rays.saturating_sub(rays_before));
        self.bytes = self.bytes.saturating_add(bytes.saturating_sub(bytes_before));
    }
}

fn sums(workers: &[(WorkerId, WorkerFigures)]) -> [u64; 2] {
    workers.iter().fold([0, 0], |[rays, bytes], (_, figures)| {
        let kinds = figures.rays;
        let spawned = [kinds.camera, kinds.indirect, kinds.specular, kinds.shadow];
        let rays = spawned.iter().fold(rays, |sum: u64, count| sum.saturating_add(*count));
        [rays, bytes.saturating_add(figures.bytes_out)]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use equilux_common::job::{Filter, PerDepth};

    fn status(state: JobState, units_committed: u32) -> JobStatus {
        let settings = Settings {
            width: 8,
            height: 8,
            crop: None,
            filter: Filter::Box,
            samples_per_pixel: 1,
            max_depth: 2,
            light_samples: PerDepth::default(),
            indirect_samples: PerDepth::default(),
            roulette_depth: None,
            seed: 0,
        };
        let plan = JobPlan {
            name: "a".into(),
            scene: "scene.json".into(),
            camera: None,
            settings,
            balancing: Balancing::default(),
            topology: Topology::Hypercube,
            workers_min: 1,
            warnings: Vec::new(),
        };
        let mut status = JobStatus::queued(JobId(1), Arc::new(plan), Time::ZERO);
        let (elapsed, startup) = (Duration::from_secs(7), Duration::from_secs(2));
        let workers = Vec::new();
        let report = JobReport {
            job: JobId(1),
            state,
            units_committed,
            units: 10,
            elapsed,
            startup,
            workers,
        };
        status.update(report, Time::ZERO);
        status
    }

    #[test]
    fn the_rest_is_estimated_from_the_rate_so_far() {
        assert_eq!(status(JobState::Rendering, 0).remaining(), None);
        let rendering = status(JobState::Rendering, 5);
        assert_eq!(rendering.remaining(), Some(Duration::from_secs(5)));
        assert_eq!(status(JobState::Cancelled, 5).remaining(), Some(Duration::ZERO));
        let later = rendering.at(Time::ZERO + Duration::from_secs(1));
        assert_eq!(later.elapsed, Duration::from_secs(8));
        assert_eq!(later.at(later.as_of), later);
    }

    #[test]
    fn time_stands_still_for_a_job_that_does_not_run() {
        let later = Time::ZERO + Duration::from_secs(100);
        for state in [JobState::Queued, JobState::Done, JobState::Cancelled] {
            let status = status(state, 10);
            assert_eq!(status.at(later), status);
        }
    }
}
