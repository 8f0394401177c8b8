//! Scenes and stores that a service is given by their path below its served root.

use std::path::Path;

use equilux_store::Store;
use reqwest::StatusCode;
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::partitions::{HALF, budgets};
use crate::service::{ended, get};
use crate::support::{PATIENCE, Service, directory, equilux, fail, file, shipped, succeed};

const SETTINGS: [&str; 4] = ["--size", "40x32", "--spp", "2"];

/// A served root with the office as a store, and what it takes.
fn root(partitions: &str) -> TempDir {
    let root = directory();
    let store = file(&root, "office.store");
    let build = ["scene", "build", &shipped("office"), "-o", &store, "--quiet"];
    succeed(build.into_iter().chain(["--partitions", partitions]));
    root
}

/// What the office looks like where it is not cut.
fn local_image() -> Vec<u8> {
    let outputs = directory();
    let (scene, outfile) = (shipped("office"), file(&outputs, "local.exr"));
    succeed(["render", &scene, "--quiet", "-o", &outfile].into_iter().chain(SETTINGS));
    std::fs::read(outfile).expect("the image")
}

async fn post(service: &Service, order: &Value) -> (StatusCode, Value) {
    let jobs = format!("{}/api/v1/jobs", service.http);
    let response = reqwest::Client::new().post(&jobs).json(order).send().await.expect("an answer");
    (response.status(), response.json().await.expect("JSON"))
}

/// The rays that workers have forwarded for a job, once they have told.
async fn forwards(job_url: &str) -> u64 {
    let told = async {
        loop {
            let job = get(job_url).await;
            let workers = job["workers"].as_array().expect("a list");
            let counts = workers.iter().map(|it| it["forwards"].as_u64().expect("a count"));
            match counts.sum() {
                0 => tokio::time::sleep(std::time::Duration::from_millis(20)).await,
                count => break count,
            }
        }
    };
    tokio::time::timeout(PATIENCE, told).await.expect("workers with half of the memory forward")
}

#[tokio::test]
async fn two_workers_with_half_of_a_store_each_render_it() {
    let (root, caches) = (root("5"), [directory(), directory()]);
    let store = file(&root, "office.store");
    let memory = budgets(Path::new(&store))[HALF].to_string();
    let service = Service::start(&["--scenes", root.path().to_str().expect("text")]);
    let _workers = caches.each_ref().map(|cache| {
        let cache = cache.path().to_str().expect("text");
        service.worker_with(&["--memory", &memory, "--cache", cache])
    });
    let expected = local_image();
    for (scene, mapping, exchange) in
        [("office.store", "diffusion", "off"), ("office.store/manifest.json", "bisection", "on")]
    {
        let order = json!({
            "scene": scene, "mapping": mapping, "exchange": exchange, "workers_min": 2,
            "width": 40, "height": 32, "spp": 2,
        });
        let (status, job) = post(&service, &order).await;
        assert_eq!(status, StatusCode::CREATED, "{job}");
        assert_eq!(job["name"], "office.store");
        let told = [&job["settings"]["mapping"], &job["settings"]["exchange"]];
        assert_eq!(told, [&json!(mapping), &json!(exchange)]);
        let job_url = format!("{}/api/v1/jobs/{}", service.http, job["id"]);
        let job = ended(&job_url).await;
        assert_eq!(job["state"], "done", "{job}");
        let image = reqwest::get(format!("{job_url}/image.exr")).await.expect("an answer");
        assert!(image.bytes().await.expect("the image") == expected, "{scene}: another image");
        assert!(forwards(&job_url).await > 0);
    }
}

#[test]
fn the_shell_names_what_lies_with_the_service() {
    let (root, cache) = (root("2"), directory());
    let scenes = root.path().to_str().expect("text");
    std::fs::create_dir(root.path().join("box")).expect("it can be made");
    for entry in Path::new(&shipped("cornell-box")).parent().expect("it").read_dir().expect("it") {
        let entry = entry.expect("an entry");
        std::fs::copy(entry.path(), root.path().join("box").join(entry.file_name())).expect("room");
    }
    let service = Service::start(&["--scenes", scenes]);
    let _worker = service.worker_with(&["--cache", cache.path().to_str().expect("text")]);
    let submit = |scene: &str, outfile: &str| {
        let args = ["submit", "--served", scene, "--coordinator", &service.http, "--watch"];
        succeed(args.into_iter().chain(["-o", outfile]).chain(SETTINGS));
        std::fs::read(outfile).expect("the image")
    };
    let outfile = file(&cache, "image.exr");
    assert!(submit("office.store", &outfile) == local_image(), "another office");
    let scene = shipped("cornell-box");
    let here = file(&cache, "here.exr");
    succeed(["render", &scene, "--quiet", "-o", &here].into_iter().chain(SETTINGS));
    assert!(submit("box", &outfile) == std::fs::read(here).expect("it"), "another box");

    let store = file(&root, "office.store");
    for args in [["submit", &store, "-o"], ["render", &store, "-o"]] {
        let watched = (args[0] == "submit").then_some("--watch");
        let args = args.into_iter().chain([&*outfile, "--coordinator", &service.http]);
        let errors = fail(args.chain(watched));
        assert!(errors.contains("not uploaded") && errors.contains("--served"), "{errors}");
    }
    let quick = equilux(["submit", "--served", "box", "--quick"]);
    assert_eq!(quick.status.code(), Some(2), "nobody here knows half of its size");
}

