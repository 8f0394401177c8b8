//! The queue: work that waits for a compute thread of this worker.
//!
//! Work is done in the order that keeps the queue short: rays in the middle of their paths first,
//! the deepest bundles before all others; then what is left of units that were begun; then new
//! units, pass by pass over the image (all tiles of the first sample numbers, then all of the next)
//! and along the curve within a pass. Work is given away from the other end, since units that
//! nobody has begun are the cheapest to move; or, by a setting, as rays from this end.
//!
//! Of a model that is cut into partitions, only rays whose partition is in memory can be traced;
//! they are taken from one partition's pile until it is empty, then from the fullest.

mod piles;
mod stock;

use std::collections::BTreeSet;

use equilux_common::balancing::GiveFirst;
use equilux_common::bundle::{BUNDLE_RAYS_MAX, Bundle, Share};
use equilux_common::credit::Credit;
use equilux_common::ids::{Attempt, PartitionId, UnitId};
use equilux_common::unit::{Rect, UnitGrid};
use equilux_common::work::{Samples, Work};

use crate::cost::{Kind, Regions};
use crate::queue::piles::Piles;
use crate::queue::stock::Stock;
use crate::residency::Residency;

/// Most camera paths that are traced as one piece: enough to fill bundles.
const PIECE_PATHS_MAX: u64 = 1024;

/// Most camera paths of a piece of a region that has not been measured: they tell what its paths
/// cost, and if that is much, not too much has been handed out.
const PROBE_PATHS: u64 = 16;

/// And while nothing at all has been measured.
const FIRST_PROBE_PATHS: u64 = 4;

/// Most shares of a piece that is joined from bundles: each needs a tile of film values while it is
/// traced.
const PIECE_SHARES_MAX: usize = 64;

/// Most rays that are traced as one piece.
const PIECE_RAYS_MAX: u64 = 1024;

/// Fewest paths or rays that something is split for: credit is not cut finer.
const PIECE_MIN: u64 = 4;

/// Unless they would take longer than this: dear ones are worth their credit and their message one
/// by one.
const PIECE_NANOS_MAX: u64 = 4_000_000;

/// Work that leaves the queue for a peer.
#[derive(Debug)]
pub(crate) struct Gift {
    /// The work.
    pub(crate) work: Work,
    /// All of the unit's credit, if the unit was begun just for this.
    pub(crate) begun: Option<Share>,
}

/// Work that waits, in order.
#[derive(Debug)]
pub(crate) struct Queue {
    grid: UnitGrid,
    regions: Regions,
    /// Whole units that nobody has begun: pass, position on the curve.
    fresh: BTreeSet<(u32, UnitId, Attempt)>,
    /// Ranges of units that were begun; the last one is next.
    started: Vec<Samples>,
    piles: Piles,
    /// The pile that rays are taken from.
    current: PartitionId,
    /// Whether rays wait for partitions, so that a piece is a step on the way of its rays instead
    /// of all the rest of it.
    is_partitioned: bool,
    stock: Stock,
}

impl Queue {
    /// Nothing waits yet of the job that is cut by `grid` and renders these pixels.
    pub(crate) fn new(grid: UnitGrid, pixels: Rect) -> Self {
        Self {
            grid,
            regions: Regions::new(pixels),
            fresh: BTreeSet::new(),
            started: Vec::new(),
            piles: Piles::default(),
            current: PartitionId(0),
            is_partitioned: false,
            stock: Stock::default(),
        }
    }

    /// The units of the job.
    pub(crate) const fn grid(&self) -> &UnitGrid {
        &self.grid
    }

    /// Whether nothing waits.
    pub(crate) fn is_empty(&self) -> bool {
        self.stock.is_empty()
    }

    /// How much waits, and what it costs.
    pub(crate) const fn stock(&self) -> &Stock {
        &self.stock
    }

    /// To be told what was measured.
    pub(crate) const fn stock_mut(&mut self) -> &mut Stock {
        &mut self.stock
    }

    /// Rays that wait.
    pub(crate) const fn ray_count(&self) -> u64 {
        self.piles.ray_count()
    }

    /// Rays that wait for a partition.
    pub(crate) fn rays_at(&self, partition: PartitionId) -> u64 {
        self.piles.rays_at(partition)
    }

