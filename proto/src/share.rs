//! Shares of credit and ranges of samples.

use equilux_common::bundle::Share;
use equilux_common::credit::{Credit, InvalidCredit};
use equilux_common::ids::{Attempt, UnitId};
use equilux_common::work::Samples;

use crate::v1;

/// A share that holds nothing or makes no sense.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidShare {
    /// The credit is none.
    #[error("credit: {0}")]
    Credit(#[from] InvalidCredit),
    /// Work without credit would be lost without anybody noticing.
    #[error("credit: is zero")]
    NoCredit,
}

/// Samples that cannot be started.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidSamples {
    /// No share.
    #[error("share: is missing")]
    NoShare,
    /// A bad one.
    #[error("share.{0}")]
    Share(#[from] InvalidShare),
    /// No paths, or more than can be numbered.
    #[error(
        "path_count: {count} paths from path {first} on cannot be numbered in 32 bits, or none"
    )]
    Range {
        /// The first path.
        first: u32,
        /// How many.
        count: u32,
    },
}

/// Checks credit that travels.
pub(crate) fn credit(words: &[u64]) -> Result<Credit, InvalidShare> {
    let credit = Credit::from_words(words)?;
    if credit.is_zero() { Err(InvalidShare::NoCredit) } else { Ok(credit) }
}

impl From<Share> for v1::Share {
    fn from(share: Share) -> Self {
        Self { unit: share.unit.0, attempt: share.attempt.0, credit: share.credit.words().to_vec() }
    }
}

impl TryFrom<v1::Share> for Share {
    type Error = InvalidShare;

    fn try_from(wire: v1::Share) -> Result<Self, InvalidShare> {
        let credit = credit(&wire.credit)?;
        Ok(Self { unit: UnitId(wire.unit), attempt: Attempt(wire.attempt), credit })
    }
}

impl From<Samples> for v1::Samples {
    fn from(samples: Samples) -> Self {
        Self {
            share: Some(samples.share.into()),
            first_path: samples.first_path,
            path_count: samples.path_count,
        }
    }
}

impl TryFrom<v1::Samples> for Samples {
    type Error = InvalidSamples;

    fn try_from(wire: v1::Samples) -> Result<Self, InvalidSamples> {
        let (first, count) = (wire.first_path, wire.path_count);
        if count == 0 || first.checked_add(count).is_none() {
            return Err(InvalidSamples::Range { first, count });
        }
        let share = wire.share.ok_or(InvalidSamples::NoShare)?.try_into()?;
        Ok(Self { share, first_path: first, path_count: count })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arbitrary;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn samples_round_trip(samples in arbitrary::samples()) {
            let wire = v1::Samples::from(samples.clone());
            prop_assert_eq!(Samples::try_from(wire), Ok(samples));
        }
    }

    #[test]
    fn zero_credit_and_empty_ranges_are_refused() {
        let share = v1::Share { unit: 0, attempt: 0, credit: vec![] };
        assert_eq!(Share::try_from(share.clone()), Err(InvalidShare::NoCredit));
        let samples = v1::Samples { share: Some(share.clone()), first_path: 1, path_count: 1 };
        assert_eq!(Samples::try_from(samples), Err(InvalidShare::NoCredit.into()));
        let samples = v1::Samples { share: Some(share), first_path: u32::MAX, path_count: 1 };
        assert!(matches!(Samples::try_from(samples), Err(InvalidSamples::Range { .. })));
        let long = v1::Share { unit: 0, attempt: 0, credit: vec![1; 129] };
        assert_eq!(Share::try_from(long), Err(InvalidCredit::TooLong(129).into()));
    }
}
