//! A worker's connection, wherever the worker is: in this process or at the end of a gRPC session.

use equilux_common::ids::{Incarnation, WorkerId};
use equilux_common::message::{ToCoordinator, ToWorker};
use tokio::sync::{mpsc, oneshot};

use crate::driver::Input;

/// Most messages that wait for a worker. It is told little: who does not read for that long is
/// taken for lost.
pub const TO_WORKER_MESSAGES_MAX: usize = 1024;

/// Most messages of one worker that wait for the coordinator; a delivery takes some 32 KiB.
pub const TO_COORDINATOR_MESSAGES_MAX: usize = 32;

/// A worker's connection. When it is dropped, the worker is lost; what it said before counts.
#[derive(Debug)]
pub struct Connection {
    /// Who it is from now on.
    pub worker: WorkerId,
    /// In which life.
    pub incarnation: Incarnation,
    /// What it is told; ends when the coordinator closes the connection.
    pub incoming: mpsc::Receiver<ToWorker>,
    /// What it says.
    pub outgoing: mpsc::Sender<ToCoordinator>,
    /// Why the coordinator closed the connection, if it did.
    pub expelled: oneshot::Receiver<String>,
}

/// The driver's end of a connection; when it is dropped, the connection is closed.
#[derive(Debug)]
pub(crate) struct Link {
    /// What the worker is told.
    pub(crate) to_worker: mpsc::Sender<ToWorker>,
    /// Why it is told no more.
    pub(crate) expel: oneshot::Sender<String>,
}

impl Connection {
    /// Opens a connection; gives the driver's end too.
    pub(crate) fn open(
        worker: WorkerId,
        incarnation: Incarnation,
        inputs: mpsc::Sender<Input>,
    ) -> (Self, Link) {
        let (to_worker, incoming) = mpsc::channel(TO_WORKER_MESSAGES_MAX);
        let (outgoing, said) = mpsc::channel(TO_COORDINATOR_MESSAGES_MAX);
        let (expel, expelled) = oneshot::channel();
        tokio::spawn(forward(worker, incarnation, said, inputs));
        let connection = Self { worker, incarnation, incoming, outgoing, expelled };
        (connection, Link { to_worker, expel })
    }
}

/// A worker that is not let in.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ConnectError {
    /// There are too many already.
    #[error("{0} workers are connected, which is the limit; stop some, or use more threads each")]
    TooMany(usize),
    /// The core has no place for it.
    #[error("the coordinator has no place for another worker; start it anew")]
    Refused,
    /// The coordinator is going down.
    #[error("the coordinator is stopping; connect again when it is back")]
    Stopping,
}

/// Hands on what a worker says, under its name, and says when the connection is gone.
async fn forward(
    worker: WorkerId,
    incarnation: Incarnation,
    mut said: mpsc::Receiver<ToCoordinator>,
    inputs: mpsc::Sender<Input>,
) {
    while let Some(message) = said.recv().await {
        if inputs.send(Input::Said { worker, incarnation, message }).await.is_err() {
            return;
        }
    }
    // If nobody listens any more, the coordinator is gone, and nobody needs to know.
    let _nobody_listens = inputs.send(Input::Lost { worker, incarnation }).await;
}
