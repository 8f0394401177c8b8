//! What is in a scene, for people and for programs: `equilux scene check`.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;

use super::camera::Camera;
use super::load::texture::byte_count;
use super::load::{Bounds, Loaded};
use super::{Environment, Geometry, Scene, Surface, Texels};
use crate::job::Filter;

/// Memory that a tree over the triangles takes, per triangle: up to two nodes of 32 bytes and a
/// triangle of 48 laid out for tracing. An estimate.
const TREE_BYTES_PER_TRIANGLE: u64 = 112;

/// Memory that each place of a prototype takes: the transform, there and back, and a node.
const BYTES_PER_PLACE: u64 = 208;

/// Bytes per gibibyte and so on, for people.
const KIBI: f64 = 1024.0;

/// A scene in figures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Description {
    /// Objects that emit nothing.
    pub geometric_objects: usize,
    /// Objects of which at least one triangle emits.
    pub light_sources: usize,
    /// Triangles in all, those of models that are placed several times counted at each place.
    pub triangles: u64,
    /// Models that are placed several times.
    pub prototypes: usize,
    /// Places of these.
    pub placements: usize,
    /// Triangles that emit, likewise.
    pub light_triangles: u64,
    /// Triangles of the files that were dropped because they have no area.
    pub degenerate_triangles: usize,
    /// Vertex positions.
    pub vertices: usize,
    /// Least coordinates of the model.
    pub bounds_min: [f32; 3],
    /// Largest coordinates of the model.
    pub bounds_max: [f32; 3],
    /// Materials by kind: `plain`, `mirror`, `glass`, `pbr`, `emitter`.
    pub materials: BTreeMap<&'static str, usize>,
    /// The textures.
    pub textures: Vec<TextureDescription>,
    /// Light from everywhere, in words.
    pub environment: String,
    /// The camera that is used unless another one is asked for.
    pub camera: CameraDescription,
    /// Names of the other cameras.
    pub cameras: Vec<String>,
    /// How it is rendered unless told otherwise.
    pub settings: SettingsDescription,
    /// Estimated memory that a worker needs for the whole model.
    pub memory_bytes: u64,
    /// What is odd about the files.
    pub warnings: Vec<String>,
}

/// A texture in figures.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct TextureDescription {
    /// Its file.
    pub name: String,
    /// Width in texels.
    pub width: u32,
    /// Height in texels.
    pub height: u32,
    /// Memory that it takes.
    pub bytes: u64,
    /// `srgb8` or `linear`.
    pub kind: &'static str,
}

/// A camera in figures, named as in a scene file.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CameraDescription {
    /// Where it stands.
    pub eye: [f32; 3],
    /// What it looks at.
    pub target: [f32; 3],
    /// Roughly up.
    pub up: [f32; 3],
    /// Full vertical angle of view in degrees.
    pub vfov: f32,
    /// Diameter of the lens.
    pub aperture: f32,
    /// Distance of the plane in focus.
    pub focus_distance: f32,
}

/// Settings, named as in a scene file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SettingsDescription {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// `box`, `tent` or `gaussian`.
    pub filter: &'static str,
    /// Samples per pixel.
    pub spp: u32,
    /// Most path segments.
    pub max_depth: u32,
    /// Shadow rays by depth.
    pub light_samples: Vec<u32>,
    /// Indirect rays by depth.
    pub indirect_samples: Vec<u32>,
    /// From where Russian roulette ends paths, if at all.
    pub roulette_depth: Option<u32>,
    /// Names the random numbers.
    pub seed: u64,
}

