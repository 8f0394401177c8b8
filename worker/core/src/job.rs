//! A job on this worker: its phase, its work, its balancing and its figures, kept consistent with
//! one another.
//!
//! The parts know nothing of each other. Nothing here speaks: what is to be said is returned.

use std::collections::BTreeMap;
use std::time::Duration;

use equilux_common::bundle::Share;
use equilux_common::credit::Credit;
use equilux_common::film::TileSums;
use equilux_common::ids::{Attempt, Incarnation, JobId, PartitionId, UnitId, WorkerId};
use equilux_common::message::{Home, JobStart, Load, PeerAddress, PeerMessage, WorkerFigures};
use equilux_common::time::Time;
use equilux_common::work::{Outcome, Work};
use equilux_mapping::Guest;

use crate::balance::Balancer;
use crate::holding::{Holding, rays_in};
use crate::pieces::PieceId;
use crate::residency::Order;
use crate::tally::Tally;
use crate::violation::Violation;
use crate::worker_core::Config;

/// Pieces handed to compute threads, per thread: one that is traced and one to follow it, so that
/// no thread waits for the core.
const PIECES_PER_THREAD: u32 = 2;

/// A piece follows another one on its thread only if what is there takes no longer than so many
/// times what a piece should take now: where single paths take longer, others may have to wait for
/// them.
const GRAINS_AHEAD: u32 = 2;

/// Units begun at a time, per thread. Bounds the memory for film values that are not home yet.
const OPEN_UNITS_PER_THREAD: u32 = 4;

/// How long after a link broke with work on its way the coordinator may take to find out that the
/// peer is lost. If it does not, the peer lives and the work is gone for good.
const BROKEN_LINK_GRACE: Duration = Duration::from_secs(30);

/// Whether rays are cast.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Loading,
    Rendering,
    /// The coordinator has been told; it will end the job.
    Failed,
}

/// A job on this worker.
#[derive(Debug)]
pub(crate) struct Job {
    id: JobId,
    config: Config,
    neighbors: Vec<WorkerId>,
    phase: Phase,
    holding: Holding,
    balancer: Balancer,
    tally: Tally,
    /// Links that broke with work on its way, and when to give up on it.
    broken: BTreeMap<(WorkerId, Incarnation), Time>,
}

impl Job {
    /// The job has just started; its units are issued next.
    pub(crate) fn new(now: Time, config: Config, start: &JobStart) -> Self {
        let mut job = Self {
            id: start.spec.id,
            config,
            neighbors: Vec::new(),
            phase: Phase::Loading,
            holding: Holding::new(&config, start),
            balancer: Balancer::new(&config, start.balancing),
            tally: Tally::new(now, config.threads),
            broken: BTreeMap::new(),
        };
        job.set_neighbors(&start.neighbors);
        job
    }

    /// Its number.
    pub(crate) const fn id(&self) -> JobId {
        self.id
    }

    /// Work is exchanged with these from now on.
    pub(crate) fn set_neighbors(&mut self, neighbors: &[PeerAddress]) {
        self.neighbors = neighbors.iter().map(|peer| peer.worker).collect();
        self.balancer.encourage();
    }

    /// These lives are lost, as the coordinator knows: what was on its way to them is tried again.
    pub(crate) fn bury(&mut self, gone: &[(WorkerId, Incarnation)]) {
        for life in gone {
            self.balancer.forget(life.0);
            self.holding.forget(life.0);
            self.broken.remove(life);
        }
    }

    /// These are home to the partitions from now on.
    pub(crate) fn change_homes(&mut self, now: Time, homes: Vec<Home>) -> Result<(), Violation> {
        self.holding.change_homes(now, homes)
    }

    /// Whole units came in.
    pub(crate) fn issue(&mut self, units: &[(UnitId, Attempt)]) -> Result<(), Violation> {
        self.balancer.encourage();
        self.holding.issue(units)
    }

    /// Drops all work of older attempts at these units.
    pub(crate) fn raise(&mut self, units: &[(UnitId, Attempt)]) {
        self.holding.raise(units);
    }

    /// The scene is loaded; of a model that is cut, these are the partitions.
    pub(crate) fn begin(&mut self, now: Time, partitions: Option<Guest>) -> Result<(), Violation> {
        if let Some(partitions) = partitions {
            self.holding.equip(now, partitions, self.config.memory)?;
        }
        self.phase = Phase::Rendering;
        self.tally.begin(now);
        self.balancer.encourage();
        Ok(())
    }

    /// A partition that was asked for is in memory.
    pub(crate) fn partition_loaded(&mut self, now: Time, partition: PartitionId) {
        self.tally.load_partition();
        self.holding.partition_loaded(now, partition);
    }

    /// Which partitions are to be loaded or dropped now.
    pub(crate) fn arrange(
        &mut self,
        now: Time,
        is_linked: impl Fn(WorkerId) -> bool,
    ) -> Vec<Order> {
        if self.phase != Phase::Rendering {
            return Vec::new();
        }
        self.holding.arrange(now, self.config.threads, is_linked)
    }

