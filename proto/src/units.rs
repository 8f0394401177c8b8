//! Lists of units as runs: a worker's initial share is a contiguous piece of the curve, and so
//! takes a few bytes however many units it has.

use equilux_common::ids::{Attempt, UnitId};

use crate::limits::UNITS_MAX;
use crate::v1::UnitRun;

/// A list of units that no job can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidUnits {
    /// A run of nothing.
    #[error("[{0}].count: is zero")]
    Empty(usize),
    /// More units than the job has.
    #[error("[{run}]: unit {last} is beyond the {limit} units of the job")]
    Beyond {
        /// Which run.
        run: usize,
        /// Its last unit.
        last: u64,
        /// How many the job has, or any job may have.
        limit: u32,
    },
    /// More units in all than the job has.
    #[error("lists more than the {limit} units of the job")]
    TooMany {
        /// How many the job has, or any job may have.
        limit: u32,
    },
}

/// The runs of a list; their order is that of the list.
pub(crate) fn runs(units: &[(UnitId, Attempt)]) -> Vec<UnitRun> {
    let follows = |a: &(UnitId, Attempt), b: &(UnitId, Attempt)| {
        a.0.0.checked_add(1) == Some(b.0.0) && a.1 == b.1
    };
    let run = |run: &[(UnitId, Attempt)]| UnitRun {
        first: run[0].0.0,
        count: run.len() as u32,
        attempt: run[0].1.0,
    };
    units.chunk_by(follows).map(run).collect()
}

/// The list in some runs, of a job of at most `limit` units.
pub(crate) fn list(runs: &[UnitRun], limit: u32) -> Result<Vec<(UnitId, Attempt)>, InvalidUnits> {
    let mut total = 0;
    for (index, run) in runs.iter().enumerate() {
        check(index, run, limit)?;
        total += u64::from(run.count);
        if total > u64::from(limit) {
            return Err(InvalidUnits::TooMany { limit });
        }
    }
    let of_run = |run: &UnitRun| {
        let attempt = Attempt(run.attempt);
        (run.first..run.first + run.count).map(move |id| (UnitId(id), attempt))
    };
    Ok(runs.iter().flat_map(of_run).collect())
}

/// The list in some runs, where the job is not at hand.
pub(crate) fn list_of_any_job(runs: &[UnitRun]) -> Result<Vec<(UnitId, Attempt)>, InvalidUnits> {
    list(runs, UNITS_MAX)
}

fn check(index: usize, run: &UnitRun, limit: u32) -> Result<(), InvalidUnits> {
    if run.count == 0 {
        return Err(InvalidUnits::Empty(index));
    }
    let last = u64::from(run.first) + u64::from(run.count) - 1;
    if last >= u64::from(limit) {
        return Err(InvalidUnits::Beyond { run: index, last, limit });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arbitrary;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn lists_round_trip(units in arbitrary::units(500)) {
            prop_assert_eq!(list(&runs(&units), 500), Ok(units));
        }
    }

    #[test]
    fn a_contiguous_share_is_one_run() {
        let units: Vec<_> = (7..9000).map(|id| (UnitId(id), Attempt(2))).collect();
        assert_eq!(runs(&units), [UnitRun { first: 7, count: 8993, attempt: 2 }]);
    }

    #[test]
    fn lists_beyond_the_job_are_refused_before_memory_is_taken() {
        let run = |first, count| UnitRun { first, count, attempt: 0 };
        assert_eq!(list(&[run(0, 0)], 10), Err(InvalidUnits::Empty(0)));
        let beyond = InvalidUnits::Beyond { run: 0, last: 10, limit: 10 };
        assert_eq!(list(&[run(5, 6)], 10), Err(beyond));
        assert!(list(&[run(u32::MAX, u32::MAX)], u32::MAX).is_err());
        assert_eq!(list(&[run(0, 9), run(0, 9)], 10), Err(InvalidUnits::TooMany { limit: 10 }));
    }
}
