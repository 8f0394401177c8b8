//! From parts to partitions: triangles come from spool files, trees are built, files written.
//!
//! Two threads work on a part each, and a third one waits for the disk to have what they wrote.
//! What they make has a name of its own until all is made, and is then numbered in the order of the
//! parts, so it does not matter who was faster.

use std::fs::File;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, bounded, unbounded};
use equilux_render::geometry::{Bounds, PARTITION_BOXES_MAX, Partition, PartitionBuilder};

use super::bisection::bisect;
use super::error::BuildError;
use super::pass::{self, PartPass, Pass};
use super::spool::{PARTS_MAX, SpooledPart};
use super::{CountedPart, Cut, Observer, PARTITIONS_DIRECTORY, Phase, Progress};
use crate::manifest::{FileEntry, PartitionEntry};
use crate::partition_file;

/// Threads that make partitions. Each holds one in memory, with what building its tree takes.
const THREADS: usize = 2;

/// Most files that are written and wait to be on the disk.
const UNSETTLED_MAX: usize = 4;

/// How often the observer is told even if nothing is done: so often an interrupt is noticed.
const OBSERVED_EVERY: Duration = Duration::from_millis(100);

/// Makes partitions of a model.
pub(super) struct Parts<'a> {
    /// Bounds of the whole model.
    pub(super) bounds: Bounds,
    /// How large partitions may be.
    pub(super) cut: Cut,
    /// Where their files go.
    pub(super) store: &'a Path,
    /// Where spool files go.
    pub(super) spool: &'a Path,
}

/// The partitions of the part at a position, in order, under names for the time being.
type Made = (usize, Result<Vec<PartitionEntry>, BuildError>);

/// A file all of which has been written.
type Written = (PathBuf, File);

impl Parts<'_> {
    /// Makes the partitions of all parts, in order.
    pub(super) fn make_all(
        &self,
        parts: Vec<CountedPart>,
        observer: &mut Observer<'_>,
    ) -> Result<Vec<PartitionEntry>, BuildError> {
        let is_interrupted = AtomicBool::new(false);
        let total = parts.iter().map(|(part, _)| part.triangle_count).sum();
        let part_count = parts.len();
        let (giver, taker) = unbounded();
        for job in parts.into_iter().enumerate() {
            giver.send(job).expect("the other end is here");
        }
        drop(giver);
        let made = std::thread::scope(|scope| {
            let ((sender, made), (written, unsettled)) = (unbounded(), bounded(UNSETTLED_MAX));
            for _ in 0..THREADS {
                let (taker, sender) = (taker.clone(), sender.clone());
                let (is_interrupted, written) = (&is_interrupted, written.clone());
                let maker = Maker { parts: self, is_interrupted, written };
                scope.spawn(move || maker.work(&taker, &sender));
            }
            drop((sender, written));
            let settled = scope.spawn(move || settle(&unsettled));
            let gathered = gather(&made, part_count, total, observer);
            is_interrupted.store(gathered.is_err(), Ordering::Relaxed);
            // What the disk refuses stops all others: it is to be told first.
            settled.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
            gathered
        })?;
        self.number(made.into_iter().flatten().collect())
    }

    /// Gives partitions their names, by their order.
    fn number(&self, mut entries: Vec<PartitionEntry>) -> Result<Vec<PartitionEntry>, BuildError> {
        for (number, entry) in entries.iter_mut().enumerate() {
            let name = format!("{PARTITIONS_DIRECTORY}/{number:05}.part");
            let path: PathBuf = self.store.join(&name);
            std::fs::rename(self.store.join(&entry.file.name), &path)
                .map_err(|cause| BuildError::unwritable(&path, cause))?;
            entry.file.name = name;
        }
        Ok(entries)
    }
}

/// A thread that makes partitions.
struct Maker<'a> {
    parts: &'a Parts<'a>,
    is_interrupted: &'a AtomicBool,
    written: Sender<Written>,
}