    /// The model turns out to be cut into partitions.
    pub(crate) fn be_partitioned(&mut self) {
        self.is_partitioned = true;
        self.recount();
    }

    /// Of what kind work is, and how many paths or rays.
    pub(crate) fn kind(&self, work: &Work) -> (Kind, u64) {
        match work {
            Work::Samples(samples) => {
                (self.kind_of_paths(samples.share.unit), u64::from(samples.path_count))
            }
            Work::Rays(bundle) => (self.kind_of_rays(bundle), bundle.rays.len() as u64),
        }
    }

    /// A whole unit came in; nothing happens if it does not exist.
    pub(crate) fn push_unit(&mut self, unit: UnitId, attempt: Attempt) {
        if let Some(unit) = self.grid.unit(unit)
            && self.fresh.insert((unit.first_sample, unit.id, attempt))
        {
            self.stock.add(self.kind_of_paths(unit.id), u64::from(unit.path_count()));
        }
    }

    /// Whether a unit waits whole.
    pub(crate) fn has_unit(&self, unit: UnitId, attempt: Attempt) -> bool {
        let pass = self.grid.unit(unit).map_or(0, |unit| unit.first_sample);
        self.fresh.contains(&(pass, unit, attempt))
    }

    /// Part of a unit came in.
    pub(crate) fn push_samples(&mut self, samples: Samples) {
        let kind = self.kind_of_paths(samples.share.unit);
        self.stock.add(kind, u64::from(samples.path_count));
        self.started.push(samples);
    }

    /// Rays came in.
    pub(crate) fn push_bundle(&mut self, bundle: Bundle) {
        self.stock.add(self.kind_of_rays(&bundle), bundle.rays.len() as u64);
        self.piles.push(bundle);
    }

    /// The partition that most rays wait for, among some, and the nanoseconds that they take a
    /// thread.
    pub(crate) fn fullest(
        &self,
        is_among: impl Fn(PartitionId) -> bool,
    ) -> Option<(PartitionId, u64)> {
        let fullest = self.piles.fullest(is_among)?;
        Some((fullest, self.rays_at(fullest).saturating_mul(self.ray_nanos(fullest)?)))
    }

    /// Takes out all rays of a partition.
    pub(crate) fn take_rays_of(&mut self, partition: PartitionId) -> Vec<Bundle> {
        std::iter::from_fn(|| self.take_bundle(partition)).collect()
    }

    /// Takes out all rays.
    pub(crate) fn take_all_rays(&mut self) -> Vec<Bundle> {
        let bundles: Vec<Bundle> = self.piles.take_all().collect();
        self.recount();
        bundles
    }

    /// The next piece to trace among rays, of about `grain` nanoseconds.
    pub(crate) fn pop_rays(&mut self, grain: u64, residency: &Residency) -> Option<Bundle> {
        let is_current = self.rays_at(self.current) > 0 && residency.is_here(self.current);
        if !is_current {
            self.current = self.piles.fullest(|partition| residency.is_here(partition))?;
        }
        let nanos = self.ray_nanos(self.current)?;
        let rays_max = (grain / nanos).clamp(piece_min(nanos), PIECE_RAYS_MAX);
        self.take_rays(self.current, rays_max)
    }

    /// The next piece to trace among units that were begun.
    pub(crate) fn pop_samples(&mut self, grain: u64) -> Option<Samples> {
        let unit = self.started.last()?.share.unit;
        let nanos = self.path_nanos(unit);
        let paths_max = (grain / nanos).clamp(piece_min(nanos), self.piece_max(unit));
        self.pop_started(paths_max)
    }

    /// Whether paths of units that are under way wait to be begun.
    pub(crate) fn has_begun(&self) -> bool {
        !self.started.is_empty()
    }

    /// How many paths wait to be begun.
    pub(crate) fn path_count(&self) -> u64 {
        self.stock.path_count()
    }

    /// Whether paths wait to be begun.
    pub(crate) fn has_paths(&self) -> bool {
        !self.started.is_empty() || !self.fresh.is_empty()
    }

    /// Begins the unit that is next; gives its share, all of the unit's credit.
    pub(crate) fn begin_first(&mut self) -> Option<Share> {
        let (_, unit, attempt) = self.fresh.pop_first()?;
        Some(self.begin(unit, attempt))
    }

