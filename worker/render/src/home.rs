//! Where contributions go while a piece of work is traced: for each unit, its share of credit and
//! the film values gathered for it.
//!
//! Work may come from other machines. Its form has been checked at the door, but only here is it
//! known whether its units, pixels and primitives exist; so that is checked before a ray is traced.

use equilux_common::bundle::{Bundle, Share};
use equilux_common::film::{Features, TileSums};
use equilux_common::ids::{PartitionId, UnitId};
use equilux_common::ray::{NO_PRIMITIVE, Ray};
use equilux_common::unit::{Rect, Unit};
use equilux_common::work::{Samples, Work};

use crate::renderer::Renderer;

/// Work that is not of this job: its sender has another idea of the scene or the settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidWork {
    /// The job has no such unit.
    #[error("work for {0}, which this job does not have")]
    Unit(UnitId),
    /// The unit has no such paths.
    #[error("paths {first} to {last} of {unit}, which has {count}")]
    Paths {
        /// The unit.
        unit: UnitId,
        /// The first path.
        first: u32,
        /// One past the last path.
        last: u64,
        /// How many it has.
        count: u32,
    },
    /// The model has no such partition.
    #[error("rays for {0}, which this model does not have")]
    Partition(PartitionId),
    /// The ray names a share that its bundle lacks.
    #[error("a ray of share {share}, but its bundle has {count}")]
    Share {
        /// The index.
        share: u8,
        /// How many there are.
        count: usize,
    },
    /// The unit does not have this pixel or sample.
    #[error("a ray for sample {sample_index} of pixel {pixel}, which {unit} does not have")]
    Pixel {
        /// The unit.
        unit: UnitId,
        /// The pixel.
        pixel: u32,
        /// The sample.
        sample_index: u32,
    },
    /// The model has no such triangle.
    #[error("a ray that hit primitive {0}, which this model does not have")]
    Primitive(u32),
    /// The ray is longer than paths of this job are.
    #[error("a ray of depth {0}, deeper than paths of this job go")]
    Depth(u16),
    /// Work without credit would be lost without being missed.
    #[error("work for {0} that carries no credit")]
    Credit(UnitId),
}

/// One unit that the work belongs to.
#[derive(Debug)]
struct Entry {
    share: Share,
    unit: Unit,
    sums: Option<TileSums>,
}

/// The units that a piece of work belongs to; while it is traced, rays name them by position.
#[derive(Debug)]
pub(crate) struct Home {
    entries: Vec<Entry>,
    image_width: u32,
}

impl Home {
    /// Takes in the shares of some work, all of which is of this job.
    pub(crate) fn new(renderer: &Renderer, work: &Work) -> Result<Self, InvalidWork> {
        let mut entries = Vec::with_capacity(work.shares().len());
        for share in work.shares() {
            let unit = renderer.grid.unit(share.unit).ok_or(InvalidWork::Unit(share.unit))?;
            if share.credit.is_zero() {
                return Err(InvalidWork::Credit(share.unit));
            }
            entries.push(Entry { share: share.clone(), unit, sums: None });
        }
        let home = Self { entries, image_width: renderer.grid.image_width() };
        match work {
            Work::Samples(samples) => check_samples(samples, &home.entries[0].unit)?,
            Work::Rays(bundle) => home.check_bundle(bundle, renderer)?,
        }
        Ok(home)
    }

    /// The unit of a share.
    pub(crate) fn unit(&self, share: u8) -> &Unit {
        &self.entries[usize::from(share)].unit
    }

    /// Counts a camera sample that begins.
    pub(crate) fn add_sample(&mut self, ray: &Ray) {
        let (sums, index) = self.pixel(ray);
        sums.add_sample(index, ray.sample_index);
    }

    /// Adds a contribution to the ray's pixel.
    pub(crate) fn add_radiance(&mut self, ray: &Ray, radiance: [f32; 3]) {
        let (sums, index) = self.pixel(ray);
        sums.add_radiance(index, ray.sample_index, radiance);
    }

    /// Adds what a camera ray saw.
    pub(crate) fn add_features(&mut self, ray: &Ray, features: &Features) {
        let (sums, index) = self.pixel(ray);
        sums.add_features(index, features);
    }

