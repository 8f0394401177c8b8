//! Times one piece of work while it is traced, bundle by bundle.
//!
//! Bundles follow one another on a thread, so the time between two looks at the clock is that of
//! the later bundle; its rays bear it in equal parts. What remains when the piece is handed back
//! goes to the camera rays of the cell that was dealt with last.

use std::time::Duration;

use equilux_common::bundle::Stage;
use equilux_common::ray::Ray;
use equilux_render::observer::Observer;

use super::table::{Cells, CostTable};

/// Runs from its start until it is stopped.
pub(super) struct Stopwatch<'a, C> {
    cells: &'a Cells,
    /// Time since any fixed moment; never goes back.
    clock: C,
    lap_start: Duration,
    last_cell: Option<u32>,
    table: CostTable,
}

impl<'a, C: FnMut() -> Duration> Stopwatch<'a, C> {
    /// From here on, time is counted.
    pub(super) fn start(cells: &'a Cells, mut clock: C) -> Self {
        let lap_start = clock();
        Self { cells, clock, lap_start, last_cell: None, table: CostTable::default() }
    }

    /// The piece is done.
    pub(super) fn stop(mut self) -> CostTable {
        let rest = self.lap();
        if let Some(cell) = self.last_cell {
            self.table.add(cell, 0, 0, rest);
        }
        self.table
    }

    /// Nanoseconds since the last lap.
    fn lap(&mut self) -> f64 {
        let now = (self.clock)();
        let lap = now.saturating_sub(std::mem::replace(&mut self.lap_start, now));
        lap.as_nanos() as f64
    }

    /// These rays bear the lap; whether they are counted as well. Gives the lap.
    fn charge(&mut self, rays: &[Ray], is_counted: bool) -> f64 {
        let lap = self.lap();
        let nanos_per_ray = lap / rays.len() as f64;
        for run in rays.chunk_by(|a, b| (a.pixel, a.depth) == (b.pixel, b.depth)) {
            let cell = self.cells.of_pixel(run[0].pixel);
            let count = if is_counted { run.len() as u64 } else { 0 };
            self.table.add(cell, run[0].depth, count, nanos_per_ray * run.len() as f64);
            self.last_cell = Some(cell);
        }
        lap
    }
}

impl<C: FnMut() -> Duration> Observer for Stopwatch<'_, C> {
    fn started(&mut self, rays: &[Ray]) {
        self.charge(rays, false);
    }

    /// A ray counts when it is cast, which comes about once; shadow rays do not.
    fn advanced(&mut self, stage: Stage, rays: &[Ray]) {
        let lap = self.charge(rays, stage == Stage::Intersect);
        if stage == Stage::Shadow && !rays.is_empty() {
            self.table.add_shadow(lap);
        }
    }
}
