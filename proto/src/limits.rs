//! The limits of the wire, each with its reason. A message that exceeds one is refused.

use std::time::Duration;

/// Most bytes of a message between coordinator and worker, set on both ends in both directions.
/// The largest legal one is a list of units broken into runs by faults: 16 MiB hold a million runs.
pub const SESSION_MESSAGE_BYTES_MAX: usize = 16 << 20;

/// Most bytes of a frame between peers. The largest bundle (255 shares of the longest credit, 64
/// rays) has 261 KiB.
pub const PEER_FRAME_BYTES_MAX: usize = 512 << 10;

/// Largest pack: a worker holds it in memory while it reads the scene.
pub const PACK_BYTES_MAX: u64 = 64 << 30;

/// Most pixels of a tile, so that no message can ask for much memory: 64 × 64.
pub const TILE_PIXELS_MAX: usize = 1 << 12;

/// Largest side of a unit's tile, which is square where the image does not cut it.
pub const TILE_SIDE_PIXELS_MAX: u32 = 64;

/// Most units of a job: what the largest image gives at the usual granularity.
pub const UNITS_MAX: u32 = 1 << 26;

/// Most tiles that a job's space-filling curve puts in order; more take too long to visit. The
/// largest image has fewer at the usual granularity, however long and narrow it is.
pub const CURVE_CELLS_MAX: u64 = 1 << 24;

/// Most workers of a job.
pub const ROSTER_WORKERS_MAX: usize = 1 << 16;

/// Most entries of a list of counts by depth: no path is deeper.
pub const PER_DEPTH_MAX: usize = equilux_common::job::DEPTH_MAX as usize;

/// Most bytes of a worker's name; a UUID has 36.
pub const NAME_BYTES_MAX: usize = 128;

/// Most bytes of an address: a host name of 253 and a port.
pub const ADDRESS_BYTES_MAX: usize = 262;

/// Most bytes of a path in a pack.
pub const ENTRY_BYTES_MAX: usize = 4096;

/// Most bytes of a program's version.
pub const VERSION_BYTES_MAX: usize = 128;

/// Most bytes of a reason; longer ones are cut by the sender.
pub const REASON_BYTES_MAX: usize = 16 << 10;

/// Most compute threads that a worker may claim.
pub const THREADS_MAX: u32 = 1 << 16;

/// How long a connection may be silent before it is probed, on both ends. A dead machine, which
/// closes nothing, is noticed after this and [`KEEPALIVE_TIMEOUT`].
pub const KEEPALIVE_INTERVAL: Duration = Duration::from_secs(5);

/// How long the answer to a probe may take. Long enough for a machine that is busy tracing.
pub const KEEPALIVE_TIMEOUT: Duration = Duration::from_secs(15);

/// How long it may take to open a connection, greeting included.
pub const GREETING_TIMEOUT: Duration = Duration::from_secs(10);
