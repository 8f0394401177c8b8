//! What belongs to a scene and to no job: where the partitions of its geometry lie, materials,
//! textures, lights.
//!
//! It takes long to make and much memory, so that any number of jobs, one after another or at once,
//! share one of it; see [`crate::renderer::Renderer`] for what belongs to a job.

use equilux_common::ray::Ray;
use equilux_common::scene::{Luminaire, Material, Prototype, Scene, Tables, Texture, triangles};

use crate::geometry::{
    Bounds, COORDINATE_MAX, PARTITION_BOXES_MAX, PartitionBuilder, PartitionSet, Probe, Routes,
    TRIANGLES_MAX,
};
use crate::light::Lights;
use crate::renderer::RenderError;
use crate::texture;

/// A scene made ready to be rendered, from any camera and with any settings.
#[derive(Debug)]
pub struct Model {
    bounds: Bounds,
    triangle_count: u64,
    pub(crate) routes: Routes,
    pub(crate) materials: Vec<Material>,
    pub(crate) textures: Vec<Texture>,
    pub(crate) lights: Lights,
    /// The partitions that stay in memory: all of a replicated model.
    partitions: PartitionSet,
}

/// What is known of a model whose partitions are elsewhere.
#[derive(Debug)]
pub struct ModelParts {
    /// Bounds of the whole model.
    pub bounds: Bounds,
    /// Triangles in the whole model, those of prototypes counted at each place.
    pub triangle_count: u64,
    /// The boxes that bound each partition; none of an empty one.
    pub boxes: Vec<Vec<Bounds>>,
    /// What all partitions share.
    pub tables: Tables,
    /// All triangles that emit, in the order of their primitive ids.
    pub luminaires: Vec<Luminaire>,
}

impl Model {
    /// Prepares a checked scene: builds the tree over its triangles and gathers its lights.
    ///
    /// # Errors
    /// If the scene is beyond what can be computed.
    pub fn new(scene: Scene) -> Result<Self, RenderError> {
        let luminaires = scene.luminaires();
        let triangle_count = scene.triangle_count();
        let Scene { geometry, prototypes, tables } = scene;
        let bounds = Bounds::of_model(&geometry, &prototypes);
        check(triangle_count, &bounds)?;
        let placed: u64 = prototypes.iter().map(Prototype::triangle_count).sum();
        let stored = geometry.triangles.len() as u64 + placed;
        let most = TRIANGLES_MAX as u64;
        if stored > most {
            return Err(RenderError::TooManyTriangles { count: stored, most });
        }
        let partition = PartitionBuilder::of_model(geometry, prototypes).build(&bounds);
        let boxes = vec![partition.boxes(PARTITION_BOXES_MAX)];
        let parts = ModelParts { bounds, triangle_count, boxes, tables, luminaires };
        Ok(Self { partitions: PartitionSet::whole(partition), ..Self::of_parts(parts)? })
    }

    /// Prepares what is known of a model whose partitions are elsewhere.
    ///
    /// # Errors
    /// If the model is beyond what can be computed.
    pub fn of_parts(parts: ModelParts) -> Result<Self, RenderError> {
        let ModelParts { bounds, triangle_count, boxes, tables, luminaires } = parts;
        check(triangle_count, &bounds)?;
        let lights = Lights::new(&tables, &luminaires, &bounds);
        let Tables { materials, textures, .. } = tables;
        let partitions = PartitionSet::new(vec![None; boxes.len()]);
        let routes = Routes::new(boxes);
        Ok(Self { bounds, triangle_count, routes, materials, textures, lights, partitions })
    }

    /// Bytes of memory that its large parts take.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let textures: usize = self.textures.iter().map(texture::bytes).sum();
        (self.partitions.bytes() + self.lights.bytes() + textures) as u64
    }

    /// How many triangles there are, those of prototypes counted at each place.
    #[must_use]
    pub const fn triangle_count(&self) -> u64 {
        self.triangle_count
    }

    /// Bounds of the whole model.
    #[must_use]
    pub const fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    /// How many parts it is cut into.
    #[must_use]
    pub const fn partition_count(&self) -> usize {
        self.routes.partition_count()
    }

    /// The partitions that stay in memory: all of a replicated model.
    #[must_use]
    pub const fn partitions(&self) -> &PartitionSet {
        &self.partitions
    }

    /// A ray made ready to be tested against this model.
    pub(crate) fn probe(&self, ray: &Ray) -> Probe {
        Probe::new(ray, &self.bounds)
    }
}

fn check(triangle_count: u64, bounds: &Bounds) -> Result<(), RenderError> {
    let most = triangles::TRIANGLES_MAX;
    if triangle_count > most {
        return Err(RenderError::TooManyTriangles { count: triangle_count, most });
    }
    let largest = bounds.lower.abs().max(bounds.upper.abs()).max_element();
    if largest > COORDINATE_MAX {
        return Err(RenderError::TooLarge(largest));
    }
    Ok(())
}
