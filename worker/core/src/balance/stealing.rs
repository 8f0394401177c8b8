//! Random-victim work stealing: the yardstick that diffusion is measured by.
//!
//! A worker whose queue is empty asks one neighbor, drawn at random, for half of what it has; if
//! there is nothing, another one at once (Blumofe & Leiserson, *Scheduling multithreaded
//! computations by work stealing*, 1999). After as many failures as it has neighbors it pauses, and
//! twice as long each time, so that an idle cluster does not drown in questions.

use std::time::Duration;

use equilux_common::ids::WorkerId;
use equilux_common::time::Time;

/// The first pause, until an attempt has been measured.
const PAUSE_AT_FIRST: Duration = Duration::from_micros(100);

/// The longest pause.
const PAUSE_MAX: Duration = Duration::from_millis(10);

/// Attempts to steal.
#[derive(Debug)]
pub(crate) struct Stealing {
    worker: WorkerId,
    /// Numbers the attempts, for the draws.
    attempt: u64,
    /// Who was asked last, and when, while the answer is awaited.
    asked: Option<(WorkerId, Time)>,
    /// From a question to its answer.
    round_trip: Option<Duration>,
    /// Since something was got or the last pause.
    failures: usize,
    pause: Duration,
    /// When the pause is over.
    resume: Option<Time>,
}

impl Stealing {
    /// A worker that has not tried yet.
    pub(crate) const fn new(worker: WorkerId) -> Self {
        Self {
            worker,
            attempt: 0,
            asked: None,
            round_trip: None,
            failures: 0,
            pause: Duration::ZERO,
            resume: None,
        }
    }

    /// Ends a pause that is over.
    pub(crate) fn wake(&mut self, now: Time) {
        self.resume = self.resume.filter(|&resume| resume > now);
    }

    /// Whom an empty-handed worker asks now, if anybody.
    pub(crate) fn victim(&mut self, now: Time, neighbors: &[WorkerId]) -> Option<WorkerId> {
        if self.asked.is_some() || self.resume.is_some() || neighbors.is_empty() {
            return None;
        }
        if self.failures >= neighbors.len() {
            self.rest(now);
            return None;
        }
        self.attempt += 1;
        let draw = hash(u64::from(self.worker.0) << 32 ^ self.attempt) % neighbors.len() as u64;
        let victim = neighbors[usize::try_from(draw).expect("fewer than neighbors")];
        self.asked = Some((victim, now));
        Some(victim)
    }

    /// A neighbor has nothing.
    pub(crate) fn fail(&mut self, now: Time, peer: WorkerId) {
        if self.answer(now, peer) {
            self.failures += 1;
        }
    }

    /// A neighbor gave something.
    pub(crate) fn succeed(&mut self, now: Time, peer: WorkerId) {
        self.answer(now, peer);
        (self.failures, self.pause, self.resume) = (0, Duration::ZERO, None);
    }

    /// A neighbor is gone.
    pub(crate) fn forget(&mut self, peer: WorkerId) {
        self.asked = self.asked.filter(|&(victim, _)| victim != peer);
    }

    /// When a pause ends.
    pub(crate) const fn deadline(&self) -> Option<Time> {
        self.resume
    }

    /// Whether no answer is awaited.
    pub(crate) const fn is_quiet(&self) -> bool {
        self.asked.is_none()
    }

    fn answer(&mut self, now: Time, peer: WorkerId) -> bool {
        let asked = self.asked.take_if(|(victim, _)| *victim == peer);
        if let Some((_, since)) = asked {
            self.round_trip = Some(now.since(since));
        }
        asked.is_some()
    }

    fn rest(&mut self, now: Time) {
        let first = self.round_trip.unwrap_or(PAUSE_AT_FIRST).max(PAUSE_AT_FIRST);
        self.pause = (self.pause * 2).clamp(first.min(PAUSE_MAX), PAUSE_MAX);
        (self.failures, self.resume) = (0, Some(now + self.pause));
    }
}

/// A number like a random one (the finalizer of `SplitMix64`: Steele, Lea & Flood, *Fast splittable
/// pseudorandom number generators*, 2014).
const fn hash(number: u64) -> u64 {
    let mut bits = number.wrapping_add(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    const NEIGHBORS: [WorkerId; 3] = [WorkerId(4), WorkerId(7), WorkerId(9)];

    #[test]
    fn failures_are_followed_by_pauses_that_grow_to_a_limit() {
        let mut stealing = Stealing::new(WorkerId(1));
        let (mut now, mut pauses) = (Time::ZERO, Vec::new());
        while pauses.len() < 12 {
            match stealing.victim(now, &NEIGHBORS) {
                Some(victim) => {
                    assert_eq!(stealing.victim(now, &NEIGHBORS), None, "one at a time");
                    now = now + Duration::from_micros(300);
                    stealing.fail(now, victim);
                }
                None => {
                    let resume = stealing.deadline().expect("a pause");
                    pauses.push(resume.since(now));
                    now = resume;
                    stealing.wake(now);
                }
            }
        }
        assert_eq!(pauses[..3], [300, 600, 1200].map(Duration::from_micros));
        assert_eq!(pauses[11], PAUSE_MAX);
        assert_eq!(stealing.attempt, 3 * 12);
        let victim = stealing.victim(now, &NEIGHBORS).expect("the pause is over");
        stealing.succeed(now, victim);
        assert!(stealing.is_quiet() && stealing.deadline().is_none());
    }

    #[test]
    fn every_neighbor_is_drawn() {
        let mut stealing = Stealing::new(WorkerId(1));
        let mut draws = [0; 3];
        for _ in 0..300 {
            let victim = stealing.victim(Time::ZERO, &NEIGHBORS).expect("may ask");
            draws[NEIGHBORS.iter().position(|&one| one == victim).expect("a neighbor")] += 1;
            stealing.succeed(Time::ZERO, victim);
        }
        assert!(draws.iter().all(|&count| count > 60), "{draws:?}");
    }
}
