//! One piece of work, traced to its end on one thread.
//!
//! Rays go through the stages in bundles. Bundles wait on a stack, so that the deepest go first and
//! the stack stays short: it holds at most what the hits on one way down have spawned. Camera rays
//! are only started when it is empty.

use equilux_common::bundle::{Bundle, Stage};
use equilux_common::ray::Ray;
use equilux_common::work::{Outcome, RayCounts, Samples, Work};

use crate::home::{Home, InvalidWork, WHOLE_MODEL};
use crate::observer::Observer;
use crate::renderer::Renderer;
use crate::sampler::{Place, Purpose};
use crate::scratch::{Pending, Scratch};
use crate::stage::shade;

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
            if let Some(Pending { stage, rays }) = self.scratch.pending.pop() {
                self.advance(stage, rays, observer);
            } else if unstarted.count() > 0 {
                self.start(&mut unstarted, observer);
            } else {
                break;
            }
        }
        while unstarted.count() > 0 {
            self.start(&mut unstarted, observer);
        }
        self.close()
    }

    /// Puts the work's rays on the stack.
    fn take(&mut self, work: Work) -> Unstarted {
        match work {
            Work::Samples(Samples { first_path, path_count, .. }) => {
                Unstarted { next_path: first_path, end_path: first_path + path_count }
            }
            Work::Rays(bundle) => {
                self.received = bundle.rays.len() as u64;
                self.scratch.seal(bundle.stage, bundle.rays);
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

    /// Does to some rays what is next, until they have retired.
    fn advance(&mut self, stage: Stage, mut rays: Vec<Ray>, observer: &mut impl Observer) {
        match stage {
            Stage::Intersect => {
                for ray in &mut rays {
                    self.renderer.model.partition.intersect(ray, &mut self.scratch.stack);
                }
                self.shade(&rays);
            }
            Stage::Shade => self.shade(&rays),
            Stage::Shadow => self.look_for_light(&rays),
        }
        observer.advanced(stage, &rays);
        self.counts.retired += rays.len() as u64;
        self.scratch.reclaim(rays);
    }

    fn look_for_light(&mut self, rays: &[Ray]) {
        for ray in rays {
            if !self.renderer.model.partition.is_occluded(ray, &mut self.scratch.stack) {
                self.home.add_radiance(ray, ray.throughput);
            }
        }
    }

    /// Shades rays and puts what they spawn on the stack, shadow rays uppermost: they end first.
    fn shade(&mut self, rays: &[Ray]) {
        let (mut onward, mut shadow) = (self.scratch.open(), self.scratch.open());
        let mut shaded = std::mem::take(&mut self.scratch.shaded);
        for ray in rays {
            shade(self.renderer, ray, &mut shaded);
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
        self.scratch.shaded = shaded;
        self.scratch.seal(Stage::Intersect, onward);
        self.scratch.seal(Stage::Shadow, shadow);
    }

    /// Hands on what is still on the stack, and retires the rest.
    fn close(self) -> Outcome {
        let handed_on = |Pending { stage, rays }| Bundle {
            stage,
            partition: WHOLE_MODEL,
            shares: Vec::new(),
            rays,
        };
        let mut successors: Vec<Bundle> = self.scratch.pending.drain(..).map(handed_on).collect();
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
