//! The JSON scene file: what it may say, and what holds where it says nothing.

use std::collections::BTreeMap;

use super::json::{Document, Fields, Node, single};
use super::material::{MATERIAL_KEYS, Override};
use super::texture::TextureRef;
use super::transform;
use crate::job::{DEPTH_MAX, Filter, PerDepth, SAMPLES_MAX, SIDE_PIXELS_MAX, SPLIT_MAX, Settings};
use crate::scene::camera::Camera;
use crate::scene::error::{Place, SceneError};
use crate::scene::placing::{COORDINATE_MAX, Transform};

/// Largest radiance: the film clamps a contribution at 2²⁰, and a light this bright is a mistake.
pub(super) const RADIANCE_MAX: f64 = 1e9;

/// The version of the format that this reader knows.
const FORMAT_VERSION: u64 = 1;

/// Angles of view between which a picture can be made, in degrees.
const VFOV_DEGREES: std::ops::RangeInclusive<f64> = 0.001..=179.9;

/// Angle of view where none is given: that of a 35 mm lens on film of 24 mm.
pub(super) const VFOV_DEFAULT: f32 = 38.0;

/// A scene file, understood but without the files that it refers to.
#[derive(Debug)]
pub(super) struct SceneFile {
    pub(super) camera: Camera,
    pub(super) cameras: BTreeMap<String, Camera>,
    pub(super) settings: Settings,
    pub(super) environment: EnvironmentEntry,
    pub(super) models: Vec<ModelEntry>,
    pub(super) materials: BTreeMap<String, Override>,
}

/// A model and where it stands.
#[derive(Debug)]
pub(super) struct ModelEntry {
    pub(super) file: String,
    pub(super) place: Place,
    pub(super) transform: Transform,
    /// The material of faces that name none.
    pub(super) material: Option<NamedMaterial>,
}

/// A material by its name, and where it is named.
#[derive(Clone, Debug)]
pub(super) struct NamedMaterial {
    pub(super) name: String,
    pub(super) place: Place,
}

impl ModelEntry {
    /// The model file called `entry` where it is, without a scene file around it.
    pub(super) fn alone(entry: &str) -> Self {
        Self {
            file: entry.rsplit('/').next().unwrap_or(entry).to_owned(),
            place: Place::file(entry),
            transform: Transform::IDENTITY,
            material: None,
        }
    }
}

/// Light from everywhere, before its image is read.
#[derive(Debug)]
pub(super) enum EnvironmentEntry {
    Black,
    Constant { radiance: [f32; 3] },
    Image { image: TextureRef, scale: f32, rotation: f32 },
}

/// What holds where a scene says nothing.
pub(super) fn default_settings() -> Settings {
    Settings {
        width: 640,
        height: 480,
        crop: None,
        filter: Filter::Box,
        samples_per_pixel: 64,
        max_depth: 8,
        light_samples: PerDepth::default(),
        indirect_samples: PerDepth::default(),
        roulette_depth: None,
        seed: 0,
    }
}

impl SceneFile {
    /// Reads the text of the scene file called `file`.
    pub(super) fn read(file: &str, text: &str) -> Result<Self, SceneError> {
        const KEYS: [&str; 8] = [
            "equilux",
            "camera",
            "cameras",
            "film",
            "integrator",
            "environment",
            "models",
            "materials",
        ];
        let document = Document::new(file, text);
        let root = Node::root(&document)?;
        let any = root.any_fields()?;
        let version = any.require("equilux", "write \"equilux\": 1 to mark the file as a scene")?;
        version.whole(FORMAT_VERSION..=FORMAT_VERSION)?;
        let fields = root.fields(&KEYS)?;
        let camera = fields.require("camera", "write {\"eye\": […], \"target\": […]}")?;
        Ok(Self {
            camera: read_camera(&camera)?,
            cameras: read_cameras(&fields)?,
            settings: read_settings(&fields)?,
            environment: read_environment(&fields)?,
            models: read_models(&fields)?,
            materials: read_materials(&fields)?,
        })
    }
}

fn read_cameras(fields: &Fields<'_>) -> Result<BTreeMap<String, Camera>, SceneError> {
    let Some(node) = fields.get("cameras") else { return Ok(BTreeMap::new()) };
    let cameras = node.any_fields()?;
    cameras.members().map(|(name, node)| Ok((name.to_owned(), read_camera(&node)?))).collect()
}

