//! Weights of samples that could have been drawn in two ways.

/// The power heuristic with exponent 2 (Veach, *Robust Monte Carlo Methods for Light Transport
/// Simulation*, 1997, section 9.2.3): the weight of a sample drawn in one way with density
/// `this`, where it could have been drawn with density `other` in the other way. Each density is
/// per solid angle and times the number of samples drawn that way; `this` is above 0.
pub(super) fn power(this: f32, other: f32) -> f32 {
    let ratio = other / this;
    1.0 / (1.0 + ratio * ratio)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_two_weights_of_a_sample_add_up_to_one() {
        for (a, b) in [(1.0, 1.0), (0.5, 3.0), (1e-20, 1e20), (7.0, 0.0)] {
            let other = if b > 0.0 { power(b, a) } else { 0.0 };
            assert!((power(a, b) + other - 1.0).abs() < 1e-6);
        }
    }
}
