//! Links over real sockets on loopback: order, loss, and peers that cannot be trusted.

use std::net::TcpListener;
use std::sync::Mutex;
use std::time::Duration;

use equilux_common::bundle::{Bundle, Share, Stage};
use equilux_common::credit::Credit;
use equilux_common::ids::{Attempt, PartitionId, UnitId};
use equilux_common::ray::{NO_PRIMITIVE, Ray};
use equilux_common::work::Work;
use equilux_proto::v1::peer_client::PeerClient;
use equilux_proto::v1::{peer_frame, peer_said};
use tokio::io::AsyncWriteExt;
use tokio::net::TcpStream;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Code, Status, Streaming};

use super::*;
use crate::dial;
use crate::driver::inputs;
use crate::testing::{no_packs, soon};

/// One end of links.
struct End {
    peers: Peers,
    heard: mpsc::Receiver<Input>,
    address: PeerAddress,
    lines: Arc<Mutex<Vec<String>>>,
    _entrance: Entrance,
}

fn hello(worker: u32, incarnation: u64) -> PeerHello {
    PeerHello { worker: WorkerId(worker), incarnation: Incarnation(incarnation) }
}

fn end(worker: u32, incarnation: u64) -> End {
    let own = hello(worker, incarnation);
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let door = Arc::new(Door::new());
    let entrance = Entrance::open(listener, own, &door, no_packs()).unwrap();
    let lines: Arc<Mutex<Vec<String>>> = Arc::default();
    let kept = Arc::clone(&lines);
    let log = Log::new(move |line| kept.lock().unwrap().push(line.to_owned()));
    let (sender, heard) = inputs();
    let peers = Peers::new(own, Ways { door, inputs: sender, log });
    let address =
        PeerAddress { worker: own.worker, incarnation: own.incarnation, address: address.into() };
    End { peers, heard, address, lines, _entrance: entrance }
}

impl End {
    /// The next event for the core.
    async fn event(&mut self) -> Event {
        loop {
            let Some(Input::Peer(heard)) = soon(self.heard.recv()).await else {
                panic!("peers only");
            };
            if let Some(event) = self.peers.hear(heard) {
                return event;
            }
        }
    }

    async fn is_linked_to(&mut self, other: &PeerAddress) {
        let event = self.event().await;
        let PeerAddress { worker, incarnation, .. } = *other;
        let Event::PeerLinked { peer, incarnation: life } = event else { panic!("{event:?}") };
        assert_eq!((peer, life), (worker, incarnation));
    }

    async fn loses(&mut self, other: &PeerAddress) {
        let event = self.event().await;
        let Event::PeerLost { peer, .. } = event else { panic!("{event:?}") };
        assert_eq!(peer, other.worker);
    }

    fn tell(&mut self, other: &PeerAddress, round: u32) -> Result<(), LinkGone> {
        let message = PeerMessage::LoadAsked { round };
        self.peers.tell(other.worker, other.incarnation, JobId(1), message)
    }

    async fn hears(&mut self, wanted: u32) {
        let event = self.event().await;
        let Event::PeerSaid { message, bytes, .. } = event else { panic!("{event:?}") };
        assert_eq!(message, PeerMessage::LoadAsked { round: wanted });
        assert!(bytes > 0);
    }

    fn has_said(&self, part: &str) -> bool {
        self.lines.lock().unwrap().iter().any(|line| line.contains(part))
    }
}

async fn linked(mut low: End, mut high: End) -> (End, End) {
    low.peers.keep(std::slice::from_ref(&high.address));
    high.peers.keep(std::slice::from_ref(&low.address));
    low.is_linked_to(&high.address).await;
    high.is_linked_to(&low.address).await;
    (low, high)
}

#[tokio::test]
async fn messages_arrive_in_order_both_ways_and_are_counted() {
    let (mut low, mut high) = linked(end(1, 7), end(2, 9)).await;
    let (low_address, high_address) = (low.address.clone(), high.address.clone());
    for round in 1..1000 {
        low.tell(&high_address, round).unwrap();
        high.tell(&low_address, round).unwrap();
    }
    for round in 1..1000 {
        low.hears(round).await;
        high.hears(round).await;
    }
    assert_eq!(low.peers.bytes_out(JobId(1)), high.peers.bytes_out(JobId(1)));
    assert!(low.peers.bytes_out(JobId(1)) > 1000);
    low.peers.forget(JobId(1));
    assert_eq!(low.peers.bytes_out(JobId(1)), 0);
    // Another life of the peer is told nothing.
    let other_life = PeerAddress { incarnation: Incarnation(8), ..high_address.clone() };
    low.tell(&other_life, 5).unwrap();
    low.tell(&high_address, 6).unwrap();
    high.hears(6).await;
}