impl Maker<'_> {
    fn work(&self, parts: &Receiver<(usize, CountedPart)>, made: &Sender<Made>) {
        for (position, (part, count)) in parts {
            if self.is_interrupted.load(Ordering::Relaxed) {
                return;
            }
            let entries = self.make(part, count, &format!("{position:05}"));
            if made.send((position, entries)).is_err() {
                return;
            }
        }
    }

    /// Makes `count` partitions of a part, or as many as it takes for none to be too large.
    fn make(
        &self,
        part: SpooledPart,
        count: u32,
        name: &str,
    ) -> Result<Vec<PartitionEntry>, BuildError> {
        if count > 1 {
            return self.divide(part, count, name);
        }
        let count = usize::try_from(part.triangle_count).unwrap_or(usize::MAX);
        let mut builder = PartitionBuilder::with_capacity(count);
        let mut pass = PartPass { part: &part, is_interrupted: self.is_interrupted };
        pass.for_each(&mut |primitive, triangle| {
            builder.push(primitive, triangle);
            Ok(())
        })?;
        let partition = builder.build_swiftly(&self.parts.bounds);
        let bytes = partition.bytes() as u64;
        let pieces = match self.parts.cut {
            Cut::Size(most) if part.triangle_count > 1 => bytes.div_ceil(most),
            Cut::Size(_) | Cut::Count(_) => 1,
        };
        if pieces > 1 {
            drop(partition);
            let count = u32::try_from(pieces.min(part.triangle_count)).unwrap_or(u32::MAX);
            return self.divide(part, count, name);
        }
        drop(part);
        Ok(vec![self.write(&partition, name)?])
    }

    /// Takes a part for a model of its own.
    fn divide(
        &self,
        part: SpooledPart,
        count: u32,
        name: &str,
    ) -> Result<Vec<PartitionEntry>, BuildError> {
        let mut pass = PartPass { part: &part, is_interrupted: self.is_interrupted };
        let mut survey = pass::survey(&mut pass)?;
        let count = match self.parts.cut {
            Cut::Size(most) => count.max(survey.parts_within(most)),
            Cut::Count(_) => count,
        };
        let prefix = format!("{name}-");
        let files = (self.parts.spool, prefix.as_str());
        let parts = match survey.cells.as_slice() {
            [] | [_] => pass::distribute_evenly(&mut pass, survey.triangle_count, count, files)?,
            cells => {
                let regions = bisect(cells, count, PARTS_MAX);
                pass::distribute(&mut pass, &mut survey, &regions, &mut |_, _| Ok(()), files)?
            }
        };
        drop(survey);
        drop(part);
        let mut entries = Vec::new();
        for (number, (part, count)) in parts.into_iter().enumerate() {
            let name = format!("{prefix}{number:05}");
            entries.extend(self.make(part, count, &name)?);
        }
        Ok(entries)
    }

    fn write(&self, partition: &Partition, name: &str) -> Result<PartitionEntry, BuildError> {
        let name = format!("{PARTITIONS_DIRECTORY}/{name}.unnumbered");
        let path = self.parts.store.join(&name);
        let (file, hash, bytes) = partition_file::write(&path, partition)
            .map_err(|cause| BuildError::unwritable(&path, cause))?;
        // Nobody listens once another file is known not to be on the disk.
        self.written.send((path, file)).map_err(|_| BuildError::Interrupted)?;
        Ok(PartitionEntry {
            triangle_count: partition.triangle_count() as u64,
            memory_bytes: partition.bytes() as u64,
            file: FileEntry { name, hash, bytes },
            boxes: partition.boxes(PARTITION_BOXES_MAX),
        })
    }
}

/// Makes sure that what was written is on the disk, in case of a power cut.
fn settle(written: &Receiver<Written>) -> Result<(), BuildError> {
    written.iter().try_for_each(|(path, file)| {
        file.sync_all().map_err(|cause| BuildError::unwritable(&path, cause))
    })
}

/// Waits for the partitions of all parts and tells the observer.
fn gather(
    made: &Receiver<Made>,
    part_count: usize,
    total: u64,
    observer: &mut Observer<'_>,
) -> Result<Vec<Vec<PartitionEntry>>, BuildError> {
    let mut gathered = vec![Vec::new(); part_count];
    let mut triangles = 0;
    loop {
        match made.recv_timeout(OBSERVED_EVERY) {
            Ok((position, entries)) => {
                gathered[position] = entries?;
                let counts = gathered[position].iter().map(|entry| entry.triangle_count);
                triangles += counts.sum::<u64>();
            }
            Err(RecvTimeoutError::Timeout) => {}
            // Threads end when all is made; if one panicked, its panic goes on when it is joined.
            Err(RecvTimeoutError::Disconnected) => return Ok(gathered),
        }
        let progress = Progress { phase: Phase::Partitions, triangles, total: Some(total) };
        if let ControlFlow::Break(()) = observer(progress) {
            return Err(BuildError::Interrupted);
        }
    }
}
