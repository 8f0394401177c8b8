//! Clusters of real processes: figures that add up, and nobody left behind.

use std::process::Stdio;

use serde_json::Value;

use crate::support::{
    Running, children_of, directory, file, is_running, long_render, shipped, succeed, until,
};

#[test]
fn the_stats_of_a_cluster_add_up() {
    let outputs = directory();
    let (image, stats) = (file(&outputs, "a.exr"), file(&outputs, "stats.json"));
    let scene = shipped("cornell-box");
    succeed([
        "render",
        &scene,
        "--workers",
        "3",
        "--threads",
        "1",
        "--size",
        "64x64",
        "--spp",
        "16",
        "--quiet",
        "-o",
        &image,
        "--stats",
        &stats,
    ]);
    let stats: Value = serde_json::from_slice(&std::fs::read(stats).expect("stats")).expect("JSON");
    assert_eq!(stats["paths"], 64 * 64 * 16);
    assert_eq!(stats["rays"]["camera"], stats["paths"]);
    let workers = stats["workers"].as_array().expect("a list");
    assert_eq!(workers.len(), 3);
    let sum =
        |field: &str| workers.iter().map(|w| w[field].as_u64().expect("a count")).sum::<u64>();
    let kinds = ["camera", "indirect", "specular", "shadow"];
    let spawned: u64 =
        kinds.iter().map(|kind| stats["rays"][kind].as_u64().expect("a count")).sum();
    assert_eq!(sum("rays"), spawned);
    assert_eq!(sum("bundles_in"), sum("bundles_out"));
    assert_eq!(sum("rays_in"), sum("rays_out"));
    assert!(workers.iter().all(|w| w["peak_rss_bytes"].as_u64() > Some(0)), "{workers:?}");
    assert!(stats["elapsed_s"].as_f64() > stats["startup_s"].as_f64());
}

#[test]
fn workers_end_with_the_process_that_started_them_even_if_it_is_killed() {
    let outputs = directory();
    let outfile = outputs.path().join("a.exr");
    let mut command = long_render(&outfile, &["--workers", "2", "--threads", "1", "--quiet"]);
    let mut process = Running { child: command.stderr(Stdio::null()).spawn().expect("it starts") };
    let parent = process.child.id();
    until("the workers run", || children_of(parent).len() == 2);
    let workers = children_of(parent);
    process.child.kill().expect("it runs");
    process.child.wait().expect("it ran");
    until("the workers are gone", || workers.iter().all(|&worker| !is_running(worker)));
}
