//! Faults: workers that come and die, and who finds out.

use crate::happening::Happening;
use crate::mail::Content;
use crate::network::End;
use crate::world::World;

/// A machine's worker comes if it is not there, and dies if it is.
pub(crate) fn turn(world: &mut World, machine: usize) {
    if let Some(host) = world.alive(machine) {
        kill(world, host);
        return;
    }
    let host = world.come(machine);
    world.send(End::Host(host), End::Coordinator, Content::Knock);
}

/// A host dies: what it holds is lost, and so is what is on its way to it, and perhaps some of what
/// is on its way from it. Who had to do with it finds out later.
pub(crate) fn kill(world: &mut World, host: usize) {
    world.go(host);
    let loses_sent = world.random.chance(50);
    world.drop_happenings(|happening| concerns(happening, host, loses_sent));
    world.send(End::Host(host), End::Coordinator, Content::HangUp);
    let hosts = world.hosts.iter().enumerate();
    let witnesses = hosts.filter(|(_, other)| other.linked.contains(&host));
    for at in witnesses.map(|(at, _)| at).collect::<Vec<_>>() {
        let when = world.now() + world.network.delay();
        world.agenda.put(when, Happening::Unlinked { at, peer: host });
    }
}

/// Whether something cannot happen any more when a host has died.
fn concerns(happening: &Happening, host: usize, loses_sent: bool) -> bool {
    let end = End::Host(host);
    match happening {
        Happening::Reaches(mail) | Happening::Arrives(mail) => {
            mail.to == end || (mail.from == end && loses_sent)
        }
        Happening::Linked { at, peer } => *at == host || *peer == host,
        Happening::Unlinked { at, .. }
        | Happening::Loaded { at, .. }
        | Happening::PartitionLoaded { at, .. }
        | Happening::Traced { at, .. } => *at == host,
        Happening::Wake { end: which } => *which == end,
        Happening::Turn { .. }
        | Happening::Change { .. }
        | Happening::Submit(_)
        | Happening::Cancel(_) => false,
    }
}
