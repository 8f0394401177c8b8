//! A simulated host: one life of a worker, with its core, its links and its compute threads.

use std::collections::BTreeSet;
use std::time::Duration;

use equilux_common::ids::{Incarnation, WorkerId};
use equilux_common::time::Time;
use equilux_worker_core::WorkerCore;

use crate::alarm::Alarm;
use crate::threads::Threads;

/// One life of a worker.
#[derive(Debug)]
pub(crate) struct Host {
    /// Its position among the machines.
    pub(crate) machine: usize,
    /// Its core, from its admission to its death.
    pub(crate) core: Option<WorkerCore>,
    pub(crate) alarm: Alarm,
    /// Who it is, since its admission.
    pub(crate) identity: Option<(WorkerId, Incarnation)>,
    pub(crate) is_alive: bool,
    /// The hosts to which its links stand.
    pub(crate) linked: BTreeSet<usize>,
    /// The hosts to which it wants links.
    pub(crate) wanted: BTreeSet<usize>,
    pub(crate) threads: Threads,
    /// When its disk has read all that was asked for.
    pub(crate) disk: Time,
    pub(crate) record: HostRecord,
}

/// What is written down of a host, for forecasts.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct HostRecord {
    /// When its last ray ended.
    pub(crate) last_ray: Time,
    /// Time that its threads spent tracing.
    pub(crate) busy: Duration,
    /// Processor time that its messages took.
    pub(crate) messages_processor: Duration,
    pub(crate) messages_out: u64,
    pub(crate) messages_in: u64,
    pub(crate) bytes_out: u64,
    pub(crate) bytes_in: u64,
    /// Partitions that it read.
    pub(crate) loads: u64,
    /// Deadlines of its core that came.
    pub(crate) wakes: u64,
    /// Events other than messages while its threads had nothing to do.
    pub(crate) idle_wakes: u64,
}

impl Host {
    /// It has just come, and nobody knows of it.
    pub(crate) fn new(machine: usize, threads: u32, speed: u32) -> Self {
        Self {
            machine,
            core: None,
            alarm: Alarm::default(),
            identity: None,
            is_alive: true,
            linked: BTreeSet::new(),
            wanted: BTreeSet::new(),
            threads: Threads::new(threads, speed),
            disk: Time::ZERO,
            record: HostRecord::default(),
        }
    }
}
