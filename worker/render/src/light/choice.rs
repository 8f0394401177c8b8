//! Choosing one of several things by their weights, so that an even spread of numbers gives an even
//! spread of choices.

/// Weights, summed up in order.
#[derive(Clone, Debug)]
pub(super) struct Choice {
    /// Sum of the weights up to and including each one.
    sums: Vec<f64>,
    /// Sum of all.
    total: f64,
}

impl Choice {
    /// Takes weights that are not negative; what is not a finite weight counts as 0.
    pub(super) fn new(weights: impl Iterator<Item = f64>) -> Self {
        let mut total = 0.0;
        let sums = weights
            .map(|weight| {
                total += if weight.is_finite() { weight.max(0.0) } else { 0.0 };
                total
            })
            .collect();
        Self { sums, total }
    }

    /// Whether there is nothing to choose.
    pub(super) const fn is_empty(&self) -> bool {
        self.total <= 0.0
    }

    /// The position that `u` (0 to below 1) falls on; one of weight 0 never.
    pub(super) fn pick(&self, u: f32) -> Option<usize> {
        let target = f64::from(u) * self.total;
        let position = self.sums.partition_point(|&sum| sum <= target);
        (position < self.sums.len()).then_some(position)
    }

    /// The probability with which a position is picked.
    pub(super) fn probability(&self, position: usize) -> f64 {
        if self.is_empty() {
            return 0.0;
        }
        let before = if position == 0 { 0.0 } else { self.sums[position - 1] };
        (self.sums[position] - before) / self.total
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn frequencies_are_the_probabilities(weights in prop::collection::vec(0u8..20, 1..20)) {
            let choice = Choice::new(weights.iter().map(|&weight| f64::from(weight)));
            prop_assume!(!choice.is_empty());
            let mut counts = vec![0u32; weights.len()];
            for step in 0u16..4096 {
                let picked = choice.pick((f32::from(step) + 0.5) / 4096.0);
                counts[picked.expect("some weight is not 0")] += 1;
            }
            for (position, &count) in counts.iter().enumerate() {
                let expected = choice.probability(position) * 4096.0;
                let error = (f64::from(count) - expected).abs();
                prop_assert!(error <= 1.0, "{position}: {count}, {expected}");
                prop_assert!(weights[position] > 0 || count == 0);
            }
        }
    }

    #[test]
    fn nothing_to_choose_is_no_choice() {
        for weights in [vec![], vec![0.0, 0.0], vec![f64::NAN, -1.0]] {
            let choice = Choice::new(weights.into_iter());
            assert!(choice.is_empty());
            assert_eq!(choice.pick(0.5), None);
        }
    }

    #[test]
    fn the_ends_belong_to_the_first_and_last_of_weight() {
        let choice = Choice::new([0.0, 1.0, 1e-12, 0.0].into_iter());
        assert_eq!(choice.pick(0.0), Some(1));
        assert_eq!(choice.pick(1.0 - f32::EPSILON / 2.0), Some(1));
        assert!((choice.probability(2) - 1e-12).abs() < 1e-15);
    }
}
