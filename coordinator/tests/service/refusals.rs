//! Bad input over REST: a problem document that says what is wrong, and a service that goes on.

use std::io::Write;

use reqwest::{Method, header};
use serde_json::json;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use crate::site::{SCENE, Site, TRIANGLE, problem};
use crate::worker::Worker;

#[tokio::test]
async fn bad_submissions_are_refused_by_field() {
    let site = Site::start().await;
    let scene = |name: &str| json!({ "scene": name });
    let with =
        |field: &str, value: serde_json::Value| json!({ "scene": "scene.json", field: value });
    std::fs::create_dir(site.scenes.path().join("folder")).expect("room on the disk");
    let bad = "{ \"equilux\": 1, \"camera\": ";
    std::fs::write(site.scenes.path().join("bad.json"), bad).expect("room on the disk");
    let outside = format!("{}/lock", site.data.path().display());
    for (body, status, part) in [
        (scene("absent.json"), 404, "absent.json"),
        (scene("folder"), 400, "folder"),
        (scene("../../etc/passwd"), 400, "outside"),
        (scene(&outside), 400, "outside"),
        (scene("bad.json"), 422, "bad.json"),
        (json!({}), 400, "scene: missing"),
        (json!({ "scene": 3 }), 400, "scene: not a text"),
        (json!([]), 400, "not a JSON object"),
        (with("spp", json!(-1)), 400, "spp: -1"),
        (with("spp", json!(0)), 400, "spp"),
        (with("width", json!(0)), 400, "width"),
        (with("width", json!("wide")), 400, "width: \"wide\""),
        (with("max_depth", json!(0)), 400, "max_depth"),
        (with("crop", json!([0, 0, 4000, 10])), 400, "crop"),
        (with("heigth", json!(3)), 400, "did you mean `height`?"),
        (with("camera", json!("nobody")), 400, "no camera \"nobody\""),
        (with("balance", json!("magic")), 400, "balance: \"magic\""),
        (with("workers_min", json!(0)), 400, "workers_min"),
        (with("name", json!("x".repeat(300))), 400, "name: 300 bytes"),
        (
            json!({ "scene": "scene.json", "width": 1_000_000_000, "height": 1_000_000_000 }),
            400,
            "width",
        ),
        (json!({ "scene": "scene.json", "width": 65536, "height": 65536 }), 400, "pixels"),
    ] {
        let detail = problem(site.post(&body).await, status).await;
        assert!(detail.contains(part), "{body}: {detail}");
    }
    let _worker = Worker::willing(&site.handle).await;
    let id = site.submit(json!({})).await;
    assert_eq!(id, 1, "what was refused has no number");
    site.wait_for(id, "done").await;
}

#[cfg(unix)]
#[tokio::test]
async fn links_do_not_lead_out_of_the_served_root() {
    let site = Site::start().await;
    let secret = site.data.path().join("secret.json");
    std::fs::write(&secret, SCENE).expect("room on the disk");
    let link = site.scenes.path().join("link.json");
    std::os::unix::fs::symlink(secret, link).expect("room on the disk");
    let detail = problem(site.post(&json!({ "scene": "link.json" })).await, 400).await;
    assert!(detail.contains("outside"), "{detail}");
}

#[tokio::test]
async fn without_a_served_root_one_is_told_to_upload() {
    let site = Site::start_with(|options| options.rest.scenes = None).await;
    let detail = problem(site.post(&json!({ "scene": "scene.json" })).await, 400).await;
    assert!(detail.contains("upload") && detail.contains("--scenes"), "{detail}");
}

#[tokio::test]
async fn bad_bodies_are_refused() {
    let site = Site::start().await;
    let send = async |media_type: Option<&str>, body: &str| {
        let mut request = site.request(Method::POST, "/api/v1/jobs").body(body.to_owned());
        if let Some(media_type) = media_type {
            request = request.header(header::CONTENT_TYPE, media_type);
        }
        request.send().await.expect("an answer")
    };
    let json_type = Some("application/json");
    for (media_type, body, status, part) in [
        (json_type, "{", 400, "not JSON"),
        (json_type, "{\"scene\": \"a\"} x", 400, "not JSON"),
        (json_type, "\u{0}", 400, "not JSON"),
        (None, "{}", 415, "content-type"),
        (Some("text/plain"), "{}", 415, "content-type"),
        (Some("multipart/form-data"), "x", 400, "boundary"),
        (Some("multipart/form-data; boundary=b"), "x", 400, "form"),
        (Some("multipart/form-data; boundary=b"), "--b--\r\n", 400, "scene: missing"),
    ] {
        let detail = problem(send(media_type, body).await, status).await;
        assert!(detail.contains(part), "{media_type:?} {body}: {detail}");
    }
    let nested = "[".repeat(60_000);
    problem(send(json_type, &nested).await, 400).await;
}

