//! The top of a worker's core: what can happen, and what is done about it.
//!
//! Every event changes the job's parts; then [`WorkerCore::settle`] looks at what they want done.
//! Only this file pushes actions. It decides what belongs to which job and to which life of a peer;
//! all else is in [`crate::job`].

use std::collections::VecDeque;
use std::time::Duration;

use equilux_common::credit::Credit;
use equilux_common::ids::{Attempt, Incarnation, JobId, UnitId, WorkerId};
use equilux_common::message::{
    Home, JobStart, Load, PeerAddress, PeerMessage, ToCoordinator, ToWorker,
};
use equilux_common::time::Time;
use equilux_common::work::Outcome;
use equilux_mapping::Guest;

use crate::action::Action;
use crate::early::{Early, Letter};
use crate::event::Event;
use crate::job::Job;
use crate::links::Links;
use crate::pieces::PieceId;
use crate::residency::Order;
use crate::violation::Violation;

/// What a worker's core knows from the start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Config {
    /// Who it is.
    pub worker: WorkerId,
    /// In which life.
    pub incarnation: Incarnation,
    /// Compute threads; at least 1.
    pub threads: u32,
    /// Speed of one of them, in thousandths of the reference; at least 1.
    pub speed: u32,
    /// Bytes of memory for partitions and for the rays that wait for them; none: all that is there.
    pub memory: Option<u64>,
}

/// Most gifts that a peer may have received without acknowledging them.
pub const WINDOW_GIFTS: u32 = crate::balance::WINDOW_GIFTS;

/// The protocol side of a worker.
#[derive(Debug)]
pub struct WorkerCore {
    config: Config,
    job: Option<Job>,
    /// The newest job that is over.
    ended: JobId,
    links: Links,
    early: Early,
    actions: VecDeque<Action>,
}

impl WorkerCore {
    /// A worker that has been admitted and takes part in no job yet.
    #[must_use]
    pub fn new(config: Config) -> Self {
        Self {
            config: Config { threads: config.threads.max(1), speed: config.speed.max(1), ..config },
            job: None,
            ended: JobId(0),
            links: Links::default(),
            early: Early::default(),
            actions: VecDeque::new(),
        }
    }

    /// Something happened.
    pub fn handle(&mut self, now: Time, event: Event) {
        match event {
            Event::CoordinatorSaid(message) => self.obey(now, message),
            Event::PeerSaid { peer, incarnation, job, message, bytes } => {
                self.hear(now, Letter { peer, incarnation, job, message, bytes });
            }
            Event::PeerLinked { peer, incarnation } => self.join(now, peer, incarnation),
            Event::PeerLost { peer, incarnation } => self.lose(now, peer, incarnation),
            Event::SceneLoaded { job, partitions } => self.begin(now, job, partitions),
            Event::PartitionLoaded { job, partition } => {
                if let Some(job) = self.job_mut(job) {
                    job.partition_loaded(now, partition);
                }
            }
            Event::SceneFailed { job, reason } => self.fail(job, reason),
            Event::Traced { job, piece, outcome, elapsed } => {
                self.trace(now, job, piece, *outcome, elapsed);
            }
        }
        self.settle(now);
    }

    /// The time that [`Self::next_deadline`] gave has come.
    pub fn wake(&mut self, now: Time) {
        self.settle(now);
    }

    /// The next thing to be done, if any. To be called until there is none.
    pub fn poll_action(&mut self) -> Option<Action> {
        self.actions.pop_front()
    }

    /// When to call [`Self::wake`], unless an event comes first. It may change with every call.
    #[must_use]
    pub fn next_deadline(&self) -> Option<Time> {
        self.job.as_ref()?.next_deadline(|peer| self.links.incarnation(peer).is_some())
    }

    /// Shows every share of credit of a job that is here: waiting, traced, retired and not
    /// delivered, or come before the job. For checks from outside.
    pub fn for_each_share(&self, id: JobId, visit: &mut dyn FnMut(UnitId, Attempt, &Credit)) {
        if let Some(job) = self.job.as_ref().filter(|job| job.id() == id) {
            job.for_each_share(visit);
        }
        self.early.for_each_share(id, |share| visit(share.unit, share.attempt, &share.credit));
    }

    /// The job that is running here.
    #[must_use]
    pub fn job(&self) -> Option<JobId> {
        self.job.as_ref().map(Job::id)
    }

    /// How long what waits here keeps all threads busy, as far as that can be told.
    #[must_use]
    pub fn load(&self) -> Load {
        self.job.as_ref().map_or(Load::ZERO, Job::load)
    }

