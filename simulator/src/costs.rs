//! The cost tracer: paths that take the time that was measured of a real render, without light.
//!
//! Each pixel lies in a cell of the recorded image, which knows how many rays of each depth its
//! paths have and what they take. A path's last depth is drawn by a hash of its pixel and its
//! sample, with the odds of its cell; so a path has the same length wherever it is traced, and the
//! mean over paths is what was recorded. Where rays become more with depth, the rays of a path are
//! one chain all the same, whose links cost as much as all of them.

use std::time::Duration;

use bytemuck::Zeroable;
use equilux_common::bundle::{Share, Stage};
use equilux_common::costs::{CellCosts, SceneCosts};
use equilux_common::film::TileSums;
use equilux_common::job::Settings;
use equilux_common::ray::Ray;
use equilux_common::unit::Unit;
use equilux_common::work::{Samples, Work};

use crate::cells::{CellGrid, rows};
use crate::random::mix;
use crate::trace::{Trace, WHOLE_MODEL, limit_nanos};
use crate::tracer::{Task, Traced, Tracer};

/// Traces by a recorded scene's costs.
#[derive(Debug)]
pub struct CostTracer {
    seed: u64,
    grid: CellGrid,
    cells: Vec<Cell>,
}

/// The paths of a cell.
#[derive(Clone, Debug)]
struct Cell {
    /// By depth: a path goes at least as deep if its 32 random bits are fewer.
    reach: Vec<u64>,
    /// Nanoseconds of a path before each depth; one more than there are depths.
    before: Vec<u64>,
}

impl CostTracer {
    /// Traces images of these settings; `factor` scales all costs.
    #[must_use]
    pub fn new(seed: u64, costs: &SceneCosts, settings: &Settings, factor: f64) -> Self {
        let cells = costs.cells.iter().map(|cell| Cell::new(cell, factor)).collect();
        Self { seed, cells, grid: CellGrid::new(costs, settings) }
    }

    fn cell(&self, x: u32, y: u32) -> &Cell {
        &self.cells[self.grid.cell(x, y)]
    }

    /// The depth of a path's last ray.
    fn last_depth(&self, cell: &Cell, pixel: u32, sample_index: u32) -> usize {
        let name = u64::from(pixel) << 32 | u64::from(sample_index);
        let bits = mix(self.seed ^ mix(name)) >> 32;
        cell.reach.iter().skip(1).take_while(|&&reach| bits < reach).count()
    }
}

impl Cell {
    fn new(costs: &CellCosts, factor: f64) -> Self {
        let rays: Vec<f64> = costs.rays_per_path.iter().map(|&rays| rays.into()).collect();
        let (mut odds, mut reach) = (1.0, vec![1 << 32]);
        let (mut spent, mut before) = (0.0, vec![0]);
        for (depth, &nanos) in costs.nanos_per_ray.iter().enumerate() {
            if depth > 0 {
                let survival =
                    if rays[depth - 1] > 0.0 { rays[depth] / rays[depth - 1] } else { 0.0 };
                odds *= survival.min(1.0);
                reach.push((odds * (1_u64 << 32) as f64) as u64);
            }
            if odds > 0.0 {
                spent += f64::from(nanos) * rays[depth] / odds * factor;
            }
            before.push(spent.round() as u64);
        }
        Self { reach, before }
    }
}

impl Tracer for CostTracer {
    fn trace(&self, task: &Task, work: Work, limit: Option<Duration>) -> Traced {
        let trace = Trace::new(work.shares());
        let mut piece = Chains { tracer: self, task, trace, limit: limit_nanos(limit) };
        match work {
            Work::Samples(samples) => piece.begin(&samples),
            Work::Rays(bundle) => bundle.rays.into_iter().for_each(|ray| piece.go_on(ray)),
        }
        piece.trace.finish()
    }
}

/// One piece being traced.
struct Chains<'a> {
    tracer: &'a CostTracer,
    task: &'a Task,
    trace: Trace,
    limit: u64,
}