    /// Ends the work: gives every successor its shares, in place of the positions by which its rays
    /// name them now, and keeps the rest with the film values.
    ///
    /// A unit that has film values keeps credit to vouch for them; so does one that has no rays
    /// left. Of a unit that has only rays left, all credit goes with them.
    pub(crate) fn close(mut self, successors: &mut [Bundle]) -> Vec<(Share, TileSums)> {
        let mut left = vec![0usize; self.entries.len()];
        for bundle in &*successors {
            positions_in(bundle).for_each(|position| left[usize::from(position)] += 1);
        }
        for bundle in successors {
            let positions: Vec<u8> = positions_in(bundle).collect();
            for (index, &position) in (0u8..).zip(&positions) {
                let waiting = &mut left[usize::from(position)];
                let share = self.entries[usize::from(position)].part_with(*waiting);
                *waiting -= 1;
                bundle.shares.push(share);
                let rays = bundle.rays.iter_mut().filter(|ray| ray.share == position);
                // Positions ascend, so an index never equals a position yet to be replaced.
                rays.for_each(|ray| ray.share = index);
            }
        }
        self.entries.into_iter().filter_map(Entry::retire).collect()
    }

    fn pixel(&mut self, ray: &Ray) -> (&mut TileSums, usize) {
        let entry = &mut self.entries[usize::from(ray.share)];
        let tile = entry.unit.tile;
        let sums = entry.sums.get_or_insert_with(|| TileSums::new(tile));
        (sums, tile.index_of(ray.pixel % self.image_width, ray.pixel / self.image_width))
    }

    fn check_bundle(&self, bundle: &Bundle, renderer: &Renderer) -> Result<(), InvalidWork> {
        check_partition(bundle.partition, renderer)?;
        bundle.rays.iter().try_for_each(|ray| self.check_ray(ray, renderer))
    }

    fn check_ray(&self, ray: &Ray, renderer: &Renderer) -> Result<(), InvalidWork> {
        let (share, count) = (ray.share, self.entries.len());
        let entry =
            self.entries.get(usize::from(share)).ok_or(InvalidWork::Share { share, count })?;
        let Unit { tile, first_sample, sample_count, .. } = entry.unit;
        let (x, y) = (ray.pixel % self.image_width, ray.pixel / self.image_width);
        let is_inside = (tile.x0..tile.x1).contains(&x)
            && (tile.y0..tile.y1).contains(&y)
            && (first_sample..first_sample + sample_count).contains(&ray.sample_index);
        if !is_inside {
            let (pixel, sample_index) = (ray.pixel, ray.sample_index);
            return Err(InvalidWork::Pixel { unit: entry.unit.id, pixel, sample_index });
        }
        let primitive = ray.hit_primitive;
        if primitive != NO_PRIMITIVE && u64::from(primitive) >= renderer.model.triangle_count() {
            return Err(InvalidWork::Primitive(primitive));
        }
        if primitive != NO_PRIMITIVE {
            check_partition(PartitionId(ray.hit_partition), renderer)?;
        }
        if u32::from(ray.depth) >= renderer.settings.max_depth {
            return Err(InvalidWork::Depth(ray.depth));
        }
        Ok(())
    }
}

impl Entry {
    /// Gives credit to one of `waiting` bundles that still get some.
    fn part_with(&mut self, waiting: usize) -> Share {
        let is_all = waiting == 1 && self.sums.is_none();
        let credit = if is_all {
            std::mem::take(&mut self.share.credit)
        } else {
            self.share.credit.split(waiting + 1)
        };
        Share { credit, ..self.share }
    }

    /// What stays here, if credit does.
    fn retire(self) -> Option<(Share, TileSums)> {
        let Self { share, unit, sums } = self;
        if share.credit.is_zero() {
            return None;
        }
        // Whoever adds them up need not look at rows in which there is nothing.
        let first_row = Rect { y1: unit.tile.y0 + 1, ..unit.tile };
        let sums = sums.map_or_else(|| TileSums::new(first_row), TileSums::cropped);
        Some((share, sums))
    }
}

fn check_partition(partition: PartitionId, renderer: &Renderer) -> Result<(), InvalidWork> {
    let is_known = (partition.0 as usize) < renderer.model.partition_count();
    if is_known { Ok(()) } else { Err(InvalidWork::Partition(partition)) }
}

fn check_samples(samples: &Samples, unit: &Unit) -> Result<(), InvalidWork> {
    let last = u64::from(samples.first_path) + u64::from(samples.path_count);
    if last > u64::from(unit.path_count()) {
        let (first, count) = (samples.first_path, unit.path_count());
        return Err(InvalidWork::Paths { unit: unit.id, first, last, count });
    }
    Ok(())
}

/// The shares that a bundle's rays name, ascending, each once.
fn positions_in(bundle: &Bundle) -> impl Iterator<Item = u8> + use<> {
    let mut is_named = [false; 256];
    bundle.rays.iter().for_each(|ray| is_named[usize::from(ray.share)] = true);
    (0..=u8::MAX).filter(move |&position| is_named[usize::from(position)])
}
