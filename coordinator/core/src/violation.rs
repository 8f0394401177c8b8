//! What no worker that keeps to the protocol sends. Who does is expelled, and its work is redone.

use equilux_common::ids::{Attempt, UnitId};

/// What was wrong with a delivery.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Violation {
    #[error("delivered {0}, which does not exist in this job")]
    UnknownUnit(UnitId),
    #[error("delivered {1} of {0}, which nobody has been asked for")]
    UnknownAttempt(UnitId, Attempt),
    #[error("delivered film values for {0} that do not fit its tile")]
    WrongTile(UnitId),
    #[error("delivered more credit of {0} than there is")]
    TooMuchCredit(UnitId),
}