#[tokio::test]
async fn bad_archives_are_refused() {
    let site = Site::start_with(|options| {
        options.rest.archive.unpacked_bytes_max = 100_000;
    })
    .await;
    let zip = |files: &[(&str, &[u8])]| {
        let mut writer = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        for (name, content) in files {
            writer.start_file(*name, zip::write::SimpleFileOptions::default()).expect("memory");
            writer.write_all(content).expect("memory");
        }
        writer.finish().expect("memory").into_inner()
    };
    let scene = SCENE.as_bytes();
    let whole = zip(&[("scene.json", scene), ("triangle.obj", TRIANGLE.as_bytes())]);
    for (archive, status, part) in [
        (zip(&[("../scene.json", scene)]), 422, "../scene.json"),
        (zip(&[("/scene.json", scene)]), 422, "absolute"),
        (zip(&[("bomb", &[0; 200_000])]), 422, "unpacks to more than 100000 bytes"),
        (whole[..whole.len() / 2].to_vec(), 422, "truncated"),
        (b"Rar!\x1a\x07".to_vec(), 415, "format is unknown"),
        (Vec::new(), 415, "format is unknown"),
        (zip(&[]), 422, "no file"),
        (zip(&[("readme.txt", b"hello")]), 422, "scene"),
        (zip(&[("scene.json", scene)]), 422, "triangle.obj"),
        (zip(&[("scene.json", b"{ \"equilux\": 1, \"camrea\": {} }")]), 422, "camera"),
    ] {
        let detail = problem(site.upload(archive, &[]).await, status).await;
        assert!(detail.contains(part), "{part}: {detail}");
    }
    for (field, text, status, part) in [
        ("spp", "many", 400, "spp: \"many\""),
        ("sp", "1", 400, "did you mean `spp`?"),
        ("entry", "absent.json", 404, "absent.json"),
        ("entry", "../scene.json", 400, "outside"),
    ] {
        let detail = problem(site.upload(whole.clone(), &[(field, text)]).await, status).await;
        assert!(detail.contains(part), "{part}: {detail}");
    }
    assert!(site.handle.jobs().is_empty());
    assert_eq!(site.upload(whole, &[]).await.status(), 201);
}

#[tokio::test]
async fn bodies_over_the_limit_are_refused() {
    let site = Site::start_with(|options| options.rest.upload_bytes_max = 10_000).await;
    let detail = problem(site.upload(vec![7; 50_000], &[]).await, 413).await;
    assert!(detail.contains("10000"), "{detail}");
    let chunks = (0..20).map(|_| Ok::<_, std::io::Error>(vec![b'x'; 1000]));
    let undeclared = reqwest::Body::wrap_stream(futures::stream::iter(
        std::iter::once(Ok(
            b"--b\r\nContent-Disposition: form-data; name=\"scene\"\r\n\r\n".to_vec()
        ))
        .chain(chunks),
    ));
    let request = site.request(Method::POST, "/api/v1/jobs");
    let request = request.header(header::CONTENT_TYPE, "multipart/form-data; boundary=b");
    problem(request.body(undeclared).send().await.expect("an answer"), 413).await;
    let long = json!({ "scene": "x".repeat(100_000) });
    let site = Site::start().await;
    problem(site.post(&long).await, 413).await;
}

#[tokio::test]
async fn who_sends_all_before_reading_still_hears_what_was_wrong() {
    let site = Site::start_with(|options| options.rest.upload_bytes_max = 40_000_000).await;
    let address = site.base().trim_start_matches("http://").to_owned();
    let bad_field = b"--b\r\nContent-Disposition: form-data; name=\"sp\"\r\n\r\n1\r\n";
    let head = b"--b\r\nContent-Disposition: form-data; name=\"scene\"\r\n\r\n";
    for (begin, bytes, origin, status) in [
        ([&bad_field[..], head].concat(), 30_000_000, "http://localhost", "403 Forbidden"),
        ([&bad_field[..], head].concat(), 30_000_000, site.base(), "400 Bad Request"),
        (head.to_vec(), 50_000_000, site.base(), "413 Payload Too Large"),
    ] {
        let body = [begin, vec![0; bytes]].concat();
        let mut socket = TcpStream::connect(&address).await.expect("a listener");
        let head = format!(
            "POST /api/v1/jobs HTTP/1.1\r\nhost: {address}\r\norigin: {origin}\r\n\
             content-length: {}\r\n\
             content-type: multipart/form-data; boundary=b\r\n\r\n",
            body.len()
        );
        socket.write_all(head.as_bytes()).await.expect("an open socket");
        socket.write_all(&body).await.expect("all of the body is taken");
        let mut answer = vec![0; 100];
        socket.read_exact(&mut answer).await.expect("an answer");
        let answer = String::from_utf8_lossy(&answer);
        assert!(answer.starts_with(&format!("HTTP/1.1 {status}")), "{answer}");
    }
}

#[tokio::test]
async fn wrong_paths_and_methods_get_problem_documents() {
    let site = Site::start().await;
    for path in [
        "/nowhere",
        "/api/v1",
        "/api/v1/jobs/77",
        "/api/v1/jobs/x",
        "/api/v1/jobs/-1",
        "/api/v1/jobs/99999999999999999999999",
        "/api/v1/jobs/77/image.exr",
        "/api/v1/jobs/77/image.jpg",
        "/api/v1/jobs/77/events",
    ] {
        problem(site.get(path).await, 404).await;
    }
    problem(site.delete("/api/v1/jobs/77").await, 404).await;
    for (method, path) in [
        (Method::PUT, "/api/v1/jobs"),
        (Method::POST, "/api/v1/jobs/1"),
        (Method::DELETE, "/api/v1/workers"),
        (Method::POST, "/healthz"),
    ] {
        let answer = site.request(method, path).send().await.expect("an answer");
        assert!(answer.headers().contains_key(header::ALLOW), "{path}");
        problem(answer, 405).await;
    }
}
