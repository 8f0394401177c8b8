//! Predicting and measuring clusters: the table, its keys, and pictures that can be opened.

use std::path::Path;

use equilux_common::costs::{COSTS_VERSION, CellCosts, SceneCosts};
use serde_json::Value;

use crate::support::{directory, fail, file, shipped, succeed};

/// The keys of a row, in order.
const KEYS: [&str; 11] =
    ["p", "model", "size", "t1_s", "delta1_s", "t2_s", "delta2_s", "s", "e", "tp_s", "percent"];

/// Writes costs of an image whose lower half is ten times as dear as the upper one.
fn write_costs(path: &str) {
    let cell = |nanos: f32| CellCosts {
        rays_per_path: vec![1.0, 0.8, 0.4],
        nanos_per_ray: vec![nanos, nanos, nanos],
    };
    let costs = SceneCosts {
        equilux_costs: COSTS_VERSION,
        scene: "slope".into(),
        width: 64,
        height: 48,
        samples_per_pixel: 8,
        cell_side_pixels: 16,
        prepare_s: 0.0001,
        bytes_per_pixel: 70.0,
        cells: (0..12).map(|index| cell(if index < 6 { 1e3 } else { 1e4 })).collect(),
    };
    std::fs::write(path, costs.to_json()).expect("a file");
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
    assert_eq!(details["details"].as_array().map(Vec::len), Some(4));
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
    let json = succeed(table.into_iter().chain(["--json", "-o", &pictures]));
    let rows: Vec<Value> = serde_json::from_str(&json).expect("rows");
    assert_eq!(rows.len(), 2);
    assert!(rows.iter().all(|row| row.as_object().expect("a row").keys().eq(KEYS)), "{json}");
    check_picture(&pictures, "figure2", &["When each of 2 workers finished"]);
    check_picture(&pictures, "efficiency", &["measured"]);
}
