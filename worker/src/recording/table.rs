//! Rays and their time, by where on the image their paths begin and how deep they are.

use std::collections::BTreeMap;

use equilux_common::costs::{COST_DEPTHS_MAX, CellCosts};
use equilux_common::job::JobSpec;
use equilux_common::unit::{Granularity, Rect, UnitGrid};

/// Side of a cell: costs differ within a tile of a unit, which has four of them, and each still has
/// hundreds of paths at few samples per pixel.
pub(super) const CELL_SIDE_PIXELS: u32 = 8;

/// A ray takes at least a nanosecond, however coarse the clock: nothing is free.
const RAY_NANOS_MIN: f64 = 1.0;

/// The cells of an image, row by row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cells {
    image_width: u32,
    region: Rect,
}

/// Rays of one cell and depth.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Cost {
    pub(super) rays: u64,
    pub(super) nanos: f64,
}

/// What was measured, by cell and depth.
#[derive(Clone, Debug, Default)]
pub(super) struct CostTable {
    by_cell: BTreeMap<u32, Vec<Cost>>,
    /// Nanoseconds of all shadow rays.
    shadow_nanos: f64,
}

impl Cells {
    /// Those of the part of the image that a job renders.
    pub(super) fn of(spec: &JobSpec) -> Self {
        Self { image_width: spec.settings.width, region: spec.settings.region() }
    }

    /// The cell of a pixel, which is numbered as rays name it.
    pub(super) const fn of_pixel(&self, pixel: u32) -> u32 {
        let (x, y) = (pixel % self.image_width, pixel / self.image_width);
        let (column, row) = (x - self.region.x0, y - self.region.y0);
        column / CELL_SIDE_PIXELS + row / CELL_SIDE_PIXELS * self.columns()
    }

    /// Those of the whole image, as units of the job: each is a tile with all samples.
    pub(super) fn units(&self, samples_per_pixel: u32) -> UnitGrid {
        let granularity =
            Granularity { tile_side_pixels: CELL_SIDE_PIXELS, samples_per_unit: samples_per_pixel };
        UnitGrid::new(self.image_width, self.region, samples_per_pixel, granularity)
    }

    /// Pixels of each cell, in order; fewer at the right and at the bottom.
    fn pixel_counts(&self) -> impl Iterator<Item = u64> + use<> {
        let (width, height) = (self.region.width(), self.region.height());
        let side = |length: u32, start| u64::from(CELL_SIDE_PIXELS.min(length - start));
        (0..height).step_by(CELL_SIDE_PIXELS as usize).flat_map(move |top| {
            let lefts = (0..width).step_by(CELL_SIDE_PIXELS as usize);
            lefts.map(move |left| side(width, left) * side(height, top))
        })
    }

    const fn columns(&self) -> u32 {
        self.region.width().div_ceil(CELL_SIDE_PIXELS)
    }
}

impl CostTable {
    /// Adds rays that took so long.
    pub(super) fn add(&mut self, cell: u32, depth: u16, rays: u64, nanos: f64) {
        let depth = usize::from(depth).min(COST_DEPTHS_MAX - 1);
        let costs = self.by_cell.entry(cell).or_default();
        if costs.len() <= depth {
            costs.resize(depth + 1, Cost::default());
        }
        costs[depth].add(Cost { rays, nanos });
    }

    /// Of what was added, so much went to shadow rays.
    pub(super) fn add_shadow(&mut self, nanos: f64) {
        self.shadow_nanos += nanos;
    }

    /// The part of all time that shadow rays took.
    pub(super) fn shadow_part(&self) -> f64 {
        let nanos: f64 = self.by_cell.values().flatten().map(|cost| cost.nanos).sum();
        self.shadow_nanos / nanos.max(RAY_NANOS_MIN)
    }

    /// Adds all that another table has.
    pub(super) fn merge(&mut self, other: Self) {
        self.shadow_nanos += other.shadow_nanos;
        for (cell, costs) in other.by_cell {
            let own = self.by_cell.entry(cell).or_default();
            own.resize(own.len().max(costs.len()), Cost::default());
            own.iter_mut().zip(costs).for_each(|(sum, cost)| sum.add(cost));
        }
    }

