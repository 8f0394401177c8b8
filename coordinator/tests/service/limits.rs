//! What is full is refused with a time to come back, and what is old is forgotten.

use equilux_common::ids::JobId;
use equilux_coordinator::order::JOBS_QUEUED_MAX;
use reqwest::{Method, header};
use serde_json::json;

use crate::site::{Site, problem};
use crate::worker::{Worker, hello};

#[tokio::test]
async fn a_full_queue_is_refused_with_a_time_to_come_back() {
    let site = Site::start().await;
    for _ in 0..=JOBS_QUEUED_MAX {
        site.submit(json!({})).await;
    }
    let answer = site.post(&json!({ "scene": "scene.json" })).await;
    assert!(answer.headers().contains_key(header::RETRY_AFTER));
    let detail = problem(answer, 503).await;
    assert!(detail.contains("wait already"), "{detail}");
    site.delete("/api/v1/jobs/1").await;
    site.submit(json!({})).await;
}

#[tokio::test]
async fn the_oldest_of_many_jobs_are_forgotten_with_their_images() {
    let site = Site::start().await;
    let _worker = Worker::willing(&site.handle).await;
    let mut last = 0;
    for _ in 0..105 {
        last = site.submit(json!({ "width": 8, "height": 8 })).await;
        site.wait_for(last, "done").await;
    }
    let forgotten = async {
        while site.handle.job(JobId(5)).is_some() || site.data.path().join("jobs/5").exists() {
            tokio::task::yield_now().await;
        }
    };
    tokio::time::timeout(crate::site::PATIENCE, forgotten).await.expect("forgotten in time");
    problem(site.get("/api/v1/jobs/1").await, 404).await;
    assert_eq!(site.get(&format!("/api/v1/jobs/{last}/image.exr")).await.status(), 200);
    assert_eq!(site.handle.jobs().len(), 100);
}

#[tokio::test]
async fn a_worker_is_listed_until_its_connection_is_dropped() {
    let site = Site::start().await;
    let connection = site.handle.connect(hello("one")).await.expect("let in");
    let workers = crate::site::json_of(site.get("/api/v1/workers").await).await;
    assert_eq!(workers[0]["name"], "one");
    assert_eq!(workers[0]["threads"], 2);
    drop(connection);
    let gone = async {
        while !site.handle.workers().is_empty() {
            tokio::task::yield_now().await;
        }
    };
    tokio::time::timeout(crate::site::PATIENCE, gone).await.expect("lost in time");
}

#[tokio::test]
async fn everything_described_is_served_and_everything_served_is_described() {
    let site = Site::start().await;
    let _worker = Worker::willing(&site.handle).await;
    site.submit(json!({})).await;
    site.wait_for(1, "done").await;
    let document = crate::site::json_of(site.get("/openapi.json").await).await;
    let paths = document["paths"].as_object().expect("paths");
    let served = include_str!("../../src/rest.rs");
    let routes: Vec<&str> = served
        .split(".route(\"")
        .skip(1)
        .map(|rest| rest.split('"').next().expect("a path"))
        .collect();
    assert_eq!(routes.len(), paths.len());
    for route in routes {
        let full = format!("/api/v1{route}");
        assert!(paths.contains_key(route) || paths.contains_key(&full), "{route}");
    }
    for (path, methods) in paths {
        let path = path.replace("{id}", "1");
        for method in ["get", "post", "delete"] {
            if methods.get(method).is_none() {
                continue;
            }
            let method = Method::from_bytes(method.to_uppercase().as_bytes()).expect("a method");
            let answer = site.request(method, &path).send().await.expect("an answer");
            assert!(![404, 405].contains(&answer.status().as_u16()), "{path}");
        }
    }
    let job = site.job(1).await;
    let described = &document["components"]["schemas"]["Job"]["properties"];
    for field in job.as_object().expect("an object").keys() {
        assert!(described[field].is_object(), "{field} is not described");
    }
}

#[tokio::test]
async fn figures_and_pages_are_there() {
    let site = Site::start().await;
    let _worker = Worker::willing(&site.handle).await;
    site.submit(json!({})).await;
    site.wait_for(1, "done").await;
    let metrics = site.get("/metrics").await.text().await.expect("a text");
    for line in [
        "equilux_workers 1",
        "equilux_jobs{state=\"done\"} 1",
        "equilux_units_committed_total 6",
        "equilux_jobs_total 1",
    ] {
        assert!(metrics.lines().any(|found| found == line), "{line} is missing in {metrics}");
    }
    assert_eq!(site.get("/healthz").await.text().await.expect("a text"), "ok\n");
    let page = site.get("/").await;
    assert!(page.headers()["content-security-policy"].to_str().expect("text").contains("'none'"));
    let page = page.text().await.expect("a text");
    assert!(page.contains("/api/v1") && !page.contains("http://"), "it loads nothing from afar");
}
