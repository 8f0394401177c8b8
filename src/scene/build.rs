//! `equilux scene build`: cuts a scene into partitions on disk.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use equilux_common::scene::describe::Bytes;
use equilux_store::{BuildError, Cut, Manifest};

use crate::args::SceneBuildArgs;
use crate::interrupt::{INTERRUPTED, Interrupt};
use crate::jobs::print_line;
use crate::store_build::{self, Built, Request};

/// Size of partitions unless told otherwise: read in a tenth of a second, and a thousand of them
/// are a large model.
const PARTITION_BYTES: u64 = 64 << 20;

/// Builds the store.
pub(super) async fn run(args: SceneBuildArgs) -> anyhow::Result<ExitCode> {
    let interrupt = Interrupt::listen()?;
    let built = tokio::task::spawn_blocking(move || build(&args, &interrupt)).await?;
    match built {
        Err(error) if matches!(error.downcast_ref(), Some(BuildError::Interrupted)) => {
            eprintln!("{error}");
            Ok(INTERRUPTED.into())
        }
        built => built.map(|()| ExitCode::SUCCESS),
    }
}

fn build(args: &SceneBuildArgs, interrupt: &Interrupt) -> anyhow::Result<()> {
    let store = args.outdir.clone().unwrap_or_else(|| default_name(&args.scene));
    let request = Request {
        scene: &args.scene,
        cut: cut(args),
        store: &store,
        spool: args.spool.as_deref(),
        is_quiet: args.quiet,
    };
    let built = store_build::build(&request, Some(interrupt))?;
    built.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
    print_line(&summary(&store, &built))?;
    Ok(())
}

fn cut(args: &SceneBuildArgs) -> Cut {
    match (args.partitions, args.partition_size) {
        (Some(count), _) => Cut::Count(count),
        (None, size) => Cut::Size(size.map_or(PARTITION_BYTES, |size| size.0)),
    }
}

/// `office.store` for `scenes/office/scene.json`, `bunny.store` for `models/bunny.obj`.
fn default_name(scene: &Path) -> PathBuf {
    PathBuf::from(format!("{}.store", crate::outputs::scene_name(scene)))
}

fn summary(store: &Path, built: &Built) -> String {
    let Built { manifest, model_bytes, elapsed, .. } = built;
    let seconds = elapsed.as_secs_f64();
    format!(
        "{}: {} in {} partitions, {}, in {seconds:.1} s ({:.0} MB/s of models, {:.2} \
         million triangles/s)",
        store.display(),
        triangles(manifest),
        manifest.partitions.len(),
        Bytes(manifest.file_bytes()),
        *model_bytes as f64 / 1e6 / seconds,
        manifest.kept_count() as f64 / 1e6 / seconds,
    )
}

/// How many triangles there are, and how many are kept where these are fewer.
fn triangles(manifest: &Manifest) -> String {
    let (all, kept) = (manifest.triangle_count, manifest.kept_count());
    if all == kept { format!("{all} triangles") } else { format!("{all} triangles ({kept} kept)") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_store_is_named_after_its_scene() {
        assert_eq!(default_name(Path::new("scenes/office/scene.json")), Path::new("office.store"));
        assert_eq!(default_name(Path::new("a/bunny.obj")), Path::new("bunny.store"));
    }
}
