//! Packs over real sockets on loopback, from parents of every kind.

use std::net::TcpListener;
use std::time::Duration;

use equilux_common::ids::{Incarnation, WorkerId};
use equilux_common::message::PeerAddress;
use equilux_common::spread::Pieces;
use equilux_proto::hello::PeerHello;
use equilux_proto::pack::{self, PackRequest};
use equilux_proto::v1;
use equilux_proto::v1::peer_server::{Peer, PeerServer};
use futures::StreamExt;
use futures::future::join_all;
use futures::stream::{self, BoxStream};
use tokio::task::JoinSet;
use tonic::transport::Server;
use tonic::transport::server::TcpIncoming;
use tonic::{Code, Request, Response, Status, Streaming};

use super::fetching::EMPTY_CHUNKS_MAX;
use super::*;
use crate::dial;
use crate::pack_cache::CACHE_BYTES_MAX;
use crate::peers::{Door, Entrance};
use crate::testing::{FakeCoordinator, Lines, Manner, chunks, content, piece_count, soon};

/// A worker, as far as packs go.
struct Member {
    packs: Packs,
    address: PeerAddress,
    directory: tempfile::TempDir,
    lines: Lines,
    _entrance: Entrance,
}

fn address(worker: u32, address: impl ToString) -> PeerAddress {
    let (worker, incarnation) = (WorkerId(worker), Incarnation(1));
    PeerAddress { worker, incarnation, address: address.to_string().into() }
}

async fn member(coordinator: &FakeCoordinator, worker: u32) -> Member {
    let channel = dial::connect(&coordinator.address).await.unwrap();
    let directory = tempfile::tempdir().unwrap();
    let lines = Lines::default();
    let cache = PackCache::open(directory.path(), CACHE_BYTES_MAX, lines.log()).unwrap();
    let packs = Packs::new(cache, CoordinatorClient::new(channel), lines.log());
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = address(worker, listener.local_addr().unwrap());
    let own = PeerHello { worker: address.worker, incarnation: address.incarnation };
    let entrance = Entrance::open(listener, own, &Door::new(), packs.passing()).unwrap();
    Member { packs, address, directory, lines, _entrance: entrance }
}

impl Member {
    async fn get(&self, from: &PackSources) -> Result<Vec<u8>, PackError> {
        soon(self.packs.pack(&scene(), from)).await.map(|bytes| bytes.to_vec())
    }

    /// The file of the pack, and that there is no other.
    fn file(&self) -> Option<std::path::PathBuf> {
        let mut files = std::fs::read_dir(self.directory.path().join("packs")).unwrap();
        let file = files.next()?.unwrap().path();
        assert!(files.next().is_none());
        Some(file)
    }
}

fn scene() -> SceneRef {
    let bytes = content();
    let hash = *blake3::hash(&bytes).as_bytes();
    SceneRef { hash, pack_bytes: bytes.len() as u64, entry: "model.obj".into() }
}

fn all() -> usize {
    piece_count(content().len())
}

fn of(tree: Tree) -> usize {
    Pieces::of(content().len() as u64).count(tree) as usize
}

const NOBODY: PackSources = [None, None];

async fn coordinator() -> FakeCoordinator {
    let coordinator = FakeCoordinator::listen("127.0.0.1:0").await;
    *coordinator.handed_out.lock().unwrap() = content();
    coordinator
}

/// What a parent does when it is asked for the pieces of a tree.
#[derive(Clone, Copy, Debug)]
enum Deed {
    /// Says nothing at all.
    IsSilent,
    /// Gives so many pieces and nothing more.
    FallsSilent(usize),
    /// Gives so many pieces, and the call breaks.
    Breaks(usize),
    /// Gives so many pieces, and says that these were all.
    Ends(usize),
    /// Says so many times that it has nothing, before it gives a piece and again after it.
    Hesitates(u32),
    /// Gives other bytes, as many as there should be.
    Lies,
    /// Gives pieces of a wrong length.
    Babbles,
    /// Gives more than there is.
    Overdoes,
}

struct FakeParent(Deed);

