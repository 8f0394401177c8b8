//! Random numbers without state: each is a function of the job's seed and of its place in the tree
//! of a path.
//!
//! The place is (pixel, sample, branch, depth, purpose). All of it but the sample number is hashed
//! into the scramble of a four-dimensional Sobol' sequence with Owen's scrambling (Burley,
//! *Practical Hash-based Owen Scrambling*, JCGT 9(4), 2020; crate `sobol_burley`), and the sample
//! number is the position in that sequence. So the samples of a pixel are stratified for each
//! purpose, and different purposes are independent of one another. Where a hit sends out several
//! rays of a kind, sample s takes the positions s·count … s·count + count − 1: they are stratified
//! within the hit and over the samples.
//!
//! The sequence has 2¹⁶ points. The position's higher bits go into the scramble: each run of 2¹⁶ is
//! a sequence of its own.

use equilux_common::ray::Ray;
use sobol_burley::sample_4d;

/// What numbers are for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Two for the place in the pixel, two for the place on the lens.
    Camera = 0,
    /// One for the choice of the light, two for the point on it.
    Light = 1,
    /// One for the choice of the lobe, two for the direction.
    Scattering = 2,
    /// One for the choice among mirrored, refracted and straight on.
    Specular = 3,
    /// One for going on.
    Roulette = 4,
}

/// Bits of a position that the sequence takes.
const SEQUENCE_BITS: u32 = 16;

/// The child number of the specular ray at a hit that also sends out indirect ones.
const SPECULAR_CHILD: u32 = u32::MAX;

/// A place in the tree of a path, from which numbers are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    hash: u64,
    sample_index: u32,
}

impl Place {
    /// The place at which a path begins.
    #[must_use]
    pub fn of_path(seed: u64, pixel: u32, sample_index: u32) -> Self {
        Self::new(seed, pixel, sample_index, 0, 0)
    }

    /// The place that a ray is at.
    #[must_use]
    pub fn of_ray(seed: u64, ray: &Ray) -> Self {
        Self::new(seed, ray.pixel, ray.sample_index, ray.branch, ray.depth)
    }

    fn new(seed: u64, pixel: u32, sample_index: u32, branch: u32, depth: u16) -> Self {
        let hash = mix(seed);
        let hash = mix(hash ^ (u64::from(pixel) << 32 | u64::from(branch)));
        Self { hash: mix(hash ^ u64::from(depth)), sample_index }
    }

    /// The numbers, from 0 to below 1, for one thing of which there is one here.
    #[must_use]
    pub fn numbers(&self, purpose: Purpose) -> [f32; 4] {
        self.numbers_of(purpose, 0, 1)
    }

    /// The numbers, from 0 to below 1, for the `index`-th of `count` things of a kind.
    #[must_use]
    pub fn numbers_of(&self, purpose: Purpose, index: u32, count: u32) -> [f32; 4] {
        let position = u64::from(self.sample_index) * u64::from(count) + u64::from(index);
        let run = position >> SEQUENCE_BITS;
        let scramble = mix(self.hash ^ (run << 8 | purpose as u64));
        sample_4d(low(position) & ((1 << SEQUENCE_BITS) - 1), 0, high(scramble))
    }
}

/// The branch of the `index`-th of `count` indirect rays that leave a hit on `branch`.
#[must_use]
pub fn branch_of_indirect(branch: u32, index: u32, count: u32) -> u32 {
    if count == 1 { branch } else { child(branch, index + 1) }
}

/// The branch of the specular ray that leaves a hit on `branch`, alone or beside indirect rays.
#[must_use]
pub fn branch_of_specular(branch: u32, is_alone: bool) -> u32 {
    if is_alone { branch } else { child(branch, SPECULAR_CHILD) }
}

fn child(branch: u32, number: u32) -> u32 {
    high(mix(u64::from(branch) << 32 | u64::from(number)))
}

/// A bijection of 64 bits in which each bit of the input sways each of the output: SplitMix64
/// (Steele, Lea, Flood 2014; the constants are Stafford's mix 13).
const fn mix(bits: u64) -> u64 {
    let bits = bits.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}

