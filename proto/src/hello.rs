//! Greetings. Before anything else both sides learn whether they are the same program: an image is
//! the same to the bit only if one version computes all of it.

use std::fmt;

use equilux_common::ids::{Incarnation, WorkerId};

use crate::limits::{NAME_BYTES_MAX, THREADS_MAX, VERSION_BYTES_MAX};
use crate::roster::{InvalidAddress, check_address};
use crate::v1;

/// The protocol that this program speaks; it rises with every change of what travels.
pub const PROTOCOL_VERSION: u32 = 2;

/// The version of this program.
pub const PROGRAM_VERSION: &str = env!("CARGO_PKG_VERSION");

/// A program and the protocol that it speaks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Versions {
    /// The program's version.
    pub program: String,
    /// The protocol's version.
    pub protocol: u32,
}

impl Versions {
    /// Those of this program.
    #[must_use]
    pub fn own() -> Self {
        Self { program: PROGRAM_VERSION.into(), protocol: PROTOCOL_VERSION }
    }
}

impl fmt::Display for Versions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "equilux {} (protocol {})", self.program, self.protocol)
    }
}

/// Another version greets.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the other side is {theirs}, this is {ours}; use the same version everywhere")]
pub struct OtherVersion {
    /// Of the program that greets.
    pub theirs: Versions,
    /// Of this program.
    pub ours: Versions,
}

/// A worker as it introduces itself to its coordinator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Hello {
    /// The same in every life of the worker, different for every worker.
    pub name: String,
    /// `host:port` at which it answers its peers.
    pub address: String,
    /// Compute threads; at least 1.
    pub threads: u32,
    /// Relative speed of one thread, 1000 where nothing has been measured; more than 0.
    pub speed: u32,
    /// Bytes of memory that it may use for the geometry of a job; none: as many as there are.
    pub memory: Option<u64>,
}

/// Who a worker is from now on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Welcome {
    /// Its id.
    pub worker: WorkerId,
    /// Its life.
    pub incarnation: Incarnation,
}

/// A worker as it introduces itself to a peer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PeerHello {
    /// Who.
    pub worker: WorkerId,
    /// In which life.
    pub incarnation: Incarnation,
}