impl Description {
    /// Describes a scene.
    #[must_use]
    pub fn of(loaded: &Loaded) -> Self {
        let scene = &loaded.scene;
        let Scene { geometry, prototypes, .. } = scene;
        let placed_objects =
            prototypes.iter().map(|it| it.geometry.objects.len() * it.placings.len());
        let object_count = geometry.objects.len() + placed_objects.sum::<usize>();
        let stored = || geometries(scene);
        let bounds =
            Bounds::of(geometry, prototypes).unwrap_or(Bounds { min: [0.0; 3], max: [0.0; 3] });
        Self {
            geometric_objects: object_count - loaded.light_object_count,
            light_sources: loaded.light_object_count,
            triangles: scene.triangle_count(),
            prototypes: prototypes.len(),
            placements: prototypes.iter().map(|it| it.placings.len()).sum(),
            light_triangles: scene.luminaire_count(),
            degenerate_triangles: loaded.degenerate_count,
            vertices: stored().map(|it| it.positions.len()).sum(),
            bounds_min: bounds.min,
            bounds_max: bounds.max,
            materials: materials(scene),
            textures: scene.tables.textures.iter().map(TextureDescription::of).collect(),
            environment: environment(scene),
            camera: CameraDescription::of(&loaded.camera),
            cameras: loaded.cameras.keys().cloned().collect(),
            settings: SettingsDescription::of(&loaded.settings),
            memory_bytes: memory(scene),
            warnings: loaded.warnings.clone(),
        }
    }
}

impl TextureDescription {
    fn of(texture: &super::Texture) -> Self {
        Self {
            name: texture.name.clone(),
            width: texture.width,
            height: texture.height,
            bytes: byte_count(texture),
            kind: match texture.texels {
                Texels::Srgb8(_) => "srgb8",
                Texels::Linear(_) => "linear",
            },
        }
    }
}

impl CameraDescription {
    const fn of(camera: &Camera) -> Self {
        Self {
            eye: camera.eye,
            target: camera.target,
            up: camera.up,
            vfov: camera.vfov,
            aperture: camera.aperture,
            focus_distance: camera.focus_distance,
        }
    }
}

impl SettingsDescription {
    fn of(settings: &crate::job::Settings) -> Self {
        Self {
            width: settings.width,
            height: settings.height,
            filter: match settings.filter {
                Filter::Box => "box",
                Filter::Tent => "tent",
                Filter::Gaussian => "gaussian",
            },
            spp: settings.samples_per_pixel,
            max_depth: settings.max_depth,
            light_samples: settings.light_samples.as_slice().to_vec(),
            indirect_samples: settings.indirect_samples.as_slice().to_vec(),
            roulette_depth: settings.roulette_depth,
            seed: settings.seed,
        }
    }
}

fn materials(scene: &Scene) -> BTreeMap<&'static str, usize> {
    let mut kinds = BTreeMap::new();
    for material in &scene.tables.materials {
        let kind = match material.surface {
            _ if material.emission != [0.0; 3] => "emitter",
            Surface::Plain { .. } => "plain",
            Surface::Mirror { .. } => "mirror",
            Surface::Glass { .. } => "glass",
            Surface::Pbr { .. } => "pbr",
        };
        *kinds.entry(kind).or_default() += 1;
    }
    kinds
}

fn environment(scene: &Scene) -> String {
    match &scene.tables.environment {
        Environment::Black => "black".to_owned(),
        Environment::Constant { radiance: [r, g, b] } => format!("radiance {r} {g} {b}"),
        Environment::Image { texture, scale, rotation } => {
            let name = &scene.tables.textures[*texture as usize].name;
            format!("image {name}, scale {scale}, rotation {rotation}°")
        }
    }
}

/// All that is kept, what is placed several times once.
fn geometries(scene: &Scene) -> impl Iterator<Item = &Geometry> {
    std::iter::once(&scene.geometry).chain(scene.prototypes.iter().map(|it| &it.geometry))
}

fn memory(scene: &Scene) -> u64 {
    let textures: u64 = scene.tables.textures.iter().map(byte_count).sum();
    let places: usize = scene.prototypes.iter().map(|it| it.placings.len()).sum();
    let geometries: u64 = geometries(scene).map(geometry_bytes).sum();
    textures + geometries + BYTES_PER_PLACE * places as u64
}

fn geometry_bytes(geometry: &Geometry) -> u64 {
    let Geometry { positions, normals, texcoords, triangles, objects } = geometry;
    let tables = size_of_val(positions.as_slice())
        + size_of_val(normals.as_slice())
        + size_of_val(texcoords.as_slice())
        + size_of_val(triangles.as_slice())
        + size_of_val(objects.as_slice());
    tables as u64 + TREE_BYTES_PER_TRIANGLE * triangles.len() as u64
}

