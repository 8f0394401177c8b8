//! A simulated host: one life of a worker, with its core, its links and its compute threads.

use std::collections::{BTreeSet, VecDeque};
use std::rc::Rc;
use std::time::Duration;

use equilux_common::ids::{Incarnation, JobId, WorkerId};
use equilux_common::time::Time;
use equilux_common::work::Work;
use equilux_worker_core::WorkerCore;

use crate::tracer::{Task, Traced, Tracer};

/// One life of a worker.
#[derive(Debug)]
pub(crate) struct Host {
    /// Its position among the machines.
    pub(crate) machine: usize,
    /// Its core, from its admission to its death.
    pub(crate) core: Option<WorkerCore>,
    /// Who it is, since its admission.
    pub(crate) identity: Option<(WorkerId, Incarnation)>,
    pub(crate) is_alive: bool,
    /// The hosts to which its links stand.
    pub(crate) linked: BTreeSet<usize>,
    /// The hosts to which it wants links.
    pub(crate) wanted: BTreeSet<usize>,
    pub(crate) threads: Threads,
}

impl Host {
    /// It has just come, and nobody knows of it.
    pub(crate) fn new(machine: usize, threads: u32, speed: u32) -> Self {
        Self {
            machine,
            core: None,
            identity: None,
            is_alive: true,
            linked: BTreeSet::new(),
            wanted: BTreeSet::new(),
            threads: Threads::new(threads, speed),
        }
    }
}

/// Compute threads and what waits for them.
#[derive(Debug)]
pub(crate) struct Threads {
    speed: u32,
    /// The job whose scene was asked for last.
    wanted: Option<JobId>,
    /// The job whose scene is loaded.
    task: Option<Rc<Task>>,
    waiting: VecDeque<Waiting>,
    running: Vec<Option<Piece>>,
    generation: u64,
}

#[derive(Debug)]
struct Waiting {
    task: Rc<Task>,
    work: Work,
    /// Whether an interrupt met it before a thread did.
    is_given_up: bool,
}

#[derive(Debug)]
struct Piece {
    task: Rc<Task>,
    work: Work,
    started: Time,
    traced: Traced,
    generation: u64,
}

/// When a thread will be done.
pub(crate) struct Due {
    pub(crate) thread: usize,
    pub(crate) generation: u64,
    pub(crate) time: Time,
}

impl Threads {
    fn new(threads: u32, speed: u32) -> Self {
        let running = (0..threads).map(|_| None).collect();
        Self { speed, wanted: None, task: None, waiting: VecDeque::new(), running, generation: 0 }
    }

    /// A scene is asked for.
    pub(crate) const fn want(&mut self, job: JobId) {
        self.wanted = Some(job);
    }

    /// A scene is loaded; says whether it is still wanted.
    pub(crate) fn load(&mut self, task: &Rc<Task>) -> bool {
        let is_wanted = self.wanted == Some(task.spec.id);
        if is_wanted {
            self.task = Some(task.clone());
        }
        is_wanted
    }

    /// Takes a piece of work of the job whose scene is loaded.
    pub(crate) fn push(&mut self, job: JobId, work: Work) {
        let task = self.task.clone().expect("work is traced only after its scene was loaded");
        assert_eq!(task.spec.id, job, "work of another job than that whose scene is loaded");
        self.waiting.push_back(Waiting { task, work, is_given_up: false });
    }

    /// Gives free threads what waits.
    pub(crate) fn start(&mut self, now: Time, tracer: &impl Tracer) -> Vec<Due> {
        let mut due = Vec::new();
        for thread in 0..self.running.len() {
            if self.running[thread].is_none()
                && let Some(Waiting { task, work, is_given_up }) = self.waiting.pop_front()
            {
                let limit = is_given_up.then_some(Duration::ZERO);
                let traced = tracer.trace(&task, work.clone(), limit);
                let piece = Piece { task, work, started: now, traced, generation: 0 };
                due.push(self.run(thread, now, piece));
            }
        }
        due
    }

    /// Lets running pieces end now, and those that wait come back untouched if `all` are meant.
    pub(crate) fn interrupt(&mut self, now: Time, tracer: &impl Tracer, all: bool) -> Vec<Due> {
        let mut due = Vec::new();
        for thread in 0..self.running.len() {
            if let Some(mut piece) = self.running[thread].take() {
                let elapsed = scale(now.since(piece.started), self.speed, 1000);
                piece.traced = tracer.trace(&piece.task, piece.work.clone(), Some(elapsed));
                due.push(self.run(thread, now, piece));
            }
        }
        for waiting in &mut self.waiting {
            waiting.is_given_up |= all;
        }
        due
    }

    /// A thread is done, unless its piece has been interrupted since.
    pub(crate) fn finish(&mut self, thread: usize, generation: u64) -> Option<(JobId, Traced)> {
        let piece = self.running[thread].take_if(|piece| piece.generation == generation)?;
        let elapsed = scale(piece.traced.elapsed, 1000, self.speed);
        Some((piece.task.spec.id, Traced { elapsed, ..piece.traced }))
    }

    /// The scene is dropped; pieces that run end as if nothing were.
    pub(crate) fn drop_scene(&mut self) {
        (self.wanted, self.task) = (None, None);
        self.waiting.clear();
    }

    /// Pieces of a job that run or wait.
    pub(crate) fn piece_count(&self, job: JobId) -> usize {
        let running = self.running.iter().flatten().filter(|piece| piece.task.spec.id == job);
        running.count() + self.waiting.iter().filter(|waiting| waiting.task.spec.id == job).count()
    }

    pub(crate) fn thread_count(&self) -> usize {
        self.running.len()
    }

    fn run(&mut self, thread: usize, now: Time, mut piece: Piece) -> Due {
        self.generation += 1;
        piece.generation = self.generation;
        let ends = piece.started + scale(piece.traced.elapsed, 1000, self.speed);
        let time = ends.max(now + Duration::from_nanos(1));
        self.running[thread] = Some(piece);
        Due { thread, generation: self.generation, time }
    }
}

fn scale(duration: Duration, numerator: u32, denominator: u32) -> Duration {
    duration * numerator / denominator
}
