//! Mail: a message between two ends, as the network carries it.

use equilux_common::bundle::Share;
use equilux_common::credit::Credit;
use equilux_common::ids::{Attempt, Incarnation, JobId, UnitId, WorkerId};
use equilux_common::message::{PeerMessage, ToCoordinator, ToWorker};

use crate::delivery::Delivery;
use crate::network::End;
use crate::wire;

/// To start a job, the coordinator's core looks up a worker's neighbors and deals out its units for
/// it: 0.9 µs (`cargo bench --bench cores`), where others take 0.4 or less.
const START_TOIL: u32 = 3;

/// A message on its way.
#[derive(Clone, Debug)]
pub(crate) struct Mail {
    pub(crate) from: End,
    pub(crate) to: End,
    /// Size of the message in the form of the wire.
    pub(crate) bytes: u64,
    /// Whether it has been delivered once before.
    pub(crate) is_copy: bool,
    pub(crate) content: Content,
}

/// What is said.
#[derive(Clone, Debug)]
pub(crate) enum Content {
    /// A host wants to take part.
    Knock,
    /// The coordinator lets a host in.
    Admit { worker: WorkerId, incarnation: Incarnation },
    /// A host's connection is found closed.
    HangUp,
    /// A worker hands over what it has gathered.
    Deliver(Box<Delivery>),
    /// A worker says something else to the coordinator.
    ToCoordinator(ToCoordinator),
    /// The coordinator speaks to a worker.
    ToWorker(ToWorker),
    /// A worker speaks to another.
    ToPeer { job: JobId, message: PeerMessage },
}

impl Content {
    /// What a worker tells the coordinator.
    pub(crate) fn told(message: ToCoordinator) -> Self {
        match message {
            ToCoordinator::Delivered { job, share, sums } => {
                Self::Deliver(Box::new(Delivery::new(job, share, &sums)))
            }
            other => Self::ToCoordinator(other),
        }
    }

    /// How many ordinary messages' time its sender's core takes for it.
    pub(crate) const fn toil(&self) -> u32 {
        match self {
            Self::ToWorker(ToWorker::JobStarted(_)) => START_TOIL,
            _ => 1,
        }
    }

    /// Size in the form of the wire; `pixel_bytes` is that of a touched pixel.
    pub(crate) fn bytes(&self, pixel_bytes: f64) -> u64 {
        match self {
            Self::Knock | Self::Admit { .. } => wire::GREETING_BYTES,
            Self::HangUp => 0,
            Self::Deliver(delivery) => {
                let touched = delivery.touched_count();
                wire::delivered_bytes(delivery.job, &delivery.share, touched, pixel_bytes)
            }
            Self::ToCoordinator(message) => wire::to_coordinator_bytes(message),
            Self::ToWorker(message) => wire::to_worker_bytes(message),
            Self::ToPeer { job, message } => wire::peer_bytes(*job, message),
        }
    }
}

impl Mail {
    /// Whether the receiver must bear that the same is delivered twice, the second time at any
    /// later moment. Credit is work: who gets it twice has too much, unless its attempt is over
    /// (`is_stale`). An acknowledgement opens the window each time, a refusal sends the asker on
    /// to the next, and neighbors and homes hold until they change again: these rely on the order
    /// of their link.
    pub(crate) fn may_come_twice(&self, is_stale: impl Fn(&Share) -> bool) -> bool {
        match &self.content {
            Content::ToPeer { message, .. } => matches!(
                message,
                PeerMessage::LoadAsked { .. }
                    | PeerMessage::Load { .. }
                    | PeerMessage::WorkAsked { .. }
            ),
            Content::Deliver(delivery) => is_stale(&delivery.share),
            Content::ToCoordinator(_) => true,
            Content::ToWorker(message) => !matches!(
                message,
                ToWorker::UnitsIssued { .. }
                    | ToWorker::NeighborsChanged { .. }
                    | ToWorker::HomesChanged { .. }
            ),
            Content::Knock | Content::Admit { .. } | Content::HangUp => false,
        }
    }

    /// Shows the credit of a job that is in this message; there is none in a copy.
    pub(crate) fn for_each_share(
        &self,
        id: JobId,
        visit: &mut dyn FnMut(UnitId, Attempt, &Credit),
    ) {
        if self.is_copy {
            return;
        }
        match &self.content {
            Content::ToPeer { job, message } if *job == id => {
                message.for_each_share(|share| show(share, visit));
            }
            Content::Deliver(delivery) if delivery.job == id => show(&delivery.share, visit),
            Content::ToWorker(ToWorker::JobStarted(start)) if start.spec.id == id => {
                show_whole(&start.units, visit);
            }
            Content::ToWorker(ToWorker::UnitsIssued { job, units }) if *job == id => {
                show_whole(units, visit);
            }
            _ => {}
        }
    }
}

fn show(share: &Share, visit: &mut dyn FnMut(UnitId, Attempt, &Credit)) {
    visit(share.unit, share.attempt, &share.credit);
}

fn show_whole(units: &[(UnitId, Attempt)], visit: &mut dyn FnMut(UnitId, Attempt, &Credit)) {
    let whole = Credit::whole();
    for &(unit, attempt) in units {
        visit(unit, attempt, &whole);
    }
}
