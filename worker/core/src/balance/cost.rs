//! What work costs: moving means of what it did cost.
//!
//! All costs are nanoseconds of one compute thread. Later this becomes a mean per region of the
//! scene; who asks for an estimate will not notice.

use std::time::Duration;

use equilux_common::work::RayCounts;

/// Assumed of a camera path until one has been traced here.
const PATH_NANOS: u64 = 20_000;

/// Weight of a new measurement is one in so many: some tens of milliseconds of memory.
const MEMORY_PIECES: u64 = 8;

/// Moving means; none where nothing has been measured.
#[derive(Debug, Default)]
pub(crate) struct Costs {
    path_nanos: Option<u64>,
    ray_nanos: Option<u64>,
    /// Of a piece of work on its compute thread.
    piece_nanos: Option<u64>,
}

impl Costs {
    /// A piece was traced, and `returned` of its rays came back unfinished.
    pub(crate) fn learn(&mut self, elapsed: Duration, counts: &RayCounts, returned: u64) {
        let nanos = u64::try_from(elapsed.as_nanos()).unwrap_or(u64::MAX);
        mix(&mut self.piece_nanos, nanos);
        if counts.camera > 0 {
            if let Some(mean) = nanos.checked_div(counts.camera.saturating_sub(returned)) {
                mix(&mut self.path_nanos, mean);
            }
            return;
        }
        // What went in, by the ledger, less what came back untouched.
        let received = (counts.retired + returned).saturating_sub(counts.spawned());
        if let Some(mean) = nanos.checked_div(received.saturating_sub(returned)) {
            mix(&mut self.ray_nanos, mean);
        }
    }

    /// Cost of so many camera paths.
    pub(crate) fn paths(&self, count: u64) -> u64 {
        count.saturating_mul(self.path())
    }

    /// Cost of so many rays in the middle of their paths: until one has been traced here, what
    /// whole paths cost.
    pub(crate) fn rays(&self, count: u64) -> u64 {
        count.saturating_mul(self.ray())
    }

    /// Cost of so many pieces on compute threads, as pieces went so far; nothing before the first.
    pub(crate) fn pieces(&self, count: u64) -> u64 {
        count.saturating_mul(self.piece_nanos.unwrap_or(0))
    }

    /// Camera paths that cost at most so much.
    pub(crate) fn paths_within(&self, nanos: u64) -> u64 {
        nanos / self.path()
    }

    /// Rays in the middle of their paths that cost at most so much.
    pub(crate) fn rays_within(&self, nanos: u64) -> u64 {
        nanos / self.ray()
    }

    fn ray(&self) -> u64 {
        self.ray_nanos.unwrap_or(self.path())
    }

    fn path(&self) -> u64 {
        self.path_nanos.unwrap_or(PATH_NANOS)
    }
}

/// Moves a mean toward a measurement; it never becomes 0.
fn mix(mean: &mut Option<u64>, measured: u64) {
    let last = mean.unwrap_or(measured);
    let kept = last - last / MEMORY_PIECES;
    *mean = Some(kept.saturating_add(measured / MEMORY_PIECES).max(1));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_means_follow_what_is_measured() {
        let mut costs = Costs::default();
        let samples = RayCounts { camera: 100, indirect: 300, retired: 400, ..Default::default() };
        let rays = RayCounts { indirect: 30, retired: 80, ..Default::default() };
        for _ in 0..200 {
            costs.learn(Duration::from_millis(1), &samples, 0);
            costs.learn(Duration::from_millis(1), &rays, 0);
        }
        assert!(costs.path_nanos.expect("measured").abs_diff(10_000) < 20, "{costs:?}");
        assert!(costs.ray_nanos.expect("measured").abs_diff(20_000) < 20, "{costs:?}");
        assert!(costs.piece_nanos.expect("measured").abs_diff(1_000_000) < 20, "{costs:?}");
    }
}
