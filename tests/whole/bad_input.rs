//! What a user can get wrong: a clear error, exit code 1 or 2, and no file left behind.

use std::fs;
use std::path::Path;

use crate::support::{
    directory, equilux, fail, file, free_address, names_in, program, shipped, succeed,
};

/// Renders a scene made of files, which must fail, and gives the error.
fn error_of(files: &[(&str, &str)]) -> String {
    let scene = directory();
    for (name, text) in files {
        fs::write(scene.path().join(name), text).expect("written");
    }
    let outputs = directory();
    let errors = fail(["render", &file(&scene, files[0].0), "-o", &file(&outputs, "a.exr")]);
    assert!(names_in(&outputs).is_empty(), "left {:?}", names_in(&outputs));
    errors
}

fn says(errors: &str, words: &[&str]) {
    for word in words {
        assert!(errors.contains(word), "`{word}` is not in: {errors}");
    }
}

const CAMERA: &str =
    r#""camera": {"eye": [0, 0, 5], "target": [0, 0, 0], "up": [0, 1, 0], "vfov": 40}"#;
const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

#[test]
fn no_such_scene_and_a_directory_are_named() {
    says(&fail(["render", "/no/such/scene.json"]), &["/no/such/scene.json"]);
    says(&fail(["render", "/"]), &["/", "directory", "name a scene file"]);
    says(&fail(["scene", "check", "/no/such/scene.obj"]), &["/no/such/scene.obj"]);
}

#[test]
fn bad_models_are_named_with_their_line() {
    says(&error_of(&[("a.obj", "")]), &["a.obj"]);
    says(&error_of(&[("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n")]), &["a.obj", "4"]);
    let missing = format!("mtllib none.mtl\n{TRIANGLE}");
    says(&error_of(&[("a.obj", &missing)]), &["none.mtl"]);
    let textured = format!("mtllib a.mtl\nusemtl m\n{TRIANGLE}");
    let material = "newmtl m\nmap_Kd none.png\n";
    says(&error_of(&[("a.obj", &textured), ("a.mtl", material)]), &["none.png", "a.mtl"]);
    let truncated = [("a.obj", &*textured), ("a.mtl", material), ("none.png", "\u{89}PNG\r\n")];
    says(&error_of(&truncated), &["none.png"]);
}

#[test]
fn headers_with_wrong_counts_are_blamed() {
    let ply = |counts: [u32; 2]| {
        let [vertices, faces] = counts;
        let model = format!(
            "ply\nformat ascii 1.0\nelement vertex {vertices}\nproperty float x\n\
             property float y\nproperty float z\nelement face {faces}\n\
             property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
        );
        error_of(&[("a.ply", &model)])
    };
    says(&ply([2, 1]), &["a.ply:12", "bytes follow", "counts in the header are too small"]);
    says(&ply([4, 1]), &["a.ply:14", "face 0", "its header counts too many"]);
    says(&ply([3, 2]), &["a.ply:14", "face 1", "its header counts too many"]);
    says(&ply([3, 0]), &["a.ply:13", "bytes follow", "counts in the header are too small"]);
}

/// A store of which a file is cut short, or has another byte at a place.
#[test]
fn what_is_wrong_with_a_store_is_told_by_its_path() {
    let home = directory();
    let store = file(&home, "box.store");
    let build = ["scene", "build", &shipped("cornell-box"), "-o", &store, "--partitions", "2"];
    succeed(build.into_iter().chain(["--quiet"]));
    let outfile = file(&home, "a.png");
    let render = ["render", "box.store", "--quick", "--quiet", "-o", &outfile];
    let cluster = [&render[..], &["--workers", "1", "--threads", "1"]].concat();
    let names = ["manifest.json", "luminaires.bin", "partitions/00001.part"];
    for name in names {
        let path = home.path().join("box.store").join(name);
        let whole = fs::read(&path).expect("a file");
        let mut flipped = whole.clone();
        flipped[whole.len() * 2 / 3] ^= 0x80;
        for damaged in [&whole[..whole.len() / 2], &flipped] {
            fs::write(&path, damaged).expect("room");
            for args in [&render[..], &cluster, &["scene", "check", "box.store"]] {
                let output = program().args(args).current_dir(home.path()).output();
                let output = output.expect("the program starts");
                let errors = String::from_utf8_lossy(&output.stderr);
                assert_eq!(output.status.code(), Some(1), "{args:?}: {errors}");
                // Workers know no more than the name in the store.
                says(&errors, &["box.store", name, "again"]);
                let is_alone = !args.contains(&"--workers");
                let path = format!("box.store/{name}");
                assert!(errors.contains(&path) || !is_alone, "{path} is not in: {errors}");
            }
        }
        fs::write(&path, whole).expect("room");
    }
    assert!(!Path::new(&outfile).exists());
}

