//! Who may do what, over real sockets.

use equilux_coordinator::serve::{ServeError, Server};
use reqwest::{Method, header};
use serde_json::json;

use crate::site::{self, Site, problem};

#[tokio::test]
async fn the_token_guards_what_changes_state() {
    let site = Site::start_with(|options| options.rest.token = Some("sesame".into())).await;
    let body = json!({ "scene": "scene.json" });
    let answer = site.post(&body).await;
    assert_eq!(answer.headers()[header::WWW_AUTHENTICATE], "Bearer");
    problem(answer, 401).await;
    problem(site.delete("/api/v1/jobs/1").await, 401).await;
    let request = |token: &str| {
        site.request(Method::POST, "/api/v1/jobs").bearer_auth(token).json(&body).send()
    };
    problem(request("open").await.expect("an answer"), 401).await;
    assert_eq!(request("sesame").await.expect("an answer").status(), 201);
    assert_eq!(site.get("/api/v1/jobs/1").await.status(), 200, "reading needs no token");
}

#[tokio::test]
async fn foreign_pages_change_nothing() {
    let site = Site::start().await;
    let post = |name: &str, value: &str| {
        let request = site.request(Method::POST, "/api/v1/jobs");
        request
            .header(name.to_owned(), value.to_owned())
            .json(&json!({ "scene": "scene.json" }))
            .send()
    };
    problem(post("origin", "https://evil.example").await.expect("an answer"), 403).await;
    problem(post("host", "evil.example").await.expect("an answer"), 421).await;
    assert!(site.handle.jobs().is_empty());
    assert_eq!(post("origin", site.base()).await.expect("an answer").status(), 201);
}

#[tokio::test]
async fn other_machines_need_a_token_or_trust() {
    let data = tempfile::tempdir().expect("a temporary directory");
    let mut options = site::options(data.path());
    options.http = "0.0.0.0:0".into();
    let error = Server::bind(options.clone()).await.expect_err("open to everybody");
    assert!(matches!(error, ServeError::Open { .. }));
    for part in ["--token", "EQUILUX_TOKEN", "--allow-open"] {
        assert!(error.to_string().contains(part), "{error}");
    }
    options.allow_open = true;
    drop(Server::bind(options.clone()).await.expect("trusted"));
    options.allow_open = false;
    options.rest.token = Some("sesame".into());
    options.data = data.path().join("other");
    Server::bind(options).await.expect("guarded");
}

#[tokio::test]
async fn what_cannot_be_had_is_named_with_its_flag() {
    let site = Site::start().await;
    let data = tempfile::tempdir().expect("a temporary directory");
    let refusal = async |change: &dyn Fn(&mut equilux_coordinator::serve::ServeOptions)| {
        let mut options = site::options(data.path());
        change(&mut options);
        Server::bind(options).await.expect_err("it cannot be had").to_string()
    };
    let http = site.base().trim_start_matches("http://").to_owned();
    let in_use = refusal(&|options| options.http.clone_from(&http)).await;
    assert!(in_use.contains("in use") && in_use.contains("--http") && in_use.contains(&http));
    let in_use = refusal(&|options| options.grpc.clone_from(&site.grpc)).await;
    assert!(in_use.contains("in use") && in_use.contains("--grpc"), "{in_use}");
    let nowhere = refusal(&|options| options.grpc = "nowhere".into()).await;
    assert!(nowhere.contains("HOST:PORT") && nowhere.contains("--grpc"), "{nowhere}");
    let scenes = refusal(&|options| options.rest.scenes = Some("/no/such/place".into())).await;
    assert!(scenes.contains("/no/such/place") && scenes.contains("--scenes"), "{scenes}");
    let taken = refusal(&|options| options.data = site.data.path().into()).await;
    assert!(taken.contains("another coordinator") && taken.contains("--data"), "{taken}");
}
