//! A scene made ready to be rendered, and the door to it: work in, an outcome out.

use std::sync::atomic::{AtomicBool, Ordering};

use equilux_common::job::Settings;
use equilux_common::scene::camera::Camera;
use equilux_common::scene::{Material, Scene, Texture};
use equilux_common::unit::UnitGrid;
use equilux_common::work::{Outcome, Work};

use crate::camera::RayCaster;
use crate::geometry::{COORDINATE_MAX, Partition, TRIANGLES_MAX};
use crate::home::InvalidWork;
use crate::light::Lights;
use crate::scratch::Scratch;
use crate::trace::Tracing;

/// All that light is computed from in one job. Any number of threads may trace with it at once.
#[derive(Debug)]
pub struct Renderer {
    pub(crate) partition: Partition,
    pub(crate) materials: Vec<Material>,
    pub(crate) textures: Vec<Texture>,
    pub(crate) lights: Lights,
    pub(crate) caster: RayCaster,
    pub(crate) settings: Settings,
    pub(crate) grid: UnitGrid,
}

/// A scene that cannot be rendered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RenderError {
    /// More than ids can name.
    #[error("the scene has {0} triangles, more than {TRIANGLES_MAX}; leave some models out")]
    TooManyTriangles(usize),
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
    /// Prepares a checked scene: builds the tree over its triangles and gathers its lights.
    ///
    /// # Errors
    /// If the scene is beyond what can be computed, or the camera has no direction.
    pub fn new(
        scene: Scene,
        camera: &Camera,
        settings: &Settings,
        grid: UnitGrid,
    ) -> Result<Self, RenderError> {
        let triangle_count = scene.geometry.triangles.len();
        if triangle_count > TRIANGLES_MAX {
            return Err(RenderError::TooManyTriangles(triangle_count));
        }
        let coordinates = scene.geometry.positions.as_flattened();
        if let Some(beyond) = coordinates.iter().find(|x| x.abs() > COORDINATE_MAX) {
            return Err(RenderError::TooLarge(*beyond));
        }
        let caster = RayCaster::new(camera, settings).ok_or(RenderError::NoView)?;
        let bounds = Partition::bounds_of(&scene.geometry);
        let lights = Lights::new(&scene, bounds.lower, bounds.upper);
        Ok(Self {
            partition: Partition::new(scene.geometry),
            materials: scene.materials,
            textures: scene.textures,
            lights,
            caster,
            settings: settings.clone(),
            grid,
        })
    }

    /// Traces a piece of work to its end on the calling thread. When `interrupt` is set, the rays
    /// that have not been begun come back as successors, soon.
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
        let is_wanted_back = || interrupt.load(Ordering::Relaxed);
        Tracing::new(self, &work, is_wanted_back, scratch).map(|tracing| tracing.run(work))
    }

    /// The job's units.
    #[must_use]
    pub const fn grid(&self) -> &UnitGrid {
        &self.grid
    }

    /// How many triangles there are.
    #[must_use]
    pub const fn triangle_count(&self) -> usize {
        self.partition.triangle_count()
    }

    pub(crate) fn material_of(&self, primitive: u32) -> &Material {
        &self.materials[self.partition.material(primitive) as usize]
    }
}
