//! What the coordinator's core wants done.

use std::time::Duration;

use equilux_common::film::TileSums;
use equilux_common::ids::{Incarnation, JobId, UnitId, WorkerId};
use equilux_common::message::{ToWorker, WorkerFigures};

use crate::event::LinkId;

/// Where a job stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum JobState {
    /// It waits for the jobs before it, or for workers.
    Queued,
    /// Workers load the scene.
    Preparing,
    /// Rays are being cast.
    Rendering,
    /// The image is whole.
    Done,
    /// It cannot be rendered.
    Failed {
        /// What went wrong and what to do about it.
        reason: String,
    },
    /// It was not wanted any more; what is committed stays.
    Cancelled,
}

impl JobState {
    /// The state's word, in messages and in REST.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Queued => "queued",
            Self::Preparing => "preparing",
            Self::Rendering => "rendering",
            Self::Done => "done",
            Self::Failed { .. } => "failed",
            Self::Cancelled => "cancelled",
        }
    }
}

/// A job's state and progress.
#[derive(Clone, Debug, PartialEq)]
pub struct JobReport {
    /// Which job.
    pub job: JobId,
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
}

/// The closed list of what the coordinator's core can ask of its driver.
#[derive(Clone, Debug)]
pub enum Action {
    /// Let the worker in under this name.
    Admit {
        /// On which connection.
        link: LinkId,
        /// Who it is from now on.
        worker: WorkerId,
        /// In which life.
        incarnation: Incarnation,
    },
    /// Close the connection to a worker: it is fenced, or it broke the protocol.
    Expel {
        /// Whom.
        worker: WorkerId,
        /// In which life.
        incarnation: Incarnation,
        /// Why.
        reason: String,
    },
    /// Tell a worker something.
    Tell {
        /// Whom.
        worker: WorkerId,
        /// In which life.
        incarnation: Incarnation,
        /// What.
        message: ToWorker,
    },
    /// Add a whole unit's values to the job's film; they will not change again.
    Commit {
        /// Of which job.
        job: JobId,
        /// Which unit.
        unit: UnitId,
        /// Its values.
        sums: TileSums,
    },
    /// A job's state or progress has changed.
    Report(JobReport),
}
