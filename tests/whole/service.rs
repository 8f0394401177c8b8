//! The service: jobs over REST from submission to image, by raw requests and by the shell's
//! commands, with real coordinators and workers.

use reqwest::StatusCode;
use reqwest::multipart::{Form, Part};
use serde_json::{Value, json};

use crate::support::{
    PATIENCE, Service, directory, equilux, fail, file, free_address, line_after, lines_of, shipped,
    succeed, until, worker,
};

const SETTINGS: [&str; 4] = ["--size", "48x40", "--spp", "4"];

/// The image that a service must deliver for the Cornell box with [`SETTINGS`].
fn local_image() -> Vec<u8> {
    let outputs = directory();
    let (scene, outfile) = (shipped("cornell-box"), file(&outputs, "local.exr"));
    let args = ["render", &scene, "--quiet", "-o", &outfile];
    succeed(args.into_iter().chain(SETTINGS));
    std::fs::read(outfile).expect("the image")
}

/// What a URL answers.
pub(crate) async fn get(url: &str) -> Value {
    let response = reqwest::get(url).await.expect("an answer");
    assert!(response.status().is_success(), "{}", response.status());
    response.json().await.expect("JSON")
}

/// Polls a job until it has ended and gives it.
pub(crate) async fn ended(job_url: &str) -> Value {
    let polling = async {
        loop {
            let job = get(job_url).await;
            let progress = job["progress"].as_f64().expect("a number");
            assert!((0.0..=1.0).contains(&progress));
            match job["state"].as_str().expect("a word") {
                "queued" | "preparing" | "rendering" => {}
                _ => break job,
            }
            tokio::time::sleep(std::time::Duration::from_millis(20)).await;
        }
    };
    tokio::time::timeout(PATIENCE, polling).await.expect("the job ends")
}

#[tokio::test]
async fn a_job_goes_over_rest_from_submission_to_image() {
    let scenes = format!("{}/scenes", env!("CARGO_MANIFEST_DIR"));
    let service = Service::start(&["--scenes", &scenes]);
    let _workers = [service.worker(), service.worker()];
    assert!(reqwest::get(format!("{}/healthz", service.http)).await.unwrap().status().is_success());

    let jobs = format!("{}/api/v1/jobs", service.http);
    let order = json!({"scene": "cornell-box/scene.json", "width": 48, "height": 40, "spp": 4});
    let response = reqwest::Client::new().post(&jobs).json(&order).send().await.unwrap();
    assert_eq!(response.status(), StatusCode::CREATED);
    let job: Value = response.json().await.unwrap();
    let job_url = format!("{jobs}/{}", job["id"]);

    let job = ended(&job_url).await;
    assert_eq!((&job["state"], &job["progress"]), (&json!("done"), &json!(1.0)), "{job}");
    let image = reqwest::get(format!("{job_url}/image.exr")).await.unwrap().bytes().await.unwrap();
    assert!(image == local_image(), "the service's image differs from the local one");
    let png = reqwest::get(format!("{job_url}/image.png")).await.unwrap().bytes().await.unwrap();
    assert!(png.starts_with(b"\x89PNG"));

    let workers = get(&format!("{}/api/v1/workers", service.http)).await;
    assert_eq!(workers.as_array().expect("a list").len(), 2);
    assert_eq!(get(&jobs).await.as_array().expect("a list").len(), 1);
}

#[tokio::test]
async fn an_upload_that_is_no_scene_is_refused_and_the_next_job_runs() {
    let service = Service::start(&[]);
    let _worker = service.worker();
    let jobs = format!("{}/api/v1/jobs", service.http);
    let rubbish = Part::bytes(vec![7; 1000]).file_name("scene.zip");
    let form = Form::new().part("scene", rubbish);
    let response = reqwest::Client::new().post(&jobs).multipart(form).send().await.unwrap();
    assert!(response.status().is_client_error());
    assert_eq!(response.headers()["content-type"], "application/problem+json");
    let problem: Value = response.json().await.unwrap();
    assert!(problem["detail"].as_str().is_some_and(|detail| !detail.is_empty()), "{problem}");

    let outputs = directory();
    let (scene, outfile) = (shipped("cornell-box"), file(&outputs, "a.exr"));
    let args = ["submit", &scene, "--coordinator", &service.http, "--watch", "-o", &outfile];
    succeed(args.into_iter().chain(SETTINGS));
    assert!(std::fs::read(outfile).expect("the image") == local_image());
}

#[test]
fn a_job_is_cancelled_in_the_middle_and_keeps_what_it_has() {
    let service = Service::start(&[]);
    let _worker = service.worker();
    let scene = shipped("cornell-box");
    let at = ["--coordinator", &*service.http];
    let long = ["submit", &scene, "--size", "128x128", "--spp", "100000"];
    let id = succeed(long.into_iter().chain(at));
    let id = id.trim();
    until("the job runs", || succeed(["jobs"].into_iter().chain(at)).contains("rendering"));
    succeed(["cancel", id].into_iter().chain(at));
    until("it is cancelled", || succeed(["jobs"].into_iter().chain(at)).contains("cancelled"));
    assert!(fail(["watch", id, "--quiet"].into_iter().chain(at)).contains("cancelled"));
    let outputs = directory();
    let outfile = file(&outputs, "partial.exr");
    succeed(["fetch", id, "-o", &outfile].into_iter().chain(at));

    let next = ["submit", &scene, "--watch"];
    succeed(next.into_iter().chain(SETTINGS).chain(at));
}

#[test]
fn render_on_a_service_gives_the_same_image_as_at_home() {
    let service = Service::start(&[]);
    let _workers = [service.worker(), service.worker(), service.worker()];
    let outputs = directory();
    let (scene, outfile) = (shipped("cornell-box"), file(&outputs, "a.exr"));
    let args = ["render", &scene, "--coordinator", &service.http, "--quiet", "-o", &outfile];
    succeed(args.into_iter().chain(SETTINGS));
    assert!(std::fs::read(outfile).expect("the image") == local_image());
}

#[test]
fn a_worker_may_start_before_its_coordinator() {
    let address = free_address();
    let mut worker = worker(&format!("http://{address}"), &[]);
    let lines = lines_of(worker.child.stderr.take().expect("a pipe"));
    line_after(&lines, "trying again in ");
    let service = Service::start_at(&address, &[]);
    let scene = shipped("cornell-box");
    let args = ["submit", &scene, "--watch", "--coordinator", &service.http];
    succeed(args.into_iter().chain(SETTINGS));
}

#[test]
fn a_token_guards_what_changes_something() {
    let service = Service::start(&["--token", "open sesame"]);
    let scene = shipped("cornell-box");
    let submit = ["submit", &scene, "--coordinator", &service.http];
    let errors = fail(submit);
    assert!(errors.contains("--token"), "{errors}");
    assert!(equilux(["jobs", "--coordinator", &service.http]).status.success());
    succeed(submit.into_iter().chain(["--token", "open sesame"]));
}
