//! The top of the coordinator's core: what can happen, and what is done about it.
//!
//! Jobs run one after another, in the order in which they were submitted. Only this file pushes
//! actions.

use std::collections::VecDeque;
use std::time::Duration;

use equilux_common::bundle::Share;
use equilux_common::credit::Credit;
use equilux_common::film::TileSums;
use equilux_common::ids::{Attempt, Incarnation, JobId, UnitId, WorkerId};
use equilux_common::message::{ToCoordinator, ToWorker, WorkerFigures};
use equilux_common::time::Time;

use crate::action::{Action, JobReport, JobState};
use crate::closing::Closing;
use crate::event::{Event, Hello, JobOrder, LinkId};
use crate::job::{Job, Shares, report_idle};
use crate::pace::Pace;
use crate::roster::Roster;

/// Most jobs that wait. A job beyond fails at once.
const QUEUED_JOBS_MAX: usize = 1024;

/// What a coordinator's core knows from the start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Config {
    /// Progress is reported at most this often; changes of state at once.
    pub report_interval: Duration,
}

impl Default for Config {
    /// Often enough for a progress bar to look alive.
    fn default() -> Self {
        Self { report_interval: Duration::from_millis(100) }
    }
}

/// The protocol side of the coordinator.
#[derive(Debug)]
pub struct CoordinatorCore {
    roster: Roster,
    queued: VecDeque<JobOrder>,
    running: Option<Job>,
    closing: Closing,
    pace: Pace,
    actions: VecDeque<Action>,
}

impl CoordinatorCore {
    /// A coordinator without workers or jobs.
    #[must_use]
    pub fn new(config: Config) -> Self {
        Self {
            roster: Roster::default(),
            queued: VecDeque::new(),
            running: None,
            closing: Closing::default(),
            pace: Pace::new(config.report_interval),
            actions: VecDeque::new(),
        }
    }

