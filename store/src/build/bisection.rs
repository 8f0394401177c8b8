//! Bisection: which cells make up which part.
//!
//! A box of cells that is to become k parts is cut in two by a plane across one of its axes, and so
//! on. The cut is the one with the least surface-area cost (Goldsmith & Salmon 1987; MacDonald &
//! Booth 1990): area × bytes, summed over both sides, swept exactly over the cells' own boxes in
//! the order of their middles. But not any cut will do:
//!
//! - The parts of both sides must be about equally large, since a part is what must fit somewhere.
//!   A side of j parts must have j/k of the bytes, give or take [`TOLERANCE`] of one part. Of k
//!   halvings the errors add up as a geometric series, so parts differ from the mean by about twice
//!   that.
//! - No side has less than a quarter of the parts. The cost alone would rather shave off slivers,
//!   each of which takes away little area, and end with parts that all overlap the same middle.

use equilux_render::geometry::Bounds;

use super::cells::Cell;

/// How far a side's bytes may be from what its parts should have, in parts.
const TOLERANCE: f64 = 0.125;

/// Cells that become parts together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Region {
    /// Positions of the cells.
    pub(super) cells: Vec<u32>,
    /// How many parts they become. More than one only if they cannot be told apart, or if there
    /// are more parts than regions may be.
    pub(super) part_count: u32,
}

/// Cuts cells into at most `regions_max` regions of `part_count` parts in all, of about equally
/// many bytes each. The regions come in the order of the cuts, so that those beside each other are
/// mostly neighbors.
pub(super) fn bisect(cells: &[Cell], part_count: u32, regions_max: u32) -> Vec<Region> {
    let mut sweep = Sweep::new(cells);
    let parts_per_region = part_count.div_ceil(regions_max);
    let mut regions = Vec::new();
    let mut open = vec![Span { begin: 0, end: cells.len(), part_count }];
    while let Some(span) = open.pop() {
        let can_be_cut = span.part_count > parts_per_region && span.end - span.begin > 1;
        if can_be_cut {
            let (left, right) = sweep.cut(&span);
            open.extend([right, left]);
        } else {
            let cells = sweep.orders[0][span.begin..span.end].to_vec();
            regions.push(Region { cells, part_count: span.part_count });
        }
    }
    regions
}

/// A range of cells, the same in all three orders.
#[derive(Clone, Copy, Debug)]
struct Span {
    begin: usize,
    end: usize,
    part_count: u32,
}

/// A place to cut: before the cell at `position` in the order along `axis`.
#[derive(Clone, Copy, Debug)]
struct Cut {
    axis: usize,
    position: usize,
    /// Parts of the left side.
    part_count: u32,
    /// By how many bytes the sides are unequal beyond what is tolerated.
    excess: f64,
    cost: f64,
}

/// The cells in the orders of their middles along the three axes, cut span by span.
struct Sweep<'a> {
    cells: &'a [Cell],
    orders: [Vec<u32>; 3],
    /// By cell: whether it goes to the left side of the cut at hand.
    is_left: Vec<bool>,
    /// Areas of the boxes around all cells from a position on.
    areas: Vec<f64>,
    /// Cells on their way from one place of an order to another.
    moved: Vec<u32>,
}

impl<'a> Sweep<'a> {
    fn new(cells: &'a [Cell]) -> Self {
        let count = u32::try_from(cells.len()).expect("cells are limited");
        let orders = std::array::from_fn(|axis| {
            let middle = |cell: u32| {
                let Bounds { lower, upper } = cells[cell as usize].bounds;
                f64::from(lower[axis]) + f64::from(upper[axis])
            };
            let mut order: Vec<u32> = (0..count).collect();
            order.sort_by(|&a, &b| middle(a).total_cmp(&middle(b)));
            order
        });
        let is_left = vec![false; cells.len()];
        Self { cells, orders, is_left, areas: vec![0.0; cells.len() + 1], moved: Vec::new() }
    }

    /// Cuts a span of at least two cells where that is best.
    fn cut(&mut self, span: &Span) -> (Span, Span) {
        let best = (0..3).filter_map(|axis| self.best_along(axis, span)).reduce(better);
        let cut = best.expect("there is a place between any two cells");
        self.divide(span, &cut);
        let middle = cut.position;
        let right_count = span.part_count - cut.part_count;
        (
            Span { end: middle, part_count: cut.part_count, ..*span },
            Span { begin: middle, part_count: right_count, ..*span },
        )
    }

