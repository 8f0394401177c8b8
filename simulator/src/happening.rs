//! What waits to happen at some later time of a run.

use equilux_common::bundle::Share;
use equilux_common::credit::Credit;
use equilux_common::ids::{Attempt, Incarnation, JobId, UnitId, WorkerId};
use equilux_common::message::{PeerMessage, ToCoordinator, ToWorker};
use equilux_coordinator_core::event::JobOrder;

use crate::network::End;

/// Something that will happen. Hosts are named by their position among all that ever were.
#[derive(Debug)]
pub(crate) enum Happening {
    /// A machine's worker comes or dies.
    Turn { machine: usize },
    /// A job is submitted.
    Submit(Box<JobOrder>),
    /// A job is cancelled.
    Cancel(JobId),
    /// A host reaches the coordinator.
    Knock { host: usize },
    /// The coordinator lets a host in.
    Admit { host: usize, worker: WorkerId, incarnation: Incarnation },
    /// The coordinator finds a host gone.
    HangUp { host: usize },
    /// A message reaches the coordinator.
    ToCoordinator { from: usize, message: ToCoordinator },
    /// A message of the coordinator reaches a host.
    ToWorker { to: usize, message: ToWorker },
    /// A message reaches a peer.
    ToPeer { from: usize, to: usize, job: JobId, message: PeerMessage },
    /// A link stands.
    Linked { at: usize, peer: usize },
    /// A link is found gone.
    Unlinked { at: usize, peer: usize },
    /// A scene is loaded.
    Loaded { at: usize, job: JobId },
    /// A compute thread is done; void if it was interrupted meanwhile.
    Traced { at: usize, thread: usize, generation: u64 },
    /// A core's deadline.
    Wake { end: End },
}

impl Happening {
    /// Shows the credit of a job that is on its way in this message.
    pub(crate) fn for_each_share(
        &self,
        id: JobId,
        visit: &mut dyn FnMut(UnitId, Attempt, &Credit),
    ) {
        match self {
            Self::ToPeer { job, message: PeerMessage::Given { work }, .. } if *job == id => {
                work.shares().iter().for_each(|share| show(share, visit));
            }
            Self::ToCoordinator {
                message: ToCoordinator::Delivered { job, share, .. }, ..
            } if *job == id => {
                show(share, visit);
            }
            Self::ToWorker { message: ToWorker::JobStarted(start), .. } if start.spec.id == id => {
                show_whole(&start.units, visit);
            }
            Self::ToWorker { message: ToWorker::UnitsIssued { job, units }, .. } if *job == id => {
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
