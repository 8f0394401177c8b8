//! One image, to the bit, however the geometry is cut and however little of it is in memory.

use std::path::Path;
use std::process::Command;

use equilux_store::Store;

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
fn budgets(store: &Path) -> [u64; 3] {
    let store = Store::open_path(store).expect("a store");
    let sizes = store.manifest().partitions.iter().map(|entry| entry.memory_bytes);
    let (all, largest) = (sizes.clone().sum::<u64>(), sizes.max().expect("seven"));
    // A part of the memory is for rays that wait.
    [all, (all / 2).max(largest), largest].map(|bytes| bytes * 4 / 3 + 4)
}

fn render(scene: &str, way: &[&str]) -> Vec<u8> {
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

/// Workers are home to a part each, and hand rays on to one another.
fn is_the_same_with_homes_apart(scene: &str) {
    let stores = directory();
    let (scene_file, store, stats) =
        (shipped(scene), file(&stores, "store"), file(&stores, "stats.json"));
    succeed(["scene", "build", &scene_file, "-o", &store, "--partitions", "7", "--quiet"]);
    let [_, half, one] = budgets(Path::new(&store));
    let expected = render(&scene_file, &[]);
    for (workers, memory, exchange) in [("2", half, "on"), ("3", one, "off"), ("3", one, "on")] {
        let memory = memory.to_string();
        let way = ["--workers", workers, "--threads", "1", "--memory", &memory];
        let way = [&way[..], &["--exchange", exchange, "--stats", &stats]].concat();
        assert!(render(&store, &way) == expected, "{scene} differs with {way:?}");
        let stats = std::fs::read_to_string(&stats).expect("the figures");
        let stats: serde_json::Value = serde_json::from_str(&stats).expect("JSON");
        let workers = stats["workers"].as_array().expect("a list");
        let forwards = workers.iter().map(|worker| worker["forwards"].as_u64().expect("a count"));
        assert!(forwards.sum::<u64>() > 0, "{scene}: nobody forwarded anything with {way:?}");
    }
}

#[test]
fn cornell_box_is_the_same_with_homes_apart() {
    is_the_same_with_homes_apart("cornell-box");
}

#[test]
fn office_is_the_same_with_homes_apart() {
    is_the_same_with_homes_apart("office");
}

#[test]
fn bathroom_is_the_same_with_homes_apart() {
    is_the_same_with_homes_apart("bathroom");
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
