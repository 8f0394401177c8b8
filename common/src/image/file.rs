//! Files that are whole or not there.

use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use super::ImageError;

/// Most names that are tried for the file beside.
const ATTEMPTS_MAX: u32 = 100;

/// Writes `bytes` to `path` such that nobody ever sees half of them under that name: to a file
/// beside it, which is then synced and renamed. Devices and pipes are written to directly, and a
/// link stays a link.
///
/// # Errors
/// Says what keeps the file from being written; what was there before is then still there.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<(), ImageError> {
    let failed = |cause: io::Error| ImageError::Unwritable { path: path.to_owned(), cause };
    let target = match std::fs::metadata(path) {
        Ok(metadata) if metadata.is_dir() => {
            return Err(ImageError::IsDirectory { path: path.to_owned() });
        }
        Ok(metadata) if metadata.is_file() => std::fs::canonicalize(path).map_err(failed)?,
        Ok(_) => {
            let mut device = OpenOptions::new().write(true).open(path).map_err(failed)?;
            return device.write_all(bytes).map_err(failed);
        }
        Err(_) => path.to_owned(),
    };
    let directory = match target.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    if !directory.is_dir() {
        return Err(ImageError::NoDirectory { path: path.to_owned() });
    }
    let (beside, file) = create_beside(&target).map_err(failed)?;
    let written = fill(file, bytes).and_then(|()| std::fs::rename(&beside, &target));
    if let Err(cause) = written {
        // The error that matters is the first one.
        let _ = std::fs::remove_file(&beside);
        return Err(failed(cause));
    }
    sync_directory(directory);
    Ok(())
}

fn create_beside(target: &Path) -> io::Result<(PathBuf, File)> {
    let name = target.file_name().ok_or(io::ErrorKind::InvalidInput)?;
    let mut attempt = 0;
    loop {
        let mut hidden = std::ffi::OsString::from(".");
        hidden.push(name);
        hidden.push(format!(".{}-{attempt}.part", std::process::id()));
        let beside = target.with_file_name(hidden);
        match OpenOptions::new().write(true).create_new(true).open(&beside) {
            Ok(file) => return Ok((beside, file)),
            Err(cause)
                if cause.kind() == io::ErrorKind::AlreadyExists && attempt < ATTEMPTS_MAX =>
            {
                attempt += 1;
            }
            Err(cause) => return Err(cause),
        }
    }
}

fn fill(mut file: File, bytes: &[u8]) -> io::Result<()> {
    file.write_all(bytes)?;
    file.sync_all()
}

/// Makes the new name last through a power cut, on systems that can; the file is whole either way.
fn sync_directory(directory: &Path) {
    if let Ok(directory) = File::open(directory) {
        let _ = directory.sync_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(directory: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(directory).unwrap();
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
    }

    #[test]
    fn a_file_is_written_and_replaced_and_nothing_else_left() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("a.exr");
        write_atomically(&path, b"one").unwrap();
        write_atomically(&path, b"two").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"two");
        assert_eq!(names(home.path()), ["a.exr"]);
    }

    #[test]
    fn what_keeps_a_file_from_being_written_is_named() {
        let home = tempfile::tempdir().unwrap();
        let error = write_atomically(home.path(), b"").unwrap_err();
        assert!(matches!(error, ImageError::IsDirectory { .. }), "{error}");
        let error = write_atomically(&home.path().join("no/a.exr"), b"").unwrap_err();
        assert!(error.to_string().contains("its directory does not exist"), "{error}");
        let file = home.path().join("f");
        std::fs::write(&file, "").unwrap();
        let error = write_atomically(&file.join("a.exr"), b"").unwrap_err();
        assert!(matches!(error, ImageError::NoDirectory { .. }), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn links_stay_links_and_devices_stay_devices() {
        let home = tempfile::tempdir().unwrap();
        let (real, link) = (home.path().join("real"), home.path().join("link"));
        std::fs::write(&real, "old").unwrap();
        std::os::unix::fs::symlink(&real, &link).unwrap();
        write_atomically(&link, b"new").unwrap();
        assert_eq!(std::fs::read(&real).unwrap(), b"new");
        assert!(link.is_symlink());
        write_atomically(Path::new("/dev/null"), b"gone").unwrap();
        assert!(!Path::new("/dev/null").is_file());
    }
}
