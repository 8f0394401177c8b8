//! One image, to the bit, however the geometry is cut and however little of it is in memory.

use std::path::Path;
use std::process::Command;

use equilux_store::Store;
use tempfile::TempDir;

use crate::support::{directory, fail, file, program, shipped, succeed};

/// Few and small, for there are many ways.
const SIZE: &str = "40x32";
const SAMPLES: &str = "2";

#[test]
fn cornell_box_is_the_same_however_it_is_cut() {
    is_the_same_however_it_is_cut("cornell-box");
}

#[test]
fn office_is_the_same_however_it_is_cut() {
    is_the_same_however_it_is_cut("office");
}

#[test]
fn bathroom_is_the_same_however_it_is_cut() {
    is_the_same_however_it_is_cut("bathroom");
}

fn is_the_same_however_it_is_cut(scene: &str) {
    let scene_file = shipped(scene);
    let expected = render(&scene_file, &[]);
    let ways: [&[&str]; 4] = [
        &["--partitions", "2", "--threads", "1"],
        &["--partitions", "7", "--threads", "3"],
        &["--partitions", "32"],
        &["--memory", "2MiB"],
    ];
    for way in ways {
        assert!(render(&scene_file, way) == expected, "{scene} differs with {way:?}");
    }
    let stores = directory();
    let store = file(&stores, "store");
    succeed(["scene", "build", &scene_file, "-o", &store, "--partitions", "7"]);
    for budget in budgets(Path::new(&store)) {
        let way = ["--memory", &budget.to_string(), "--threads", "2"];
        assert!(render(&store, &way) == expected, "{scene} differs with {way:?}");
    }
}

/// Enough memory for all partitions, for half of them, and for the largest one alone.
pub(crate) fn budgets(store: &Path) -> [u64; 3] {
    let store = Store::open_path(store).expect("a store");
    let sizes = store.manifest().partitions.iter().map(|entry| entry.memory_bytes);
    let (all, largest) = (sizes.clone().sum::<u64>(), sizes.max().expect("seven"));
    // A part of the memory is for rays that wait.
    [all, (all / 2).max(largest), largest].map(|bytes| bytes * 4 / 3 + 4)
}

/// A small image of a scene.
pub(crate) fn render(scene: &str, way: &[&str]) -> Vec<u8> {
    let outputs = directory();
    let outfile = file(&outputs, "image.exr");
    let args = ["render", scene, "--size", SIZE, "--spp", SAMPLES, "--quiet", "-o", &outfile];
    succeed(args.into_iter().chain(way.iter().copied()));
    std::fs::read(outfile).expect("the image")
}

#[test]
fn a_city_is_made_cut_and_rendered_within_a_part_of_its_size() {
    let places = directory();
    let (city, store) = (file(&places, "city"), file(&places, "city.store"));
    succeed(["scene", "generate", "city", "--triangles", "30000", "--outdir", &city, "--quiet"]);
    let scene = format!("{city}/scene.json");
    let build = ["scene", "build", &scene, "-o", &store, "--partition-size", "256KiB", "--quiet"];
    let summary = succeed(build);
    assert!(summary.contains("30000 triangles"), "{summary}");
    let [all, ..] = budgets(Path::new(&store));
    let memory = (all / 4).to_string();
    assert!(render(&store, &["--memory", &memory]) == render(&scene, &[]), "another city");
}

/// Bytes that the process may have for writing: a quarter of what the model takes.
#[test]
fn a_model_four_times_as_large_as_a_process_may_grow_is_rendered() {
    let places = directory();
    let (city, store) = (file(&places, "city"), file(&places, "city.store"));
    succeed(["scene", "generate", "city", "--triangles", "4000000", "--outdir", &city, "--quiet"]);
    let scene = format!("{city}/scene.json");
    succeed(["scene", "build", &scene, "-o", &store, "--partition-size", "4MiB", "--quiet"]);
    let [all, ..] = budgets(Path::new(&store));
    let limit = all * 3 / 4 / 4;
    let outfile = file(&places, "limited.exr");
    let limited = format!("ulimit -d {} && exec \"$0\" \"$@\"", limit >> 10);
    let memory = (limit / 3).to_string();
    let args = ["--size", SIZE, "--spp", SAMPLES, "--quiet", "--threads", "2", "-o", &outfile];
    let mut command = Command::new("sh");
    command.args(["-c", &limited]).arg(program().get_program());
    command.args(["render", &store, "--memory", &memory]).args(args);
    let output = command.output().expect("a shell");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(std::fs::read(outfile).expect("the image") == render(&store, &[]), "another city");
}