#[test]
fn bad_scene_files_are_named_with_field_and_remedy() {
    let scene = |more: &str| {
        let text = format!(
            "{{\"equilux\": 1,\n{CAMERA},\n\"models\": [{{\"file\": \"a.obj\"}}]{more}\n}}"
        );
        error_of(&[("scene.json", &text), ("a.obj", TRIANGLE)])
    };
    says(&scene(",\n\"integrater\": {}"), &["integrater", "integrator", "scene.json:4"]);
    says(&scene(",\n\"film\": {\"width\": \"wide\"}"), &["width", "scene.json:4"]);
    says(&scene(",\n\"film\": {\"width\": 0}"), &["width"]);
    says(&scene(",\n\"integrator\": {\"spp\": -3}"), &["spp"]);
    says(&scene(",\n\"film\": {\"width\": 1000000000, \"height\": 1000000000}"), &["width"]);
    let no_camera = "{\"equilux\": 1, \"models\": [{\"file\": \"a.obj\"}]}";
    says(&error_of(&[("scene.json", no_camera), ("a.obj", TRIANGLE)]), &["camera"]);
}

#[test]
fn wrong_usage_is_exit_code_2() {
    let scene = shipped("cornell-box");
    for args in [
        &["render"][..],
        &["render", &scene, "--spp", "0"],
        &["render", &scene, "--size", "wide"],
        &["render", &scene, "--workers", "-1"],
        &["sing"],
    ] {
        assert_eq!(equilux(args.iter().copied()).status.code(), Some(2), "{args:?}");
    }
}

#[test]
fn outputs_that_cannot_be_written_are_refused_before_the_work() {
    let scene = shipped("cornell-box");
    says(&fail(["render", &scene, "-o", "/no/such/directory/a.exr"]), &["/no/such/directory"]);
    says(&fail(["render", &scene, "-o", "a.jpg"]), &[".exr or .png"]);
}

#[test]
fn help_and_version_are_there_on_every_level() {
    for args in
        [&["--help"][..], &["--version"], &["render", "--help"], &["scene", "check", "--help"]]
    {
        assert!(equilux(args.iter().copied()).status.success(), "{args:?}");
    }
}

#[test]
fn a_port_in_use_and_an_unreachable_service_are_named() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = taken.local_addr().expect("an address").to_string();
    let data = directory();
    let data = data.path().to_str().expect("text");
    let free = "127.0.0.1:0";
    let errors = fail(["coordinator", "--grpc", &address, "--http", free, "--data", data]);
    says(&errors, &[&address, "--grpc"]);
    let errors = fail(["coordinator", "--http", &address, "--grpc", free, "--data", data]);
    says(&errors, &[&address, "--http"]);
    let nobody = format!("http://{}", free_address());
    says(&fail(["jobs", "--coordinator", &nobody]), &[&nobody, "equilux coordinator"]);
}

#[test]
fn a_closed_standard_output_is_no_panic() {
    let scene = shipped("cornell-box");
    let mut command = program();
    let mut child = command
        .args(["scene", "check", &scene])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .expect("it starts");
    drop(child.stdout.take());
    let output = child.wait_with_output().expect("it ends");
    assert!(!String::from_utf8_lossy(&output.stderr).contains("panicked"));
}