    /// Who has given a copy of a partition.
    pub(crate) fn giver(&self, partition: PartitionId) -> Option<WorkerId> {
        self.holding.giver(partition)
    }

    /// The job cannot go on here; says whether that is news.
    pub(crate) fn fail(&mut self) -> bool {
        std::mem::replace(&mut self.phase, Phase::Failed) != Phase::Failed
    }

    /// Whether the scene is being loaded.
    pub(crate) fn is_loading(&self) -> bool {
        self.phase == Phase::Loading
    }

    /// A link to a peer stands.
    pub(crate) const fn join(&mut self) {
        self.balancer.encourage();
    }

    /// The link to a peer is gone.
    pub(crate) fn lose(&mut self, now: Time, peer: WorkerId, incarnation: Incarnation) {
        let (gifts, forwards) = (self.balancer.forget(peer), self.holding.forget(peer));
        if gifts || forwards {
            self.broken.insert((peer, incarnation), now + BROKEN_LINK_GRACE);
        }
    }

    /// Whether a message has work of an attempt of which the coordinator has not told yet.
    pub(crate) fn is_ahead(&self, message: &PeerMessage) -> bool {
        self.holding.is_ahead(message)
    }

    /// A peer said something; gives the answer, if it wants one.
    pub(crate) fn hear(
        &mut self,
        now: Time,
        peer: WorkerId,
        message: PeerMessage,
        bytes: u64,
    ) -> Result<Option<PeerMessage>, Violation> {
        self.tally.hear(bytes);
        let mut answer = self.balancer.hear(now, peer, &message, &self.holding);
        match message {
            PeerMessage::Offered { partition, load } => {
                answer = Some(self.consider(partition, load));
            }
            PeerMessage::Given { work } => {
                self.tally.receive(rays_in(&work));
                self.holding.receive_gift(now, peer, work)?;
            }
            PeerMessage::Forwarded { bundles } => {
                bundles.iter().for_each(|bundle| self.tally.receive(bundle.rays.len() as u64));
                self.holding.receive_forwards(now, peer, bundles)?;
            }
            PeerMessage::ForwardsAcknowledged { count } => {
                self.holding.acknowledge_forwards(peer, count);
            }
            _ => {}
        }
        Ok(answer)
    }

    /// A copy of a partition is offered, with rays of so much time.
    fn consider(&self, partition: PartitionId, load: Load) -> PeerMessage {
        let transfer = self.holding.load_time(partition);
        let is_taken = self.phase == Phase::Rendering
            && self.balancer.is_copy_worth(load, transfer, &self.holding);
        if is_taken {
            PeerMessage::OfferTaken { partition }
        } else {
            PeerMessage::OfferRefused { partition }
        }
    }

    /// A piece was traced.
    pub(crate) fn trace(&mut self, now: Time, piece: PieceId, outcome: Outcome, elapsed: Duration) {
        self.tally.trace(now, elapsed, &outcome.counts);
        self.holding.trace(now, piece, outcome, elapsed);
    }

    /// The next piece for a compute thread, while there are threads for it.
    pub(crate) fn next_piece(&mut self, now: Time) -> Option<(PieceId, Work)> {
        let (threads, pieces) = (self.config.threads, self.holding.pieces());
        let grain = self.balancer.grain(&self.holding);
        let is_needed = pieces.count() < threads;
        let ahead = Duration::from_nanos(grain) * GRAINS_AHEAD;
        let may_follow = pieces.count() < threads * PIECES_PER_THREAD
            && pieces.expected(ahead * 2) <= ahead * threads;
        if self.phase != Phase::Rendering || !(is_needed || may_follow) {
            return None;
        }
        let open_units_max =
            if is_needed { usize::MAX } else { (threads * OPEN_UNITS_PER_THREAD) as usize };
        self.holding.dispatch(now, grain, open_units_max)
    }

    /// What is to be given to peers now, or said to those who get nothing.
    pub(crate) fn gifts(&mut self, now: Time) -> Vec<(WorkerId, PeerMessage)> {
        if self.phase == Phase::Failed {
            return Vec::new();
        }
        let given = self.balancer.give(now, &mut self.holding);
        given.gifts.iter().for_each(|(_, work)| self.tally.give(rays_in(work)));
        let gifts = given.gifts.into_iter().map(|(peer, work)| (peer, PeerMessage::Given { work }));
        let offers = given.offers.into_iter();
        let offers =
            offers.map(|(peer, partition, load)| (peer, PeerMessage::Offered { partition, load }));
        let declined = given.declined.into_iter().map(|peer| (peer, PeerMessage::Declined));
        gifts.chain(offers).chain(declined).collect()
    }