    /// How long what waits must last: below, a worker asks for more, and gives nothing away.
    #[must_use]
    pub fn low_water(&self) -> Duration {
        self.job.as_ref().map_or(Duration::ZERO, Job::low_water)
    }

    /// Rays that wait here, for a thread or for their way to another home, and how many may where
    /// the model is cut.
    #[must_use]
    pub fn waiting_rays(&self) -> (u64, u64) {
        self.job.as_ref().map_or((0, u64::MAX), Job::waiting_rays)
    }

    /// Whether nothing waits or is traced here.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.job.as_ref().is_none_or(Job::is_idle)
    }

    /// Whether nothing waits or is traced here, and nothing is expected of a peer.
    #[must_use]
    pub fn is_quiet(&self) -> bool {
        self.early.is_empty() && self.job.as_ref().is_none_or(Job::is_quiet)
    }

    /// Most gifts of which one peer has not said that they arrived.
    #[must_use]
    pub fn unacknowledged_max(&self) -> u32 {
        self.job.as_ref().map_or(0, Job::unacknowledged_max)
    }

    fn obey(&mut self, now: Time, message: ToWorker) {
        match message {
            ToWorker::JobStarted(start) => self.start(now, *start),
            ToWorker::NeighborsChanged { job, neighbors, gone } => {
                self.change_neighbors(job, neighbors, &gone);
            }
            ToWorker::HomesChanged { job, homes } => self.change_homes(now, job, homes),
            ToWorker::AttemptsRaised { job, units } => {
                if let Some(job) = self.job_mut(job) {
                    job.raise(&units);
                    self.reread(now);
                }
            }
            ToWorker::UnitsIssued { job, units } => self.issue(job, &units),
            ToWorker::JobEnded { job } => self.end(now, job),
        }
    }

    fn start(&mut self, now: Time, mut start: JobStart) {
        let id = start.spec.id;
        if id <= self.ended || self.job() == Some(id) {
            return;
        }
        if let Some(previous) = self.job() {
            self.end(now, previous);
        }
        let job = Job::new(now, self.config, &start);
        let mut peers = self.others(&start.homes);
        peers.append(&mut start.neighbors);
        self.links.replace(peers);
        self.job = Some(job);
        let (spec, pack_from) = (Box::new(start.spec), start.pack_from);
        self.actions.push_back(Action::LoadScene { spec, pack_from });
        self.actions.push_back(Action::Link(self.links.wanted().to_vec()));
        self.issue(id, &start.units);
        self.reread(now);
    }

    fn change_neighbors(
        &mut self,
        job: JobId,
        neighbors: Vec<PeerAddress>,
        gone: &[(WorkerId, Incarnation)],
    ) {
        let Some(job) = self.job.as_mut().filter(|running| running.id() == job) else { return };
        job.set_neighbors(&neighbors);
        job.bury(gone);
        self.links.widen(neighbors, gone);
        self.actions.push_back(Action::Link(self.links.wanted().to_vec()));
    }

    fn change_homes(&mut self, now: Time, job: JobId, homes: Vec<Home>) {
        let others = self.others(&homes);
        let Some(job) = self.job.as_mut().filter(|running| running.id() == job) else { return };
        let outcome = job.change_homes(now, homes);
        self.links.widen(others, &[]);
        self.actions.push_back(Action::Link(self.links.wanted().to_vec()));
        if let Err(violation) = outcome {
            self.give_up(&violation);
        }
    }

    /// Where the living homes are found, but for this one.
    fn others(&self, homes: &[Home]) -> Vec<PeerAddress> {
        let living = homes.iter().filter(|home| !home.is_lost).map(|home| &home.peer);
        living.filter(|peer| peer.worker != self.config.worker).cloned().collect()
    }

    fn issue(&mut self, job: JobId, units: &[(UnitId, Attempt)]) {
        if let Some(Err(violation)) = self.job_mut(job).map(|job| job.issue(units)) {
            self.give_up(&violation);
        }
    }

    fn end(&mut self, now: Time, id: JobId) {
        self.ended = self.ended.max(id);
        self.early.forget_job(id);
        let Some(job) = self.job.take_if(|job| job.id() == id) else { return };
        let figures = Box::new(job.figures(now));
        self.tell(ToCoordinator::Reported { job: id, figures });
        self.actions.push_back(Action::DropScene { job: id });
    }

    fn begin(&mut self, now: Time, id: JobId, partitions: Option<Guest>) {
        let Some(job) = self.job_mut(id).filter(|job| job.is_loading()) else { return };
        match job.begin(now, partitions) {
            Ok(()) => self.tell(ToCoordinator::Ready { job: id }),
            Err(violation) => self.give_up(&violation),
        }
    }

    fn fail(&mut self, id: JobId, reason: String) {
        if self.job_mut(id).is_some_and(Job::fail) {
            self.tell(ToCoordinator::Failed { job: id, reason });
        }
    }

    fn give_up(&mut self, violation: &Violation) {
        if let Some(id) = self.job() {
            self.fail(id, violation.to_string());
        }
    }

    fn trace(&mut self, now: Time, id: JobId, piece: PieceId, outcome: Outcome, elapsed: Duration) {
        if let Some(job) = self.job_mut(id) {
            job.trace(now, piece, outcome, elapsed);
        }
    }

    /// Takes a letter from a peer, or keeps it until it can be answered.
    fn hear(&mut self, now: Time, letter: Letter) {
        if letter.job <= self.ended {
            return;
        }
        let is_linked = self.links.incarnation(letter.peer) == Some(letter.incarnation);
        let is_due = |job: &&mut Job| job.id() == letter.job && !job.is_ahead(&letter.message);
        let Some(job) = self.job.as_mut().filter(|job| is_linked && is_due(job)) else {
            self.early.keep(letter);
            return;
        };
        match job.hear(now, letter.peer, letter.message, letter.bytes) {
            Ok(Some(answer)) => self.tell_peer(letter.peer, answer),
            Ok(None) => {}
            Err(violation) => self.give_up(&violation),
        }
    }

    /// Takes up the letters that came too early.
    fn reread(&mut self, now: Time) {
        for letter in self.early.take_all() {
            self.hear(now, letter);
        }
    }

    fn join(&mut self, now: Time, peer: WorkerId, incarnation: Incarnation) {
        if !self.links.join(peer, incarnation) {
            return;
        }
        if let Some(job) = &mut self.job {
            job.join();
        }
        self.reread(now);
    }

    fn lose(&mut self, now: Time, peer: WorkerId, incarnation: Incarnation) {
        let stood = self.links.lose(peer, incarnation);
        if let Some(job) = self.job.as_mut().filter(|_| stood) {
            job.lose(now, peer, incarnation);
        }
    }

    /// Does all that is to be done, whatever happened.
    fn settle(&mut self, now: Time) {
        self.put_to_work(now);
        let Some(job) = &mut self.job else { return };
        let id = job.id();
        let mut said = job.gifts(now);
        let forwards = job.forwards(now, |peer| self.links.incarnation(peer).is_some());
        if !forwards.is_empty() {
            // What is left may be stuck now.
            self.put_to_work(now);
        }
        said.extend(forwards);
        let Some(job) = &mut self.job else { return };
        said.extend(job.questions(now, |peer| self.links.incarnation(peer).is_some()));
        if job.interrupts(now) {
            self.actions.push_back(Action::Interrupt);
        }
        said.extend(job.receipts(now));
        let (figures, complete) = (job.take_figures(now), job.take_complete(now));
        let violation = job.violation(now, |peer| self.links.incarnation(peer).is_some());
        job.check();

        for (peer, message) in said {
            self.tell_peer(peer, message);
        }
        if let Some(figures) = figures {
            self.tell(ToCoordinator::Reported { job: id, figures: Box::new(figures) });
        }
        for (share, sums) in complete {
            self.tell(ToCoordinator::Delivered { job: id, share, sums });
        }
        if let Some(violation) = violation {
            self.give_up(&violation);
        }
    }

    /// Has partitions brought and dropped, and work traced.
    fn put_to_work(&mut self, now: Time) {
        let Some(job) = &mut self.job else { return };
        let id = job.id();
        for order in job.arrange(now, |peer| self.links.incarnation(peer).is_some()) {
            self.actions.push_back(match order {
                Order::Load(partition) => {
                    let from = job.giver(partition).and_then(|peer| self.links.address(peer));
                    Action::LoadPartition { job: id, partition, from: from.cloned() }
                }
                Order::Drop(partition) => Action::DropPartition { job: id, partition },
            });
        }
        while let Some((piece, work)) = job.next_piece(now) {
            self.actions.push_back(Action::Trace { job: id, piece, work });
        }
    }

    fn job_mut(&mut self, id: JobId) -> Option<&mut Job> {
        self.job.as_mut().filter(|job| job.id() == id)
    }

    fn tell(&mut self, message: ToCoordinator) {
        self.actions.push_back(Action::Tell(message));
    }

    fn tell_peer(&mut self, peer: WorkerId, message: PeerMessage) {
        let incarnation = self.links.incarnation(peer).expect("only linked peers are spoken to");
        let job = self.job().expect("peers are spoken to about the running job");
        self.actions.push_back(Action::TellPeer { peer, incarnation, job, message });
    }
}

#[cfg(test)]
mod tests;
