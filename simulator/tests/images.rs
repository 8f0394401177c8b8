//! Real images under simulated disorder: the film of a cluster whose messages are late and whose
//! workers die equals that of the reference renderer to the bit.
//!
//! Every policy of balancing is tried on every topology, in clusters of several sizes whose
//! machines are of different speeds, claim other ones, and change theirs from piece to piece; and
//! again with the model cut, in clusters whose memories hold a part of it. All seeds are different.
//! Ten times as many run by `cargo test --release -p equilux-simulator --test images --
//! --ignored`, some minutes. What goes wrong is said with its seed and policy, which are enough to
//! play it again.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use equilux_common::balancing::{Balance, Balancing, DiffusionStep, GiveFirst, Word};
use equilux_common::bundle::Stage;
use equilux_common::film::TileSums;
use equilux_common::ids::JobId;
use equilux_common::job::{JobSpec, SceneRef};
use equilux_common::ray::Ray;
use equilux_common::scene::Scene;
use equilux_common::scene::files::Directory;
use equilux_common::scene::load::load;
use equilux_common::topology::{Graph, Topology};
use equilux_common::unit::Granularity;
use equilux_common::work::Work;
use equilux_coordinator_core::action::JobState;
use equilux_render::geometry::{Bounds, PARTITION_BOXES_MAX, Partition, PartitionBuilder};
use equilux_render::model::{Model, ModelParts};
use equilux_render::observer::Observer;
use equilux_render::reference;
use equilux_render::renderer::Renderer;
use equilux_render::scratch::Scratch;
use equilux_simulator::counts::Counts;
use equilux_simulator::light::LightTracer;
use equilux_simulator::plan::Plan;
use equilux_simulator::random::{Random, mix};
use equilux_simulator::simulation::Simulation;
use equilux_simulator::tracer::{Task, Traced, Tracer};

/// Counts of workers at which topologies have their full form (a hypercube of 8, a torus of 3 × 3
/// or 2 × 2 × 3), or not.
const WORKER_COUNTS: [usize; 5] = [5, 8, 9, 11, 12];

/// Speeds of machines, and what they claim as theirs.
const SPEEDS: [u32; 5] = [250, 500, 1000, 2000, 4000];

/// What a ray takes when it is quick.
const RAY_COST: Duration = Duration::from_micros(300);

/// How many times longer than the quickest a piece takes at most.
const SLOWNESS_MAX: u32 = 8;

/// Three circles of workers that hang together by one edge each: hard to get through.
const GRAPH: &str = "0 1\n1 2\n2 0\n2 3\n3 4\n4 5\n5 3\n5 6\n6 7\n7 8\n8 6\n";

/// How one image is made.
#[derive(Clone, Debug)]
struct Way {
    seed: u64,
    topology: Topology,
    balancing: Balancing,
    is_cut: bool,
}

fn topologies() -> [Topology; 6] {
    let graph = Graph::parse(GRAPH).expect("a graph");
    [
        Topology::Complete,
        Topology::Ring,
        Topology::Torus2d,
        Topology::Torus3d,
        Topology::Hypercube,
        Topology::Graph(Arc::new(graph)),
    ]
}

fn policies() -> Vec<Balancing> {
    let mut policies = Vec::new();
    for &balance in Balance::ALL {
        for &step in DiffusionStep::ALL {
            let policy =
                |&give_first| Balancing { balance, step, give_first, ..Balancing::default() };
            policies.extend(GiveFirst::ALL.iter().map(policy));
        }
    }
    policies
}

impl Way {
    /// With every other seed all are there from the start, with the others they come, die and
    /// come again.
    fn plan(&self, spec: &JobSpec) -> Plan {
        let is_calm = self.seed.is_multiple_of(2);
        let plan = if is_calm { Plan::calm(self.seed) } else { Plan::stormy(self.seed) };
        let plan = if self.is_cut { plan.partitioned() } else { plan };
        let mut plan = plan.rendering(spec.clone());
        let mut random = Random::new(self.seed ^ 0x1_4a6e);
        let worker_count = random.pick(&WORKER_COUNTS);
        plan.machines = plan.machines.iter().cycle().take(worker_count).cloned().collect();
        for (number, machine) in plan.machines.iter_mut().enumerate() {
            machine.name = format!("host{number}");
            machine.speed = random.pick(&SPEEDS);
            machine.claimed_speed = random.pick(&SPEEDS);
        }
        let order = &mut plan.jobs[0].1;
        let Balancing { exchange, mapping, .. } = order.balancing;
        order.balancing = Balancing { exchange, mapping, ..self.balancing };
        order.topology = self.topology.clone();
        order.workers_min = if is_calm { worker_count as u32 } else { 1 };
        plan
    }

