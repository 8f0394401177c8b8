//! Memory that a partition is read into: one block from the system, which goes back as a whole.
//!
//! Half of what reading a partition took was the system clearing memory page by page and entering
//! each into its tables. It does so five hundred times less often with large pages. They also make
//! rays faster: the walk through a tree jumps all over its memory, and a large page takes one place
//! in the processor's table of pages where five hundred small ones do not fit.

use std::io;

use memmap2::MmapMut;

/// Memory on a page boundary.
pub(crate) struct Block(MmapMut);

impl Block {
    /// A block of so many bytes, all zero.
    pub(crate) fn new(bytes: usize) -> io::Result<Self> {
        // The system has no empty blocks.
        let map = MmapMut::map_anon(bytes.max(1))?;
        #[cfg(target_os = "linux")]
        // Where the system has no large pages, small ones do as well.
        let _ = map.advise(memmap2::Advice::HugePage);
        Ok(Self(map))
    }
}

impl AsRef<[u8]> for Block {
    fn as_ref(&self) -> &[u8] {
        &self.0
    }
}

impl AsMut<[u8]> for Block {
    fn as_mut(&mut self) -> &mut [u8] {
        &mut self.0
    }
}
