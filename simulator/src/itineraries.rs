//! The itinerary tracer: paths that visit the partitions that paths of a real render visited, and
//! take the time that was measured of it.
//!
//! Of each cell of the recorded image some paths are known stay by stay
//! ([`equilux_common::itinerary`]). A simulated path is one of its cell's, by a hash of its pixel
//! and its sample, and its rays name the stay that is next. A stay takes its part, by the visits of
//! rays in it, of what the paths of its cell take on average. Like the real tracer, a thread goes
//! on as far as partitions are in memory, and hands back what needs another one.

use std::time::Duration;

use bytemuck::Zeroable;
use equilux_common::bundle::Share;
use equilux_common::costs::SceneCosts;
use equilux_common::ids::PartitionId;
use equilux_common::itinerary::{Itinerary, PartitionedCosts, Stay, weight};
use equilux_common::job::Settings;
use equilux_common::ray::Ray;
use equilux_common::unit::Unit;
use equilux_common::work::{Samples, Work};

use crate::cells::{CellGrid, rows};
use crate::random::mix;
use crate::trace::{Trace, limit_nanos};
use crate::tracer::{Task, Traced, Tracer};

/// Traces by the itineraries and the costs of a recorded store.
#[derive(Debug)]
pub struct ItineraryTracer {
    seed: u64,
    grid: CellGrid,
    cells: Vec<Vec<Path>>,
}

/// A recorded path.
#[derive(Debug)]
struct Path {
    /// What the camera's ray takes until it sets out.
    camera_nanos: u64,
    stays: Vec<Step>,
}

/// A stay.
#[derive(Clone, Copy, Debug)]
struct Step {
    stay: Stay,
    nanos: u64,
    /// How many stays follow from this one, and from those.
    progeny: u32,
}

impl ItineraryTracer {
    /// Traces images of these settings; `factor` scales all costs.
    #[must_use]
    pub fn new(
        seed: u64,
        costs: &SceneCosts,
        partitioned: &PartitionedCosts,
        settings: &Settings,
        factor: f64,
    ) -> Self {
        let cells = costs.cells.iter().zip(&partitioned.itineraries);
        let cells = cells.map(|(cell, itineraries)| {
            let weights = itineraries.iter().map(|path| weight(path, partitioned.shadow_weight));
            let mean = weights.sum::<f64>() / itineraries.len() as f64;
            let nanos = cell.path_nanos() * factor / mean;
            let path = |path| Path::new(path, partitioned.shadow_weight, nanos);
            itineraries.iter().map(path).collect()
        });
        Self { seed, cells: cells.collect(), grid: CellGrid::new(costs, settings) }
    }

    fn path(&self, pixel: u32, sample_index: u32, image_width: u32) -> &Path {
        let cell = self.grid.cell(pixel % image_width, pixel / image_width);
        let name = u64::from(pixel) << 32 | u64::from(sample_index);
        let paths = &self.cells[cell];
        &paths[(mix(self.seed ^ mix(name)) % paths.len() as u64) as usize]
    }
}

impl Path {
    /// A path whose visits of rays that are no shadow rays take so long.
    fn new(itinerary: &Itinerary, shadow_weight: f64, nanos: f64) -> Self {
        let mut stays: Vec<Step> = Vec::new();
        // What follows a stay comes after it, so its progeny are known before.
        let mut heirs: Vec<u32> = Vec::new();
        for &stay in itinerary.iter().rev() {
            let followers = heirs.len() - stay.follower_count as usize..;
            let progeny = heirs.drain(followers).map(|heir| heir + 1).sum();
            let nanos = (stay.weight(shadow_weight) * nanos).round() as u64;
            stays.push(Step { stay, nanos: nanos.max(1), progeny });
            heirs.push(progeny);
        }
        stays.reverse();
        Self { camera_nanos: (nanos.round() as u64).max(1), stays }
    }
}