impl fmt::Display for Description {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "geometric objects  {}", self.geometric_objects)?;
        writeln!(f, "light sources      {}", self.light_sources)?;
        let lights = self.light_triangles;
        writeln!(f, "triangles          {} ({lights} emit)", self.triangles)?;
        if self.prototypes > 0 {
            let (prototypes, placements) = (self.prototypes, self.placements);
            writeln!(f, "placed models      {prototypes} at {placements} places")?;
        }
        writeln!(f, "vertices           {}", self.vertices)?;
        let ([x0, y0, z0], [x1, y1, z1]) = (self.bounds_min, self.bounds_max);
        writeln!(f, "bounds             ({x0} {y0} {z0}) to ({x1} {y1} {z1})")?;
        let kinds = self.materials.iter().map(|(kind, count)| format!("{count} {kind}"));
        writeln!(f, "materials          {}", kinds.collect::<Vec<_>>().join(", "))?;
        writeln!(f, "textures           {}", self.textures.len())?;
        for TextureDescription { name, width, height, bytes, kind } in &self.textures {
            writeln!(f, "  {name}  {width}×{height} {kind}, {}", Bytes(*bytes))?;
        }
        writeln!(f, "environment        {}", self.environment)?;
        let CameraDescription { eye, target, vfov, .. } = self.camera;
        let ([ex, ey, ez], [tx, ty, tz]) = (eye, target);
        writeln!(f, "camera             ({ex} {ey} {ez}) to ({tx} {ty} {tz}), vfov {vfov}°")?;
        if !self.cameras.is_empty() {
            writeln!(f, "other cameras      {}", self.cameras.join(", "))?;
        }
        let SettingsDescription { width, height, filter, spp, max_depth, seed, .. } = self.settings;
        writeln!(f, "film               {width}×{height}, {filter} filter")?;
        writeln!(f, "integrator         {spp} spp, max depth {max_depth}, seed {seed}")?;
        writeln!(f, "memory             about {}", Bytes(self.memory_bytes))?;
        self.warnings.iter().try_for_each(|warning| writeln!(f, "warning: {warning}"))
    }
}

/// A number of bytes as people read it.
pub struct Bytes(pub u64);

impl fmt::Display for Bytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let bytes = self.0 as f64;
        let units = [(KIBI * KIBI * KIBI, "GiB"), (KIBI * KIBI, "MiB"), (KIBI, "KiB")];
        match units.into_iter().find(|(unit, _)| bytes >= *unit) {
            Some((unit, name)) => write!(f, "{:.1} {name}", bytes / unit),
            None => write!(f, "{bytes} B"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::files::Pack;
    use crate::scene::load::load;

    #[test]
    fn a_scene_is_described_in_words_and_in_json() {
        let obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 2 0\no a\nusemtl m\nf 1 2 3\no b\n\
                   usemtl m\nf 1 2 3\nusemtl l\nf 1 2 3\nf 1 1 1\n";
        let mtl = "newmtl m\nKs 1 1 1\nillum 3\nnewmtl l\nKe 1 1 1\n";
        let files = [("a.obj", obj), ("a.mtl", mtl)];
        let files = files.map(|(name, text)| (name.to_owned(), text.into()));
        let loaded = load(&Pack::from_files(files).unwrap(), "a.obj").unwrap();
        let description = Description::of(&loaded);
        assert_eq!((description.geometric_objects, description.light_sources), (1, 1));
        assert_eq!((description.triangles, description.light_triangles), (3, 1));
        assert_eq!(description.materials, BTreeMap::from([("emitter", 1), ("mirror", 1)]));
        let text = description.to_string();
        for line in [
            "triangles          3 (1 emit)",
            "bounds             (0 0 0) to (1 2 0)",
            "materials          1 emitter, 1 mirror",
            "film               640×480, box filter",
            "warning: 1 degenerate triangles are left out",
        ] {
            assert!(text.contains(line), "{line}\n{text}");
        }
        let json = serde_json::to_value(&description).unwrap();
        assert_eq!(json["settings"]["spp"], 64);
    }

    #[test]
    fn bytes_are_rounded_for_people() {
        let texts = [999, 2048, 5 << 20, 3 << 30].map(|bytes| Bytes(bytes).to_string());
        assert_eq!(texts, ["999 B", "2.0 KiB", "5.0 MiB", "3.0 GiB"]);
    }
}
