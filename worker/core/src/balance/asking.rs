//! The receiving side of balancing: rounds of asking the neighbors.
//!
//! One round at a time: ask all for their load, wait for every answer, ask each for its part. After
//! a round the neighbors know what is wanted here, and nobody is asked again before something has
//! come of it: work has arrived, or the neighbors are others. So who comes away empty is silent.

use std::collections::BTreeMap;

use equilux_common::ids::WorkerId;
use equilux_common::message::Load;

use crate::balance::diffusion;

/// Rounds of asking.
#[derive(Debug, Default)]
pub(crate) struct Asking {
    /// Answers so far, while a round is open.
    answers: Option<BTreeMap<WorkerId, Option<Load>>>,
    round: u32,
    may_ask: bool,
}

impl Asking {
    /// Something has changed for which it is worth asking (again).
    pub(crate) const fn encourage(&mut self) {
        self.may_ask = true;
    }

    /// Begins a round if that may be; gives its number.
    pub(crate) fn begin(&mut self, neighbors: &[WorkerId]) -> Option<u32> {
        if !self.may_ask || self.answers.is_some() || neighbors.is_empty() {
            return None;
        }
        self.may_ask = false;
        self.round = self.round.wrapping_add(1);
        self.answers = Some(neighbors.iter().map(|&neighbor| (neighbor, None)).collect());
        Some(self.round)
    }

    /// A neighbor answered.
    pub(crate) fn answer(&mut self, peer: WorkerId, round: u32, load: Load) {
        let is_this_round = round == self.round;
        if let Some(answer) = self.answers.as_mut().and_then(|answers| answers.get_mut(&peer))
            && is_this_round
        {
            *answer = Some(load);
        }
    }

    /// A neighbor will not answer any more.
    pub(crate) fn forget(&mut self, peer: WorkerId) {
        if let Some(answers) = &mut self.answers {
            answers.remove(&peer);
        }
    }

    /// Ends the round if all have answered: how much to ask of whom, as time of this worker's
    /// queue. If what should flow is less than `enough`, word is left with all others too, that
    /// they may push as much as that when they have it.
    pub(crate) fn conclude(&mut self, own: Load, enough: Load) -> Vec<(WorkerId, Load)> {
        let is_complete =
            |answers: &BTreeMap<_, Option<Load>>| answers.values().all(Option::is_some);
        if !self.answers.as_ref().is_some_and(is_complete) {
            return Vec::new();
        }
        let answers = self.answers.take().unwrap_or_default();
        let loads: Vec<Load> = answers.values().map(|answer| answer.unwrap_or_default()).collect();
        let flows = diffusion::flows(own, &loads);
        let is_poor = own.saturating_add(flows.iter().sum()) < enough;
        let wanted = |flow: Load| if is_poor { flow.max(enough) } else { flow };
        let amounts = flows.into_iter().map(wanted);
        answers.into_keys().zip(amounts).filter(|(_, amount)| !amount.is_zero()).collect()
    }

    /// Whether no answer is awaited.
    pub(crate) const fn is_quiet(&self) -> bool {
        self.answers.is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NEIGHBORS: [WorkerId; 2] = [WorkerId(4), WorkerId(7)];

    fn seconds(seconds: u64) -> Load {
        Load::from_secs(seconds)
    }

    #[test]
    fn each_is_asked_for_its_part_once_all_have_answered() {
        let mut asking = Asking::default();
        assert_eq!(asking.begin(&NEIGHBORS), None, "nothing has happened yet");
        asking.encourage();
        let round = asking.begin(&NEIGHBORS).expect("may ask");
        asking.answer(WorkerId(4), round, seconds(30));
        asking.answer(WorkerId(7), round + 1, seconds(90));
        assert!(
            asking.conclude(Load::ZERO, seconds(1)).is_empty(),
            "one answer is of another round"
        );
        asking.answer(WorkerId(7), round, Load::ZERO);
        assert_eq!(asking.conclude(Load::ZERO, seconds(1)), [(WorkerId(4), seconds(10))]);
        assert_eq!(asking.begin(&NEIGHBORS), None, "nothing has come of it yet");
    }

    #[test]
    fn who_comes_away_poor_leaves_word_with_all_and_is_silent() {
        let mut asking = Asking::default();
        asking.encourage();
        let round = asking.begin(&NEIGHBORS).expect("may ask");
        asking.answer(WorkerId(4), round, Load::ZERO);
        asking.forget(WorkerId(7));
        assert_eq!(asking.conclude(Load::ZERO, seconds(1)), [(WorkerId(4), seconds(1))]);
        assert!(asking.is_quiet() && asking.begin(&NEIGHBORS).is_none());
    }
}
