//! The partitions that are in memory.

use std::sync::Arc;

use equilux_common::ids::PartitionId;

use super::Partition;

/// Which partitions of a model are in memory, and they themselves. Clones share them.
#[derive(Clone, Debug)]
pub struct PartitionSet(Arc<[Option<Arc<Partition>>]>);

impl PartitionSet {
    /// Those that are there, by their numbers.
    #[must_use]
    pub fn new(partitions: Vec<Option<Arc<Partition>>>) -> Self {
        Self(partitions.into())
    }

    /// A whole model in one partition.
    #[must_use]
    pub fn whole(partition: Partition) -> Self {
        Self::new(vec![Some(Arc::new(partition))])
    }

    /// A partition, if it is in memory.
    #[must_use]
    #[inline]
    pub fn get(&self, PartitionId(partition): PartitionId) -> Option<&Partition> {
        self.0.get(partition as usize)?.as_deref()
    }

    /// Bytes of memory that they take.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.0.iter().flatten().map(|partition| partition.bytes()).sum()
    }
}
