//! The load of every worker over time, for a heat map.

use std::time::Duration;

/// Instants that are kept, at most; beyond, every other one is dropped.
const INSTANTS_MAX: usize = 400;

/// Loads of all workers at equal intervals.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadMap {
    /// Time between two instants; the first is the submission.
    pub interval: Duration,
    /// By instant and worker: seconds of work in the worker's queue.
    pub seconds: Vec<Vec<f32>>,
}

impl LoadMap {
    /// Nothing has been seen yet.
    pub(crate) const fn new(interval: Duration) -> Self {
        Self { interval, seconds: Vec::new() }
    }

    /// When to look next.
    pub(crate) fn next(&self) -> Duration {
        self.interval * u32::try_from(self.seconds.len()).unwrap_or(u32::MAX)
    }

    /// The loads at that time.
    pub(crate) fn push(&mut self, loads: Vec<f32>) {
        self.seconds.push(loads);
        if self.seconds.len() >= INSTANTS_MAX {
            let mut index = 0;
            self.seconds.retain(|_| {
                index += 1;
                index % 2 == 1
            });
            self.interval *= 2;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_run_keeps_every_other_instant() {
        let mut map = LoadMap::new(Duration::from_millis(10));
        for _ in 0..3 * INSTANTS_MAX {
            let time = map.next();
            map.push(vec![time.as_secs_f32()]);
        }
        assert!((INSTANTS_MAX / 2..INSTANTS_MAX).contains(&map.seconds.len()));
        for (index, loads) in (0_u32..).zip(&map.seconds) {
            assert_eq!(loads[0], (map.interval * index).as_secs_f32());
        }
    }
}
