//! What must hold after every step of a run, whatever has happened.

use equilux_common::credit::Credit;
use equilux_common::ids::{Attempt, JobId, UnitId};

/// Credit of the units that are not committed, added up from everywhere.
///
/// Each unit's credit of its current attempt must be whole: more would end the job early, less
/// never.
#[derive(Debug)]
pub struct CreditCheck {
    /// By unit; none for committed ones.
    units: Vec<Option<(Attempt, Credit)>>,
}

impl CreditCheck {
    /// Expects the credit of these units, of so many in all.
    #[must_use]
    pub fn new(unit_count: u32, uncommitted: impl Iterator<Item = (UnitId, Attempt)>) -> Self {
        let mut units = vec![None; unit_count as usize];
        for (unit, attempt) in uncommitted {
            units[unit.0 as usize] = Some((attempt, Credit::zero()));
        }
        Self { units }
    }

    /// Adds a share that was found somewhere.
    ///
    /// # Panics
    /// If there is more credit than there can be.
    pub fn add(&mut self, unit: UnitId, attempt: Attempt, credit: &Credit) {
        match &mut self.units[unit.0 as usize] {
            Some((current, sum)) if *current == attempt => {
                sum.merge(credit).unwrap_or_else(|error| panic!("{unit}, {attempt}: {error}"));
            }
            Some((current, _)) => assert!(attempt < *current, "{unit}: nobody began {attempt}"),
            None => {}
        }
    }

    /// Makes sure that nothing is missing.
    ///
    /// # Panics
    /// If credit is missing.
    pub fn finish(&self, job: JobId) {
        for (index, unit) in self.units.iter().enumerate() {
            if let Some((attempt, sum)) = unit {
                assert!(sum.is_whole(), "{job}, unit {index}, {attempt}: only {sum:?} is left");
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[should_panic(expected = "only Credit(2^-1) is left")]
    fn a_lost_share_shows() {
        let mut check = CreditCheck::new(2, [(UnitId(1), Attempt(3))].into_iter());
        check.add(UnitId(1), Attempt(3), &Credit::whole().split(2));
        check.add(UnitId(1), Attempt(2), &Credit::whole());
        check.finish(JobId(1));
    }
}
