//! What a simulated compute thread does with a piece of work.

use std::collections::BTreeSet;
use std::time::Duration;

use equilux_common::ids::PartitionId;
use equilux_common::job::JobSpec;
use equilux_common::unit::UnitGrid;
use equilux_common::work::{Outcome, Work};

/// A job as tracers see it.
#[derive(Clone, Debug)]
pub struct Task {
    /// What is rendered.
    pub spec: JobSpec,
    /// Its units.
    pub grid: UnitGrid,
    /// The partitions that are in memory; of no meaning for a replicated model.
    pub resident: BTreeSet<PartitionId>,
}

/// A piece that was traced.
#[derive(Clone, Debug)]
pub struct Traced {
    /// What it came to.
    pub outcome: Outcome,
    /// How long it took, in virtual time at speed 1.
    pub elapsed: Duration,
}

/// Something that traces: pure, so that the same piece can be traced once more up to an interrupt.
pub trait Tracer {
    /// Traces a piece. With a limit, an interrupt comes after so much time: what has not been begun
    /// by then comes back as successors.
    fn trace(&self, task: &Task, work: Work, limit: Option<Duration>) -> Traced;
}
