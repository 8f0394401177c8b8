//! Recording what paths cost: a file that can be read, beside the very same image.

use std::fs;

use equilux_common::costs::SceneCosts;

use crate::support::{directory, equilux, fail, file, names_in, shipped, succeed};

#[test]
fn recording_costs_changes_no_bit_of_the_image() {
    let (scene, outputs) = (shipped("cornell-box"), directory());
    let (plain, recorded) = (file(&outputs, "plain.exr"), file(&outputs, "recorded.exr"));
    let costs = file(&outputs, "costs.json");
    let common = ["render", &scene, "--size", "50x36", "--spp", "3", "--threads", "2", "--quiet"];
    succeed(common.into_iter().chain(["-o", &plain]));
    succeed(common.into_iter().chain(["-o", &recorded, "--record-costs", &costs]));
    assert!(fs::read(plain).expect("an image") == fs::read(recorded).expect("an image"));
    let text = fs::read_to_string(costs).expect("the costs");
    let costs = SceneCosts::from_json(&text).expect("costs that can be read");
    assert_eq!((&*costs.scene, costs.width, costs.height), ("cornell-box", 50, 36));
    assert_eq!((costs.samples_per_pixel, costs.cells.len()), (3, 7 * 5));
    assert!(costs.cells.iter().any(|cell| cell.rays_per_path.len() > 2), "some paths go deep");
    assert_eq!(names_in(&outputs).len(), 3, "nothing else is left");
}

#[test]
fn what_cannot_be_recorded_is_refused_before_the_work() {
    let (scene, outputs) = (shipped("cornell-box"), directory());
    let image = file(&outputs, "a.exr");
    let render = ["render", &scene, "-o", &image, "--record-costs"];
    let with =
        |more: &[&'static str]| -> Vec<&str> { render.iter().chain(more).copied().collect() };
    assert!(fail(with(&["/no/such/directory/costs.json"])).contains("/no/such/directory"));
    assert!(fail(with(&["/"])).contains("is a directory"));
    for others in [["--workers", "2"], ["--coordinator", "http://127.0.0.1:1"]] {
        let output = equilux(with(&["costs.json", others[0], others[1]]));
        let errors = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{errors}");
        assert!(errors.contains("--record-costs") && errors.contains(others[0]), "{errors}");
    }
    assert!(names_in(&outputs).is_empty(), "{:?}", names_in(&outputs));
}

/// What was simulated of four workers: efficiency, forwards per path, and partitions that a worker
/// loads.
fn simulated(costs: &str, outdir: &str, exchange: &str) -> [f64; 3] {
    let simulate = ["simulate", "--costs", costs, "--workers", "4", "--memory", "1/2"];
    let how = ["--work", "2", "--balance", "diffusion", "--details", "--outdir", outdir];
    let text = succeed(simulate.into_iter().chain(how).chain(["--exchange", exchange]));
    let row = text.lines().rev().find(|line| line.contains("diffusion")).expect("a row of details");
    let cells: Vec<&str> = row.split_whitespace().collect();
    [7, 8, 9].map(|column| cells[column].parse().expect("a number"))
}

#[test]
fn a_store_is_simulated_from_what_was_recorded_of_it() {
    let outputs = directory();
    let (store, costs) = (file(&outputs, "office.store"), file(&outputs, "costs.json"));
    let (image, outdir) = (file(&outputs, "a.png"), file(&outputs, "figures"));
    succeed(["scene", "build", &shipped("office"), "-o", &store, "--partitions", "6", "--quiet"]);
    let render = ["render", &store, "--size", "64x48", "--spp", "4", "--threads", "1", "--quiet"];
    succeed(render.into_iter().chain(["-o", &image, "--record-costs", &costs]));
    // More cannot be said: it depends on how long paths took, which differs from run to run, and
    // whoever is full makes copies even where nothing is exchanged.
    for exchange in ["on", "off"] {
        let [efficiency, forwards, loads] = simulated(&costs, &outdir, exchange);
        let is_plausible = efficiency > 0.1 && forwards > 0.5 && loads >= 1.0;
        assert!(is_plausible, "{exchange}: {efficiency} {forwards} {loads}");
    }
}
