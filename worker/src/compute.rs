//! Compute threads: they take work, trace it and hand back what it came to. Without work they are
//! parked.
//!
//! All threads take from one channel; the core gives them only as much as they need, so that what
//! waits stays with the core, which can give it to others.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Weak};
use std::thread;
use std::time::{Duration, Instant};

use crossbeam_channel::{Receiver, Sender, unbounded};
use equilux_common::ids::JobId;
use equilux_common::work::{Outcome, Work};
use equilux_render::home::InvalidWork;
use equilux_render::renderer::Renderer;
use equilux_render::scratch::Scratch;
use equilux_worker_core::PieceId;

/// Light, as compute threads see it: a job's scene, ready to be traced.
pub trait Tracer: Send + Sync {
    /// Traces `work`. When `interrupt` turns true, rays not begun come back as successors.
    ///
    /// # Errors
    /// If the work is not of this job; a peer has sent it then.
    fn trace(
        &self,
        work: Work,
        interrupt: &AtomicBool,
        scratch: &mut Scratch,
    ) -> Result<Outcome, InvalidWork>;
}

impl Tracer for Renderer {
    fn trace(
        &self,
        work: Work,
        interrupt: &AtomicBool,
        scratch: &mut Scratch,
    ) -> Result<Outcome, InvalidWork> {
        Self::trace(self, work, interrupt, scratch)
    }
}

/// A piece of work on its way to a thread.
pub(crate) struct Task {
    /// Of which job.
    pub(crate) job: JobId,
    /// Which piece, for the core.
    pub(crate) piece: PieceId,
    /// Its scene; gone if the scene is dropped before a thread takes the work up.
    pub(crate) tracer: Weak<dyn Tracer>,
    /// What is to be traced.
    pub(crate) work: Work,
}

/// What a thread has done.
#[derive(Debug)]
pub(crate) struct Traced {
    /// Of which job.
    pub(crate) job: JobId,
    /// Which piece.
    pub(crate) piece: PieceId,
    /// What it came to.
    pub(crate) outcome: Result<Outcome, TraceError>,
    /// How long it took.
    pub(crate) elapsed: Duration,
}

/// Work that came to nothing.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum TraceError {
    /// A peer sent what is not of this job.
    #[error("a peer sent {0}; all programs must be of one version")]
    Invalid(#[from] InvalidWork),
    /// Light has a bug.
    #[error("a compute thread panicked: {0}; this is a bug in equilux, please report it")]
    Panicked(String),
}

/// A worker's compute threads. They end when this is dropped, and give up what they trace.
#[derive(Debug)]
pub(crate) struct Compute {
    tasks: Sender<(u64, Task)>,
    flags: Vec<Arc<AtomicBool>>,
    /// How many interrupts there were; tasks carry how many there were before them.
    interrupts: Arc<AtomicU64>,
}

impl Compute {
    /// Starts `threads` threads, which hand what they have done to `report`.
    ///
    /// # Errors
    /// If the system gives no more threads.
    pub(crate) fn start(
        threads: u32,
        report: impl Fn(Traced) + Clone + Send + 'static,
    ) -> std::io::Result<Self> {
        // Unbounded, for the core bounds what is given out by what threads can do.
        let (tasks, taken) = unbounded();
        let interrupts = Arc::new(AtomicU64::new(0));
        let flags = (0..threads)
            .map(|index| {
                let flag = Arc::new(AtomicBool::new(false));
                let (taken, report) = (taken.clone(), report.clone());
                let orders = Orders { flag: flag.clone(), interrupts: interrupts.clone() };
                let name = format!("compute-{index}");
                thread::Builder::new().name(name).spawn(move || run(&taken, &orders, &report))?;
                Ok(flag)
            })
            .collect::<std::io::Result<_>>()?;
        Ok(Self { tasks, flags, interrupts })
    }

    /// Has `task` traced by any thread.
    pub(crate) fn trace(&self, task: Task) {
        let before = self.interrupts.load(Ordering::SeqCst);
        let is_taken = self.tasks.send((before, task)).is_ok();
        assert!(is_taken, "threads live as long as their channel");
    }

    /// Has threads give up soon what they have not begun of all tasks so far, whether they have
    /// taken them up yet or not. What is handed out afterwards is traced to its end.
    pub(crate) fn interrupt(&self) {
        self.interrupts.fetch_add(1, Ordering::SeqCst);
        for flag in &self.flags {
            flag.store(true, Ordering::SeqCst);
        }
    }
}

impl Drop for Compute {
    fn drop(&mut self) {
        self.interrupt();
    }
}

/// How a thread is told to give up.
struct Orders {
    flag: Arc<AtomicBool>,
    interrupts: Arc<AtomicU64>,
}

impl Orders {
    /// A task is taken up: interrupts before it was handed out do not concern it, later ones do.
    /// One that comes between the two steps sets the flag itself.
    fn renew(&self, before: u64) {
        self.flag.store(false, Ordering::SeqCst);
        if self.interrupts.load(Ordering::SeqCst) != before {
            self.flag.store(true, Ordering::SeqCst);
        }
    }
}

