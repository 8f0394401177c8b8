//! Messages that came too early: about a job that has not started here, from a peer to whom no link
//! stands yet, so that it could not be answered, or with work of an attempt that has not been heard
//! of.

use std::collections::{BTreeMap, VecDeque};

use equilux_common::bundle::Share;
use equilux_common::ids::{Incarnation, JobId, WorkerId};
use equilux_common::message::PeerMessage;

use crate::balance::WINDOW_GIFTS;
use crate::forwarding::WINDOW_FORWARDS;

/// Most letters kept of one peer: a window of gifts, one of forwards, and a few questions and
/// requests. What is dropped beyond is nobody's work, for neither exceeds its window; a question
/// may be, and is asked again in the next round.
const LETTERS_PER_PEER_MAX: usize = WINDOW_GIFTS as usize + WINDOW_FORWARDS + 16;

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
    /// Keeps a letter, unless its sender has sent too many. Letters of its earlier lives go, and
    /// those about earlier jobs: they are over, or nobody would speak about this one.
    pub(crate) fn keep(&mut self, letter: Letter) {
        let letters = self.letters.entry(letter.peer).or_default();
        letters.retain(|earlier| {
            earlier.incarnation >= letter.incarnation && earlier.job >= letter.job
        });
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
            letter.message.for_each_share(&mut visit);
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
