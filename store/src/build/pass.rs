//! Passes over triangles: all of a scene's, or those of a part on disk.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use crossbeam_channel::{Receiver, Sender, bounded};
use equilux_common::scene::WorldTriangle;
use equilux_common::scene::triangles::TriangleSource;
use equilux_render::geometry::{Bounds, COORDINATE_MAX, TRIANGLES_MAX};

use super::bisection::Region;
use super::cells::Cells;
use super::error::BuildError;
use super::spool::{Spool, SpooledPart};
use super::{CountedPart, Observer, Phase, Progress};

/// Lots of triangles on their way from the reader to the visitor: enough that neither waits for
/// the other's hiccups, 1 MiB or so.
const LOTS_UNDERWAY: usize = 8;

/// Who is shown triangles with their primitive ids.
pub(super) type Visit<'a> = dyn FnMut(u32, &WorldTriangle) -> Result<(), BuildError> + Send + 'a;

/// Triangles that can be shown.
pub(super) trait Pass {
    /// Shows all of them in order.
    fn for_each(&mut self, visit: &mut Visit<'_>) -> Result<(), BuildError>;
}

/// A pass over a scene's triangles: those that are where they are, or those of a prototype. They
/// are read on this thread and visited on another, so that parsing and sorting go on at the same
/// time.
pub(super) struct ScenePass<'a, 'b> {
    pub(super) source: &'a mut dyn TriangleSource,
    pub(super) prototype: Option<usize>,
    pub(super) observer: &'a mut Observer<'b>,
    pub(super) phase: Phase,
    /// How many triangles there must be, if that is known.
    pub(super) expected: Option<u64>,
    /// How many are through with this phase already, and how many will be in all.
    pub(super) before: u64,
    pub(super) total: Option<u64>,
    /// Whether those that are shown must be shown again to be through with it.
    pub(super) is_preliminary: bool,
}

impl<'a, 'b> ScenePass<'a, 'b> {
    /// The survey of what is where it is.
    pub(super) fn new(source: &'a mut dyn TriangleSource, observer: &'a mut Observer<'b>) -> Self {
        let phase = Phase::Survey;
        Self {
            source,
            prototype: None,
            observer,
            phase,
            expected: None,
            before: 0,
            total: None,
            is_preliminary: false,
        }
    }
}

impl Pass for ScenePass<'_, '_> {
    fn for_each(&mut self, visit: &mut Visit<'_>) -> Result<(), BuildError> {
        let (full, lots) = bounded(LOTS_UNDERWAY);
        let (empty, returned) = bounded(LOTS_UNDERWAY);
        let (count, visited) = std::thread::scope(|scope| {
            let visitor = scope.spawn(move || visit_lots(&lots, &empty, visit));
            let count = self.read(full, &returned);
            (count, visitor.join())
        });
        // What stops the visitor stops the reader, too: it is to be told first.
        visited.unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
        let count = count?;
        match self.expected {
            Some(expected) if expected != count => Err(BuildError::Changed),
            _ => Ok(()),
        }
    }
}

/// Triangles that travel together.
type Lot = Vec<WorldTriangle>;

impl ScenePass<'_, '_> {
    /// Sends all triangles and tells how many there were.
    fn read(&mut self, full: Sender<Lot>, returned: &Receiver<Lot>) -> Result<u64, BuildError> {
        let Self { phase, before, total, is_preliminary, .. } = *self;
        let mut count = 0;
        let mut refused = None;
        let mut send = |triangles: &[WorldTriangle]| {
            count += triangles.len() as u64;
            if count > TRIANGLES_MAX as u64 {
                refused = Some(BuildError::TooManyTriangles);
                return ControlFlow::Break(());
            }
            let mut lot = returned.try_recv().unwrap_or_default();
            lot.clear();
            lot.extend_from_slice(triangles);
            if full.send(lot).is_err() {
                return ControlFlow::Break(());
            }
            let triangles = if is_preliminary { before } else { before + count };
            let told = (self.observer)(Progress { phase, triangles, total });
            if told.is_break() {
                refused = Some(BuildError::Interrupted);
            }
            told
        };
        match self.prototype {
            None => self.source.for_each(&mut send)?,
            Some(prototype) => self.source.for_each_of(prototype, &mut send)?,
        }
        refused.map_or(Ok(count), Err)
    }
}

fn visit_lots(
    lots: &Receiver<Lot>,
    empty: &Sender<Lot>,
    visit: &mut Visit<'_>,
) -> Result<(), BuildError> {
    let mut primitive = 0;
    for lot in lots {
        for triangle in &lot {
            visit(primitive, triangle)?;
            primitive += 1;
        }
        // If there is no room, one lot more is made anew.
        let _ = empty.try_send(lot);
    }
    Ok(())
}

/// A pass over the triangles of a part, which ends early when it is no longer wanted.
pub(super) struct PartPass<'a> {
    pub(super) part: &'a SpooledPart,
    pub(super) is_interrupted: &'a AtomicBool,
}