    /// Something to give away, of about `budget` nanoseconds of one thread; if it is not split as
    /// finely, of no more than `most`.
    pub(crate) fn pop_gift(&mut self, budget: u64, most: u64, first: GiveFirst) -> Option<Gift> {
        let samples = |queue: &mut Self| queue.give_samples(budget, most);
        let rays = |queue: &mut Self| {
            let fullest = queue.piles.fullest(|_| true)?;
            queue.give_rays(fullest, budget, most)
        };
        match first {
            GiveFirst::Samples => samples(self).or_else(|| rays(self)),
            GiveFirst::Rays => rays(self).or_else(|| samples(self)),
        }
    }

    /// Drops what `keep` refuses; says how many rays went.
    pub(crate) fn retain(&mut self, keep: impl Fn(&Share) -> bool) -> u64 {
        self.fresh
            .retain(|&(_, unit, attempt)| keep(&Share { unit, attempt, credit: Credit::whole() }));
        self.started.retain(|samples| keep(&samples.share));
        let dropped = self.piles.retain(keep);
        self.recount();
        dropped
    }

    /// Shows the units that wait whole.
    pub(crate) fn for_each_unit(&self, mut visit: impl FnMut(UnitId, Attempt)) {
        for &(_, unit, attempt) in &self.fresh {
            visit(unit, attempt);
        }
    }

    /// A unit that nobody has begun, from the end; else part of a range.
    pub(crate) fn give_samples(&mut self, budget: u64, most: u64) -> Option<Gift> {
        let last = self.fresh.last().map(|&(_, unit, _)| unit);
        let goes_whole = last.is_some_and(|unit| {
            u64::from(self.paths_of(unit)).saturating_mul(self.path_nanos(unit)) <= budget
        });
        let largest = self.largest_started();
        let next =
            if goes_whole { last } else { largest.map(|index| self.started[index].share.unit) };
        let paths = split(budget, most, self.path_nanos(next.or(last)?))?;
        let begun = if goes_whole || next.is_none() { self.begin_last() } else { None };
        let index = if begun.is_some() { self.started.len() - 1 } else { largest? };
        let work = Work::Samples(self.take_started(index, paths));
        Some(Gift { work, begun })
    }

    /// The rays of a partition that are closest to the end of their paths.
    pub(crate) fn give_rays(
        &mut self,
        partition: PartitionId,
        budget: u64,
        most: u64,
    ) -> Option<Gift> {
        let rays_max = split(budget, most, self.ray_nanos(partition)?)?;
        let bundle = self.take_rays(partition, rays_max.min(BUNDLE_RAYS_MAX as u64))?;
        Some(Gift { work: Work::Rays(bundle), begun: None })
    }

    /// The range of a unit that would take longest.
    fn largest_started(&self) -> Option<usize> {
        let nanos = |range: &Samples| {
            u64::from(range.path_count).saturating_mul(self.path_nanos(range.share.unit))
        };
        (0..self.started.len()).max_by_key(|&index| nanos(&self.started[index]))
    }

    fn begin_last(&mut self) -> Option<Share> {
        let (_, unit, attempt) = self.fresh.pop_last()?;
        Some(self.begin(unit, attempt))
    }

    fn begin(&mut self, unit: UnitId, attempt: Attempt) -> Share {
        let path_count = self.paths_of(unit);
        let share = Share { unit, attempt, credit: Credit::whole() };
        self.started.push(Samples { share: share.clone(), first_path: 0, path_count });
        share
    }

    fn kind_of_paths(&self, unit: UnitId) -> Kind {
        let unit = self.grid.unit(unit).expect("units are checked when they come in");
        Kind::Paths(self.regions.of(unit.tile))
    }

    /// Rays that came back from an interrupted thread before they were begun are whole paths; of
    /// these there are many in a bundle, of those that were begun, few.
    fn kind_of_rays(&self, bundle: &Bundle) -> Kind {
        let begun = bundle.rays.iter().filter(|ray| ray.depth > 0).count();
        let unit = bundle.shares.first().map(|share| share.unit);
        let unit = unit.filter(|_| !self.is_partitioned && 2 * begun < bundle.rays.len());
        unit.map_or(Kind::Rays, |unit| self.kind_of_paths(unit))
    }

