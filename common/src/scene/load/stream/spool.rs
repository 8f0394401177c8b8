//! Temporary files for what does not fit memory.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use crate::scene::error::SceneError;
use crate::scene::files::LargeFile;

/// How much is written at once.
const BUFFER_BYTES: usize = 1 << 18;

/// A temporary file that is being written.
#[derive(Debug)]
pub(super) struct SpoolWriter {
    writer: BufWriter<File>,
    path: SpoolPath,
}

/// A temporary file; it goes when this value goes.
#[derive(Debug)]
pub(super) struct Spool {
    pub(super) file: LargeFile,
    _path: SpoolPath,
}

/// Where a temporary file is, for as long as it is there.
#[derive(Debug)]
struct SpoolPath(PathBuf);

impl Drop for SpoolPath {
    fn drop(&mut self) {
        // It is of no use to anybody; if it cannot be removed, whoever made the directory will.
        let _ = std::fs::remove_file(&self.0);
    }
}

impl SpoolPath {
    fn unwritable(&self, cause: io::Error) -> SceneError {
        SceneError::Unwritable { path: self.0.display().to_string(), cause }
    }
}

impl SpoolWriter {
    /// A new file called `name` in `directory`.
    pub(super) fn new(directory: &Path, name: &str) -> Result<Self, SceneError> {
        let path = directory.join(name);
        let shown = path.display().to_string();
        let file = File::create_new(&path)
            .map_err(|cause| SceneError::Unwritable { path: shown, cause })?;
        let writer = BufWriter::with_capacity(BUFFER_BYTES, file);
        Ok(Self { writer, path: SpoolPath(path) })
    }

    /// Appends bytes.
    pub(super) fn write(&mut self, bytes: &[u8]) -> Result<(), SceneError> {
        self.writer.write_all(bytes).map_err(|cause| self.path.unwritable(cause))
    }

    /// Appends numbers of single precision.
    pub(super) fn write_row(&mut self, numbers: &[f32]) -> Result<(), SceneError> {
        numbers.iter().try_for_each(|number| self.write(&number.to_le_bytes()))
    }

    /// Ends it, so that it can be read.
    pub(super) fn finish(self) -> Result<Spool, SceneError> {
        let Self { writer, path } = self;
        writer.into_inner().map_err(|error| path.unwritable(error.into_error()))?;
        let file = LargeFile::on_disk(&path.0.display().to_string(), &path.0)?;
        Ok(Spool { file, _path: path })
    }
}
