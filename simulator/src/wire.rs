//! Sizes of messages in the form of the wire, estimated: the simulator writes no bytes. The layouts
//! are those of `docs/wire.md` and of protobuf; a test of the whole program holds these sizes
//! against what is really written.

use std::time::Duration;

use equilux_common::bundle::Share;
use equilux_common::ids::{Attempt, Incarnation, JobId, UnitId, WorkerId};
use equilux_common::message::{
    Home, JobStart, PeerAddress, PeerMessage, ToCoordinator, ToWorker, WorkerFigures,
};
use equilux_common::work::{Samples, Work};

/// A greeting of either side.
pub(crate) const GREETING_BYTES: u64 = 70;

/// What one Ethernet frame carries of a stream, and what is around it: preamble, gap, headers of
/// Ethernet, IP and TCP with time stamps.
const FRAME_PAYLOAD_BYTES: u64 = 1448;
const FRAME_OVERHEAD_BYTES: u64 = 90;

/// Around a message in its stream: the headers of gRPC and of an HTTP/2 frame.
const STREAM_OVERHEAD_BYTES: u64 = 14;

/// A job without its entry's name: scene, camera, settings and granularity.
const SPEC_BYTES: u64 = 160;

/// Bytes around the pixels of film values: version, tile, counters, runs.
const TILE_BYTES: u64 = 16;

/// Bytes that a message of so many bytes takes on a line.
#[must_use]
pub fn line_bytes(bytes: u64) -> u64 {
    let streamed = bytes + STREAM_OVERHEAD_BYTES;
    streamed + streamed.div_ceil(FRAME_PAYLOAD_BYTES) * FRAME_OVERHEAD_BYTES
}

/// Credit that comes home with the film values of so many touched pixels, of `pixel_bytes` each.
#[must_use]
pub fn delivered_bytes(job: JobId, part: &Share, touched: usize, pixel_bytes: f64) -> u64 {
    let sums = TILE_BYTES + (touched as f64 * pixel_bytes).round() as u64;
    nested(number(job.0) + nested(share(part)) + nested(sums))
}

/// Any other message to the coordinator.
#[must_use]
pub fn to_coordinator_bytes(message: &ToCoordinator) -> u64 {
    nested(match message {
        ToCoordinator::Ready { job } => number(job.0),
        ToCoordinator::Failed { job, reason } => number(job.0) + nested(reason.len() as u64),
        ToCoordinator::Delivered { job, share, .. } => return delivered_bytes(*job, share, 0, 0.0),
        ToCoordinator::Reported { job, figures: part } => number(job.0) + figures(part),
    })
}

/// A message to a worker.
#[must_use]
pub fn to_worker_bytes(message: &ToWorker) -> u64 {
    nested(match message {
        ToWorker::JobStarted(start) => job_start(start),
        ToWorker::NeighborsChanged { job, neighbors, gone } => {
            let life =
                |life: &(WorkerId, Incarnation)| nested(number(life.0.0.into()) + number(life.1.0));
            number(job.0) + addresses(neighbors) + gone.iter().map(life).sum::<u64>()
        }
        ToWorker::HomesChanged { job, homes } => number(job.0) + homes_bytes(homes),
        ToWorker::AttemptsRaised { job, units } | ToWorker::UnitsIssued { job, units } => {
            number(job.0) + runs(units)
        }
        ToWorker::JobEnded { job } => number(job.0),
    })
}

/// A message between workers.
#[must_use]
pub fn peer_bytes(job: JobId, message: &PeerMessage) -> u64 {
    let said = match message {
        PeerMessage::LoadAsked { round } => number((*round).into()),
        PeerMessage::Load { round, load, capacity } => {
            number((*round).into()) + nanos(*load) + number(*capacity)
        }
        PeerMessage::WorkAsked { amount } => nanos(*amount),
        PeerMessage::Given { work: Work::Samples(part) } => nested(samples(part)),
        PeerMessage::Given { work: Work::Rays(part) } => nested(part.wire_bytes()),
        PeerMessage::Declined => 0,
        PeerMessage::Offered { partition, load } => number(partition.0.into()) + nanos(*load),
        PeerMessage::OfferTaken { partition } | PeerMessage::OfferRefused { partition } => {
            number(partition.0.into())
        }
        PeerMessage::Acknowledged { count } | PeerMessage::ForwardsAcknowledged { count } => {
            number((*count).into())
        }
        PeerMessage::Forwarded { bundles } => {
            bundles.iter().map(|bundle| nested(bundle.wire_bytes())).sum()
        }
    };
    nested(number(job.0) + nested(said))
}

