//! Clients that do not keep to the protocol: they are told so, and harm nobody else.

use equilux_common::bundle::Share;
use equilux_common::credit::Credit;
use equilux_common::ids::{Attempt, JobId, UnitId};
use equilux_common::message::ToCoordinator;
use equilux_proto::session::FromWorker;
use equilux_proto::v1::{self, WorkerToCoordinator, worker_to_coordinator::Message};
use serde_json::json;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use crate::sessions::{Remote, hello};
use crate::site::Site;
use crate::worker::{self, Worker};

async fn renders_still(site: &Site) {
    let _worker = Worker::willing(&site.handle).await;
    let id = site.submit(json!({})).await;
    site.wait_for(id, "done").await;
    assert_eq!(site.image(id, "image.exr").await, site.expected_exr(id, 6));
}

/// The status that a session ends with.
async fn end_of(remote: &mut Remote) -> tonic::Status {
    let ending = async {
        loop {
            if let Err(status) = remote.hear().await {
                return status;
            }
        }
    };
    tokio::time::timeout(crate::site::PATIENCE, ending).await.expect("it ends in time")
}

#[tokio::test]
async fn another_version_is_refused_with_both_named() {
    let site = Site::start().await;
    let mut other = hello();
    let Some(Message::Hello(greeting)) = &mut other.message else { panic!("it is a greeting") };
    greeting.versions = Some(v1::Versions { program: "7.8.9".into(), protocol: 99 });
    let status = Remote::open(&site, other).await.err().expect("refused");
    assert_eq!(status.code(), tonic::Code::FailedPrecondition);
    for part in ["7.8.9", "99", equilux_proto::hello::PROGRAM_VERSION] {
        assert!(status.message().contains(part), "{status}");
    }
    assert!(site.handle.workers().is_empty());
}

#[tokio::test]
async fn bad_greetings_are_refused_by_field() {
    let site = Site::start().await;
    let ready = FromWorker::Said(ToCoordinator::Ready { job: JobId(1) }).into();
    let mut no_threads = hello();
    if let Some(Message::Hello(greeting)) = &mut no_threads.message {
        greeting.threads = 0;
    }
    let empty = WorkerToCoordinator { message: None };
    for (first, part) in [(ready, "hello"), (no_threads, "hello: threads"), (empty, "empty")] {
        let status = Remote::open(&site, first).await.err().expect("refused");
        assert_eq!(status.code(), tonic::Code::InvalidArgument);
        assert!(status.message().contains(part), "{status}");
    }
    assert!(site.handle.workers().is_empty());
    renders_still(&site).await;
}

#[tokio::test]
async fn bad_messages_end_the_session_and_name_the_field() {
    let site = Site::start().await;
    let share = v1::Share { unit: 0, attempt: 0, credit: vec![] };
    let delivered = |share, sums| {
        let delivered = v1::Delivered { job: 1, share, sums };
        WorkerToCoordinator { message: Some(Message::Delivered(delivered)) }
    };
    for (message, part) in [
        (WorkerToCoordinator { message: None }, "empty"),
        (hello(), "hello"),
        (delivered(None, vec![]), "delivered.share"),
        (delivered(Some(share), vec![1, 2, 3]), "delivered.s"),
    ] {
        let mut remote = Remote::open(&site, hello()).await.expect("let in");
        remote.says.send(message).await.expect("an open session");
        let status = end_of(&mut remote).await;
        assert_eq!(status.code(), tonic::Code::InvalidArgument);
        assert!(status.message().contains(part), "{status}");
    }
    renders_still(&site).await;
}

#[tokio::test]
async fn values_for_the_wrong_job_unit_or_tile_do_no_harm() {
    let site = Site::start().await;
    let id = site.submit(json!({ "workers_min": 2 })).await;
    let grid = worker::grid(&site.handle.job(JobId(id)).expect("a job").plan.settings);
    for (job, unit, tile_of) in [(99, 0, 0), (id, 5000, 0), (id, 0, 1), (id, 3, 3)] {
        let share = Share { unit: UnitId(unit), attempt: Attempt(0), credit: Credit::whole() };
        let sums = worker::values(&grid, tile_of);
        let remote = Remote::open(&site, hello()).await.expect("let in");
        remote.say(ToCoordinator::Ready { job: JobId(job) }).await;
        for _twice in 0..2 {
            let (share, sums) = (share.clone(), sums.clone());
            let message = ToCoordinator::Delivered { job: JobId(job), share, sums };
            // The session may have been ended by then.
            let _ended = remote.says.send(FromWorker::Said(message).into()).await;
        }
        tokio::time::sleep(std::time::Duration::from_millis(30)).await;
    }
    site.delete(&format!("/api/v1/jobs/{id}")).await;
    renders_still(&site).await;
}

#[tokio::test]
async fn rubbish_on_the_sockets_does_no_harm() {
    let site = Site::start().await;
    let http = site.base().trim_start_matches("http://").to_owned();
    let long = [b"GET /".to_vec(), vec![b'a'; 200_000], b" HTTP/1.1\r\n\r\n".to_vec()].concat();
    let preface = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\xff\xff\xff\xff\xff\xff\xff\xff".to_vec();
    for bytes in [b"\x00\x01\x02\xff\xfe rubbish\r\n\r\n".to_vec(), long, preface] {
        for address in [&http, &site.grpc] {
            let mut socket = TcpStream::connect(address).await.expect("a listener");
            // The other side may hang up in the middle.
            let _hung_up = socket.write_all(&bytes).await;
            let _hung_up = socket.shutdown().await;
            let mut answer = Vec::new();
            let reading = socket.read_to_end(&mut answer);
            let _cut = tokio::time::timeout(crate::site::PATIENCE, reading).await.expect("an end");
        }
    }
    renders_still(&site).await;
}
