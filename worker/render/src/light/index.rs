//! From a primitive to its place among the luminaires, asked at every hit: a bit per primitive, and
//! a count per 64 of them.

const WORD_BITS: u32 = u64::BITS;

/// Which primitives are luminaires, and which in order.
#[derive(Clone, Debug)]
pub(super) struct LightIndex {
    words: Vec<Word>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Word {
    bits: u64,
    /// Luminaires before this word.
    before: u32,
}

impl LightIndex {
    /// Numbers the luminaires among `primitive_count` primitives, given in ascending order.
    pub(super) fn new(primitive_count: usize, luminaires: impl Iterator<Item = u32>) -> Self {
        let mut words = vec![Word::default(); primitive_count.div_ceil(WORD_BITS as usize)];
        for primitive in luminaires {
            words[(primitive / WORD_BITS) as usize].bits |= 1 << (primitive % WORD_BITS);
        }
        let mut before = 0;
        for word in &mut words {
            word.before = before;
            before += word.bits.count_ones();
        }
        Self { words }
    }

    /// The place of a primitive among the luminaires, if it is one.
    pub(super) fn position(&self, primitive: u32) -> Option<usize> {
        let word = self.words.get((primitive / WORD_BITS) as usize)?;
        let bit = 1_u64 << (primitive % WORD_BITS);
        let is_luminaire = word.bits & bit != 0;
        is_luminaire.then(|| (word.before + (word.bits & (bit - 1)).count_ones()) as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn it_finds_what_a_search_finds(
            luminaires in prop::collection::btree_set(0u32..300, 0..200),
        ) {
            let sorted: Vec<u32> = luminaires.into_iter().collect();
            let index = LightIndex::new(300, sorted.iter().copied());
            for primitive in (0..310).chain([u32::MAX]) {
                prop_assert_eq!(index.position(primitive), sorted.binary_search(&primitive).ok());
            }
        }
    }
}