fn job_start(start: &JobStart) -> u64 {
    let spec = SPEC_BYTES + start.spec.scene.entry.len() as u64;
    let choices = 8;
    let sources = start.pack_from.iter().map(|peer| addresses(peer.as_slice())).sum::<u64>();
    let peers = addresses(&start.neighbors) + homes_bytes(&start.homes);
    nested(spec) + peers + choices + sources + runs(&start.units)
}

fn homes_bytes(homes: &[Home]) -> u64 {
    let home = |home: &Home| {
        let memory = home.memory.map_or(0, number);
        let flags = 2 * (u64::from(home.is_late) + u64::from(home.is_lost));
        nested(addresses(std::slice::from_ref(&home.peer)) + memory + flags)
    };
    homes.iter().map(home).sum()
}

fn addresses(peers: &[PeerAddress]) -> u64 {
    let address = |peer: &PeerAddress| {
        let lives = number(peer.worker.0.into()) + number(peer.incarnation.0);
        nested(lives + nested(peer.address.len() as u64))
    };
    peers.iter().map(address).sum()
}

fn runs(units: &[(UnitId, Attempt)]) -> u64 {
    let follows = |a: &(UnitId, Attempt), b: &(UnitId, Attempt)| a.0.0 + 1 == b.0.0 && a.1 == b.1;
    let run = |run: &[(UnitId, Attempt)]| {
        let (first, attempt) = (run[0].0.0, run[0].1.0);
        nested(number(first.into()) + number(run.len() as u64) + number(attempt.into()))
    };
    units.chunk_by(follows).map(run).sum()
}

fn share(share: &Share) -> u64 {
    let words = share.credit.words().len() as u64;
    number(share.unit.0.into()) + number(share.attempt.0.into()) + nested(8 * words)
}

fn samples(samples: &Samples) -> u64 {
    let range = number(samples.first_path.into()) + number(samples.path_count.into());
    nested(share(&samples.share)) + range
}

fn figures(figures: &WorkerFigures) -> u64 {
    let rays = figures.rays;
    let times = [figures.busy, figures.idle, figures.finish].map(nanos);
    let small = [rays.camera, rays.indirect, rays.specular, rays.shadow, rays.retired];
    let moved = [figures.bundles_in, figures.bundles_out, figures.rays_in, figures.rays_out];
    let rest = [figures.bytes_in, figures.bytes_out, figures.balance_requests];
    let last = [figures.partition_loads, figures.peak_rss_bytes, figures.forwards];
    let numbers = small.iter().chain(&moved).chain(&rest).chain(&last);
    times.iter().sum::<u64>() + numbers.map(|&figure| number(figure)).sum::<u64>()
}

fn nanos(duration: Duration) -> u64 {
    number(u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX))
}

/// A field that holds a number: nothing if it is 0.
const fn number(value: u64) -> u64 {
    if value == 0 { 0 } else { 1 + varint(value) }
}

/// A field that holds so many bytes.
const fn nested(bytes: u64) -> u64 {
    1 + varint(bytes) + bytes
}

/// A number in groups of 7 bits.
const fn varint(value: u64) -> u64 {
    let bits = u64::BITS - value.leading_zeros();
    if bits == 0 { 1 } else { (bits as u64).div_ceil(7) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_take_groups_of_seven_bits() {
        assert_eq!([0, 1, 127, 128, u64::MAX].map(varint), [1, 1, 1, 2, 10]);
        assert_eq!((number(0), number(300), nested(0), nested(200)), (0, 3, 2, 203));
    }

    #[test]
    fn a_long_message_takes_many_frames() {
        assert_eq!(line_bytes(10), 10 + 14 + 90);
        assert_eq!(line_bytes(14_466), 14_480 + 10 * 90);
    }
}
