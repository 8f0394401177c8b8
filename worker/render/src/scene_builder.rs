//! Scenes for tests, built in code.

use std::sync::Arc;

use equilux_common::job::{Filter, PerDepth, Settings};
use equilux_common::scene::camera::Camera;
use equilux_common::scene::placing::{Placing, Transform};
use equilux_common::scene::{
    Environment, Geometry, Material, NO_INDEX, Prototype, Scene, Surface, Triangle,
};
use equilux_common::unit::{Granularity, UnitGrid};
use glam::Vec3;

use crate::geometry::{Bounds, PARTITION_BOXES_MAX, Partition, PartitionBuilder};
use crate::model::{Model, ModelParts};
use crate::renderer::Renderer;

/// A scene that grows.
pub(crate) struct SceneBuilder {
    scene: Scene,
}

impl SceneBuilder {
    pub(crate) fn new() -> Self {
        Self { scene: Scene::default() }
    }

    /// The same radiance from everywhere.
    pub(crate) fn environment(&mut self, radiance: f32) {
        self.scene.tables.environment = Environment::Constant { radiance: [radiance; 3] };
    }

    pub(crate) fn surface(&mut self, surface: Surface, opacity: f32) -> u32 {
        self.material(Material { name: String::new(), emission: [0.0; 3], surface, opacity })
    }

    pub(crate) fn diffuse(&mut self, albedo: f32) -> u32 {
        self.surface(plain(albedo, 0.0, 1.0), 1.0)
    }

    pub(crate) fn light(&mut self, radiance: f32) -> u32 {
        self.material(Material {
            name: String::new(),
            emission: [radiance; 3],
            surface: plain(0.0, 0.0, 1.0),
            opacity: 1.0,
        })
    }

    /// A parallelogram; seen from the side that it faces, `across` turns to `up`
    /// counter-clockwise.
    pub(crate) fn quad(&mut self, corner: Vec3, across: Vec3, up: Vec3, material: u32) {
        let corners = [corner, corner + across, corner + across + up, corner + up];
        let geometry = crate::geometry::tests::meshes::mesh(&corners, &[[0, 1, 2], [0, 2, 3]]);
        self.mesh(&geometry, |_| material);
    }

    /// A mesh, each triangle with a material of its own.
    pub(crate) fn mesh(&mut self, mesh: &Geometry, material: impl Fn(&[Vec3; 3]) -> u32) {
        let geometry = &mut self.scene.geometry;
        let first = u32::try_from(geometry.positions.len()).expect("few vertices");
        geometry.positions.extend_from_slice(&mesh.positions);
        geometry.triangles.extend(mesh.triangles.iter().map(|triangle| {
            let at = |index: u32| Vec3::from(mesh.positions[index as usize]);
            Triangle {
                positions: triangle.positions.map(|index| index + first),
                normals: [NO_INDEX; 3],
                texcoords: [NO_INDEX; 3],
                material: material(&triangle.positions.map(at)),
            }
        }));
    }

    /// A mesh of one material at several places.
    pub(crate) fn placed_mesh(&mut self, mesh: &Geometry, material: u32, places: &[Transform]) {
        let mut geometry = mesh.clone();
        geometry.triangles.iter_mut().for_each(|triangle| triangle.material = material);
        let placings = places.iter().copied().map(Placing::new).collect();
        self.scene.prototypes.push(Prototype { geometry, placings });
    }

    /// Makes everything `factor` times as large.
    pub(crate) fn scale(&mut self, factor: f32) {
        for position in &mut self.scene.geometry.positions {
            *position = position.map(|x| x * factor);
        }
    }

    pub(crate) fn renderer(self, camera: &Camera, settings: &Settings) -> Renderer {
        renderer_of(self.scene, camera, settings)
    }

    pub(crate) fn scene(&self) -> &Scene {
        &self.scene
    }

