//! The stub tracer: a seeded branching process in the place of light.
//!
//! A ray's value, its cost and its children are a hash of the integers that name it, so the film
//! does not depend on who traces what, and is known beforehand by walking every path's tree alone
//! ([`StubTracer::expected`]). It conserves credit and counts rays as light must.

use std::time::Duration;

use bytemuck::Zeroable;
use equilux_common::bundle::Stage;
use equilux_common::film::TileSums;
use equilux_common::ids::PartitionId;
use equilux_common::ray::Ray;
use equilux_common::unit::Rect;
use equilux_common::work::{Samples, Work};

use crate::random::mix;
use crate::trace::{Trace, WHOLE_MODEL, limit_nanos};
use crate::tracer::{Task, Traced, Tracer};

/// Paths have no rays deeper than this.
const DEPTH_MAX: u16 = 6;

/// Pixels of one such square cost the same: work is as uneven as images are.
const REGION_PIXELS: u32 = 8;

/// Most visits of a ray.
const VISITS_MAX: u64 = 4;

/// A branching process.
#[derive(Clone, Copy, Debug)]
pub struct StubTracer {
    /// Names the process.
    pub seed: u64,
    /// Mean cost of a ray.
    pub ray_cost: Duration,
    /// Of a hundred rays, how many cannot go on where they were spawned and come back.
    pub parked_percent: u64,
    /// Partitions of the model; 0 for a replicated one. A ray visits up to [`VISITS_MAX`] of them
    /// before it ends.
    pub partition_count: u32,
}

impl StubTracer {
    /// The film of the whole job, computed one path after another, without units, bundles or
    /// credit.
    #[must_use]
    pub fn expected(&self, task: &Task) -> TileSums {
        let region = task.spec.settings.region();
        let mut film = TileSums::new(region);
        for y in region.y0..region.y1 {
            for x in region.x0..region.x1 {
                for sample_index in 0..task.spec.settings.samples_per_pixel {
                    let pixel = x + y * task.grid.image_width();
                    let camera = Ray { pixel, sample_index, ..Ray::zeroed() };
                    film.add_sample(region.index_of(x, y), sample_index);
                    self.walk(&camera, task, &mut film);
                }
            }
        }
        film
    }

    fn walk(&self, ray: &Ray, task: &Task, film: &mut TileSums) {
        self.shine(ray, task, film);
        for child in self.children(ray) {
            self.walk(&child, task, film);
        }
    }

    /// Adds what a ray contributes.
    fn shine(&self, ray: &Ray, task: &Task, sums: &mut TileSums) {
        let value = i64::try_from(self.hash(ray) % 1000).expect("a small number") + 1;
        let pixel = &mut sums.pixels[pixel_index(ray, task, sums.tile)];
        let layer =
            if ray.sample_index.is_multiple_of(2) { &mut pixel.even } else { &mut pixel.odd };
        layer[usize::from(ray.depth) % 3] += value;
    }

    fn children(&self, ray: &Ray) -> impl Iterator<Item = Ray> + use<> {
        let odds = mix(self.hash(ray) ^ 0xc0ffee) % 100;
        let count = if ray.depth >= DEPTH_MAX || odds < 35 { 0 } else { 1 + u32::from(odds > 80) };
        let ray = *ray;
        (0..count).map(move |which| {
            let branch = ray.branch.wrapping_mul(3).wrapping_add(which + 1);
            Ray { branch, depth: ray.depth + 1, hit_partition: 0, ..ray }
        })
    }

    /// Cost of one ray in nanoseconds: tenfold between regions, and uneven within.
    fn cost(&self, ray: &Ray, task: &Task) -> u64 {
        let width = task.grid.image_width();
        let (x, y) = (ray.pixel % width / REGION_PIXELS, ray.pixel / width / REGION_PIXELS);
        let region = mix(self.seed ^ mix(u64::from(x) << 32 | u64::from(y))) % 10 + 1;
        let mean = u64::try_from(self.ray_cost.as_nanos()).expect("a short time");
        mean * region * (50 + self.hash(ray) % 100) / 550 + 1
    }

