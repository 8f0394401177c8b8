//! Who takes part in a job.

use equilux_common::ids::{Incarnation, WorkerId};
use equilux_common::message::{Home, PeerAddress};

use crate::limits::{ADDRESS_BYTES_MAX, ROSTER_WORKERS_MAX};
use crate::v1;

/// A roster that cannot be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidRoster {
    /// More workers than any job may have.
    #[error("has {0} workers; at most {ROSTER_WORKERS_MAX} are allowed")]
    Length(usize),
    /// Out of order, or one twice.
    #[error("[{0}].worker: does not ascend")]
    Order(usize),
    /// Somebody cannot be reached.
    #[error("[{index}].{problem}")]
    Address {
        /// Whose place.
        index: usize,
        /// What is wrong.
        problem: InvalidAddress,
    },
}

/// Not the address of anybody.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("address: is not host:port within {ADDRESS_BYTES_MAX} bytes")]
pub struct InvalidAddress;

/// Makes sure that an address has a host and a port.
pub(crate) fn check_address(address: String) -> Result<String, InvalidAddress> {
    if is_address(&address) { Ok(address) } else { Err(InvalidAddress) }
}

/// Whether a worker may be found at `address`: a host and a port.
#[must_use]
pub fn is_address(address: &str) -> bool {
    let is_within = address.len() <= ADDRESS_BYTES_MAX;
    let has_both = address.rsplit_once(':').is_some_and(|(host, port)| {
        let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b".-_:[]".contains(&byte);
        let is_port = port.bytes().all(|byte| byte.is_ascii_digit());
        !host.is_empty()
            && host.bytes().all(is_plain)
            && is_port
            && port.parse::<u16>().is_ok_and(|port| port > 0)
    });
    is_within && has_both
}

impl From<PeerAddress> for v1::PeerAddress {
    fn from(peer: PeerAddress) -> Self {
        let (worker, incarnation) = (peer.worker.0, peer.incarnation.0);
        Self { worker, incarnation, address: peer.address.as_ref().into() }
    }
}

impl TryFrom<v1::PeerAddress> for PeerAddress {
    type Error = InvalidAddress;

    fn try_from(wire: v1::PeerAddress) -> Result<Self, InvalidAddress> {
        let (worker, incarnation) = (WorkerId(wire.worker), Incarnation(wire.incarnation));
        Ok(Self { worker, incarnation, address: check_address(wire.address)?.into() })
    }
}

/// The wire's form of a roster.
pub(crate) fn to_wire(roster: Vec<PeerAddress>) -> Vec<v1::PeerAddress> {
    roster.into_iter().map(v1::PeerAddress::from).collect()
}

/// Checks a roster.
pub(crate) fn from_wire(wire: Vec<v1::PeerAddress>) -> Result<Vec<PeerAddress>, InvalidRoster> {
    if wire.len() > ROSTER_WORKERS_MAX {
        return Err(InvalidRoster::Length(wire.len()));
    }
    let not_above = wire.windows(2).position(|pair| pair[0].worker >= pair[1].worker);
    if let Some(index) = not_above {
        return Err(InvalidRoster::Order(index + 1));
    }
    let entry = |(index, peer): (usize, v1::PeerAddress)| {
        peer.try_into().map_err(|problem| InvalidRoster::Address { index, problem })
    };
    wire.into_iter().enumerate().map(entry).collect()
}

impl From<Home> for v1::Home {
    fn from(home: Home) -> Self {
        let Home { peer, memory, is_late, is_lost } = home;
        Self { peer: Some(peer.into()), memory, is_late, is_lost }
    }
}

/// Checks homes.
pub(crate) fn homes_from_wire(wire: Vec<v1::Home>) -> Result<Vec<Home>, InvalidRoster> {
    if wire.len() > ROSTER_WORKERS_MAX {
        return Err(InvalidRoster::Length(wire.len()));
    }
    let entry = |(index, home): (usize, v1::Home)| {
        let v1::Home { peer, memory, is_late, is_lost } = home;
        let peer = peer.ok_or(InvalidAddress).and_then(PeerAddress::try_from);
        let peer = peer.map_err(|problem| InvalidRoster::Address { index, problem })?;
        Ok(Home { peer, memory, is_late, is_lost })
    };
    wire.into_iter().enumerate().map(entry).collect()
}

/// The wire's form of lives.
pub(crate) fn lives_to_wire(lives: Vec<(WorkerId, Incarnation)>) -> Vec<v1::PeerLife> {
    let life = |(worker, incarnation): (WorkerId, Incarnation)| v1::PeerLife {
        worker: worker.0,
        incarnation: incarnation.0,
    };
    lives.into_iter().map(life).collect()
}

/// Checks lives.
pub(crate) fn lives_from_wire(
    wire: &[v1::PeerLife],
) -> Result<Vec<(WorkerId, Incarnation)>, InvalidRoster> {
    if wire.len() > ROSTER_WORKERS_MAX {
        return Err(InvalidRoster::Length(wire.len()));
    }
    let life = |life: &v1::PeerLife| (WorkerId(life.worker), Incarnation(life.incarnation));
    Ok(wire.iter().map(life).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arbitrary;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn rosters_round_trip(roster in arbitrary::roster()) {
            prop_assert_eq!(from_wire(to_wire(roster.clone())), Ok(roster));
        }

        #[test]
        fn an_address_is_taken_as_it_is_or_not_at_all(address in ".{0,30}") {
            prop_assert!(check_address(address.clone()).is_ok_and(|same| same == address)
                || check_address(address) == Err(InvalidAddress));
        }
    }

    #[test]
    fn addresses_have_a_host_and_a_port() {
        for good in ["localhost:1", "127.0.0.1:65535", "[::1]:7000", "worker_3.lan:80"] {
            assert_eq!(check_address(good.into()), Ok(good.into()));
        }
        for bad in ["", ":1", "host", "host:", "host:0", "host:65536", "host:+1", "a b:1", "a/b:1"]
        {
            assert_eq!(check_address(bad.into()), Err(InvalidAddress), "{bad}");
        }
    }

    #[test]
    fn a_roster_ascends() {
        let peer = |worker| v1::PeerAddress { worker, incarnation: 1, address: "a:1".into() };
        assert_eq!(from_wire(vec![peer(1), peer(1)]), Err(InvalidRoster::Order(1)));
        assert_eq!(from_wire(vec![peer(1), peer(3), peer(2)]), Err(InvalidRoster::Order(2)));
    }
}
