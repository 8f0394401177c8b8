//! Links to peers: one stream for each pair of workers, opened by the one with the lower id.
//!
//! ```text
//!   driver ──tell──▶ outgoing ──▶ stream ──▶ peer
//!   driver ◀─hear─── inputs ◀──── stream ◀── peer
//! ```
//!
//! A task per peer opens the stream or waits for it, says that the link stands, hands on what the
//! peer says, and says that the link is gone; then it begins anew. Every standing of a link has a
//! number, so that what is left over from an earlier one is told apart.

mod door;
mod stream;

use std::collections::BTreeMap;
use std::sync::Arc;

use equilux_common::ids::{Incarnation, JobId, WorkerId};
use equilux_common::message::{PeerAddress, PeerMessage};
use equilux_proto::hello::PeerHello;
use equilux_proto::peer::PeerFrame;
use equilux_proto::v1;
use equilux_worker_core::event::Event;
use prost::Message;
use tokio::sync::mpsc;
use tokio::task::AbortHandle;

pub(crate) use door::{Door, Entrance};

use crate::driver::Input;
use crate::log::Log;
use stream::Caller;

/// Most frames that wait for a peer. Windows keep their number far below; a peer that reads so
/// slowly that they do not is taken for lost.
pub(crate) const LINK_FRAMES_MAX: usize = 4096;

/// What the task of a link tells the driver.
#[derive(Debug)]
pub(crate) struct Heard {
    pub(crate) peer: WorkerId,
    pub(crate) incarnation: Incarnation,
    /// Which standing of the link it is.
    pub(crate) standing: u64,
    pub(crate) news: News,
}

/// What happened on a link.
#[derive(Debug)]
pub(crate) enum News {
    /// It stands; this leads to the peer.
    Linked(mpsc::Sender<v1::PeerFrame>),
    /// The peer said something, in so many bytes.
    Said { job: JobId, message: PeerMessage, bytes: u64 },
    /// It is gone.
    Lost,
}

/// The link is gone, or the peer does not read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LinkGone;

/// All links of a worker.
#[derive(Debug)]
pub(crate) struct Peers {
    own: PeerHello,
    links: BTreeMap<WorkerId, Link>,
    bytes_out: BTreeMap<JobId, u64>,
    /// None where there are no peers.
    ways: Option<Ways>,
}

/// How peers are reached.
#[derive(Debug)]
pub(crate) struct Ways {
    pub(crate) door: Arc<Door>,
    pub(crate) inputs: mpsc::Sender<Input>,
    pub(crate) log: Log,
}

#[derive(Debug)]
struct Link {
    address: PeerAddress,
    standing: Option<(u64, mpsc::Sender<v1::PeerFrame>)>,
    task: AbortHandle,
}

impl Drop for Link {
    fn drop(&mut self) {
        self.task.abort();
    }
}

impl Peers {
    /// No peers now or ever.
    pub(crate) const fn none(worker: WorkerId, incarnation: Incarnation) -> Self {
        let own = PeerHello { worker, incarnation };
        Self { own, links: BTreeMap::new(), bytes_out: BTreeMap::new(), ways: None }
    }

    /// No peers yet.
    pub(crate) const fn new(own: PeerHello, ways: Ways) -> Self {
        Self { own, links: BTreeMap::new(), bytes_out: BTreeMap::new(), ways: Some(ways) }
    }

    /// Keeps links to exactly these peers; those that there are already stay as they are.
    pub(crate) fn keep(&mut self, peers: &[PeerAddress]) {
        let Some(ways) = &self.ways else { return };
        self.links.retain(|&peer, link| {
            let is_kept = peers.contains(&link.address);
            if !is_kept {
                ways.door.dismiss(peer);
            }
            is_kept
        });
        for address in peers.iter().filter(|peer| peer.worker != self.own.worker) {
            self.links.entry(address.worker).or_insert_with(|| {
                let task = tokio::spawn(stream::keep(Caller::new(self.own, address, ways)));
                Link { address: address.clone(), standing: None, task: task.abort_handle() }
            });
        }
    }

    /// What the core is to know of what a link's task says.
    pub(crate) fn hear(&mut self, heard: Heard) -> Option<Event> {
        let Heard { peer, incarnation, standing, news } = heard;
        let link = self.links.get_mut(&peer).filter(|l| l.address.incarnation == incarnation)?;
        let is_current = link.standing.as_ref().is_some_and(|(number, _)| *number == standing);
        match news {
            News::Linked(outgoing) => {
                link.standing = Some((standing, outgoing));
                Some(Event::PeerLinked { peer, incarnation })
            }
            News::Said { job, message, bytes } if is_current => {
                Some(Event::PeerSaid { peer, incarnation, job, message, bytes })
            }
            News::Lost if is_current => {
                link.standing = None;
                Some(Event::PeerLost { peer, incarnation })
            }
            News::Said { .. } | News::Lost => None,
        }
    }

    /// Tells a peer something, if the link to it in this life stands. It is an error if the peer is
    /// found not to read; the link is given up then.
    pub(crate) fn tell(
        &mut self,
        peer: WorkerId,
        incarnation: Incarnation,
        job: JobId,
        message: PeerMessage,
    ) -> Result<(), LinkGone> {
        let link = self.links.get_mut(&peer).filter(|l| l.address.incarnation == incarnation);
        let Some(link) = link else { return Ok(()) };
        let Some((_, outgoing)) = &link.standing else { return Ok(()) };
        let frame = v1::PeerFrame::from(PeerFrame::Said { job, message });
        let bytes = frame.encoded_len() as u64;
        match outgoing.try_send(frame) {
            Ok(()) => {
                *self.bytes_out.entry(job).or_default() += bytes;
                Ok(())
            }
            // Its task will say so.
            Err(mpsc::error::TrySendError::Closed(_)) => Ok(()),
            Err(mpsc::error::TrySendError::Full(_)) => {
                link.standing = None;
                Err(LinkGone)
            }
        }
    }

    /// Bytes told to peers about a job.
    pub(crate) fn bytes_out(&self, job: JobId) -> u64 {
        self.bytes_out.get(&job).copied().unwrap_or(0)
    }

    /// A job is over.
    pub(crate) fn forget(&mut self, job: JobId) {
        self.bytes_out.remove(&job);
    }
}

#[cfg(test)]
mod tests;
