//! What a worker's core wants done.

use equilux_common::ids::{Incarnation, JobId, PartitionId, WorkerId};
use equilux_common::job::JobSpec;
use equilux_common::message::{PeerAddress, PeerMessage, ToCoordinator};
use equilux_common::spread::PackSources;
use equilux_common::work::Work;

use crate::pieces::PieceId;

/// The closed list of what a worker's core can ask of its driver.
#[derive(Clone, Debug)]
pub enum Action {
    /// Fetch the job's scene and make it ready to be traced; answer with `SceneLoaded` or
    /// `SceneFailed`.
    LoadScene {
        /// The job.
        spec: Box<JobSpec>,
        /// Who passes its scene on.
        pack_from: PackSources,
    },
    /// Bring a partition into memory; answer with `PartitionLoaded` or `SceneFailed`.
    LoadPartition {
        /// Of which job's model.
        job: JobId,
        /// Which.
        partition: PartitionId,
        /// Who has given a copy of it, if somebody has, and passes it on.
        from: Option<PeerAddress>,
    },
    /// Let go of a partition: its memory is free when all pieces that were handed out before have
    /// come back.
    DropPartition {
        /// Of which job's model.
        job: JobId,
        /// Which.
        partition: PartitionId,
    },
    /// Trace this on any compute thread; answer with `Traced`.
    Trace {
        /// Of which job.
        job: JobId,
        /// Which piece; `Traced` names it.
        piece: PieceId,
        /// What.
        work: Work,
    },
    /// Let threads give up soon what they have not begun of all pieces that are out, taken up yet
    /// or not; it comes back as successors in `Traced`.
    Interrupt,
    /// Drop the job's scene. What is being traced of it may end as `Traced` or not at all.
    DropScene {
        /// Of which job.
        job: JobId,
    },
    /// Keep links to exactly these peers; answer with `PeerLinked` and `PeerLost`.
    Link(Vec<PeerAddress>),
    /// Tell a peer something.
    TellPeer {
        /// Whom.
        peer: WorkerId,
        /// In which life; if it has another one by now, drop the message.
        incarnation: Incarnation,
        /// About which job.
        job: JobId,
        /// What.
        message: PeerMessage,
    },
    /// Tell the coordinator something.
    Tell(ToCoordinator),
}
