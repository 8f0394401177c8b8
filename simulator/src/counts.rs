//! How many messages a run took.

use equilux_common::message::{PeerMessage, ToCoordinator};
use equilux_common::work::Work;

/// Messages that were sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Steps of the run.
    pub steps: u64,
    /// Of every kind and between all, greetings included.
    pub messages: u64,
    /// Second deliveries of messages.
    pub copies: u64,
    /// Between coordinator and workers, both ways.
    pub coordinator: u64,
    /// Deliveries of credit and film values among them.
    pub delivered: u64,
    /// Reports of figures among them.
    pub reported: u64,
    /// Questions for load, and as many answers.
    pub load_asked: u64,
    /// Requests for work.
    pub work_asked: u64,
    /// Gifts, and as many acknowledgements.
    pub given: u64,
    /// Gifts of rays in the middle of their paths.
    pub rays_given: u64,
    /// Messages with rays for the homes of partitions.
    pub forwarded: u64,
    /// Rays in them.
    pub rays_forwarded: u64,
    /// Copies of partitions of other homes that workers loaded: such as were offered, and such as
    /// were made for rays behind closed windows.
    pub copies_loaded: u64,
    /// The most rays that waited with one worker at a time, in thousandths of its allowance.
    pub waiting_permille_max: u64,
    /// Pieces of work that were handed to compute threads.
    pub pieces: u64,
    /// Interrupts of compute threads.
    pub interrupts: u64,
    /// Messages between workers about a job that the coordinator knew to be over, as they were
    /// sent.
    pub late: u64,
}

impl Counts {
    /// A worker told the coordinator something.
    pub(crate) fn add_told(&mut self, message: &ToCoordinator) {
        self.coordinator += 1;
        self.delivered += u64::from(matches!(message, ToCoordinator::Delivered { .. }));
        self.reported += u64::from(matches!(message, ToCoordinator::Reported { .. }));
    }

    /// A message was sent between workers.
    pub(crate) fn add(&mut self, message: &PeerMessage, is_late: bool) {
        self.late += u64::from(is_late);
        match message {
            PeerMessage::LoadAsked { .. } => self.load_asked += 1,
            PeerMessage::WorkAsked { .. } => self.work_asked += 1,
            PeerMessage::Given { work } => {
                self.given += 1;
                self.rays_given += u64::from(matches!(work, Work::Rays(_)));
            }
            PeerMessage::Forwarded { bundles } => {
                self.forwarded += 1;
                self.rays_forwarded +=
                    bundles.iter().map(|bundle| bundle.rays.len() as u64).sum::<u64>();
            }
            PeerMessage::Load { .. }
            | PeerMessage::Acknowledged { .. }
            | PeerMessage::ForwardsAcknowledged { .. }
            | PeerMessage::Offered { .. }
            | PeerMessage::OfferTaken { .. }
            | PeerMessage::OfferRefused { .. }
            | PeerMessage::Declined => {}
        }
    }
}
