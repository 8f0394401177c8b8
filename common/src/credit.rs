//! Credit: exact shares of a unit's wholeness, by which termination is known without asking.
//!
//! A unit starts with credit 1. Whenever its rays part, the credit parts with them; whenever rays
//! end, their credit goes home. The unit is complete when its credit is 1 again, and not before
//! (Mattern, *Global quiescence detection based on credit distribution and recovery*, 1989).
//!
//! Shares are dyadic fractions of any length, so a share can always be split and nothing is ever
//! rounded.

use std::fmt;

use smallvec::SmallVec;

const WORD_BITS: usize = 64;

/// Most words that a credit may have on the wire. A share of 2⁻⁸¹⁹² has been halved more often
/// than any unit has rays in flight.
pub const CREDIT_WORDS_MAX: usize = 128;

/// A dyadic fraction from 0 to 1, exact.
///
/// Bit 63 of the first word weighs 1, the next bit ½, and so on; trailing zero words are dropped.
#[derive(Clone, Default, PartialEq, Eq, Hash)]
pub struct Credit {
    words: Words,
}

/// Nearly all shares have one word or two: those need no memory of their own.
type Words = SmallVec<[u64; 2]>;

/// More credit came together than there is: somebody counted a share twice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("credit exceeds the whole")]
pub struct CreditOverflow;

/// More credit was taken away than was there: somebody gave a share that was not theirs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("credit falls below nothing")]
pub struct CreditUnderflow;

/// Bytes that are no credit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidCredit {
    /// Longer than [`CREDIT_WORDS_MAX`].
    #[error("credit has {0} words; at most {CREDIT_WORDS_MAX} are allowed")]
    TooLong(usize),
    /// More than the whole.
    #[error("credit exceeds the whole")]
    TooMuch,
    /// Not in the shortest form.
    #[error("credit ends in a zero word")]
    NotShortest,
}

impl Credit {
    /// No credit.
    #[must_use]
    pub const fn zero() -> Self {
        Self { words: Words::new_const() }
    }

    /// All of a unit's credit.
    #[must_use]
    pub fn whole() -> Self {
        Self { words: Words::from_slice(&[1 << (WORD_BITS - 1)]) }
    }

    /// Whether this is all of a unit's credit.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.words[..] == [1 << (WORD_BITS - 1)]
    }

    /// Whether this is none.
    #[must_use]
    pub fn is_zero(&self) -> bool {
        self.words.is_empty()
    }

    /// Gives a share away and keeps the rest; both are more than zero. `parts` is how many shares
    /// (the kept one included) the caller expects to make of this credit in all: the more, the
    /// smaller each share, so that the length grows with the logarithm of their number.
    ///
    /// # Panics
    /// If there is no credit to split: only a bug can ask for that.
    #[must_use]
    pub fn split(&mut self, parts: usize) -> Self {
        let highest = self.highest_bit().expect("a share that is split holds credit");
        let halvings = usize::max(1, parts.next_power_of_two().trailing_zeros() as usize);
        let share = Self::power(highest + halvings);
        self.subtract(&share);
        share
    }

    /// Adds a share to this one.
    ///
    /// # Errors
    /// If the sum exceeds the whole; `self` is then unchanged.
    pub fn merge(&mut self, other: &Self) -> Result<(), CreditOverflow> {
        let mut sum = Words::from_slice(&self.words);
        sum.resize(usize::max(self.words.len(), other.words.len()), 0);
        let mut carry = false;
        for (index, word) in sum.iter_mut().enumerate().rev() {
            let addend = other.words.get(index).copied().unwrap_or(0);
            let (partial, first) = word.overflowing_add(addend);
            let (total, second) = partial.overflowing_add(u64::from(carry));
            *word = total;
            carry = first || second;
        }
        let merged = Self::from_trimmed(sum);
        if carry || merged.exceeds_whole() {
            return Err(CreditOverflow);
        }
        *self = merged;
        Ok(())
    }

    /// Takes away a share that was merged before.
    ///
    /// # Errors
    /// If `other` is more than there is; `self` is then unchanged.
    pub fn withdraw(&mut self, other: &Self) -> Result<(), CreditUnderflow> {
        // Trailing zero words are dropped, so the order of the words is that of the fractions.
        if other.words > self.words {
            return Err(CreditUnderflow);
        }
        self.subtract(other);
        Ok(())
    }

    /// The words of the fraction, most significant first: the form of the wire.
    #[must_use]
    pub fn words(&self) -> &[u64] {
        &self.words
    }

    /// Takes the form of the wire.
    ///
    /// # Errors
    /// If the words are no credit.
    pub fn from_words(words: &[u64]) -> Result<Self, InvalidCredit> {
        if words.len() > CREDIT_WORDS_MAX {
            return Err(InvalidCredit::TooLong(words.len()));
        }
        if words.last() == Some(&0) {
            return Err(InvalidCredit::NotShortest);
        }
        let credit = Self { words: Words::from_slice(words) };
        if credit.exceeds_whole() { Err(InvalidCredit::TooMuch) } else { Ok(credit) }
    }

    fn from_trimmed(words: Words) -> Self {
        let mut credit = Self { words };
        credit.trim();
        credit
    }

    fn exceeds_whole(&self) -> bool {
        let top = self.words.first().copied().unwrap_or(0);
        top > 1 << (WORD_BITS - 1) || (top == 1 << (WORD_BITS - 1) && self.words.len() > 1)
    }

    /// Position of the highest bit set, counted from the one that weighs 1.
    fn highest_bit(&self) -> Option<usize> {
        let index = self.words.iter().position(|&word| word != 0)?;
        Some(index * WORD_BITS + self.words[index].leading_zeros() as usize)
    }

    /// 2 to the power of minus `position`.
    fn power(position: usize) -> Self {
        let mut words = Words::from_elem(0, position / WORD_BITS + 1);
        words[position / WORD_BITS] = mask(position);
        Self { words }
    }

    /// Takes away `other`, which is at most `self`.
    fn subtract(&mut self, other: &Self) {
        self.words.resize(usize::max(self.words.len(), other.words.len()), 0);
        let mut borrow = false;
        for (index, word) in self.words.iter_mut().enumerate().rev() {
            let subtrahend = other.words.get(index).copied().unwrap_or(0);
            let (partial, first) = word.overflowing_sub(subtrahend);
            let (difference, second) = partial.overflowing_sub(u64::from(borrow));
            *word = difference;
            borrow = first || second;
        }
        assert!(!borrow, "a share is smaller than what it is taken from");
        self.trim();
    }

    fn trim(&mut self) {
        while self.words.last() == Some(&0) {
            self.words.pop();
        }
    }
}