#[test]
fn workers_fetch_the_partitions_of_a_store() {
    let stores = directory();
    let (scene, store) = (shipped("office"), file(&stores, "store"));
    succeed(["scene", "build", &scene, "-o", &store, "--partitions", "5", "--quiet"]);
    let [_, half, _] = budgets(Path::new(&store));
    let memory = half.to_string();
    let expected = render(&scene, &[]);
    let way = ["--workers", "1", "--threads", "1", "--memory", &memory];
    assert!(render(&store, &way) == expected, "another image");
}

/// How a cluster shares a store.
#[derive(Clone, Copy, Debug)]
struct Way {
    partitions: usize,
    workers: usize,
    budget: usize,
    is_exchanging: bool,
    mapping: &'static str,
}

const PARTITIONS: [&str; 3] = ["2", "7", "32"];
const WORKERS: [&str; 3] = ["1", "2", "3"];
const MAPPINGS: [&str; 2] = ["bisection", "diffusion"];

/// Positions in [`budgets`].
const ALL: usize = 0;
pub(crate) const HALF: usize = 1;

/// Every value of each with every value of each other: of the partitions, the workers, the budgets,
/// the exchange and the mapping.
fn some_ways() -> Vec<Way> {
    let square = |row: usize| (0..3).map(move |column| (row, column, (row + column) % 3));
    let ways = (0..3).flat_map(square).enumerate();
    let mut ways: Vec<Way> = ways
        .map(|(number, (partitions, workers, budget))| Way {
            partitions,
            workers,
            budget,
            is_exchanging: number % 2 == 0,
            mapping: MAPPINGS[number / 2 % 2],
        })
        .collect();
    let last = Way { is_exchanging: true, mapping: MAPPINGS[1], ..ways[3] };
    ways.extend([last, Way { workers: 2, budget: HALF, ..last }]);
    ways
}

fn all_ways() -> Vec<Way> {
    let numbers = 0..3 * 3 * 3 * 2 * 2;
    let way = |number: usize| Way {
        partitions: number % 3,
        workers: number / 3 % 3,
        budget: number / 9 % 3,
        is_exchanging: (number / 27).is_multiple_of(2),
        mapping: MAPPINGS[number / 54],
    };
    numbers.map(way).collect()
}

/// Workers are home to a part each, and hand rays on to one another.
fn is_the_same_with_homes_apart(scene: &str, ways: &[Way]) {
    let places = directory();
    let (scene_file, stats) = (shipped(scene), file(&places, "stats.json"));
    let stores = PARTITIONS.map(|count| {
        let store = file(&places, count);
        succeed(["scene", "build", &scene_file, "-o", &store, "--partitions", count, "--quiet"]);
        store
    });
    let expected = render(&scene_file, &[]);
    for way in ways {
        let store = &stores[way.partitions];
        let memory = budgets(Path::new(store))[way.budget].to_string();
        let exchange = if way.is_exchanging { "on" } else { "off" };
        let cluster = ["--workers", WORKERS[way.workers], "--threads", "1", "--memory", &memory];
        let balancing = ["--exchange", exchange, "--mapping", way.mapping, "--stats", &stats];
        let args = [&cluster[..], &balancing].concat();
        assert!(render(store, &args) == expected, "{scene} differs with {way:?}");
        let stats = std::fs::read_to_string(&stats).expect("the figures");
        let stats: serde_json::Value = serde_json::from_str(&stats).expect("JSON");
        let workers = stats["workers"].as_array().expect("a list");
        let forwards = workers.iter().map(|worker| worker["forwards"].as_u64().expect("a count"));
        let is_apart = way.workers > 0 && way.budget != ALL;
        assert_eq!(forwards.sum::<u64>() > 0, is_apart, "{scene}: forwards with {way:?}");
    }
}

#[test]
fn cornell_box_is_the_same_with_homes_apart() {
    is_the_same_with_homes_apart("cornell-box", &some_ways());
}

#[test]
fn office_is_the_same_with_homes_apart() {
    is_the_same_with_homes_apart("office", &some_ways());
}

#[test]
fn bathroom_is_the_same_with_homes_apart() {
    is_the_same_with_homes_apart("bathroom", &some_ways());
}

