//! The film as the coordinator's driver would keep it, and which units it holds.

use std::collections::BTreeSet;

use equilux_common::film::TileSums;
use equilux_common::ids::UnitId;

use crate::tracer::Task;

/// What was committed of a job.
#[derive(Clone, Debug)]
pub struct Film {
    /// The pixels of the job's region.
    pub sums: TileSums,
    units: BTreeSet<UnitId>,
    unit_count: u32,
}

impl Film {
    /// Nothing has been committed yet.
    #[must_use]
    pub fn new(task: &Task) -> Self {
        let sums = TileSums::new(task.spec.settings.region());
        Self { sums, units: BTreeSet::new(), unit_count: task.grid.unit_count() }
    }

    /// Adds a unit.
    ///
    /// # Panics
    /// If the unit was committed before.
    pub fn commit(&mut self, unit: UnitId, sums: &TileSums) {
        assert!(self.units.insert(unit), "{unit} was committed twice");
        self.sums.merge(sums);
    }

    /// Whether every unit was committed.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.units.len() == self.unit_count as usize
    }
}
