//! The compute threads of a simulated host, and the pieces of work that run or wait there.
//!
//! A piece knows how much of it is done, in time of speed 1000, and since when it has gone on from
//! there; so its end can be found anew when the machine changes its speed, when a message takes its
//! processor for a moment, and when it is interrupted.

use std::collections::{BTreeSet, VecDeque};
use std::rc::Rc;
use std::time::Duration;

use equilux_common::ids::{JobId, PartitionId};
use equilux_common::time::Time;
use equilux_common::work::{Outcome, Work};
use equilux_worker_core::PieceId;

use crate::alarm::Alarm;
use crate::tracer::{Task, Traced, Tracer};

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
    /// By thread: when its piece's end is looked at.
    alarms: Vec<Alarm>,
    /// The thread that the last message held up.
    stalled: usize,
}

#[derive(Debug)]
struct Waiting {
    task: Rc<Task>,
    id: PieceId,
    work: Work,
    /// Whether an interrupt met it before a thread did.
    is_given_up: bool,
}

#[derive(Debug)]
struct Piece {
    task: Rc<Task>,
    id: PieceId,
    work: Work,
    traced: Traced,
    started: Time,
    /// How much was done at `since`, in time of speed 1000.
    done: Duration,
    since: Time,
    /// How long messages have held it up.
    stalled: Duration,
    ends: Time,
}

impl Piece {
    fn new(task: Rc<Task>, id: PieceId, work: Work, traced: Traced, now: Time) -> Self {
        Self {
            task,
            id,
            work,
            traced,
            started: now,
            done: Duration::ZERO,
            since: now,
            stalled: Duration::ZERO,
            ends: now,
        }
    }

    /// Adds up what is done by now.
    fn advance(&mut self, now: Time, speed: u32) {
        self.done += scale(now.since(self.since), speed, 1000);
        self.since = self.since.max(now);
    }
}

/// When to look whether a thread is done.
pub(crate) struct Due {
    pub(crate) thread: usize,
    pub(crate) time: Time,
}

/// A piece that has ended.
pub(crate) struct Ended {
    pub(crate) job: JobId,
    pub(crate) piece: PieceId,
    pub(crate) outcome: Outcome,
    /// How long its thread took.
    pub(crate) elapsed: Duration,
    /// How long messages held it up meanwhile.
    pub(crate) stalled: Duration,
    /// How long it would have taken at speed 1000 and undisturbed.
    pub(crate) work: Duration,
}

