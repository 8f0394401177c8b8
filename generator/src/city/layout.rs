//! Where things are: a grid of blocks on both sides of an avenue, seen from above the avenue.
//!
//! x runs across the avenue, which is at x = 0, and the camera looks along −z. The layout knows
//! nothing of how fine the city is, so that what stands near the camera is there in all sizes.

use super::mesh::Span;
use crate::random::Random;
use crate::stage::View;
use crate::vector::{Vector, vector};

/// Between the blocks left and right of the avenue.
pub(super) const AVENUE: f64 = 34.0;
/// Between other blocks.
pub(super) const STREET: f64 = 16.0;
/// Sides of a block along x and z, kerb to kerb.
pub(super) const BLOCK: (f64, f64) = (84.0, 64.0);
/// From the kerb to the buildings.
pub(super) const SIDEWALK: f64 = 4.5;
/// How far one block is from the next.
pub(super) const PITCH: (f64, f64) = (BLOCK.0 + STREET, BLOCK.1 + STREET);
/// Columns and rows on either side of the camera.
const COLUMNS: i32 = 60;
const ROWS: i32 = 95;
/// How far the city reaches, by [`Cell::distance`].
pub(super) const REACH: f64 = 7000.0;
/// What is behind the camera or beside the picture counts as this many times as far away.
const UNSEEN_FACTOR: f64 = 2.4;
/// The row in which a tower stands across the avenue.
const LANDMARK_ROW: i32 = -13;
/// Where the towers are highest, and how far the quarter of towers reaches along x and z.
const DOWNTOWN: (Vector, (f64, f64)) = (vector(0.0, 0.0, -920.0), (430.0, 480.0));

/// The picture.
pub(super) const VIEW: View = View {
    eye: vector(5.0, 47.0, 40.0),
    target: vector(-4.0, 33.0, -150.0),
    vfov: 44.0,
    size: (960, 540),
    filter: "tent",
};

/// A rectangle on the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rect {
    pub(super) x: Span,
    pub(super) z: Span,
}

impl Rect {
    /// With its sides moved inward.
    pub(super) fn inset(self, by: f64) -> Self {
        Self { x: (self.x.0 + by, self.x.1 - by), z: (self.z.0 + by, self.z.1 - by) }
    }

    pub(super) fn width(&self) -> f64 {
        self.x.1 - self.x.0
    }

    pub(super) fn depth(&self) -> f64 {
        self.z.1 - self.z.0
    }

    pub(super) fn middle(&self) -> (f64, f64) {
        ((self.x.0 + self.x.1) / 2.0, (self.z.0 + self.z.1) / 2.0)
    }
}

/// What stands on a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Buildings,
    Park,
    /// The tower across the avenue.
    Landmark,
}

/// A block and half of the streets around it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    pub(super) column: i32,
    pub(super) row: i32,
    pub(super) kind: Kind,
    /// From the eye to the nearest point of it, as seen; more if it is not in the picture.
    pub(super) distance: f64,
}

impl Cell {
    fn new(column: i32, row: i32) -> Self {
        let mut random = Random::new(0xB10C, key(column, row));
        let is_park = random.happens(0.045) || (column, row) == (-1, -3);
        let kind = if is_park { Kind::Park } else { Kind::Buildings };
        let mut cell = Self { column, row, kind, distance: 0.0 };
        cell.distance = seen_distance(&cell.ground());
        cell
    }

    fn landmark() -> Self {
        let cell = Self { column: 0, row: LANDMARK_ROW, kind: Kind::Landmark, distance: 0.0 };
        Self { distance: seen_distance(&cell.block()), ..cell }
    }

    /// The block, kerb to kerb.
    pub(super) fn block(&self) -> Rect {
        let z = f64::from(self.row) * PITCH.1 + STREET / 2.0;
        let z = (z, z + BLOCK.1);
        if self.kind == Kind::Landmark {
            return Rect { x: (-AVENUE / 2.0, AVENUE / 2.0), z };
        }
        let near = f64::from(rank(self.column)) * PITCH.0 + AVENUE / 2.0;
        Rect { x: mirrored((near, near + BLOCK.0), self.column), z }
    }

