//! The stub tracer: a seeded branching process in the place of light.
//!
//! A ray's value, its cost and its children are a hash of the integers that name it, so the film
//! does not depend on who traces what, and is known beforehand by walking every path's tree alone
//! ([`StubTracer::expected`]). It conserves credit and counts rays as light must.

use std::time::Duration;

use bytemuck::Zeroable;
use equilux_common::bundle::{BUNDLE_RAYS_MAX, Bundle, Share, Stage};
use equilux_common::film::TileSums;
use equilux_common::ids::PartitionId;
use equilux_common::ray::Ray;
use equilux_common::unit::Rect;
use equilux_common::work::{Outcome, RayCounts, Samples, Work};

use crate::random::mix;
use crate::tracer::{Task, Traced, Tracer};

/// Paths have no rays deeper than this.
const DEPTH_MAX: u16 = 6;

/// Pixels of one such square cost the same: work is as uneven as images are.
const REGION_PIXELS: u32 = 8;

/// A branching process.
#[derive(Clone, Copy, Debug)]
pub struct StubTracer {
    /// Names the process.
    pub seed: u64,
    /// Mean cost of a ray.
    pub ray_cost: Duration,
    /// Of a hundred rays, how many cannot go on where they were spawned and come back.
    pub parked_percent: u64,
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
            Ray { branch, depth: ray.depth + 1, ..ray }
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
        let limit =
            limit.map_or(u64::MAX, |limit| u64::try_from(limit.as_nanos()).unwrap_or(u64::MAX));
        let mut trace = Trace::new(*self, task, work.shares());
        match work {
            Work::Samples(samples) => trace.begin(&samples, limit),
            Work::Rays(bundle) => bundle.rays.into_iter().for_each(|ray| trace.follow(ray, limit)),
        }
        trace.finish()
    }
}

/// One piece being traced.
struct Trace<'a> {
    stub: StubTracer,
    task: &'a Task,
    shares: Vec<Share>,
    /// What each share's rays added, if any ended.
    sums: Vec<Option<TileSums>>,
    given_up: Vec<Ray>,
    counts: RayCounts,
    nanos: u64,
}

impl<'a> Trace<'a> {
    fn new(stub: StubTracer, task: &'a Task, shares: &[Share]) -> Self {
        let sums = vec![None; shares.len()];
        let (given_up, counts) = (Vec::new(), RayCounts::default());
        Self { stub, task, shares: shares.to_vec(), sums, given_up, counts, nanos: 0 }
    }

    fn begin(&mut self, samples: &Samples, limit: u64) {
        let unit = self.task.grid.unit(samples.share.unit).expect("a unit of this job");
        for number in samples.first_path..samples.first_path + samples.path_count {
            let (x, y, sample_index) = unit.path(number);
            let pixel = x + y * self.task.grid.image_width();
            self.counts.camera += 1;
            self.follow(Ray { pixel, sample_index, ..Ray::zeroed() }, limit);
        }
    }

    /// Follows a ray and all that it spawns here, until the limit.
    fn follow(&mut self, ray: Ray, limit: u64) {
        let mut stack = vec![ray];
        while let Some(ray) = stack.pop() {
            if self.nanos >= limit {
                self.given_up.push(ray);
                continue;
            }
            self.nanos += self.stub.cost(&ray, self.task);
            self.end(&ray);
            for child in self.stub.children(&ray) {
                self.count(&child);
                let parked = self.stub.is_parked(&child);
                if parked { self.given_up.push(child) } else { stack.push(child) }
            }
        }
    }

    fn end(&mut self, ray: &Ray) {
        let share = &self.shares[usize::from(ray.share)];
        let tile = self.task.grid.unit(share.unit).expect("a unit of this job").tile;
        let sums = self.sums[usize::from(ray.share)].get_or_insert_with(|| TileSums::new(tile));
        if ray.depth == 0 {
            sums.add_sample(pixel_index(ray, self.task, tile), ray.sample_index);
        }
        self.stub.shine(ray, self.task, sums);
        self.counts.retired += 1;
    }

    fn count(&mut self, child: &Ray) {
        match self.stub.hash(child) % 3 {
            0 => self.counts.shadow += 1,
            1 => self.counts.indirect += 1,
            _ => self.counts.specular += 1,
        }
    }

    fn finish(mut self) -> Traced {
        let rays = std::mem::take(&mut self.given_up);
        let mut bundles: Vec<Vec<Ray>> =
            rays.chunks(BUNDLE_RAYS_MAX).map(<[Ray]>::to_vec).collect();
        let mut left: Vec<usize> = (0..self.shares.len())
            .map(|index| bundles.iter().filter(|rays| holds(rays, index)).count())
            .collect();
        let successors = bundles.drain(..).map(|rays| self.seal(rays, &mut left)).collect();
        let retired = self.shares.into_iter().zip(self.sums);
        let retired = retired.filter_map(|(share, sums)| Some((share, sums?))).collect();
        let outcome = Outcome { retired, successors, counts: self.counts };
        Traced { outcome, elapsed: Duration::from_nanos(self.nanos) }
    }

    /// Makes a bundle of rays, with its part of the credit of each share. `left` counts the bundles
    /// to come per share; where no ray has ended, the last of them takes all that is left.
    fn seal(&mut self, mut rays: Vec<Ray>, left: &mut [usize]) -> Bundle {
        let mut shares = Vec::new();
        for (index, share) in
            self.shares.iter_mut().enumerate().filter(|(index, _)| holds(&rays, *index))
        {
            let takers = left[index] + usize::from(self.sums[index].is_some());
            let credit = if takers == 1 {
                std::mem::take(&mut share.credit)
            } else {
                share.credit.split(takers)
            };
            left[index] -= 1;
            shares.push((index, Share { credit, ..share.clone() }));
        }
        for ray in &mut rays {
            let place = shares.iter().position(|(index, _)| *index == usize::from(ray.share));
            ray.share = u8::try_from(place.expect("its share was put in")).expect("few shares");
        }
        let shares = shares.into_iter().map(|(_, share)| share).collect();
        Bundle { stage: Stage::Intersect, partition: PartitionId(0), shares, rays }
    }
}

fn holds(rays: &[Ray], share: usize) -> bool {
    rays.iter().any(|ray| usize::from(ray.share) == share)
}

fn pixel_index(ray: &Ray, task: &Task, tile: Rect) -> usize {
    let width = task.grid.image_width();
    tile.index_of(ray.pixel % width, ray.pixel / width)
}
