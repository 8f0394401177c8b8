//! Links between hosts: which are wanted, which stand, and what is lost with one that is let go.

use equilux_common::message::PeerAddress;
use equilux_worker_core::event::Event;

use crate::happening::Happening;
use crate::network::End;
use crate::world::World;

/// A host wants links to exactly these peers. One stands when both want it: each side's greeting is
/// awaited, and so both find out at a time of their own.
pub(crate) fn want(world: &mut World, host: usize, peers: &[PeerAddress]) {
    let wanted = peers.iter().map(|peer| world.host(peer.worker, peer.incarnation)).collect();
    world.hosts[host].wanted = wanted;
    let at = &world.hosts[host];
    let dropped: Vec<usize> = at.linked.difference(&at.wanted).copied().collect();
    let missing: Vec<usize> = at.wanted.difference(&at.linked).copied().collect();
    for peer in dropped {
        world.hosts[host].linked.remove(&peer);
        let (from, to) = (End::Host(host), End::Host(peer));
        world.drop_happenings(|happening| {
            happening.mail().is_some_and(|mail| (mail.from, mail.to) == (from, to))
        });
    }
    for peer in missing {
        if world.hosts[peer].is_alive && world.hosts[peer].wanted.contains(&host) {
            for (at, peer) in [(host, peer), (peer, host)] {
                let when = world.now() + world.network.greeting();
                world.agenda.put(when, Happening::Linked { at, peer });
            }
        }
    }
}

/// A link stands; gives what its host is told, if that is news and wanted.
pub(crate) fn stand(world: &mut World, at: usize, peer: usize) -> Option<Event> {
    let host = &mut world.hosts[at];
    let is_news = host.wanted.contains(&peer) && host.linked.insert(peer);
    let (peer, incarnation) = world.hosts[peer].identity.filter(|_| is_news)?;
    Some(Event::PeerLinked { peer, incarnation })
}

/// A link is found gone; gives what its host is told, if it stood.
pub(crate) fn break_off(world: &mut World, at: usize, peer: usize) -> Option<Event> {
    let stood = world.hosts[at].linked.remove(&peer);
    let (peer, incarnation) = world.hosts[peer].identity.filter(|_| stood)?;
    Some(Event::PeerLost { peer, incarnation })
}
