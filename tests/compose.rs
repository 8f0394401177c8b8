//! The compose file that users run, run: three workers in containers make the image that this
//! machine makes alone, to the bit.
//!
//! Needs a Docker Engine with Compose, and the Dockerfile's two base images, which are pulled or
//! made by `deploy/ci/base-images.sh`; the test does neither. Without them it says that it is
//! skipped, except under `CI=true`, where it fails.

use std::env;
use std::fs;
use std::future::Future;
use std::io::{self, Write};
use std::net::TcpListener;
use std::path::Path;
use std::process::{self, Command, Output};
use std::time::Duration;

use reqwest::Client;
use serde_json::{Value, json};

/// Workers in the cluster, each with one compute thread.
const WORKERS: usize = 3;

/// The scene below `scenes/`; large enough a job that nobody is done before everybody has begun.
const SCENE: &str = "cornell-box/scene.json";
const SIDE_PIXELS: u32 = 128;
const SPP: u32 = 64;

/// How long the cluster may take for one thing: to be there, or to render.
const PATIENCE: Duration = Duration::from_secs(120);

/// Between two looks at a thing that is waited for.
const PAUSE: Duration = Duration::from_millis(250);

#[tokio::test]
async fn a_composed_cluster_makes_the_very_image_of_one_machine() {
    let cluster = match Cluster::start() {
        Ok(cluster) => cluster,
        Err(reason) => return skip(&reason),
    };

    let health = || async { (cluster.healthy_count() == WORKERS + 1).then_some(()) };
    wait_for("healthy containers", health).await;
    let joined =
        || async { (cluster.get("/workers").await.as_array()?.len() == WORKERS).then_some(()) };
    wait_for("workers", joined).await;
    assert_eq!(cluster.compose(&["exec", "-T", "coordinator", "id", "-u"]), "10001\n");

    let job = cluster.submit().await;
    let job = wait_for("end of the job", || cluster.ended(&job["id"])).await;
    assert_eq!(job["state"], "done", "{job:#}");
    assert_eq!(job["progress"], 1.0, "{job:#}");
    assert_all_took_part(&job);

    let image = cluster.image(&job["id"]).await;
    assert!(image == local_image(), "the cluster's image differs from this machine's");
}

/// Every worker traced rays of its own.
fn assert_all_took_part(job: &Value) {
    let workers = job["workers"].as_array().expect("figures of each worker");
    let traced = |worker: &Value| {
        let rays = worker["rays"].as_object().expect("rays by kind");
        rays.values().filter_map(Value::as_u64).sum::<u64>() > 0
    };
    assert_eq!(workers.len(), WORKERS, "{job:#}");
    assert!(workers.iter().all(traced), "{job:#}");
}

/// The same job on this machine, without a cluster.
fn local_image() -> Vec<u8> {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let outfile = directory.path().join("local.exr");
    let mut render = Command::new(env!("CARGO_BIN_EXE_equilux"));
    render.current_dir(env!("CARGO_MANIFEST_DIR")).arg("render").arg(format!("scenes/{SCENE}"));
    render.args(["--spp", &SPP.to_string(), "--size", &format!("{SIDE_PIXELS}x{SIDE_PIXELS}")]);
    succeed(render.arg("--quiet").arg("--outfile").arg(&outfile));
    fs::read(outfile).expect("the local image")
}

/// A cluster of containers; it ends with the value.
struct Cluster {
    compose: Vec<&'static str>,
    project: String,
    port: u16,
    client: Client,
}

impl Cluster {
    /// Builds the image and brings the cluster up, or says what is missing for it.
    fn start() -> Result<Self, String> {
        if !succeeds(Command::new("docker").arg("info")) {
            return Err("there is no Docker Engine that answers".into());
        }
        let tools = [vec!["docker", "compose"], vec!["docker-compose"]];
        let mut tools = tools.into_iter().filter(|tool| succeeds(command(tool).arg("version")));
        let compose = tools.next().ok_or("there is neither `docker compose` nor docker-compose")?;
        for image in base_images() {
            if !succeeds(Command::new("docker").args(["image", "inspect", &image])) {
                return Err(format!(
                    "the base image {image} is not here; pull it, or make it by \
                     deploy/ci/base-images.sh"
                ));
            }
        }
        let project = format!("equilux-test-{}", process::id());
        let client = Client::builder().no_proxy().build().expect("an HTTP client");
        let cluster = Self { compose, project, port: http_port(), client };
        cluster.compose(&["up", "-d", "--build", "--scale", &format!("worker={WORKERS}")]);
        Ok(cluster)
    }

    /// Runs a command of Compose; what it printed.
    fn compose(&self, arguments: &[&str]) -> String {
        succeed(self.command().args(arguments))
    }

