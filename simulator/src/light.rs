//! The real tracer in virtual time: real images under simulated disorder.

use std::borrow::Cow;
use std::cell::RefCell;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use equilux_common::ids::PartitionId;
use equilux_common::work::Work;
use equilux_render::geometry::{Partition, PartitionSet};
use equilux_render::renderer::Renderer;
use equilux_render::scratch::Scratch;

use crate::tracer::{Task, Traced, Tracer};

/// Traces with the real renderer of one job; every ray takes the same virtual time.
#[derive(Debug)]
pub struct LightTracer {
    renderer: Renderer,
    /// Those of a model that is cut, by their numbers; none of a model that is whole.
    partitions: Vec<Arc<Partition>>,
    ray_cost: Duration,
    scratch: RefCell<Scratch>,
}

impl LightTracer {
    /// A tracer whose rays take `ray_cost` each.
    #[must_use]
    pub fn new(renderer: Renderer, ray_cost: Duration) -> Self {
        Self { renderer, partitions: Vec::new(), ray_cost, scratch: RefCell::default() }
    }

    /// The same tracer for a model that is cut into these partitions.
    #[must_use]
    pub fn cut(self, partitions: Vec<Arc<Partition>>) -> Self {
        Self { partitions, ..self }
    }

    /// The renderer with the partitions that are in memory.
    #[must_use]
    pub fn renderer(&self, task: &Task) -> Cow<'_, Renderer> {
        if self.partitions.is_empty() {
            return Cow::Borrowed(&self.renderer);
        }
        let is_here = |number| task.resident.contains(&PartitionId(number));
        let numbered = (0u32..).zip(&self.partitions);
        let here =
            numbered.map(|(number, partition)| is_here(number).then(|| Arc::clone(partition)));
        Cow::Owned(self.renderer.with_partitions(PartitionSet::new(here.collect())))
    }
}

impl Tracer for LightTracer {
    /// An interrupt strikes before the first ray, wherever it comes: the renderer has no notion of
    /// virtual time.
    fn trace(&self, task: &Task, work: Work, limit: Option<Duration>) -> Traced {
        let interrupt = AtomicBool::new(limit.is_some());
        let outcome = self.renderer(task).trace(work, &interrupt, &mut self.scratch.borrow_mut());
        let outcome = outcome.expect("the cores only move work of this job");
        let rays = u32::try_from(outcome.counts.retired).expect("a piece is small");
        let elapsed = limit.unwrap_or_default() + self.ray_cost * rays;
        Traced { outcome, elapsed }
    }
}
