//! Jobs from submission to image.

use std::io::Write;
use std::time::Duration;

use reqwest::StatusCode;
use serde_json::{Value, json};

use crate::site::{PATIENCE, SCENE, Site, TRIANGLE, json_of};
use crate::worker::Worker;

fn tar(files: &[(&str, &str)]) -> Vec<u8> {
    let mut builder = tar::Builder::new(Vec::new());
    for (name, text) in files {
        let mut header = tar::Header::new_ustar();
        header.set_size(text.len() as u64);
        header.set_mode(0o644);
        builder.append_data(&mut header, name, text.as_bytes()).expect("memory");
    }
    builder.into_inner().expect("memory")
}

fn tar_gz(files: &[(&str, &str)]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(&tar(files)).expect("memory");
    encoder.finish().expect("memory")
}

fn zip(files: &[(&str, &str)]) -> Vec<u8> {
    let mut writer = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for (name, text) in files {
        writer.start_file(*name, zip::write::SimpleFileOptions::default()).expect("memory");
        writer.write_all(text.as_bytes()).expect("memory");
    }
    writer.finish().expect("memory").into_inner()
}

#[tokio::test]
async fn a_job_goes_from_submission_to_image() {
    let site = Site::start().await;
    let body = json!({ "scene": "scene.json", "spp": 2, "seed": 7, "crop": [0, 0, 20, 20] });
    let answer = site.post(&body).await;
    assert_eq!(answer.status(), StatusCode::CREATED);
    assert_eq!(answer.headers()["location"], "/api/v1/jobs/1");
    let job = json_of(answer).await;
    assert_eq!(job["state"], "queued");
    assert_eq!(job["progress"], 0.0);
    assert_eq!(job["remaining_s"], Value::Null);
    assert_eq!(job["settings"]["crop"], json!([0, 0, 20, 20]));
    assert_eq!(job["settings"]["width"], 40);

    let _worker = Worker::willing(&site.handle).await;
    let job = site.wait_for(1, "done").await;
    assert_eq!(job["progress"], 1.0);
    assert_eq!(job["remaining_s"], 0.0);
    assert_eq!(job["units"], 4);
    assert_eq!(site.image(1, "image.exr").await, site.expected_exr(1, 4));
    assert!(site.image(1, "image.png").await.starts_with(b"\x89PNG"));
    assert_eq!(json_of(site.get("/api/v1/jobs").await).await, json!([job]));
    site.stop().await;
}

