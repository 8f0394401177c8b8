//! The receiving side of diffusion: rounds of asking the neighbors.
//!
//! One round at a time: ask all for their load, wait for every answer, ask each for its part. After
//! a round the neighbors know what is wanted here, and nobody is asked again before something has
//! come of it: work has arrived, or the neighbors are others. Who falls idle nevertheless leaves
//! word with those that do not know yet, once (a lifeline: Saraswat et al., *Lifeline-based global
//! load balancing*, 2011), and is silent.

use std::collections::{BTreeMap, BTreeSet};

use equilux_common::balancing::DiffusionStep;
use equilux_common::ids::WorkerId;
use equilux_common::message::Load;
use equilux_common::time::Time;

use crate::balance::GIFT_MIN;
use crate::balance::diffusion::{self, Vertex};
use crate::balance::marks::Marks;

/// Rounds of asking.
#[derive(Debug)]
pub(crate) struct Asking {
    step: DiffusionStep,
    marks: Marks,
    /// Answers so far, while a round is open.
    answers: Option<BTreeMap<WorkerId, Option<Vertex>>>,
    round: u32,
    may_ask: bool,
    /// Who knows that work is wanted here, and has given none since.
    told: BTreeSet<WorkerId>,
}

impl Asking {
    /// Nobody has been asked yet.
    pub(crate) fn new(step: DiffusionStep) -> Self {
        Self {
            step,
            marks: Marks::default(),
            answers: None,
            round: 0,
            may_ask: false,
            told: BTreeSet::new(),
        }
    }

    /// Something has changed for which it is worth asking (again).
    pub(crate) const fn encourage(&mut self) {
        self.may_ask = true;
    }

    /// How cycles of asking went.
    pub(crate) const fn marks(&self) -> &Marks {
        &self.marks
    }

    /// Begins a round if that may be; gives its number.
    pub(crate) fn begin(&mut self, now: Time, neighbors: &[WorkerId]) -> Option<u32> {
        if !self.may_ask || self.answers.is_some() || neighbors.is_empty() {
            return None;
        }
        self.may_ask = false;
        self.round = self.round.wrapping_add(1);
        self.answers = Some(neighbors.iter().map(|&neighbor| (neighbor, None)).collect());
        self.marks.ask(now);
        Some(self.round)
    }

    /// A neighbor answered.
    pub(crate) fn answer(&mut self, peer: WorkerId, round: u32, vertex: Vertex) {
        let is_this_round = round == self.round;
        if let Some(answer) = self.answers.as_mut().and_then(|answers| answers.get_mut(&peer))
            && is_this_round
        {
            *answer = Some(vertex);
        }
    }

    /// A neighbor gave something.
    pub(crate) fn receive(&mut self, now: Time, peer: WorkerId) {
        self.marks.receive(now);
        self.told.remove(&peer);
    }

    /// A neighbor was given something, and forgets what was wanted here.
    pub(crate) fn give(&mut self, peer: WorkerId) {
        self.told.remove(&peer);
    }

    /// A neighbor will not answer any more.
    pub(crate) fn forget(&mut self, peer: WorkerId) {
        self.told.remove(&peer);
        if let Some(answers) = &mut self.answers {
            answers.remove(&peer);
        }
    }

    /// Ends the round if all have answered: how much to ask of whom, as time of a reference
    /// thread. If that is less than `enough` in all, word is left with all others too, that they
    /// may push as much as that when they have it.
    pub(crate) fn conclude(
        &mut self,
        now: Time,
        own: Vertex,
        enough: Load,
    ) -> Vec<(WorkerId, Load)> {
        let is_complete =
            |answers: &BTreeMap<_, Option<Vertex>>| answers.values().all(Option::is_some);
        let Some(answers) = self.answers.take_if(|answers| is_complete(answers)) else {
            return Vec::new();
        };
        self.marks.answer(now);
        let (neighbors, vertices): (Vec<WorkerId>, Vec<Vertex>) =
            answers.into_iter().filter_map(|(peer, vertex)| Some((peer, vertex?))).unzip();
        let flows = diffusion::flows(self.step, own, &vertices);
        let flows = diffusion::consolidate(own, &vertices, &flows, GIFT_MIN);
        let total: Load = flows.iter().sum();
        if !total.is_zero() {
            self.marks.request(now);
        }
        let is_poor = total < enough;
        let wanted = |flow: Load| if is_poor { flow.max(enough) } else { flow };
        let amounts = neighbors.into_iter().zip(flows.into_iter().map(wanted));
        let amounts: Vec<_> = amounts.filter(|(_, amount)| !amount.is_zero()).collect();
        self.told = amounts.iter().map(|&(peer, _)| peer).collect();
        amounts
    }

    /// Who of the neighbors does not know yet that this worker is idle; from now on they do.
    pub(crate) fn leave_word(&mut self, neighbors: &[WorkerId]) -> Vec<WorkerId> {
        if !self.is_quiet() {
            return Vec::new();
        }
        neighbors.iter().copied().filter(|&neighbor| self.told.insert(neighbor)).collect()
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

    fn has(load: u64) -> Vertex {
        Vertex { load: seconds(load), capacity: 1000 }
    }

    #[test]
    fn each_is_asked_for_its_part_once_all_have_answered() {
        let mut asking = Asking::new(DiffusionStep::Explicit);
        let (now, nothing) = (Time::ZERO, has(0));
        assert_eq!(asking.begin(now, &NEIGHBORS), None, "nothing has happened yet");
        asking.encourage();
        let round = asking.begin(now, &NEIGHBORS).expect("may ask");
        asking.answer(WorkerId(4), round, has(30));
        asking.answer(WorkerId(7), round + 1, has(90));
        let requests = asking.conclude(now, nothing, seconds(1));
        assert!(requests.is_empty(), "one answer is of another round");
        asking.answer(WorkerId(7), round, nothing);
        assert_eq!(asking.conclude(now, nothing, seconds(1)), [(WorkerId(4), seconds(10))]);
        assert_eq!(asking.begin(now, &NEIGHBORS), None, "nothing has come of it yet");
        assert_eq!(asking.leave_word(&NEIGHBORS), [WorkerId(7)], "the other one knows");
        assert!(asking.leave_word(&NEIGHBORS).is_empty(), "now both do");
        asking.receive(now, WorkerId(4));
        asking.encourage();
        assert!(asking.begin(now, &NEIGHBORS).is_some());
    }

    #[test]
    fn who_comes_away_poor_leaves_word_with_all_and_is_silent() {
        let mut asking = Asking::new(DiffusionStep::Implicit);
        asking.encourage();
        let round = asking.begin(Time::ZERO, &NEIGHBORS).expect("may ask");
        assert!(asking.leave_word(&NEIGHBORS).is_empty(), "answers are awaited");
        asking.answer(WorkerId(4), round, has(0));
        asking.forget(WorkerId(7));
        let requests = asking.conclude(Time::ZERO, has(0), seconds(1));
        assert_eq!(requests, [(WorkerId(4), seconds(1))]);
        assert!(asking.is_quiet() && asking.begin(Time::ZERO, &NEIGHBORS).is_none());
        assert!(asking.leave_word(&[WorkerId(4)]).is_empty());
    }
}
