//! What makes a job fail here, although the scene is good: somebody broke the protocol.
//!
//! Only a bug or a broken link can cause any of this. The job fails with a message instead of
//! waiting forever for credit that cannot become whole.

use equilux_common::ids::{PartitionId, UnitId, WorkerId};

/// Why the job cannot go on.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Violation {
    #[error("{0} does not exist in this job; all programs must be of one version")]
    UnknownUnit(UnitId),
    #[error(
        "paths {first} to {end} were given of {unit}, which has {path_count}; \
         all programs must be of one version"
    )]
    UnknownPaths { unit: UnitId, first: u32, end: u64, path_count: u32 },
    #[error("rays came for {0}, and there are {1} partitions; all programs must be of one version")]
    UnknownPartition(PartitionId, usize),
    #[error("more credit was given for {0} than there is; all programs must be of one version")]
    TooMuchCredit(UnitId),
    #[error(
        "the largest partition of this model takes {largest} bytes, which is too much for the \
         memory that this worker may use; give it at least `--memory {least}`, or build the store \
         with a smaller `--partition-size`"
    )]
    TooLittleMemory { largest: u64, least: u64 },
    #[error(
        "the link to {0} broke while work was on its way there; check the network, submit again"
    )]
    LinkBroken(WorkerId),
    #[error(
        "there is no link to {0}, which is home to a part of the model; make sure that all workers \
         reach one another (`--advertise`), submit again"
    )]
    Unreachable(WorkerId),
}
