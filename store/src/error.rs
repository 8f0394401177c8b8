//! What can be wrong with a store: always a file, what is wrong with it, and what to do.

use std::io;
use std::path::Path;

use equilux_common::scene::files::ReadError;
use equilux_render::geometry::InvalidPartition;

/// A store, or a file of one, that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// A file that is not there or cannot be read.
    #[error(transparent)]
    Unreadable(#[from] ReadError),
    /// Reading failed halfway.
    #[error("{file}: cannot be read: {cause}")]
    Failed {
        /// The file.
        file: String,
        /// Why.
        cause: io::Error,
    },
    /// Written by another version of this program.
    #[error(
        "{file}: is of version {found} of the format, and this program reads version {known}; \
         build the store again"
    )]
    OtherVersion {
        /// The file.
        file: String,
        /// Its version.
        found: u32,
        /// Ours.
        known: u32,
    },
    /// Something else under the name of a store's file.
    #[error("{file}: is not {kind}; name the directory of a store, or build it again")]
    Foreign {
        /// The file.
        file: String,
        /// What it should be.
        kind: &'static str,
    },
    /// Longer or shorter than it was written.
    #[error("{file}: has {found} bytes instead of {expected}; copy it again or rebuild the store")]
    WrongLength {
        /// The file.
        file: String,
        /// Its length.
        found: u64,
        /// Its length when it was written.
        expected: u64,
    },
    /// Not the bytes that were written.
    #[error("{file}: is damaged (its checksum is wrong); copy it again or rebuild the store")]
    Damaged {
        /// The file.
        file: String,
    },
    /// The bytes that were written, but no partition.
    #[error("{file}: {cause}; build the store again")]
    InvalidPartition {
        /// The file.
        file: String,
        /// What is wrong.
        cause: InvalidPartition,
    },
    /// A manifest, or a table, that makes no sense.
    #[error("{file}: {problem}")]
    Malformed {
        /// The file.
        file: String,
        /// What is wrong and what to do.
        problem: String,
    },
}

impl StoreError {
    /// The same of a store in `directory`: the file is named by its path from here.
    #[must_use]
    pub fn below(mut self, directory: &Path) -> Self {
        let name = match &mut self {
            Self::Unreadable(error) => error.name_mut(),
            Self::Failed { file, .. }
            | Self::OtherVersion { file, .. }
            | Self::Foreign { file, .. }
            | Self::WrongLength { file, .. }
            | Self::Damaged { file }
            | Self::InvalidPartition { file, .. }
            | Self::Malformed { file, .. } => file,
        };
        *name = directory.join(&*name).display().to_string();
        self
    }
}
