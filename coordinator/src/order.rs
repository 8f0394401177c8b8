//! A job as it is ordered: what the driver takes in, checked by whoever made it.

use std::sync::Arc;

use equilux_common::balancing::Balancing;
use equilux_common::job::Settings;
use equilux_common::scene::camera::Camera;
use equilux_common::scene::files::Pack;
use equilux_common::topology::Topology;

use crate::attachments::Attachments;

/// Longest name of a job in bytes.
pub const NAME_BYTES_MAX: usize = 200;

/// Most jobs that wait for their turn.
pub const JOBS_QUEUED_MAX: usize = 64;

/// Most bytes of packs held for jobs that have not ended; queued jobs keep theirs in memory.
pub const PACKS_BYTES_MAX: u64 = 8 << 30;

/// A job to be rendered.
#[derive(Clone, Debug)]
pub struct Order {
    /// The scene's files.
    pub pack: Arc<Pack>,
    /// Files beside them, which workers fetch when they need them.
    pub attachments: Attachments,
    /// The scene file among them.
    pub entry: String,
    /// What the camera is called in the scene, if it was chosen by name.
    pub camera_name: Option<String>,
    /// The camera.
    pub camera: Camera,
    /// How to render.
    pub settings: Settings,
    /// How work is spread.
    pub balancing: Balancing,
    /// Who exchanges work with whom.
    pub topology: Topology,
    /// Do not start with fewer workers than this; at least 1.
    pub workers_min: u32,
    /// What people call the job.
    pub name: String,
    /// What the readers of the scene had to say.
    pub warnings: Vec<String>,
}

/// A job that is not taken.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SubmitError {
    /// A setting is out of its limits.
    #[error(transparent)]
    Settings(#[from] equilux_common::job::InvalidSettings),
    /// The name is too long.
    #[error("name: {bytes} bytes are more than {NAME_BYTES_MAX}; choose a shorter name")]
    NameTooLong {
        /// Its length.
        bytes: usize,
    },
    /// A job needs somebody to render it.
    #[error("workers_min: 0 workers cannot render; give 1 or more")]
    NoWorkers,
    /// Too many jobs wait already.
    #[error("{JOBS_QUEUED_MAX} jobs wait already; submit again when one has ended")]
    QueueFull,
    /// The scenes of the waiting jobs take too much memory.
    #[error(
        "the scenes of waiting jobs take {PACKS_BYTES_MAX} bytes; submit again when one has ended"
    )]
    PacksFull,
    /// The coordinator is going down.
    #[error("the coordinator is stopping; submit again when it is back")]
    Stopping,
}

impl Order {
    /// Makes sure that everything is within its limits.
    ///
    /// # Errors
    /// Names the first thing that is not.
    pub fn check(&self) -> Result<(), SubmitError> {
        self.settings.check()?;
        if self.name.len() > NAME_BYTES_MAX {
            return Err(SubmitError::NameTooLong { bytes: self.name.len() });
        }
        if self.workers_min == 0 { Err(SubmitError::NoWorkers) } else { Ok(()) }
    }
}
