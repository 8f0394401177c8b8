//! The job store: a directory that holds the images of jobs that have ended.
//!
//! ```text
//! DATA/lock                 held while a coordinator runs
//! DATA/jobs/7/image.exr     written whole or not at all
//! DATA/jobs/7/image.png
//! ```

use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

use equilux_common::ids::JobId;

/// What an image is asked for as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageFormat {
    /// All layers, linear.
    Exr,
    /// The beauty layer through the tone curve.
    Png,
}

impl ImageFormat {
    /// The name of the file, in the store and in URLs.
    #[must_use]
    pub const fn file_name(self) -> &'static str {
        match self {
            Self::Exr => "image.exr",
            Self::Png => "image.png",
        }
    }

    /// Its media type.
    #[must_use]
    pub const fn media_type(self) -> &'static str {
        match self {
            Self::Exr => "image/x-exr",
            Self::Png => "image/png",
        }
    }
}

/// The directory, locked by this process.
#[derive(Debug)]
pub struct Store {
    root: PathBuf,
    newest: JobId,
    /// Unlocked when it is closed.
    _lock: File,
}

/// A directory that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// Another coordinator uses it.
    #[error(
        "{}: another coordinator uses this data directory; stop it, or name another one by --data",
        .0.display()
    )]
    InUse(PathBuf),
    /// The operating system said no.
    #[error("{}: {cause}; name a directory that can be written by --data", .path.display())]
    Unusable {
        /// The file or directory.
        path: PathBuf,
        /// Why.
        cause: io::Error,
    },
}

impl Store {
    /// Opens the directory, and makes it where it is not there.
    ///
    /// # Errors
    /// If it is in use or cannot be written.
    pub fn open(root: &Path) -> Result<Self, StoreError> {
        let unusable = |path: &Path, cause| StoreError::Unusable { path: path.into(), cause };
        let jobs = root.join("jobs");
        fs::create_dir_all(&jobs).map_err(|cause| unusable(&jobs, cause))?;
        let lock_path = root.join("lock");
        let lock = File::create(&lock_path).map_err(|cause| unusable(&lock_path, cause))?;
        lock.try_lock().map_err(|error| match error {
            TryLockError::WouldBlock => StoreError::InUse(root.into()),
            TryLockError::Error(cause) => unusable(&lock_path, cause),
        })?;
        let kept = job_numbers(&jobs).map_err(|cause| unusable(&jobs, cause))?;
        let newest = JobId(kept.into_iter().max().unwrap_or(0));
        Ok(Self { root: root.into(), newest, _lock: lock })
    }

    /// The newest job of earlier runs; numbers go on from there.
    #[must_use]
    pub const fn newest_job(&self) -> JobId {
        self.newest
    }

    /// The directory itself; temporary files may lie in it.
    #[must_use]
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Where a job's image lies, if it has been stored.
    #[must_use]
    pub fn image_path(&self, job: JobId, format: ImageFormat) -> PathBuf {
        self.job_path(job).join(format.file_name())
    }

    /// Makes the directory for a job's images.
    ///
    /// # Errors
    /// If the operating system says no.
    pub fn prepare(&self, job: JobId) -> io::Result<()> {
        fs::create_dir_all(self.job_path(job))
    }

    /// Deletes a job's images.
    pub(crate) fn forget(&self, job: JobId) {
        // What cannot be deleted stays: nobody asks for it any more, and nothing depends on it.
        let _stays = fs::remove_dir_all(self.job_path(job));
    }

    fn job_path(&self, job: JobId) -> PathBuf {
        self.root.join("jobs").join(job.0.to_string())
    }
}

/// The numbers of the jobs that have a directory.
fn job_numbers(jobs: &Path) -> io::Result<Vec<u64>> {
    let entries = fs::read_dir(jobs)?.collect::<io::Result<Vec<_>>>()?;
    Ok(entries.iter().filter_map(|entry| entry.file_name().to_str()?.parse().ok()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_go_on_and_nobody_else_gets_in() {
        let directory = tempfile::tempdir().expect("a temporary directory");
        let root = directory.path().join("new/data");
        let store = Store::open(&root).expect("a fresh directory");
        assert_eq!(store.newest_job(), JobId(0));
        store.prepare(JobId(7)).expect("room on the disk");
        store.prepare(JobId(12)).expect("room on the disk");
        assert!(matches!(Store::open(&root), Err(StoreError::InUse(_))));
        store.forget(JobId(7));
        drop(store);
        let again = Store::open(&root).expect("unlocked by now");
        assert_eq!(again.newest_job(), JobId(12));
        assert!(!again.image_path(JobId(7), ImageFormat::Exr).parent().expect("a job's").exists());
    }

    #[test]
    fn a_file_in_the_way_is_named() {
        let file = tempfile::NamedTempFile::new().expect("a temporary file");
        let error = Store::open(file.path()).expect_err("a file is no directory");
        assert!(error.to_string().contains("--data"), "{error}");
    }
}
