//! A job on this worker: its work, its accounts and its balancing, kept consistent with one
//! another.
//!
//! The parts know nothing of each other; here is where a piece of work that moves is moved in all
//! of them. Nothing here speaks: what is to be said is returned.

use std::collections::BTreeMap;
use std::time::Duration;

use equilux_common::balancing::Balance;
use equilux_common::bundle::{Bundle, Share};
use equilux_common::credit::Credit;
use equilux_common::film::TileSums;
use equilux_common::ids::{Attempt, Incarnation, JobId, UnitId, WorkerId};
use equilux_common::message::{JobStart, Load, PeerAddress, PeerMessage, WorkerFigures};
use equilux_common::time::Time;
use equilux_common::work::{Outcome, Samples, Work};

use crate::accounts::Accounts;
use crate::balance::Balancer;
use crate::ledger::Ledger;
use crate::queue::Queue;
use crate::tally::Tally;
use crate::violation::Violation;
use crate::worker_core::Config;

/// Pieces handed to compute threads, per thread: one that is traced and one to follow it, so that
/// no thread waits for the core.
const PIECES_PER_THREAD: u32 = 2;

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
    balance: Balance,
    phase: Phase,
    queue: Queue,
    accounts: Accounts,
    balancer: Balancer,
    ledger: Ledger,
    tally: Tally,
    /// Pieces on compute threads.
    traces: u32,
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
            balance: start.balancing.balance,
            phase: Phase::Loading,
            queue: Queue::new(start.spec.grid()),
            accounts: Accounts::default(),
            balancer: Balancer::new(&config, start.balancing),
            ledger: Ledger::default(),
            tally: Tally::new(now, config.threads),
            traces: 0,
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
            self.broken.remove(life);
        }
    }

    /// Whole units came in.
    pub(crate) fn issue(&mut self, units: &[(UnitId, Attempt)]) -> Result<(), Violation> {
        self.raise(units);
        for &(unit, attempt) in units {
            self.check_unit(unit)?;
            if attempt == self.accounts.attempt(unit) {
                self.enter_whole(unit, attempt)?;
            }
        }
        self.balancer.encourage();
        Ok(())
    }

    /// Drops all work of older attempts at these units.
    pub(crate) fn raise(&mut self, units: &[(UnitId, Attempt)]) {
        let mut is_any_newer = false;
        for &(unit, attempt) in units {
            is_any_newer |= self.accounts.raise(unit, attempt);
        }
        if is_any_newer {
            let dropped = self.queue.retain(|share| self.accounts.is_current(share));
            self.ledger.drop_rays(dropped);
        }
    }

    /// The scene is loaded.
    pub(crate) fn begin(&mut self, now: Time) {
        self.phase = Phase::Rendering;
        self.tally.begin(now);
        self.balancer.encourage();
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
        if self.balancer.forget(peer) {
            self.broken.insert((peer, incarnation), now + BROKEN_LINK_GRACE);
        }
    }

    /// A peer said something; gives the answer, if it wants one.
    pub(crate) fn hear(
        &mut self,
        peer: WorkerId,
        message: PeerMessage,
        bytes: u64,
    ) -> Result<Option<PeerMessage>, Violation> {
        self.tally.hear(bytes);
        let answer = match self.balance {
            Balance::None => None,
            Balance::Diffusion | Balance::Stealing => {
                self.balancer.hear(peer, &message, &self.queue)
            }
        };
        let PeerMessage::Given { work } = message else { return Ok(answer) };
        self.receive(work)?;
        Ok(Some(PeerMessage::Acknowledged { count: 1 }))
    }

    /// A piece was traced.
    pub(crate) fn trace(&mut self, now: Time, outcome: Outcome, elapsed: Duration) {
        let returned = ray_count(&outcome.successors);
        self.traces = self.traces.checked_sub(1).expect("a piece was handed out before");
        self.ledger.trace(&outcome.counts, returned);
        self.tally.trace(now, elapsed, &outcome.counts);
        self.balancer.learn(elapsed, &outcome.counts, returned);
        for (share, sums) in &outcome.retired {
            if self.accounts.is_current(share) {
                self.accounts.retire(share, sums, self.queue.grid());
            }
        }
        for bundle in outcome.successors {
            self.resume(bundle);
        }
        if self.traces == 0 {
            self.accounts.assert_nothing_traced();
        }
    }

    /// The next piece for a compute thread, while there are threads for it.
    pub(crate) fn next_piece(&mut self) -> Option<Work> {
        let threads = self.config.threads;
        if self.phase != Phase::Rendering || self.traces >= threads * PIECES_PER_THREAD {
            return None;
        }
        let may_begin = self.accounts.open_count() < (threads * OPEN_UNITS_PER_THREAD) as usize
            || self.traces < threads;
        let work = match self.queue.pop(self.balancer.costs()) {
            Some(work) => work,
            None if may_begin => {
                let share = self.queue.begin_first()?;
                self.accounts.enter(&share).expect("nobody else has credit of a whole unit");
                self.queue.pop(self.balancer.costs())?
            }
            None => return None,
        };
        work.shares().iter().for_each(|share| self.accounts.trace(share));
        self.ledger.dispatch(rays_in(&work));
        self.traces += 1;
        Some(work)
    }

    /// What is to be given to peers now.
    pub(crate) fn gifts(&mut self) -> Vec<(WorkerId, Work)> {
        if self.phase == Phase::Failed {
            return Vec::new();
        }
        let gifts = self.balancer.gifts(&mut self.queue);
        gifts
            .into_iter()
            .map(|(peer, gift)| {
                if let Some(share) = &gift.begun {
                    self.accounts.enter(share).expect("nobody else has credit of a whole unit");
                }
                gift.work.shares().iter().for_each(|share| self.accounts.leave(share));
                let rays = rays_in(&gift.work);
                self.ledger.send(rays);
                self.tally.give(rays);
                (peer, gift.work)
            })
            .collect()
    }

    /// What is to be asked of the linked neighbors now.
    pub(crate) fn questions(
        &mut self,
        is_linked: impl Fn(WorkerId) -> bool,
    ) -> Vec<(WorkerId, PeerMessage)> {
        if self.phase != Phase::Rendering || self.balance == Balance::None {
            return Vec::new();
        }
        let mut neighbors = self.neighbors.clone();
        neighbors.retain(|&peer| is_linked(peer));
        let (questions, is_round) = self.balancer.questions(&self.queue, &neighbors);
        if is_round {
            self.tally.ask();
        }
        questions
    }

    /// Whether compute threads are to give up what they have not begun.
    pub(crate) fn interrupts(&mut self, now: Time) -> bool {
        self.phase == Phase::Rendering && self.balancer.interrupts(now, &self.queue, self.traces)
    }

    /// The figures, if it is time to report them.
    pub(crate) fn take_figures(&mut self, now: Time) -> Option<WorkerFigures> {
        let is_idle = self.is_idle();
        self.tally.take_due(now, is_idle)
    }

    /// The figures as of now.
    pub(crate) fn figures(&self, now: Time) -> WorkerFigures {
        self.tally.figures(now)
    }

    /// Credit that goes home, with its film values.
    pub(crate) fn take_complete(&mut self) -> Vec<(Share, TileSums)> {
        self.accounts.take_complete()
    }

    /// Work that is gone for good, if it is time to say so.
    pub(crate) fn violation(&self, now: Time) -> Option<Violation> {
        let (&(peer, _), _) = self.broken.iter().find(|&(_, &deadline)| deadline <= now)?;
        (self.phase != Phase::Failed).then_some(Violation::LinkBroken(peer))
    }

    /// When something is due without an event.
    pub(crate) fn next_deadline(&self) -> Option<Time> {
        let is_active = self.phase != Phase::Failed;
        let broken = self.broken.values().min().copied().filter(|_| is_active);
        let interrupt = self.balancer.interrupt_deadline(&self.queue, self.traces);
        let interrupt = interrupt.filter(|_| self.phase == Phase::Rendering);
        [self.tally.deadline(), interrupt, broken].into_iter().flatten().min()
    }

    /// Whether no thread traces and nothing waits.
    pub(crate) const fn is_idle(&self) -> bool {
        self.traces == 0 && self.queue.is_empty()
    }

    /// Whether moreover nothing is expected of anybody.
    pub(crate) fn is_quiet(&self) -> bool {
        self.is_idle() && self.accounts.open_count() == 0 && self.balancer.is_quiet()
    }

    /// How long what waits keeps all threads busy.
    pub(crate) fn load(&self) -> Load {
        self.balancer.load(&self.queue)
    }

    /// The fullest window toward a peer.
    pub(crate) fn unacknowledged_max(&self) -> u32 {
        self.balancer.unacknowledged_max()
    }

    /// Shows every share of credit that is here.
    pub(crate) fn for_each_share(&self, visit: &mut dyn FnMut(UnitId, Attempt, &Credit)) {
        let whole = Credit::whole();
        self.queue.for_each_unit(|unit, attempt| visit(unit, attempt, &whole));
        self.accounts.for_each_share(visit);
    }

    /// Checks that no ray was lost or doubled.
    pub(crate) fn check(&self) {
        self.ledger.check(self.queue.ray_count(), self.traces);
    }

    /// Work came from a peer.
    fn receive(&mut self, work: Work) -> Result<(), Violation> {
        self.check_work(&work)?;
        let rays = rays_in(&work);
        self.ledger.receive(rays);
        self.tally.receive(rays);
        let attempts: Vec<_> =
            work.shares().iter().map(|share| (share.unit, share.attempt)).collect();
        self.raise(&attempts);
        match work {
            Work::Samples(samples) => self.receive_samples(samples),
            Work::Rays(bundle) => self.receive_bundle(bundle),
        }
    }

    fn receive_samples(&mut self, samples: Samples) -> Result<(), Violation> {
        if !self.accounts.is_current(&samples.share) {
            return Ok(());
        }
        if samples.share.credit.is_whole() {
            return self.enter_whole(samples.share.unit, samples.share.attempt);
        }
        self.enter(&samples.share)?;
        self.queue.push_samples(samples);
        Ok(())
    }

    fn receive_bundle(&mut self, mut bundle: Bundle) -> Result<(), Violation> {
        self.drop_stale(&mut bundle);
        for share in &bundle.shares {
            self.enter(share)?;
        }
        if !bundle.shares.is_empty() {
            self.queue.push_bundle(bundle);
        }
        Ok(())
    }

    /// Rays came back from a compute thread.
    fn resume(&mut self, mut bundle: Bundle) {
        self.drop_stale(&mut bundle);
        bundle.shares.iter().for_each(|share| self.accounts.resume(share));
        if !bundle.shares.is_empty() {
            self.queue.push_bundle(bundle);
        }
    }

    fn drop_stale(&mut self, bundle: &mut Bundle) {
        let dropped = bundle.retain_shares(|share| self.accounts.is_current(share));
        self.ledger.drop_rays(dropped as u64);
    }

    /// A whole unit came in: nobody has begun it, so nothing else of it can be here.
    fn enter_whole(&mut self, unit: UnitId, attempt: Attempt) -> Result<(), Violation> {
        if self.accounts.is_open(unit) || self.queue.has_unit(unit, attempt) {
            return Err(Violation::TooMuchCredit(unit));
        }
        self.queue.push_unit(unit, attempt);
        Ok(())
    }

    fn enter(&mut self, share: &Share) -> Result<(), Violation> {
        if self.queue.has_unit(share.unit, share.attempt) {
            return Err(Violation::TooMuchCredit(share.unit));
        }
        self.accounts.enter(share).map_err(|_| Violation::TooMuchCredit(share.unit))
    }

    fn check_work(&self, work: &Work) -> Result<(), Violation> {
        for share in work.shares() {
            self.check_unit(share.unit)?;
        }
        let Work::Samples(samples) = work else { return Ok(()) };
        let unit = samples.share.unit;
        let path_count = self.queue.grid().unit(unit).map_or(0, |unit| unit.path_count());
        let first = samples.first_path;
        let end = u64::from(first) + u64::from(samples.path_count);
        if end > u64::from(path_count) {
            return Err(Violation::UnknownPaths { unit, first, end, path_count });
        }
        Ok(())
    }

    fn check_unit(&self, unit: UnitId) -> Result<(), Violation> {
        let is_known = self.queue.grid().unit(unit).is_some();
        if is_known { Ok(()) } else { Err(Violation::UnknownUnit(unit)) }
    }
}

fn rays_in(work: &Work) -> u64 {
    match work {
        Work::Samples(_) => 0,
        Work::Rays(bundle) => bundle.rays.len() as u64,
    }
}

fn ray_count(bundles: &[Bundle]) -> u64 {
    bundles.iter().map(|bundle| bundle.rays.len() as u64).sum()
}