impl Tracer for ItineraryTracer {
    fn trace(&self, task: &Task, work: Work, limit: Option<Duration>) -> Traced {
        let trace = Trace::new(work.shares());
        let mut piece = Journey { tracer: self, task, trace, limit: limit_nanos(limit) };
        match work {
            Work::Samples(samples) => piece.begin(&samples),
            Work::Rays(bundle) => bundle.rays.into_iter().for_each(|ray| piece.go_on(ray)),
        }
        piece.trace.finish()
    }
}

/// One piece being traced.
struct Journey<'a> {
    tracer: &'a ItineraryTracer,
    task: &'a Task,
    trace: Trace,
    limit: u64,
}

impl Journey<'_> {
    /// Traces samples. As in the real tracer, all of them are begun.
    fn begin(&mut self, samples: &Samples) {
        let (tracer, width) = (self.tracer, self.task.grid.image_width());
        let unit = self.unit(&samples.share);
        let end = samples.first_path + samples.path_count;
        self.trace.counts.camera += u64::from(samples.path_count);
        for number in samples.first_path..end {
            let (x, y, sample_index) = unit.path(number);
            let pixel = x + y * width;
            let rows = rows(&unit, samples.first_path, end);
            let sums = self.trace.sums(0, rows);
            sums.add_sample(sums.tile.index_of(x, y), sample_index);
            let path = tracer.path(pixel, sample_index, width);
            self.trace.nanos += path.camera_nanos;
            if path.stays.is_empty() {
                self.trace.counts.retired += 1;
            } else {
                self.follow(path, Ray { pixel, sample_index, ..Ray::zeroed() });
            }
        }
    }

    /// Traces a ray in the middle of its path.
    fn go_on(&mut self, ray: Ray) {
        let path = self.tracer.path(ray.pixel, ray.sample_index, self.task.grid.image_width());
        self.follow(path, ray);
    }

    /// Follows a ray and all that it spawns as far as partitions are in memory, until the limit.
    fn follow(&mut self, path: &Path, ray: Ray) {
        let mut waiting = vec![ray];
        while let Some(ray) = waiting.pop() {
            let Step { stay, nanos, .. } = path.stays[ray.branch as usize];
            let partition = PartitionId(stay.partition);
            if self.trace.nanos >= self.limit || !self.task.resident.contains(&partition) {
                self.trace.give_up(partition, stay.stage, ray);
                continue;
            }
            self.trace.nanos += nanos;
            self.trace.counts.indirect += u64::from(stay.onward);
            self.trace.counts.shadow += u64::from(stay.shadow);
            let ended = stay.ray_count() - u64::from(stay.follower_count);
            self.trace.counts.retired += ended;
            if ended > 0 {
                self.shine(&ray);
            }
            let mut next = ray.branch + 1;
            for _ in 0..stay.follower_count {
                waiting.push(Ray { branch: next, depth: ray.depth.saturating_add(1), ..ray });
                next += 1 + path.stays[next as usize].progeny;
            }
        }
    }

    /// The light of a ray that ends touches its pixel.
    fn shine(&mut self, ray: &Ray) {
        let width = self.task.grid.image_width();
        let tile = self.unit(self.trace.share(ray)).tile;
        let sums = self.trace.sums(ray.share.into(), tile);
        let index = sums.tile.index_of(ray.pixel % width, ray.pixel / width);
        sums.pixels[index].even[0] += 1;
    }

    fn unit(&self, share: &Share) -> Unit {
        self.task.grid.unit(share.unit).expect("a unit of this job")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    use equilux_common::bundle::Stage;
    use equilux_common::credit::Credit;
    use equilux_common::ids::{Attempt, UnitId};
    use equilux_common::itinerary::PartitionCosts;
    use equilux_common::work::RayCounts;
    use proptest::prelude::*;

    const PARTITIONS: u32 = 3;

    fn stay(partition: u32, stage: Stage, onward: u32, shadow: u32, follower_count: u32) -> Stay {
        Stay { partition, stage, onward, shadow, follower_count }
    }

    /// A path that branches, one that goes straight on, and one that meets nothing.
    fn itineraries() -> Vec<Itinerary> {
        let (intersect, shade, shadow) = (Stage::Intersect, Stage::Shade, Stage::Shadow);
        let branching = vec![
            stay(0, intersect, 2, 1, 3),
            stay(2, intersect, 0, 1, 1),
            stay(1, shadow, 0, 0, 0),
            stay(1, shade, 1, 0, 0),
            stay(2, shadow, 0, 0, 0),
        ];
        let straight = vec![stay(1, intersect, 0, 0, 1), stay(0, intersect, 0, 0, 0)];
        vec![branching, straight, Vec::new()]
    }

    fn costs() -> SceneCosts {
        let costs = crate::scenario::tests::costs();
        let partition = PartitionCosts { memory_bytes: 1000, position: [0.0; 3] };
        let partitioned = PartitionedCosts {
            partitions: vec![partition; PARTITIONS as usize],
            ties: Vec::new(),
            shadow_weight: 0.5,
            itineraries: vec![itineraries(); costs.cells.len()],
        };
        SceneCosts { partitioned: Some(partitioned), ..costs }
    }

    fn task(resident: u32) -> Task {
        let spec = crate::scenario::spec(40, 30, 8, 1);
        let resident = (0..PARTITIONS).filter(|number| resident >> number & 1 == 1);
        Task { grid: spec.grid(), spec, resident: resident.map(PartitionId).collect() }
    }

    fn tracer() -> ItineraryTracer {
        let (costs, spec) = (costs(), task(0).spec);
        let partitioned = costs.partitioned.as_ref().expect("it is cut");
        ItineraryTracer::new(7, &costs, partitioned, &spec.settings, 1.0)
    }

    fn whole_unit(task: &Task, unit: u32) -> Work {
        let share = Share { unit: UnitId(unit), attempt: Attempt(0), credit: Credit::whole() };
        let path_count = task.grid.unit(UnitId(unit)).expect("a unit").path_count();
        Work::Samples(Samples { share, first_path: 0, path_count })
    }

    proptest! {
        #[test]
        fn what_is_in_memory_when_changes_neither_cost_nor_rays_nor_credit(
            unit in 0u32..6, resident in prop::collection::vec(0u32..8, 0..12),
            limits in prop::collection::vec(prop::option::of(0u64..400_000), 0..12),
        ) {
            let (tracer, all) = (tracer(), task(7));
            let undisturbed = tracer.trace(&all, whole_unit(&all, unit), None);
            prop_assert!(undisturbed.outcome.successors.is_empty());
            let (mut resident, mut limits) = (resident.into_iter(), limits.into_iter());
            let mut pending = vec![whole_unit(&all, unit)];
            let (mut credit, mut elapsed) = (Credit::zero(), Duration::ZERO);
            let mut counts = RayCounts::default();
            while let Some(work) = pending.pop() {
                let here = task(resident.next().unwrap_or(7));
                let limit = limits.next().flatten().map(Duration::from_nanos);
                let traced = tracer.trace(&here, work, limit);
                elapsed += traced.elapsed;
                counts.add(&traced.outcome.counts);
                for (share, _) in traced.outcome.retired {
                    credit.merge(&share.credit).expect("at most the whole");
                }
                let places: BTreeSet<_> =
                    traced.outcome.successors.iter().map(|rays| rays.partition).collect();
                let is_away = |partition| !here.resident.contains(partition);
                prop_assert!(limit.is_some() || places.iter().all(is_away), "{places:?}");
                pending.extend(traced.outcome.successors.into_iter().map(Work::Rays));
            }
            prop_assert!(credit.is_whole());
            prop_assert_eq!(elapsed, undisturbed.elapsed);
            prop_assert_eq!(counts, undisturbed.outcome.counts);
            prop_assert_eq!(counts.retired, counts.spawned());
        }
    }

    #[test]
    fn the_mean_cost_of_paths_is_what_was_recorded() {
        let (tracer, task) = (tracer(), task(7));
        let units = (0..task.grid.unit_count()).map(|unit| whole_unit(&task, unit));
        let total: Duration = units.map(|unit| tracer.trace(&task, unit, None).elapsed).sum();
        let expected = crate::cells::pass_cost(&costs(), 40, 30) * 8;
        let ratio = total.as_secs_f64() / expected.as_secs_f64();
        assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
    }
}
