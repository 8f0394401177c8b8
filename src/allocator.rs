//! How the C library's allocator gives memory back.
//!
//! Partitions of a model come and go, tens of megabytes at a time, and memory must stay within a
//! budget. glibc takes large blocks from the system and gives them back as a whole; but whenever
//! one is given back, it raises the size from which blocks count as large, up to 32 MiB. Blocks
//! below it come from a heap that fragments: rendering a city of 10⁸ triangles within 1 GiB took
//! 1.35 GiB, and 1.00 GiB with the size fixed.

/// From this size on, blocks are the system's: far below the tables of a partition, and far above
/// what is allocated often.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const LARGE_BLOCK_BYTES: libc::c_int = 1 << 20;

/// Fixes the size from which blocks are given back as a whole. To be called before there are
/// threads.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[expect(unsafe_code, reason = "a call into the C library, with nothing but numbers")]
pub(crate) fn give_back_large_blocks() {
    // SAFETY: mallopt takes two numbers, refuses those that it does not know, and no other thread
    // is there yet to allocate meanwhile.
    let is_set = unsafe { libc::mallopt(libc::M_MMAP_THRESHOLD, LARGE_BLOCK_BYTES) };
    debug_assert_eq!(is_set, 1, "glibc knows this setting");
}

/// Other allocators give memory back as they see fit.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(crate) const fn give_back_large_blocks() {}