    /// All of the cell; neighbors share their edges to the bit.
    pub(super) fn ground(&self) -> Rect {
        let edge = |rank: i32| match rank {
            0 => 0.0,
            _ => f64::from(rank) * PITCH.0 + (AVENUE - STREET) / 2.0,
        };
        let rank = rank(self.column);
        let z = f64::from(self.row) * PITCH.1;
        Rect { x: mirrored((edge(rank), edge(rank + 1)), self.column), z: (z, z + PITCH.1) }
    }

    /// A stream of random numbers for one purpose (`salt`) and one thing of this cell.
    pub(super) fn random(&self, salt: u64, thing: u64) -> Random {
        let offset = if self.kind == Kind::Landmark { 1 << 40 } else { 0 };
        Random::new(salt, offset + (key(self.column, self.row) << 12) + thing)
    }

    /// How much of a downtown it is: 1 in its middle, next to nothing far away.
    pub(super) fn centrality(&self) -> f64 {
        let (x, z) = self.block().middle();
        let (center, (reach_x, reach_z)) = DOWNTOWN;
        let (x, z) = ((x - center.x) / reach_x, (z - center.z) / reach_z);
        let falling = 1.0 / (1.0 + x * x + z * z);
        falling * falling
    }

    /// How high a building here may be without hiding the avenue from the camera.
    pub(super) fn height_max(&self) -> f64 {
        let (x, z) = self.block().middle();
        let ahead = VIEW.eye.z - z;
        if x.abs() > 200.0 || ahead < -150.0 { 400.0 } else { (20.0 + 0.19 * ahead).max(17.0) }
    }
}

/// All cells of the largest city, from near to far.
pub(super) fn cells() -> Vec<Cell> {
    let columns = -COLUMNS..COLUMNS;
    let grid = columns.flat_map(|column| (-ROWS..ROWS).map(move |row| Cell::new(column, row)));
    let mut cells: Vec<Cell> = grid.filter(|cell| cell.distance < REACH).collect();
    cells.push(Cell::landmark());
    cells.sort_by(|a, b| {
        let place = |cell: &Cell| (cell.row, cell.column, cell.kind == Kind::Landmark);
        a.distance.total_cmp(&b.distance).then(place(a).cmp(&place(b)))
    });
    cells
}

/// How many columns from the avenue.
const fn rank(column: i32) -> i32 {
    if column < 0 { -1 - column } else { column }
}

fn mirrored((low, high): Span, column: i32) -> Span {
    if column < 0 { (-high, -low) } else { (low, high) }
}

fn key(column: i32, row: i32) -> u64 {
    // Both are small; the sums are positive.
    ((column + 1024) as u64) << 12 | (row + 1024) as u64
}

fn seen_distance(ground: &Rect) -> f64 {
    let nearest = |(low, high): Span, to: f64| to.clamp(low, high) - to;
    let (dx, dz) = (nearest(ground.x, VIEW.eye.x), nearest(ground.z, VIEW.eye.z));
    let distance = vector(dx, VIEW.eye.y, dz).length();
    // Half of the picture is this many times as wide as far away.
    const SLOPE: f64 = 0.78;
    let ahead = VIEW.eye.z - ground.z.0;
    let is_seen = ahead > 0.0 && dx.abs() < SLOPE * ahead;
    if is_seen { distance } else { distance * UNSEEN_FACTOR }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_lie_within_their_cells_and_cells_touch() {
        for (column, row) in [(0, 0), (-1, 0), (5, -7), (-9, 3)] {
            let cell = Cell::new(column, row);
            let (block, ground) = (cell.block(), cell.ground());
            assert!(ground.x.0 < block.x.0 && block.x.1 < ground.x.1);
            assert!(ground.z.0 < block.z.0 && block.z.1 < ground.z.1);
            assert_eq!(ground.x.1, Cell::new(column + 1, row).ground().x.0);
            assert_eq!(ground.z.1, Cell::new(column, row + 1).ground().z.0);
            assert!((block.width() - BLOCK.0).abs() + (block.depth() - BLOCK.1).abs() < 1e-9);
        }
    }

    #[test]
    fn the_city_lies_within_ten_kilometres_and_its_order_is_from_near_to_far() {
        let cells = cells();
        assert!(cells.len() > 4000, "{}", cells.len());
        assert!(cells.windows(2).all(|pair| pair[0].distance <= pair[1].distance));
        for cell in &cells {
            let Rect { x, z } = cell.ground();
            assert!([x.0, x.1, z.0, z.1].iter().all(|c| c.abs() < 9_500.0), "{cell:?}");
        }
    }
}
