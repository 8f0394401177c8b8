//! A run: the event loop around the cores.

use std::collections::BTreeMap;
use std::time::Duration;

use equilux_common::credit::Credit;
use equilux_common::ids::{Attempt, Incarnation, JobId, UnitId, WorkerId};
use equilux_common::job::JobSpec;
use equilux_common::message::PeerAddress;
use equilux_common::time::Time;
use equilux_coordinator_core::action::Action as CoordinatorAction;
use equilux_coordinator_core::event::{Event as CoordinatorEvent, Hello, LinkId};
use equilux_coordinator_core::{Config as CoordinatorConfig, CoordinatorCore};
use equilux_worker_core::action::Action;
use equilux_worker_core::event::Event;
use equilux_worker_core::{Config, WINDOW_GIFTS, WorkerCore};

use crate::agenda::Agenda;
use crate::checks::CreditCheck;
use crate::counts::Counts;
use crate::happening::Happening;
use crate::host::{Due, Host};
use crate::network::{End, Network};
use crate::plan::Plan;
use crate::random::Random;
use crate::tracer::Tracer;
use crate::view::JobView;

/// Pieces that a worker's core may have on compute threads, per thread.
const PIECES_PER_THREAD_MAX: usize = 2;

/// A run that takes more steps than this will never end.
const STEPS_MAX: u64 = 1_000_000;

/// The real cores in virtual time.
#[derive(Debug)]
pub struct Simulation<T> {
    plan: Plan,
    tracer: T,
    now: Time,
    agenda: Agenda,
    coordinator: CoordinatorCore,
    hosts: Vec<Host>,
    network: Network,
    random: Random,
    jobs: BTreeMap<JobId, JobView>,
    /// Credit that died with hosts and links.
    lost: Vec<(JobId, UnitId, Attempt, Credit)>,
    counts: Counts,
}

impl<T: Tracer> Simulation<T> {
    /// Prepares a run.
    #[must_use]
    pub fn new(plan: Plan, tracer: T) -> Self {
        let mut random = Random::new(plan.seed ^ 0x51b);
        let network = Network::new(plan.latency, Random::new(random.bits()));
        let mut simulation = Self {
            tracer,
            now: Time::ZERO,
            agenda: Agenda::default(),
            coordinator: CoordinatorCore::new(CoordinatorConfig::default()),
            hosts: Vec::new(),
            network,
            random,
            jobs: BTreeMap::new(),
            lost: Vec::new(),
            counts: Counts::default(),
            plan,
        };
        simulation.schedule_plan();
        simulation
    }

    /// Runs until nothing happens any more.
    ///
    /// # Panics
    /// If anything that must hold does not.
    pub fn run(&mut self) {
        while let Some((time, happening)) = self.agenda.pop() {
            assert!(self.counts.steps < STEPS_MAX, "the run does not end");
            self.counts.steps += 1;
            self.now = time;
            self.happen(happening);
            self.check();
        }
    }

    /// The jobs, by number.
    #[must_use]
    pub const fn jobs(&self) -> &BTreeMap<JobId, JobView> {
        &self.jobs
    }

    /// How many messages were sent.
    #[must_use]
    pub const fn counts(&self) -> Counts {
        self.counts
    }

    /// How many lives workers had.
    #[must_use]
    pub fn life_count(&self) -> u64 {
        self.hosts.len() as u64
    }

    /// The virtual time.
    #[must_use]
    pub const fn now(&self) -> Time {
        self.now
    }

    /// Whether no core has anything left to do.
    #[must_use]
    pub fn is_quiet(&self) -> bool {
        let cores = self.hosts.iter().filter_map(|host| host.core.as_ref());
        self.coordinator.job().is_none()
            && cores.into_iter().all(|core| core.is_quiet() && core.job().is_none())
    }

    fn schedule_plan(&mut self) {
        for (machine, plan) in self.plan.machines.clone().into_iter().enumerate() {
            for turn in plan.turns {
                self.schedule(Time::ZERO + turn, Happening::Turn { machine });
            }
        }
        let mut time = Time::ZERO;
        for (wait, order) in self.plan.jobs.clone() {
            time = time + wait;
            self.schedule(time, Happening::Submit(Box::new(order)));
        }
        if let Some((when, job)) = self.plan.cancelled {
            self.schedule(Time::ZERO + when, Happening::Cancel(job));
        }
    }

