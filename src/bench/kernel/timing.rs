//! How fast kernels are: all trace the same rays, in turn, several times over.

use std::time::{Duration, Instant};

use equilux_common::ray::Ray;

use super::kind::{ByKind, Kind};

/// Rays that are handed to a kernel at once: what the paper used (section 3), and no more than
/// travel in a bundle.
const BUNDLE_RAYS: usize = 32;

/// Rays that lie ready at a time, fresh copies of those to be traced, and whose time is taken
/// together. They fit a small part of the caches, where rays are that a renderer has just made;
/// copying them is not timed.
const READY_RAYS: usize = 32 * BUNDLE_RAYS;

/// How long is measured if no number of rounds is asked for: no round begins later.
const MEASURED: Duration = Duration::from_secs(18);

/// But there are so many at least.
const ROUNDS_MIN: u32 = 3;

/// What finds out what rays hit.
pub(super) trait Kernel {
    /// As tables have it.
    fn name(&self) -> &'static str;

    /// Sets each ray's closest hit (`distance`, `hit_primitive`), if it has one.
    fn closest(&mut self, rays: &mut [Ray]);

    /// Says of each shadow ray whether anything is in its way.
    fn any(&mut self, rays: &[Ray], are_hit: &mut [bool]);
}

/// What was measured.
pub(super) struct Timing {
    pub(super) rounds: u32,
    /// Of each kernel, rays per second; none where there are no rays.
    pub(super) speeds: Vec<ByKind<Option<f64>>>,
}

impl Timing {
    /// Measures kernels, in so many rounds if a number is given. A kernel traces all rays of a kind
    /// before the next one does, so that each has its tree in the caches. Of the times that the
    /// same few rays took, the shortest counts: whatever else the machine does can only lengthen
    /// them, and seldom meets the same ones each time.
    pub(super) fn measure(
        kernels: &mut [Box<dyn Kernel + '_>],
        rays: &ByKind<Vec<Ray>>,
        wanted: Option<u32>,
    ) -> Self {
        let mut best: Vec<_> = kernels.iter().map(|_| rays.map(|_| Vec::new())).collect();
        let (started, mut rounds) = (now(), 0);
        let is_enough = |rounds| match wanted {
            Some(wanted) => rounds >= wanted,
            None => rounds >= ROUNDS_MIN && started.elapsed() >= MEASURED,
        };
        while !is_enough(rounds) {
            let began = now();
            for (at, (kind, rays)) in rays.iter().enumerate() {
                // Another one goes first each time.
                for turn in 0..kernels.len() {
                    let number = (turn + rounds as usize) % kernels.len();
                    let mut times = Vec::new();
                    pass(&mut *kernels[number], kind, rays, |_, time| times.push(time));
                    keep_shorter(&mut best[number].0[at], times);
                }
            }
            rounds += 1;
            eprintln!("round {rounds}: {:.1} s", began.elapsed().as_secs_f64());
        }
        let counts = rays.map(Vec::len);
        let speeds = |best: &ByKind<Vec<Duration>>| {
            let speed = |at: usize| {
                let elapsed = best.0[at].iter().sum::<Duration>().as_secs_f64();
                (counts.0[at] > 0).then(|| counts.0[at] as f64 / elapsed)
            };
            ByKind(std::array::from_fn(speed))
        };
        Self { rounds, speeds: best.iter().map(speeds).collect() }
    }
}

/// Keeps the shorter of two times for each run of rays; of what is new, all.
fn keep_shorter(best: &mut Vec<Duration>, times: Vec<Duration>) {
    best.resize(times.len(), Duration::MAX);
    for (best, time) in best.iter_mut().zip(times) {
        *best = time.min(*best);
    }
}

/// What came of a bundle.
pub(super) enum Traced<'a> {
    /// The rays, with what they hit.
    Closest(&'a [Ray]),
    /// Of each ray, whether anything is in its way.
    Any(&'a [bool]),
}

/// Lets a kernel trace all rays of a kind, some at a time. What comes of them, and how long they
/// took, is shown while no time is taken.
pub(super) fn pass(
    kernel: &mut dyn Kernel,
    kind: Kind,
    rays: &[Ray],
    mut show: impl FnMut(Traced<'_>, Duration),
) {
    let mut ready = Vec::with_capacity(READY_RAYS);
    let mut are_hit = [false; READY_RAYS];
    for rays in rays.chunks(READY_RAYS) {
        ready.clear();
        ready.extend_from_slice(rays);
        let are_hit = &mut are_hit[..rays.len()];
        let started = now();
        if kind.is_shadow() {
            let bundles = ready.chunks(BUNDLE_RAYS).zip(are_hit.chunks_mut(BUNDLE_RAYS));
            bundles.for_each(|(rays, are_hit)| kernel.any(rays, are_hit));
            show(Traced::Any(are_hit), started.elapsed());
        } else {
            ready.chunks_mut(BUNDLE_RAYS).for_each(|rays| kernel.closest(rays));
            show(Traced::Closest(&ready), started.elapsed());
        }
    }
}

#[expect(clippy::disallowed_methods, reason = "an edge: it takes times")]
pub(super) fn now() -> Instant {
    Instant::now()
}
