//! One piece of work, traced to its end on one thread.
//!
//! Rays go through the stages in bundles. Bundles wait on a stack, so that the deepest go first and
//! the stack stays short: it holds at most what the hits on one way down have spawned. Camera rays
//! are only started when it is empty.

use equilux_common::bundle::{Bundle, Stage};
use equilux_common::ids::PartitionId;
use equilux_common::ray::Ray;
use equilux_common::work::{Outcome, RayCounts, Samples, Work};

use crate::home::{Home, InvalidWork};
use crate::observer::Observer;
use crate::renderer::Renderer;
use crate::sampler::{Place, Purpose};
use crate::scratch::{Pending, Scratch};
use crate::stage::shade;
use crate::visits::Elsewhere;

/// Most camera samples that are given up as rays when an interrupt is asked for (1 MiB of them);
/// those before are traced all the same.
const GIVEN_UP_PATHS_MAX: u32 = 16_384;

/// The state of tracing one piece of work.
pub(crate) struct Tracing<'a, F> {
    renderer: &'a Renderer,
    /// Whether rays that have not been begun are to be given up; asked before each bundle.
    is_wanted_back: F,
    scratch: &'a mut Scratch,
    home: Home,
    counts: RayCounts,
    received: u64,
}

/// Camera samples yet to be started.
struct Unstarted {
    next_path: u32,
    end_path: u32,
}

impl<'a, F: FnMut() -> bool> Tracing<'a, F> {
    pub(crate) fn new(
        renderer: &'a Renderer,
        work: &Work,
        is_wanted_back: F,
        scratch: &'a mut Scratch,
    ) -> Result<Self, InvalidWork> {
        let home = Home::new(renderer, work)?;
        Ok(Self {
            renderer,
            is_wanted_back,
            scratch,
            home,
            counts: RayCounts::default(),
            received: 0,
        })
    }

    pub(crate) fn run(mut self, work: Work, observer: &mut impl Observer) -> Outcome {
        let mut unstarted = self.take(work);
        while !self.is_interrupted(&unstarted) {
            if let Some(pending) = self.scratch.pending.pop() {
                self.advance(pending, observer);
            } else if unstarted.count() > 0 {
                self.start(&mut unstarted, observer);
            } else {
                break;
            }
        }
        while unstarted.count() > 0 {
            self.start(&mut unstarted, observer);
        }
        self.lay_aside(observer);
        self.close()
    }

    /// Puts the work's rays on the stack.
    fn take(&mut self, work: Work) -> Unstarted {
        match work {
            Work::Samples(Samples { first_path, path_count, .. }) => {
                Unstarted { next_path: first_path, end_path: first_path + path_count }
            }
            Work::Rays(Bundle { stage, partition, rays, .. }) => {
                self.received = rays.len() as u64;
                self.scratch.pending.push(Pending { stage, partition: Some(partition), rays });
                Unstarted { next_path: 0, end_path: 0 }
            }
        }
    }

    fn is_interrupted(&mut self, unstarted: &Unstarted) -> bool {
        unstarted.count() <= GIVEN_UP_PATHS_MAX && (self.is_wanted_back)()
    }

    /// Spawns the camera rays of one bundle.
    fn start(&mut self, unstarted: &mut Unstarted, observer: &mut impl Observer) {
        let unit = *self.home.unit(0);
        let mut rays = self.scratch.open();
        while unstarted.count() > 0 && rays.len() < self.scratch.bundle_rays {
            let ray = self.renderer.camera_ray(unit.path(unstarted.next_path));
            unstarted.next_path += 1;
            self.home.add_sample(&ray);
            self.counts.camera += 1;
            rays.push(ray);
        }
        observer.started(&rays);
        self.scratch.seal(Stage::Intersect, rays);
    }

    /// Does to some rays what is next: those whose way leads to a partition that is not in memory
    /// are laid aside, all others retire.
    fn advance(&mut self, pending: Pending, observer: &mut impl Observer) {
        let Pending { stage, partition, mut rays } = pending;
        match stage {
            Stage::Intersect | Stage::Shade => {
                self.find_hits(stage, partition, &mut rays);
                self.shade(&rays);
            }
            Stage::Shadow => self.look_for_light(partition, &mut rays),
        }
        observer.advanced(stage, &rays);
        self.counts.retired += rays.len() as u64;
        self.scratch.reclaim(rays);
    }