/// Writes a store's manifest anew, with something else in a place of it.
fn edit(store: &Path, from: &str, to: &str) {
    let manifest = store.join("manifest.json");
    let text = std::fs::read_to_string(&manifest).expect("a manifest");
    assert!(text.contains(from), "there is no {from} in {text}");
    std::fs::write(manifest, text.replacen(from, to, 1)).expect("it can be written");
}

#[cfg(unix)]
#[tokio::test]
async fn stores_that_are_missing_damaged_or_lead_out_are_refused() {
    use std::os::unix::fs::symlink;
    let (outside, root) = (root("2"), directory());
    let original = outside.path().join("office.store");
    let copy = |name: &str| {
        let store = root.path().join(name);
        let status = std::process::Command::new("cp").arg("-r").arg(&original).arg(&store).status();
        assert!(status.expect("cp starts").success());
        store
    };
    symlink(&original, root.path().join("linked.store")).expect("it can be linked");
    let relink = |store: &Path, name: &str| {
        std::fs::remove_file(store.join(name)).expect("a file");
        symlink(original.join(name), store.join(name)).expect("it can be linked");
    };
    relink(&copy("manifest.store"), "manifest.json");
    relink(&copy("lights.store"), "luminaires.bin");
    relink(&copy("part.store"), "partitions/00001.part");
    edit(&copy("named.store"), "partitions/00001.part", "../part.store/partitions/00001.part");
    edit(&copy("old.store"), "\"equilux_store\": 3", "\"equilux_store\": 1");
    edit(&copy("damaged.store"), "\"triangle_count\"", "\"triangle_cuont\"");
    std::fs::write(copy("lost.store").join("manifest.json"), "{}").expect("room");
    std::fs::write(copy("empty.store").join("manifest.json"), "").expect("room");
    std::fs::remove_file(copy("gone.store").join("partitions/00000.part")).expect("a file");
    std::fs::write(copy("short.store").join("partitions/00000.part"), "short").expect("room");
    std::fs::write(copy("dark.store").join("luminaires.bin"), "short").expect("room");

    let service = Service::start(&["--scenes", root.path().to_str().expect("text")]);
    for (scene, status, part) in [
        ("absent.store", 404, "absent.store: no such file"),
        ("absent.store/manifest.json", 404, "no such file"),
        ("linked.store", 400, "linked.store: lies outside"),
        ("../office.store", 400, "lies outside"),
        (original.to_str().expect("text"), 400, "lies outside"),
        ("manifest.store", 400, "manifest.store/manifest.json: lies outside"),
        ("manifest.store/manifest.json", 400, "manifest.json: lies outside"),
        ("lights.store", 422, "lights.store/luminaires.bin: lies outside"),
        ("part.store", 422, "part.store/partitions/00001.part: lies outside"),
        ("named.store", 422, "\"../part.store/partitions/00001.part\" is no name"),
        ("old.store", 422, "is of version 1 of the format, and this program reads version 3"),
        ("damaged.store", 422, "triangle_cuont"),
        ("lost.store", 422, "lost.store/manifest.json: is not a store's manifest"),
        ("empty.store", 422, "empty.store/manifest.json:1: EOF"),
        ("gone.store", 422, "gone.store/partitions/00000.part: no such file"),
        ("short.store", 422, "short.store/partitions/00000.part: has 5 bytes instead of"),
        ("dark.store", 422, "dark.store/luminaires.bin: has 5 bytes instead of"),
        ("short.store/partitions", 400, "is a directory without a scene.json"),
    ] {
        let (found, problem) = post(&service, &json!({ "scene": scene })).await;
        let detail = problem["detail"].as_str().expect("a text");
        assert_eq!(found, status, "{scene}: {detail}");
        assert!(detail.contains(part), "{scene}: {detail}");
        let shown = root.path().to_str().expect("text");
        assert!(!detail.contains(shown), "{scene}: tells where the root is: {detail}");
    }
    assert_eq!(get(&format!("{}/api/v1/jobs", service.http)).await, json!([]));
}

#[tokio::test]
async fn a_partition_that_is_damaged_on_disk_fails_the_job_and_is_named() {
    let (root, cache) = (root("2"), directory());
    let store = Store::open_path(&root.path().join("office.store")).expect("a store");
    let name = &store.manifest().partitions[1].file.name;
    let path = root.path().join("office.store").join(name);
    let mut bytes = std::fs::read(&path).expect("a partition");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 4;
    std::fs::write(&path, bytes).expect("room");
    let service = Service::start(&["--scenes", root.path().to_str().expect("text")]);
    let _worker = service.worker_with(&["--cache", cache.path().to_str().expect("text")]);
    let (_, job) = post(&service, &json!({"scene": "office.store", "spp": 1})).await;
    let job = ended(&format!("{}/api/v1/jobs/{}", service.http, job["id"])).await;
    assert_eq!(job["state"], "failed", "{job}");
    assert!(job["error"].as_str().is_some_and(|error| error.contains("00001.part")), "{job}");
}
