//! The world around the cores: clock, hosts, network, and what is counted and lost in it.

use std::collections::BTreeMap;
use std::time::Duration;

use equilux_common::credit::Credit;
use equilux_common::ids::{Attempt, Incarnation, JobId, PartitionId, UnitId, WorkerId};
use equilux_common::time::Time;
use equilux_mapping::Guest;

use crate::agenda::Agenda;
use crate::counts::Counts;
use crate::happening::Happening;
use crate::host::Host;
use crate::mail::{Content, Mail};
use crate::network::{End, Network, Trip};
use crate::plan::Plan;
use crate::random::Random;
use crate::threads::Due;

/// Everything but the cores' own state and what traces.
#[derive(Debug)]
pub(crate) struct World {
    pub(crate) plan: Plan,
    pub(crate) agenda: Agenda,
    pub(crate) hosts: Vec<Host>,
    pub(crate) network: Network,
    pub(crate) random: Random,
    pub(crate) counts: Counts,
    /// The job that the coordinator runs.
    pub(crate) running: Option<JobId>,
    /// Compute time of all pieces that ended, at speed 1000.
    pub(crate) work: Duration,
    /// When the last ray ended, and how many messages had been sent before.
    pub(crate) last_ray: (Time, u64),
    /// Positions of all lives that were ever admitted.
    lives: BTreeMap<(WorkerId, Incarnation), usize>,
    /// By machine: its host that is alive.
    alive: Vec<Option<usize>>,
    /// Credit that died with hosts and links.
    lost: Vec<(JobId, UnitId, Attempt, Credit)>,
}

impl World {
    pub(crate) fn new(plan: Plan) -> Self {
        let mut random = Random::new(plan.seed ^ 0x51b);
        let network = Network::new(plan.network, Random::new(random.bits()));
        Self {
            agenda: Agenda::default(),
            hosts: Vec::new(),
            network,
            random,
            counts: Counts::default(),
            running: None,
            work: Duration::ZERO,
            last_ray: (Time::ZERO, 0),
            lives: BTreeMap::new(),
            alive: vec![None; plan.machines.len()],
            lost: Vec::new(),
            plan,
        }
    }

    pub(crate) const fn now(&self) -> Time {
        self.agenda.now()
    }

    /// The host of a machine that is alive.
    pub(crate) fn alive(&self, machine: usize) -> Option<usize> {
        self.alive[machine]
    }

    /// A worker comes on a machine.
    pub(crate) fn come(&mut self, machine: usize) -> usize {
        let plan = &self.plan.machines[machine];
        self.hosts.push(Host::new(machine, plan.threads, plan.speed));
        self.alive[machine] = Some(self.hosts.len() - 1);
        self.hosts.len() - 1
    }

    /// A host is gone, and so is the credit it held.
    pub(crate) fn go(&mut self, host: usize) {
        let host = &mut self.hosts[host];
        host.is_alive = false;
        self.alive[host.machine] = None;
        if let Some(core) = host.core.take()
            && let Some(job) = self.running
        {
            core.for_each_share(job, &mut |unit, attempt, credit| {
                self.lost.push((job, unit, attempt, credit.clone()));
            });
        }
    }

    /// The coordinator has given a host its name.
    pub(crate) fn name(&mut self, host: usize, worker: WorkerId, incarnation: Incarnation) {
        self.hosts[host].identity = Some((worker, incarnation));
        self.lives.insert((worker, incarnation), host);
    }

    /// The host that is or was a worker in one of its lives.
    pub(crate) fn host(&self, worker: WorkerId, incarnation: Incarnation) -> usize {
        self.lives[&(worker, incarnation)]
    }

