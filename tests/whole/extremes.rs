//! Models that leave nothing to cut by: the image is that of the model in one piece.

use std::fmt::Write;
use std::path::Path;

use equilux_store::Store;

use crate::partitions::{budgets, render};
use crate::support::{directory, fail, file, names_in, succeed};

const SCENE: &str = r#"{"equilux": 1,
    "camera": {"eye": [0.4, 0.3, 6], "target": [0, 0, 0], "up": [0, 1, 0], "vfov": 40},
    "environment": {"radiance": [1, 0.8, 0.6]},
    "models": [{"file": "model.obj"}]}"#;

/// A triangle as a model has it.
fn triangle(model: &mut String, corners: [[f32; 3]; 3]) {
    for [x, y, z] in corners {
        writeln!(model, "v {x} {y} {z}").expect("there is room");
    }
    model.push_str("f -3 -2 -1\n");
}

/// Renders a model as it is, then cut, with one worker and with two that have memory for its
/// largest partition alone.
fn is_the_same_cut(model: &str, cut: &[&str], check: impl Fn(&[u64])) {
    let home = directory();
    let (scene, store) = (file(&home, "scene.json"), file(&home, "store"));
    std::fs::write(home.path().join("model.obj"), model).expect("room");
    std::fs::write(&scene, SCENE).expect("room");
    let expected = render(&scene, &[]);
    let build = ["scene", "build", &scene, "-o", &store, "--quiet"];
    succeed(build.into_iter().chain(cut.iter().copied()));
    let manifest = Store::open_path(Path::new(&store)).expect("a store").into_parts().0;
    let counts: Vec<u64> = manifest.partitions.iter().map(|it| it.triangle_count).collect();
    check(&counts);
    let [.., least] = budgets(Path::new(&store));
    let memory = ["--memory", &least.to_string(), "--threads", "1"];
    for workers in [&[][..], &["--workers", "1"], &["--workers", "2"]] {
        let way = [&memory[..], workers].concat();
        assert!(render(&store, &way) == expected, "another image with {way:?}");
    }
}

#[test]
fn a_single_triangle_in_seven_partitions() {
    let mut model = String::new();
    triangle(&mut model, [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.5]]);
    is_the_same_cut(&model, &["--partitions", "7"], |counts| {
        assert_eq!((counts.len(), counts.iter().sum()), (7, 1));
    });
}

#[test]
fn thousands_of_triangles_about_a_single_point() {
    let mut model = String::new();
    // A few steps of single precision across.
    let [x, y, z] = [0.5, 0.25, 1.0];
    let corners = [[x, y, z], [x + 3e-7, y, z], [x, y + 3e-7, z]];
    (0..4000).for_each(|_| triangle(&mut model, corners));
    is_the_same_cut(&model, &["--partition-size", "64KiB"], |counts| assert!(counts.len() > 2));
}

#[test]
fn nothing_but_a_point_is_refused() {
    let home = directory();
    let mut model = String::new();
    (0..4000).for_each(|_| triangle(&mut model, [[0.5, 0.25, 1.0]; 3]));
    let (model_file, store) = (file(&home, "model.obj"), file(&home, "store"));
    std::fs::write(&model_file, model).expect("room");
    for args in [["render", &model_file, "-o", "a.png"], ["scene", "build", &model_file, "-o"]] {
        let is_build = args[0] == "scene";
        let errors = fail(args.into_iter().chain(is_build.then_some(&*store)));
        assert!(errors.contains("model.obj") && errors.contains("degenerate"), "{errors}");
    }
    assert_eq!(names_in(&home), [Path::new("model.obj")]);
}

#[test]
fn thousands_of_triangles_in_the_same_place() {
    let mut model = String::new();
    let corners = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.5]];
    (0..4000).for_each(|_| triangle(&mut model, corners));
    is_the_same_cut(&model, &["--partition-size", "64KiB"], |counts| assert!(counts.len() > 2));
}

#[test]
fn one_triangle_of_enormous_size_across_all_partitions() {
    let mut model = String::new();
    for number in 0..3000u16 {
        let [x, y] = [number % 60, number / 60].map(|at| f32::from(at) * 0.1 - 2.5);
        let z = f32::from(number % 7) * 0.2 - 0.5;
        triangle(&mut model, [[x, y, z], [x + 0.09, y, z], [x, y + 0.09, z + 0.1]]);
        if number == 1500 {
            triangle(&mut model, [[-1e7, -1e7, 0.0], [1e7, -1e7, 0.1], [0.0, 1e7, -0.1]]);
        }
    }
    is_the_same_cut(&model, &["--partitions", "7"], |counts| {
        assert!(counts.len() == 7 && counts.iter().all(|&count| count > 1), "{counts:?}");
    });
}