    fn happen(&mut self, happening: Happening) {
        match happening {
            Happening::Turn { machine } => self.turn(machine),
            Happening::Submit(order) => {
                self.jobs.insert(order.spec.id, JobView::new(order.spec.clone()));
                self.coordinate(CoordinatorEvent::Submitted(order));
            }
            Happening::Cancel(job) => self.coordinate(CoordinatorEvent::Cancelled { job }),
            Happening::Knock { host } => self.knock(host),
            Happening::Admit { host, worker, incarnation } => self.admit(host, worker, incarnation),
            Happening::HangUp { host } => {
                if let Some((worker, incarnation)) = self.hosts[host].identity {
                    self.coordinate(CoordinatorEvent::WorkerLost { worker, incarnation });
                }
            }
            Happening::ToCoordinator { from, message } => {
                let (worker, incarnation) = self.hosts[from].identity.expect("it was admitted");
                let event = CoordinatorEvent::WorkerSaid { worker, incarnation, message };
                self.coordinate(event);
            }
            Happening::ToWorker { to, message } => self.work(to, Event::CoordinatorSaid(message)),
            Happening::ToPeer { from, to, job, message } => {
                let (peer, incarnation) = self.hosts[from].identity.expect("it was admitted");
                self.work(to, Event::PeerSaid { peer, incarnation, job, message, bytes: 1 });
            }
            Happening::Linked { at, peer } => self.link_stands(at, peer),
            Happening::Unlinked { at, peer } => self.link_gone(at, peer),
            Happening::Loaded { at, job } => {
                if self.hosts[at].threads.load(&self.jobs[&job].task) {
                    self.work(at, Event::SceneLoaded { job });
                }
            }
            Happening::Traced { at, thread, generation } => self.traced(at, thread, generation),
            Happening::Wake { end } => self.wake(end),
        }
    }

    /// A machine's worker comes if it is not there, and dies if it is.
    fn turn(&mut self, machine: usize) {
        let alive = self.hosts.iter().position(|host| host.machine == machine && host.is_alive);
        if let Some(host) = alive {
            self.kill(host);
            return;
        }
        let plan = &self.plan.machines[machine];
        self.hosts.push(Host::new(machine, plan.threads, plan.speed));
        let host = self.hosts.len() - 1;
        self.send(End::Host(host), End::Coordinator, Happening::Knock { host });
    }

    fn knock(&mut self, host: usize) {
        let plan = &self.plan.machines[self.hosts[host].machine];
        let hello = Hello {
            name: plan.name.clone(),
            address: host.to_string(),
            threads: plan.threads,
            speed: plan.speed,
        };
        self.coordinate(CoordinatorEvent::Knocked { link: LinkId(host as u64), hello });
    }

    fn admit(&mut self, host: usize, worker: WorkerId, incarnation: Incarnation) {
        if !self.hosts[host].is_alive {
            return;
        }
        let machine = &self.plan.machines[self.hosts[host].machine];
        let (threads, speed) = (machine.threads, machine.speed);
        let config = Config { worker, incarnation, threads, speed };
        self.hosts[host].core = Some(WorkerCore::new(config));
    }

    /// A host dies: what it holds is lost, and so is what is on its way to it, and perhaps some of
    /// what is on its way from it. Who had to do with it finds out later.
    fn kill(&mut self, host: usize) {
        self.hosts[host].is_alive = false;
        if let Some(core) = self.hosts[host].core.take()
            && let Some(job) = core.job()
        {
            core.for_each_share(&mut |unit, attempt, credit| {
                self.lost.push((job, unit, attempt, credit.clone()));
            });
        }
        let loses_sent = self.random.chance(50);
        self.drop_happenings(|happening| match happening {
            Happening::ToWorker { to, .. } => *to == host,
            Happening::ToPeer { from, to, .. } => *to == host || (*from == host && loses_sent),
            Happening::ToCoordinator { from, .. } => *from == host && loses_sent,
            Happening::Knock { host: which } => *which == host && loses_sent,
            Happening::Admit { host: which, .. } => *which == host,
            Happening::Linked { at, peer } => *at == host || *peer == host,
            Happening::Unlinked { at, .. }
            | Happening::Loaded { at, .. }
            | Happening::Traced { at, .. } => *at == host,
            Happening::Wake { end } => *end == End::Host(host),
            _ => false,
        });
        self.send(End::Host(host), End::Coordinator, Happening::HangUp { host });
        let witnesses = self.hosts.iter().enumerate();
        let witnesses: Vec<usize> =
            witnesses.filter(|(_, other)| other.linked.contains(&host)).map(|(at, _)| at).collect();
        for at in witnesses {
            let when = self.now + self.network.delay();
            self.schedule(when, Happening::Unlinked { at, peer: host });
        }
    }

    fn link_stands(&mut self, at: usize, peer: usize) {
        if self.hosts[at].wanted.contains(&peer)
            && self.hosts[at].linked.insert(peer)
            && let Some((peer, incarnation)) = self.hosts[peer].identity
        {
            self.work(at, Event::PeerLinked { peer, incarnation });
        }
    }