#[tonic::async_trait]
impl Peer for FakeParent {
    type ExchangeStream = BoxStream<'static, Result<v1::PeerFrame, Status>>;
    type PassPackStream = BoxStream<'static, Result<v1::PackChunk, Status>>;

    async fn exchange(
        &self,
        _: Request<Streaming<v1::PeerFrame>>,
    ) -> Result<Response<Self::ExchangeStream>, Status> {
        Err(Status::unimplemented("it only passes packs on"))
    }

    async fn pass_pack(
        &self,
        request: Request<v1::PackRequest>,
    ) -> Result<Response<Self::PassPackStream>, Status> {
        let PackRequest { tree, skip, .. } = request.into_inner().try_into().unwrap();
        let right: Vec<_> = chunks(&content(), tree, skip).collect();
        let first = |count: usize| stream::iter(right[..count].to_vec()).map(Ok);
        let spoil = |piece: &v1::PackChunk| pack::chunk(piece.data.iter().map(|b| !b).collect());
        let pieces = match self.0 {
            Deed::IsSilent => return std::future::pending().await,
            Deed::FallsSilent(count) => first(count).chain(stream::pending()).boxed(),
            Deed::Breaks(count) => {
                let broken = Err(Status::unavailable("it broke"));
                first(count).chain(stream::iter([broken])).boxed()
            }
            Deed::Ends(count) => first(count).boxed(),
            Deed::Hesitates(times) => {
                let nothing = || stream::iter((0..times).map(|_| Ok(pack::none_yet())));
                let rest = stream::iter(right[1..].to_vec()).map(Ok);
                nothing().chain(first(1)).chain(nothing()).chain(rest).boxed()
            }
            Deed::Lies => stream::iter(right.iter().map(spoil).map(Ok).collect::<Vec<_>>()).boxed(),
            Deed::Babbles => stream::iter([Ok(pack::chunk(vec![1; 7]))]).boxed(),
            Deed::Overdoes => {
                first(right.len()).chain(stream::iter([Ok(right[0].clone())])).boxed()
            }
        };
        Ok(Response::new(pieces))
    }
}

/// A parent that does so until this is dropped.
async fn parent(deed: Deed) -> (PeerAddress, JoinSet<()>) {
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = address(9, listener.local_addr().unwrap());
    let mut server = JoinSet::new();
    server.spawn(async move {
        let server = Server::builder().add_service(PeerServer::new(FakeParent(deed)));
        server.serve_with_incoming(TcpIncoming::from(listener)).await.unwrap();
    });
    (address, server)
}

#[tokio::test]
async fn a_pack_is_fetched_once() {
    let coordinator = coordinator().await;
    let member = member(&coordinator, 0).await;
    // Two jobs at a time on one scene, and another one later.
    let both = join_all([member.get(&NOBODY), member.get(&NOBODY)]).await;
    assert!(both.into_iter().all(|bytes| bytes.unwrap() == content()));
    assert_eq!(member.get(&NOBODY).await.unwrap(), content());
    assert_eq!(coordinator.piece_count(), all());
    assert!(member.file().is_some());
}

#[tokio::test]
async fn a_busy_coordinator_is_asked_again() {
    let coordinator = coordinator().await;
    *coordinator.busy.lock().unwrap() = 3;
    assert_eq!(member(&coordinator, 0).await.get(&NOBODY).await.unwrap(), content());
}

#[tokio::test]
async fn a_damaged_pack_is_fetched_again_and_mended() {
    let coordinator = coordinator().await;
    let member = member(&coordinator, 0).await;
    member.get(&NOBODY).await.unwrap();
    let path = member.file().unwrap();
    let mut bytes = content();
    bytes[100] ^= 1;
    let longer = [content(), vec![0]].concat();
    for (damaged, times) in [(&bytes[..], 2), (&bytes[..10], 3), (&[], 4), (&longer, 5)] {
        std::fs::write(&path, damaged).unwrap();
        assert_eq!(member.get(&NOBODY).await.unwrap(), content());
        assert_eq!(coordinator.piece_count(), times * all());
        assert_eq!(std::fs::read(&path).unwrap(), content());
    }
}

