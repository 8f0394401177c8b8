//! A worker's session once it has greeted: what it says goes in, what it is told goes out.

use std::time::Duration;

use equilux_common::message::{ToCoordinator, ToWorker};
use equilux_proto::session::{FromCoordinator, FromWorker};
use equilux_proto::v1::{CoordinatorToWorker, WorkerToCoordinator};
use tokio::sync::{mpsc, oneshot, watch};
use tokio::time::timeout;
use tonic::{Status, Streaming};

use crate::connection::Connection;
use crate::service::refusal;

/// How long a worker may leave unread what it is told.
const UNREAD_MAX: Duration = Duration::from_secs(60);

/// Both directions of a session.
pub(crate) struct Session {
    /// The worker's place in the cluster.
    pub(crate) connection: Connection,
    /// What comes from the socket.
    pub(crate) heard: Streaming<WorkerToCoordinator>,
    /// What goes to the socket.
    pub(crate) answers: mpsc::Sender<Result<CoordinatorToWorker, Status>>,
    /// Turns true when the coordinator goes down.
    pub(crate) stopping: watch::Receiver<bool>,
}

impl Session {
    /// Runs until either side ends it. The worker is lost then, for its connection is dropped.
    pub(crate) async fn run(self, welcome: CoordinatorToWorker) {
        let Self { connection, heard, answers, mut stopping } = self;
        let Connection { incoming, outgoing, expelled, .. } = connection;
        let end = tokio::select! {
            end = listen(heard, outgoing) => end,
            end = tell(welcome, incoming, &answers, expelled) => end,
            _ = stopping.wait_for(|is_stopping| *is_stopping) => {
                Some(Status::unavailable("the coordinator is stopping"))
            }
        };
        if let Some(status) = end {
            // A client that does not read cannot be told.
            let _unread = answers.try_send(Err(status));
        }
    }
}

/// Hands in what the worker says; ends when it says no more, or what is no message.
async fn listen(
    mut heard: Streaming<WorkerToCoordinator>,
    outgoing: mpsc::Sender<ToCoordinator>,
) -> Option<Status> {
    loop {
        let wire = match heard.message().await {
            Ok(Some(wire)) => wire,
            Ok(None) => return None,
            Err(status) => return Some(status),
        };
        let message = match FromWorker::try_from(wire) {
            Ok(FromWorker::Said(message)) => message,
            Ok(FromWorker::Hello(_)) => {
                return Some(Status::invalid_argument("hello: comes once, first of all"));
            }
            Err(error) => return Some(refusal(&error)),
        };
        if outgoing.send(message).await.is_err() {
            return Some(Status::unavailable("the coordinator is stopping"));
        }
    }
}

/// Hands out what the worker is told; ends when the coordinator closes the connection, or the
/// worker does not listen.
async fn tell(
    welcome: CoordinatorToWorker,
    mut incoming: mpsc::Receiver<ToWorker>,
    answers: &mpsc::Sender<Result<CoordinatorToWorker, Status>>,
    expelled: oneshot::Receiver<String>,
) -> Option<Status> {
    let mut next = Some(welcome);
    while let Some(message) = next {
        match timeout(UNREAD_MAX, answers.send(Ok(message))).await {
            Ok(Ok(())) => (),
            Ok(Err(_)) => return None,
            Err(_) => return Some(Status::aborted("the worker does not read what it is told")),
        }
        next = incoming.recv().await.map(|message| FromCoordinator::Said(message).into());
    }
    let reason = expelled.await.unwrap_or_else(|_| "the worker fell behind".into());
    Some(Status::aborted(reason))
}
