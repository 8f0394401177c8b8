//! A coordinator on ports of its own, with a data directory and a served root of its own.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use equilux_common::balancing::Balancing;
use equilux_common::film::TileSums;
use equilux_common::ids::JobId;
use equilux_common::image::Image;
use equilux_common::scene::files::Pack;
use equilux_common::scene::load::load;
use equilux_common::topology::Topology;
use equilux_coordinator::attachments::Attachments;
use equilux_coordinator::handle::Handle;
use equilux_coordinator::order::Order;
use equilux_coordinator::rest::RestOptions;
use equilux_coordinator::serve::{ServeError, ServeOptions, Server};
use reqwest::{Method, RequestBuilder, Response, StatusCode};
use serde_json::{Value, json};
use tempfile::TempDir;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;

use crate::worker;

/// No test waits longer for anything.
pub(crate) const PATIENCE: Duration = Duration::from_secs(20);

/// 40 × 24 pixels in tiles of 16 × 16: six units.
pub(crate) const SCENE: &str = r#"{
    "equilux": 1,
    "camera": { "eye": [0, 0, 3], "target": [0, 0, 0], "up": [0, 1, 0], "vfov": 40 },
    "film": { "width": 40, "height": 24 },
    "integrator": { "spp": 4, "max_depth": 3 },
    "models": [{ "file": "triangle.obj" }]
}"#;

pub(crate) const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

pub(crate) struct Site {
    pub(crate) handle: Handle,
    pub(crate) grpc: String,
    pub(crate) data: TempDir,
    pub(crate) scenes: TempDir,
    base: String,
    client: reqwest::Client,
    stop: oneshot::Sender<()>,
    running: JoinHandle<Result<(), ServeError>>,
}

/// Options for ports that nobody uses.
pub(crate) fn options(data: &Path) -> ServeOptions {
    ServeOptions {
        grpc: "127.0.0.1:0".into(),
        http: "127.0.0.1:0".into(),
        data: data.into(),
        allow_open: false,
        rest: RestOptions::default(),
    }
}

/// The scene as an order, for a coordinator without sockets.
pub(crate) fn order() -> Order {
    let files = [("scene.json", SCENE), ("triangle.obj", TRIANGLE)];
    let pack = Pack::from_files(files.map(|(name, text)| (name.to_owned(), text.into())));
    let pack = pack.expect("plain names");
    let loaded = load(&pack, "scene.json").expect("a fine scene");
    Order {
        attachments: Attachments::default(),
        pack: Arc::new(pack),
        entry: "scene.json".into(),
        camera_name: None,
        camera: loaded.camera,
        settings: loaded.settings,
        balancing: Balancing::default(),
        topology: Topology::Hypercube,
        workers_min: 1,
        name: "order".into(),
        warnings: loaded.warnings,
    }
}

impl Site {
    pub(crate) async fn start() -> Self {
        Self::start_with(|_| ()).await
    }

    pub(crate) async fn start_with(change: impl FnOnce(&mut ServeOptions)) -> Self {
        let data = tempfile::tempdir().expect("a temporary directory");
        let scenes = tempfile::tempdir().expect("a temporary directory");
        for (name, text) in [("scene.json", SCENE), ("triangle.obj", TRIANGLE)] {
            std::fs::write(scenes.path().join(name), text).expect("room on the disk");
        }
        let mut options = options(data.path());
        options.rest.scenes = Some(scenes.path().into());
        change(&mut options);
        let server = Server::bind(options).await.expect("free ports");
        let base = format!("http://{}", server.http_address());
        let grpc = server.grpc_address().to_string();
        let handle = server.handle();
        let (stop, stopped) = oneshot::channel();
        let running = tokio::spawn(server.run(async move {
            let _stopped_or_dropped = stopped.await;
        }));
        let client = reqwest::Client::new();
        Self { handle, grpc, data, scenes, base, client, stop, running }
    }

    pub(crate) fn base(&self) -> &str {
        &self.base
    }

    /// Stops the service, which must take its leave in time.
    pub(crate) async fn stop(self) {
        self.stop.send(()).expect("the service runs");
        let ended = tokio::time::timeout(PATIENCE, self.running).await.expect("in time");
        ended.expect("no panic").expect("no failure");
    }

