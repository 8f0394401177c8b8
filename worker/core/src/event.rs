//! What can happen to a worker.

use std::time::Duration;

use equilux_common::ids::{Incarnation, JobId, PartitionId, WorkerId};
use equilux_common::message::{PeerMessage, ToWorker};
use equilux_common::work::Outcome;
use equilux_mapping::Guest;

use crate::pieces::PieceId;

/// The closed list of what can happen to a worker.
#[derive(Clone, Debug)]
pub enum Event {
    /// The coordinator said something.
    CoordinatorSaid(ToWorker),
    /// A peer said something. The driver has checked that it is who it says it is.
    PeerSaid {
        /// Who.
        peer: WorkerId,
        /// In which life.
        incarnation: Incarnation,
        /// About which job.
        job: JobId,
        /// What.
        message: PeerMessage,
        /// Its size on the wire, for the figures.
        bytes: u64,
    },
    /// A link to a peer stands: what is told it now will arrive in order, unless the link is lost.
    PeerLinked {
        /// Who.
        peer: WorkerId,
        /// In which life.
        incarnation: Incarnation,
    },
    /// The link to a peer is gone, and with it what was on the way.
    PeerLost {
        /// Who.
        peer: WorkerId,
        /// In which life.
        incarnation: Incarnation,
    },
    /// The scene that [`crate::action::Action::LoadScene`] asked for is ready to be traced.
    SceneLoaded {
        /// For which job.
        job: JobId,
        /// The partitions, if the model is cut into some that are to be loaded one by one: the
        /// bytes of memory that each takes, where it lies, and how much they have to do with one
        /// another. A replicated model is in memory, and has none.
        partitions: Option<Guest>,
    },
    /// The partition that [`crate::action::Action::LoadPartition`] asked for is in memory: pieces
    /// handed out from now on are traced through it.
    PartitionLoaded {
        /// For which job.
        job: JobId,
        /// Which.
        partition: PartitionId,
    },
    /// The scene, or a partition of it, cannot be had.
    SceneFailed {
        /// For which job.
        job: JobId,
        /// What went wrong and what to do about it.
        reason: String,
    },
    /// A piece of work was traced.
    Traced {
        /// Of which job.
        job: JobId,
        /// Which piece, as [`crate::action::Action::Trace`] named it.
        piece: PieceId,
        /// What it came to.
        outcome: Box<Outcome>,
        /// How long a compute thread took.
        elapsed: Duration,
    },
}