#[tokio::test]
async fn the_image_is_kept_on_disk_and_not_in_memory() {
    let site = Site::start().await;
    let _worker = Worker::willing(&site.handle).await;
    let id = site.submit(json!({})).await;
    site.wait_for(id, "done").await;
    let stored = async {
        while site.handle.film(equilux_common::ids::JobId(id)).is_some() {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    };
    tokio::time::timeout(PATIENCE, stored).await.expect("stored in time");
    let path = site.data.path().join("jobs/1/image.exr");
    assert_eq!(std::fs::read(path).expect("a file"), site.expected_exr(id, 6));
    assert_eq!(site.image(id, "image.exr").await, site.expected_exr(id, 6));
    let names = std::fs::read_dir(site.data.path().join("jobs/1")).expect("a directory");
    assert_eq!(names.count(), 2, "nothing but the two images is left behind");
}

#[tokio::test]
async fn archives_of_all_formats_give_the_image_of_the_served_scene() {
    let site = Site::start().await;
    let _worker = Worker::willing(&site.handle).await;
    let files = [("room/scene.json", SCENE), ("room/triangle.obj", TRIANGLE)];
    for archive in [zip(&files), tar(&files), tar_gz(&files)] {
        let answer = site.upload(archive, &[("spp", "4"), ("name", "a room")]).await;
        assert_eq!(answer.status(), StatusCode::CREATED, "{}", answer.text().await.expect("text"));
        let job = json_of(answer).await;
        assert_eq!(job["name"], "a room");
        let id = job["id"].as_u64().expect("a number");
        site.wait_for(id, "done").await;
        assert_eq!(site.image(id, "image.exr").await, site.expected_exr(id, 6));
    }
    let answer = site.upload(tar(&files), &[("entry", "room/scene.json")]).await;
    assert_eq!(json_of(answer).await["name"], "room");
}

#[tokio::test]
async fn the_image_can_be_seen_while_it_is_rendered() {
    let site = Site::start().await;
    let worker = Worker::start(&site.handle, 2).await;
    let id = site.submit(json!({})).await;
    let seen = async {
        while site.job(id).await["units_committed"] != 2 {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    };
    tokio::time::timeout(PATIENCE, seen).await.expect("two units in time");
    let job = site.job(id).await;
    assert_eq!(job["state"], "rendering");
    assert!((job["progress"].as_f64().expect("a number") - 2.0 / 6.0).abs() < 1e-9);
    assert!(job["remaining_s"].is_f64());
    assert_eq!(site.image(id, "image.exr").await, site.expected_exr(id, 2));
    worker.permits.add_permits(4);
    site.wait_for(id, "done").await;
    assert_eq!(site.image(id, "image.exr").await, site.expected_exr(id, 6));
}

#[tokio::test]
async fn a_cancelled_job_keeps_what_it_has_and_makes_room_for_the_next() {
    let site = Site::start().await;
    let worker = Worker::start(&site.handle, 3).await;
    let first = site.submit(json!({})).await;
    let second = site.submit(json!({})).await;
    let waiting = site.submit(json!({})).await;
    let seen = async {
        while site.job(first).await["units_committed"] != 3 {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    };
    tokio::time::timeout(PATIENCE, seen).await.expect("three units in time");
    for _again in 0..2 {
        let answer = site.delete(&format!("/api/v1/jobs/{first}")).await;
        assert_eq!(answer.status(), StatusCode::OK);
        assert_eq!(json_of(answer).await["state"], "cancelled");
    }
    let answer = site.delete(&format!("/api/v1/jobs/{waiting}")).await;
    assert_eq!(json_of(answer).await["state"], "cancelled");
    assert_eq!(site.image(first, "image.exr").await, site.expected_exr(first, 3));
    worker.permits.add_permits(100);
    site.wait_for(second, "done").await;
    assert_eq!(site.image(second, "image.exr").await, site.expected_exr(second, 6));
    let done = json_of(site.delete(&format!("/api/v1/jobs/{second}")).await).await;
    assert_eq!(done["state"], "done", "a job that is done cannot be cancelled any more");
}

#[tokio::test]
async fn a_failed_job_says_why_and_the_next_one_runs() {
    let site = Site::start().await;
    let _worker = Worker::willing(&site.handle).await;
    let failing = site.submit(json!({ "spp": 10 })).await;
    let next = site.submit(json!({})).await;
    let job = site.wait_for(failing, "failed").await;
    assert!(job["error"].as_str().expect("a reason").contains("the moon is in the way"));
    site.wait_for(next, "done").await;
    assert_eq!(site.image(next, "image.exr").await, site.expected_exr(next, 6));
}

#[tokio::test]
async fn events_tell_a_job_to_its_end() {
    let site = Site::start().await;
    let id = site.submit(json!({})).await;
    let mut stream = site.get(&format!("/api/v1/jobs/{id}/events")).await;
    assert_eq!(stream.headers()["content-type"], "text/event-stream");
    let first = stream.chunk().await.expect("a chunk").expect("an event");
    assert!(String::from_utf8_lossy(&first).contains("\"queued\""));
    let _worker = Worker::willing(&site.handle).await;
    let mut text = String::new();
    while let Some(chunk) = stream.chunk().await.expect("a chunk") {
        text.push_str(&String::from_utf8_lossy(&chunk));
    }
    let last = text.trim_end().rsplit("\n\n").next().expect("an event");
    assert!(last.starts_with("event: job\ndata: "), "{last}");
    let job: Value = serde_json::from_str(&last["event: job\ndata: ".len()..]).expect("JSON");
    assert_eq!(job["state"], "done");
    assert_eq!(job["id"], id);
}

#[tokio::test]
async fn numbers_go_on_after_a_restart() {
    let site = Site::start().await;
    let _worker = Worker::willing(&site.handle).await;
    let id = site.submit(json!({})).await;
    site.wait_for(id, "done").await;
    let path = site.data.path().to_owned();
    let kept = tempfile::tempdir().expect("a temporary directory");
    let stored = path.join("jobs/1/image.png");
    while !stored.exists() {
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    std::fs::create_dir_all(kept.path().join("jobs/1")).expect("room on the disk");
    std::fs::copy(&stored, kept.path().join("jobs/1/image.png")).expect("room on the disk");
    site.stop().await;
    let again = Site::start_with(|options| options.data = kept.path().into()).await;
    assert_eq!(again.submit(json!({})).await, 2);
}