#[test]
#[ignore = "takes some minutes; nightly"]
fn every_scene_is_the_same_in_every_way() {
    for scene in ["cornell-box", "office", "bathroom"] {
        is_the_same_with_homes_apart(scene, &all_ways());
    }
}

/// The Cornell box at many places, each of a file of its own or all of one.
fn boxes(places: &TempDir, is_shared: bool) -> String {
    let home = shipped("cornell-box");
    let home = Path::new(&home).parent().expect("a directory");
    let copy = |from: &str, to: &str| {
        std::fs::copy(home.join(from), places.path().join(to)).expect("a file");
    };
    let text = std::fs::read_to_string(home.join("scene.json")).expect("a scene");
    let mut scene: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let mut models = Vec::new();
    for name in ["cornell-box", "lights"] {
        for number in 0..12 {
            let file =
                if is_shared { format!("{name}.obj") } else { format!("{name}-{number}.obj") };
            copy(&format!("{name}.obj"), &file);
            let size = 1.0 + 0.1 * f64::from(number);
            let mirrored = if number % 5 == 0 { -size } else { size };
            models.push(serde_json::json!({"file": file, "transform": {
                "scale": [size, mirrored, size],
                "rotate": [0, 17 * number, 3 * number],
                "translate": [number % 4 * 700, 0, number / 4 * -900],
            }}));
        }
    }
    copy("cornell-box.mtl", "cornell-box.mtl");
    scene["models"] = models.into();
    scene["camera"] = serde_json::json!({"eye": [1000, 900, 2500], "target": [1000, 100, -900]});
    let path = file(places, if is_shared { "shared.json" } else { "apart.json" });
    std::fs::write(&path, scene.to_string()).expect("it can be written");
    path
}

#[test]
fn what_is_placed_several_times_is_as_if_it_were_several_models() {
    let places = directory();
    let (shared, apart) = (boxes(&places, true), boxes(&places, false));
    let expected = render(&apart, &[]);
    let ways: [&[&str]; 4] =
        [&[], &["--partitions", "2"], &["--partitions", "7"], &["--memory", "1MiB"]];
    for way in ways {
        assert!(render(&shared, way) == expected, "another image with {way:?}");
    }
    let (kept, all) = (file(&places, "kept"), file(&places, "all"));
    for (scene, store) in [(&shared, &kept), (&apart, &all)] {
        succeed(["scene", "build", scene, "-o", store, "--partitions", "5", "--quiet"]);
    }
    let counts = |store: &String| {
        let store = Store::open_path(Path::new(store)).expect("a store");
        (store.manifest().triangle_count, store.manifest().kept_count())
    };
    let (count, kept_count) = counts(&kept);
    assert_eq!(counts(&all), (count, count));
    assert_eq!(kept_count * 12, count);
    let memory = budgets(Path::new(&kept))[HALF].to_string();
    let way = ["--workers", "2", "--threads", "1", "--memory", &memory];
    assert!(render(&kept, &way) == expected, "another image with two workers");
}

#[test]
fn too_little_memory_is_refused_with_the_least_that_works() {
    let stores = directory();
    let store = file(&stores, "store");
    succeed(["scene", "build", &shipped("cornell-box"), "-o", &store, "--partitions", "2"]);
    let outfile = file(&stores, "image.png");
    let errors = fail(["render", &store, "--memory", "1KiB", "--quiet", "-o", &outfile]);
    let least = errors.split_once("--memory ").expect("it names a remedy").1;
    let least: String = least.chars().take_while(char::is_ascii_digit).collect();
    assert!(!Path::new(&outfile).exists());
    succeed(["render", &store, "--memory", &least, "--quick", "--quiet", "-o", &outfile]);
}

#[test]
fn a_damaged_partition_is_named_and_no_image_is_left() {
    let stores = directory();
    let store = file(&stores, "store");
    succeed(["scene", "build", &shipped("cornell-box"), "-o", &store, "--partitions", "2"]);
    let partition = Path::new(&store).join("partitions").join("00001.part");
    let mut bytes = std::fs::read(&partition).expect("the second partition");
    let last = bytes.len() - 1;
    bytes[last / 2] ^= 4;
    std::fs::write(&partition, &bytes).expect("it can be written");
    let outfile = file(&stores, "image.png");
    let errors = fail(["render", &store, "--quick", "--quiet", "-o", &outfile]);
    assert!(errors.contains("00001.part"), "{errors}");
    assert!(!Path::new(&outfile).exists());
}
