//! Routing: whether rays that wait for a partition are for this worker, or for which home.
//!
//! A worker traces what it is home to, and what it has taken a copy of. One whose memory holds the
//! whole model is at home everywhere.

use std::collections::BTreeMap;

use equilux_common::balancing::{Balance, Exchange};
use equilux_common::ids::{PartitionId, WorkerId};
use equilux_common::message::{Home, JobStart};
use equilux_mapping::Guest;

use crate::allowance::{Allowance, growth};
use crate::homes::Homes;
use crate::residency::partition_bytes_max;
use crate::violation::Violation;
use crate::worker_core::Config;

/// Where rays belong.
#[derive(Debug)]
pub(crate) struct Routing {
    own: WorkerId,
    /// Bytes of memory that this worker may use; none: as many as there are.
    memory: Option<u64>,
    homes: Homes,
    /// Whether partitions of other homes may be copied.
    may_copy: bool,
    /// Whether this worker's memory holds all partitions.
    is_home_to_all: bool,
    are_rays_free: bool,
    /// How many rays may come of one where it is shaded.
    growth: u64,
    allowance: Allowance,
    /// How many rays may be on their way to each home.
    windows: BTreeMap<WorkerId, u64>,
    /// None while they are not known, or if the model is replicated.
    partitions: Option<Guest>,
    /// Partitions of other homes that this worker traces too, until it lets go of them, and who has
    /// given them.
    copies: BTreeMap<PartitionId, WorkerId>,
}

impl Routing {
    /// A job has started; of its partitions nothing is known yet.
    pub(crate) fn new(config: &Config, start: &JobStart) -> Self {
        let growth = growth(&start.spec.settings);
        let mut routing = Self {
            own: config.worker,
            memory: config.memory,
            homes: Homes::new(start.balancing.mapping),
            may_copy: start.balancing.exchange == Exchange::On
                && start.balancing.balance == Balance::Diffusion,
            is_home_to_all: true,
            are_rays_free: true,
            growth,
            allowance: Allowance::new(config.memory, growth, 0),
            windows: BTreeMap::new(),
            partitions: None,
            copies: BTreeMap::new(),
        };
        routing.change_homes(start.homes.clone());
        routing
    }

    /// These are the partitions.
    pub(crate) fn equip(&mut self, partitions: Guest) {
        self.homes.resize(&partitions);
        self.partitions = Some(partitions);
        self.look();
    }

    /// These are home to the partitions from now on.
    pub(crate) fn change_homes(&mut self, homes: Vec<Home>) {
        self.homes.change(homes, self.partitions.as_ref());
        let count = self.homes.living().count();
        self.allowance = Allowance::new(self.memory, self.growth, count);
        let window = |home: &Home| {
            let allowance = Allowance::new(home.memory, self.growth, count);
            (home.peer.worker, allowance.window())
        };
        self.windows = self.homes.living().map(window).collect();
        self.look();
    }

    /// Where rays of a partition go, if they are not for this worker.
    pub(crate) fn destination(&self, partition: PartitionId) -> Option<WorkerId> {
        if self.is_home_to_all || self.copies.contains_key(&partition) {
            return None;
        }
        self.homes.of(partition).filter(|&home| home != self.own)
    }

    /// Whether rays can be traced by anybody. Nobody can tell while the scene is being loaded.
    pub(crate) const fn are_rays_free(&self) -> bool {
        self.are_rays_free
    }

    /// How many rays may be on their way to a home.
    pub(crate) fn window(&self, home: WorkerId) -> Option<u64> {
        self.windows.get(&home).copied()
    }

    /// How many rays may be on their way here from each sender.
    pub(crate) fn own_window(&self) -> Option<u64> {
        self.window(self.own)
    }

    /// Rays of a partition are for this worker from now on; says whether they were not before.
    pub(crate) fn take_copy(&mut self, partition: PartitionId, giver: WorkerId) -> bool {
        let is_news = self.destination(partition).is_some();
        if is_news {
            self.copies.insert(partition, giver);
        }
        is_news
    }

    /// Whether partitions of other homes may be copied.
    pub(crate) const fn may_copy(&self) -> bool {
        self.may_copy
    }

    /// Lets go of the copies that `keep` refuses.
    pub(crate) fn retain_copies(&mut self, keep: impl Fn(PartitionId) -> bool) {
        self.copies.retain(|&partition, _| keep(partition));
    }

    /// How many rays may wait here.
    pub(crate) const fn allowance(&self) -> Allowance {
        self.allowance
    }

    /// Who has given a copy of a partition.
    pub(crate) fn giver(&self, partition: PartitionId) -> Option<WorkerId> {
        self.copies.get(&partition).copied()
    }

    /// A partition leaves memory; says whether its rays go to its home from now on.
    pub(crate) fn drop_copy(&mut self, partition: PartitionId) -> bool {
        self.copies.remove(&partition).is_some() && self.destination(partition).is_some()
    }

    /// Makes sure that there is such a partition.
    pub(crate) fn check(&self, partition: PartitionId) -> Result<(), Violation> {
        let Some(partitions) = &self.partitions else { return Ok(()) };
        let count = partitions.objects().len();
        let is_known = (partition.0 as usize) < count;
        is_known.then_some(()).ok_or(Violation::UnknownPartition(partition, count))
    }

    /// Finds out what depends on all partitions and homes.
    fn look(&mut self) {
        self.is_home_to_all = self.holds_all(self.memory);
        let mut homes = self.homes.living().peekable();
        let is_known = self.partitions.is_some();
        self.are_rays_free =
            homes.peek().is_none() || is_known && homes.all(|home| self.holds_all(home.memory));
    }

    fn holds_all(&self, memory: Option<u64>) -> bool {
        let partitions = self.partitions.iter().flat_map(|guest| guest.objects());
        partitions.map(|object| object.bytes).sum::<u64>() <= partition_bytes_max(memory)
    }
}
