//! What the command line says in place of the scene file: applied to settings here, or sent to a
//! service as fields of a job.

use std::collections::BTreeMap;

use equilux_common::balancing::{Balance, Balancing, Word};
use equilux_common::job::Settings;
use equilux_common::scene::camera::Camera;
use equilux_common::scene::load::{Loaded, camera_named};
use equilux_common::topology::Topology;
use equilux_common::unit::Rect;
use serde_json::{Map, Value, json};

use crate::args::{Crop, SettingsArgs, Size, SpreadArgs};

/// How much smaller each side of a quick preview is.
const QUICK_SIDE: u32 = 2;

/// How many times fewer samples a quick preview has.
const QUICK_SAMPLES: u32 = 4;

/// What a scene says, which holds unless the command line says otherwise.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Defaults<'a> {
    pub(crate) camera: &'a Camera,
    pub(crate) cameras: &'a BTreeMap<String, Camera>,
    pub(crate) settings: &'a Settings,
}

impl<'a> Defaults<'a> {
    /// What a scene in memory says.
    pub(crate) const fn of(loaded: &'a Loaded) -> Self {
        Self { camera: &loaded.camera, cameras: &loaded.cameras, settings: &loaded.settings }
    }
}

/// The camera and the settings of a scene, with the command line's say.
pub(crate) fn apply(
    args: &SettingsArgs,
    defaults: &Defaults<'_>,
) -> anyhow::Result<(Camera, Settings)> {
    let mut settings = defaults.settings.clone();
    set(&mut settings.samples_per_pixel, args.spp);
    set(&mut settings.width, args.size.map(|size| size.width));
    set(&mut settings.height, args.size.map(|size| size.height));
    set(&mut settings.max_depth, args.max_depth);
    set(&mut settings.seed, args.seed);
    if let Some(crop) = args.crop {
        settings.crop = Some(crop.0);
    }
    if args.quick {
        make_quick(args, &mut settings);
    }
    settings.check()?;
    let camera = match &args.camera {
        Some(name) => camera_named(defaults.cameras, name)?,
        None => *defaults.camera,
    };
    Ok((camera, settings))
}

/// The same as fields of a job that is sent to a service, which applies them to the scene there.
pub(crate) fn job_fields(
    args: &SettingsArgs,
    defaults: &Defaults<'_>,
) -> anyhow::Result<Map<String, Value>> {
    let (_, settings) = apply(args, defaults)?;
    let complete = SettingsArgs {
        spp: Some(settings.samples_per_pixel),
        size: Some(Size { width: settings.width, height: settings.height }),
        max_depth: Some(settings.max_depth),
        seed: Some(settings.seed),
        crop: settings.crop.map(Crop),
        quick: false,
        ..args.clone()
    };
    Ok(wishes(&complete))
}

/// What the command line says itself, but for previews, as fields of a job on a scene that only the
/// service knows.
pub(crate) fn wishes(args: &SettingsArgs) -> Map<String, Value> {
    let fields = [
        ("spp", args.spp.map(Value::from)),
        ("width", args.size.map(|size| size.width.into())),
        ("height", args.size.map(|size| size.height.into())),
        ("max_depth", args.max_depth.map(Value::from)),
        ("seed", args.seed.map(Value::from)),
        ("crop", args.crop.map(|Crop(Rect { x0, y0, x1, y1 })| json!([x0, y0, x1, y1]))),
        ("camera", args.camera.clone().map(Value::from)),
        ("balance", Some(args.balance.name().into())),
        ("diffusion_step", Some(args.spread.diffusion_step.name().into())),
        ("give_first", Some(args.spread.give_first.name().into())),
        ("exchange", Some(args.spread.exchange.name().into())),
        ("mapping", Some(args.spread.mapping.name().into())),
        ("topology", Some(topology_field(&args.spread.topology.0))),
    ];
    let said = fields.into_iter().filter_map(|(name, value)| Some((name.to_owned(), value?)));
    said.collect()
}

/// A topology as REST takes it: a word, or a list of edges.
fn topology_field(topology: &Topology) -> Value {
    match topology {
        Topology::Graph(graph) => json!(graph.edges()),
        named => json!(named.name()),
    }
}

/// How work is to be spread.
pub(crate) const fn balancing(balance: Balance, args: &SpreadArgs) -> Balancing {
    let (step, give_first, exchange) = (args.diffusion_step, args.give_first, args.exchange);
    Balancing { balance, step, give_first, exchange, mapping: args.mapping }
}

/// A preview: what the command line does not say itself gets smaller.
fn make_quick(args: &SettingsArgs, settings: &mut Settings) {
    if args.size.is_none() {
        settings.width = settings.width.div_ceil(QUICK_SIDE);
        settings.height = settings.height.div_ceil(QUICK_SIDE);
        settings.crop = settings.crop.map(smaller);
    }
    if args.spp.is_none() {
        settings.samples_per_pixel = settings.samples_per_pixel.div_ceil(QUICK_SAMPLES);
    }
}

/// The rectangle on an image of which each side is smaller; never empty.
const fn smaller(crop: Rect) -> Rect {
    Rect {
        x0: crop.x0 / QUICK_SIDE,
        y0: crop.y0 / QUICK_SIDE,
        x1: crop.x1.div_ceil(QUICK_SIDE),
        y1: crop.y1.div_ceil(QUICK_SIDE),
    }
}

fn set<T>(field: &mut T, value: Option<T>) {
    if let Some(value) = value {
        *field = value;
    }
}
