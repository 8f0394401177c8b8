//! How fast one of this worker's threads traces when all of them do, so that the coordinator issues
//! a fast machine more than a slow one from the start. It is a first guess: work that was issued
//! wrongly flows, and no image depends on it.
//!
//! A small course, the same everywhere, is run for some slices of time by as many threads as will
//! compute; of the slices, in which threads may have been disturbed, the best one counts.

mod course;

use std::num::NonZero;
use std::thread;
use std::time::{Duration, Instant};

use futures::FutureExt;
use futures::future::{BoxFuture, Shared};

use self::course::Course;

/// Rays per second of one thread of the reference, of which a speed is thousandths: a virtual AMD
/// EPYC of 2 threads, both of them running.
const REFERENCE_RAYS_PER_SECOND: f64 = 1.65e6;

/// The speed where nothing can be measured.
const SPEED_UNMEASURED: u32 = 1000;

/// No machine is a thousand times the reference, and no clock that says so is to be believed.
const SPEED_MAX: f64 = 1e6;

/// Slices, the first of which finds cold caches: 50 ms in all, which connecting takes as well.
const SLICES: usize = 5;

/// Time of a slice: some laps of the course, and longer than a clock tick of the slowest system.
const SLICE: Duration = Duration::from_millis(10);

/// A speed that is being measured, or has been.
pub(crate) type Measurement = Shared<BoxFuture<'static, u32>>;

/// Begins to measure the speed of one of `threads` threads, beside whatever else is done.
pub(crate) fn measure(threads: u32) -> Measurement {
    let measuring = tokio::task::spawn_blocking(move || run(threads, stopwatch));
    measuring.map(|speed| speed.unwrap_or(SPEED_UNMEASURED)).boxed().shared()
}

/// Runs the course on so many threads, each with a stopwatch of its own; the speed of one.
fn run<C: FnMut() -> Duration>(threads: u32, stopwatch: impl Fn() -> C + Sync) -> u32 {
    let cores = thread::available_parallelism().map_or(1, NonZero::get);
    // More threads than cores share them.
    let running = cores.min(threads as usize);
    let course = Course::new();
    let rates: Vec<Vec<f64>> = thread::scope(|scope| {
        let rates = || rates(&course, stopwatch());
        let start = |_| thread::Builder::new().spawn_scoped(scope, rates).ok();
        let started: Vec<_> = (0..running).filter_map(start).collect();
        started.into_iter().filter_map(|thread| thread.join().ok()).collect()
    });
    speed(&rates, threads)
}

/// What each slice came to on one thread.
fn rates(course: &Course, mut clock: impl FnMut() -> Duration) -> Vec<f64> {
    let mut runner = course.runner();
    (0..SLICES).map(|_| slice(|| runner.lap(), &mut clock)).collect()
}

/// Runs laps for the time of a slice; rays per second. A lap says how many rays it had.
fn slice(mut lap: impl FnMut() -> u64, mut clock: impl FnMut() -> Duration) -> f64 {
    let start = clock();
    let mut rays = 0;
    loop {
        rays += lap();
        let elapsed = clock().saturating_sub(start);
        if elapsed >= SLICE {
            return rays as f64 / elapsed.as_secs_f64();
        }
    }
}

/// The speed of one of `threads` threads, by the rays per second of the slices of those that ran.
fn speed(rates: &[Vec<f64>], threads: u32) -> u32 {
    let together = |slice: usize| rates.iter().filter_map(|rates| rates.get(slice)).sum::<f64>();
    let best = (0..SLICES).map(together).fold(0.0, f64::max);
    if best == 0.0 {
        return SPEED_UNMEASURED;
    }
    let thousandths = best / f64::from(threads) / REFERENCE_RAYS_PER_SECOND * 1000.0;
    thousandths.round().clamp(1.0, SPEED_MAX) as u32
}

/// Time from now on.
#[expect(clippy::disallowed_methods, reason = "the edge measures what light does")]
fn stopwatch() -> impl FnMut() -> Duration {
    let start = Instant::now();
    move || start.elapsed()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slice_ends_with_the_lap_that_fills_it() {
        let mut times = (0..).map(|look| Duration::from_millis(look * 3));
        let mut laps = [600, 900, 500, 400, 7000].into_iter();
        let rate = slice(|| laps.next().unwrap(), || times.next().unwrap());
        assert_eq!((laps.len(), rate.round()), (1, 200_000.0));
    }

    #[test]
    fn the_best_slice_of_all_threads_together_counts() {
        let reference = REFERENCE_RAYS_PER_SECOND;
        let even = |rate: f64| vec![rate * reference; SLICES];
        assert_eq!(speed(&[even(1.0)], 1), 1000);
        assert_eq!(speed(&[even(0.25), even(0.75)], 2), 500);
        assert_eq!(speed(&[even(1.0), even(1.0)], 8), 250, "eight threads on two cores");
        let mut disturbed = [even(1.0), even(1.0)];
        disturbed[0][0] = 9.0 * reference;
        disturbed[1][0] = 0.0;
        assert_eq!(speed(&disturbed, 2), 4500);
        disturbed[0][0] = 0.1 * reference;
        assert_eq!(speed(&disturbed, 2), 1000);
    }

    #[test]
    fn a_speed_is_what_the_coordinator_takes() {
        assert_eq!(speed(&[], 4), SPEED_UNMEASURED);
        assert_eq!(speed(&[vec![1e-9; SLICES]], 1), 1);
        assert_eq!(speed(&[vec![1e300; SLICES]], 1), 1_000_000);
    }

    /// Stopwatches on which every lap takes so long.
    fn every_lap_takes(lap: Duration) -> impl Fn() -> Box<dyn FnMut() -> Duration> + Sync {
        move || {
            let mut time = Duration::ZERO;
            Box::new(move || {
                time += lap;
                time
            })
        }
    }

    #[test]
    fn twice_the_time_for_the_course_is_half_the_speed() {
        let rays = Course::new().runner().lap() as f64;
        let lap = Duration::from_secs_f64(rays / REFERENCE_RAYS_PER_SECOND);
        assert_eq!(run(1, every_lap_takes(lap)), 1000, "that of the reference");
        assert_eq!(run(1, every_lap_takes(2 * lap)), 500);
        assert_eq!(run(1, every_lap_takes(lap / 2)), 2000);
        // Longer than a slice.
        assert_eq!(run(1, every_lap_takes(100 * lap)), 10);
    }
}
