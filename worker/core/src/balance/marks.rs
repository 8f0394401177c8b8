//! The low-water mark: how much work must wait so that the wait for more is hidden.
//!
//! That is the work of a full cycle of balancing, as cycles went here lately: from the question for
//! load until half have answered (a single one that is late shall not set the mark), and from the
//! request to the first gift. So the mark follows the network, and the haste of the workers at its
//! other ends.

use std::time::Duration;

use equilux_common::time::Time;

/// The mark before anything was measured.
const MARK_AT_FIRST: Duration = Duration::from_micros(200);

/// Below, asking would cost more than the wait.
const MARK_MIN: Duration = Duration::from_micros(50);

/// Above, what others wait for would be kept from them.
const MARK_MAX: Duration = Duration::from_millis(50);

/// A gift that takes so many rounds was not to be had when it was asked for: its delay is the
/// work's, not the network's.
const GIFT_ROUNDS_MAX: u32 = 4;

/// The mark over the time that a cycle takes, in quarters: the next one may take a little longer.
const MARGIN_QUARTERS: u32 = 5;

/// Measured durations of the parts of a cycle.
#[derive(Debug, Default)]
pub(crate) struct Marks {
    round: Cautious,
    gift: Cautious,
    asked: Option<Time>,
    requested: Option<Time>,
}

impl Marks {
    /// The neighbors are asked for their load.
    pub(crate) const fn ask(&mut self, now: Time) {
        self.asked = Some(now);
        self.requested = None;
    }

    /// Half have answered; only the first time counts.
    pub(crate) fn answer(&mut self, now: Time) {
        if let Some(asked) = self.asked.take() {
            self.round.add(now.since(asked));
        }
    }

    /// Work was requested of somebody who has some.
    pub(crate) const fn request(&mut self, now: Time) {
        self.requested = Some(now);
    }

    /// Work came.
    pub(crate) fn receive(&mut self, now: Time) {
        if let Some((requested, round)) = self.requested.take().zip(self.round.mean) {
            self.gift.add(now.since(requested).min(round * GIFT_ROUNDS_MAX));
        }
    }

    /// How long what waits must last.
    pub(crate) fn low_water(&self) -> Duration {
        let Some(round) = self.round.mean else { return MARK_AT_FIRST };
        let cycle = round + self.gift.mean.unwrap_or(round);
        (cycle * MARGIN_QUARTERS / 4).clamp(MARK_MIN, MARK_MAX)
    }
}

/// A moving mean that follows what is longer at once, but not all the way, and what is shorter
/// slowly.
#[derive(Debug, Default)]
struct Cautious {
    mean: Option<Duration>,
}

impl Cautious {
    fn add(&mut self, measured: Duration) {
        // A neighbor may have had nothing to give for a while: that is no matter of cycles.
        let measured = measured.min(MARK_MAX);
        let mean = self.mean.unwrap_or(measured);
        let is_longer = measured > mean;
        let weight = if is_longer { 2 } else { 8 };
        self.mean = Some(if is_longer {
            mean + (measured - mean) / weight
        } else {
            mean - (mean - measured) / weight
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const US: u64 = 1000;

    /// Cycles that take so many microseconds each.
    fn cycles(marks: &mut Marks, count: u64, micros: u64) {
        for cycle in 0..count {
            let time = |part: u64| Time::from_nanos(cycle * 1000 * US + part * micros * US / 2);
            marks.ask(time(0));
            marks.answer(time(1));
            marks.request(time(1));
            marks.receive(time(2));
            marks.receive(time(3));
        }
    }

    #[test]
    fn the_mark_is_a_measured_cycle_and_a_margin() {
        let mut marks = Marks::default();
        assert_eq!(marks.low_water(), MARK_AT_FIRST);
        cycles(&mut marks, 1, 400);
        assert_eq!(marks.low_water(), Duration::from_micros(500));
        cycles(&mut marks, 1, 800);
        assert_eq!(marks.low_water(), Duration::from_micros(750), "half the way up");
        cycles(&mut marks, 100, 4);
        assert_eq!(marks.low_water(), MARK_MIN);
        cycles(&mut marks, 20, 1_000_000);
        assert_eq!(marks.low_water(), MARK_MAX, "100 ms and a margin are too much");
    }

    #[test]
    fn a_gift_that_was_not_to_be_had_does_not_raise_the_mark_for_long() {
        let mut marks = Marks::default();
        cycles(&mut marks, 1, 400);
        let later = |micros: u64| Time::from_nanos((5000 + micros) * US);
        marks.ask(later(0));
        marks.answer(later(200));
        marks.request(later(200));
        marks.receive(later(40_200));
        assert_eq!(marks.low_water(), Duration::from_micros(875), "a gift of 4 rounds, half of it");
    }
}
