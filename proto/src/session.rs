//! What travels between a worker and its coordinator.

use std::time::Duration;

use equilux_common::bundle::Share;
use equilux_common::ids::JobId;
use equilux_common::job::JobSpec;
use equilux_common::message::{JobStart, PeerAddress, ToCoordinator, ToWorker, WorkerFigures};
use equilux_common::work::RayCounts;

use crate::balancing::InvalidBalancing;
use crate::hello::{Hello, InvalidHello, Welcome};
use crate::job::InvalidJobSpec;
use crate::limits::REASON_BYTES_MAX;
use crate::peer::nanos;
use crate::roster::{self, InvalidAddress, InvalidRoster};
use crate::share::InvalidShare;
use crate::tile::{self, InvalidTile};
use crate::units::{self, InvalidUnits};
use crate::v1::{self, coordinator_to_worker, worker_to_coordinator};

/// One message from a worker.
#[derive(Clone, Debug, PartialEq)]
pub enum FromWorker {
    /// The greeting, first of all and only then.
    Hello(Hello),
    /// Anything after it.
    Said(ToCoordinator),
}

/// One message from the coordinator.
#[derive(Clone, Debug, PartialEq)]
pub enum FromCoordinator {
    /// The greeting, first of all and only then.
    Welcome(Welcome),
    /// Anything after it.
    Said(ToWorker),
}

