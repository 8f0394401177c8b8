//! What the cores say to one another. The wire's form of it is made and checked in `equilux-proto`.

use std::sync::Arc;
use std::time::Duration;

use crate::balancing::Balancing;
use crate::bundle::{Bundle, Share};
use crate::film::TileSums;
use crate::ids::{Attempt, Incarnation, JobId, PartitionId, UnitId, WorkerId};
use crate::job::JobSpec;
use crate::spread::PackSources;
use crate::work::{RayCounts, Work};

/// Where a worker is found, and in which life.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct PeerAddress {
    /// Who.
    pub worker: WorkerId,
    /// In which life.
    pub incarnation: Incarnation,
    /// `host:port` at which it answers its peers. Shared, since every neighbor is told of it.
    pub address: Arc<str>,
}

/// A worker that is home to partitions of a model that is cut, or becomes so when others are lost.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Home {
    /// Where it is found.
    pub peer: PeerAddress,
    /// Bytes of memory that it may use for geometry; none: as many as there are.
    pub memory: Option<u64>,
    /// Whether it came after the partitions had been given homes.
    pub is_late: bool,
    /// Whether this life is lost, and its partitions are at home with others.
    pub is_lost: bool,
}

/// A job as one worker is told of it.
#[derive(Clone, Debug, PartialEq)]
pub struct JobStart {
    /// The job.
    pub spec: JobSpec,
    /// With whom this worker exchanges work, by ascending id.
    pub neighbors: Vec<PeerAddress>,
    /// Who is home to the partitions of the model: those who were there when they were given homes,
    /// the lost ones too, then those who came later and live; nobody if it is replicated.
    pub homes: Vec<Home>,
    /// How work is spread.
    pub balancing: Balancing,
    /// This worker's initial share of units, each with all of its credit.
    pub units: Vec<(UnitId, Attempt)>,
    /// Who passes the scene's pack on to this worker.
    pub pack_from: PackSources,
}

/// From the coordinator to a worker.
#[derive(Clone, Debug, PartialEq)]
pub enum ToWorker {
    /// Take part in this job.
    JobStarted(Box<JobStart>),
    /// Work is exchanged with others now. Those that were neighbors before and live stay linked,
    /// for something may be on its way.
    NeighborsChanged {
        /// In which job.
        job: JobId,
        /// With whom, by ascending id.
        neighbors: Vec<PeerAddress>,
        /// The lives that are lost since the last such message.
        gone: Vec<(WorkerId, Incarnation)>,
    },
    /// Others are home to the partitions of the model: all workers find by the same list who is
    /// home to which.
    HomesChanged {
        /// In which job.
        job: JobId,
        /// As in [`JobStart`].
        homes: Vec<Home>,
    },
    /// Drop older attempts of these units, wherever they are.
    AttemptsRaised {
        /// Of which job.
        job: JobId,
        /// The attempts that count from now on.
        units: Vec<(UnitId, Attempt)>,
    },
    /// Render these units too; each comes with all of its credit.
    UnitsIssued {
        /// Of which job.
        job: JobId,
        /// The units and the attempts they are at.
        units: Vec<(UnitId, Attempt)>,
    },
    /// The job is over, one way or another: drop all of it.
    JobEnded {
        /// Which job.
        job: JobId,
    },
}

/// From a worker to the coordinator.
#[derive(Clone, Debug, PartialEq)]
pub enum ToCoordinator {
    /// The scene is loaded and rays are being cast.
    Ready {
        /// For which job.
        job: JobId,
    },
    /// The job cannot be rendered, by nobody's death: its scene is bad, or memory is short.
    Failed {
        /// Which job.
        job: JobId,
        /// What went wrong and what to do about it.
        reason: String,
    },
    /// Credit comes home, with the film values it vouches for.
    Delivered {
        /// Of which job.
        job: JobId,
        /// The unit and the credit.
        share: Share,
        /// What was gathered for it here since the last delivery.
        sums: TileSums,
    },
    /// The worker in figures, in total since the job's start.
    Reported {
        /// Of which job.
        job: JobId,
        /// The figures.
        figures: Box<WorkerFigures>,
    },
}