    /// Renders the image, compares it, and says what that took.
    fn run(&self, picture: &Picture) -> Counts {
        let plan = self.plan(&picture.spec);
        let tracer = match &plan.guest {
            Some(guest) => picture.cut_tracer(guest.objects().len()),
            None => picture.tracer(),
        };
        let mut simulation = Simulation::new(plan, Unsteady::new(tracer, self.seed));
        simulation.run();
        let view = &simulation.jobs()[&JobId(1)];
        let report = view.report.as_ref().expect("it was reported");
        assert_eq!(report.state, JobState::Done);
        assert!(view.film.sums == picture.expected, "another image");
        simulation.counts()
    }

    /// The same, and says which way it was if it goes wrong.
    fn check(&self, picture: &Picture) -> Counts {
        catch_unwind(AssertUnwindSafe(|| self.run(picture))).unwrap_or_else(|panic| {
            eprintln!("{} goes wrong with {self:?}", picture.name);
            resume_unwind(panic)
        })
    }
}

/// A scene to be rendered in many ways, and the right image of it.
struct Picture {
    name: &'static str,
    spec: JobSpec,
    scene: Scene,
    model: Arc<Model>,
    /// By number of partitions.
    cuts: RefCell<BTreeMap<usize, CutModel>>,
    expected: TileSums,
}

/// A model in partitions.
#[derive(Clone)]
struct CutModel {
    model: Arc<Model>,
    partitions: Vec<Arc<Partition>>,
}

impl CutModel {
    /// Cuts a scene into so many partitions, by the order of its triangles.
    fn new(scene: &Scene, count: usize) -> Self {
        let bounds = Bounds::of_model(&scene.geometry, &[]);
        let triangles = &scene.geometry.triangles;
        let partition = |part: usize| {
            let mut builder = PartitionBuilder::default();
            let numbered = (0u32..).zip(triangles).enumerate();
            let own = numbered.filter(|(index, _)| index * count / triangles.len() == part);
            for (_, (number, triangle)) in own {
                builder.push(number, &scene.geometry.world_triangle(triangle));
            }
            Arc::new(builder.build(&bounds))
        };
        let partitions: Vec<Arc<Partition>> = (0..count).map(partition).collect();
        let parts = ModelParts {
            bounds,
            triangle_count: triangles.len() as u64,
            boxes: partitions.iter().map(|it| it.boxes(PARTITION_BOXES_MAX)).collect(),
            tables: scene.tables.clone(),
            luminaires: scene.luminaires(),
        };
        Self { model: Arc::new(Model::of_parts(parts).expect("a shipped scene")), partitions }
    }
}

impl Picture {
    fn new(name: &'static str) -> Self {
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
        let model = Arc::new(Model::new(loaded.scene.clone()).expect("a shipped scene"));
        let expected = reference::render(&renderer(&model, &spec));
        let cuts = RefCell::default();
        Self { name, spec, scene: loaded.scene, model, cuts, expected }
    }

    fn tracer(&self) -> LightTracer {
        LightTracer::new(renderer(&self.model, &self.spec), RAY_COST)
    }

    fn cut_tracer(&self, count: usize) -> LightTracer {
        let mut cuts = self.cuts.borrow_mut();
        let cut = cuts.entry(count).or_insert_with(|| CutModel::new(&self.scene, count));
        let CutModel { model, partitions } = cut.clone();
        LightTracer::new(renderer(&model, &self.spec), RAY_COST).cut(partitions)
    }
}

fn renderer(model: &Arc<Model>, spec: &JobSpec) -> Renderer {
    let renderer = Renderer::of_model(Arc::clone(model), &spec.camera, &spec.settings, spec.grid());
    renderer.expect("a shipped scene")
}

/// Threads whose speed changes from piece to piece, and that interrupts meet in the middle of one.
struct Unsteady {
    light: LightTracer,
    scratch: RefCell<Scratch>,
    seed: u64,
}

impl Unsteady {
    fn new(light: LightTracer, seed: u64) -> Self {
        Self { light, scratch: RefCell::default(), seed }
    }