/// The life of a thread.
fn run(tasks: &Receiver<(u64, Task)>, orders: &Orders, report: &impl Fn(Traced)) {
    let mut scratch = Scratch::default();
    for (before, Task { job, piece, tracer, work }) in tasks {
        let Some(tracer) = tracer.upgrade() else { continue };
        orders.renew(before);
        let interrupt = &orders.flag;
        let start = now();
        let tracing = || tracer.trace(work, interrupt, &mut scratch);
        let outcome = match catch_unwind(AssertUnwindSafe(tracing)) {
            Ok(outcome) => outcome.map_err(TraceError::from),
            Err(panic) => {
                // Whatever the panic left behind is not to be trusted.
                scratch = Scratch::default();
                Err(TraceError::Panicked(message_of(panic.as_ref())))
            }
        };
        let elapsed = start.elapsed();
        // The scene may be dropped here; that is done before anybody is told.
        drop(tracer);
        report(Traced { job, piece, outcome, elapsed });
    }
}

#[expect(clippy::disallowed_methods, reason = "the edge measures for the core")]
fn now() -> Instant {
    Instant::now()
}

fn message_of(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "no message".into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use equilux_common::bundle::Share;
    use equilux_common::credit::Credit;
    use equilux_common::ids::{Attempt, UnitId};
    use equilux_common::work::{RayCounts, Samples};

    const PATIENCE: Duration = Duration::from_secs(20);

    /// Traces until it is interrupted, or panics, by the number of paths.
    struct Stub {
        begun: Sender<()>,
    }

    const UNTIL_INTERRUPTED: u32 = 1;
    const PANICS: u32 = 2;
    const SHORT: u32 = 3;

    impl Tracer for Stub {
        fn trace(
            &self,
            work: Work,
            interrupt: &AtomicBool,
            _: &mut Scratch,
        ) -> Result<Outcome, InvalidWork> {
            let Work::Samples(samples) = work else { unreachable!("only samples are given here") };
            self.begun.send(()).expect("the test listens");
            match samples.path_count {
                PANICS => panic!("no such luck"),
                SHORT => {}
                _ => {
                    while !interrupt.load(Ordering::Relaxed) {
                        thread::yield_now();
                    }
                }
            }
            let counts = RayCounts { camera: samples.path_count.into(), ..RayCounts::default() };
            Ok(Outcome { counts, ..Outcome::default() })
        }
    }

    struct Bench {
        compute: Compute,
        tracer: Arc<dyn Tracer>,
        begun: Receiver<()>,
        traced: Receiver<Traced>,
    }

    fn bench(threads: u32) -> Bench {
        let (begin, begun) = unbounded();
        let (report, traced) = unbounded();
        let compute = Compute::start(threads, move |done| drop(report.send(done))).unwrap();
        Bench { compute, tracer: Arc::new(Stub { begun: begin }), begun, traced }
    }

    impl Bench {
        fn give(&self, path_count: u32) {
            let share = Share { unit: UnitId(0), attempt: Attempt(0), credit: Credit::whole() };
            let work = Work::Samples(Samples { share, first_path: 0, path_count });
            let tracer = Arc::downgrade(&self.tracer);
            self.compute.trace(Task { job: JobId(7), piece: PieceId(3), tracer, work });
        }

        fn done(&self) -> Result<u64, TraceError> {
            let traced = self.traced.recv_timeout(PATIENCE).expect("a thread has done it");
            assert_eq!((traced.job, traced.piece), (JobId(7), PieceId(3)));
            traced.outcome.map(|outcome| outcome.counts.camera)
        }
    }

    #[test]
    fn an_interrupt_is_obeyed_for_all_that_was_handed_out_before() {
        let bench = bench(2);
        bench.give(UNTIL_INTERRUPTED);
        bench.give(UNTIL_INTERRUPTED);
        bench.give(UNTIL_INTERRUPTED);
        for _ in 0..2 {
            bench.begun.recv_timeout(PATIENCE).expect("both threads trace");
        }
        bench.compute.interrupt();
        assert_eq!([bench.done(), bench.done(), bench.done()], [Ok(1), Ok(1), Ok(1)]);
        bench.begun.recv_timeout(PATIENCE).expect("the third was begun");
        bench.give(UNTIL_INTERRUPTED);
        bench.begun.recv_timeout(PATIENCE).expect("the fourth is begun");
        assert!(bench.traced.recv_timeout(Duration::from_millis(20)).is_err(), "and goes on");
        bench.compute.interrupt();
        assert_eq!(bench.done(), Ok(1));
    }

    #[test]
    fn an_interrupt_is_not_lost_on_what_no_thread_has_taken_up() {
        let bench = bench(1);
        for _ in 0..200 {
            bench.give(UNTIL_INTERRUPTED);
            bench.compute.interrupt();
            assert_eq!(bench.done(), Ok(1));
        }
    }

    #[test]
    fn a_panic_is_told_and_the_thread_goes_on() {
        let bench = bench(1);
        bench.give(PANICS);
        bench.give(SHORT);
        assert_eq!(bench.done(), Err(TraceError::Panicked("no such luck".into())));
        assert_eq!(bench.done(), Ok(3));
    }

    #[test]
    fn work_of_a_dropped_scene_is_not_begun_and_dropping_ends_the_rest() {
        let mut bench = bench(1);
        bench.give(UNTIL_INTERRUPTED);
        bench.begun.recv_timeout(PATIENCE).expect("it is begun");
        bench.give(SHORT);
        let (begin, _) = unbounded();
        bench.tracer = Arc::new(Stub { begun: begin });
        drop(bench.compute);
        let traced = bench.traced.recv_timeout(PATIENCE).expect("it was given up");
        assert!(traced.outcome.is_ok());
        assert!(bench.traced.recv_timeout(PATIENCE).is_err(), "nothing more, and the thread ended");
    }
}
