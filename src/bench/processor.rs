//! What the system accounts for: processor time by thread, and how often threads were woken. Linux
//! tells in `/proc` (proc(5)); elsewhere both are unknown.
//!
//! A worker's threads are of two kinds: compute threads, which trace, and all others, which carry
//! messages and run the core that balances.

use std::collections::BTreeMap;
use std::time::Duration;

/// Processor time of a cluster.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct ProcessorTime {
    /// Of the workers' compute threads.
    pub(crate) compute: Duration,
    /// Of all other threads of the workers.
    pub(crate) messages: Duration,
    /// Of this process, whose threads are the coordinator.
    pub(crate) coordinator: Duration,
}

/// How often each thread went to sleep of itself, which it does once for each time it is woken.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Wakes {
    threads: BTreeMap<i32, ThreadWakes>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct ThreadWakes {
    is_compute: bool,
    count: u64,
}

impl ProcessorTime {
    /// What was spent from an earlier reading until this one.
    pub(crate) fn since(&self, earlier: &Self) -> Self {
        Self {
            compute: self.compute.saturating_sub(earlier.compute),
            messages: self.messages.saturating_sub(earlier.messages),
            coordinator: self.coordinator.saturating_sub(earlier.coordinator),
        }
    }

    /// Of all.
    pub(crate) fn total(&self) -> Duration {
        self.compute + self.messages + self.coordinator
    }
}

impl Wakes {
    /// Those of compute threads and of all others from an earlier reading until this one. What a
    /// thread did that has ended since is not known.
    pub(crate) fn since(&self, earlier: &Self) -> [u64; 2] {
        let mut sums = [0, 0];
        for (id, thread) in &self.threads {
            let before = earlier.threads.get(id).map_or(0, |thread| thread.count);
            sums[usize::from(!thread.is_compute)] += thread.count.saturating_sub(before);
        }
        sums
    }
}

#[cfg(target_os = "linux")]
mod linux {
    use std::collections::BTreeMap;
    use std::time::Duration;

    use procfs::ProcResult;
    use procfs::process::{Process, Stat, Task};

    use super::{ProcessorTime, ThreadWakes, Wakes};

    /// How the names of compute threads begin.
    const COMPUTE: &str = "compute-";

    /// Processor time so far of workers with these process ids and of this process.
    pub(in crate::bench) fn processor_time(workers: &[u32]) -> Option<ProcessorTime> {
        let own = Process::myself().and_then(|own| own.stat()).ok()?;
        let mut sum = ProcessorTime { coordinator: spent(&own), ..ProcessorTime::default() };
        for &worker in workers {
            let [all, compute] = of_worker(worker).ok()?;
            sum.compute += compute;
            sum.messages += all.saturating_sub(compute);
        }
        Some(sum)
    }

    /// How often the threads of workers with these process ids were woken so far.
    pub(in crate::bench) fn wakes(workers: &[u32]) -> Option<Wakes> {
        let mut threads = BTreeMap::new();
        for &worker in workers {
            for (task, stat) in tasks(worker).ok()? {
                // It may have ended since.
                let Ok(status) = task.status() else { continue };
                let is_compute = stat.comm.starts_with(COMPUTE);
                let count = status.voluntary_ctxt_switches?;
                threads.insert(task.tid, ThreadWakes { is_compute, count });
            }
        }
        Some(Wakes { threads })
    }

    /// Of all threads of a process, also those that have ended, and of its compute threads, which
    /// live as long as it does.
    fn of_worker(worker: u32) -> ProcResult<[Duration; 2]> {
        let is_compute = |(_, stat): &(Task, Stat)| stat.comm.starts_with(COMPUTE);
        let threads = tasks(worker)?.into_iter().filter(is_compute);
        let compute = threads.map(|(_, stat)| spent(&stat)).sum();
        Ok([spent(&process(worker)?.stat()?), compute])
    }

    /// The threads of a process, without those that end while they are looked at.
    fn tasks(id: u32) -> ProcResult<Vec<(Task, Stat)>> {
        let tasks = process(id)?.tasks()?.flatten();
        Ok(tasks.filter_map(|task| task.stat().ok().map(|stat| (task, stat))).collect())
    }

    fn process(id: u32) -> ProcResult<Process> {
        Process::new(i32::try_from(id).unwrap_or_default())
    }

    fn spent(stat: &Stat) -> Duration {
        let ticks = (stat.utime + stat.stime) as f64;
        Duration::from_secs_f64(ticks / procfs::ticks_per_second() as f64)
    }

    #[cfg(test)]
    mod tests {
        use super::*;
        use std::hint::black_box;
        use std::sync::mpsc;
        use std::thread::Builder;

        #[test]
        fn threads_are_told_apart_by_their_names() {
            let own = [std::process::id()];
            let before = (processor_time(&own).unwrap(), wakes(&own).unwrap());
            let (ask, asked) = mpsc::channel::<u64>();
            let (answer, answered) = mpsc::channel();
            let body = move || {
                for rounds in asked {
                    let sum = (0..rounds).fold(0_u64, |sum, it| black_box(sum ^ it));
                    answer.send(sum).unwrap();
                }
            };
            let thread = Builder::new().name("compute-0".into()).spawn(body).unwrap();
            let spent_enough = || {
                ask.send(1_000_000).unwrap();
                answered.recv().unwrap();
                let spent = processor_time(&own).unwrap().since(&before.0);
                // A bound by its own spending, for the time on the clock proves nothing.
                assert!(spent.total() < Duration::from_secs(10), "no compute thread is seen");
                spent.compute >= Duration::from_millis(20)
            };
            // As long as it takes: how fast this machine is does not matter.
            while !spent_enough() {}
            assert!(wakes(&own).unwrap().since(&before.1)[0] > 0);
            drop(ask);
            thread.join().unwrap();
        }

        #[test]
        fn of_a_process_that_is_not_there_nothing_is_known() {
            assert_eq!(processor_time(&[u32::MAX]), None);
            assert_eq!(wakes(&[u32::MAX]), None);
        }
    }
}

#[cfg(target_os = "linux")]
pub(super) use linux::{processor_time, wakes};

/// Unknown.
#[cfg(not(target_os = "linux"))]
pub(super) const fn processor_time(_: &[u32]) -> Option<ProcessorTime> {
    None
}

/// Unknown.
#[cfg(not(target_os = "linux"))]
pub(super) const fn wakes(_: &[u32]) -> Option<Wakes> {
    None
}