    pub(crate) fn request(&self, method: Method, path: &str) -> RequestBuilder {
        self.client.request(method, format!("{}{path}", self.base)).timeout(PATIENCE)
    }

    pub(crate) async fn get(&self, path: &str) -> Response {
        self.request(Method::GET, path).send().await.expect("an answer")
    }

    pub(crate) async fn post(&self, body: &Value) -> Response {
        let request = self.request(Method::POST, "/api/v1/jobs").json(body);
        request.send().await.expect("an answer")
    }

    pub(crate) async fn delete(&self, path: &str) -> Response {
        self.request(Method::DELETE, path).send().await.expect("an answer")
    }

    /// Submits the scene with these settings besides; gives the job's number.
    pub(crate) async fn submit(&self, settings: Value) -> u64 {
        let mut body = json!({ "scene": "scene.json" });
        let fields = body.as_object_mut().expect("an object");
        fields.extend(settings.as_object().expect("an object").clone());
        let answer = self.post(&body).await;
        assert_eq!(answer.status(), StatusCode::CREATED);
        json_of(answer).await["id"].as_u64().expect("a number")
    }

    /// Uploads these bytes as an archive.
    pub(crate) async fn upload(&self, archive: Vec<u8>, texts: &[(&str, &str)]) -> Response {
        let part = reqwest::multipart::Part::bytes(archive).file_name("scene");
        let mut form = reqwest::multipart::Form::new();
        for (name, text) in texts {
            form = form.text((*name).to_owned(), (*text).to_owned());
        }
        let request =
            self.request(Method::POST, "/api/v1/jobs").multipart(form.part("scene", part));
        request.send().await.expect("an answer")
    }

    pub(crate) async fn job(&self, id: u64) -> Value {
        json_of(self.get(&format!("/api/v1/jobs/{id}")).await).await
    }

    /// Polls a job until it is in this state.
    pub(crate) async fn wait_for(&self, id: u64, state: &str) -> Value {
        let polling = async {
            loop {
                let job = self.job(id).await;
                if job["state"] == state {
                    return job;
                }
                tokio::time::sleep(Duration::from_millis(10)).await;
            }
        };
        tokio::time::timeout(PATIENCE, polling).await.expect("the state is reached in time")
    }

    /// A job's image as a file.
    pub(crate) async fn image(&self, id: u64, name: &str) -> Vec<u8> {
        let answer = self.get(&format!("/api/v1/jobs/{id}/{name}")).await;
        assert_eq!(answer.status(), StatusCode::OK);
        answer.bytes().await.expect("a whole body").to_vec()
    }

    /// The EXR file of a job whose first `unit_count` units are delivered.
    pub(crate) fn expected_exr(&self, id: u64, unit_count: u32) -> Vec<u8> {
        let plan = self.handle.job(JobId(id)).expect("a job").plan;
        let settings = &plan.settings;
        let mut film = TileSums::new(settings.region());
        let grid = worker::grid(settings);
        for unit in 0..unit_count {
            film.merge(&worker::values(&grid, unit));
        }
        Image::develop(&film, settings).to_exr().expect("an image")
    }
}

pub(crate) async fn json_of(answer: Response) -> Value {
    answer.json().await.expect("a JSON document")
}

/// Makes sure that an answer is a problem document; gives its detail.
pub(crate) async fn problem(answer: Response, status: u16) -> String {
    let path = answer.url().path().to_owned();
    let media_type = answer.headers()["content-type"].to_str().expect("text").to_owned();
    let answered = answer.status().as_u16();
    let text = answer.text().await.expect("a text");
    assert_eq!(answered, status, "{text}");
    assert_eq!(media_type, "application/problem+json");
    let document: Value = serde_json::from_str(&text).expect("a JSON document");
    assert_eq!(document["status"], status);
    assert_eq!(document["instance"], path);
    let kind = document["type"].as_str().expect("a type");
    let (_, kind) = kind.rsplit_once('/').expect("a path");
    let openapi: Value = serde_json::from_str(include_str!("../../src/rest/openapi.json"))
        .expect("the document is JSON");
    assert!(openapi["x-problems"][kind].is_string(), "{kind} is not described");
    assert!(document["title"].is_string());
    document["detail"].as_str().expect("a detail").to_owned()
}