#[tokio::test]
async fn what_is_not_the_pack_is_refused_and_leaves_no_file() {
    let coordinator = coordinator().await;
    let member = member(&coordinator, 0).await;
    let mut other = content();
    other[700] ^= 1;
    for wrong in [other.clone(), other[..600_000].to_vec(), vec![7; 3 << 20], vec![]] {
        *coordinator.handed_out.lock().unwrap() = wrong;
        let refusal = member.get(&NOBODY).await.unwrap_err();
        assert!(matches!(refusal, PackError::Other(_)), "{refusal}");
        assert_eq!(member.file(), None);
    }
    let (hash, entry) = ([1; 32], String::new());
    let huge = SceneRef { hash, entry, pack_bytes: 1 << 63 };
    let refusal = member.packs.pack(&huge, &NOBODY).await.unwrap_err();
    assert!(matches!(refusal, PackError::Memory(_)), "{refusal}");
}

#[tokio::test]
async fn a_cache_that_cannot_be_written_is_done_without() {
    let coordinator = coordinator().await;
    let member = member(&coordinator, 0).await;
    std::fs::remove_dir_all(member.directory.path()).unwrap();
    assert_eq!(member.get(&NOBODY).await.unwrap(), content());
    assert!(member.lines.contain("cannot write to the cache"));
}

#[tokio::test]
async fn a_pack_reaches_everybody_and_leaves_the_coordinator_once() {
    let coordinator = coordinator().await;
    let members = join_all((0..6).map(|worker| member(&coordinator, worker))).await;
    let sources = |position| {
        let parent = |tree: Tree| tree.parent(position, members.len());
        Tree::ALL.map(|tree| parent(tree).map(|parent| members[parent].address.clone()))
    };
    let sources: Vec<PackSources> = (0..members.len()).map(sources).collect();
    let getting = members.iter().zip(&sources).map(|(member, from)| member.get(from));
    for bytes in join_all(getting).await {
        assert_eq!(bytes.unwrap(), content());
    }
    assert_eq!(coordinator.piece_count(), all());
}

#[tokio::test]
async fn who_asks_early_waits_and_who_asks_late_is_served_from_the_cache() {
    let coordinator = coordinator().await;
    let first = member(&coordinator, 0).await;
    let from = [Some(first.address.clone()), Some(first.address.clone())];
    let (early, late) = (member(&coordinator, 1).await, member(&coordinator, 2).await);
    let hears = async {
        tokio::time::sleep(Duration::from_millis(200)).await;
        first.get(&NOBODY).await
    };
    let (early, hears) = tokio::join!(early.get(&from), hears);
    assert_eq!((early.unwrap(), hears.unwrap()), (content(), content()));
    assert_eq!(late.get(&from).await.unwrap(), content());
    assert_eq!(coordinator.piece_count(), all());
}

#[tokio::test]
async fn whatever_a_parent_does_its_children_have_the_pack() {
    let (even, odd) = (of(Tree::Even), of(Tree::Odd));
    // What the coordinator has to give besides the pieces of the other tree.
    for (deed, given, complaint) in [
        (Deed::IsSilent, odd, "is silent"),
        (Deed::FallsSilent(20), odd - 20, "is silent"),
        (Deed::Breaks(0), odd, "it broke"),
        (Deed::Breaks(20), odd - 20, "it broke"),
        (Deed::Ends(20), odd - 20, "something else"),
        (Deed::Hesitates(EMPTY_CHUNKS_MAX + 1), odd, "it has had nothing for long"),
        (Deed::Lies, even + odd, "it is fetched again"),
        (Deed::Babbles, odd, "something else"),
        (Deed::Overdoes, 0, "something else"),
    ] {
        let coordinator = coordinator().await;
        let mut middle = member(&coordinator, 1).await;
        middle.packs.with_parent.silence = Duration::from_millis(300);
        let (parent, _server) = parent(deed).await;
        let below = member(&coordinator, 2).await;
        let from_middle = [None, Some(middle.address.clone())];
        let getting = [(&middle, [None, Some(parent)]), (&below, from_middle)];
        let getting = getting.iter().map(|(member, from)| member.get(from));
        for bytes in join_all(getting).await {
            assert_eq!(bytes.unwrap(), content(), "{deed:?}");
        }
        assert!(middle.lines.contain(complaint), "{deed:?}: {:?}", middle.lines);
        let (least, is_lie) = (2 * even + given, matches!(deed, Deed::Lies));
        let count = coordinator.piece_count();
        // What is below a liar may have believed it, and then asks for everything too.
        assert!(count == least || is_lie && count > least, "{deed:?}: {count}, not {least}");
    }
}