    fn command(&self) -> Command {
        let mut command = command(&self.compose);
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("deploy/compose.yaml");
        command.arg("-f").arg(file).args(["-p", &self.project]);
        command.env("EQUILUX_HTTP_PORT", self.port.to_string());
        command.env("EQUILUX_IMAGE", "equilux-test").env_remove("EQUILUX_TOKEN");
        command
    }

    fn healthy_count(&self) -> usize {
        let project = format!("label=com.docker.compose.project={}", self.project);
        let mut list = Command::new("docker");
        list.args(["ps", "--quiet", "--filter", &project, "--filter", "health=healthy"]);
        succeed(&mut list).lines().count()
    }

    fn url(&self, path: &str) -> String {
        format!("http://127.0.0.1:{}/api/v1{path}", self.port)
    }

    async fn get(&self, path: &str) -> Value {
        let response = self.client.get(self.url(path)).send().await.expect("an answer");
        response.json().await.expect("JSON")
    }

    async fn submit(&self) -> Value {
        let order = json!({
            "scene": SCENE,
            "width": SIDE_PIXELS,
            "height": SIDE_PIXELS,
            "spp": SPP,
            "workers_min": WORKERS,
        });
        let request = self.client.post(self.url("/jobs")).json(&order);
        let response = request.send().await.expect("an answer");
        let status = response.status();
        let job: Value = response.json().await.expect("JSON");
        assert_eq!(status, 201, "{job:#}");
        job
    }

    /// The job, once it has ended in whatever way.
    async fn ended(&self, id: &Value) -> Option<Value> {
        let job = self.get(&format!("/jobs/{id}")).await;
        let goes_on =
            ["queued", "preparing", "rendering"].iter().any(|state| job["state"] == *state);
        (!goes_on).then_some(job)
    }

    async fn image(&self, id: &Value) -> Vec<u8> {
        let request = self.client.get(self.url(&format!("/jobs/{id}/image.exr")));
        let response = request.send().await.expect("an answer");
        assert_eq!(response.status(), 200);
        response.bytes().await.expect("the image").to_vec()
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let logs = self.command().args(["logs", "--no-color", "--tail", "50"]).output();
            say(&logs.map(text).unwrap_or_default());
        }
        let down = self.command().args(["down", "--volumes", "--remove-orphans"]).output();
        if !down.as_ref().is_ok_and(|down| down.status.success()) {
            say(&format!("cannot take the cluster down: {}", down.map(text).unwrap_or_default()));
        }
    }
}

/// The defaults of the Dockerfile's arguments for base images.
fn base_images() -> Vec<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("deploy/Dockerfile");
    let dockerfile = fs::read_to_string(path).expect("deploy/Dockerfile");
    let arguments = dockerfile.lines().filter_map(|line| line.strip_prefix("ARG "));
    let bases =
        arguments.filter_map(|it| it.split_once("_BASE=")).map(|(_, image)| image.to_owned());
    bases.collect()
}

/// The port that is asked for, else a free one.
fn http_port() -> u16 {
    if let Ok(port) = env::var("EQUILUX_HTTP_PORT") {
        return port.parse().expect("EQUILUX_HTTP_PORT is a port");
    }
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    listener.local_addr().expect("its number").port()
}

/// Looks again and again until there is something, and fails when it takes too long.
async fn wait_for<T, F: Future<Output = Option<T>>>(what: &str, look: impl Fn() -> F) -> T {
    let found = tokio::time::timeout(PATIENCE, async {
        loop {
            if let Some(found) = look().await {
                return found;
            }
            tokio::time::sleep(PAUSE).await;
        }
    });
    found.await.unwrap_or_else(|_| panic!("waited in vain for: {what}"))
}

fn skip(reason: &str) {
    assert!(env::var("CI").as_deref() != Ok("true"), "cannot be skipped in CI: {reason}");
    say(&format!("skipped: {reason}"));
}

/// Prints past the test runner, which would keep it to itself.
fn say(text: &str) {
    let _ = writeln!(io::stderr(), "{text}");
}

fn command(words: &[&str]) -> Command {
    let mut command = Command::new(words[0]);
    command.args(&words[1..]);
    command
}

fn succeeds(command: &mut Command) -> bool {
    command.output().is_ok_and(|output| output.status.success())
}

fn succeed(command: &mut Command) -> String {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let has_succeeded = output.status.success();
    let stdout = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(has_succeeded, "{command:?}: {}", text(output));
    stdout
}

fn text(output: Output) -> String {
    let [stdout, stderr] =
        [output.stdout, output.stderr].map(|it| String::from_utf8_lossy(&it).into_owned());
    stdout + &stderr
}