    /// How many times longer than the quickest this piece takes: the same each time.
    fn slowness(&self, work: &Work) -> u32 {
        let (share, number) = match work {
            Work::Samples(samples) => (samples.share.unit, samples.first_path),
            Work::Rays(bundle) => (bundle.shares[0].unit, bundle.rays.len() as u32),
        };
        let bits = mix(u64::from(share.0) << 32 | u64::from(number)) ^ self.seed;
        Random::new(bits).within_u32(1..=SLOWNESS_MAX)
    }
}

impl Tracer for Unsteady {
    fn trace(&self, task: &Task, work: Work, limit: Option<Duration>) -> Traced {
        let slowness = self.slowness(&work);
        let Some(limit) = limit else {
            let Traced { outcome, elapsed } = self.light.trace(task, work, None);
            return Traced { outcome, elapsed: elapsed * slowness };
        };
        let interrupt = AtomicBool::new(limit.is_zero());
        let ray_cost = RAY_COST * slowness;
        let mut timer = Timer { ray_cost, elapsed: Duration::ZERO, limit, interrupt: &interrupt };
        let (renderer, mut scratch) = (self.light.renderer(task), self.scratch.borrow_mut());
        let outcome = renderer.trace_observed(work, &interrupt, &mut scratch, &mut timer);
        let outcome = outcome.expect("the cores only move work of this job");
        Traced { outcome, elapsed: timer.elapsed.max(limit) }
    }
}

/// Interrupts a piece once its rays have taken so long.
struct Timer<'a> {
    ray_cost: Duration,
    elapsed: Duration,
    limit: Duration,
    interrupt: &'a AtomicBool,
}

impl Observer for Timer<'_> {
    fn started(&mut self, _: &[Ray]) {}

    fn advanced(&mut self, stage: Stage, rays: &[Ray]) {
        if stage == Stage::Intersect {
            self.elapsed += self.ray_cost * rays.len() as u32;
            self.interrupt.store(self.elapsed >= self.limit, Ordering::Relaxed);
        }
    }
}

/// Renders a scene in every way, each from so many seeds of its own, the first of which is named.
fn renders_as_defined(scene: &'static str, mut seed: u64, seed_count: u64) {
    let picture = Picture::new(scene);
    for balancing in policies() {
        let (mut gifts, mut gifts_of_rays) = (0, 0);
        for topology in topologies() {
            for _ in 0..seed_count {
                let topology = topology.clone();
                let counts = Way { seed, topology, balancing, is_cut: false }.check(&picture);
                gifts += counts.given;
                gifts_of_rays += counts.rays_given;
                seed += 1;
            }
        }
        // Otherwise nothing was tried.
        let is_tried = match balancing.balance {
            Balance::Diffusion => gifts > gifts_of_rays && gifts_of_rays > 0,
            Balance::Stealing => gifts > 0,
            Balance::None => gifts == 0,
        };
        assert!(is_tried, "{scene}, {balancing:?}: {gifts} gifts, {gifts_of_rays} of rays");
    }
}

/// The same with the scene in partitions.
fn renders_as_defined_in_partitions(scene: &'static str, mut seed: u64, seed_count: u64) {
    let picture = Picture::new(scene);
    let mut forwards = 0;
    for balancing in policies() {
        for topology in topologies() {
            for _ in 0..seed_count {
                let topology = topology.clone();
                let counts = Way { seed, topology, balancing, is_cut: true }.check(&picture);
                forwards += counts.forwarded;
                seed += 1;
            }
        }
    }
    assert!(forwards > 0, "{scene}: nothing was forwarded");
}

#[test]
fn the_cornell_box_renders_as_defined_in_partitions() {
    renders_as_defined_in_partitions("cornell-box", 40_000, 1);
}

#[test]
fn the_office_renders_as_defined_in_partitions() {
    renders_as_defined_in_partitions("office", 50_000, 1);
}

#[test]
fn the_bathroom_renders_as_defined_in_partitions() {
    renders_as_defined_in_partitions("bathroom", 60_000, 1);
}

#[test]
fn the_cornell_box_renders_as_defined() {
    renders_as_defined("cornell-box", 10_000, 4);
}

#[test]
fn the_office_renders_as_defined() {
    renders_as_defined("office", 20_000, 4);
}

#[test]
fn the_bathroom_renders_as_defined() {
    renders_as_defined("bathroom", 30_000, 4);
}

#[test]
#[ignore = "takes minutes; see the head of this file"]
fn scenes_render_as_defined_from_many_seeds() {
    for (first, scene) in [(100_000, "cornell-box"), (200_000, "office"), (300_000, "bathroom")] {
        renders_as_defined(scene, first, 40);
        renders_as_defined_in_partitions(scene, first + 50_000, 10);
    }
}
