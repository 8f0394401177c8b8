//! A worker's session with its coordinator: one stream in each direction, greetings first.

use equilux_common::message::{ToCoordinator, ToWorker};
use equilux_proto::hello::{Hello, Welcome};
use equilux_proto::limits::{GREETING_TIMEOUT, SESSION_MESSAGE_BYTES_MAX};
use equilux_proto::session::{FromCoordinator, FromWorker, InvalidFromCoordinator};
use equilux_proto::v1::coordinator_client::CoordinatorClient;
use equilux_proto::v1::{CoordinatorToWorker, WorkerToCoordinator};
use futures::{Stream, StreamExt, stream};
use tokio::sync::{mpsc, oneshot};
use tokio::time::timeout;
use tokio_stream::wrappers::ReceiverStream;
use tonic::transport::Channel;
use tonic::{Code, Status, Streaming};

use crate::dial;
use crate::driver::CoordinatorLink;

/// Most messages of the coordinator that wait for the driver.
const TO_WORKER_MESSAGES_MAX: usize = 64;

/// Most messages that wait for the socket; a delivery takes some 32 KiB.
const TO_COORDINATOR_MESSAGES_MAX: usize = 32;

/// Why there is no session, or not any more.
#[derive(Clone, Debug, thiserror::Error)]
pub(crate) enum SessionError {
    /// The coordinator is another program. Final.
    #[error("{0}")]
    Refused(String),
    /// Nobody answers, or not as a coordinator does.
    #[error("cannot be reached: {0}")]
    Unreachable(String),
    /// It was there.
    #[error("has ended the session: {0}")]
    Ended(String),
    /// It says what cannot be.
    #[error("breaks the protocol: {0}")]
    Invalid(#[from] InvalidFromCoordinator),
    /// It does not greet, or greets again.
    #[error("breaks the protocol: its welcome must come first, and once")]
    Welcome,
}

impl From<Status> for SessionError {
    fn from(status: Status) -> Self {
        match status.code() {
            Code::FailedPrecondition => Self::Refused(status.message().to_owned()),
            Code::Unavailable => Self::Unreachable(status.message().to_owned()),
            Code::Unimplemented => Self::Unreachable("it is no equilux coordinator".into()),
            code => Self::Ended(format!("{} ({code:?})", status.message())),
        }
    }
}

/// A session that has begun.
pub(crate) struct Session {
    /// Who this worker is from now on.
    pub(crate) welcome: Welcome,
    /// What leads to the coordinator and back.
    pub(crate) link: CoordinatorLink,
    /// For requests beside the session.
    pub(crate) client: CoordinatorClient<Channel>,
    /// Why the session has ended, once it has.
    pub(crate) end: oneshot::Receiver<SessionError>,
}

/// Opens a session with the coordinator at `authority` (`host:port`).
pub(crate) async fn open(authority: &str, hello: Hello) -> Result<Session, SessionError> {
    match timeout(GREETING_TIMEOUT, greet(authority, hello)).await {
        Ok(session) => session,
        Err(_) => Err(SessionError::Unreachable("no answer in time".into())),
    }
}

async fn greet(authority: &str, hello: Hello) -> Result<Session, SessionError> {
    let channel = dial::connect(authority).await.map_err(SessionError::Unreachable)?;
    let mut client = CoordinatorClient::new(channel)
        .max_decoding_message_size(SESSION_MESSAGE_BYTES_MAX)
        .max_encoding_message_size(SESSION_MESSAGE_BYTES_MAX);
    let (outgoing, told) = mpsc::channel(TO_COORDINATOR_MESSAGES_MAX);
    let mut said = client.session(to_wire(hello, told)).await?.into_inner();
    let first = said.message().await?.ok_or(SessionError::Welcome)?;
    let FromCoordinator::Welcome(welcome) = first.try_into()? else {
        return Err(SessionError::Welcome);
    };
    let (incoming, end) = listen(said);
    Ok(Session { welcome, link: CoordinatorLink { incoming, outgoing }, client, end })
}

/// The greeting, then all that the coordinator is told.
fn to_wire(
    hello: Hello,
    told: mpsc::Receiver<ToCoordinator>,
) -> impl Stream<Item = WorkerToCoordinator> {
    let told = ReceiverStream::new(told).map(FromWorker::Said);
    stream::iter([FromWorker::Hello(hello)]).chain(told).map(WorkerToCoordinator::from)
}

/// Hands on what the coordinator says until it says no more; then, why.
fn listen(
    mut said: Streaming<CoordinatorToWorker>,
) -> (mpsc::Receiver<ToWorker>, oneshot::Receiver<SessionError>) {
    let (messages, incoming) = mpsc::channel(TO_WORKER_MESSAGES_MAX);
    let (ended, end) = oneshot::channel();
    tokio::spawn(async move {
        loop {
            match next(&mut said).await {
                Ok(message) => match messages.send(message).await {
                    Ok(()) => {}
                    Err(_) => return,
                },
                Err(why) => {
                    // Before the messages end, so that whoever sees that finds the reason.
                    let _nobody_asks = ended.send(why);
                    return;
                }
            }
        }
    });
    (incoming, end)
}

async fn next(said: &mut Streaming<CoordinatorToWorker>) -> Result<ToWorker, SessionError> {
    let wire = match said.message().await {
        Ok(Some(wire)) => wire,
        Ok(None) => return Err(SessionError::Ended("it said no more".into())),
        Err(status) => return Err(SessionError::Ended(status.message().to_owned())),
    };
    match wire.try_into()? {
        FromCoordinator::Said(message) => Ok(message),
        FromCoordinator::Welcome(_) => Err(SessionError::Welcome),
    }
}