/// A worker that cannot be let in.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidHello {
    /// It is another program.
    #[error(transparent)]
    Version(#[from] InvalidVersions),
    /// No name, or a long one.
    #[error("name: has {0} bytes, not from 1 to {NAME_BYTES_MAX}")]
    Name(usize),
    /// It cannot be reached.
    #[error(transparent)]
    Address(#[from] InvalidAddress),
    /// It cannot compute.
    #[error("threads: {0} is not from 1 to {THREADS_MAX}")]
    Threads(u32),
    /// It is infinitely slow.
    #[error("speed: is zero")]
    Speed,
}

/// A peer that is not listened to.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidPeerHello {
    /// It is another program.
    #[error(transparent)]
    Version(#[from] InvalidVersions),
}

/// Versions that are no versions, or others.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidVersions {
    /// Not said.
    #[error("versions: are missing; the other side is no equilux")]
    Missing,
    /// A long text.
    #[error("versions.program: has {0} bytes; at most {VERSION_BYTES_MAX} are allowed")]
    Program(usize),
    /// Others.
    #[error(transparent)]
    Other(#[from] OtherVersion),
}

fn own_versions() -> Option<v1::Versions> {
    let Versions { program, protocol } = Versions::own();
    Some(v1::Versions { program, protocol })
}

fn check_versions(wire: Option<v1::Versions>) -> Result<(), InvalidVersions> {
    let v1::Versions { program, protocol } = wire.ok_or(InvalidVersions::Missing)?;
    if program.len() > VERSION_BYTES_MAX {
        return Err(InvalidVersions::Program(program.len()));
    }
    let (theirs, ours) = (Versions { program, protocol }, Versions::own());
    if theirs == ours { Ok(()) } else { Err(OtherVersion { theirs, ours }.into()) }
}

impl From<Hello> for v1::Hello {
    fn from(hello: Hello) -> Self {
        Self {
            versions: own_versions(),
            name: hello.name,
            address: hello.address,
            threads: hello.threads,
            speed: hello.speed,
            memory: hello.memory,
        }
    }
}

impl TryFrom<v1::Hello> for Hello {
    type Error = InvalidHello;

    fn try_from(wire: v1::Hello) -> Result<Self, InvalidHello> {
        check_versions(wire.versions)?;
        if !(1..=NAME_BYTES_MAX).contains(&wire.name.len()) {
            return Err(InvalidHello::Name(wire.name.len()));
        }
        if !(1..=THREADS_MAX).contains(&wire.threads) {
            return Err(InvalidHello::Threads(wire.threads));
        }
        if wire.speed == 0 {
            return Err(InvalidHello::Speed);
        }
        let address = check_address(wire.address)?;
        let v1::Hello { name, threads, speed, memory, .. } = wire;
        Ok(Self { name, address, threads, speed, memory })
    }
}

impl From<Welcome> for v1::Welcome {
    fn from(welcome: Welcome) -> Self {
        Self { worker: welcome.worker.0, incarnation: welcome.incarnation.0 }
    }
}

impl From<v1::Welcome> for Welcome {
    fn from(wire: v1::Welcome) -> Self {
        Self { worker: WorkerId(wire.worker), incarnation: Incarnation(wire.incarnation) }
    }
}

impl From<PeerHello> for v1::PeerHello {
    fn from(hello: PeerHello) -> Self {
        Self { versions: own_versions(), worker: hello.worker.0, incarnation: hello.incarnation.0 }
    }
}

impl TryFrom<v1::PeerHello> for PeerHello {
    type Error = InvalidPeerHello;

    fn try_from(wire: v1::PeerHello) -> Result<Self, InvalidPeerHello> {
        check_versions(wire.versions)?;
        Ok(Self { worker: WorkerId(wire.worker), incarnation: Incarnation(wire.incarnation) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn hello() -> Hello {
        let address = "localhost:9".into();
        Hello { name: "n".into(), address, threads: 4, speed: 1000, memory: None }
    }

    proptest! {
        #[test]
        fn greetings_round_trip(
            name in ".{1,20}", port in 1u16.., threads in 1..THREADS_MAX, speed in 1u32..,
            worker in any::<u32>(), incarnation in any::<u64>(),
            memory in proptest::option::of(any::<u64>()),
        ) {
            let address = format!("10.0.0.1:{port}");
            let hello = Hello { name, address, threads, speed, memory };
            prop_assert_eq!(Hello::try_from(v1::Hello::from(hello.clone())), Ok(hello));
            let (worker, incarnation) = (WorkerId(worker), Incarnation(incarnation));
            let welcome = Welcome { worker, incarnation };
            prop_assert_eq!(Welcome::from(v1::Welcome::from(welcome)), welcome);
            let peer = PeerHello { worker, incarnation };
            prop_assert_eq!(PeerHello::try_from(v1::PeerHello::from(peer)), Ok(peer));
        }
    }

    #[test]
    fn another_version_is_refused_before_all_else_and_both_are_named() {
        let mut wire = v1::Hello::from(hello());
        wire.name.clear();
        wire.versions = Some(v1::Versions { program: "9.9.9".into(), protocol: 77 });
        let message = Hello::try_from(wire).expect_err("another version").to_string();
        for part in ["9.9.9", "77", PROGRAM_VERSION, &format!("protocol {PROTOCOL_VERSION}")] {
            assert!(message.contains(part), "{message}");
        }
    }

    #[test]
    fn what_is_wrong_is_refused_by_field() {
        let refusal = |spoil: fn(&mut v1::Hello)| {
            let mut wire = v1::Hello::from(hello());
            spoil(&mut wire);
            Hello::try_from(wire).expect_err("it is spoilt")
        };
        assert_eq!(refusal(|hello| hello.versions = None), InvalidVersions::Missing.into());
        assert_eq!(refusal(|hello| hello.name = "x".repeat(129)), InvalidHello::Name(129));
        assert_eq!(refusal(|hello| hello.threads = 0), InvalidHello::Threads(0));
        assert_eq!(refusal(|hello| hello.speed = 0), InvalidHello::Speed);
        assert_eq!(refusal(|hello| hello.address.clear()), InvalidAddress.into());
    }
}
