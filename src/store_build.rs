//! Building a store while the user watches: for `equilux scene build`, and for a render that cuts
//! its scene by itself.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::Context;
use equilux_common::scene::files::Directory;
use equilux_common::scene::stream::SceneStream;
use equilux_store::{Cut, Manifest, Overture, Phase, Places};
use tempfile::TempDir;

use crate::interrupt::Interrupt;
use crate::progress::{Moment, Progress};

/// Time between two looks at the progress.
const SHOWN_EVERY: Duration = Duration::from_millis(100);

/// What is built, and how.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Request<'a> {
    /// The scene.
    pub(crate) scene: &'a Path,
    /// How it is cut.
    pub(crate) cut: Cut,
    /// Where the store goes.
    pub(crate) store: &'a Path,
    /// Where temporary files go, if not beside it.
    pub(crate) spool: Option<&'a Path>,
    /// Whether nothing is said but errors.
    pub(crate) is_quiet: bool,
}

/// What came of it.
#[derive(Clone, Debug)]
pub(crate) struct Built {
    /// What the store holds.
    pub(crate) manifest: Manifest,
    /// Bytes of the models that it was made from.
    pub(crate) model_bytes: u64,
    /// How long it took.
    pub(crate) elapsed: Duration,
    /// What is odd about the scene.
    pub(crate) warnings: Vec<String>,
}

/// Builds a store without ever holding the model in memory.
pub(crate) fn build(request: &Request<'_>, interrupt: Option<&Interrupt>) -> anyhow::Result<Built> {
    let begin = now();
    let (directory, entry) = Directory::of(request.scene)?;
    let spool = spool(request)?;
    let (mut stream, read) = SceneStream::open(&directory, &entry, spool.path())?;
    let mut meter = Meter::new(request.is_quiet, begin, read.triangle_count);
    let overture = Overture {
        tables: &read.tables,
        camera: &read.camera,
        cameras: &read.cameras,
        settings: &read.settings,
    };
    let places = Places { store: request.store, spool: request.spool };
    let mut observer = |progress| {
        meter.show(&progress);
        let is_asked = interrupt.is_some_and(Interrupt::is_asked);
        if is_asked { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let built = equilux_store::build(&mut stream, &overture, request.cut, &places, &mut observer);
    meter.progress.end();
    let mut warnings = read.warnings;
    warnings.extend_from_slice(stream.warnings());
    let (manifest, model_bytes) = (built?, read.model_bytes);
    Ok(Built { manifest, model_bytes, elapsed: begin.elapsed(), warnings })
}

/// A directory for what does not fit memory while the scene is read: beside the store unless there
/// is another place for it.
fn spool(request: &Request<'_>) -> anyhow::Result<TempDir> {
    let beside = request.store.parent().filter(|parent| !parent.as_os_str().is_empty());
    let place = request.spool.or(beside).unwrap_or_else(|| Path::new("."));
    let made = tempfile::Builder::new().prefix(".equilux-scene-").tempdir_in(place);
    made.with_context(|| {
        let place = place.display();
        format!("{place}: cannot be written to; name a place that can, by -o and --spool")
    })
}

/// Shows how far the building is, now and then.
struct Meter {
    progress: Progress,
    begin: Instant,
    shown: Option<Instant>,
    /// The phase at hand and when it began.
    phase: Option<(Phase, Instant)>,
    /// About how many triangles there are, until that is known.
    triangle_estimate: u64,
}

impl Meter {
    fn new(is_quiet: bool, begin: Instant, triangle_estimate: u64) -> Self {
        let progress = Progress::new(is_quiet);
        Self { progress, begin, shown: None, phase: None, triangle_estimate }
    }

    fn show(&mut self, progress: &equilux_store::Progress) {
        let now = now();
        let is_due = self.shown.is_none_or(|shown| now - shown >= SHOWN_EVERY);
        let since = match self.phase {
            Some((phase, since)) if phase == progress.phase => since,
            _ => self.phase.insert((progress.phase, now)).1,
        };
        if !is_due {
            return;
        }
        self.shown = Some(now);
        let rate = progress.triangles as f64 / 1e6 / (now - since).as_secs_f64().max(1e-3);
        let total = progress.total.unwrap_or(self.triangle_estimate).max(1);
        let millions = progress.triangles as f64 / 1e6;
        self.progress.show(&Moment {
            state: word(progress.phase),
            progress: progress.triangles as f64 / total as f64,
            elapsed: now - self.begin,
            remaining: None,
            detail: &format!("{millions:.1} million triangles, {rate:.2} million/s"),
        });
    }
}

const fn word(phase: Phase) -> &'static str {
    match phase {
        Phase::Survey => "survey",
        Phase::Distribution => "distribute",
        Phase::Partitions => "build",
    }
}

#[expect(clippy::disallowed_methods, reason = "an edge: throughput is told to the user")]
fn now() -> Instant {
    Instant::now()
}
