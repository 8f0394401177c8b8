//! A run: the event loop around the cores.

use std::collections::BTreeMap;
use std::time::Duration;

use equilux_common::bundle::Share;
use equilux_common::credit::Credit;
use equilux_common::ids::JobId;
use equilux_common::time::Time;
use equilux_coordinator_core::event::{Event as CoordinatorEvent, JobOrder};
use equilux_worker_core::event::Event;
use equilux_worker_core::{WINDOW_GIFTS, WorkerCore};

use crate::checks::CreditCheck;
use crate::coordination::Coordination;
use crate::counts::Counts;
use crate::crew::Crew;
use crate::faults;
use crate::happening::Happening;
use crate::host::HostRecord;
use crate::links;
use crate::mail::Mail;
use crate::network::{End, Trip};
use crate::plan::Plan;
use crate::tracer::Tracer;
use crate::view::JobView;
use crate::world::World;

/// Pieces that a worker's core may have on compute threads, per thread.
const PIECES_PER_THREAD_MAX: usize = 2;

/// The real cores in virtual time.
#[derive(Debug)]
pub struct Simulation<T> {
    world: World,
    coordination: Coordination,
    crew: Crew<T>,
}

impl<T: Tracer> Simulation<T> {
    /// Prepares a run.
    #[must_use]
    pub fn new(plan: Plan, tracer: T) -> Self {
        let mut world = World::new(plan);
        schedule_plan(&mut world);
        Self { world, coordination: Coordination::new(), crew: Crew::new(tracer) }
    }

    /// Runs until nothing happens any more.
    ///
    /// # Panics
    /// If anything that must hold does not.
    pub fn run(&mut self) {
        while self.step() {}
    }

    /// Does what is next; says whether there was anything.
    ///
    /// # Panics
    /// If anything that must hold does not.
    pub fn step(&mut self) -> bool {
        let Some(happening) = self.world.agenda.pop() else { return false };
        self.world.counts.steps += 1;
        assert!(self.world.counts.steps < self.world.plan.steps_max, "the run does not end");
        self.happen(happening);
        if self.world.plan.is_checked {
            self.check();
        }
        true
    }

    /// Submits a job now.
    pub fn submit(&mut self, order: JobOrder) {
        self.coordination.submit(&mut self.world, Box::new(order));
    }

    /// The jobs, by number.
    #[must_use]
    pub const fn jobs(&self) -> &BTreeMap<JobId, JobView> {
        &self.coordination.jobs
    }

    /// How many messages were sent.
    #[must_use]
    pub const fn counts(&self) -> Counts {
        self.world.counts
    }

    /// How many lives workers had.
    #[must_use]
    pub fn life_count(&self) -> u64 {
        self.world.hosts.len() as u64
    }

    /// The virtual time.
    #[must_use]
    pub const fn now(&self) -> Time {
        self.world.now()
    }

    /// Whether no core has anything left to do.
    #[must_use]
    pub fn is_quiet(&self) -> bool {
        let cores = self.world.hosts.iter().filter_map(|host| host.core.as_ref());
        self.coordination.core.job().is_none()
            && cores.into_iter().all(|core| core.is_quiet() && core.job().is_none())
    }

    /// The cores of the workers that are there, by machine.
    pub fn cores(&self) -> impl Iterator<Item = &WorkerCore> {
        let machines = 0..self.world.plan.machines.len();
        let hosts = machines.filter_map(|machine| self.world.alive(machine));
        hosts.filter_map(|host| self.world.hosts[host].core.as_ref())
    }

    /// How long the longest piece on the threads of each worker that is there would go on, by
    /// machine.
    pub fn longest_pieces(&self) -> impl Iterator<Item = Duration> {
        let machines = 0..self.world.plan.machines.len();
        let hosts = machines.filter_map(|machine| self.world.alive(machine));
        let hosts = hosts.map(|host| &self.world.hosts[host]).filter(|host| host.core.is_some());
        hosts.map(|host| host.threads.longest_left(self.now()))
    }

    /// Compute time of all pieces that ended, at speed 1000.
    #[must_use]
    pub const fn work(&self) -> Duration {
        self.world.work
    }

    /// When the next thing will happen.
    pub(crate) fn next_time(&self) -> Option<Time> {
        self.world.agenda.next_time()
    }

    /// A machine's worker comes or dies after some time.
    pub(crate) fn turn_in(&mut self, wait: Duration, machine: usize) {
        self.world.agenda.put(self.now() + wait, Happening::Turn { machine });
    }

    /// A machine computes at another speed after some time.
    pub(crate) fn change_speed_in(&mut self, wait: Duration, machine: usize, speed: u32) {
        self.world.agenda.put(self.now() + wait, Happening::Change { machine, speed });
    }

    /// What is written down of the worker on a machine.
    pub(crate) fn record(&self, machine: usize) -> Option<HostRecord> {
        self.world.alive(machine).map(|host| self.world.hosts[host].record)
    }

