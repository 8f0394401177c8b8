//! A scene in the making: things that reflect and things that shine, each in a file of its own, and
//! the texts that go with them.

use crate::files::{Counts, Files};
use crate::frame::Frame;
use crate::material::Material;
use crate::model::Model;
use crate::number::{POSITION_DECIMALS, numbers};
use crate::shape::Shape;
use crate::vector::Vector;

/// Where the picture is taken from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct View {
    pub(crate) eye: Vector,
    pub(crate) target: Vector,
    /// Full vertical angle in degrees.
    pub(crate) vfov: f64,
    /// Width and height in pixels.
    pub(crate) size: (u32, u32),
    pub(crate) filter: &'static str,
}

/// What the README of a scene says besides its counts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct About {
    /// The name of the scene, which is also that of its files.
    pub(crate) name: &'static str,
    /// What it shows: Markdown.
    pub(crate) shows: &'static str,
    /// Where it comes from and how it may be used: Markdown.
    pub(crate) source: &'static str,
}

/// A scene in the making.
#[derive(Debug)]
pub(crate) struct Stage {
    about: About,
    objects: Model,
    lights: Model,
}

impl Stage {
    pub(crate) fn new(about: About) -> Self {
        let mtl = format!("{}.mtl", about.name);
        let comment = |what| format!("Equilux {}: {what}; metres, y up", about.name);
        Self {
            about,
            objects: Model::new(&comment("what reflects"), &mtl),
            lights: Model::new(&comment("what shines, on the front of its faces"), &mtl),
        }
    }

    /// Puts a thing in its place. What shines goes with the lights.
    pub(crate) fn put(
        &mut self,
        noun: &'static str,
        material: &Material,
        at: &Frame,
        shape: Shape,
    ) {
        let model = if material.emits() { &mut self.lights } else { &mut self.objects };
        model.add(noun, material, &shape.placed(at));
    }

    /// Objects so far that do not shine.
    pub(crate) fn object_count(&self) -> u64 {
        self.objects.object_count()
    }

    /// The finished files.
    pub(crate) fn into_files(self, view: &View) -> Files {
        let counts = Counts {
            objects: self.objects.object_count(),
            lights: self.lights.object_count(),
            triangles: self.objects.triangle_count() + self.lights.triangle_count(),
        };
        let name = self.about.name;
        let obj = format!("{name}.obj");
        let files = vec![
            ("scene.json".to_owned(), scene_json(view, &[&obj, "lights.obj"])),
            ("README.md".to_owned(), readme(&self.about, counts)),
            (format!("{name}.mtl"), self.mtl()),
            ("lights.obj".to_owned(), self.lights.into_text()),
            (obj, self.objects.into_text()),
        ];
        Files::new(counts, files)
    }

    fn mtl(&self) -> String {
        let mut all = self.objects.materials().clone();
        all.extend(self.lights.materials());
        let heading = format!("# Equilux {}: reflectances in linear RGB\n\n", self.about.name);
        let entries = all.values().map(|material| {
            assert!(material.conserves_energy(), "{} reflects too much", material.name);
            material.to_mtl()
        });
        heading + &entries.collect::<String>()
    }
}

fn scene_json(view: &View, models: &[&str]) -> String {
    let list = |v: Vector| numbers(&[v.x, v.y, v.z], POSITION_DECIMALS).replace(' ', ", ");
    let vfov = numbers(&[view.vfov], POSITION_DECIMALS);
    let (width, height) = view.size;
    let models: Vec<String> =
        models.iter().map(|file| format!("    {{ \"file\": \"{file}\" }}")).collect();
    [
        "{".to_owned(),
        "  \"equilux\": 1,".to_owned(),
        "  \"camera\": {".to_owned(),
        format!("    \"eye\": [{}],", list(view.eye)),
        format!("    \"target\": [{}],", list(view.target)),
        "    \"up\": [0, 1, 0],".to_owned(),
        format!("    \"vfov\": {vfov}"),
        "  },".to_owned(),
        format!(
            "  \"film\": {{ \"width\": {width}, \"height\": {height}, \"filter\": \"{}\" }},",
            view.filter
        ),
        "  \"integrator\": {".to_owned(),
        "    \"spp\": 64,".to_owned(),
        "    \"max_depth\": 8,".to_owned(),
        "    \"light_samples\": 1,".to_owned(),
        "    \"indirect_samples\": 1,".to_owned(),
        "    \"seed\": 1".to_owned(),
        "  },".to_owned(),
        format!("  \"models\": [\n{}\n  ]", models.join(",\n")),
        "}\n".to_owned(),
    ]
    .join("\n")
}

/// How the materials are meant.
const MATERIALS: &str = "\
Reflectances (`Kd`, `Ks`) and emission (`Ke`, as radiance) are linear RGB with Rec. 709 primaries.
`illum 1` is diffuse; `illum 2` adds to `Kd`/π a GGX gloss of reflectance `Ks` and alpha = √(2 /
(`Ns` + 2)); `illum 3` is a perfect mirror. Surfaces reflect on both sides; lights shine from the
side on which the corners of their faces run counter-clockwise. The background is black.";

fn readme(about: &About, counts: Counts) -> String {
    format!(
        "# {}\n\n{}\n\n| | count |\n|---|---|\n| geometric objects | {} |\n| light sources | {} |\n\
         | triangles | {} |\n\n## Materials\n\n{MATERIALS}\n\n## Source and licence\n\n{}\n",
        about.name,
        about.shows.trim(),
        counts.objects,
        counts.lights,
        counts.triangles,
        about.source.trim(),
    )
}
