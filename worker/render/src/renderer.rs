//! A job made ready to be rendered, and the door to it: work in, an outcome out.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use equilux_common::job::Settings;
use equilux_common::scene::Scene;
use equilux_common::scene::camera::Camera;
use equilux_common::unit::UnitGrid;
use equilux_common::work::{Outcome, Work};

use crate::camera::RayCaster;
use crate::geometry::{COORDINATE_MAX, PartitionSet};
use crate::home::InvalidWork;
use crate::model::Model;
use crate::observer::Observer;
use crate::scratch::Scratch;
use crate::trace::Tracing;

/// All that light is computed from in one job. Any number of threads may trace with it at once.
#[derive(Clone, Debug)]
pub struct Renderer {
    pub(crate) model: Arc<Model>,
    /// What rays can be traced through; those that need another partition are handed on.
    pub(crate) partitions: PartitionSet,
    pub(crate) caster: RayCaster,
    pub(crate) settings: Settings,
    pub(crate) grid: Arc<UnitGrid>,
}

/// A scene or a job that cannot be rendered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RenderError {
    /// More than ids can name.
    #[error("the scene has {count} triangles, more than {most}; leave some models out")]
    TooManyTriangles {
        /// How many it has.
        count: u64,
        /// How many it may have.
        most: u64,
    },
    /// Larger than single precision can compute with.
    #[error(
        "a vertex lies at {0:e}, beyond {COORDINATE_MAX:e} scene units; scale the models down, \
         for instance by `transform`"
    )]
    TooLarge(f32),
    /// No direction of view.
    #[error(
        "camera: `target` must differ from `eye`, and `up` must not be parallel to the line \
         between them"
    )]
    NoView,
}

impl Renderer {
    /// Makes a scene ready for one job alone.
    ///
    /// # Errors
    /// If the scene is beyond what can be computed, or the camera has no direction.
    pub fn new(
        scene: Scene,
        camera: &Camera,
        settings: &Settings,
        grid: UnitGrid,
    ) -> Result<Self, RenderError> {
        Self::of_model(Arc::new(Model::new(scene)?), camera, settings, grid)
    }

    /// Makes a job on a model ready, which takes no time to speak of.
    ///
    /// # Errors
    /// If the camera has no direction.
    pub fn of_model(
        model: Arc<Model>,
        camera: &Camera,
        settings: &Settings,
        grid: UnitGrid,
    ) -> Result<Self, RenderError> {
        let caster = RayCaster::new(camera, settings).ok_or(RenderError::NoView)?;
        let (partitions, settings) = (model.partitions().clone(), settings.clone());
        Ok(Self { model, partitions, caster, settings, grid: Arc::new(grid) })
    }

    /// The same job with other partitions in memory.
    #[must_use]
    pub fn with_partitions(&self, partitions: PartitionSet) -> Self {
        Self { partitions, ..self.clone() }
    }

    /// The same image in other units.
    #[must_use]
    pub fn with_grid(&self, grid: UnitGrid) -> Self {
        Self { grid: Arc::new(grid), ..self.clone() }
    }

    /// Traces a piece of work to its end on the calling thread, or until all rays that are left
    /// need partitions that are not in memory: these come back as successors, in bundles by
    /// partition. When `interrupt` is set, so do the rays that have not been begun, soon.
    ///
    /// # Errors
    /// If the work is not of this job: its units, pixels, samples or primitives do not exist here.
    /// Nothing of it has then been traced.
    pub fn trace(
        &self,
        work: Work,
        interrupt: &AtomicBool,
        scratch: &mut Scratch,
    ) -> Result<Outcome, InvalidWork> {
        self.trace_observed(work, interrupt, scratch, &mut ())
    }

    /// [`Self::trace`], while `observer` watches.
    ///
    /// # Errors
    /// As [`Self::trace`].
    pub fn trace_observed(
        &self,
        work: Work,
        interrupt: &AtomicBool,
        scratch: &mut Scratch,
        observer: &mut impl Observer,
    ) -> Result<Outcome, InvalidWork> {
        let is_wanted_back = || interrupt.load(Ordering::Relaxed);
        let tracing = Tracing::new(self, &work, is_wanted_back, scratch)?;
        Ok(tracing.run(work, observer))
    }

    /// The job's units.
    #[must_use]
    pub fn grid(&self) -> &UnitGrid {
        &self.grid
    }
}