#[tokio::test]
async fn links_that_are_kept_stay_and_others_go() {
    let (mut low, mut high) = linked(end(1, 1), end(2, 1)).await;
    let (low_address, high_address) = (low.address.clone(), high.address.clone());
    low.peers.keep(&[low_address.clone(), high_address.clone()]);
    low.tell(&high_address, 3).unwrap();
    high.hears(3).await;
    low.peers.keep(&[]);
    high.loses(&low_address).await;
    low.peers.keep(std::slice::from_ref(&high_address));
    low.is_linked_to(&high_address).await;
    high.is_linked_to(&low_address).await;
    low.tell(&high_address, 4).unwrap();
    high.hears(4).await;
}

#[tokio::test]
async fn a_peer_that_leaves_is_lost_and_its_next_life_is_linked() {
    for low_leaves in [true, false] {
        let (low, high) = linked(end(1, 1), end(2, 1)).await;
        let (mut stays, leaves) = if low_leaves { (high, low) } else { (low, high) };
        let gone = leaves.address.clone();
        drop(leaves);
        stays.loses(&gone).await;
        let mut next = end(gone.worker.0, 2);
        stays.peers.keep(std::slice::from_ref(&next.address));
        next.peers.keep(std::slice::from_ref(&stays.address));
        stays.is_linked_to(&next.address.clone()).await;
        next.is_linked_to(&stays.address).await;
    }
}

#[tokio::test]
async fn a_peer_that_does_not_read_is_given_up_and_memory_is_bounded() {
    let mut high = end(2, 1);
    let impostor = PeerAddress { address: "127.0.0.1:1".into(), ..end(1, 1).address };
    high.peers.keep(std::slice::from_ref(&impostor));
    // It greets, and never reads what comes back.
    let (_said, _answers) = knock(&high.address, frame_of(hello(1, 1))).await.unwrap();
    high.is_linked_to(&impostor).await;
    let told = (0..).take_while(|_| {
        let (share, rays) = (share(), vec![ray(); 64]);
        let bundle =
            Bundle { stage: Stage::Shade, partition: PartitionId(0), shares: vec![share], rays };
        let message = PeerMessage::Given { work: Work::Rays(bundle) };
        high.peers.tell(impostor.worker, impostor.incarnation, JobId(1), message).is_ok()
    });
    assert!(told.count() <= 2 * LINK_FRAMES_MAX);
}

fn share() -> Share {
    Share { unit: UnitId(0), attempt: Attempt(0), credit: Credit::whole() }
}

fn ray() -> Ray {
    Ray {
        origin: [0.0; 3],
        direction: [0.0, 0.0, 1.0],
        throughput: [1.0; 3],
        distance: f32::INFINITY,
        hit_primitive: NO_PRIMITIVE,
        hit_partition: 0,
        pixel: 0,
        sample_index: 0,
        branch: 0,
        pdf: 0.0,
        depth: 0,
        share: 0,
        flags: 0,
    }
}

fn frame_of(hello: PeerHello) -> v1::PeerFrame {
    PeerFrame::Hello(hello).into()
}

type Link = (mpsc::Sender<v1::PeerFrame>, Streaming<v1::PeerFrame>);

/// Opens a stream as no honest peer would; gives it once it is answered.
async fn knock(at: &PeerAddress, first: v1::PeerFrame) -> Result<Link, Status> {
    let channel = dial::connect(&at.address).await.map_err(Status::unavailable)?;
    let (said, frames) = mpsc::channel(16);
    said.send(first).await.unwrap();
    let answers = soon(PeerClient::new(channel).exchange(ReceiverStream::new(frames))).await?;
    Ok((said, answers.into_inner()))
}

#[tokio::test]
async fn strangers_are_sent_away_with_a_reason() {
    let mut high = end(2, 1);
    let expected = PeerAddress { address: "127.0.0.1:1".into(), ..end(1, 5).address };
    high.peers.keep(&[expected]);
    let mut other_version = v1::PeerHello::from(hello(1, 5));
    other_version.versions = Some(v1::Versions { program: "9.8.7".into(), protocol: 99 });
    let other_version = v1::PeerFrame { frame: Some(peer_frame::Frame::Hello(other_version)) };
    let speaks_first =
        PeerFrame::Said { job: JobId(1), message: PeerMessage::LoadAsked { round: 1 } };
    for (first, code, part) in [
        (other_version, Code::FailedPrecondition, "9.8.7"),
        (frame_of(hello(3, 1)), Code::InvalidArgument, "opens no link"),
        (frame_of(hello(2, 1)), Code::InvalidArgument, "opens no link"),
        (speaks_first.into(), Code::InvalidArgument, "must come first"),
        (v1::PeerFrame { frame: None }, Code::InvalidArgument, "empty"),
    ] {
        let refusal = knock(&high.address, first).await.expect_err("it is a stranger");
        assert_eq!(refusal.code(), code, "{refusal}");
        assert!(refusal.message().contains(part), "{refusal}");
    }
}