    /// Leaves the rays whose hits are known, or known not to be, and where these hits are.
    fn find_hits(&mut self, stage: Stage, partition: Option<PartitionId>, rays: &mut Vec<Ray>) {
        let Self { renderer, scratch, .. } = self;
        scratch.slots.clear();
        if stage == Stage::Intersect && renderer.is_whole() {
            renderer.find_all_hits(rays, &mut scratch.slots, &mut scratch.stack);
            return;
        }
        rays.retain_mut(|ray| {
            let found = match stage {
                Stage::Intersect => renderer.find_hit(ray, partition, &mut scratch.stack),
                Stage::Shade | Stage::Shadow => renderer.place_of_hit(ray, &mut scratch.stack),
            };
            match found {
                Ok(slot) => scratch.slots.push(slot),
                Err(Elsewhere { partition, stage }) => scratch.park(partition, stage, *ray),
            }
            found.is_ok()
        });
    }

    fn look_for_light(&mut self, partition: Option<PartitionId>, rays: &mut Vec<Ray>) {
        let Self { renderer, scratch, home, .. } = self;
        if renderer.is_whole() {
            renderer.find_occluded(rays, &mut scratch.are_occluded, &mut scratch.stack);
            let lit =
                rays.iter().zip(&scratch.are_occluded).filter(|(_, is_occluded)| !**is_occluded);
            lit.for_each(|(ray, _)| home.add_radiance(ray, ray.throughput));
            return;
        }
        rays.retain(|ray| {
            let is_lit = renderer.is_lit(ray, partition, &mut scratch.stack);
            match is_lit {
                Ok(true) => home.add_radiance(ray, ray.throughput),
                Ok(false) => {}
                Err(Elsewhere { partition, stage }) => scratch.park(partition, stage, *ray),
            }
            is_lit.is_ok()
        });
    }

    /// Shades rays and puts what they spawn on the stack, shadow rays uppermost: they end first.
    fn shade(&mut self, rays: &[Ray]) {
        let (mut onward, mut shadow) = (self.scratch.open(), self.scratch.open());
        let mut shaded = std::mem::take(&mut self.scratch.shaded);
        let slots = std::mem::take(&mut self.scratch.slots);
        for (ray, &slot) in rays.iter().zip(&slots) {
            shade(self.renderer, ray, slot, &mut shaded);
            if shaded.radiance != glam::Vec3::ZERO {
                self.home.add_radiance(ray, shaded.radiance.into());
            }
            if let Some(features) = &shaded.features {
                self.home.add_features(ray, features);
            }
            self.counts.shadow += shaded.shadow_rays.len() as u64;
            self.counts.indirect += shaded.indirect_rays.len() as u64;
            self.counts.specular += u64::from(shaded.specular_ray.is_some());
            for &ray in shaded.indirect_rays.iter().chain(&shaded.specular_ray) {
                self.scratch.add(Stage::Intersect, &mut onward, ray);
            }
            for &ray in &shaded.shadow_rays {
                self.scratch.add(Stage::Shadow, &mut shadow, ray);
            }
        }
        (self.scratch.shaded, self.scratch.slots) = (shaded, slots);
        self.scratch.seal(Stage::Intersect, onward);
        self.scratch.seal(Stage::Shadow, shadow);
    }

    /// Lays aside what is still on the stack; rays that meet no partition end right here.
    fn lay_aside(&mut self, observer: &mut impl Observer) {
        for Pending { stage, partition, mut rays } in std::mem::take(&mut self.scratch.pending) {
            let Self { renderer, scratch, .. } = self;
            rays.retain(|ray| {
                let set_out = || renderer.first_partition(ray, &mut scratch.stack);
                let partition = partition.or_else(set_out);
                if let Some(partition) = partition {
                    scratch.park(partition, stage, *ray);
                }
                partition.is_none()
            });
            self.advance(Pending { stage, partition: None, rays }, observer);
        }
    }

    /// Hands on what was laid aside, and retires the rest.
    fn close(self) -> Outcome {
        let mut successors = self.scratch.take_bundles();
        let left: u64 = successors.iter().map(|bundle| bundle.rays.len() as u64).sum();
        let (spawned, retired) = (self.counts.spawned(), self.counts.retired);
        assert_eq!(spawned + self.received, retired + left, "every ray is accounted for");
        let retired = self.home.close(&mut successors);
        Outcome { retired, successors, counts: self.counts }
    }
}

impl Unstarted {
    const fn count(&self) -> u32 {
        self.end_path - self.next_path
    }
}

impl Renderer {
    /// The ray with which a sample of a pixel begins.
    pub(crate) fn camera_ray(&self, (x, y, sample_index): (u32, u32, u32)) -> Ray {
        let pixel = x + y * self.grid.image_width();
        let place = Place::of_path(self.settings.seed, pixel, sample_index);
        self.caster.ray(x, y, sample_index, place.numbers(Purpose::Camera))
    }
}

#[cfg(test)]
mod tests;
