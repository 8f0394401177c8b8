//! The real tracer in virtual time: real images under simulated disorder.

use std::cell::RefCell;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use equilux_common::work::Work;
use equilux_render::renderer::Renderer;
use equilux_render::scratch::Scratch;

use crate::tracer::{Task, Traced, Tracer};

/// Traces with the real renderer of one job; every ray takes the same virtual time.
#[derive(Debug)]
pub struct LightTracer {
    renderer: Renderer,
    ray_cost: Duration,
    scratch: RefCell<Scratch>,
}

impl LightTracer {
    /// A tracer whose rays take `ray_cost` each.
    #[must_use]
    pub fn new(renderer: Renderer, ray_cost: Duration) -> Self {
        Self { renderer, ray_cost, scratch: RefCell::default() }
    }

    /// The renderer.
    #[must_use]
    pub const fn renderer(&self) -> &Renderer {
        &self.renderer
    }
}

impl Tracer for LightTracer {
    /// An interrupt strikes before the first ray, wherever it comes: the renderer has no notion of
    /// virtual time.
    fn trace(&self, _task: &Task, work: Work, limit: Option<Duration>) -> Traced {
        let interrupt = AtomicBool::new(limit.is_some());
        let outcome = self.renderer.trace(work, &interrupt, &mut self.scratch.borrow_mut());
        let outcome = outcome.expect("the cores only move work of this job");
        let rays = u32::try_from(outcome.counts.retired).expect("a piece is small");
        let elapsed = limit.unwrap_or_default() + self.ray_cost * rays;
        Traced { outcome, elapsed }
    }
}
