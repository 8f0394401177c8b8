//! The directory that a generated scene goes to: if nothing comes of the scene, it is not left.

use std::path::{Path, PathBuf};

use anyhow::Context;

/// Directories that were made for files to come. When this is dropped, those that are still empty
/// go again.
pub(super) struct Outdir {
    /// The innermost first.
    made: Vec<PathBuf>,
}

impl Outdir {
    /// Makes a directory, and those that it lies in, as far as they are not there.
    pub(super) fn make(path: &Path) -> anyhow::Result<Self> {
        let is_missing = |path: &&Path| !path.as_os_str().is_empty() && !path.exists();
        let made = path.ancestors().take_while(is_missing).map(Path::to_owned).collect();
        // Also if only some can be made.
        let outdir = Self { made };
        std::fs::create_dir_all(path)
            .with_context(|| format!("{}: cannot be made", path.display()))?;
        Ok(outdir)
    }
}

impl Drop for Outdir {
    fn drop(&mut self) {
        // What has files in it stays.
        let _rest = self.made.iter().try_for_each(std::fs::remove_dir);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_was_made_and_is_empty_goes() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("a/b/c");
        drop(Outdir::make(&path).unwrap());
        assert!(!home.path().join("a").exists());

        let kept = Outdir::make(&path).unwrap();
        std::fs::write(home.path().join("a/file"), "").unwrap();
        drop(kept);
        assert!(home.path().join("a").exists() && !home.path().join("a/b").exists());
        drop(Outdir::make(home.path()).unwrap());
        assert!(home.path().exists());

        let beyond = Outdir::make(&home.path().join("a/file/d"));
        assert!(beyond.err().unwrap().to_string().contains("a/file/d: cannot be made"));
    }
}