    fn link_gone(&mut self, at: usize, peer: usize) {
        if self.hosts[at].linked.remove(&peer)
            && let Some((peer, incarnation)) = self.hosts[peer].identity
        {
            self.work(at, Event::PeerLost { peer, incarnation });
        }
    }

    fn traced(&mut self, at: usize, thread: usize, generation: u64) {
        let Some((job, traced)) = self.hosts[at].threads.finish(thread, generation) else { return };
        let due = self.hosts[at].threads.start(self.now, &self.tracer);
        self.schedule_threads(at, due);
        let elapsed = traced.elapsed;
        self.work(at, Event::Traced { job, outcome: Box::new(traced.outcome), elapsed });
    }

    fn wake(&mut self, end: End) {
        let is_due = |deadline: Option<Time>| deadline.is_some_and(|time| time <= self.now);
        match end {
            End::Coordinator if is_due(self.coordinator.next_deadline()) => {
                self.coordinator.wake(self.now);
                self.coordinated();
            }
            End::Host(host) => {
                if let Some(core) = &mut self.hosts[host].core
                    && core.next_deadline().is_some_and(|time| time <= self.now)
                {
                    core.wake(self.now);
                    self.worked(host);
                }
            }
            End::Coordinator => {}
        }
    }

    fn coordinate(&mut self, event: CoordinatorEvent) {
        self.coordinator.handle(self.now, event);
        self.coordinated();
    }

    /// Carries out what the coordinator's core wants.
    fn coordinated(&mut self) {
        while let Some(action) = self.coordinator.poll_action() {
            self.carry_out_coordinator(action);
        }
        self.schedule_wake(End::Coordinator, self.coordinator.next_deadline());
    }

    fn carry_out_coordinator(&mut self, action: CoordinatorAction) {
        match action {
            CoordinatorAction::Admit { link, worker, incarnation } => {
                let host = usize::try_from(link.0).expect("a host's number");
                self.hosts[host].identity = Some((worker, incarnation));
                let admit = Happening::Admit { host, worker, incarnation };
                self.send(End::Coordinator, End::Host(host), admit);
            }
            CoordinatorAction::Expel { worker, incarnation, reason } => {
                assert!(reason.contains("new life"), "{worker} broke the protocol: {reason}");
                let host = self.host(worker, incarnation);
                if self.hosts[host].is_alive {
                    // A knock of its own earlier life came late. It is fenced, and comes again.
                    self.kill(host);
                    self.turn(self.hosts[host].machine);
                }
            }
            CoordinatorAction::Tell { worker, incarnation, message } => {
                self.counts.coordinator += 1;
                let to = self.host(worker, incarnation);
                self.send(End::Coordinator, End::Host(to), Happening::ToWorker { to, message });
            }
            CoordinatorAction::Commit { job, unit, sums } => {
                self.jobs.get_mut(&job).expect("it was submitted").commit(unit, &sums);
            }
            CoordinatorAction::Report(report) => {
                self.jobs.get_mut(&report.job).expect("it was submitted").report(report);
            }
        }
    }

    fn work(&mut self, host: usize, event: Event) {
        if let Some(core) = &mut self.hosts[host].core {
            core.handle(self.now, event);
            self.worked(host);
        }
    }

    /// Carries out what a worker's core wants.
    fn worked(&mut self, host: usize) {
        while let Some(action) = self.hosts[host].core.as_mut().and_then(WorkerCore::poll_action) {
            self.carry_out(host, action);
        }
        let due = self.hosts[host].threads.start(self.now, &self.tracer);
        self.schedule_threads(host, due);
        let deadline = self.hosts[host].core.as_ref().and_then(WorkerCore::next_deadline);
        self.schedule_wake(End::Host(host), deadline);
    }

    fn carry_out(&mut self, host: usize, action: Action) {
        match action {
            Action::LoadScene { spec, .. } => self.load(host, &spec),
            Action::Trace { job, work } => self.hosts[host].threads.push(job, work),
            Action::Interrupt => {
                self.counts.interrupts += 1;
                let all = self.random.chance(50);
                let due = self.hosts[host].threads.interrupt(self.now, &self.tracer, all);
                self.schedule_threads(host, due);
            }
            Action::DropScene { .. } => self.hosts[host].threads.drop_scene(),
            Action::Link(peers) => self.link(host, &peers),
            Action::TellPeer { peer, incarnation, job, message } => {
                self.counts.add(&message, self.coordinator.job() != Some(job));
                let to = self.host(peer, incarnation);
                assert!(self.hosts[host].linked.contains(&to), "{peer} is told without a link");
                let happening = Happening::ToPeer { from: host, to, job, message };
                self.send(End::Host(host), End::Host(to), happening);
            }
            Action::Tell(message) => {
                self.counts.coordinator += 1;
                let happening = Happening::ToCoordinator { from: host, message };
                self.send(End::Host(host), End::Coordinator, happening);
            }
        }
    }

