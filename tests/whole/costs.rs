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