    fn material(&mut self, material: Material) -> u32 {
        self.scene.tables.materials.push(material);
        u32::try_from(self.scene.tables.materials.len() - 1).expect("few materials")
    }
}

/// The scene, cut into partitions of which triangle `index`, and that of each prototype, goes to
/// `owners[index % …]`; with the partitions, none of which is in the renderer's memory.
pub(crate) fn partitioned(
    scene: &Scene,
    owners: &[usize],
    whole: &Renderer,
) -> (Renderer, Vec<Arc<Partition>>) {
    let Scene { geometry, prototypes, tables } = scene;
    let bounds = Bounds::of_model(geometry, prototypes);
    let mut builders: Vec<PartitionBuilder> = Vec::new();
    builders.resize_with(owners.iter().max().map_or(1, |most| most + 1), Default::default);
    for ((primitive, triangle), &owner) in
        (0u32..).zip(&geometry.triangles).zip(owners.iter().cycle())
    {
        builders[owner].push(primitive, &geometry.world_triangle(triangle));
    }
    for (number, Prototype { geometry, .. }) in prototypes.iter().enumerate() {
        let places = scene.placements().filter(|it| it.prototype == number);
        let places: Vec<_> = places.map(|it| (it.placing, it.first_primitive)).collect();
        builders.iter_mut().for_each(|builder| builder.begin_object(places.clone()));
        let triangles = (0u32..).zip(&geometry.triangles);
        for ((local, triangle), &owner) in triangles.zip(owners.iter().cycle()) {
            builders[owner].push(local, &geometry.world_triangle(triangle));
        }
    }
    let partitions: Vec<Arc<Partition>> =
        builders.into_iter().map(|builder| Arc::new(builder.build(&bounds))).collect();
    let parts = ModelParts {
        bounds,
        triangle_count: scene.triangle_count(),
        boxes: partitions.iter().map(|partition| partition.boxes(PARTITION_BOXES_MAX)).collect(),
        tables: tables.clone(),
        luminaires: scene.luminaires(),
    };
    let model = Arc::new(Model::of_parts(parts).expect("a scene that can be rendered"));
    let partitions_of_none = model.partitions().clone();
    (Renderer { model, partitions: partitions_of_none, ..whole.clone() }, partitions)
}

/// A job on a scene.
fn renderer_of(scene: Scene, camera: &Camera, settings: &Settings) -> Renderer {
    let granularity = Granularity { tile_side_pixels: 8, samples_per_unit: 2 };
    let (width, region) = (settings.width, settings.region());
    let grid = UnitGrid::new(width, region, settings.samples_per_pixel, granularity);
    Renderer::new(scene, camera, settings, grid).expect("a scene that can be rendered")
}

/// Grey diffuse reflection and gloss.
pub(crate) fn plain(diffuse: f32, specular: f32, alpha: f32) -> Surface {
    let (diffuse, specular) = ([diffuse; 3], [specular; 3]);
    Surface::Plain { diffuse, diffuse_texture: None, specular, alpha }
}

/// A pinhole camera.
pub(crate) fn camera(eye: Vec3, target: Vec3, vfov: f32) -> Camera {
    let (eye, target) = (eye.into(), target.into());
    Camera { eye, target, up: [0.0, 1.0, 0.01], vfov, aperture: 0.0, focus_distance: 1.0 }
}

/// A square image with n = m = 1.
pub(crate) fn settings(side: u32, samples_per_pixel: u32, max_depth: u32) -> Settings {
    Settings {
        width: side,
        height: side,
        crop: None,
        filter: Filter::Box,
        samples_per_pixel,
        max_depth,
        light_samples: PerDepth::default(),
        indirect_samples: PerDepth::default(),
        roulette_depth: None,
        seed: 1,
    }
}

/// One number for all depths.
pub(crate) fn always(count: u32) -> PerDepth {
    PerDepth::new(vec![count]).expect("within limits")
}
