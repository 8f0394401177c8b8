//! What waits to happen at some later time of a run.

use equilux_common::credit::Credit;
use equilux_common::ids::{Attempt, JobId, PartitionId, UnitId};
use equilux_coordinator_core::event::JobOrder;

use crate::mail::Mail;
use crate::network::End;

/// Something that will happen. Hosts are named by their position among all that ever were.
#[derive(Debug)]
pub(crate) enum Happening {
    /// A machine's worker comes or dies.
    Turn { machine: usize },
    /// A machine computes at another speed from now on.
    Change { machine: usize, speed: u32 },
    /// A job is submitted.
    Submit(Box<JobOrder>),
    /// A job is cancelled.
    Cancel(JobId),
    /// The first byte of a message reaches its receiver's link.
    Reaches(Box<Mail>),
    /// A message is in its receiver's hands.
    Arrives(Box<Mail>),
    /// A link stands.
    Linked { at: usize, peer: usize },
    /// A link is found gone.
    Unlinked { at: usize, peer: usize },
    /// A scene is loaded.
    Loaded { at: usize, job: JobId },
    /// A partition is loaded.
    PartitionLoaded { at: usize, job: JobId, partition: PartitionId },
    /// A compute thread is done, unless its piece's end has changed since.
    Traced { at: usize, thread: usize },
    /// A core's deadline.
    Wake { end: End },
}

impl Happening {
    /// The message that is on its way here.
    pub(crate) const fn mail(&self) -> Option<&Mail> {
        match self {
            Self::Reaches(mail) | Self::Arrives(mail) => Some(mail),
            _ => None,
        }
    }

    /// Shows the credit of a job that is on its way in this message.
    pub(crate) fn for_each_share(
        &self,
        job: JobId,
        visit: &mut dyn FnMut(UnitId, Attempt, &Credit),
    ) {
        if let Some(mail) = self.mail() {
            mail.for_each_share(job, visit);
        }
    }
}