    fn load(&mut self, host: usize, spec: &JobSpec) {
        self.hosts[host].threads.want(spec.id);
        let time = self.now + self.random.duration(Duration::ZERO..=self.plan.load_max);
        self.schedule(time, Happening::Loaded { at: host, job: spec.id });
    }

    fn link(&mut self, host: usize, peers: &[PeerAddress]) {
        let wanted = peers.iter().map(|peer| self.host(peer.worker, peer.incarnation)).collect();
        self.hosts[host].wanted = wanted;
        let dropped: Vec<usize> =
            self.hosts[host].linked.difference(&self.hosts[host].wanted).copied().collect();
        for peer in dropped {
            self.hosts[host].linked.remove(&peer);
            self.drop_happenings(|happening| {
                matches!(happening, Happening::ToPeer { from, to, .. } if (*from, *to) == (host, peer))
            });
        }
        let mut missing: Vec<usize> =
            self.hosts[host].wanted.difference(&self.hosts[host].linked).copied().collect();
        missing.retain(|&peer| self.hosts[peer].is_alive);
        for peer in missing {
            let when = self.now + self.network.delay();
            self.schedule(when, Happening::Linked { at: host, peer });
        }
    }

    /// The host that is or was a worker in one of its lives.
    fn host(&self, worker: WorkerId, incarnation: Incarnation) -> usize {
        let is_it = |host: &Host| host.identity == Some((worker, incarnation));
        self.hosts.iter().position(is_it).expect("only admitted workers are spoken of")
    }

    /// Sends something over a link. What goes to the dead is lost.
    fn send(&mut self, from: End, to: End, happening: Happening) {
        if let End::Host(host) = to
            && !self.hosts[host].is_alive
        {
            self.lose(&happening);
            return;
        }
        let time = self.network.arrival(self.now, from, to);
        self.schedule(time, happening);
    }

    fn schedule(&mut self, time: Time, happening: Happening) {
        self.agenda.put(time, happening);
    }

    fn schedule_threads(&mut self, at: usize, due: Vec<Due>) {
        for Due { thread, generation, time } in due {
            self.schedule(time, Happening::Traced { at, thread, generation });
        }
    }

    fn schedule_wake(&mut self, end: End, deadline: Option<Time>) {
        if let Some(deadline) = deadline {
            assert!(deadline > self.now, "{end:?} wants to be woken at once");
            self.schedule(deadline, Happening::Wake { end });
        }
    }

    fn drop_happenings(&mut self, is_dropped: impl Fn(&Happening) -> bool) {
        for happening in self.agenda.strike(is_dropped) {
            self.lose(&happening);
        }
    }

    fn lose(&mut self, happening: &Happening) {
        if let Some(job) = self.coordinator.job() {
            happening.for_each_share(job, &mut |unit, attempt, credit| {
                self.lost.push((job, unit, attempt, credit.clone()));
            });
        }
    }

    /// Checks what must hold at any moment.
    fn check(&mut self) {
        for host in &self.hosts {
            let Some(core) = &host.core else { continue };
            assert!(core.unacknowledged_max() <= WINDOW_GIFTS, "a window overflows");
            if let Some(job) = core.job() {
                let pieces_max = host.threads.thread_count() * PIECES_PER_THREAD_MAX;
                assert!(host.threads.piece_count(job) <= pieces_max, "threads are flooded");
            }
        }
        let Some(id) = self.coordinator.job() else {
            self.lost.clear();
            return;
        };
        self.check_credit(id);
    }

    fn check_credit(&self, id: JobId) {
        let mut uncommitted = Vec::new();
        self.coordinator.for_each_uncommitted(|unit, attempt| uncommitted.push((unit, attempt)));
        let unit_count = self.jobs[&id].task.grid.unit_count();
        let mut check = CreditCheck::new(unit_count, uncommitted.into_iter());
        let mut add = |unit, attempt, credit: &Credit| check.add(unit, attempt, credit);
        self.coordinator.for_each_share(&mut add);
        for core in self.hosts.iter().filter_map(|host| host.core.as_ref()) {
            if core.job() == Some(id) {
                core.for_each_share(&mut add);
            }
        }
        for happening in self.agenda.iter() {
            happening.for_each_share(id, &mut add);
        }
        for (_, unit, attempt, credit) in self.lost.iter().filter(|(job, ..)| *job == id) {
            add(*unit, *attempt, credit);
        }
        check.finish(id);
    }
}