#[tokio::test]
async fn a_parent_that_has_nothing_yet_is_waited_for_up_to_a_limit_each_time() {
    let coordinator = coordinator().await;
    let member = member(&coordinator, 1).await;
    let (parent, _server) = parent(Deed::Hesitates(EMPTY_CHUNKS_MAX)).await;
    assert_eq!(member.get(&[None, Some(parent)]).await.unwrap(), content());
    assert_eq!(coordinator.piece_count(), of(Tree::Even));
}

#[tokio::test]
async fn a_coordinator_that_is_silent_is_given_up_and_may_be_asked_again() {
    let coordinator = coordinator().await;
    let mut member = member(&coordinator, 0).await;
    member.packs.with_coordinator.silence = Duration::from_millis(50);
    for count in [0, 1, 5] {
        *coordinator.manner.lock().unwrap() = Manner::FallsSilent(count);
        let refusal = member.get(&NOBODY).await.unwrap_err();
        assert!(matches!(refusal, PackError::Silent(_)), "{refusal}");
        assert_eq!(member.file(), None);
    }
    *coordinator.manner.lock().unwrap() = Manner::Whole;
    member.packs.with_coordinator = COORDINATOR_PATIENCE;
    assert_eq!(member.get(&NOBODY).await.unwrap(), content());
}

#[tokio::test]
async fn a_coordinator_that_has_nothing_is_not_waited_for() {
    let coordinator = coordinator().await;
    *coordinator.manner.lock().unwrap() = Manner::HasNothing;
    let refusal = member(&coordinator, 0).await.get(&NOBODY).await.unwrap_err();
    assert!(matches!(refusal, PackError::Other(_)), "{refusal}");
}

#[tokio::test]
async fn nobody_at_the_address_is_no_matter() {
    let coordinator = coordinator().await;
    let nobody = Some(address(3, "127.0.0.1:1"));
    let member = member(&coordinator, 1).await;
    assert_eq!(member.get(&[nobody.clone(), nobody]).await.unwrap(), content());
    assert!(member.lines.contain("the coordinator is asked"));
    assert_eq!(coordinator.piece_count(), all());
}

#[tokio::test]
async fn who_waits_hears_that_somebody_is_there_and_too_many_are_turned_away() {
    let coordinator = coordinator().await;
    let member = member(&coordinator, 1).await;
    let place = member.packs.place(&scene()).unwrap().unwrap();
    let passing = member.packs.passing();
    let request = PackRequest { hash: scene().hash, tree: Tree::Odd, skip: 0 };
    let mut streams = Vec::new();
    let refusal = loop {
        match passing.pass(request).await {
            Ok(stream) => streams.push(stream),
            Err(status) => break status,
        }
    };
    assert_eq!((refusal.code(), streams.len()), (Code::ResourceExhausted, 32));
    let chunk = soon(streams[0].next()).await.unwrap().unwrap();
    assert_eq!(chunk, pack::none_yet());
    // What can never come, ends.
    drop(place);
    let end = soon(streams[0].next()).await.unwrap().unwrap_err();
    assert_eq!(end.code(), Code::Unavailable);
    assert!(soon(streams[0].next()).await.is_none());
    // Another one has room now.
    streams.clear();
    let beyond = PackRequest { skip: u64::MAX, ..request };
    let place = member.packs.place(&scene()).unwrap();
    let mut stream = passing.pass(beyond).await.unwrap();
    assert!(soon(stream.next()).await.is_none());
    drop(place);
}
