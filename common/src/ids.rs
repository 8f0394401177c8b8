//! Names of things that cross a boundary. Each is a type of its own, so that a unit cannot be taken
//! for a worker.

use std::fmt;

macro_rules! id {
    ($(#[$doc:meta])* $name:ident($inner:ty), $prefix:literal) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name(pub $inner);

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, concat!($prefix, "{}"), self.0)
            }
        }
    };
}

id!(
    /// A job, numbered by its coordinator from 1 in the order of submission; never reused.
    JobId(u64), "job "
);
id!(
    /// A worker's place in the cluster. It outlives a restart of the worker's process.
    WorkerId(u32), "worker "
);
id!(
    /// The how-many-th life of a worker. What an older one still sends is refused.
    Incarnation(u64), "incarnation "
);
id!(
    /// A unit of a job: its position in the order of [`crate::unit::UnitGrid`].
    UnitId(u32), "unit "
);
id!(
    /// The how-many-th try at a unit, from 0. Results of an older attempt are dropped.
    Attempt(u32), "attempt "
);
id!(
    /// A part of the model. A replicated model is the one partition 0.
    PartitionId(u32), "partition "
);