impl Chains<'_> {
    /// Traces samples, pixel by pixel.
    fn begin(&mut self, samples: &Samples) {
        let unit = self.unit(&samples.share);
        let end = samples.first_path + samples.path_count;
        self.trace.counts.camera += u64::from(samples.path_count);
        let mut path = samples.first_path;
        while path < end {
            let (x, y, first_sample) = unit.path(path);
            let left = unit.sample_count - path % unit.sample_count;
            let count = left.min(end - path);
            let begun = self.trace_pixel(x, y, first_sample..first_sample + count);
            if begun > 0 {
                let sums = self.trace.sums(0, rows(&unit, samples.first_path, end));
                let index = sums.tile.index_of(x, y);
                add_samples(sums, index, first_sample, begun);
            }
            path += count;
        }
    }

    /// Traces samples of one pixel; says how many had been begun when the interrupt came.
    fn trace_pixel(&mut self, x: u32, y: u32, samples: std::ops::Range<u32>) -> u32 {
        let tracer = self.tracer;
        let (cell, pixel) = (tracer.cell(x, y), x + y * self.task.grid.image_width());
        let mut begun = 0;
        for sample_index in samples {
            begun += u32::from(self.trace.nanos < self.limit);
            let last = tracer.last_depth(cell, pixel, sample_index);
            self.follow(cell, Ray { pixel, sample_index, ..Ray::zeroed() }, last);
        }
        begun
    }

    /// Traces a ray in the middle of its path.
    fn go_on(&mut self, ray: Ray) {
        let tracer = self.tracer;
        let width = self.task.grid.image_width();
        let (x, y) = (ray.pixel % width, ray.pixel / width);
        let cell = tracer.cell(x, y);
        if self.trace.nanos < self.limit {
            let tile = self.unit(self.trace.share(&ray)).tile;
            let sums = self.trace.sums(ray.share.into(), tile);
            let index = tile.index_of(x, y);
            if ray.depth == 0 {
                sums.add_sample(index, ray.sample_index);
            } else {
                // The light that the rest of a path brings touches its pixel too.
                sums.pixels[index].even[0] += 1;
            }
        }
        self.follow(cell, ray, tracer.last_depth(cell, ray.pixel, ray.sample_index));
    }

    /// Follows a ray to the last depth of its path, or until the limit.
    fn follow(&mut self, cell: &Cell, mut ray: Ray, last: usize) {
        let trace = &mut self.trace;
        let depth = usize::from(ray.depth);
        let start = trace.nanos;
        let cost = cell.before[last + 1] - cell.before[depth];
        let links = (last - depth) as u64;
        if start.saturating_add(cost) <= self.limit {
            trace.nanos += cost;
            trace.counts.indirect += links;
            trace.counts.retired += links + 1;
            return;
        }
        let is_begun = |&depth_next: &usize| {
            start + (cell.before[depth_next] - cell.before[depth]) < self.limit
        };
        let ended = (depth..=last).take_while(is_begun).count();
        trace.nanos += cell.before[depth + ended] - cell.before[depth];
        trace.counts.retired += ended as u64;
        trace.counts.indirect += (ended as u64).min(links);
        if depth + ended <= last {
            ray.depth += u16::try_from(ended).expect("paths are short");
            trace.give_up(WHOLE_MODEL, Stage::Intersect, ray);
        }
    }

    fn unit(&self, share: &Share) -> Unit {
        self.task.grid.unit(share.unit).expect("a unit of this job")
    }
}

/// Counts consecutive camera samples of a pixel.
fn add_samples(sums: &mut TileSums, index: usize, first_sample: u32, count: u32) {
    let even = i64::from((first_sample + count).div_ceil(2) - first_sample.div_ceil(2));
    sums.pixels[index].even_samples += even;
    sums.pixels[index].odd_samples += i64::from(count) - even;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cells::pass_cost;
    use crate::scenario::tests::costs;
    use equilux_common::credit::Credit;
    use equilux_common::ids::{Attempt, UnitId};
    use proptest::prelude::*;

    fn task() -> Task {
        let spec = crate::scenario::spec(40, 30, 8, 1);
        Task { grid: spec.grid(), spec, resident: std::collections::BTreeSet::new() }
    }

    fn tracer(task: &Task) -> CostTracer {
        CostTracer::new(7, &costs(), &task.spec.settings, 1.0)
    }

    fn whole_unit(task: &Task, unit: u32) -> Work {
        let share = Share { unit: UnitId(unit), attempt: Attempt(0), credit: Credit::whole() };
        let path_count = task.grid.unit(UnitId(unit)).expect("a unit").path_count();
        Work::Samples(Samples { share, first_path: 0, path_count })
    }

    proptest! {
        #[test]
        fn interrupts_change_neither_cost_nor_samples_nor_credit(
            unit in 0u32..6, limits in prop::collection::vec(0u64..400_000, 0..8),
        ) {
            let task = task();
            let tracer = tracer(&task);
            let undisturbed = tracer.trace(&task, whole_unit(&task, unit), None);
            let mut limits = limits.into_iter().map(Duration::from_nanos);
            let mut pending = vec![whole_unit(&task, unit)];
            let (mut credit, mut elapsed) = (Credit::zero(), Duration::ZERO);
            let mut counts = equilux_common::work::RayCounts::default();
            let mut sums = TileSums::new(task.grid.unit(UnitId(unit)).expect("a unit").tile);
            while let Some(work) = pending.pop() {
                let traced = tracer.trace(&task, work, limits.next());
                elapsed += traced.elapsed;
                counts.add(&traced.outcome.counts);
                for (share, part) in traced.outcome.retired {
                    credit.merge(&share.credit).expect("at most the whole");
                    sums.merge(&part);
                }
                pending.extend(traced.outcome.successors.into_iter().map(Work::Rays));
            }
            prop_assert!(credit.is_whole());
            prop_assert_eq!(elapsed, undisturbed.elapsed);
            prop_assert_eq!(counts, undisturbed.outcome.counts);
            prop_assert_eq!(counts.retired, counts.spawned());
            let expected = &undisturbed.outcome.retired[0].1;
            for (sum, whole) in sums.pixels.iter().zip(&expected.pixels) {
                prop_assert_eq!(sum.even_samples, whole.even_samples);
                prop_assert_eq!(sum.odd_samples, whole.odd_samples);
            }
        }
    }

    #[test]
    fn the_mean_cost_of_paths_is_what_was_recorded() {
        let task = task();
        let tracer = tracer(&task);
        let units = (0..task.grid.unit_count()).map(|unit| whole_unit(&task, unit));
        let total: Duration = units.map(|unit| tracer.trace(&task, unit, None).elapsed).sum();
        let expected = pass_cost(&costs(), 40, 30) * 8;
        let ratio = total.as_secs_f64() / expected.as_secs_f64();
        assert!((ratio - 1.0).abs() < 0.03, "{ratio}");
    }
}
