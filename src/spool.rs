//! Directories for what a single image needs, which go with it: where `--spool` says, or else where
//! the system has temporary files.

use std::path::Path;

use anyhow::Context;
use equilux_coordinator::attachments::Attachments;
use equilux_worker::link_into_cache;
use tempfile::TempDir;

/// A new directory in `place`, if one is named.
pub(crate) fn make(place: Option<&Path>) -> anyhow::Result<TempDir> {
    let place = place.map_or_else(std::env::temp_dir, Path::to_owned);
    tempfile::tempdir_in(&place).with_context(|| {
        format!("{}: cannot be written to; name a place that can by --spool", place.display())
    })
}

/// A cache for worker processes, in which a scene's partitions are already as far as they can be
/// linked; others are fetched.
pub(crate) fn make_cache(place: Option<&Path>, scene: &Attachments) -> anyhow::Result<TempDir> {
    let cache = make(place)?;
    let files = scene.files.iter().map(|(hash, (path, _))| (*hash, path.as_path()));
    let _all_linked = link_into_cache(cache.path(), files).is_ok();
    Ok(cache)
}
