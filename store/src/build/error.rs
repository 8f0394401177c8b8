//! What can keep a store from being built.

use std::io;
use std::path::{Path, PathBuf};

use equilux_common::scene::error::SceneError;
use equilux_render::geometry::{COORDINATE_MAX, TRIANGLES_MAX};

/// A store that cannot be built. Nothing is left of it, and what was there before still is.
#[derive(Debug, thiserror::Error)]
pub enum BuildError {
    /// The scene cannot be read.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The scene's second reading differs from the first.
    #[error("the scene changed while it was read; leave its files alone and build again")]
    Changed,
    /// More triangles than ids.
    #[error("the scene has {0} triangles at all places, more than ids can name; leave some out")]
    TooManyPlaced(u64),
    /// More than are kept.
    #[error("the scene has more than {TRIANGLES_MAX} triangles; leave some out")]
    TooManyTriangles,
    /// A coordinate beyond what can be computed with.
    #[error(
        "triangle {primitive} has a coordinate that is no number within ±{COORDINATE_MAX}; \
         scale the model down or leave the triangle out"
    )]
    OutOfRange {
        /// The triangle's primitive id.
        primitive: u64,
    },
    /// A triangle of a material that is not in the tables.
    #[error("triangle {primitive} has material {material}, and there are only {count}")]
    NoMaterial {
        /// The triangle's primitive id.
        primitive: u32,
        /// Its material.
        material: u32,
        /// How many there are.
        count: usize,
    },
    /// Something that is no store is where the store should be.
    #[error(
        "{path}: is there, and is no store or has more in it; remove it or name another directory"
    )]
    Occupied {
        /// What is there.
        path: PathBuf,
    },
    /// The operating system does not take a file.
    #[error("{path}: cannot be written: {cause}; {remedy}")]
    Unwritable {
        /// The file or directory.
        path: PathBuf,
        /// Why.
        cause: io::Error,
        /// What to do.
        remedy: &'static str,
    },
    /// A spool file, which was written a moment ago, cannot be read.
    #[error("{path}: cannot be read again: {cause}; build again, or name another --spool")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: io::Error,
    },
    /// Whoever asked for it does not want it any more.
    #[error("interrupted; nothing was built")]
    Interrupted,
}

impl BuildError {
    pub(super) fn unwritable(path: &Path, cause: io::Error) -> Self {
        let remedy = match cause.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
                "free some space there, or name another place by -o and --spool"
            }
            io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
                "name a place that you may write to, by -o and --spool"
            }
            io::ErrorKind::NotFound => "make the directory first",
            _ => "name another place by -o and --spool",
        };
        Self::Unwritable { path: path.to_owned(), cause, remedy }
    }

    pub(super) fn unreadable(path: &Path, cause: io::Error) -> Self {
        Self::Unreadable { path: path.to_owned(), cause }
    }
}