/// A worker's part in a job, in figures (the stats file's fields per worker).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WorkerFigures {
    /// Time that compute threads spent tracing, added over threads.
    pub busy: Duration,
    /// Time that compute threads waited for work, added over threads.
    pub idle: Duration,
    /// When the last ray ended here, since the job's start.
    pub finish: Duration,
    /// Rays by kind.
    pub rays: RayCounts,
    /// Bundles and sample ranges received from peers.
    pub bundles_in: u64,
    /// Bundles and sample ranges sent to peers.
    pub bundles_out: u64,
    /// Rays in the middle of their paths received from peers.
    pub rays_in: u64,
    /// Rays in the middle of their paths sent to peers.
    pub rays_out: u64,
    /// Of those, rays that went to the home of the partition that they had to visit next.
    pub forwards: u64,
    /// Bytes of peer messages received.
    pub bytes_in: u64,
    /// Bytes of peer messages sent.
    pub bytes_out: u64,
    /// Rounds of asking the neighbors.
    pub balance_requests: u64,
    /// Partitions read into memory.
    pub partition_loads: u64,
    /// Largest resident size of the process; 0 where unknown.
    pub peak_rss_bytes: u64,
}

/// Waiting work, as the time that all threads of the worker that holds it would take for it.
pub type Load = Duration;

/// From a worker to a neighbor, about one job.
#[derive(Clone, Debug, PartialEq)]
pub enum PeerMessage {
    /// How much is waiting with you?
    LoadAsked {
        /// Comes back in the answer.
        round: u32,
    },
    /// This much.
    Load {
        /// As asked.
        round: u32,
        /// Work waiting in the queue.
        load: Load,
        /// What this worker computes at a time, in thousandths of a thread of reference speed.
        capacity: u64,
    },
    /// Give me this much. Who cannot now keeps it in mind and gives when it can.
    WorkAsked {
        /// Estimated compute time of the work wanted, of one thread of reference speed.
        amount: Load,
    },
    /// There is nothing here for who asks one neighbor at a time; it will not be kept in mind.
    Declined,
    /// Rays wait here for this partition, and there is nothing else to give: take a copy of it, and
    /// they are yours.
    Offered {
        /// The partition.
        partition: PartitionId,
        /// Estimated compute time of the rays, of one thread of reference speed.
        load: Load,
    },
    /// The copy is taken, or has been there already: give the rays.
    OfferTaken {
        /// The partition.
        partition: PartitionId,
    },
    /// The copy would cost more than it saves.
    OfferRefused {
        /// The partition.
        partition: PartitionId,
    },
    /// Here is work. It takes a place in the window until it is acknowledged.
    Given {
        /// The work.
        work: Work,
    },
    /// This many of the things you gave have arrived.
    Acknowledged {
        /// How many more than said before.
        count: u32,
    },
    /// Rays whose next partition is at home with you. They take their places in the window until
    /// they are acknowledged.
    Forwarded {
        /// The rays; at least one bundle.
        bundles: Vec<Bundle>,
    },
    /// This many of your messages with forwarded rays have arrived, and there is room for more.
    ForwardsAcknowledged {
        /// How many more than said before.
        count: u32,
    },
}

impl PeerMessage {
    /// Shows the shares of credit that travel in the message.
    pub fn for_each_share(&self, mut visit: impl FnMut(&Share)) {
        match self {
            Self::Given { work } => work.shares().iter().for_each(visit),
            Self::Forwarded { bundles } => {
                bundles.iter().flat_map(|bundle| &bundle.shares).for_each(&mut visit);
            }
            _ => {}
        }
    }
}