fn read_camera(node: &Node<'_>) -> Result<Camera, SceneError> {
    let keys = ["eye", "target", "up", "vfov", "aperture", "focus_distance"];
    let fields = node.fields(&keys)?;
    let range = -COORDINATE_MAX..=COORDINATE_MAX;
    let eye: [f64; 3] = fields.require("eye", "write where it stands")?.numbers(range.clone())?;
    let target = fields.require("target", "write what it looks at")?;
    let target: [f64; 3] = target.numbers(range.clone())?;
    let up = fields.get("up").map_or(Ok([0.0, 1.0, 0.0]), |up| up.numbers(range))?;
    let view: [f64; 3] = std::array::from_fn(|axis| target[axis] - eye[axis]);
    let distance = length(view);
    if single(distance) == 0.0 || eye.map(single) == target.map(single) {
        return Err(node.invalid("\"eye\" and \"target\" must differ"));
    }
    check_up(node, view, up)?;
    let number = |key: &str, range, default| {
        fields.get(key).map_or(Ok(default), |node: Node<'_>| node.float(range))
    };
    Ok(Camera {
        eye: eye.map(single),
        target: target.map(single),
        up: up.map(single),
        vfov: number("vfov", VFOV_DEGREES, VFOV_DEFAULT)?,
        aperture: number("aperture", 0.0..=COORDINATE_MAX, 0.0)?,
        focus_distance: number("focus_distance", 1e-9..=COORDINATE_MAX, single(distance))?,
    })
}

/// The view and the upward direction must span a plane.
fn check_up(node: &Node<'_>, view: [f64; 3], up: [f64; 3]) -> Result<(), SceneError> {
    const SINE_MIN: f64 = 1e-6;
    let cross = [
        view[1] * up[2] - view[2] * up[1],
        view[2] * up[0] - view[0] * up[2],
        view[0] * up[1] - view[1] * up[0],
    ];
    if length(cross) > SINE_MIN * length(view) * length(up) {
        return Ok(());
    }
    Err(node.invalid("\"up\" must not be zero or parallel to the view; try [0, 0, 1]"))
}

fn length(v: [f64; 3]) -> f64 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}

fn read_settings(fields: &Fields<'_>) -> Result<Settings, SceneError> {
    let mut settings = default_settings();
    if let Some(node) = fields.get("film") {
        read_film(&node, &mut settings)?;
        settings.check().map_err(|error| node.invalid(error.problem))?;
    }
    if let Some(node) = fields.get("integrator") {
        read_integrator(&node, &mut settings)?;
        settings.check().map_err(|error| node.invalid(error.problem))?;
    }
    Ok(settings)
}

fn read_film(node: &Node<'_>, settings: &mut Settings) -> Result<(), SceneError> {
    let fields = node.fields(&["width", "height", "filter"])?;
    if let Some(width) = fields.get("width") {
        settings.width = width.count(1..=SIDE_PIXELS_MAX)?;
    }
    if let Some(height) = fields.get("height") {
        settings.height = height.count(1..=SIDE_PIXELS_MAX)?;
    }
    if let Some(filter) = fields.get("filter") {
        settings.filter = match filter.word(&["box", "tent", "gaussian"])? {
            "box" => Filter::Box,
            "tent" => Filter::Tent,
            _ => Filter::Gaussian,
        };
    }
    Ok(())
}

fn read_integrator(node: &Node<'_>, settings: &mut Settings) -> Result<(), SceneError> {
    let fields = node.fields(&[
        "spp",
        "max_depth",
        "light_samples",
        "indirect_samples",
        "seed",
        "roulette_depth",
    ])?;
    if let Some(spp) = fields.get("spp") {
        settings.samples_per_pixel = spp.count(1..=SAMPLES_MAX)?;
    }
    if let Some(depth) = fields.get("max_depth") {
        settings.max_depth = depth.count(1..=DEPTH_MAX)?;
    }
    if let Some(numbers) = fields.get("light_samples") {
        settings.light_samples = read_per_depth(&numbers)?;
    }
    if let Some(numbers) = fields.get("indirect_samples") {
        settings.indirect_samples = read_per_depth(&numbers)?;
    }
    if let Some(seed) = fields.get("seed") {
        settings.seed = seed.whole(0..=u64::MAX)?;
    }
    if let Some(depth) = fields.get("roulette_depth") {
        settings.roulette_depth = Some(depth.count(0..=DEPTH_MAX)?);
    }
    Ok(())
}