    /// The partition that a ray has to visit before it can end and is not in memory, if any. The
    /// ray counts its visits.
    fn visit(&self, ray: &mut Ray, task: &Task) -> Option<PartitionId> {
        if self.partition_count == 0 {
            return None;
        }
        let visits = mix(self.hash(ray) ^ 0x7157) % (VISITS_MAX + 1);
        while u64::from(ray.hit_partition) < visits {
            let way = mix(self.hash(ray) ^ mix(u64::from(ray.hit_partition)));
            let partition = u32::try_from(way % u64::from(self.partition_count));
            let partition = PartitionId(partition.expect("below a count of 32 bits"));
            if !task.resident.contains(&partition) {
                return Some(partition);
            }
            ray.hit_partition += 1;
        }
        None
    }

    fn is_parked(&self, ray: &Ray) -> bool {
        ray.depth > 0 && mix(self.hash(ray) ^ 0x9a4c) % 100 < self.parked_percent
    }

    fn hash(&self, ray: &Ray) -> u64 {
        let place = u64::from(ray.pixel) << 32 | u64::from(ray.sample_index);
        let name = u64::from(ray.branch) << 16 | u64::from(ray.depth);
        mix(self.seed ^ mix(place ^ mix(name)))
    }
}

impl Tracer for StubTracer {
    fn trace(&self, task: &Task, work: Work, limit: Option<Duration>) -> Traced {
        let trace = Trace::new(work.shares());
        let mut piece = Branching { stub: *self, task, trace, limit: limit_nanos(limit) };
        match work {
            Work::Samples(samples) => piece.begin(&samples),
            Work::Rays(bundle) => bundle.rays.into_iter().for_each(|ray| piece.follow(ray)),
        }
        piece.trace.finish()
    }
}

/// One piece being traced.
struct Branching<'a> {
    stub: StubTracer,
    task: &'a Task,
    trace: Trace,
    limit: u64,
}

impl Branching<'_> {
    fn begin(&mut self, samples: &Samples) {
        let unit = self.task.grid.unit(samples.share.unit).expect("a unit of this job");
        for number in samples.first_path..samples.first_path + samples.path_count {
            let (x, y, sample_index) = unit.path(number);
            let pixel = x + y * self.task.grid.image_width();
            self.trace.counts.camera += 1;
            self.follow(Ray { pixel, sample_index, ..Ray::zeroed() });
        }
    }

    /// Follows a ray and all that it spawns here, until the limit.
    fn follow(&mut self, ray: Ray) {
        let mut stack = vec![ray];
        while let Some(mut ray) = stack.pop() {
            if self.trace.nanos >= self.limit {
                self.give_up(ray);
                continue;
            }
            if let Some(partition) = self.stub.visit(&mut ray, self.task) {
                self.trace.nanos += 1;
                self.trace.give_up(partition, Stage::Intersect, ray);
                continue;
            }
            self.trace.nanos += self.stub.cost(&ray, self.task);
            self.end(&ray);
            for child in self.stub.children(&ray) {
                self.count(&child);
                let parked = self.stub.is_parked(&child);
                if parked { self.give_up(child) } else { stack.push(child) }
            }
        }
    }

    /// A ray goes on later, wherever its way leads.
    fn give_up(&mut self, mut ray: Ray) {
        let partition = self.stub.visit(&mut ray, self.task).unwrap_or(WHOLE_MODEL);
        self.trace.give_up(partition, Stage::Intersect, ray);
    }

    fn end(&mut self, ray: &Ray) {
        let unit = self.trace.share(ray).unit;
        let tile = self.task.grid.unit(unit).expect("a unit of this job").tile;
        let sums = self.trace.sums(ray.share.into(), tile);
        if ray.depth == 0 {
            sums.add_sample(pixel_index(ray, self.task, tile), ray.sample_index);
        }
        self.stub.shine(ray, self.task, sums);
        self.trace.counts.retired += 1;
    }

    fn count(&mut self, child: &Ray) {
        let counts = &mut self.trace.counts;
        match self.stub.hash(child) % 3 {
            0 => counts.shadow += 1,
            1 => counts.indirect += 1,
            _ => counts.specular += 1,
        }
    }
}

fn pixel_index(ray: &Ray, task: &Task, tile: Rect) -> usize {
    let width = task.grid.image_width();
    tile.index_of(ray.pixel % width, ray.pixel / width)
}