#[expect(clippy::cast_possible_truncation, reason = "the low half is what is asked for")]
const fn low(bits: u64) -> u32 {
    bits as u32
}

const fn high(bits: u64) -> u32 {
    low(bits >> 32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mean_of_product(a: &[f32], b: &[f32]) -> f64 {
        let products = a.iter().zip(b).map(|(&a, &b)| f64::from(a - 0.5) * f64::from(b - 0.5));
        products.sum::<f64>() / a.len() as f64
    }

    #[test]
    fn the_samples_of_a_pixel_are_stratified() {
        for count in [1u32, 4] {
            let mut strata = [0; 64];
            for sample_index in 0..64 / count {
                let place = Place::of_path(3, 17, sample_index);
                for index in 0..count {
                    let [x, ..] = place.numbers_of(Purpose::Light, index, count);
                    strata[(x * 64.0) as usize] += 1;
                }
            }
            assert_eq!(strata, [1; 64], "{count} at each hit");
        }
    }

    #[test]
    fn the_things_at_one_hit_are_stratified() {
        for sample_index in 0..100 {
            let place = Place::of_path(9, 4, sample_index);
            let mut strata = [0; 16];
            for index in 0..16 {
                let [x, y, ..] = place.numbers_of(Purpose::Scattering, index, 16);
                strata[(x * 4.0) as usize * 4 + (y * 4.0) as usize] += 1;
            }
            assert_eq!(strata, [1; 16]);
        }
    }

    #[test]
    fn places_are_independent() {
        let draw = |place: &dyn Fn(u32) -> Place, purpose| -> Vec<f32> {
            (0..20_000).map(|index| place(index).numbers(purpose)[0]).collect()
        };
        let base = draw(&|index| Place::new(1, index, 0, 0, 0), Purpose::Light);
        let others = [
            draw(&|index| Place::new(1, index, 0, 0, 0), Purpose::Scattering),
            draw(&|index| Place::new(1, index, 0, 0, 1), Purpose::Light),
            draw(&|index| Place::new(1, index, 0, 1, 0), Purpose::Light),
            draw(&|index| Place::new(1, index, 1, 0, 0), Purpose::Light),
            draw(&|index| Place::new(1, index, 1 << 16, 0, 0), Purpose::Light),
            draw(&|index| Place::new(1, index + 1, 0, 0, 0), Purpose::Light),
            draw(&|index| Place::new(2, index, 0, 0, 0), Purpose::Light),
        ];
        // Of independent numbers the product has a standard deviation of 1/12/√20000 = 0.0006.
        assert!((mean_of_product(&base, &base) - 1.0 / 12.0).abs() < 0.003);
        for (number, other) in others.iter().enumerate().filter(|&(number, _)| number != 3) {
            assert!(mean_of_product(&base, other).abs() < 0.003, "place {number}");
        }
        // Two samples of one pixel are stratified: the second lies in the half the first is not in.
        let is_other_half = base.iter().zip(&others[3]).all(|(a, b)| (*a < 0.5) != (*b < 0.5));
        assert!(is_other_half);
    }

    #[test]
    fn branches_differ() {
        let mut branches: Vec<u32> =
            (0..1024).map(|index| branch_of_indirect(5, index, 1024)).collect();
        branches.push(branch_of_specular(5, false));
        branches.push(branch_of_indirect(5, 0, 1));
        assert_eq!(branches[1025], branch_of_specular(5, true));
        branches.sort_unstable();
        branches.dedup();
        assert_eq!(branches.len(), 1026);
    }

    /// The very numbers, so that a change of library or machine does not go unseen.
    #[test]
    fn numbers_never_change() {
        let numbers = Place::new(42, 1000, 70_000, 3, 2).numbers_of(Purpose::Light, 1, 4);
        assert_eq!(numbers.map(f32::to_bits), [1059939052, 1052090504, 1050140772, 1062273828]);
    }
}
