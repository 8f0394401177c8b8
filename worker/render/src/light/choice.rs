//! Choosing one of several things by their weights, so that an even spread of numbers gives an even
//! spread of choices.

/// For so many weights there is an entry of the guide.
const WEIGHTS_PER_ENTRY: usize = 4;

/// Weights, summed up in order, and a guide to them: the cutpoint method (Chen & Asau, *On
/// Generating Random Variates from an Empirical Distribution*, AIIE Transactions 6(2), 1974).
#[derive(Clone, Debug)]
pub(super) struct Choice {
    /// Sum of the weights up to and including each one.
    sums: Vec<f64>,
    /// Sum of all.
    total: f64,
    /// Which positions 0, 1/n, 2/n, … and 1 fall on, where n is a power of two: so n times a number
    /// is exact, and what falls between two entries is picked between their positions.
    guide: Vec<u32>,
}

impl Choice {
    /// Takes weights that are not negative; what is not a finite weight counts as 0.
    pub(super) fn new(weights: impl Iterator<Item = f64>) -> Self {
        let mut total = 0.0;
        let sums: Vec<f64> = weights
            .map(|weight| {
                total += if weight.is_finite() { weight.max(0.0) } else { 0.0 };
                total
            })
            .collect();
        let steps = (sums.len() / WEIGHTS_PER_ENTRY).next_power_of_two();
        let position = |step: usize| {
            let target = step as f64 / steps as f64 * total;
            let position = sums.partition_point(|&sum| sum <= target);
            u32::try_from(position).expect("fewer than 2³² weights")
        };
        let guide = (0..=steps).map(position).collect();
        Self { sums, total, guide }
    }

    /// Whether there is nothing to choose.
    pub(super) const fn is_empty(&self) -> bool {
        self.total <= 0.0
    }

    /// The position that `u` (0 to below 1) falls on; one of weight 0 never.
    pub(super) fn pick(&self, u: f32) -> Option<usize> {
        let target = f64::from(u) * self.total;
        let steps = self.guide.len() - 1;
        let step = ((f64::from(u) * steps as f64) as usize).min(steps - 1);
        let [first, last] = [self.guide[step] as usize, self.guide[step + 1] as usize];
        let position = first + self.sums[first..last].partition_point(|&sum| sum <= target);
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

    proptest! {
        #[test]
        fn the_guide_leads_where_a_search_does(
            weights in prop::collection::vec(prop_oneof![Just(0.0), 0f64..1e-9, 0f64..1.0], 1..200),
            numbers in prop::collection::vec(0u32..1 << 24, 100),
        ) {
            let choice = Choice::new(weights.iter().copied());
            prop_assume!(!choice.is_empty());
            for number in numbers {
                let u = number as f32 / 16_777_216.0;
                let target = f64::from(u) * choice.total;
                let expected = choice.sums.partition_point(|&sum| sum <= target);
                prop_assert_eq!(choice.pick(u), Some(expected));
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
