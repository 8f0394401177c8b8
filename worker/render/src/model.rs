//! What belongs to a scene and to no job: triangles under their tree, materials, textures, lights.
//!
//! It takes long to make and much memory, so that any number of jobs, one after another or at once,
//! share one of it; see [`crate::renderer::Renderer`] for what belongs to a job.

use equilux_common::scene::{Material, Scene, Texture};

use crate::geometry::{COORDINATE_MAX, Partition, TRIANGLES_MAX};
use crate::light::Lights;
use crate::renderer::RenderError;
use crate::texture;

/// A scene made ready to be rendered, from any camera and with any settings.
#[derive(Debug)]
pub struct Model {
    pub(crate) partition: Partition,
    pub(crate) materials: Vec<Material>,
    pub(crate) textures: Vec<Texture>,
    pub(crate) lights: Lights,
}

impl Model {
    /// Prepares a checked scene: builds the tree over its triangles and gathers its lights.
    ///
    /// # Errors
    /// If the scene is beyond what can be computed.
    pub fn new(scene: Scene) -> Result<Self, RenderError> {
        let triangle_count = scene.geometry.triangles.len();
        if triangle_count > TRIANGLES_MAX {
            return Err(RenderError::TooManyTriangles(triangle_count));
        }
        let coordinates = scene.geometry.positions.as_flattened();
        if let Some(beyond) = coordinates.iter().find(|x| x.abs() > COORDINATE_MAX) {
            return Err(RenderError::TooLarge(*beyond));
        }
        let bounds = Partition::bounds_of(&scene.geometry);
        let lights = Lights::new(&scene, bounds.lower, bounds.upper);
        Ok(Self {
            partition: Partition::new(scene.geometry),
            materials: scene.materials,
            textures: scene.textures,
            lights,
        })
    }

    /// Bytes of memory that its large parts take.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let textures: usize = self.textures.iter().map(texture::bytes).sum();
        (self.partition.bytes() + self.lights.bytes() + textures) as u64
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
