//! The workers' side of a run: their cores, carried out, and what their threads trace.

use equilux_common::ids::{Incarnation, JobId, WorkerId};
use equilux_worker_core::action::Action;
use equilux_worker_core::event::Event;
use equilux_worker_core::{Config, WorkerCore};

use crate::happening::Happening;
use crate::links;
use crate::mail::{Content, Mail};
use crate::network::End;
use crate::threads::Ended;
use crate::tracer::Tracer;
use crate::world::World;

/// All workers; their hosts are the world's.
#[derive(Debug)]
pub(crate) struct Crew<T> {
    tracer: T,
}

impl<T: Tracer> Crew<T> {
    pub(crate) const fn new(tracer: T) -> Self {
        Self { tracer }
    }

    /// A message is in a host's hands.
    pub(crate) fn receive(&self, world: &mut World, host: usize, mail: Mail) {
        match mail.content {
            Content::Admit { worker, incarnation } => admit(world, host, worker, incarnation),
            Content::ToWorker(message) => {
                self.handle(world, host, Event::CoordinatorSaid(message));
            }
            Content::ToPeer { job, message } => {
                let End::Host(from) = mail.from else { return };
                let (peer, incarnation) = world.hosts[from].identity.expect("it was admitted");
                let bytes = mail.bytes;
                let event = Event::PeerSaid { peer, incarnation, job, message, bytes };
                self.handle(world, host, event);
            }
            Content::Knock | Content::HangUp | Content::Deliver(_) | Content::ToCoordinator(_) => {}
        }
    }

    /// Something that is no message happened on a host.
    pub(crate) fn note(&self, world: &mut World, host: usize, event: Event) {
        let idle = world.hosts[host].threads.is_idle();
        world.hosts[host].record.idle_wakes += u64::from(idle);
        self.handle(world, host, event);
    }

    /// A thread is done, unless its piece's end has changed since.
    pub(crate) fn trace(&self, world: &mut World, at: usize, thread: usize) {
        let now = world.now();
        let later = world.hosts[at].threads.ring(thread, now);
        world.put_due(at, later);
        let Some(ended) = world.hosts[at].threads.finish(thread, now) else { return };
        world.last_ray = (now, world.counts.messages);
        world.work += ended.work;
        let host = &mut world.hosts[at];
        host.record.last_ray = now;
        host.record.busy += ended.elapsed.saturating_sub(ended.stalled);
        let due = host.threads.start(now, &self.tracer);
        world.put_due(at, due);
        let Ended { job, piece, elapsed, .. } = ended;
        let outcome = Box::new(ended.outcome);
        self.handle(world, at, Event::Traced { job, piece, outcome, elapsed });
    }

    /// A core's deadline may have come.
    pub(crate) fn wake(&self, world: &mut World, at: usize) {
        let (now, host) = (world.now(), &mut world.hosts[at]);
        if !host.alarm.ring(now) {
            return;
        }
        if let Some(core) = &mut host.core
            && core.next_deadline().is_some_and(|time| time <= now)
        {
            core.wake(now);
            host.record.wakes += 1;
            host.record.idle_wakes += u64::from(host.threads.is_idle());
        }
        self.carry_out_all(world, at);
    }

    /// A machine computes at another speed from now on.
    pub(crate) fn change_speed(&self, world: &mut World, machine: usize, speed: u32) {
        world.plan.machines[machine].speed = speed;
        if let Some(host) = world.alive(machine) {
            let now = world.now();
            let due = world.hosts[host].threads.set_speed(now, speed);
            world.put_due(host, due);
        }
    }

    fn handle(&self, world: &mut World, host: usize, event: Event) {
        let now = world.now();
        if let Some(core) = &mut world.hosts[host].core {
            core.handle(now, event);
            self.carry_out_all(world, host);
        }
    }

    fn carry_out_all(&self, world: &mut World, at: usize) {
        while let Some(action) = world.hosts[at].core.as_mut().and_then(WorkerCore::poll_action) {
            self.carry_out(world, at, action);
        }
        note_waiting(world, at);
        let (now, host) = (world.now(), &mut world.hosts[at]);
        let due = host.threads.start(now, &self.tracer);
        let deadline = host.core.as_ref().and_then(WorkerCore::next_deadline);
        if let Some(time) = host.alarm.set(deadline) {
            assert!(time > now, "host {at} wants to be woken at once");
            world.agenda.put(time, Happening::Wake { end: End::Host(at) });
        }
        world.put_due(at, due);
    }

    fn carry_out(&self, world: &mut World, host: usize, action: Action) {
        match action {
            Action::LoadScene { spec, .. } => load(world, host, spec.id),
            Action::Trace { job, piece, work } => {
                world.counts.pieces += 1;
                world.hosts[host].threads.push(job, piece, work);
            }
            Action::LoadPartition { job, partition, from } => {
                world.counts.copies_loaded += u64::from(from.is_some());
                let time = world.read(host, partition);
                world.agenda.put(time, Happening::PartitionLoaded { at: host, job, partition });
            }
            Action::DropPartition { partition, .. } => {
                world.hosts[host].threads.drop_partition(partition);
            }
            Action::Interrupt => {
                world.counts.interrupts += 1;
                let now = world.now();
                let due = world.hosts[host].threads.interrupt(now, &self.tracer);
                world.put_due(host, due);
            }
            Action::DropScene { .. } => world.hosts[host].threads.drop_scene(),
            Action::Link(peers) => links::want(world, host, &peers),
            Action::TellPeer { peer, incarnation, job, message } => {
                world.counts.add(&message, world.running != Some(job));
                let to = world.host(peer, incarnation);
                assert!(world.hosts[host].linked.contains(&to), "{peer} is told without a link");
                let content = Content::ToPeer { job, message };
                world.send(End::Host(host), End::Host(to), content);
            }
            Action::Tell(message) => {
                world.counts.add_told(&message);
                world.send(End::Host(host), End::Coordinator, Content::told(message));
            }
        }
    }
}

/// Takes note of how many rays wait with a worker.
fn note_waiting(world: &mut World, at: usize) {
    let Some(core) = &world.hosts[at].core else { return };
    let (rays, rays_max) = core.waiting_rays();
    let permille = u128::from(rays) * 1000 / u128::from(rays_max.max(1));
    let most = &mut world.counts.waiting_permille_max;
    *most = (*most).max(u64::try_from(permille).unwrap_or(u64::MAX));
}

fn admit(world: &mut World, host: usize, worker: WorkerId, incarnation: Incarnation) {
    let machine = &world.plan.machines[world.hosts[host].machine];
    let (threads, speed, memory) = (machine.threads, machine.claimed_speed, machine.memory);
    let config = Config { worker, incarnation, threads, speed, memory };
    world.hosts[host].core = Some(WorkerCore::new(config));
}

fn load(world: &mut World, host: usize, job: JobId) {
    world.hosts[host].threads.want(job);
    let time = world.now() + world.random.duration(world.plan.load.clone());
    world.agenda.put(time, Happening::Loaded { at: host, job });
}