/// A message that no worker sends.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidFromWorker {
    /// Nothing in it.
    #[error("message: is empty or of an unknown kind")]
    Empty,
    /// A bad greeting.
    #[error("hello: {0}")]
    Hello(#[from] InvalidHello),
    /// A reason that nobody reads.
    #[error("failed.reason: has {0} bytes; at most {REASON_BYTES_MAX} are allowed")]
    Reason(usize),
    /// Values without credit.
    #[error("delivered.share: is missing")]
    NoShare,
    /// Bad credit.
    #[error("delivered.share.{0}")]
    Share(#[from] InvalidShare),
    /// Bad values.
    #[error("delivered.sums: {0}")]
    Sums(#[from] InvalidTile),
}

/// A message that no coordinator sends.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidFromCoordinator {
    /// Nothing in it.
    #[error("message: is empty or of an unknown kind")]
    Empty,
    /// A bad job.
    #[error("job_started.{0}")]
    JobStarted(#[from] InvalidJobStart),
    /// Bad neighbors.
    #[error("neighbors_changed.neighbors{0}")]
    Neighbors(InvalidRoster),
    /// Bad lives.
    #[error("neighbors_changed.gone{0}")]
    Gone(InvalidRoster),
    /// Bad homes.
    #[error("homes_changed.homes{0}")]
    Homes(InvalidRoster),
    /// Bad units.
    #[error("units{0}")]
    Units(#[from] InvalidUnits),
}

/// A job that cannot be started.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidJobStart {
    /// No job.
    #[error("spec: is missing")]
    NoSpec,
    /// A bad one.
    #[error("spec.{0}")]
    Spec(#[from] InvalidJobSpec),
    /// Among nobody.
    #[error("neighbors{0}")]
    Neighbors(#[from] InvalidRoster),
    /// At home nowhere.
    #[error("homes{0}")]
    Homes(InvalidRoster),
    /// With a pack from nobody.
    #[error("{field}.{problem}")]
    Source {
        /// For which pieces.
        field: &'static str,
        /// What is wrong.
        problem: InvalidAddress,
    },
    /// Balanced in no known way.
    #[error(transparent)]
    Balancing(#[from] InvalidBalancing),
    /// Units that the job does not have.
    #[error("units{0}")]
    Units(#[from] InvalidUnits),
}

impl From<FromWorker> for v1::WorkerToCoordinator {
    fn from(message: FromWorker) -> Self {
        use worker_to_coordinator::Message as Wire;
        let message = match message {
            FromWorker::Hello(hello) => Wire::Hello(hello.into()),
            FromWorker::Said(ToCoordinator::Ready { job }) => Wire::Ready(v1::Ready { job: job.0 }),
            FromWorker::Said(ToCoordinator::Failed { job, reason }) => {
                Wire::Failed(v1::Failed { job: job.0, reason: cut(reason) })
            }
            FromWorker::Said(ToCoordinator::Delivered { job, share, sums }) => {
                let (share, sums) = (Some(share.into()), tile::encode(&sums));
                Wire::Delivered(v1::Delivered { job: job.0, share, sums })
            }
            FromWorker::Said(ToCoordinator::Reported { job, figures }) => {
                Wire::Reported(reported(job, &figures))
            }
        };
        Self { message: Some(message) }
    }
}

impl TryFrom<v1::WorkerToCoordinator> for FromWorker {
    type Error = InvalidFromWorker;

    fn try_from(wire: v1::WorkerToCoordinator) -> Result<Self, InvalidFromWorker> {
        use worker_to_coordinator::Message as Wire;
        Ok(Self::Said(match wire.message.ok_or(InvalidFromWorker::Empty)? {
            Wire::Hello(hello) => return Ok(Self::Hello(hello.try_into()?)),
            Wire::Ready(v1::Ready { job }) => ToCoordinator::Ready { job: JobId(job) },
            Wire::Failed(v1::Failed { reason, .. }) if reason.len() > REASON_BYTES_MAX => {
                return Err(InvalidFromWorker::Reason(reason.len()));
            }
            Wire::Failed(v1::Failed { job, reason }) => {
                ToCoordinator::Failed { job: JobId(job), reason }
            }
            Wire::Delivered(v1::Delivered { job, share, sums }) => {
                let share: Share = share.ok_or(InvalidFromWorker::NoShare)?.try_into()?;
                ToCoordinator::Delivered { job: JobId(job), share, sums: tile::decode(&sums)? }
            }
            Wire::Reported(wire) => {
                ToCoordinator::Reported { job: JobId(wire.job), figures: Box::new(figures(&wire)) }
            }
        }))
    }
}

impl From<FromCoordinator> for v1::CoordinatorToWorker {
    fn from(message: FromCoordinator) -> Self {
        use coordinator_to_worker::Message as Wire;
        let message = match message {
            FromCoordinator::Welcome(welcome) => Wire::Welcome(welcome.into()),
            FromCoordinator::Said(ToWorker::JobStarted(start)) => Wire::JobStarted((*start).into()),
            FromCoordinator::Said(ToWorker::NeighborsChanged { job, neighbors, gone }) => {
                let (neighbors, gone) = (roster::to_wire(neighbors), roster::lives_to_wire(gone));
                Wire::NeighborsChanged(v1::NeighborsChanged { job: job.0, neighbors, gone })
            }
            FromCoordinator::Said(ToWorker::HomesChanged { job, homes }) => {
                let homes = homes.into_iter().map(v1::Home::from).collect();
                Wire::HomesChanged(v1::HomesChanged { job: job.0, homes })
            }
            FromCoordinator::Said(ToWorker::AttemptsRaised { job, units }) => {
                let units = units::runs(&units);
                Wire::AttemptsRaised(v1::AttemptsRaised { job: job.0, units })
            }
            FromCoordinator::Said(ToWorker::UnitsIssued { job, units }) => {
                let units = units::runs(&units);
                Wire::UnitsIssued(v1::UnitsIssued { job: job.0, units })
            }
            FromCoordinator::Said(ToWorker::JobEnded { job }) => {
                Wire::JobEnded(v1::JobEnded { job: job.0 })
            }
        };
        Self { message: Some(message) }
    }
}

impl TryFrom<v1::CoordinatorToWorker> for FromCoordinator {
    type Error = InvalidFromCoordinator;

    fn try_from(wire: v1::CoordinatorToWorker) -> Result<Self, InvalidFromCoordinator> {
        use coordinator_to_worker::Message as Wire;
        Ok(Self::Said(match wire.message.ok_or(InvalidFromCoordinator::Empty)? {
            Wire::Welcome(welcome) => return Ok(Self::Welcome(welcome.into())),
            Wire::JobStarted(start) => ToWorker::JobStarted(Box::new(start.try_into()?)),
            Wire::NeighborsChanged(v1::NeighborsChanged { job, neighbors, gone }) => {
                let neighbors = roster::from_wire(neighbors);
                let neighbors = neighbors.map_err(InvalidFromCoordinator::Neighbors)?;
                let gone = roster::lives_from_wire(&gone).map_err(InvalidFromCoordinator::Gone)?;
                ToWorker::NeighborsChanged { job: JobId(job), neighbors, gone }
            }
            Wire::HomesChanged(v1::HomesChanged { job, homes }) => {
                let homes = roster::homes_from_wire(homes);
                let homes = homes.map_err(InvalidFromCoordinator::Homes)?;
                ToWorker::HomesChanged { job: JobId(job), homes }
            }
            Wire::AttemptsRaised(v1::AttemptsRaised { job, units }) => {
                let units = units::list_of_any_job(&units)?;
                ToWorker::AttemptsRaised { job: JobId(job), units }
            }
            Wire::UnitsIssued(v1::UnitsIssued { job, units }) => {
                let units = units::list_of_any_job(&units)?;
                ToWorker::UnitsIssued { job: JobId(job), units }
            }
            Wire::JobEnded(v1::JobEnded { job }) => ToWorker::JobEnded { job: JobId(job) },
        }))
    }
}

impl From<JobStart> for v1::JobStarted {
    fn from(start: JobStart) -> Self {
        let [even, odd] = start.pack_from;
        Self {
            even_pieces_from: even.map(Into::into),
            odd_pieces_from: odd.map(Into::into),
            spec: Some(start.spec.into()),
            neighbors: roster::to_wire(start.neighbors),
            homes: start.homes.into_iter().map(v1::Home::from).collect(),
            balancing: Some(start.balancing.into()),
            units: units::runs(&start.units),
        }
    }
}

impl TryFrom<v1::JobStarted> for JobStart {
    type Error = InvalidJobStart;

    fn try_from(wire: v1::JobStarted) -> Result<Self, InvalidJobStart> {
        let spec: JobSpec = wire.spec.ok_or(InvalidJobStart::NoSpec)?.try_into()?;
        let unit_count = spec.grid().unit_count();
        let even = source("even_pieces_from", wire.even_pieces_from)?;
        let odd = source("odd_pieces_from", wire.odd_pieces_from)?;
        Ok(Self {
            pack_from: [even, odd],
            neighbors: roster::from_wire(wire.neighbors)?,
            homes: roster::homes_from_wire(wire.homes).map_err(InvalidJobStart::Homes)?,
            balancing: wire.balancing.ok_or(InvalidBalancing::Missing)?.try_into()?,
            units: units::list(&wire.units, unit_count)?,
            spec,
        })
    }
}

fn source(
    field: &'static str,
    wire: Option<v1::PeerAddress>,
) -> Result<Option<PeerAddress>, InvalidJobStart> {
    let peer = wire.map(PeerAddress::try_from).transpose();
    peer.map_err(|problem| InvalidJobStart::Source { field, problem })
}

fn reported(job: JobId, figures: &WorkerFigures) -> v1::Reported {
    let rays = figures.rays;
    v1::Reported {
        job: job.0,
        busy_nanos: nanos(figures.busy),
        idle_nanos: nanos(figures.idle),
        finish_nanos: nanos(figures.finish),
        camera_rays: rays.camera,
        indirect_rays: rays.indirect,
        specular_rays: rays.specular,
        shadow_rays: rays.shadow,
        retired_rays: rays.retired,
        bundles_in: figures.bundles_in,
        bundles_out: figures.bundles_out,
        rays_in: figures.rays_in,
        rays_out: figures.rays_out,
        forwards: figures.forwards,
        bytes_in: figures.bytes_in,
        bytes_out: figures.bytes_out,
        balance_requests: figures.balance_requests,
        partition_loads: figures.partition_loads,
        peak_rss_bytes: figures.peak_rss_bytes,
    }
}

const fn figures(wire: &v1::Reported) -> WorkerFigures {
    WorkerFigures {
        busy: Duration::from_nanos(wire.busy_nanos),
        idle: Duration::from_nanos(wire.idle_nanos),
        finish: Duration::from_nanos(wire.finish_nanos),
        rays: RayCounts {
            camera: wire.camera_rays,
            indirect: wire.indirect_rays,
            specular: wire.specular_rays,
            shadow: wire.shadow_rays,
            retired: wire.retired_rays,
        },
        bundles_in: wire.bundles_in,
        bundles_out: wire.bundles_out,
        rays_in: wire.rays_in,
        rays_out: wire.rays_out,
        forwards: wire.forwards,
        bytes_in: wire.bytes_in,
        bytes_out: wire.bytes_out,
        balance_requests: wire.balance_requests,
        partition_loads: wire.partition_loads,
        peak_rss_bytes: wire.peak_rss_bytes,
    }
}

/// A reason of at most [`REASON_BYTES_MAX`] bytes.
fn cut(mut reason: String) -> String {
    let longest = REASON_BYTES_MAX.min(reason.len());
    let end = (0..=longest).rev().find(|&end| reason.is_char_boundary(end));
    reason.truncate(end.unwrap_or(0));
    reason
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arbitrary;
    use crate::limits::SESSION_MESSAGE_BYTES_MAX;
    use proptest::prelude::*;
    use prost::Message;

    proptest! {
        #[test]
        fn messages_of_workers_round_trip_through_their_bytes(message in arbitrary::from_worker()) {
            let bytes = v1::WorkerToCoordinator::from(message.clone()).encode_to_vec();
            let wire = v1::WorkerToCoordinator::decode(&bytes[..]).expect("as encoded");
            prop_assert_eq!(FromWorker::try_from(wire), Ok(message));
        }

        #[test]
        fn messages_to_workers_round_trip_through_their_bytes(
            message in arbitrary::from_coordinator(),
        ) {
            let bytes = v1::CoordinatorToWorker::from(message.clone()).encode_to_vec();
            let wire = v1::CoordinatorToWorker::decode(&bytes[..]).expect("as encoded");
            prop_assert_eq!(FromCoordinator::try_from(wire), Ok(message));
        }

        #[test]
        fn spoilt_and_arbitrary_bytes_never_panic(
            up in arbitrary::from_worker(), down in arbitrary::from_coordinator(),
            spots in arbitrary::spots(), bytes in prop::collection::vec(any::<u8>(), 0..300),
        ) {
            let up = arbitrary::spoil(v1::WorkerToCoordinator::from(up).encode_to_vec(), &spots);
            let down = arbitrary::spoil(v1::CoordinatorToWorker::from(down).encode_to_vec(), &spots);
            for bytes in [up, down, bytes] {
                let _ = v1::WorkerToCoordinator::decode(&bytes[..]).map(FromWorker::try_from);
                let _ = v1::CoordinatorToWorker::decode(&bytes[..]).map(FromCoordinator::try_from);
            }
        }
    }

    #[test]
    fn what_is_missing_is_named() {
        let up = |message| FromWorker::try_from(v1::WorkerToCoordinator { message });
        assert_eq!(up(None), Err(InvalidFromWorker::Empty));
        let delivered = v1::Delivered { job: 1, share: None, sums: vec![] };
        let delivered = worker_to_coordinator::Message::Delivered(delivered);
        assert_eq!(up(Some(delivered)), Err(InvalidFromWorker::NoShare));
        let down = |message| FromCoordinator::try_from(v1::CoordinatorToWorker { message });
        assert_eq!(down(None), Err(InvalidFromCoordinator::Empty));
        let started = coordinator_to_worker::Message::JobStarted(v1::JobStarted::default());
        assert_eq!(down(Some(started)), Err(InvalidJobStart::NoSpec.into()));
    }

    #[test]
    fn units_beyond_the_job_are_refused() {
        let mut start = arbitrary::plain_start();
        let limit = start.spec.grid().unit_count();
        start.units.push((equilux_common::ids::UnitId(limit), Default::default()));
        let message = FromCoordinator::Said(ToWorker::JobStarted(Box::new(start)));
        let wire = v1::CoordinatorToWorker::from(message);
        let refusal = FromCoordinator::try_from(wire).expect_err("one unit too many").to_string();
        assert!(refusal.starts_with("job_started.units[0]: unit"), "{refusal}");
    }

    #[test]
    fn nobody_is_no_source_of_packs() {
        let peer = arbitrary::plain_peer();
        let mut start = v1::JobStarted::from(arbitrary::plain_start());
        start.odd_pieces_from = Some(peer.clone().into());
        let read = JobStart::try_from(start.clone()).expect("as it should be");
        assert_eq!(read.pack_from, [None, Some(peer)]);
        start.odd_pieces_from = Some(v1::PeerAddress::default());
        let refusal = JobStart::try_from(start).expect_err("nobody").to_string();
        assert!(refusal.starts_with("odd_pieces_from.address: is not"), "{refusal}");
    }

    #[test]
    fn a_long_reason_is_cut_between_letters() {
        let reason = "ä".repeat(REASON_BYTES_MAX);
        let message = FromWorker::Said(ToCoordinator::Failed { job: JobId(1), reason });
        let wire = v1::WorkerToCoordinator::from(message);
        assert!(FromWorker::try_from(wire).is_ok());
    }

    #[test]
    fn the_largest_tile_fits_a_message() {
        let sums = arbitrary::largest_tile();
        assert!(2 * tile::encode(&sums).len() < SESSION_MESSAGE_BYTES_MAX);
    }
}
