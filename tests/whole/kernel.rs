//! Measuring the kernel: the figures and the table, and what it refuses.

use std::fs;

use serde_json::Value;

use crate::support::{directory, equilux, fail, file, shipped, succeed};

const KINDS: [&str; 5] = ["primary", "diffuse1", "diffuse2", "shadow1", "shadow2"];

/// All kernels, ours first.
const KERNELS: [&str; 4] = ["single", "shared", "obvhs-bvh2", "obvhs-cwbvh"];

fn bench(scene: &str, more: &[&str]) -> String {
    succeed(
        ["bench", "kernel", scene, "--rounds", "1", "--rays", "2000"].iter().chain(more).copied(),
    )
}

fn measured(scene: &str) -> Value {
    serde_json::from_str(&bench(scene, &["--json"])).expect("an object")
}

#[test]
fn all_kernels_are_measured_with_all_kinds_of_rays() {
    let report = measured(&shipped("cornell-box"));
    assert_eq!(report["scene"], "cornell-box");
    assert_eq!(report["triangles"], 32);
    assert_eq!(report["rounds"], 1);
    assert!(report["build_s"].as_f64() > Some(0.0), "{report}");
    let bytes = report["bytes_per_triangle"].as_f64().expect("a number");
    assert!((36.0..500.0).contains(&bytes), "{bytes}: a corner takes 12");
    let kernels = report["kernels"].as_array().expect("a list");
    assert!(kernels.iter().map(|kernel| &kernel["name"]).eq(&KERNELS), "{report}");
    for kernel in kernels {
        let keys = kernel.as_object().expect("an object").keys();
        assert!(keys.eq(["name"].iter().chain(&KINDS)), "{kernel}");
        assert!(KINDS.iter().all(|kind| kernel[kind].as_f64() > Some(0.0)), "{kernel}");
    }
    let rays = report["rays"]["primary"].as_u64().expect("a number");
    assert!((1900..2100).contains(&rays), "{rays}");
    // A shut box but for its front: all rays that leave go to hits, and the lamp hangs in the open.
    let rate = |kind: &str| report["hits"][kind].as_f64().zip(report["rays"][kind].as_f64());
    let rate = |kind: &str| rate(kind).map(|(hits, rays)| hits / rays).expect("numbers");
    assert!(rate("primary") > 0.8 && rate("diffuse1") > 0.6, "{report}");
    assert!((0.01..0.3).contains(&rate("shadow1")), "{report}");
    assert_eq!(report["has_lights"], true);
}

#[test]
fn the_same_rays_come_each_time() {
    let scene = shipped("cornell-box");
    let (first, second) = (measured(&scene), measured(&scene));
    assert_eq!((&first["rays"], &first["hits"]), (&second["rays"], &second["hits"]));
}

#[test]
fn the_table_has_a_row_for_each_kernel_and_the_ratios() {
    let text = bench(&shipped("cornell-box"), &[]);
    let header = text.lines().find(|line| line.starts_with("kernel")).expect("a table");
    assert!(header.split_whitespace().skip(1).eq(KINDS), "{text}");
    for kernel in KERNELS {
        let row = |line: &&str| line.starts_with(kernel);
        let expected = if kernel == "obvhs-cwbvh" { 1 } else { 2 };
        assert_eq!(text.lines().filter(row).count(), expected, "{text}");
    }
    assert!(text.contains("over obvhs-cwbvh") && text.contains('×'), "{text}");
}

#[test]
fn without_lights_shadow_rays_go_to_the_top() {
    let scene = directory();
    let model = file(&scene, "a.obj");
    fs::write(&model, "v 0 0 0\nv 1 0 0\nv 0 1 1\nv 2 2 2\nf 1 2 3\nf 1 3 4\n").expect("written");
    let text = bench(&model, &[]);
    assert!(text.contains("no area lights"), "{text}");
}

#[test]
fn a_camera_that_sees_nothing_and_a_store_are_refused() {
    let scene = directory();
    let json = r#"{"equilux": 1, "models": [{"file": "a.obj"}],
        "camera": {"eye": [0, 0, 5], "target": [0, 0, 9], "up": [0, 1, 0], "vfov": 40}}"#;
    fs::write(scene.path().join("a.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").expect("written");
    fs::write(scene.path().join("scene.json"), json).expect("written");
    let errors = fail(["bench", "kernel", &file(&scene, "scene.json")]);
    assert!(errors.contains("scene.json") && errors.contains("`camera`"), "{errors}");

    let store = file(&scene, "a.store");
    succeed(["scene", "build", &shipped("cornell-box"), "-q", "-o", &store]);
    let errors = fail(["bench", "kernel", &store]);
    assert!(errors.contains("a.store") && errors.contains("was built from"), "{errors}");

    assert!(fail(["bench", "kernel", "/no/such/scene.obj"]).contains("/no/such/scene.obj"));
    let none = equilux(["bench", "kernel", &shipped("cornell-box"), "--rounds", "0"]);
    assert_eq!(none.status.code(), Some(2));
}
