//! How work is spread.

use equilux_common::balancing::{Balance, Balancing, DiffusionStep, Exchange, GiveFirst, Mapping};

use crate::v1;

/// Numbers that name no way to spread work.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidBalancing {
    /// Nothing is said.
    #[error("balancing: is missing")]
    Missing,
    /// No way to balance.
    #[error("balancing.balance: {0} is unknown")]
    Balance(i32),
    /// No form of the step.
    #[error("balancing.step: {0} is unknown")]
    Step(i32),
    /// Nothing to give.
    #[error("balancing.give_first: {0} is unknown")]
    GiveFirst(i32),
    /// Neither with exchange nor without.
    #[error("balancing.exchange: {0} is unknown")]
    Exchange(i32),
    /// No way to give homes.
    #[error("balancing.mapping: {0} is unknown")]
    Mapping(i32),
}

impl From<Balancing> for v1::Balancing {
    fn from(balancing: Balancing) -> Self {
        let balance = match balancing.balance {
            Balance::Diffusion => v1::Balance::Diffusion,
            Balance::Stealing => v1::Balance::Stealing,
            Balance::None => v1::Balance::None,
        };
        let step = match balancing.step {
            DiffusionStep::Explicit => v1::DiffusionStep::Explicit,
            DiffusionStep::Implicit => v1::DiffusionStep::Implicit,
        };
        let give_first = match balancing.give_first {
            GiveFirst::Samples => v1::GiveFirst::Samples,
            GiveFirst::Rays => v1::GiveFirst::Rays,
        };
        let exchange = match balancing.exchange {
            Exchange::On => v1::Exchange::On,
            Exchange::Off => v1::Exchange::Off,
        };
        let mapping = match balancing.mapping {
            Mapping::Bisection => v1::Mapping::Bisection,
            Mapping::Diffusion => v1::Mapping::Diffusion,
        };
        Self {
            balance: balance.into(),
            step: step.into(),
            give_first: give_first.into(),
            exchange: exchange.into(),
            mapping: mapping.into(),
        }
    }
}

impl TryFrom<v1::Balancing> for Balancing {
    type Error = InvalidBalancing;

    fn try_from(wire: v1::Balancing) -> Result<Self, InvalidBalancing> {
        let balance = match wire.balance() {
            v1::Balance::Diffusion => Balance::Diffusion,
            v1::Balance::Stealing => Balance::Stealing,
            v1::Balance::None => Balance::None,
            v1::Balance::Unspecified => return Err(InvalidBalancing::Balance(wire.balance)),
        };
        let step = match wire.step() {
            v1::DiffusionStep::Explicit => DiffusionStep::Explicit,
            v1::DiffusionStep::Implicit => DiffusionStep::Implicit,
            v1::DiffusionStep::Unspecified => return Err(InvalidBalancing::Step(wire.step)),
        };
        let give_first = match wire.give_first() {
            v1::GiveFirst::Samples => GiveFirst::Samples,
            v1::GiveFirst::Rays => GiveFirst::Rays,
            v1::GiveFirst::Unspecified => {
                return Err(InvalidBalancing::GiveFirst(wire.give_first));
            }
        };
        let exchange = match wire.exchange() {
            v1::Exchange::On => Exchange::On,
            v1::Exchange::Off => Exchange::Off,
            v1::Exchange::Unspecified => return Err(InvalidBalancing::Exchange(wire.exchange)),
        };
        let mapping = match wire.mapping() {
            v1::Mapping::Bisection => Mapping::Bisection,
            v1::Mapping::Diffusion => Mapping::Diffusion,
            v1::Mapping::Unspecified => return Err(InvalidBalancing::Mapping(wire.mapping)),
        };
        Ok(Self { balance, step, give_first, exchange, mapping })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arbitrary;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn balancing_round_trips(balancing in arbitrary::balancing()) {
            prop_assert_eq!(v1::Balancing::from(balancing).try_into(), Ok(balancing));
        }
    }

    #[test]
    fn what_has_no_name_is_refused() {
        let refused = |spoil: fn(&mut v1::Balancing)| {
            let mut wire = v1::Balancing::from(Balancing::default());
            spoil(&mut wire);
            Balancing::try_from(wire).expect_err("no such number")
        };
        assert_eq!(refused(|wire| wire.balance = 9), InvalidBalancing::Balance(9));
        assert_eq!(refused(|wire| wire.step = 0), InvalidBalancing::Step(0));
        assert_eq!(refused(|wire| wire.give_first = -1), InvalidBalancing::GiveFirst(-1));
        assert_eq!(refused(|wire| wire.exchange = 3), InvalidBalancing::Exchange(3));
        assert_eq!(refused(|wire| wire.mapping = 0), InvalidBalancing::Mapping(0));
    }
}