    fn best_along(&mut self, axis: usize, span: &Span) -> Option<Cut> {
        let order = &self.orders[axis][span.begin..span.end];
        let mut around = Bounds::EMPTY;
        for (position, &cell) in order.iter().enumerate().rev() {
            around = around.joined(&self.cells[cell as usize].bounds);
            self.areas[position] = half_area(&around);
        }
        let bytes = |cell: &u32| self.cells[*cell as usize].bytes;
        let shares = Shares { bytes: order.iter().map(bytes).sum(), part_count: span.part_count };
        let (mut left, mut left_bytes) = (Bounds::EMPTY, 0);
        let mut best: Option<Cut> = None;
        for (before, &cell) in order[..order.len() - 1].iter().enumerate() {
            let cell = &self.cells[cell as usize];
            left = left.joined(&cell.bounds);
            left_bytes += cell.bytes;
            let (part_count, excess) = shares.of_left(left_bytes);
            let cost = half_area(&left) * left_bytes as f64
                + self.areas[before + 1] * (shares.bytes - left_bytes) as f64;
            let position = span.begin + before + 1;
            let cut = Cut { axis, position, part_count, excess, cost };
            best = Some(best.map_or(cut, |best| better(best, cut)));
        }
        best
    }

    /// Brings the cells of the left side before those of the right one, in all orders.
    fn divide(&mut self, span: &Span, cut: &Cut) {
        let order = &self.orders[cut.axis];
        for (position, &cell) in order.iter().enumerate().take(span.end).skip(span.begin) {
            self.is_left[cell as usize] = position < cut.position;
        }
        for axis in (0..3).filter(|&axis| axis != cut.axis) {
            let order = &mut self.orders[axis][span.begin..span.end];
            self.moved.clear();
            let mut kept = 0;
            for position in 0..order.len() {
                let cell = order[position];
                if self.is_left[cell as usize] {
                    order[kept] = cell;
                    kept += 1;
                } else {
                    self.moved.push(cell);
                }
            }
            order[kept..].copy_from_slice(&self.moved);
        }
    }
}

/// What a span has to share out between the sides of a cut.
struct Shares {
    bytes: u64,
    part_count: u32,
}

impl Shares {
    /// How many of the parts a left side of so many bytes becomes, and by how many bytes that is
    /// out of proportion beyond what is tolerated.
    fn of_left(&self, left_bytes: u64) -> (u32, f64) {
        let part_bytes = self.bytes as f64 / f64::from(self.part_count);
        let least = self.part_count.div_ceil(4);
        let proportional = (left_bytes as f64 / part_bytes).round() as u32;
        let part_count = proportional.clamp(least, self.part_count - least);
        let unequal = (left_bytes as f64 - part_bytes * f64::from(part_count)).abs();
        (part_count, (unequal - TOLERANCE * part_bytes).max(0.0))
    }
}

/// The more balanced cut, the cheaper one of equally balanced ones, and else the first.
fn better(a: Cut, b: Cut) -> Cut {
    if (b.excess, b.cost) < (a.excess, a.cost) { b } else { a }
}

/// Half of a box's surface; none for the empty box.
fn half_area(bounds: &Bounds) -> f64 {
    let [x, y, z] = (bounds.upper.as_dvec3() - bounds.lower.as_dvec3()).to_array();
    x * y + y * z + z * x
}

#[cfg(test)]
mod tests {
    use equilux_common::scene::WorldTriangle;

    use super::super::cells::Cells;
    use super::*;

    /// A cell for each small triangle at one of these places.
    fn cells(places: &[[f32; 3]]) -> Cells {
        let mut cells = Cells::new();
        for &[x, y, z] in places {
            let corners = [[x, y, z], [x + 0.1, y, z], [x, y + 0.1, z]];
            let (normals, texcoords) = (None, None);
            cells.add(&WorldTriangle { corners, normals, texcoords, material: 0 }, 1);
        }
        cells
    }

    #[test]
    fn clumps_stay_together() {
        // Two clumps of 40 and of 24, far apart: of 8 parts, 5 and 3.
        let clump = |x: f32, count: u32| {
            (0..count).map(move |n| [x + (n % 4) as f32, (n / 4) as f32, (n % 3) as f32])
        };
        let places: Vec<_> = clump(0.0, 40).chain(clump(1000.0, 24)).collect();
        let cells = cells(&places);
        let regions = bisect(cells.as_slice(), 8, 8);
        assert_eq!(regions.len(), 8);
        for region in &regions {
            let first = region.cells.iter().filter(|&&cell| cell < 40).count();
            assert!(first == 0 || first == region.cells.len(), "{region:?}");
            assert!((6..=10).contains(&region.cells.len()), "{region:?}");
        }
    }

    #[test]
    fn there_are_as_many_parts_as_asked_for() {
        let places: Vec<_> = (0..50).map(|n| [(n * n) as f32, n as f32, 0.0]).collect();
        let cells = cells(&places);
        for part_count in [1, 2, 3, 49, 50, 51, 1000] {
            for regions_max in [1, 4, 5000] {
                let regions = bisect(cells.as_slice(), part_count, regions_max);
                let counts = regions.iter().map(|region| region.part_count);
                assert_eq!(counts.sum::<u32>(), part_count);
                let mut all: Vec<u32> =
                    regions.iter().flat_map(|region| region.cells.clone()).collect();
                all.sort_unstable();
                assert_eq!(all, (0..50).collect::<Vec<_>>());
            }
        }
        assert_eq!(bisect(&[], 3, 10), [Region { cells: Vec::new(), part_count: 3 }]);
    }
}
