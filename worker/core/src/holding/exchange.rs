//! What moves between homes: rays on their way to them, and copies of partitions.

use std::collections::BTreeMap;
use std::time::Duration;

use equilux_common::bundle::Bundle;
use equilux_common::ids::{PartitionId, WorkerId};
use equilux_common::time::Time;
use equilux_common::work::Work;

use super::Holding;
use crate::cost::Kind;
use crate::forwarding::Parcels;
use crate::violation::Violation;

/// So much work of rays for each thread is enough at a home where partitions may be copied: those
/// who would send more had better trace them themselves.
const WORK_MAX: Duration = Duration::from_millis(20);

impl Holding {
    /// What goes to other homes now.
    pub(crate) fn forwards(&mut self, now: Time, is_linked: impl Fn(WorkerId) -> bool) -> Parcels {
        let is_idle = self.pieces.count() < self.pieces.thread_count();
        let window = |home: WorkerId| self.routing.window(home).filter(|_| is_linked(home));
        let parcels = self.forwarding.take(now, is_idle, window);
        for bundle in parcels.iter().flat_map(|(_, bundles)| bundles) {
            bundle.shares.iter().for_each(|share| self.accounts.leave(share));
            self.ledger.send(bundle.rays.len() as u64);
        }
        parcels
    }

    /// Rays came from a peer that is not home to what they have to visit next.
    pub(crate) fn receive_forwards(
        &mut self,
        now: Time,
        peer: WorkerId,
        bundles: Vec<Bundle>,
    ) -> Result<(), Violation> {
        let rays = bundles.iter().map(|bundle| bundle.rays.len() as u64).sum();
        self.forwarding.receive(now, peer, rays);
        bundles.into_iter().try_for_each(|bundle| self.receive(now, Work::Rays(bundle)))
    }

    /// A peer gives work. Rays come with a copy of what they wait for, if that is not here any
    /// more.
    pub(crate) fn receive_gift(
        &mut self,
        now: Time,
        peer: WorkerId,
        work: Work,
    ) -> Result<(), Violation> {
        if let Work::Rays(bundle) = &work {
            self.take_copy(now, peer, bundle.partition)?;
        }
        self.receive(now, work)
    }

    /// A home has taken so many messages with rays.
    pub(crate) fn acknowledge_forwards(&mut self, home: WorkerId, count: u32) {
        self.forwarding.acknowledge(home, count);
    }

    /// How many messages with rays to acknowledge to whom now.
    pub(crate) fn forward_receipts(&mut self, now: Time) -> Vec<(WorkerId, u32)> {
        let own = self.open_window();
        self.forwarding.receipts(now, own)
    }

    /// A home to which rays have waited for too long, because there is no link.
    pub(crate) fn unreachable(
        &self,
        now: Time,
        is_linked: impl Fn(WorkerId) -> bool,
    ) -> Option<WorkerId> {
        self.forwarding.unreachable(now, is_linked)
    }

    /// A peer is gone; says whether rays were on their way to it.
    pub(crate) fn forget(&mut self, peer: WorkerId) -> bool {
        self.forwarding.forget(peer)
    }

    /// The partition that most rays wait for here of those in memory, which can be passed on, to be
    /// offered to a neighbor with the rays; and the nanoseconds that they would take a thread here.
    pub(crate) fn offer(&self) -> Option<(PartitionId, u64)> {
        self.queue.fullest(|partition| self.residency.is_here(partition))
    }

    /// How long it would take to have a partition in memory.
    pub(crate) fn load_time(&self, partition: PartitionId) -> Duration {
        self.residency.load_time(partition)
    }

    /// Rays of a partition are for this worker from now on.
    fn take_copy(
        &mut self,
        now: Time,
        giver: WorkerId,
        partition: PartitionId,
    ) -> Result<(), Violation> {
        self.routing.check(partition)?;
        if !self.routing.take_copy(partition, giver) {
            return Ok(());
        }
        for bundle in self.forwarding.take_back() {
            self.put_rays(now, bundle);
        }
        Ok(())
    }

    /// Rays that are stuck on their way to homes that have more than enough to do, by partition: as
    /// far as copies may be made, and as a copy takes no longer to come than they last. Those of
    /// what is in memory anyway stay here at once.
    pub(super) fn stuck_rays(
        &mut self,
        is_linked: impl Fn(WorkerId) -> bool,
    ) -> BTreeMap<PartitionId, u64> {
        let is_full = self.is_full();
        if !(self.routing.may_copy() || is_full) || self.forwarding.ray_count() == 0 {
            return BTreeMap::new();
        }
        let window = |home: WorkerId| self.routing.window(home).filter(|_| is_linked(home));
        let mut stuck = self.forwarding.stuck(window);
        let ray_nanos = self.queue.stock().costs().of(Kind::Rays);
        stuck.retain(|&partition, rays| {
            let lasts = Duration::from_nanos(rays.saturating_mul(ray_nanos));
            is_full || lasts >= self.residency.load_time(partition)
        });
        let is_here = |&partition: &PartitionId| self.residency.is_here(partition);
        for partition in stuck.keys().copied().filter(is_here).collect::<Vec<_>>() {
            self.copy_for_stuck(partition);
            stuck.remove(&partition);
        }
        stuck
    }

    /// A partition is in memory or is being loaded: rays that are stuck on their way to its home
    /// stay here.
    pub(super) fn copy_for_stuck(&mut self, partition: PartitionId) {
        let Some(home) = self.routing.destination(partition) else { return };
        self.routing.take_copy(partition, home);
        for bundle in self.forwarding.take_rays_of(partition) {
            self.queue.push_bundle(bundle);
        }
    }

    /// Who has given a copy of a partition.
    pub(crate) fn giver(&self, partition: PartitionId) -> Option<WorkerId> {
        self.routing.giver(partition)
    }

    /// Lets go of copies that are not in memory and that no rays wait for.
    pub(super) fn drop_idle_copies(&mut self) {
        let (queue, residency) = (&self.queue, &self.residency);
        self.routing.retain_copies(|partition| {
            residency.is_here(partition) || queue.rays_at(partition) > 0
        });
    }

    /// A partition leaves memory: if it was a copy, its rays go home.
    pub(super) fn drop_copy(&mut self, now: Time, partition: PartitionId) {
        if self.routing.drop_copy(partition) {
            for bundle in self.queue.take_rays_of(partition) {
                self.put_rays(now, bundle);
            }
        }
    }

    /// When something is due without an event.
    pub(crate) fn deadline(&self, is_linked: impl Fn(WorkerId) -> bool) -> Option<Time> {
        let window = |home: WorkerId| self.routing.window(home).filter(|_| is_linked(home));
        let forwarding = self.forwarding.deadline(self.open_window(), window);
        [forwarding, self.accounts.deadline(self.patience())].into_iter().flatten().min()
    }

    /// How many rays may be on their way here from each sender, while so few wait for what is at
    /// home here that more may come.
    fn open_window(&self) -> Option<u64> {
        let has_room =
            !self.is_full() && self.queue.ray_count() <= self.routing.allowance().rays() / 2;
        let ray_nanos = self.queue.stock().costs().of(Kind::Rays);
        let work = Duration::from_nanos(self.queue.ray_count().saturating_mul(ray_nanos));
        let is_busy = self.routing.may_copy() && work > WORK_MAX * self.pieces.thread_count();
        self.routing.own_window().filter(|_| has_room && !is_busy)
    }
}
