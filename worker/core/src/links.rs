//! Links to peers: which are wanted and which stand.
//!
//! While a job runs the set of links only grows (lost lives apart), even if workers that join
//! change who is whose neighbor: closing a link would lose what is on its way.

use std::collections::BTreeMap;

use equilux_common::ids::{Incarnation, WorkerId};
use equilux_common::message::PeerAddress;

/// Links to peers.
#[derive(Debug, Default)]
pub(crate) struct Links {
    wanted: Vec<PeerAddress>,
    standing: BTreeMap<WorkerId, Incarnation>,
}

impl Links {
    /// A job starts: links to exactly these peers are wanted.
    pub(crate) fn replace(&mut self, mut wanted: Vec<PeerAddress>) {
        wanted.sort_unstable();
        wanted.dedup();
        self.wanted = wanted;
        let is_wanted = |worker: WorkerId, incarnation: Incarnation| {
            self.wanted.iter().any(|peer| (peer.worker, peer.incarnation) == (worker, incarnation))
        };
        self.standing.retain(|&worker, &mut incarnation| is_wanted(worker, incarnation));
    }

    /// The neighbors have changed: links to these peers are wanted too. Lives that are gone are let
    /// go.
    pub(crate) fn widen(&mut self, neighbors: Vec<PeerAddress>, gone: &[(WorkerId, Incarnation)]) {
        let mut wanted = std::mem::take(&mut self.wanted);
        wanted.retain(|peer| !gone.contains(&(peer.worker, peer.incarnation)));
        wanted.extend(neighbors);
        self.replace(wanted);
    }

    /// The peers to which links are wanted.
    pub(crate) fn wanted(&self) -> &[PeerAddress] {
        &self.wanted
    }

    /// A link stands; says whether that is news and wanted.
    pub(crate) fn join(&mut self, peer: WorkerId, incarnation: Incarnation) -> bool {
        let is_wanted =
            |wanted: &PeerAddress| (wanted.worker, wanted.incarnation) == (peer, incarnation);
        self.wanted.iter().any(is_wanted)
            && self.standing.insert(peer, incarnation) != Some(incarnation)
    }

    /// A link is gone; says whether it stood.
    pub(crate) fn lose(&mut self, peer: WorkerId, incarnation: Incarnation) -> bool {
        let stood = self.standing.get(&peer) == Some(&incarnation);
        if stood {
            self.standing.remove(&peer);
        }
        stood
    }

    /// Where a linked peer is found.
    pub(crate) fn address(&self, peer: WorkerId) -> Option<&PeerAddress> {
        let incarnation = self.incarnation(peer)?;
        self.wanted.iter().find(|w| (w.worker, w.incarnation) == (peer, incarnation))
    }

    /// In which life a peer is linked.
    pub(crate) fn incarnation(&self, peer: WorkerId) -> Option<Incarnation> {
        self.standing.get(&peer).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn peer(worker: u32, incarnation: u64) -> PeerAddress {
        let (worker, incarnation) = (WorkerId(worker), Incarnation(incarnation));
        PeerAddress { worker, incarnation, address: "".into() }
    }

    #[test]
    fn links_of_a_running_job_only_grow_but_for_lost_lives() {
        let mut links = Links::default();
        links.replace(vec![peer(1, 0), peer(2, 0)]);
        assert!(links.join(WorkerId(1), Incarnation(0)) && links.join(WorkerId(2), Incarnation(0)));
        assert!(!links.join(WorkerId(1), Incarnation(0)), "no news");
        assert!(!links.join(WorkerId(9), Incarnation(0)), "not wanted");
        links.widen(vec![peer(3, 0)], &[(WorkerId(2), Incarnation(0))]);
        assert_eq!(links.wanted(), [peer(1, 0), peer(3, 0)]);
        assert_eq!(links.incarnation(WorkerId(1)), Some(Incarnation(0)));
        assert_eq!(links.incarnation(WorkerId(2)), None);
    }
}