    /// Rays that are to go to other homes now.
    pub(crate) fn forwards(
        &mut self,
        now: Time,
        is_linked: impl Fn(WorkerId) -> bool,
    ) -> Vec<(WorkerId, PeerMessage)> {
        if self.phase != Phase::Rendering {
            return Vec::new();
        }
        let parcels = self.holding.forwards(now, is_linked);
        for bundle in parcels.iter().flat_map(|(_, bundles)| bundles) {
            self.tally.forward(bundle.rays.len() as u64);
        }
        let message = |(home, bundles)| (home, PeerMessage::Forwarded { bundles });
        parcels.into_iter().map(message).collect()
    }

    /// What is to be asked of the linked neighbors now.
    pub(crate) fn questions(
        &mut self,
        now: Time,
        is_linked: impl Fn(WorkerId) -> bool,
    ) -> Vec<(WorkerId, PeerMessage)> {
        if self.phase != Phase::Rendering {
            return Vec::new();
        }
        let mut neighbors = self.neighbors.clone();
        neighbors.retain(|&peer| is_linked(peer));
        let (questions, is_round) = self.balancer.questions(now, &self.holding, &neighbors);
        if is_round {
            self.tally.ask();
        }
        questions
    }

    /// What is to be acknowledged now.
    pub(crate) fn receipts(&mut self, now: Time) -> Vec<(WorkerId, PeerMessage)> {
        let gifts = self.balancer.receipts(now).into_iter();
        let gifts = gifts.map(|(peer, count)| (peer, PeerMessage::Acknowledged { count }));
        let forwards = self.holding.forward_receipts(now).into_iter();
        let forwards =
            forwards.map(|(peer, count)| (peer, PeerMessage::ForwardsAcknowledged { count }));
        gifts.chain(forwards).collect()
    }

    /// Whether compute threads are to give up what they have not begun.
    pub(crate) fn interrupts(&mut self, now: Time) -> bool {
        self.phase == Phase::Rendering && self.balancer.interrupts(now, &mut self.holding)
    }

    /// The figures, if it is time to report them.
    pub(crate) fn take_figures(&mut self, now: Time) -> Option<WorkerFigures> {
        self.tally.take_due(now)
    }

    /// The figures as of now.
    pub(crate) fn figures(&self, now: Time) -> WorkerFigures {
        self.tally.figures(now)
    }

    /// Credit that goes home, with its film values.
    pub(crate) fn take_complete(&mut self, now: Time) -> Vec<(Share, TileSums)> {
        self.holding.take_complete(now)
    }

    /// Work that is gone for good, if it is time to say so.
    pub(crate) fn violation(
        &self,
        now: Time,
        is_linked: impl Fn(WorkerId) -> bool,
    ) -> Option<Violation> {
        if self.phase == Phase::Failed {
            return None;
        }
        let broken = self.broken.iter().find(|&(_, &deadline)| deadline <= now);
        let broken = broken.map(|(&(peer, _), _)| Violation::LinkBroken(peer));
        broken.or_else(|| self.holding.unreachable(now, is_linked).map(Violation::Unreachable))
    }

    /// When something is due without an event.
    pub(crate) fn next_deadline(&self, is_linked: impl Fn(WorkerId) -> bool) -> Option<Time> {
        let is_active = self.phase != Phase::Failed;
        let broken = self.broken.values().min().copied().filter(|_| is_active);
        let is_rendering = self.phase == Phase::Rendering;
        let balancing = self.balancer.deadline().filter(|_| is_rendering);
        let figures = self.tally.deadline().filter(|_| !self.holding.is_idle());
        let holding = self.holding.deadline(is_linked).filter(|_| is_rendering);
        [figures, balancing, broken, holding].into_iter().flatten().min()
    }

    /// How long what waits must last.
    pub(crate) fn low_water(&self) -> Duration {
        self.balancer.low_water()
    }

    /// Whether no thread traces and nothing waits.
    pub(crate) fn is_idle(&self) -> bool {
        self.holding.is_idle()
    }

    /// Whether no thread traces, nothing waits and nothing is expected of anybody.
    pub(crate) fn is_quiet(&self) -> bool {
        self.holding.is_quiet() && self.balancer.is_quiet()
    }

    /// How long what waits keeps all threads busy.
    pub(crate) fn load(&self) -> Load {
        self.balancer.load(&self.holding)
    }

    /// Rays that wait here, and how many may.
    pub(crate) const fn waiting_rays(&self) -> (u64, u64) {
        self.holding.waiting_rays()
    }

    /// The fullest window toward a peer.
    pub(crate) fn unacknowledged_max(&self) -> u32 {
        self.balancer.unacknowledged_max()
    }

    /// Shows every share of credit that is here.
    pub(crate) fn for_each_share(&self, visit: &mut dyn FnMut(UnitId, Attempt, &Credit)) {
        self.holding.for_each_share(visit);
    }

    /// Checks that no ray was lost or doubled.
    pub(crate) fn check(&self) {
        // What made a job fail may be half done.
        if self.phase != Phase::Failed {
            self.holding.check();
        }
    }
}
