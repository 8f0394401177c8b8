//! What a thread keeps between pieces of work, so that tracing does not allocate.

use equilux_common::bundle::{BUNDLE_RAYS_MAX, Stage};
use equilux_common::ray::Ray;

use crate::geometry::Stack;
use crate::stage::Shaded;

/// Rays that await a stage.
#[derive(Debug)]
pub(crate) struct Pending {
    pub(crate) stage: Stage,
    pub(crate) rays: Vec<Ray>,
}

/// A thread's working memory. One per thread; reuse it.
#[derive(Debug)]
pub struct Scratch {
    /// Most rays of a bundle.
    pub(crate) bundle_rays: usize,
    pub(crate) stack: Stack,
    pub(crate) shaded: Shaded,
    /// What is to be done, the latest last.
    pub(crate) pending: Vec<Pending>,
    spare: Vec<Vec<Ray>>,
}

impl Default for Scratch {
    fn default() -> Self {
        Self {
            bundle_rays: BUNDLE_RAYS_MAX,
            stack: Stack::default(),
            shaded: Shaded::default(),
            pending: Vec::new(),
            spare: Vec::new(),
        }
    }
}

impl Scratch {
    /// An empty list of rays.
    pub(crate) fn open(&mut self) -> Vec<Ray> {
        self.spare.pop().unwrap_or_else(|| Vec::with_capacity(self.bundle_rays))
    }

    /// Takes a list back.
    pub(crate) fn reclaim(&mut self, mut rays: Vec<Ray>) {
        rays.clear();
        self.spare.push(rays);
    }

    /// Adds a ray to those that will await `stage`; a full list is put on the stack.
    pub(crate) fn add(&mut self, stage: Stage, open: &mut Vec<Ray>, ray: Ray) {
        open.push(ray);
        if open.len() == self.bundle_rays {
            let full = std::mem::take(open);
            self.pending.push(Pending { stage, rays: full });
            *open = self.open();
        }
    }

    /// Puts a list on the stack unless it is empty.
    pub(crate) fn seal(&mut self, stage: Stage, rays: Vec<Ray>) {
        if rays.is_empty() {
            self.reclaim(rays);
        } else {
            self.pending.push(Pending { stage, rays });
        }
    }
}
