//! What can happen to the coordinator.

use std::sync::Arc;

use equilux_common::balancing::Balancing;
use equilux_common::ids::{Incarnation, JobId, WorkerId};
use equilux_common::job::JobSpec;
use equilux_common::message::ToCoordinator;
use equilux_common::topology::Topology;

/// The driver's number for a connection that has not been admitted yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct LinkId(pub u64);

/// A worker as it introduces itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Hello {
    /// The same in every life of the worker, different for every worker.
    pub name: String,
    /// `host:port` at which it answers its peers.
    pub address: Arc<str>,
    /// Compute threads.
    pub threads: u32,
    /// Relative speed of one thread, 1000 where nothing has been measured; more than 0.
    pub speed: u32,
    /// Bytes of memory that it may use for the geometry of a job; none: as many as there are.
    pub memory: Option<u64>,
}

/// A job as it is submitted.
#[derive(Clone, Debug, PartialEq)]
pub struct JobOrder {
    /// What to render; its id is the driver's choice, above all earlier ones.
    pub spec: JobSpec,
    /// How work is spread.
    pub balancing: Balancing,
    /// Who exchanges work with whom.
    pub topology: Topology,
    /// Do not start with fewer workers than this; at least 1.
    pub workers_min: u32,
    /// Whether the model is cut into partitions, which have to be at home somewhere.
    pub is_partitioned: bool,
}

/// The closed list of what can happen to the coordinator.
#[derive(Clone, Debug)]
pub enum Event {
    /// A worker wants to take part.
    Knocked {
        /// On which connection.
        link: LinkId,
        /// Who.
        hello: Hello,
    },
    /// The connection to a worker is gone.
    WorkerLost {
        /// Who.
        worker: WorkerId,
        /// In which life.
        incarnation: Incarnation,
    },
    /// A worker said something.
    WorkerSaid {
        /// Who.
        worker: WorkerId,
        /// In which life.
        incarnation: Incarnation,
        /// What.
        message: ToCoordinator,
    },
    /// A job was submitted.
    Submitted(Box<JobOrder>),
    /// A job is not wanted any more.
    Cancelled {
        /// Which.
        job: JobId,
    },
}
