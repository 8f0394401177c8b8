//! One image, to the bit: whatever the number of threads and workers and whatever the balancing,
//! the file is the one that the reference renderer defines.

use equilux_common::image::Image;
use equilux_common::job::{JobSpec, SceneRef};
use equilux_common::scene::files::Directory;
use equilux_common::scene::load::load;
use equilux_common::unit::Granularity;
use equilux_render::reference;
use equilux_render::renderer::Renderer;

use crate::support::{directory, file, shipped, succeed};

const WIDTH: u32 = 48;
const HEIGHT: u32 = 40;
const SAMPLES: u32 = 3;

#[test]
fn cornell_box_is_the_same_however_it_is_made() {
    is_the_same_however_it_is_made("cornell-box");
}

#[test]
fn office_is_the_same_however_it_is_made() {
    is_the_same_however_it_is_made("office");
}

#[test]
fn bathroom_is_the_same_however_it_is_made() {
    is_the_same_however_it_is_made("bathroom");
}

fn is_the_same_however_it_is_made(scene: &str) {
    let expected = reference_exr(scene);
    let ways: [&[&str]; 10] = [
        &["--threads", "1"],
        &["--threads", "2", "--instructions", "portable"],
        &["--workers", "2", "--threads", "1", "--instructions", "portable"],
        &["--threads", "2"],
        &["--threads", "4"],
        &["--workers", "1"],
        &["--workers", "2", "--threads", "2"],
        &["--workers", "3", "--threads", "1", "--topology", "ring"],
        &["--workers", "5", "--threads", "1"],
        &["--workers", "3", "--threads", "1", "--balance", "none"],
    ];
    for way in ways {
        assert!(render(scene, way) == expected, "{scene} differs with {way:?}");
    }
}

fn render(scene: &str, way: &[&str]) -> Vec<u8> {
    let outputs = directory();
    let outfile = file(&outputs, "image.exr");
    let (size, samples) = (format!("{WIDTH}x{HEIGHT}"), SAMPLES.to_string());
    let scene = shipped(scene);
    let args = ["render", &scene, "--size", &size, "--spp", &samples, "--quiet", "-o", &outfile];
    succeed(args.into_iter().chain(way.iter().copied()));
    std::fs::read(outfile).expect("the image")
}

/// The image as it is defined: by a plain loop, in this process.
fn reference_exr(scene: &str) -> Vec<u8> {
    let (files, entry) = Directory::of(shipped(scene).as_ref()).expect("a scene");
    let loaded = load(&files, &entry).expect("a good scene");
    let mut settings = loaded.settings.clone();
    (settings.width, settings.height, settings.samples_per_pixel) = (WIDTH, HEIGHT, SAMPLES);
    let spec = JobSpec {
        id: Default::default(),
        scene: SceneRef { hash: [0; 32], pack_bytes: 0, entry },
        camera: loaded.camera,
        granularity: Granularity::for_job(settings.region(), SAMPLES, 2),
        settings,
    };
    let renderer = Renderer::new(loaded.scene, &spec.camera, &spec.settings, spec.grid());
    let film = reference::render(&renderer.expect("a scene that can be rendered"));
    Image::develop(&film, &spec.settings).to_exr().expect("an image")
}