#[tokio::test]
async fn another_life_is_let_in_only_when_it_is_expected() {
    let mut high = end(2, 1);
    let expected = |incarnation| PeerAddress {
        incarnation: Incarnation(incarnation),
        address: "127.0.0.1:1".into(),
        ..high_peer()
    };
    high.peers.keep(&[expected(5)]);
    let address = high.address.clone();
    let early = tokio::spawn(async move { knock(&address, frame_of(hello(1, 6))).await });
    tokio::time::sleep(Duration::from_millis(200)).await;
    assert!(!early.is_finished() && high.heard.is_empty(), "it waits at the door");
    high.peers.keep(&[expected(6)]);
    let link = early.await.unwrap().expect("it is expected by now");
    high.is_linked_to(&expected(6)).await;
    drop(link);
    high.loses(&expected(6)).await;
}

fn high_peer() -> PeerAddress {
    PeerAddress { worker: WorkerId(1), incarnation: Incarnation(0), address: "".into() }
}

#[tokio::test]
async fn a_peer_that_speaks_rubbish_is_left_and_may_come_again() {
    let mut high = end(2, 1);
    let peer = PeerAddress { address: "127.0.0.1:1".into(), ..end(1, 1).address };
    high.peers.keep(std::slice::from_ref(&peer));
    let spoilt = |spoil: fn(&mut Ray)| {
        let mut bad = ray();
        spoil(&mut bad);
        let (stage, partition) = (Stage::Intersect, PartitionId(0));
        let bundle = Bundle { stage, partition, shares: vec![share()], rays: vec![bad] };
        let bundle = equilux_proto::bundle::encode(&bundle);
        let work = Some(v1::work::Work::Bundle(bundle));
        let message = Some(peer_said::Message::Given(v1::Work { work }));
        let said = v1::PeerSaid { job: 1, message };
        v1::PeerFrame { frame: Some(peer_frame::Frame::Said(said)) }
    };
    let rubbish = [
        (spoilt(|ray| ray.throughput[0] = f32::NAN), "rays[0].throughput: is not finite"),
        (spoilt(|ray| ray.share = 9), "rays[0].share: 9 is out of range"),
        (frame_of(hello(1, 1)), "greets twice"),
        (v1::PeerFrame { frame: None }, "frame: is empty"),
    ];
    for (frame, complaint) in rubbish {
        let (said, mut answers) = knock(&high.address, frame_of(hello(1, 1))).await.unwrap();
        high.is_linked_to(&peer).await;
        let good = PeerFrame::Said { job: JobId(1), message: PeerMessage::LoadAsked { round: 8 } };
        said.send(good.into()).await.unwrap();
        high.hears(8).await;
        said.send(frame).await.unwrap();
        high.loses(&peer).await;
        assert!(high.has_said(complaint), "{:?}", high.lines.lock().unwrap());
        // The greeting, then nothing more.
        assert!(soon(answers.message()).await.unwrap().is_some());
        assert!(!matches!(soon(answers.message()).await, Ok(Some(_))));
    }
}

#[tokio::test]
async fn what_is_not_even_http_harms_nobody() {
    let (mut low, mut high) = linked(end(1, 1), end(2, 1)).await;
    for rubbish in
        [&[0u8; 3000][..], b"GET / HTTP/1.1\r\n\r\n", b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\nXX"]
    {
        let mut stream = TcpStream::connect(&*high.address.address).await.unwrap();
        stream.write_all(rubbish).await.unwrap();
    }
    low.tell(&high.address, 12).unwrap();
    high.hears(12).await;
}

#[tokio::test]
async fn a_newer_stream_takes_the_place_of_an_older_one() {
    let mut high = end(2, 1);
    let peer = PeerAddress { address: "127.0.0.1:1".into(), ..end(1, 1).address };
    high.peers.keep(std::slice::from_ref(&peer));
    let older = knock(&high.address, frame_of(hello(1, 1))).await.unwrap();
    high.is_linked_to(&peer).await;
    let (_said, mut answers) = knock(&high.address, frame_of(hello(1, 1))).await.unwrap();
    high.loses(&peer).await;
    high.is_linked_to(&peer).await;
    high.tell(&peer, 77).unwrap();
    assert!(soon(answers.message()).await.unwrap().is_some(), "the greeting");
    let frame = PeerFrame::try_from(soon(answers.message()).await.unwrap().unwrap()).unwrap();
    let message = PeerMessage::LoadAsked { round: 77 };
    assert_eq!(frame, PeerFrame::Said { job: JobId(1), message });
    drop(older);
}
