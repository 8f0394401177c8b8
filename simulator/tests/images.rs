//! Real images under simulated disorder: the film of a cluster whose messages are late and whose
//! workers die equals that of the reference renderer to the bit.

use std::path::PathBuf;
use std::time::Duration;

use equilux_common::ids::JobId;
use equilux_common::job::{JobSpec, SceneRef};
use equilux_common::scene::files::Directory;
use equilux_common::scene::load::load;
use equilux_common::unit::Granularity;
use equilux_coordinator_core::action::JobState;
use equilux_render::reference;
use equilux_render::renderer::Renderer;
use equilux_simulator::counts::Counts;
use equilux_simulator::light::LightTracer;
use equilux_simulator::plan::Plan;
use equilux_simulator::simulation::Simulation;

const SEEDS: [u64; 3] = [5, 11, 14];

fn prepare(name: &str) -> (JobSpec, impl Fn() -> LightTracer + use<>) {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../scenes").join(name);
    let (files, entry) = Directory::of(&path.join("scene.json")).expect("a shipped scene");
    let loaded = load(&files, &entry).expect("a shipped scene");
    let mut settings = loaded.settings;
    (settings.width, settings.height, settings.samples_per_pixel) = (28, 20, 6);
    let spec = JobSpec {
        id: JobId(1),
        scene: SceneRef { hash: [0; 32], pack_bytes: 0, entry },
        camera: loaded.camera,
        settings,
        granularity: Granularity { tile_side_pixels: 8, samples_per_unit: 4 },
    };
    let tracer = {
        let (spec, scene) = (spec.clone(), loaded.scene);
        move || {
            let (camera, settings) = (&spec.camera, &spec.settings);
            let renderer = Renderer::new(scene.clone(), camera, settings, spec.grid());
            LightTracer::new(renderer.expect("a shipped scene"), Duration::from_micros(300))
        }
    };
    (spec, tracer)
}

fn renders_as_defined(name: &str) {
    let (spec, tracer) = prepare(name);
    let expected = reference::render(tracer().renderer());
    let mut total = Counts::default();
    for plan in SEEDS.map(Plan::calm).into_iter().chain(SEEDS.map(Plan::stormy)) {
        let seed = plan.seed;
        let mut simulation = Simulation::new(plan.rendering(spec.clone()), tracer());
        simulation.run();
        let view = &simulation.jobs()[&JobId(1)];
        let report = view.report.as_ref().expect("it was reported");
        assert_eq!(report.state, JobState::Done, "{name}, seed {seed}");
        assert!(view.film.sums == expected, "{name}, seed {seed}: another image");
        total.given += simulation.counts().given;
        total.rays_given += simulation.counts().rays_given;
    }
    assert!(total.given > total.rays_given && total.rays_given > 0, "{name}: {total:?}");
}

#[test]
fn the_cornell_box_renders_as_defined() {
    renders_as_defined("cornell-box");
}

#[test]
fn the_office_renders_as_defined() {
    renders_as_defined("office");
}

#[test]
fn the_bathroom_renders_as_defined() {
    renders_as_defined("bathroom");
}
