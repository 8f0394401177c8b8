//! Tables of plain entries, wherever their memory comes from.
//!
//! A model that is built has its tables in lists of their own. A partition that is read has all of
//! them in one block, which whoever reads it takes from the system as suits it best.

use std::fmt;
use std::marker::PhantomData;
use std::ops::{Deref, Range};

use bytemuck::Pod;
use bytes::Bytes;

/// Entries that are there to be read. Clones share them.
#[derive(Clone)]
pub(super) struct Table<T> {
    /// Aligned to entries, of which it holds whole ones.
    bytes: Bytes,
    entries: PhantomData<T>,
}

impl<T: Pod> Table<T> {
    /// The table whose memory this is; none if it does not hold whole entries or lies askew.
    pub(super) fn in_bytes(bytes: Bytes) -> Option<Self> {
        let is_table = bytes.is_empty() || bytemuck::try_cast_slice::<u8, T>(&bytes).is_ok();
        is_table.then_some(Self { bytes, entries: PhantomData })
    }

    /// Some of its entries; they must be there.
    pub(super) fn slice(&self, entries: Range<usize>) -> Self {
        let size = size_of::<T>();
        let bytes = self.bytes.slice(entries.start * size..entries.end * size);
        Self { bytes, entries: PhantomData }
    }

    /// Its memory.
    pub(super) fn as_bytes(&self) -> &[u8] {
        &self.bytes
    }
}

impl<T: Pod> Default for Table<T> {
    fn default() -> Self {
        Self { bytes: Bytes::new(), entries: PhantomData }
    }
}

impl<T: Pod + Send + Sync> From<Vec<T>> for Table<T> {
    fn from(list: Vec<T>) -> Self {
        Self { bytes: Bytes::from_owner(List(list)), entries: PhantomData }
    }
}

impl<T: Pod> Deref for Table<T> {
    type Target = [T];

    #[inline]
    fn deref(&self) -> &[T] {
        // The memory of an empty one may lie anywhere.
        if self.bytes.is_empty() { &[] } else { bytemuck::cast_slice(&self.bytes) }
    }
}

impl<T: Pod + fmt::Debug> fmt::Debug for Table<T> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_list().entries(self.iter()).finish()
    }
}

/// A list as the owner of its bytes.
struct List<T>(Vec<T>);

impl<T: Pod> AsRef<[u8]> for List<T> {
    fn as_ref(&self) -> &[u8] {
        bytemuck::cast_slice(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_and_its_bytes_are_the_same_table() {
        let table = Table::from(vec![[1u32, 2], [3, 4], [5, 6]]);
        assert_eq!(*table, [[1, 2], [3, 4], [5, 6]]);
        let whole = Bytes::from_owner(List(vec![9u32, 3, 4, 5, 6]));
        let rest = Table::<[u32; 2]>::in_bytes(whole.slice(4..)).expect("two entries");
        assert_eq!(*rest, table[1..]);
        assert_eq!(rest.as_bytes(), &whole[4..]);
    }

    #[test]
    fn what_holds_no_whole_entries_or_lies_askew_is_no_table() {
        let bytes = Bytes::from_owner(List(vec![0u32; 4]));
        assert!(Table::<[u32; 3]>::in_bytes(bytes.clone()).is_none());
        assert!(Table::<u32>::in_bytes(bytes.slice(1..5)).is_none());
        let empty = Table::<[u32; 3]>::in_bytes(bytes.slice(5..5)).expect("no entries");
        assert!(empty.is_empty());
    }
}