    fn paths_of(&self, unit: UnitId) -> u32 {
        self.grid.unit(unit).expect("units are checked when they come in").path_count()
    }

    /// What a path of a unit costs.
    fn path_nanos(&self, unit: UnitId) -> u64 {
        self.stock.costs().of(self.kind_of_paths(unit))
    }

    /// What one of the rays costs that are next in a pile.
    fn ray_nanos(&self, partition: PartitionId) -> Option<u64> {
        Some(self.stock.costs().of(self.kind_of_rays(self.piles.next(partition)?)))
    }

    /// Most paths of a unit that are traced as one piece.
    fn piece_max(&self, unit: UnitId) -> u64 {
        let costs = self.stock.costs();
        let Kind::Paths(region) = self.kind_of_paths(unit) else { return PIECE_PATHS_MAX };
        match costs.measured(region) {
            Some(_) => PIECE_PATHS_MAX,
            None if costs.is_any_measured() => PROBE_PATHS,
            None => FIRST_PROBE_PATHS,
        }
    }

    /// At most so many of the rays that are next in a pile. Where they take steps instead of going
    /// all the way, several bundles make a piece.
    fn take_rays(&mut self, partition: PartitionId, rays_max: u64) -> Option<Bundle> {
        let rays_max = usize::try_from(rays_max).unwrap_or(usize::MAX);
        let mut taken = self.take_bundle(partition)?;
        if taken.rays.len() > rays_max {
            let parted = taken.split_off(rays_max);
            self.push_bundle(taken);
            return Some(parted);
        }
        while self.is_partitioned
            && let Some(next) = self.piles.next(partition)
            && next.stage == taken.stage
            && taken.rays.len() + next.rays.len() <= rays_max
            && taken.shares.len() + next.shares.len() <= PIECE_SHARES_MAX
        {
            taken.join(self.take_bundle(partition)?);
        }
        Some(taken)
    }

    fn take_bundle(&mut self, partition: PartitionId) -> Option<Bundle> {
        let bundle = self.piles.pop(partition)?;
        self.stock.take(self.kind_of_rays(&bundle), bundle.rays.len() as u64);
        Some(bundle)
    }

    /// At most so many paths of the range that is next.
    fn pop_started(&mut self, paths_max: u64) -> Option<Samples> {
        let last = self.started.len().checked_sub(1)?;
        Some(self.take_started(last, paths_max))
    }

    /// At most so many paths of a range; the credit parts in proportion.
    fn take_started(&mut self, index: usize, paths_max: u64) -> Samples {
        let paths_max = u32::try_from(paths_max).unwrap_or(u32::MAX);
        let kind = self.kind_of_paths(self.started[index].share.unit);
        let range = &mut self.started[index];
        self.stock.take(kind, u64::from(range.path_count.min(paths_max)));
        if range.path_count <= paths_max {
            return self.started.remove(index);
        }
        let parts = range.path_count.div_ceil(paths_max) as usize;
        let credit = range.share.credit.split(parts);
        let piece = Samples {
            share: Share { credit, ..range.share },
            first_path: range.first_path,
            path_count: paths_max,
        };
        range.first_path += paths_max;
        range.path_count -= paths_max;
        piece
    }

    fn recount(&mut self) {
        let fresh = self.fresh.iter().map(|&(_, unit, _)| (unit, self.paths_of(unit)));
        let started = self.started.iter().map(|range| (range.share.unit, range.path_count));
        let paths = fresh.chain(started);
        let paths = paths.map(|(unit, count)| (self.kind_of_paths(unit), u64::from(count)));
        let bundles = self.piles.iter();
        let rays = bundles.map(|bundle| (self.kind_of_rays(bundle), bundle.rays.len() as u64));
        let (paths, rays): (Vec<_>, Vec<_>) = (paths.collect(), rays.collect());
        self.stock.clear();
        for (kind, count) in paths.into_iter().chain(rays) {
            self.stock.add(kind, count);
        }
    }
}

/// Fewest paths or rays that are handed out or given away, at so much each.
const fn piece_min(nanos: u64) -> u64 {
    let within = PIECE_NANOS_MAX / nanos;
    match within {
        0 => 1,
        _ if within < PIECE_MIN => within,
        _ => PIECE_MIN,
    }
}

