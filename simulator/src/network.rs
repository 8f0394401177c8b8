//! The network: every link delivers in order and after a random delay, and no link waits for
//! another.

use std::collections::BTreeMap;
use std::time::Duration;

use equilux_common::time::Time;

use crate::plan::Latency;
use crate::random::Random;

/// One end of a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum End {
    Coordinator,
    /// A host, by its position among all that ever were.
    Host(usize),
}

/// All links.
#[derive(Debug)]
pub(crate) struct Network {
    latency: Latency,
    random: Random,
    /// When the last message on each link arrives.
    last: BTreeMap<(End, End), Time>,
}

impl Network {
    pub(crate) const fn new(latency: Latency, random: Random) -> Self {
        Self { latency, random, last: BTreeMap::new() }
    }

    /// When a message that is sent now arrives.
    pub(crate) fn arrival(&mut self, now: Time, from: End, to: End) -> Time {
        let soonest = now + self.delay();
        let last = self.last.entry((from, to)).or_default();
        *last = soonest.max(*last + Duration::from_nanos(1));
        *last
    }

    /// A delay like that of a message, for things that are bound to no link.
    pub(crate) fn delay(&mut self) -> Duration {
        let Latency { least, jitter, tail, tail_percent } = self.latency;
        let slow = if self.random.chance(tail_percent) { tail } else { Duration::ZERO };
        least + self.random.duration(Duration::ZERO..=jitter + slow)
    }
}
