//! The only way in to a running coordinator: jobs are submitted and cancelled through it, workers
//! connect through it, and everything is read through it.

use std::path::PathBuf;
use std::sync::Arc;

use bytes::Bytes;
use equilux_common::ids::JobId;
use equilux_common::job::Settings;
use equilux_common::time::Time;
use equilux_coordinator_core::event::Hello;
use tokio::sync::{mpsc, oneshot, watch};

use crate::attachments::{Blob, BlobHash};
use crate::board::Board;
use crate::clock::Clock;
use crate::connection::{ConnectError, Connection};
use crate::driver::{Admitted, Driver, INPUTS_MAX, Input, Knock};
use crate::film::GatheredFilm;
use crate::order::{Order, SubmitError};
use crate::status::{JobStatus, Totals, WorkerStatus};
use crate::store::{ImageFormat, Store};

/// A running coordinator. It stops when every handle and every connection is dropped.
#[derive(Clone, Debug)]
pub struct Handle {
    inputs: mpsc::Sender<Input>,
    board: Board,
    clock: Clock,
    store: Option<Arc<Store>>,
}

/// Where a job's image is to be had.
#[derive(Clone, Debug)]
pub enum ImageSource {
    /// In memory, as far as it is rendered.
    Film {
        /// The committed units.
        film: GatheredFilm,
        /// How they are rendered.
        settings: Settings,
    },
    /// In a file that will not change any more.
    File(PathBuf),
}

impl Handle {
    /// Starts a coordinator on the current runtime. Images of jobs that have ended go to the store;
    /// without one they stay in memory, for a caller that takes the film itself.
    #[must_use]
    pub fn start(store: Option<Store>) -> Self {
        let (inputs, receiver) = mpsc::channel(INPUTS_MAX);
        let (board, clock) = (Board::default(), Clock::new());
        let store = store.map(Arc::new);
        let channel = (inputs.downgrade(), receiver);
        tokio::spawn(Driver::new(clock, board.clone(), store.clone(), channel).run());
        Self { inputs, board, clock, store }
    }

    /// Submits a job; it is queued when this returns.
    ///
    /// # Errors
    /// If the order is out of its limits, or there is no room for it.
    pub async fn submit(&self, order: Order) -> Result<JobId, SubmitError> {
        order.check()?;
        let packed = tokio::task::spawn_blocking(move || pack(order));
        let admitted = Box::new(packed.await.map_err(|_| SubmitError::Stopping)?);
        let (reply, answer) = oneshot::channel();
        let input = Input::Submitted { admitted, reply };
        self.inputs.send(input).await.map_err(|_| SubmitError::Stopping)?;
        answer.await.map_err(|_| SubmitError::Stopping)?
    }

    /// Cancels a job; nothing happens if it is unknown or has ended.
    pub async fn cancel(&self, job: JobId) {
        let (reply, answer) = oneshot::channel();
        if self.inputs.send(Input::Cancelled { job, reply }).await.is_ok() {
            // An error means that the coordinator is gone, and the job with it.
            let _coordinator_is_gone = answer.await;
        }
    }

    /// Lets a worker in.
    ///
    /// # Errors
    /// If there are too many, or the coordinator is stopping.
    pub async fn connect(&self, hello: Hello) -> Result<Connection, ConnectError> {
        let (reply, answer) = oneshot::channel();
        let knock = Input::Knocked(Knock { hello, reply });
        self.inputs.send(knock).await.map_err(|_| ConnectError::Stopping)?;
        answer.await.map_err(|_| ConnectError::Stopping)?
    }

    /// A job as it stands now, or nothing if there is none of this number any more.
    #[must_use]
    pub fn job(&self, job: JobId) -> Option<JobStatus> {
        Some(self.board.job(job)?.at(self.now()))
    }

    /// All jobs that are known, by ascending id.
    #[must_use]
    pub fn jobs(&self) -> Vec<JobStatus> {
        let now = self.now();
        self.board.jobs().iter().map(|status| status.at(now)).collect()
    }

    /// Changes of a job as they come.
    #[must_use]
    pub fn watch(&self, job: JobId) -> Option<watch::Receiver<JobStatus>> {
        self.board.watch(job)
    }

    /// What is committed of a job and still in memory: while it is not in the store.
    #[must_use]
    pub fn film(&self, job: JobId) -> Option<(GatheredFilm, Settings)> {
        let settings = self.board.job(job)?.plan.settings.clone();
        Some((self.board.film(job)?, settings))
    }

    /// Where a job's image is to be had.
    #[must_use]
    pub fn image(&self, job: JobId, format: ImageFormat) -> Option<ImageSource> {
        self.board.job(job)?;
        if let Some((film, settings)) = self.film(job) {
            return Some(ImageSource::Film { film, settings });
        }
        Some(ImageSource::File(self.store.as_ref()?.image_path(job, format)))
    }

    /// The workers that are connected, by ascending id.
    #[must_use]
    pub fn workers(&self) -> Vec<WorkerStatus> {
        self.board.workers()
    }

    /// Sums since the coordinator's start.
    #[must_use]
    pub fn totals(&self) -> Totals {
        self.board.totals()
    }

    /// What has this hash of the packs and attachments of jobs that have not ended.
    #[must_use]
    pub fn blob(&self, hash: &BlobHash) -> Option<Blob> {
        self.board.blob(hash)
    }

    /// The coordinator's time.
    #[must_use]
    pub fn now(&self) -> Time {
        self.clock.now()
    }
}

fn pack(order: Order) -> Admitted {
    let pack = Bytes::from(order.pack.to_bytes());
    Admitted { hash: *blake3::hash(&pack).as_bytes(), pack, order }
}