impl Threads {
    pub(crate) fn new(threads: u32, speed: u32) -> Self {
        Self {
            speed: speed.max(1),
            wanted: None,
            task: None,
            waiting: VecDeque::new(),
            running: (0..threads.max(1)).map(|_| None).collect(),
            alarms: vec![Alarm::default(); threads.max(1) as usize],
            stalled: 0,
        }
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

    /// A partition is loaded: what is taken up from now on is traced through it. Says whether its
    /// job still has its scene here.
    pub(crate) fn load_partition(&mut self, job: JobId, partition: PartitionId) -> bool {
        let is_wanted = self.task.as_ref().is_some_and(|task| task.spec.id == job);
        if is_wanted {
            self.change_resident(|resident| {
                resident.insert(partition);
            });
        }
        is_wanted
    }

    /// What is taken up from now on is not traced through a partition any more.
    pub(crate) fn drop_partition(&mut self, partition: PartitionId) {
        self.change_resident(|resident| {
            resident.remove(&partition);
        });
    }

    /// Pieces that are out keep what they have.
    fn change_resident(&mut self, change: impl FnOnce(&mut BTreeSet<PartitionId>)) {
        let Some(task) = &mut self.task else { return };
        change(&mut Rc::make_mut(task).resident);
    }

    /// Takes a piece of work of the job whose scene is loaded.
    pub(crate) fn push(&mut self, job: JobId, id: PieceId, work: Work) {
        let task = self.task.clone().expect("work is traced only after its scene was loaded");
        assert_eq!(task.spec.id, job, "work of another job than that whose scene is loaded");
        self.waiting.push_back(Waiting { task, id, work, is_given_up: false });
    }

    /// Gives free threads what waits.
    pub(crate) fn start(&mut self, now: Time, tracer: &impl Tracer) -> Vec<Due> {
        let mut due = Vec::new();
        for thread in 0..self.running.len() {
            if self.running[thread].is_none()
                && let Some(Waiting { task, id, work, is_given_up }) = self.waiting.pop_front()
            {
                let limit = is_given_up.then_some(Duration::ZERO);
                let traced = tracer.trace(&task, work.clone(), limit);
                self.running[thread] = Some(Piece::new(task, id, work, traced, now));
                due.extend(self.find_end(thread, now));
            }
        }
        due
    }

    /// Lets running pieces end now, and those that wait come back untouched.
    pub(crate) fn interrupt(&mut self, now: Time, tracer: &impl Tracer) -> Vec<Due> {
        for waiting in &mut self.waiting {
            waiting.is_given_up = true;
        }
        self.advance(now);
        for piece in self.running.iter_mut().flatten() {
            piece.traced = tracer.trace(&piece.task, piece.work.clone(), Some(piece.done));
        }
        self.find_ends(now)
    }

    /// The machine computes at another speed from now on.
    pub(crate) fn set_speed(&mut self, now: Time, speed: u32) -> Vec<Due> {
        self.advance(now);
        self.speed = speed.max(1);
        self.find_ends(now)
    }

    /// A message takes a processor for a moment: one of the threads in turn, if all of them run.
    pub(crate) fn stall(&mut self, now: Time, time: Duration) -> Option<Due> {
        if time.is_zero() || self.running.iter().any(Option::is_none) {
            return None;
        }
        self.stalled = (self.stalled + 1) % self.running.len();
        let piece = self.running[self.stalled].as_mut()?;
        piece.advance(now, self.speed);
        piece.since = piece.since + time;
        piece.stalled += time;
        self.find_end(self.stalled, now)
    }

    /// A thread's alarm rings; gives the next one if its piece has been given a later end since.
    pub(crate) fn ring(&mut self, thread: usize, now: Time) -> Option<Due> {
        let is_set = self.alarms[thread].ring(now);
        let later = self.running[thread].as_ref().map(|piece| piece.ends);
        let time = self.alarms[thread].set(later.filter(|&ends| is_set && ends > now))?;
        Some(Due { thread, time })
    }

    /// Takes the piece of a thread that is done.
    pub(crate) fn finish(&mut self, thread: usize, now: Time) -> Option<Ended> {
        let piece = self.running[thread].take_if(|piece| piece.ends <= now)?;
        Some(Ended {
            job: piece.task.spec.id,
            piece: piece.id,
            outcome: piece.traced.outcome,
            elapsed: now.since(piece.started),
            stalled: piece.stalled,
            work: piece.traced.elapsed,
        })
    }

    /// The scene is dropped; pieces that run end as if nothing were.
    pub(crate) fn drop_scene(&mut self) {
        (self.wanted, self.task) = (None, None);
        self.waiting.clear();
    }

    /// Whether a scene is loaded, and yet no thread has anything to do.
    pub(crate) fn is_idle(&self) -> bool {
        self.task.is_some() && self.waiting.is_empty() && self.running.iter().all(Option::is_none)
    }

    /// How long the longest of the running pieces would go on.
    pub(crate) fn longest_left(&self, now: Time) -> Duration {
        let left = self.running.iter().flatten().map(|piece| piece.ends.since(now));
        left.max().unwrap_or_default()
    }

    /// Pieces of a job that run or wait.
    pub(crate) fn piece_count(&self, job: JobId) -> usize {
        let running = self.running.iter().flatten().filter(|piece| piece.task.spec.id == job);
        running.count() + self.waiting.iter().filter(|waiting| waiting.task.spec.id == job).count()
    }

    pub(crate) fn thread_count(&self) -> usize {
        self.running.len()
    }

    /// Adds up what is done by now of all running pieces.
    fn advance(&mut self, now: Time) {
        let speed = self.speed;
        self.running.iter_mut().flatten().for_each(|piece| piece.advance(now, speed));
    }

    /// Finds out when all running pieces will end, and when to look.
    fn find_ends(&mut self, now: Time) -> Vec<Due> {
        (0..self.running.len()).filter_map(|thread| self.find_end(thread, now)).collect()
    }

    /// Finds out when the piece of a thread will end, and whether to look then.
    fn find_end(&mut self, thread: usize, now: Time) -> Option<Due> {
        let piece = self.running[thread].as_mut()?;
        let left = piece.traced.elapsed.saturating_sub(piece.done);
        let ends = piece.since + scale(left, 1000, self.speed);
        piece.ends = ends.max(now + Duration::from_nanos(1));
        let time = self.alarms[thread].set(Some(piece.ends))?;
        Some(Due { thread, time })
    }
}

/// A duration at another speed.
fn scale(duration: Duration, numerator: u32, denominator: u32) -> Duration {
    duration * numerator / denominator
}
