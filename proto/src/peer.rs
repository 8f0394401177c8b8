//! What travels between two workers.

use std::time::Duration;

use equilux_common::bundle::Bundle;
use equilux_common::ids::{JobId, PartitionId};
use equilux_common::message::PeerMessage;
use equilux_common::work::Work;

use crate::bundle::{self, InvalidBundle};
use crate::hello::{InvalidPeerHello, PeerHello};
use crate::share::InvalidSamples;
use crate::v1::{self, peer_frame, peer_said, work};

/// One frame on a link.
#[derive(Clone, Debug, PartialEq)]
pub enum PeerFrame {
    /// The greeting, first of all and only then.
    Hello(PeerHello),
    /// Anything after it.
    Said {
        /// About which job.
        job: JobId,
        /// What.
        message: PeerMessage,
    },
}

/// A frame that no peer sends.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidPeerFrame {
    /// Neither greeting nor message.
    #[error("frame: is empty or of an unknown kind")]
    Empty,
    /// A message about nothing.
    #[error("said.message: is empty or of an unknown kind")]
    NoMessage,
    /// A bad greeting.
    #[error("hello: {0}")]
    Hello(#[from] InvalidPeerHello),
    /// Bad work.
    #[error("said.given.{0}")]
    Work(#[from] InvalidWork),
    /// A worker that cannot compute.
    #[error("said.load.capacity: is zero")]
    NoCapacity,
    /// No rays.
    #[error("said.forwarded.bundles: is empty")]
    NothingForwarded,
    /// Bad rays.
    #[error("said.forwarded.bundles[{index}]: {problem}")]
    Forwarded {
        /// In which bundle.
        index: usize,
        /// What is wrong with it.
        problem: InvalidBundle,
    },
    /// Nothing has arrived.
    #[error("said.acknowledged.count: is zero")]
    NothingAcknowledged,
}

/// Work that cannot be done.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidWork {
    /// Neither samples nor rays.
    #[error("work: is empty or of an unknown kind")]
    Empty,
    /// Bad samples.
    #[error("samples.{0}")]
    Samples(#[from] InvalidSamples),
    /// A bad bundle.
    #[error("bundle: {0}")]
    Bundle(#[from] InvalidBundle),
}

impl From<PeerFrame> for v1::PeerFrame {
    fn from(frame: PeerFrame) -> Self {
        let frame = match frame {
            PeerFrame::Hello(hello) => peer_frame::Frame::Hello(hello.into()),
            PeerFrame::Said { job, message } => {
                let message = Some(message.into());
                peer_frame::Frame::Said(v1::PeerSaid { job: job.0, message })
            }
        };
        Self { frame: Some(frame) }
    }
}

impl TryFrom<v1::PeerFrame> for PeerFrame {
    type Error = InvalidPeerFrame;

    fn try_from(wire: v1::PeerFrame) -> Result<Self, InvalidPeerFrame> {
        match wire.frame.ok_or(InvalidPeerFrame::Empty)? {
            peer_frame::Frame::Hello(hello) => Ok(Self::Hello(hello.try_into()?)),
            peer_frame::Frame::Said(v1::PeerSaid { job, message }) => {
                let message = message.ok_or(InvalidPeerFrame::NoMessage)?.try_into()?;
                Ok(Self::Said { job: JobId(job), message })
            }
        }
    }
}

impl From<PeerMessage> for peer_said::Message {
    fn from(message: PeerMessage) -> Self {
        match message {
            PeerMessage::LoadAsked { round } => Self::LoadAsked(v1::LoadAsked { round }),
            PeerMessage::Load { round, load, capacity } => {
                Self::Load(v1::Load { round, load_nanos: nanos(load), capacity })
            }
            PeerMessage::WorkAsked { amount } => {
                Self::WorkAsked(v1::WorkAsked { amount_nanos: nanos(amount) })
            }
            PeerMessage::Given { work } => Self::Given(work.into()),
            PeerMessage::Declined => Self::Declined(v1::Declined {}),
            PeerMessage::Acknowledged { count } => Self::Acknowledged(v1::Acknowledged { count }),
            PeerMessage::Offered { partition, load } => Self::Offered(copy_of(partition, load)),
            PeerMessage::OfferTaken { partition } => {
                Self::OfferTaken(copy_of(partition, Duration::ZERO))
            }
            PeerMessage::OfferRefused { partition } => {
                Self::OfferRefused(copy_of(partition, Duration::ZERO))
            }
            PeerMessage::Forwarded { bundles } => {
                let bundles = bundles.iter().map(bundle::encode).collect();
                Self::Forwarded(v1::Forwarded { bundles })
            }
            PeerMessage::ForwardsAcknowledged { count } => {
                Self::ForwardsAcknowledged(v1::Acknowledged { count })
            }
        }
    }
}

impl TryFrom<peer_said::Message> for PeerMessage {
    type Error = InvalidPeerFrame;

    fn try_from(wire: peer_said::Message) -> Result<Self, InvalidPeerFrame> {
        use peer_said::Message as Wire;
        Ok(match wire {
            Wire::LoadAsked(v1::LoadAsked { round }) => Self::LoadAsked { round },
            Wire::Load(v1::Load { capacity: 0, .. }) => return Err(InvalidPeerFrame::NoCapacity),
            Wire::Load(v1::Load { round, load_nanos, capacity }) => {
                Self::Load { round, load: Duration::from_nanos(load_nanos), capacity }
            }
            Wire::WorkAsked(v1::WorkAsked { amount_nanos }) => {
                Self::WorkAsked { amount: Duration::from_nanos(amount_nanos) }
            }
            Wire::Given(work) => Self::Given { work: work.try_into()? },
            Wire::Declined(v1::Declined {}) => Self::Declined,
            Wire::Acknowledged(v1::Acknowledged { count: 0 })
            | Wire::ForwardsAcknowledged(v1::Acknowledged { count: 0 }) => {
                return Err(InvalidPeerFrame::NothingAcknowledged);
            }
            Wire::Acknowledged(v1::Acknowledged { count }) => Self::Acknowledged { count },
            Wire::ForwardsAcknowledged(v1::Acknowledged { count }) => {
                Self::ForwardsAcknowledged { count }
            }
            Wire::Offered(v1::CopyOfPartition { partition, load_nanos }) => {
                let load = Duration::from_nanos(load_nanos);
                Self::Offered { partition: PartitionId(partition), load }
            }
            Wire::OfferTaken(copy) => Self::OfferTaken { partition: PartitionId(copy.partition) },
            Wire::OfferRefused(copy) => {
                Self::OfferRefused { partition: PartitionId(copy.partition) }
            }
            Wire::Forwarded(v1::Forwarded { bundles }) => {
                Self::Forwarded { bundles: forwarded(&bundles)? }
            }
        })
    }
}

fn copy_of(PartitionId(partition): PartitionId, load: Duration) -> v1::CopyOfPartition {
    v1::CopyOfPartition { partition, load_nanos: nanos(load) }
}

fn forwarded(wire: &[Vec<u8>]) -> Result<Vec<Bundle>, InvalidPeerFrame> {
    if wire.is_empty() {
        return Err(InvalidPeerFrame::NothingForwarded);
    }
    let decode = |(index, bytes): (usize, &Vec<u8>)| {
        bundle::decode(bytes).map_err(|problem| InvalidPeerFrame::Forwarded { index, problem })
    };
    wire.iter().enumerate().map(decode).collect()
}

impl From<Work> for v1::Work {
    fn from(work: Work) -> Self {
        let work = match work {
            Work::Samples(samples) => work::Work::Samples(samples.into()),
            Work::Rays(bundle) => work::Work::Bundle(bundle::encode(&bundle)),
        };
        Self { work: Some(work) }
    }
}

impl TryFrom<v1::Work> for Work {
    type Error = InvalidWork;

    fn try_from(wire: v1::Work) -> Result<Self, InvalidWork> {
        match wire.work.ok_or(InvalidWork::Empty)? {
            work::Work::Samples(samples) => Ok(Self::Samples(samples.try_into()?)),
            work::Work::Bundle(bytes) => Ok(Self::Rays(bundle::decode(&bytes)?)),
        }
    }
}

/// A duration on the wire; 584 years are enough for any.
pub(crate) fn nanos(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arbitrary;
    use crate::limits::PEER_FRAME_BYTES_MAX;
    use equilux_common::bundle::{BUNDLE_RAYS_MAX, Share};
    use equilux_common::credit::{CREDIT_WORDS_MAX, Credit};
    use proptest::prelude::*;
    use prost::Message;

    proptest! {
        #[test]
        fn frames_round_trip_through_their_bytes(frame in arbitrary::peer_frame()) {
            let bytes = v1::PeerFrame::from(frame.clone()).encode_to_vec();
            let wire = v1::PeerFrame::decode(&bytes[..]).expect("as encoded");
            prop_assert_eq!(PeerFrame::try_from(wire), Ok(frame));
        }

        #[test]
        fn arbitrary_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            if let Ok(wire) = v1::PeerFrame::decode(&bytes[..]) {
                let _ = PeerFrame::try_from(wire);
            }
        }

        #[test]
        fn a_spoilt_frame_never_panics(
            frame in arbitrary::peer_frame(), spots in arbitrary::spots(),
        ) {
            let bytes = arbitrary::spoil(v1::PeerFrame::from(frame).encode_to_vec(), &spots);
            if let Ok(wire) = v1::PeerFrame::decode(&bytes[..]) {
                let _ = PeerFrame::try_from(wire);
            }
        }
    }

    #[test]
    fn what_is_missing_is_named() {
        let frame = |frame| PeerFrame::try_from(v1::PeerFrame { frame });
        assert_eq!(frame(None), Err(InvalidPeerFrame::Empty));
        let said = |message| frame(Some(peer_frame::Frame::Said(v1::PeerSaid { job: 1, message })));
        assert_eq!(said(None), Err(InvalidPeerFrame::NoMessage));
        let empty = peer_said::Message::Given(v1::Work { work: None });
        assert_eq!(said(Some(empty)), Err(InvalidWork::Empty.into()));
        let none = peer_said::Message::Acknowledged(v1::Acknowledged { count: 0 });
        assert_eq!(said(Some(none)), Err(InvalidPeerFrame::NothingAcknowledged));
        let none = peer_said::Message::Forwarded(v1::Forwarded { bundles: vec![] });
        assert_eq!(said(Some(none)), Err(InvalidPeerFrame::NothingForwarded));
        let bundles = vec![bundle::encode(&arbitrary::plain_bundle()), vec![]];
        let half = peer_said::Message::Forwarded(v1::Forwarded { bundles });
        let problem = InvalidBundle::Length { got: 0 };
        assert_eq!(said(Some(half)), Err(InvalidPeerFrame::Forwarded { index: 1, problem }));
    }

    #[test]
    fn the_largest_bundle_fits_a_frame() {
        let plain = arbitrary::plain_bundle();
        let credit = Credit::from_words(&[1; CREDIT_WORDS_MAX]).expect("less than the whole");
        let share = Share { credit, ..plain.shares[0].clone() };
        let bundle = Bundle {
            shares: vec![share; equilux_common::bundle::SHARES_MAX],
            rays: vec![plain.rays[0]; BUNDLE_RAYS_MAX],
            ..plain
        };
        let message = PeerMessage::Given { work: Work::Rays(bundle) };
        let frame = PeerFrame::Said { job: JobId(u64::MAX), message };
        assert!(v1::PeerFrame::from(frame).encoded_len() <= PEER_FRAME_BYTES_MAX);
    }
}
