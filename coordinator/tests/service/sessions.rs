//! Workers over gRPC.

use equilux_common::message::{ToCoordinator, ToWorker};
use equilux_common::spread::{Pieces, Tree};
use equilux_proto::hello::Hello;
use equilux_proto::pack::{self, PackRequest};
use equilux_proto::session::{FromCoordinator, FromWorker};
use equilux_proto::v1::coordinator_client::CoordinatorClient;
use equilux_proto::v1::{self, CoordinatorToWorker, WorkerToCoordinator};
use serde_json::json;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::transport::Channel;
use tonic::{Status, Streaming};

use crate::site::Site;
use crate::worker;

pub(crate) struct Remote {
    pub(crate) client: CoordinatorClient<Channel>,
    pub(crate) says: mpsc::Sender<WorkerToCoordinator>,
    pub(crate) hears: Streaming<CoordinatorToWorker>,
}

pub(crate) fn hello() -> WorkerToCoordinator {
    let address = "127.0.0.1:1".into();
    FromWorker::Hello(Hello {
        name: worker::new_name(),
        address,
        threads: 4,
        speed: 1000,
        memory: None,
    })
    .into()
}

impl Remote {
    /// Opens a session that begins with this message.
    pub(crate) async fn open(site: &Site, first: WorkerToCoordinator) -> Result<Self, Status> {
        let mut client =
            CoordinatorClient::connect(format!("http://{}", site.grpc)).await.expect("a listener");
        let (says, spoken) = mpsc::channel(8);
        says.send(first).await.expect("room");
        let hears = client.session(ReceiverStream::new(spoken)).await?.into_inner();
        Ok(Self { client, says, hears })
    }

    pub(crate) async fn hear(&mut self) -> Result<FromCoordinator, Status> {
        let wire = self.hears.message().await?.ok_or_else(|| Status::ok("it ended"))?;
        Ok(FromCoordinator::try_from(wire).expect("a message that passes the checks"))
    }

    pub(crate) async fn say(&self, message: ToCoordinator) {
        self.says.send(FromWorker::Said(message).into()).await.expect("an open session");
    }

    /// The greeting's answer, and the start of the job.
    async fn hear_start(&mut self) -> Box<equilux_common::message::JobStart> {
        loop {
            if let FromCoordinator::Said(ToWorker::JobStarted(start)) =
                self.hear().await.expect("told")
            {
                return start;
            }
        }
    }
}

#[tokio::test]
async fn a_worker_at_the_end_of_a_socket_renders_a_job() {
    let site = Site::start().await;
    let mut remote = Remote::open(&site, hello()).await.expect("let in");
    let FromCoordinator::Welcome(welcome) = remote.hear().await.expect("a greeting") else {
        panic!("the greeting comes first");
    };
    assert_eq!(site.handle.workers()[0].worker, welcome.worker);
    let id = site.submit(json!({})).await;
    let start = remote.hear_start().await;
    for message in worker::answers(&start) {
        remote.say(message).await;
    }
    site.wait_for(id, "done").await;
    assert_eq!(site.image(id, "image.exr").await, site.expected_exr(id, 6));
}

#[tokio::test]
async fn the_pack_of_a_job_is_sent_and_only_that() {
    let site = Site::start().await;
    let mut remote = Remote::open(&site, hello()).await.expect("let in");
    site.submit(json!({})).await;
    let scene = remote.hear_start().await.spec.scene;
    let request = |hash, tree, skip| v1::PackRequest::from(PackRequest { hash, tree, skip });
    let pieces = Pieces::of(scene.pack_bytes);
    let mut bytes = vec![0; scene.pack_bytes as usize];
    for tree in Tree::ALL {
        let first = remote.client.fetch_pack(request(scene.hash, tree, 0)).await.expect("known");
        let mut chunks = first.into_inner();
        for range in (0..).map_while(|index| pieces.range(tree, index)) {
            let chunk = chunks.message().await.expect("a chunk").expect("as many as there are");
            let piece = pack::piece(chunk).expect("within the limits").expect("not empty");
            bytes[range.start as usize..range.end as usize].copy_from_slice(&piece);
        }
        assert_eq!(chunks.message().await.expect("an end"), None);
        let all = request(scene.hash, tree, pieces.count(tree));
        let mut chunks = remote.client.fetch_pack(all).await.expect("known").into_inner();
        assert_eq!(chunks.message().await.expect("an end"), None);
    }
    assert_eq!(*blake3::hash(&bytes).as_bytes(), scene.hash);
    let other = remote.client.fetch_pack(request([7; 32], Tree::Even, 0)).await;
    assert_eq!(other.expect_err("unknown").code(), tonic::Code::NotFound);
    let good = request(scene.hash, Tree::Odd, 0);
    let short = v1::PackRequest { hash: vec![1, 2, 3], ..good };
    let status = remote.client.fetch_pack(short).await.expect_err("no hash");
    assert!(status.message().contains("hash"), "{status}");
}

#[tokio::test]
async fn a_worker_is_lost_when_its_session_ends() {
    let site = Site::start().await;
    let mut remote = Remote::open(&site, hello()).await.expect("let in");
    remote.hear().await.expect("a greeting");
    assert_eq!(site.handle.workers().len(), 1);
    drop(remote);
    let gone = async {
        while !site.handle.workers().is_empty() {
            tokio::time::sleep(std::time::Duration::from_millis(5)).await;
        }
    };
    tokio::time::timeout(crate::site::PATIENCE, gone).await.expect("lost in time");
}

#[tokio::test]
async fn sessions_and_streams_end_when_the_coordinator_stops() {
    let site = Site::start().await;
    let mut remote = Remote::open(&site, hello()).await.expect("let in");
    remote.hear().await.expect("a greeting");
    let id = site.submit(json!({ "workers_min": 2 })).await;
    let mut events = site.get(&format!("/api/v1/jobs/{id}/events")).await;
    events.chunk().await.expect("a chunk").expect("an event");
    let begun = tokio::time::Instant::now();
    site.stop().await;
    assert!(begun.elapsed() < std::time::Duration::from_secs(4), "nobody had to be cut off");
    let status = loop {
        if let Err(status) = remote.hear().await {
            break status;
        }
    };
    assert_eq!(status.code(), tonic::Code::Unavailable);
}