fn read_per_depth(node: &Node<'_>) -> Result<PerDepth, SceneError> {
    let numbers = if node.is_list() {
        node.items()?.iter().map(|item| item.count(0..=SPLIT_MAX)).collect::<Result<_, _>>()?
    } else {
        vec![node.count(0..=SPLIT_MAX)?]
    };
    PerDepth::new(numbers).map_err(|error| node.invalid(error.to_string()))
}

fn read_environment(fields: &Fields<'_>) -> Result<EnvironmentEntry, SceneError> {
    let Some(node) = fields.get("environment") else { return Ok(EnvironmentEntry::Black) };
    let fields = node.fields(&["radiance", "image", "scale", "rotation"])?;
    match (fields.get("radiance"), fields.get("image")) {
        (Some(radiance), None) => {
            if let Some(extra) = fields.get("scale").or_else(|| fields.get("rotation")) {
                return Err(extra.invalid("goes with \"image\" only"));
            }
            Ok(EnvironmentEntry::Constant { radiance: radiance.triple(0.0..=RADIANCE_MAX)? })
        }
        (None, Some(image)) => {
            let number = |key, range, default| {
                fields.get(key).map_or(Ok(default), |node: Node<'_>| node.float(range))
            };
            Ok(EnvironmentEntry::Image {
                image: TextureRef { file: image.string()?, place: image.place() },
                scale: number("scale", 0.0..=RADIANCE_MAX, 1.0)?,
                rotation: number("rotation", -360.0..=360.0, 0.0)?,
            })
        }
        _ => Err(node.invalid("give either \"radiance\" or \"image\"")),
    }
}

fn read_models(fields: &Fields<'_>) -> Result<Vec<ModelEntry>, SceneError> {
    let node = fields.require("models", "write [{\"file\": \"….ply\"}]")?;
    let items = node.items()?;
    if items.is_empty() {
        return Err(node.invalid("must name at least one model, as in [{\"file\": \"….ply\"}]"));
    }
    items.iter().map(read_model).collect()
}

fn read_model(node: &Node<'_>) -> Result<ModelEntry, SceneError> {
    let fields = node.fields(&["file", "transform", "material"])?;
    let file = fields.require("file", "write the name of the .obj or .ply file")?;
    let transform = fields.get("transform");
    let material = fields.get("material").map(|material| {
        material.string().map(|name| NamedMaterial { name, place: material.place() })
    });
    Ok(ModelEntry {
        place: file.place(),
        file: file.string()?,
        transform: transform
            .map_or(Ok(Transform::IDENTITY), |transform| transform::read(&transform))?,
        material: material.transpose()?,
    })
}

fn read_materials(fields: &Fields<'_>) -> Result<BTreeMap<String, Override>, SceneError> {
    let Some(node) = fields.get("materials") else { return Ok(BTreeMap::new()) };
    let materials = node.any_fields()?;
    let mut overrides = BTreeMap::new();
    for (name, node) in materials.members() {
        node.fields(&MATERIAL_KEYS)?;
        overrides.insert(name.to_owned(), Override::read(&node)?);
    }
    Ok(overrides)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: &str = r#""camera": {"eye": [0, 0, 5], "target": [0, 0, 0]}"#;
    const MODELS: &str = r#""models": [{"file": "a.obj"}]"#;

    fn read(rest: &str) -> Result<SceneFile, SceneError> {
        SceneFile::read("s.json", &format!("{{\"equilux\": 1,\n{rest}\n}}"))
    }

    fn with(rest: &str) -> Result<SceneFile, SceneError> {
        read(&format!("{CAMERA}, {MODELS},\n{rest}"))
    }

    fn message(result: Result<SceneFile, SceneError>) -> String {
        result.unwrap_err().to_string()
    }

    #[test]
    fn a_minimal_scene_has_sane_defaults() {
        let scene = read(&format!("{CAMERA}, {MODELS}")).unwrap();
        assert_eq!(scene.settings, default_settings());
        assert_eq!(scene.camera.up, [0.0, 1.0, 0.0]);
        assert_eq!(scene.camera.focus_distance, 5.0);
        assert_eq!(scene.models[0].file, "a.obj");
    }

    #[test]
    fn everything_is_read() {
        let scene = with(
            r#""film": {"width": 10, "height": 20, "filter": "tent"},
            "integrator": {"spp": 3, "max_depth": 4, "light_samples": [4, 1], "seed": 9,
                "indirect_samples": 2, "roulette_depth": null},
            "environment": {"image": "sky.exr", "rotation": 90},
            "cameras": {"side": {"eye": [1, 0, 0], "target": [0, 0, 0], "vfov": 20}}"#,
        )
        .unwrap();
        assert_eq!((scene.settings.width, scene.settings.filter), (10, Filter::Tent));
        assert_eq!(scene.settings.light_samples.as_slice(), [4, 1]);
        assert_eq!(scene.settings.indirect_samples.as_slice(), [2]);
        assert_eq!(scene.cameras["side"].vfov, 20.0);
        assert!(matches!(scene.environment, EnvironmentEntry::Image { rotation: 90.0, .. }));
    }

    #[test]
    fn bad_input_names_line_field_and_remedy() {
        for (text, wanted) in [
            (r#""film": {"widht": 5}"#, "s.json:3: unknown key \"film.widht\"; did you mean"),
            (r#""film": {"width": 0}"#, "s.json:3: film.width: must be a whole number from 1"),
            (r#""film": {"width": 1000000000, "height": 1000000000}"#, "s.json:3: film.width: "),
            (r#""film": {"width": 60000, "height": 60000}"#, "3600000000 pixels are more than"),
            (r#""film": {"filter": "lanczos"}"#, "is none of \"box\", \"tent\", \"gaussian\""),
            (r#""integrator": {"spp": -1}"#, "integrator.spp: must be a whole number from 1 to"),
            (r#""integrator": {"spp": "many"}"#, "not \"many\""),
            (r#""integrator": {"light_samples": []}"#, "integrator.light_samples: a list of"),
            (r#""environment": {}"#, "environment: give either"),
            (r#""environment": {"radiance": [1, 2]}"#, "must be 3 numbers, not 2"),
            (r#""environment": {"radiance": [1, 2, -3]}"#, "environment.radiance[2]: -3 is not"),
            (r#""cammera": 1"#, "unknown key \"cammera\"; did you mean \"camera\"?"),
        ] {
            let error = message(with(text));
            assert!(error.contains(wanted), "{text}: {error}");
        }
    }

    #[test]
    fn a_missing_camera_or_model_is_an_error() {
        assert!(message(read(MODELS)).starts_with("s.json:1: \"camera\" is missing"));
        assert!(message(read(CAMERA)).starts_with("s.json:1: \"models\" is missing"));
        let error = message(read(&format!("{CAMERA}, \"models\": []")));
        assert!(error.contains("at least one model"), "{error}");
        let error = SceneFile::read("s.json", "{}").unwrap_err().to_string();
        assert!(error.contains("\"equilux\" is missing"), "{error}");
        let error = SceneFile::read("s.json", "{\"equilux\": 2}").unwrap_err().to_string();
        assert!(error.contains("equilux: must be a whole number from 1 to 1"), "{error}");
    }

    #[test]
    fn impossible_cameras_are_refused() {
        let camera = |text: &str| message(read(&format!("\"camera\": {{{text}}}, {MODELS}")));
        let at = r#""eye": [0, 0, 5], "target": [0, 0, 0]"#;
        assert!(camera(r#""eye": [1, 1, 1], "target": [1, 1, 1]"#).contains("must differ"));
        assert!(camera(&format!("{at}, \"up\": [0, 0, 1]")).contains("parallel"));
        assert!(camera(&format!("{at}, \"up\": [0, 0, 0]")).contains("parallel"));
        assert!(camera(&format!("{at}, \"vfov\": 180")).contains("camera.vfov: 180 is not"));
        assert!(camera(&format!("{at}, \"aperture\": -1")).contains("camera.aperture"));
        assert!(camera(&format!("{at}, \"vfov\": NaN")).contains("not valid JSON"));
        assert!(camera(r#""eye": [0, 0, 1e300], "target": [0, 0, 0]"#).contains("camera.eye[2]"));
    }
}
