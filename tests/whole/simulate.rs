//! Predicting and measuring clusters: the table, its keys, and pictures that can be opened.

use std::path::Path;

use equilux_common::costs::{COSTS_VERSION, CellCosts, SceneCosts};
use serde_json::Value;

use crate::support::{directory, fail, file, shipped, succeed};

/// The keys of a row, in order.
const KEYS: [&str; 11] =
    ["p", "model", "size", "t1_s", "delta1_s", "t2_s", "delta2_s", "s", "e", "tp_s", "percent"];

/// Costs of an image whose lower half is ten times as dear as the upper one.
fn costs() -> SceneCosts {
    let cell = |nanos: f32| CellCosts {
        rays_per_path: vec![1.0, 0.8, 0.4],
        nanos_per_ray: vec![nanos, nanos, nanos],
    };
    SceneCosts {
        equilux_costs: COSTS_VERSION,
        scene: "slope".into(),
        width: 64,
        height: 48,
        samples_per_pixel: 8,
        cell_side_pixels: 16,
        prepare_s: 0.0001,
        bytes_per_pixel: 70.0,
        cells: (0..12).map(|index| cell(if index < 6 { 1e3 } else { 1e4 })).collect(),
        partitioned: None,
    }
}

fn write_costs(path: &str) {
    std::fs::write(path, costs().to_json()).expect("a file");
}

fn check_picture(directory: &str, name: &str, labels: &[&str]) {
    let png = image::open(Path::new(directory).join(format!("{name}.png"))).expect("a PNG");
    let mut colors: Vec<_> = png.to_rgb8().pixels().map(|pixel| pixel.0).collect();
    colors.sort_unstable();
    colors.dedup();
    assert!(png.width() >= 600 && colors.len() > 10, "{name}: a blank picture");
    let svg = std::fs::read_to_string(Path::new(directory).join(format!("{name}.svg")));
    let svg = svg.expect("an SVG");
    assert!(svg.starts_with("<svg ") && svg.trim_end().ends_with("</svg>"), "{name}: no SVG");
    for label in labels {
        assert!(svg.contains(label), "{name}: no `{label}`");
    }
}

#[test]
fn a_simulation_prints_the_table_and_draws_the_pictures() {
    let outputs = directory();
    let (costs, pictures) = (file(&outputs, "costs.json"), file(&outputs, "pictures"));
    write_costs(&costs);
    let common = ["simulate", "--costs", &costs, "--workers", "4", "-o", &pictures];
    let text = succeed(common);
    assert!(text.starts_with("P  Model  Size"), "{text}");
    assert_eq!(text.lines().count(), 3, "{text}");
    check_picture(&pictures, "figure2", &["without balancing", "with balancing", "finished after"]);
    check_picture(&pictures, "efficiency", &["workers", "efficiency", "Slope, size 1"]);
    check_picture(&pictures, "messages", &["messages per worker", "bytes per worker"]);
    check_picture(&pictures, "heat-4", &["Work that waits with each of 4 workers", "worker"]);

    let json = succeed(common.into_iter().chain(["--json"]));
    let rows: Vec<Value> = serde_json::from_str(&json).expect("rows");
    assert_eq!(rows.len(), 2);
    for (row, p) in rows.iter().zip([1, 4]) {
        assert!(row.as_object().expect("a row").keys().eq(KEYS), "{row}");
        assert_eq!((row["p"].as_u64(), row["model"].as_str()), (Some(p), Some("Slope")));
    }
    assert_eq!(json, succeed(common.into_iter().chain(["--json"])), "the same seed");
    let details = succeed(common.into_iter().chain(["--json", "--details"]));
    let details: Value = serde_json::from_str(&details).expect("rows and details");
    let details = details["details"].as_array().expect("a list");
    assert_eq!(details.len(), 4);
    assert!(details.iter().all(|it| it["end_after_last_s"].as_f64() > Some(0.0)), "{details:?}");
}

#[test]
fn an_amount_of_work_takes_the_place_of_the_size() {
    let outputs = directory();
    let (costs, pictures) = (file(&outputs, "costs.json"), file(&outputs, "pictures"));
    write_costs(&costs);
    let json = succeed([
        "simulate",
        "--costs",
        &costs,
        "--workers",
        "2",
        "--work",
        "0.5",
        "--network",
        "cluster",
        "--json",
        "-o",
        &pictures,
    ]);
    let rows: Vec<Value> = serde_json::from_str(&json).expect("rows");
    assert!(rows[1]["size"].is_null() && rows[1]["work_s"] == 0.5, "{json}");
    let alone = rows[0]["t1_s"].as_f64().expect("a time");
    assert!((0.5..0.6).contains(&alone), "{alone}");
}