/// How many paths or rays of so much each to give away for a budget; none if the fewest are too
/// many.
fn split(budget: u64, most: u64, nanos: u64) -> Option<u64> {
    let least = piece_min(nanos);
    let count = budget / nanos;
    if count >= least {
        return Some(count);
    }
    (least.saturating_mul(nanos) <= most).then_some(least)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use equilux_common::bundle::Stage;
    use equilux_common::ids::PartitionId;
    use equilux_common::ray::Ray;
    use equilux_common::unit::{Granularity, Rect};

    /// What a path is taken to cost before one has been traced.
    const PATH: u64 = 20_000;
    const GRAIN: u64 = 200 * PATH;

    /// Four tiles of two passes: units 0, 2, 4, 6 are the first pass; 16 × 16 × 4 paths each.
    fn queue() -> Queue {
        let region = Rect { x0: 0, y0: 0, x1: 32, y1: 32 };
        let granularity = Granularity { tile_side_pixels: 16, samples_per_unit: 4 };
        let mut queue = Queue::new(UnitGrid::new(32, region, 8, granularity), region);
        for unit in 0..8 {
            queue.push_unit(UnitId(unit), Attempt(0));
        }
        queue
    }

    fn bundle(depth: u16, unit: u32) -> Bundle {
        Bundle {
            stage: Stage::Intersect,
            partition: PartitionId(0),
            shares: vec![Share {
                unit: UnitId(unit),
                attempt: Attempt(0),
                credit: Credit::whole(),
            }],
            rays: vec![Ray { depth, ..Ray::zeroed() }; 3],
        }
    }

    #[test]
    fn units_are_begun_pass_by_pass_along_the_curve() {
        let mut queue = queue();
        let order: Vec<u32> =
            std::iter::from_fn(|| queue.begin_first()).map(|share| share.unit.0).collect();
        assert_eq!(order, [0, 2, 4, 6, 1, 3, 5, 7]);
    }

    #[test]
    fn deep_rays_come_first_and_grains_share_the_credit_of_their_range() {
        let mut queue = queue();
        queue.begin_first().expect("eight units wait");
        queue.push_bundle(bundle(1, 2));
        queue.push_bundle(bundle(4, 2));
        let all = Residency::replicated();
        let depths: Vec<u16> =
            std::iter::from_fn(|| Some(queue.pop_rays(GRAIN, &all)?.depth())).collect();
        assert_eq!(depths, [4, 1]);
        let mut credit = Credit::zero();
        let mut paths = Vec::new();
        while let Some(grain) = queue.pop_samples(GRAIN) {
            assert!(
                u64::from(grain.path_count) <= PIECE_PATHS_MAX && !grain.share.credit.is_zero()
            );
            credit.merge(&grain.share.credit).expect("parts of the whole");
            paths.extend(grain.first_path..grain.first_path + grain.path_count);
        }
        assert!(credit.is_whole());
        paths.sort_unstable();
        assert_eq!(paths, (0..1024).collect::<Vec<_>>());
    }

    #[test]
    fn gifts_come_from_the_far_end_and_split_what_is_too_large() {
        let mut queue = queue();
        let gift = queue.pop_gift(1500 * PATH, 0, GiveFirst::Samples).expect("a unit fits");
        assert!(matches!(&gift.work, Work::Samples(all) if all.share.unit == UnitId(7)
            && all.path_count == 1024));
        let gift = queue.pop_gift(100 * PATH, 0, GiveFirst::Samples).expect("a part fits");
        assert!(matches!(&gift.work, Work::Samples(part) if part.path_count == 100));
        assert_eq!(gift.begun.map(|share| share.unit), Some(UnitId(5)));
        let gift = queue.pop_gift(100 * PATH, 0, GiveFirst::Samples).expect("a part fits");
        assert!(gift.begun.is_none(), "the rest of the same unit goes first");
        assert!(
            queue.pop_gift(3 * PATH, 0, GiveFirst::Samples).is_none(),
            "too little for a message"
        );
    }

    #[test]
    fn dropped_shares_leave_the_counts_right() {
        let mut queue = queue();
        queue.push_bundle(bundle(1, 2));
        queue.begin_first().expect("eight units wait");
        assert_eq!(queue.retain(|share| share.unit.0 > 2), 3);
        assert_eq!((queue.ray_count(), queue.stock.nanos()), (0, 5 * 1024 * PATH));
    }
}