    /// Something happened.
    pub fn handle(&mut self, now: Time, event: Event) {
        match event {
            Event::Knocked { link, hello } => self.admit(link, hello),
            Event::WorkerLost { worker, incarnation } => self.lose(worker, incarnation),
            Event::WorkerSaid { worker, incarnation, message } => {
                if self.roster.has(worker, incarnation) {
                    self.hear(now, worker, incarnation, message);
                }
            }
            Event::Submitted(order) => self.submit(*order),
            Event::Cancelled { job } => self.cancel(now, job),
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
        let pace = self.running.as_ref().and_then(|_| self.pace.deadline());
        [pace, self.closing.deadline()].into_iter().flatten().min()
    }

    /// The job that is running.
    #[must_use]
    pub fn job(&self) -> Option<JobId> {
        self.running.as_ref().map(|job| job.order().spec.id)
    }

    /// Compute threads of all who take part.
    #[must_use]
    pub fn thread_count(&self) -> u32 {
        let threads = self.roster.members().map(|(_, member)| member.hello.threads);
        threads.fold(0, u32::saturating_add)
    }

    /// Shows the units of the running job that are not committed, and the attempts they are at. For
    /// checks from outside.
    pub fn for_each_uncommitted(&self, mut visit: impl FnMut(UnitId, Attempt)) {
        for (unit, attempt) in self.running.iter().flat_map(|job| job.gathering().uncommitted()) {
            visit(unit, attempt);
        }
    }

    /// Shows every share of credit of the running job that is here. For checks from outside.
    pub fn for_each_share(&self, visit: &mut dyn FnMut(UnitId, Attempt, &Credit)) {
        let Some(job) = &self.running else { return };
        job.gathering().for_each_share(visit);
        if job.is_orphaned() {
            let whole = Credit::whole();
            self.for_each_uncommitted(|unit, attempt| visit(unit, attempt, &whole));
        }
    }

    fn admit(&mut self, link: LinkId, hello: Hello) {
        let Some((worker, incarnation)) = self.roster.next_life(&hello.name) else { return };
        if let Some(earlier) = self.roster.member(worker).map(|member| member.incarnation) {
            self.expel(worker, earlier, "the same worker has come again in a new life".into());
        }
        self.roster.admit(worker, incarnation, hello);
        self.actions.push_back(Action::Admit { link, worker, incarnation });
        let Some(job) = &mut self.running else { return };
        if job.is_orphaned() {
            job.settle_homes(&self.roster);
        } else {
            job.add_home(self.roster.home(worker).expect("it has just been admitted"));
        }
        let units = if job.is_orphaned() { job.issue(&self.roster) } else { Vec::new() };
        let units = units.into_iter().next().map_or(Vec::new(), |(_, units)| units);
        let neighbors = self.roster.neighbors(worker, &job.order().topology);
        let start = job.start(neighbors, self.roster.pack_sources(worker), units);
        let raised = job.gathering().uncommitted().filter(|&(_, attempt)| attempt > Attempt(0));
        let raised: Vec<_> = raised.collect();
        let id = start.spec.id;
        self.tell(worker, ToWorker::JobStarted(Box::new(start)));
        if !raised.is_empty() {
            self.tell(worker, ToWorker::AttemptsRaised { job: id, units: raised });
        }
        self.tell_neighbors(Some(worker), &[]);
        self.tell_homes(Some(worker));
    }

    fn lose(&mut self, worker: WorkerId, incarnation: Incarnation) {
        if self.roster.remove(worker, incarnation).is_none() {
            return;
        }
        let Some(job) = &mut self.running else { return };
        let id = job.order().spec.id;
        // Any unit may have had rays at the lost worker: all that are not whole are tried again.
        let units = job.gathering_mut().raise();
        let shares = job.issue(&self.roster);
        job.lose_home(worker, incarnation);
        self.tell_neighbors(None, &[(worker, incarnation)]);
        self.tell_homes(None);
        self.tell_all(&ToWorker::AttemptsRaised { job: id, units });
        self.issue(id, shares);
    }

    fn issue(&mut self, job: JobId, shares: Shares) {
        for (worker, units) in shares.into_iter().filter(|(_, units)| !units.is_empty()) {
            self.tell(worker, ToWorker::UnitsIssued { job, units });
        }
    }

    fn expel(&mut self, worker: WorkerId, incarnation: Incarnation, reason: String) {
        self.actions.push_back(Action::Expel { worker, incarnation, reason });
        self.lose(worker, incarnation);
    }

    fn hear(
        &mut self,
        now: Time,
        worker: WorkerId,
        incarnation: Incarnation,
        message: ToCoordinator,
    ) {
        match message {
            ToCoordinator::Ready { job } => self.begin(now, job),
            ToCoordinator::Failed { job, reason } => self.fail(now, worker, job, &reason),
            ToCoordinator::Delivered { job, share, sums } if self.job() == Some(job) => {
                self.deliver(now, (worker, incarnation), &share, sums);
            }
            ToCoordinator::Delivered { .. } => {}
            ToCoordinator::Reported { job, figures } => self.note(worker, job, *figures),
        }
    }

    fn begin(&mut self, now: Time, id: JobId) {
        let Some(job) = self.running.as_mut().filter(|job| job.order().spec.id == id) else {
            return;
        };
        if job.begin(now) {
            let report = job.report(now, job.state());
            self.report_now(now, report);
        }
    }

    fn fail(&mut self, now: Time, worker: WorkerId, id: JobId, reason: &str) {
        if self.job() == Some(id) {
            let name = self.roster.member(worker).map_or("", |member| &member.hello.name);
            let reason = format!("{worker} ({name}): {reason}");
            self.end(now, JobState::Failed { reason });
        }
    }

    fn deliver(
        &mut self,
        now: Time,
        (worker, incarnation): (WorkerId, Incarnation),
        share: &Share,
        sums: TileSums,
    ) {
        let Some(job) = &mut self.running else { return };
        match job.gathering_mut().deliver(share, sums) {
            Ok(None) => {}
            Ok(Some((unit, sums))) => {
                let is_complete = job.gathering().is_complete();
                let job = job.order().spec.id;
                self.actions.push_back(Action::Commit { job, unit, sums });
                self.pace.change();
                if is_complete {
                    self.end(now, JobState::Done);
                }
            }
            Err(violation) => self.expel(worker, incarnation, violation.to_string()),
        }
    }

    fn note(&mut self, worker: WorkerId, id: JobId, figures: WorkerFigures) {
        match &mut self.running {
            Some(job) if job.order().spec.id == id => {
                job.hear(worker, figures);
                self.pace.change();
            }
            _ => {
                let report = self.closing.hear(worker, id, figures);
                self.actions.extend(report.map(Action::Report));
            }
        }
    }

    fn submit(&mut self, order: JobOrder) {
        let is_full = self.queued.len() >= QUEUED_JOBS_MAX;
        let reason =
            || format!("{QUEUED_JOBS_MAX} jobs are waiting already; submit it again later");
        let state = if is_full { JobState::Failed { reason: reason() } } else { JobState::Queued };
        self.actions.push_back(Action::Report(report_idle(&order, state)));
        if !is_full {
            self.queued.push_back(order);
        }
    }

    fn cancel(&mut self, now: Time, id: JobId) {
        if self.job() == Some(id) {
            self.end(now, JobState::Cancelled);
        } else if let Some(index) = self.queued.iter().position(|order| order.spec.id == id)
            && let Some(order) = self.queued.remove(index)
        {
            self.actions.push_back(Action::Report(report_idle(&order, JobState::Cancelled)));
        }
    }

    /// Ends the running job, one way or another.
    fn end(&mut self, now: Time, state: JobState) {
        let Some(job) = self.running.take() else { return };
        let report = job.report(now, state);
        self.tell_all(&ToWorker::JobEnded { job: report.job });
        let awaited = self.roster.members().map(|(worker, _)| worker).collect();
        self.closing.close(now, report.clone(), awaited);
        self.report_now(now, report);
    }

    /// Starts the next job if nothing runs and enough workers are there.
    fn start(&mut self, now: Time) {
        let is_enough = |order: &JobOrder| self.roster.len() >= order.workers_min.max(1) as usize;
        if self.running.is_some() || !self.queued.front().is_some_and(is_enough) {
            return;
        }
        let Some(order) = self.queued.pop_front() else { return };
        let mut job = Job::new(now, order);
        job.settle_homes(&self.roster);
        for (worker, units) in job.issue(&self.roster) {
            let neighbors = self.roster.neighbors(worker, &job.order().topology);
            job.meet(worker, &neighbors);
            let start = job.start(neighbors, self.roster.pack_sources(worker), units);
            self.tell(worker, ToWorker::JobStarted(Box::new(start)));
        }
        let report = job.report(now, job.state());
        self.running = Some(job);
        self.report_now(now, report);
    }

    /// Does all that is to be done, whatever happened.
    fn settle(&mut self, now: Time) {
        self.start(now);
        if let Some(job) = &self.running
            && self.pace.deadline().is_some_and(|deadline| deadline <= now)
        {
            let report = job.report(now, job.state());
            self.report_now(now, report);
        }
        let closed = self.closing.expire(now);
        self.actions.extend(closed.into_iter().map(Action::Report));
    }

    fn report_now(&mut self, now: Time, report: JobReport) {
        self.pace.report(now);
        self.actions.push_back(Action::Report(report));
    }

    /// Tells those whose neighbors are others now, but for one who knows; and everybody if lives
    /// are gone, for any worker may have had a link to them.
    fn tell_neighbors(&mut self, but: Option<WorkerId>, gone: &[(WorkerId, Incarnation)]) {
        let Some(job) = &mut self.running else { return };
        let id = job.order().spec.id;
        let told: Vec<WorkerId> = self.roster.members().map(|(worker, _)| worker).collect();
        let mut messages = Vec::new();
        for worker in told {
            let neighbors = self.roster.neighbors(worker, &job.order().topology);
            if (job.meet(worker, &neighbors) || !gone.is_empty()) && Some(worker) != but {
                let gone = gone.to_vec();
                messages.push((worker, ToWorker::NeighborsChanged { job: id, neighbors, gone }));
            }
        }
        for (worker, message) in messages {
            self.tell(worker, message);
        }
    }

    /// Tells all but one who knows who is home to the partitions, if they have to be at home
    /// somewhere.
    fn tell_homes(&mut self, but: Option<WorkerId>) {
        let Some(message) = self.running.as_ref().and_then(Job::homes) else { return };
        let workers = self.roster.members().map(|(worker, _)| worker);
        let told: Vec<WorkerId> = workers.filter(|&worker| Some(worker) != but).collect();
        for worker in told {
            self.tell(worker, message.clone());
        }
    }

    fn tell_all(&mut self, message: &ToWorker) {
        let told: Vec<WorkerId> = self.roster.members().map(|(worker, _)| worker).collect();
        for worker in told {
            self.tell(worker, message.clone());
        }
    }

    fn tell(&mut self, worker: WorkerId, message: ToWorker) {
        let Some(member) = self.roster.member(worker) else { return };
        let incarnation = member.incarnation;
        self.actions.push_back(Action::Tell { worker, incarnation, message });
    }
}

#[cfg(test)]
mod tests;