    /// The table in the form of the file; nothing unless it has every path of the cells.
    pub(super) fn cells(&self, cells: &Cells, samples_per_pixel: u32) -> Option<Vec<CellCosts>> {
        let expected = cells.pixel_counts().map(|pixels| pixels * u64::from(samples_per_pixel));
        let costs = (0..).zip(expected).map(|(cell, paths)| {
            let costs = self.by_cell.get(&cell)?;
            (costs[0].rays == paths).then(|| cell_costs(costs))
        });
        costs.collect()
    }

    #[cfg(test)]
    pub(super) fn of_cell(&self, cell: u32) -> &[Cost] {
        self.by_cell.get(&cell).map_or(&[], Vec::as_slice)
    }

    #[cfg(test)]
    pub(super) fn total(&self) -> Cost {
        let mut total = Cost::default();
        self.by_cell.values().flatten().for_each(|cost| total.add(*cost));
        total
    }
}

impl Cost {
    fn add(&mut self, other: Self) {
        self.rays += other.rays;
        self.nanos += other.nanos;
    }
}

fn cell_costs(costs: &[Cost]) -> CellCosts {
    let paths = costs[0].rays as f64;
    let nanos = |cost: &Cost| match cost.rays {
        0 => 0.0,
        rays => (cost.nanos / rays as f64).max(RAY_NANOS_MIN),
    };
    CellCosts {
        rays_per_path: costs.iter().map(|cost| (cost.rays as f64 / paths) as f32).collect(),
        nanos_per_ray: costs.iter().map(|cost| nanos(cost) as f32).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two cells and a bit to the right, one and a bit down, away from the image's corner.
    const CELLS: Cells =
        Cells { image_width: 100, region: Rect { x0: 4, y0: 2, x1: 4 + 18, y1: 2 + 9 } };

    #[test]
    fn every_pixel_is_in_one_cell() {
        let region = CELLS.region;
        let mut counts = vec![0; 6];
        for (x, y) in (region.y0..region.y1).flat_map(|y| (4..22).map(move |x| (x, y))) {
            counts[CELLS.of_pixel(x + 100 * y) as usize] += 1;
        }
        assert_eq!(counts, [64, 64, 16, 8, 8, 2]);
        assert!(CELLS.pixel_counts().eq(counts));
    }

    /// Every path of two samples, each of 500 ns.
    fn whole() -> CostTable {
        let mut table = CostTable::default();
        for (cell, pixels) in (0..).zip([64, 64, 16, 8, 8, 2]) {
            table.add(cell, 0, pixels * 2, 1000.0 * pixels as f64);
        }
        table
    }

    #[test]
    fn costs_are_means_by_depth_and_the_deepest_count_together() {
        let mut table = whole();
        let mut deep = CostTable::default();
        deep.add(5, 1, 2, 500.0);
        deep.add(5, 1, 0, 100.0);
        deep.add(5, 40, 1, 9.0);
        deep.add(5, 70, 1, 0.0);
        table.merge(deep);
        let cells = table.cells(&CELLS, 2).unwrap();
        assert_eq!(cells[4], CellCosts { rays_per_path: vec![1.0], nanos_per_ray: vec![500.0] });
        let CellCosts { rays_per_path, nanos_per_ray } = &cells[5];
        assert_eq!((rays_per_path.len(), nanos_per_ray.len()), (COST_DEPTHS_MAX, COST_DEPTHS_MAX));
        assert_eq!(
            (&rays_per_path[..3], &nanos_per_ray[..3]),
            (&[1.0, 0.5, 0.0][..], &[500.0, 300.0, 0.0][..])
        );
        assert_eq!((rays_per_path[31], nanos_per_ray[31]), (0.5, 4.5));
    }

    #[test]
    fn a_table_that_lacks_a_path_makes_no_file() {
        let mut table = whole();
        table.add(5, 0, 1, 0.0);
        assert_eq!(table.cells(&CELLS, 2), None, "one too many");
        assert_eq!(whole().cells(&CELLS, 3), None, "a third too few");
        table = whole();
        table.by_cell.remove(&3);
        assert_eq!(table.cells(&CELLS, 2), None, "a cell without paths");
    }
}