    /// By machine: seconds of work in the queue of its worker.
    pub(crate) fn loads(&self) -> Vec<f32> {
        let core = |host: usize| self.world.hosts[host].core.as_ref();
        let seconds = |core: &WorkerCore| core.load().as_secs_f32();
        let machines = 0..self.world.plan.machines.len();
        machines
            .map(|machine| self.world.alive(machine).and_then(core).map_or(0.0, seconds))
            .collect()
    }

    fn happen(&mut self, happening: Happening) {
        let world = &mut self.world;
        match happening {
            Happening::Turn { machine } => faults::turn(world, machine),
            Happening::Change { machine, speed } => self.crew.change_speed(world, machine, speed),
            Happening::Submit(order) => self.coordination.submit(world, order),
            Happening::Cancel(job) => {
                self.coordination.handle(world, CoordinatorEvent::Cancelled { job });
            }
            Happening::Reaches(mail) => self.reach(mail),
            Happening::Arrives(mail) => self.arrive(*mail),
            Happening::Linked { at, peer } => {
                if let Some(event) = links::stand(world, at, peer) {
                    self.crew.note(world, at, event);
                }
            }
            Happening::Unlinked { at, peer } => {
                if let Some(event) = links::break_off(world, at, peer) {
                    self.crew.note(world, at, event);
                }
            }
            Happening::Loaded { at, job } => {
                if world.hosts[at].threads.load(&self.coordination.jobs[&job].task) {
                    let partitions = world.plan.guest.clone();
                    self.crew.note(world, at, Event::SceneLoaded { job, partitions });
                }
            }
            Happening::PartitionLoaded { at, job, partition } => {
                if world.hosts[at].threads.load_partition(job, partition) {
                    self.crew.note(world, at, Event::PartitionLoaded { job, partition });
                }
            }
            Happening::Traced { at, thread } => self.crew.trace(world, at, thread),
            Happening::Wake { end: End::Coordinator } => self.coordination.wake(world),
            Happening::Wake { end: End::Host(at) } => self.crew.wake(world, at),
        }
    }

    /// The first byte of a message reaches its receiver's link.
    fn reach(&mut self, mail: Box<Mail>) {
        let now = self.world.now();
        let Mail { from, to, bytes, .. } = *mail;
        let trip = Trip { from, to, bytes, toil: 1 };
        let time = self.world.network.arrive(now, trip);
        if time == now {
            self.arrive(*mail);
        } else {
            self.world.agenda.put(time, Happening::Arrives(mail));
        }
    }

    /// A message is in its receiver's hands.
    fn arrive(&mut self, mail: Mail) {
        if self.world.plan.copied_percent > 0 && mail.may_come_twice(|share| self.is_stale(share)) {
            self.world.copy(&mail);
        }
        self.world.note_arrival(&mail);
        match mail.to {
            End::Coordinator => self.coordination.receive(&mut self.world, mail),
            End::Host(host) => self.crew.receive(&mut self.world, host, mail),
        }
    }

    /// Whether the coordinator has raised the attempt of a unit above that of a share.
    fn is_stale(&self, share: &Share) -> bool {
        let mut is_stale = false;
        self.coordination.core.for_each_uncommitted(|unit, attempt| {
            is_stale |= unit == share.unit && attempt > share.attempt;
        });
        is_stale
    }

    /// Checks what must hold at any moment.
    fn check(&mut self) {
        for host in &self.world.hosts {
            let Some(core) = &host.core else { continue };
            assert!(core.unacknowledged_max() <= WINDOW_GIFTS, "a window overflows");
            if let Some(job) = core.job() {
                let pieces_max = host.threads.thread_count() * PIECES_PER_THREAD_MAX;
                assert!(host.threads.piece_count(job) <= pieces_max, "threads are flooded");
            }
        }
        match self.coordination.core.job() {
            Some(job) => self.check_credit(job),
            None => self.world.forget_lost(),
        }
    }

    fn check_credit(&self, id: JobId) {
        let (core, world) = (&self.coordination.core, &self.world);
        let mut uncommitted = Vec::new();
        core.for_each_uncommitted(|unit, attempt| uncommitted.push((unit, attempt)));
        let unit_count = self.coordination.jobs[&id].task.grid.unit_count();
        let mut check = CreditCheck::new(unit_count, uncommitted.into_iter());
        let mut add = |unit, attempt, credit: &Credit| check.add(unit, attempt, credit);
        core.for_each_share(&mut add);
        for core in world.hosts.iter().filter_map(|host| host.core.as_ref()) {
            core.for_each_share(id, &mut add);
        }
        world.for_each_share(id, &mut add);
        check.finish(id);
    }
}

fn schedule_plan(world: &mut World) {
    let plan = world.plan.clone();
    for (machine, plan) in plan.machines.into_iter().enumerate() {
        for turn in plan.turns {
            world.agenda.put(Time::ZERO + turn, Happening::Turn { machine });
        }
    }
    let mut time = Time::ZERO;
    for (wait, order) in plan.jobs {
        time = time + wait;
        world.agenda.put(time, Happening::Submit(Box::new(order)));
    }
    if let Some((when, job)) = plan.cancelled {
        world.agenda.put(Time::ZERO + when, Happening::Cancel(job));
    }
}
