//! How long a worker takes from hearing of a job whose scene is in memory to being ready for it:
//! measured on a driver of its own, which is told of some jobs without work.

use std::sync::Arc;
use std::time::Duration;

use equilux_common::balancing::Balancing;
use equilux_common::ids::{Incarnation, JobId, WorkerId};
use equilux_common::job::JobSpec;
use equilux_common::message::{JobStart, ToCoordinator, ToWorker};
use equilux_worker_core::Config;
use tokio::sync::mpsc;

use super::now;
use crate::driver::{CoordinatorLink, SceneSource, drive_local};

/// Jobs that are measured; the middle one counts.
const ROUNDS: u64 = 5;

/// The preparation for the job `spec`; nothing if the worker fails.
pub(super) async fn preparation(scene: Arc<dyn SceneSource>, spec: JobSpec) -> Option<Duration> {
    let (told, incoming) = mpsc::channel(1);
    let (outgoing, mut said) = mpsc::channel(1);
    let config = Config {
        worker: WorkerId(0),
        incarnation: Incarnation(0),
        threads: 1,
        speed: 1000,
        memory: None,
    };
    let link = CoordinatorLink { incoming, outgoing };
    tokio::spawn(drive_local(config, link, scene));
    let mut rounds = Vec::new();
    for round in 1..=ROUNDS {
        let job = JobId(round);
        let start = Box::new(idle_start(JobSpec { id: job, ..spec.clone() }));
        let begun = now();
        told.send(ToWorker::JobStarted(start)).await.ok()?;
        until_ready(&mut said).await?;
        rounds.push(begun.elapsed());
        told.send(ToWorker::JobEnded { job }).await.ok()?;
    }
    rounds.sort_unstable();
    Some(rounds[rounds.len() / 2])
}

async fn until_ready(said: &mut mpsc::Receiver<ToCoordinator>) -> Option<()> {
    loop {
        match said.recv().await? {
            ToCoordinator::Ready { .. } => return Some(()),
            ToCoordinator::Failed { .. } => return None,
            ToCoordinator::Delivered { .. } | ToCoordinator::Reported { .. } => {}
        }
    }
}

/// A job in which a worker has nothing to do.
fn idle_start(spec: JobSpec) -> JobStart {
    JobStart {
        spec,
        pack_from: [None, None],
        neighbors: Vec::new(),
        homes: Vec::new(),
        balancing: Balancing::default(),
        units: Vec::new(),
    }
}