const fn mask(position: usize) -> u64 {
    1 << (WORD_BITS - 1 - position % WORD_BITS)
}

impl fmt::Debug for Credit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let bits: Vec<String> = (0..self.words.len() * WORD_BITS)
            .filter(|&position| self.words[position / WORD_BITS] & mask(position) != 0)
            .map(|position| format!("2^-{position}"))
            .collect();
        write!(f, "Credit({})", if bits.is_empty() { "0".into() } else { bits.join(" + ") })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn any_splitting_and_merging_is_whole_at_the_end_and_never_before(
            steps in prop::collection::vec(
                (any::<prop::sample::Index>(), 1usize..70, any::<bool>()),
                0..300,
            )
        ) {
            let mut shares = vec![Credit::whole()];
            for (choice, parts, merges) in steps {
                let index = choice.index(shares.len());
                if merges && shares.len() > 1 {
                    let share = shares.swap_remove(index);
                    let target = index % shares.len();
                    shares[target].merge(&share).expect("shares of one unit");
                } else {
                    let given = shares[index].split(parts);
                    prop_assert!(!given.is_zero() && !shares[index].is_zero());
                    shares.push(given);
                }
            }
            let mut home = Credit::zero();
            for (index, share) in shares.iter().enumerate() {
                prop_assert!(!home.is_whole(), "whole before share {index} came home");
                home.merge(share).expect("shares of one unit");
            }
            prop_assert!(home.is_whole());
            for share in &shares {
                home.withdraw(share).expect("what came home");
            }
            prop_assert!(home.is_zero());
            prop_assert_eq!(home.withdraw(&shares[0]), Err(CreditUnderflow));
        }

        #[test]
        fn words_round_trip_and_arbitrary_words_never_panic(
            words in prop::collection::vec(any::<u64>(), 0..6)
        ) {
            if let Ok(credit) = Credit::from_words(&words) {
                prop_assert_eq!(credit.words(), &words[..]);
            }
        }
    }

    #[test]
    fn a_fan_of_shares_stays_short() {
        let mut kept = Credit::whole();
        for _ in 0..1000 {
            let share = kept.split(1024);
            assert_eq!(share.words().len(), 1);
        }
        assert_eq!(kept.words().len(), 1);
    }

    #[test]
    fn more_than_the_whole_is_refused() {
        let mut credit = Credit::whole();
        let share = credit.split(2);
        credit.merge(&share).expect("the two halves");
        assert_eq!(credit.merge(&share), Err(CreditOverflow));
        assert!(credit.is_whole());
    }
}
