//! `equilux scene generate city`: writes a city to files as it is built, without holding it.
//!
//! Files are written beside their final names and renamed when all are whole, the scene file last;
//! an error or an interrupt leaves none of them, and no directory that was made for them.

use std::fs::Permissions;
use std::io::{BufWriter, IntoInnerError, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::Context;
use equilux_generator::{City, CityFile};
use tempfile::NamedTempFile;

use super::outdir::Outdir;
use crate::args::GenerateArgs;
use crate::interrupt::{INTERRUPTED, Interrupt};
use crate::jobs::print_line;
use crate::progress::{Moment, Progress};

/// Triangles where no number is given: a gigabyte or so when rendered, and some seconds to write.
const TRIANGLES: u64 = 1_000_000;

/// How files are buffered: a city has some dozens of them.
const BUFFER_BYTES: usize = 256 << 10;

/// Permissions of new files, less the user's mask: what programs usually ask for.
const MODE: u32 = 0o666;

/// `equilux scene generate city`.
pub(super) async fn generate(args: GenerateArgs) -> anyhow::Result<ExitCode> {
    let mut interrupt = Interrupt::listen()?;
    let is_stopped = Arc::new(AtomicBool::new(false));
    let writing = tokio::task::spawn_blocking({
        let is_stopped = Arc::clone(&is_stopped);
        move || write(&args, &is_stopped)
    });
    tokio::pin!(writing);
    let written = tokio::select! {
        written = &mut writing => written,
        () = interrupt.asked() => {
            is_stopped.store(true, Ordering::Relaxed);
            writing.await
        }
    };
    match written?? {
        Some(line) => {
            print_line(&line)?;
            Ok(ExitCode::SUCCESS)
        }
        None => Ok(ExitCode::from(INTERRUPTED)),
    }
}

/// Writes all files, and gives the line that tells of them; none if it was stopped.
fn write(args: &GenerateArgs, is_stopped: &AtomicBool) -> anyhow::Result<Option<String>> {
    let city = City::new(args.triangles.unwrap_or(TRIANGLES))?;
    let outdir = args.outdir.clone().unwrap_or_else(|| "city".into());
    let _unless_empty = Outdir::make(&outdir)?;
    let mut files: Vec<Part> = city
        .files()
        .into_iter()
        .map(|file| Part::create(&outdir, file))
        .collect::<Result<_, _>>()?;
    let mut meter = Meter::new(args.quiet, files.iter().map(|file| file.file.bytes).sum());
    let result = city.write(|index, bytes| {
        if is_stopped.load(Ordering::Relaxed) {
            return Err(Broken::Stopped);
        }
        meter.add(bytes.len());
        files[index].write(bytes).map_err(Broken::Failed)
    });
    meter.progress.end();
    match result {
        Ok(()) => {}
        Err(Broken::Stopped) => return Ok(None),
        Err(Broken::Failed(error)) => return Err(error),
    }
    // What can fail for want of room comes first, so that all files get their names, or none.
    let files: Vec<Whole> = files.into_iter().map(Part::finish).collect::<Result<_, _>>()?;
    files.into_iter().try_for_each(Whole::keep)?;
    let scene = outdir.join("scene.json");
    let (triangles, emitters) = (city.triangle_count(), city.emitter_count());
    Ok(Some(format!("{}: {triangles} triangles, {emitters} of which emit", scene.display())))
}

/// Why the writing ended early.
enum Broken {
    Stopped,
    Failed(anyhow::Error),
}

/// A file that is being written; it vanishes unless it is kept.
struct Part {
    path: PathBuf,
    file: CityFile,
    writer: BufWriter<NamedTempFile>,
}

impl Part {
    fn create(outdir: &Path, file: CityFile) -> anyhow::Result<Self> {
        let path = outdir.join(&file.name);
        let beside = tempfile::Builder::new()
            .prefix(&format!(".{}.", file.name))
            .suffix(".part")
            .permissions(Permissions::from_mode(MODE))
            .tempfile_in(outdir)
            .with_context(|| format!("{}: cannot be created", path.display()))?;
        Ok(Self { path, file, writer: BufWriter::with_capacity(BUFFER_BYTES, beside) })
    }

    fn write(&mut self, bytes: &[u8]) -> anyhow::Result<()> {
        let result = self.writer.write_all(bytes);
        result.with_context(|| format!("{}: cannot be written", self.path.display()))
    }

    /// Writes what is left to write, and waits until all of it is on the disk.
    fn finish(self) -> anyhow::Result<Whole> {
        let failed = || format!("{}: cannot be written", self.path.display());
        let flushed = self.writer.into_inner().map_err(IntoInnerError::into_error);
        let beside = flushed.with_context(failed)?;
        let bytes = beside.as_file().metadata().with_context(failed)?.len();
        assert_eq!(bytes, self.file.bytes, "{} is as long as was planned", self.file.name);
        beside.as_file().sync_all().with_context(failed)?;
        Ok(Whole { path: self.path, beside })
    }
}

/// A file all of which is there but its name; it vanishes unless it is kept.
struct Whole {
    path: PathBuf,
    beside: NamedTempFile,
}

impl Whole {
    fn keep(self) -> anyhow::Result<()> {
        let Self { path, beside } = self;
        let failed = || format!("{}: cannot be written", path.display());
        beside.persist(&path).map_err(|error| error.error).with_context(failed)?;
        Ok(())
    }
}

/// Shows how many bytes are written.
struct Meter {
    progress: Progress,
    started: Instant,
    shown: Duration,
    written: u64,
    total: u64,
}

impl Meter {
    /// Shown at most so often.
    const PERIOD: Duration = Duration::from_millis(100);

    #[expect(clippy::disallowed_methods, reason = "an edge may look at the clock")]
    fn new(is_quiet: bool, total: u64) -> Self {
        let progress = Progress::new(is_quiet);
        Self { progress, started: Instant::now(), shown: Duration::ZERO, written: 0, total }
    }

    fn add(&mut self, bytes: usize) {
        self.written += bytes as u64;
        let elapsed = self.started.elapsed();
        if elapsed < self.shown + Self::PERIOD {
            return;
        }
        self.shown = elapsed;
        let progress = self.written as f64 / self.total.max(1) as f64;
        let remaining = elapsed.mul_f64((1.0 / progress - 1.0).max(0.0));
        let (remaining, detail) = (Some(remaining), "");
        self.progress.show(&Moment { state: "writing", progress, elapsed, remaining, detail });
    }
}
