//! The disorder of a lived-in room: numbers that look random and are the same for ever.
//!
//! A generator is named by a place (which shelf, which desk), so that a change in one piece of
//! furniture leaves all others as they were.

/// A stream of pseudo-random numbers (`SplitMix64`: Steele, Lea and Flood 2014).
#[derive(Clone, Debug)]
pub(crate) struct Random {
    state: u64,
}

impl Random {
    /// The stream of a kind of thing (`salt`) and which one of them it is.
    pub(crate) fn new(salt: u64, index: u64) -> Self {
        Self { state: mix(mix(salt).wrapping_add(index)) }
    }

    fn next(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        mix(self.state)
    }

    /// Evenly in [0, 1).
    pub(crate) fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Evenly between two numbers.
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Whether something happens that does with this probability.
    pub(crate) fn happens(&mut self, probability: f64) -> bool {
        self.unit() < probability
    }

    /// One of a list that is not empty.
    pub(crate) fn pick<'a, T>(&mut self, choices: &'a [T]) -> &'a T {
        assert!(!choices.is_empty(), "nothing to pick from");
        &choices[(self.next() % choices.len() as u64) as usize]
    }
}

/// A bijection of 64 bits in which every input bit sways every output bit.
fn mix(bits: u64) -> u64 {
    let bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    bits ^ (bits >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stay_in_range_and_spread() {
        let mut random = Random::new(1, 2);
        let drawn: Vec<f64> = (0..4000).map(|_| random.between(2.0, 4.0)).collect();
        assert!(drawn.iter().all(|x| (2.0..4.0).contains(x)));
        let mean = drawn.iter().sum::<f64>() / 4000.0;
        assert!((mean - 3.0).abs() < 0.05, "{mean}");
    }

    #[test]
    fn places_have_streams_of_their_own() {
        assert_ne!(Random::new(1, 2).next(), Random::new(1, 3).next());
        assert_ne!(Random::new(1, 2).next(), Random::new(2, 2).next());
    }
}