    /// Sends something over a link. What goes to the dead is lost.
    pub(crate) fn send(&mut self, from: End, to: End, content: Content) {
        let (bytes, toil) = (content.bytes(self.plan.pixel_bytes), content.toil());
        let mail = Mail { from, to, bytes, is_copy: false, content };
        self.counts.messages += 1;
        if let End::Host(host) = from {
            self.hosts[host].record.messages_out += 1;
            self.hosts[host].record.bytes_out += bytes;
            self.occupy(host, bytes);
        }
        let time = self.network.depart(self.now(), Trip { from, to, bytes, toil });
        match to {
            End::Host(host) if !self.hosts[host].is_alive => {
                self.lose(&Happening::Reaches(Box::new(mail)));
            }
            _ => self.agenda.put(time, Happening::Reaches(Box::new(mail))),
        }
    }

    /// A message is in its receiver's hands.
    pub(crate) fn note_arrival(&mut self, mail: &Mail) {
        if let End::Host(host) = mail.to {
            self.hosts[host].record.messages_in += 1;
            self.hosts[host].record.bytes_in += mail.bytes;
            self.occupy(host, mail.bytes);
        }
    }

    /// A message that its receiver must bear twice may come twice.
    pub(crate) fn copy(&mut self, mail: &Mail) {
        let percent = self.plan.copied_percent;
        if percent > 0 && !mail.is_copy && self.random.chance(percent) {
            self.counts.copies += 1;
            let when = self.now() + self.network.delay();
            let copy = Mail { is_copy: true, ..mail.clone() };
            self.agenda.put(when, Happening::Arrives(Box::new(copy)));
        }
    }

    pub(crate) fn put_due(&mut self, at: usize, due: impl IntoIterator<Item = Due>) {
        for Due { thread, time } in due {
            self.agenda.put(time, Happening::Traced { at, thread });
        }
    }

    /// Drops what will not happen after all, with the credit in it.
    pub(crate) fn drop_happenings(&mut self, is_dropped: impl Fn(&Happening) -> bool) {
        for happening in self.agenda.strike(is_dropped) {
            self.lose(&happening);
        }
    }

    /// Shows the credit of a job that is on its way or lost.
    pub(crate) fn for_each_share(
        &self,
        id: JobId,
        visit: &mut dyn FnMut(UnitId, Attempt, &Credit),
    ) {
        for happening in self.agenda.iter() {
            happening.for_each_share(id, visit);
        }
        for (_, unit, attempt, credit) in self.lost.iter().filter(|(job, ..)| *job == id) {
            visit(*unit, *attempt, credit);
        }
    }

    /// Nothing runs: nobody asks for what was lost.
    pub(crate) fn forget_lost(&mut self) {
        self.lost.clear();
    }

    fn lose(&mut self, happening: &Happening) {
        if let Some(job) = self.running {
            happening.for_each_share(job, &mut |unit, attempt, credit| {
                self.lost.push((job, unit, attempt, credit.clone()));
            });
        }
    }

    /// A host reads a partition from its disk, one after another: when that will be in memory.
    /// Reading takes a processor.
    pub(crate) fn read(&mut self, host: usize, PartitionId(partition): PartitionId) -> Time {
        let (now, load) = (self.now(), self.random.duration(self.plan.partition_load.clone()));
        let objects = self.plan.guest.as_ref().map_or(&[][..], Guest::objects);
        let bytes = objects.get(partition as usize).map_or(0, |object| object.bytes);
        let read = self.plan.network.disk_read(bytes);
        let host_read = &mut self.hosts[host];
        host_read.record.loads += 1;
        host_read.disk = host_read.disk.max(now) + read;
        let time = host_read.disk + load;
        let due = host_read.threads.stall(now, read);
        self.put_due(host, due);
        time
    }

    /// A message takes processor time of a host.
    fn occupy(&mut self, host: usize, bytes: u64) {
        let (now, time) = (self.now(), self.plan.network.processor(bytes));
        self.hosts[host].record.messages_processor += time;
        let due = self.hosts[host].threads.stall(now, time);
        self.put_due(host, due);
    }
}
