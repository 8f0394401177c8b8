//! Messages that came too early: about a job that has not started here, or from a peer to whom no
//! link stands yet, so that it could not be answered.

use std::collections::{BTreeMap, VecDeque};

use equilux_common::bundle::Share;
use equilux_common::ids::{Incarnation, JobId, WorkerId};
use equilux_common::message::PeerMessage;

use crate::balance::WINDOW_GIFTS;

/// Most letters kept of one peer: a window of gifts, and a few questions and requests. What is
/// dropped beyond is nobody's work, for gifts do not exceed their window; a question may be, and
/// is asked again in the next round.
const LETTERS_PER_PEER_MAX: usize = WINDOW_GIFTS as usize + 16;

/// A message together with all that is known of it.
#[derive(Clone, Debug)]
pub(crate) struct Letter {
    pub(crate) peer: WorkerId,
    pub(crate) incarnation: Incarnation,
    pub(crate) job: JobId,
    pub(crate) message: PeerMessage,
    pub(crate) bytes: u64,
}

/// Letters that wait, in the order of their arrival per peer.
#[derive(Debug, Default)]
pub(crate) struct Early {
    letters: BTreeMap<WorkerId, VecDeque<Letter>>,
}

impl Early {
    /// Keeps a letter, unless its sender has sent too many. Letters of its earlier lives go.
    pub(crate) fn keep(&mut self, letter: Letter) {
        let letters = self.letters.entry(letter.peer).or_default();
        letters.retain(|earlier| earlier.incarnation >= letter.incarnation);
        if letters.len() < LETTERS_PER_PEER_MAX {
            letters.push_back(letter);
        }
    }

    /// Takes out all letters: those that are still too early will be kept again.
    pub(crate) fn take_all(&mut self) -> impl Iterator<Item = Letter> + use<> {
        std::mem::take(&mut self.letters).into_values().flatten()
    }

    /// Drops the letters about a job that is over, and about all before it.
    pub(crate) fn forget_job(&mut self, job: JobId) {
        for letters in self.letters.values_mut() {
            letters.retain(|letter| letter.job > job);
        }
        self.letters.retain(|_, letters| !letters.is_empty());
    }

    /// Shows the shares of credit that wait here, of one job.
    pub(crate) fn for_each_share(&self, job: JobId, mut visit: impl FnMut(&Share)) {
        for letter in self.letters.values().flatten().filter(|letter| letter.job == job) {
            if let PeerMessage::Given { work } = &letter.message {
                work.shares().iter().for_each(&mut visit);
            }
        }
    }

    /// Whether nothing waits.
    pub(crate) fn is_empty(&self) -> bool {
        self.letters.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn letter(peer: u32, job: u64) -> Letter {
        Letter {
            peer: WorkerId(peer),
            incarnation: Incarnation(0),
            job: JobId(job),
            message: PeerMessage::LoadAsked { round: 1 },
            bytes: 8,
        }
    }

    #[test]
    fn one_peer_cannot_fill_the_memory_nor_crowd_out_others() {
        let mut early = Early::default();
        for _ in 0..10 * LETTERS_PER_PEER_MAX {
            early.keep(letter(1, 2));
        }
        early.keep(letter(2, 1));
        assert_eq!(early.take_all().count(), LETTERS_PER_PEER_MAX + 1);
        early.keep(letter(1, 2));
        early.keep(letter(1, 3));
        early.forget_job(JobId(2));
        assert_eq!(early.take_all().map(|letter| letter.job).collect::<Vec<_>>(), [JobId(3)]);
    }
}
