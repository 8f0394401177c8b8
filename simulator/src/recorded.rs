//! The tracer of a recorded scene: by the itineraries of its paths where partitions come and go,
//! else by their costs alone.

use std::time::Duration;

use equilux_common::costs::SceneCosts;
use equilux_common::job::Settings;
use equilux_common::work::Work;

use crate::costs::CostTracer;
use crate::forecast::Scenario;
use crate::itineraries::ItineraryTracer;
use crate::scenario::cut;
use crate::tracer::{Task, Traced, Tracer};

/// Traces what was recorded.
#[derive(Debug)]
pub(crate) enum RecordedTracer {
    Replicated(CostTracer),
    Partitioned(ItineraryTracer),
}

impl RecordedTracer {
    /// Traces images of these settings for workers some of which may have too little memory for
    /// all of the model; `factor` scales all costs.
    pub(crate) fn new(
        scenario: &Scenario,
        costs: &SceneCosts,
        settings: &Settings,
        factor: f64,
    ) -> Self {
        let seed = scenario.seed;
        match cut(costs, scenario) {
            None => Self::Replicated(CostTracer::new(seed, costs, settings, factor)),
            Some(paths) => {
                Self::Partitioned(ItineraryTracer::new(seed, costs, paths, settings, factor))
            }
        }
    }
}

impl Tracer for RecordedTracer {
    fn trace(&self, task: &Task, work: Work, limit: Option<Duration>) -> Traced {
        match self {
            Self::Replicated(tracer) => tracer.trace(task, work, limit),
            Self::Partitioned(tracer) => tracer.trace(task, work, limit),
        }
    }
}