impl Pass for PartPass<'_> {
    fn for_each(&mut self, visit: &mut Visit<'_>) -> Result<(), BuildError> {
        self.part.for_each(&mut |primitive, triangle| {
            if self.is_interrupted.load(Ordering::Relaxed) {
                return Err(BuildError::Interrupted);
            }
            visit(primitive, triangle)
        })
    }
}

/// What a pass found.
pub(super) struct Survey {
    pub(super) cells: Cells,
    pub(super) triangle_count: u64,
    /// Estimated memory of one partition with all triangles.
    pub(super) bytes: u64,
}

impl Survey {
    /// Bounds of all triangles; those of nothing if there is none.
    pub(super) fn bounds(&self) -> Bounds {
        let boxes = self.cells.as_slice().iter().map(|cell| cell.bounds);
        boxes.fold(Bounds::EMPTY, |around, it| around.joined(&it))
    }

    /// How many parts there must be for each to take at most so many bytes, most likely.
    pub(super) fn parts_within(&self, part_bytes: u64) -> u32 {
        u32::try_from(self.bytes.div_ceil(mean_within(part_bytes))).unwrap_or(u32::MAX).max(1)
    }
}

/// What partitions are to take on average so that each takes at most so many bytes: they differ by
/// some eighths from the mean, and the few that are too large nevertheless are cut again.
pub(super) fn mean_within(part_bytes: u64) -> u64 {
    (part_bytes / 5 * 4).max(1)
}

/// Looks at all triangles.
pub(super) fn survey(pass: &mut dyn Pass) -> Result<Survey, BuildError> {
    let mut survey = Survey { cells: Cells::new(), triangle_count: 0, bytes: 0 };
    pass.for_each(&mut |_, triangle| {
        let is_within = |x: &f32| x.abs() <= COORDINATE_MAX;
        if !triangle.corners.as_flattened().iter().all(is_within) {
            return Err(BuildError::OutOfRange { primitive: survey.triangle_count });
        }
        let bytes = memory_bytes(triangle);
        survey.cells.add(triangle, bytes);
        survey.triangle_count += 1;
        survey.bytes += bytes;
        Ok(())
    })?;
    Ok(survey)
}

/// Puts the triangles that were surveyed into a part for each region, or several where a region's
/// triangles cannot be told apart; shows them to `gather` as well. The parts' files lie in the
/// directory and begin with the prefix.
pub(super) fn distribute(
    pass: &mut dyn Pass,
    survey: &mut Survey,
    regions: &[Region],
    gather: &mut Visit<'_>,
    (directory, prefix): (&Path, &str),
) -> Result<Vec<CountedPart>, BuildError> {
    let mut part_of_cell = vec![0; survey.cells.as_slice().len()];
    for (part, region) in regions.iter().enumerate() {
        region.cells.iter().for_each(|&cell| part_of_cell[cell as usize] = part);
    }
    let mut spool = Spool::new(directory, prefix, regions.len());
    pass.for_each(&mut |primitive, triangle| {
        let cell = survey.cells.position(triangle).ok_or(BuildError::Changed)?;
        gather(primitive, triangle)?;
        spool.push(part_of_cell[cell], primitive, triangle)
    })?;
    Ok(spool.finish()?.into_iter().zip(regions.iter().map(|region| region.part_count)).collect())
}

/// Puts triangles that cannot be told apart into parts by their order, equally many each.
pub(super) fn distribute_evenly(
    pass: &mut dyn Pass,
    triangle_count: u64,
    part_count: u32,
    (directory, prefix): (&Path, &str),
) -> Result<Vec<CountedPart>, BuildError> {
    let mut spool = Spool::new(directory, prefix, part_count as usize);
    let mut position = 0;
    pass.for_each(&mut |primitive, triangle| {
        let part = position * u64::from(part_count) / triangle_count;
        position += 1;
        spool.push(part as usize, primitive, triangle)
    })?;
    Ok(spool.finish()?.into_iter().map(|part| (part, 1)).collect())
}

/// Memory that a triangle takes in a partition, about: 44 bytes and a third of a node for itself;
/// indices, and a table that is shared but badly, for normals and texture coordinates. Too much
/// makes partitions smaller than they may be; too little, and they must be cut again.
fn memory_bytes(triangle: &WorldTriangle) -> u64 {
    let normals = if triangle.normals.is_some() { 12 + 24 } else { 0 };
    let texcoords = if triangle.texcoords.is_some() { 12 + 16 } else { 0 };
    68 + normals + texcoords
}
