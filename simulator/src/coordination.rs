//! The coordinator's side of a run: its core, carried out, and the jobs as its driver sees them.

use std::collections::BTreeMap;

use equilux_common::ids::JobId;
use equilux_coordinator_core::action::Action;
use equilux_coordinator_core::event::{Event, Hello, JobOrder, LinkId};
use equilux_coordinator_core::{Config, CoordinatorCore};

use crate::alarm::Alarm;
use crate::faults;
use crate::happening::Happening;
use crate::mail::{Content, Mail};
use crate::network::End;
use crate::view::JobView;
use crate::world::World;

/// The coordinator.
#[derive(Debug)]
pub(crate) struct Coordination {
    pub(crate) core: CoordinatorCore,
    pub(crate) jobs: BTreeMap<JobId, JobView>,
    alarm: Alarm,
}

impl Coordination {
    pub(crate) fn new() -> Self {
        let core = CoordinatorCore::new(Config::default());
        Self { core, jobs: BTreeMap::new(), alarm: Alarm::default() }
    }

    /// A job is submitted.
    pub(crate) fn submit(&mut self, world: &mut World, order: Box<JobOrder>) {
        self.jobs.insert(order.spec.id, JobView::new(order.spec.clone(), world.now()));
        self.handle(world, Event::Submitted(order));
    }

    /// A message is in the coordinator's hands.
    pub(crate) fn receive(&mut self, world: &mut World, mail: Mail) {
        let End::Host(host) = mail.from else { return };
        let identity = world.hosts[host].identity;
        let event = match (mail.content, identity) {
            (Content::Knock, _) => {
                Event::Knocked { link: LinkId(host as u64), hello: hello(world, host) }
            }
            (Content::HangUp, Some((worker, incarnation))) => {
                Event::WorkerLost { worker, incarnation }
            }
            (Content::Deliver(delivery), Some((worker, incarnation))) => {
                Event::WorkerSaid { worker, incarnation, message: delivery.unpack() }
            }
            (Content::ToCoordinator(message), Some((worker, incarnation))) => {
                Event::WorkerSaid { worker, incarnation, message }
            }
            _ => return,
        };
        self.handle(world, event);
    }

    /// Something happened.
    pub(crate) fn handle(&mut self, world: &mut World, event: Event) {
        self.core.handle(world.now(), event);
        self.carry_out_all(world);
    }

    /// The core's deadline may have come.
    pub(crate) fn wake(&mut self, world: &mut World) {
        if !self.alarm.ring(world.now()) {
            return;
        }
        if self.core.next_deadline().is_some_and(|time| time <= world.now()) {
            self.core.wake(world.now());
        }
        self.carry_out_all(world);
    }

    fn carry_out_all(&mut self, world: &mut World) {
        self.note_end(world);
        while let Some(action) = self.core.poll_action() {
            self.carry_out(world, action);
        }
        let deadline = self.core.next_deadline();
        if let Some(time) = self.alarm.set(deadline) {
            assert!(time > world.now(), "the coordinator wants to be woken at once");
            world.agenda.put(time, Happening::Wake { end: End::Coordinator });
        }
    }

    /// Writes down when a job ended, before anybody is told.
    fn note_end(&mut self, world: &mut World) {
        let before = std::mem::replace(&mut world.running, self.core.job());
        if before != world.running
            && let Some(view) = before.and_then(|job| self.jobs.get_mut(&job))
        {
            let (last_ray, messages) = world.last_ray;
            view.end(world.now(), last_ray, world.counts.messages - messages);
        }
    }

    fn carry_out(&mut self, world: &mut World, action: Action) {
        match action {
            Action::Admit { link, worker, incarnation } => {
                let host = usize::try_from(link.0).expect("a host's number");
                world.name(host, worker, incarnation);
                let admit = Content::Admit { worker, incarnation };
                world.send(End::Coordinator, End::Host(host), admit);
            }
            Action::Expel { worker, incarnation, reason } => {
                assert!(reason.contains("new life"), "{worker} broke the protocol: {reason}");
                let host = world.host(worker, incarnation);
                if world.hosts[host].is_alive {
                    // A knock of its own earlier life came late. It is fenced, and comes again.
                    faults::kill(world, host);
                    faults::turn(world, world.hosts[host].machine);
                }
            }
            Action::Tell { worker, incarnation, message } => {
                world.counts.coordinator += 1;
                let to = world.host(worker, incarnation);
                world.send(End::Coordinator, End::Host(to), Content::ToWorker(message));
            }
            Action::Commit { job, unit, sums } => {
                self.view(job).commit(unit, &sums);
            }
            Action::Report(report) => self.view(report.job).report(report),
        }
    }

    fn view(&mut self, job: JobId) -> &mut JobView {
        self.jobs.get_mut(&job).expect("it was submitted")
    }
}

/// A host as it introduces itself.
fn hello(world: &World, host: usize) -> Hello {
    let plan = &world.plan.machines[world.hosts[host].machine];
    Hello {
        name: plan.name.clone(),
        address: address(host).into(),
        threads: plan.threads,
        speed: plan.claimed_speed,
        memory: plan.memory,
    }
}

/// As long as addresses are.
fn address(host: usize) -> String {
    format!("10.0.{}.{}:7000", host / 256, host % 256)
}