#[test]
fn hard_cases_are_held_against_the_speeds_of_those_that_are_there() {
    let outputs = directory();
    let (costs, pictures) = (file(&outputs, "costs.json"), file(&outputs, "pictures"));
    write_costs(&costs);
    let simulate = ["simulate", "--costs", &costs, "--work", "0.5", "--network", "cluster"];
    let all = ["--case", "point,straggler,latecomers", "--workers", "4", "--json", "-o", &pictures];
    let json = succeed(simulate.into_iter().chain(all));
    let rows: Vec<Value> = serde_json::from_str(&json).expect("rows");
    let cases: Vec<_> = rows.iter().map(|row| row["case"].as_str()).collect();
    assert_eq!(cases, [None, Some("straggler"), Some("latecomers"), Some("point")]);
    let number = |row: usize, key: &str| rows[row][key].as_f64().expect("a number");
    // What four workers amount to: one is a tenth, two are there for half of the time, all are.
    for (row, workers) in [(1, 3.1), (2, 3.0), (3, 4.0)] {
        let (s, e, t2) = (number(row, "s"), number(row, "e"), number(row, "t2_s"));
        assert!((0.5..=1.0).contains(&e) && (s / e / workers - 1.0).abs() < 0.05, "{}", rows[row]);
        assert!((number(row, "tp_s") - t2 * (1.0 - e)).abs() < 1e-6, "{}", rows[row]);
    }
    // Without balancing everything stays where it was issued.
    let alone = number(0, "t1_s");
    assert!((number(3, "t1_s") / alone - 1.0).abs() < 0.05, "{json}");
    assert!(number(1, "t1_s") > alone, "a quarter of the work at a tenth of the speed");
    for case in ["straggler", "latecomers", "point"] {
        let pictures = format!("{pictures}/{case}");
        check_picture(&pictures, "figure2", &[case]);
        check_picture(&pictures, "heat-4", &[case]);
    }
    assert!(!Path::new(&pictures).join("figure2.svg").exists(), "the even case was not asked for");
    let one = ["--case", "straggler", "--workers", "1"];
    assert!(fail(simulate.into_iter().chain(one)).contains("--case"));
}

#[test]
fn an_image_that_is_too_large_is_refused_by_the_option_that_makes_it_so() {
    let outputs = directory();
    let (path, pictures) = (file(&outputs, "costs.json"), file(&outputs, "pictures"));
    let large = SceneCosts {
        width: 6000,
        height: 6000,
        cell_side_pixels: 6000,
        cells: costs().cells[..1].to_vec(),
        ..costs()
    };
    std::fs::write(&path, large.to_json()).expect("a file");
    let simulate = ["simulate", "--costs", &path, "--workers", "2", "-o", &pictures];
    assert!(fail(simulate).contains("--sizes 1: 6000x6000 pixels"));
    succeed(simulate.into_iter().chain(["--work", "0.1"]));
    let scene = shipped("cornell-box");
    assert!(fail(["bench", "table1", &scene, "--sizes", "1,10000"]).contains("--sizes 10000"));
}

#[test]
fn costs_that_do_not_belong_there_are_refused_with_their_file() {
    let outputs = directory();
    let (costs, scene) = (file(&outputs, "costs.json"), shipped("cornell-box"));
    let pictures = file(&outputs, "pictures");
    let simulate = ["simulate", "--workers", "2", "-o", &pictures, "--costs", &costs];
    assert!(fail(simulate).contains("--record-costs"));
    std::fs::write(&costs, "{}").expect("a file");
    assert!(fail(simulate).contains("costs.json"));
    write_costs(&costs);
    let errors = fail(simulate.into_iter().chain([&*scene]));
    assert!(errors.contains("`slope`, which is none of the scenes"), "{errors}");
    let copy = file(&outputs, "copy.json");
    write_costs(&copy);
    for second in [&costs, &copy] {
        let errors = fail(simulate.into_iter().chain(["--costs", second]));
        assert!(errors.contains(&**second) && errors.contains("leave one of them out"), "{errors}");
    }
    let errors = fail(["simulate", "--workers", "2", "-o", &pictures, &scene, &scene]);
    assert!(errors.contains("two models are called `Cornell-box`"), "{errors}");
}

#[test]
fn a_benchmark_measures_real_processes() {
    let outputs = directory();
    let scene = file(&outputs, "scene.json");
    let pictures = file(&outputs, "pictures");
    let cornell = std::fs::read_to_string(shipped("cornell-box")).expect("the scene");
    let mut cornell: Value = serde_json::from_str(&cornell).expect("JSON");
    cornell["film"]["width"] = 48.into();
    cornell["film"]["height"] = 48.into();
    let shipped = shipped("cornell-box");
    let beside = Path::new(&shipped).parent().expect("a directory");
    for entry in std::fs::read_dir(beside).expect("the scene's files").flatten() {
        std::fs::copy(entry.path(), outputs.path().join(entry.file_name())).expect("a copy");
    }
    std::fs::write(&scene, cornell.to_string()).expect("a file");
    let table = ["bench", "table1", &scene, "--workers", "1,2", "--sizes", "1", "--spp", "4"];
    let json = succeed(table.into_iter().chain(["--json", "--details", "-o", &pictures]));
    let told: Value = serde_json::from_str(&json).expect("an object");
    let list = |key: &str| told[key].as_array().expect("a list").clone();
    let rows = list("rows");
    assert_eq!((rows.len(), list("calibration").len()), (2, 2), "{json}");
    assert!(rows.iter().all(|row| row.as_object().expect("a row").keys().eq(KEYS)), "{json}");
    let balances: Vec<_> = list("overhead").iter().map(|it| it["balance"].clone()).collect();
    assert_eq!(balances, ["diffusion", "diffusion", "none"]);
    if cfg!(target_os = "linux") {
        assert!(list("overhead").iter().all(|it| it["processor_s"].as_f64() > Some(0.0)), "{json}");
        assert!(told["idle_wakes"]["compute_per_s"].as_f64() < Some(1.0), "{json}");
    }
    check_picture(&pictures, "figure2", &["When each of 2 workers finished"]);
    check_picture(&pictures, "efficiency", &["measured"]);
}
