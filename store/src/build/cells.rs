//! Cells: what a survey of triangles remembers of where they are, in a memory that does not grow
//! with their number.
//!
//! Space is cut into cubes whose side is a power of two, and triangles that lie in the same cube
//! with their middle, and are about equally large, share a cell: their number in bytes and the box
//! around them. Nothing need be known of the model before. The grid begins as fine as numbers are,
//! with a cell to every triangle; whenever there are too many cells, or one too far out, the side
//! is doubled and cells merge. So a small model is known exactly, and a large one has always
//! between an eighth of the most cells and all of them, where it has surfaces and nowhere else.
//!
//! That large triangles have cells of their own keeps the boxes of the others tight: a ground plane
//! does not make the crowd upon it large.

use equilux_common::scene::WorldTriangle;
use equilux_render::geometry::Bounds;
use glam::Vec3;

/// Most cells of a survey. The table of them then takes 28 MiB, and bisecting them some tenths of
/// a second for each time that the number of parts doubles.
const CELLS_MAX: usize = 1 << 19;

/// Places in the hash table, which is hence never more than half full.
const SLOTS: usize = 2 * CELLS_MAX;

/// A place in the hash table that holds no cell.
const VACANT: u32 = u32::MAX;

/// Bits of each of a cell's three coordinates.
const COORDINATE_BITS: u32 = 18;

/// Coordinates count from this far below the origin.
const COORDINATE_OFFSET: i32 = 1 << (COORDINATE_BITS - 1);

/// Binary exponent of the finest side.
const FINEST_EXPONENT: i32 = -100;

/// Distances from the origin below 2⁻⁹⁰ count as none: scaled down, they could vanish.
const NEGLIGIBLE: f32 = 1.0 / (1_u128 << 90) as f32;

/// What single precision adds to binary exponents.
const EXPONENT_BIAS: i32 = 127;

/// Triangles that lie together.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    key: u64,
    /// Around all of them.
    pub(super) bounds: Bounds,
    /// Bytes that they will take in a partition.
    pub(super) bytes: u64,
}

/// The cells of some triangles.
#[derive(Debug)]
pub(super) struct Cells {
    grid: Grid,
    cells: Vec<Cell>,
    /// By hash of the key: positions in `cells`.
    slots: Vec<u32>,
    /// The cell of the last triangle, which often is that of the next one, too.
    last: u32,
}

impl Cells {
    pub(super) fn new() -> Self {
        let grid = Grid { origin: Vec3::ZERO, exponent: FINEST_EXPONENT };
        Self { grid, cells: Vec::new(), slots: vec![VACANT; SLOTS], last: 0 }
    }

    /// All cells, in the order in which the triangles touched them.
    pub(super) fn as_slice(&self) -> &[Cell] {
        &self.cells
    }

    /// Adds a triangle that will take so many bytes.
    pub(super) fn add(&mut self, triangle: &WorldTriangle, bytes: u64) {
        let bounds = bounds_of(triangle);
        if self.cells.is_empty() {
            self.grid.origin = middle(&bounds);
        }
        let key = loop {
            match self.grid.key(&bounds) {
                Some(key) => break key,
                None => self.coarsen(),
            }
        };
        let cell = Cell { key, bounds, bytes };
        match self.find(key) {
            Ok(at) => self.cells[at as usize].merge(&cell),
            Err(slot) => self.insert(slot, cell),
        }
        while self.cells.len() == CELLS_MAX {
            self.coarsen();
        }
    }

    /// The position of a triangle's cell; none if there is none that holds it, so that it cannot
    /// have been added.
    pub(super) fn position(&mut self, triangle: &WorldTriangle) -> Option<usize> {
        let bounds = bounds_of(triangle);
        let at = self.find(self.grid.key(&bounds)?).ok()? as usize;
        let around = &self.cells[at].bounds;
        (around.joined(&bounds) == *around).then_some(at)
    }

    /// Where the cell of this key is, or else the slot where it belongs.
    #[inline]
    fn find(&mut self, key: u64) -> Result<u32, usize> {
        if self.cells.get(self.last as usize).is_some_and(|cell| cell.key == key) {
            return Ok(self.last);
        }
        let mut slot = slot_of(key);
        loop {
            let at = self.slots[slot];
            if at == VACANT {
                return Err(slot);
            }
            if self.cells[at as usize].key == key {
                self.last = at;
                return Ok(at);
            }
            slot = (slot + 1) % SLOTS;
        }
    }

    fn insert(&mut self, slot: usize, cell: Cell) {
        self.last = u32::try_from(self.cells.len()).expect("cells are limited");
        self.slots[slot] = self.last;
        self.cells.push(cell);
    }

    /// Doubles the side of all cells.
    fn coarsen(&mut self) {
        self.grid.exponent += 1;
        self.slots.fill(VACANT);
        let cells = std::mem::take(&mut self.cells);
        self.cells.reserve(CELLS_MAX.min(cells.len()));
        for mut cell in cells {
            cell.key = self.grid.coarser_key(cell.key);
            match self.find(cell.key) {
                Ok(at) => self.cells[at as usize].merge(&cell),
                Err(slot) => self.insert(slot, cell),
            }
        }
    }
}

impl Cell {
    fn merge(&mut self, other: &Self) {
        self.bounds = self.bounds.joined(&other.bounds);
        self.bytes += other.bytes;
    }
}

/// Where cells are.
#[derive(Clone, Copy, Debug)]
struct Grid {
    /// A corner of some cell, whatever their side.
    origin: Vec3,
    /// Binary exponent of the side.
    exponent: i32,
}

impl Grid {
    /// What tells the cell of a triangle within `bounds` from all others: the coordinates, from
    /// bit 8 on, and the exponent of the triangle's size, or of the side if that is larger. None
    /// if it is too far out.
    #[inline]
    fn key(&self, bounds: &Bounds) -> Option<u64> {
        let scale = f32::from_bits(((EXPONENT_BIAS - self.exponent) as u32) << 23);
        let place = middle(bounds) - self.origin;
        let mut cell = [0; 3];
        for (coordinate, place) in cell.iter_mut().zip(place.to_array()) {
            // Scaling and rounding down are exact, so that the cell of a triangle is the same
            // whether it is found in this grid or in a finer one that became this one.
            let place = if place.abs() < NEGLIGIBLE { 0.0 } else { place * scale };
            if place.abs() >= COORDINATE_OFFSET as f32 {
                return None;
            }
            *coordinate = (floor(place) + COORDINATE_OFFSET) as u64;
        }
        let size = (bounds.upper - bounds.lower).max_element();
        let class = u64::from(size.to_bits() >> 23).max(self.least_class());
        Some(join(cell, class))
    }

    /// The key, in this grid, of what had `key` in the one that was twice as fine.
    fn coarser_key(&self, key: u64) -> u64 {
        let half_offset = COORDINATE_OFFSET as u64 / 2;
        let mask = (1 << COORDINATE_BITS) - 1;
        let coordinates = std::array::from_fn(|axis| {
            let coordinate = (key >> (8 + COORDINATE_BITS * axis as u32)) & mask;
            coordinate / 2 + half_offset
        });
        join(coordinates, (key & 0xFF).max(self.least_class()))
    }

    /// The class of triangles that are no larger than a cell.
    fn least_class(&self) -> u64 {
        u64::try_from(self.exponent + EXPONENT_BIAS).expect("the side is a number")
    }
}

#[inline]
fn join([x, y, z]: [u64; 3], class: u64) -> u64 {
    class | (x | (y | z << COORDINATE_BITS) << COORDINATE_BITS) << 8
}

/// Fibonacci hashing (Knuth, The Art of Computer Programming 6.4): the upper bits of a product.
#[inline]
const fn slot_of(key: u64) -> usize {
    (key.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> (u64::BITS - SLOTS.trailing_zeros())) as usize
}

/// Rounds a small number down. (`f32::floor` is a call into the C library where SSE 4.1 is not
/// taken for granted.)
#[inline]
fn floor(number: f32) -> i32 {
    let toward_zero = number as i32;
    toward_zero - i32::from(number < toward_zero as f32)
}

#[inline]
fn middle(bounds: &Bounds) -> Vec3 {
    0.5 * (bounds.lower + bounds.upper)
}

#[inline]
pub(super) fn bounds_of(triangle: &WorldTriangle) -> Bounds {
    let [a, b, c] = triangle.corners.map(Vec3::from);
    Bounds { lower: a.min(b).min(c), upper: a.max(b).max(c) }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn any_coordinate() -> impl Strategy<Value = f32> {
        prop_oneof![
            -1.0f32..1.0,
            -1e-30f32..1e-30,
            -1e11f32..1e11,
            Just(0.0),
            Just(1e-45),
            Just(-1e-45)
        ]
    }

    fn any_triangle() -> impl Strategy<Value = WorldTriangle> {
        let corner = proptest::array::uniform3(any_coordinate());
        let corners = (corner, 0.0f32..4.0, any::<bool>()).prop_map(|(a, size, is_small)| {
            let size = if is_small { size * 1e-20 } else { size };
            [a, a.map(|x| x + size), a.map(|x| x - size / 3.0)]
        });
        corners.prop_map(|corners| WorldTriangle {
            corners,
            normals: None,
            texcoords: None,
            material: 0,
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn a_triangle_is_found_in_its_cell_however_coarse_it_became(
            triangles in proptest::collection::vec(any_triangle(), 1..60),
            doublings in 0usize..20,
        ) {
            let mut cells = Cells::new();
            triangles.iter().for_each(|triangle| cells.add(triangle, 3));
            (0..doublings).for_each(|_| cells.coarsen());
            let bytes = cells.as_slice().iter().map(|cell| cell.bytes);
            prop_assert_eq!(bytes.sum::<u64>(), 3 * triangles.len() as u64);
            for triangle in &triangles {
                prop_assert!(cells.position(triangle).is_some(), "{:?}", triangle);
            }
        }
    }

    #[test]
    fn many_triangles_share_cells_and_giants_have_their_own() {
        let triangle = |x: u32, z: u32, size: f32| {
            let (x, z) = (x as f32, z as f32);
            WorldTriangle {
                corners: [[x, 0.0, z], [x + size, 0.0, z], [x, 0.0, z + size]],
                normals: None,
                texcoords: None,
                material: 0,
            }
        };
        let mut cells = Cells::new();
        for place in 0..2 * CELLS_MAX as u32 {
            cells.add(&triangle(place % 1024, place / 1024, 1.0), 1);
        }
        let giant = triangle(512, 512, 1000.0);
        cells.add(&giant, 1);
        let count = cells.as_slice().len();
        assert!((CELLS_MAX / 8..CELLS_MAX).contains(&count), "{count}");
        let at = cells.position(&giant).expect("it was added");
        assert_eq!(cells.as_slice()[at].bytes, 1);
        let small = cells.as_slice().iter().enumerate().filter(|(cell, _)| *cell != at);
        let largest = small.map(|(_, cell)| (cell.bounds.upper - cell.bounds.lower).max_element());
        assert!(largest.fold(0.0, f32::max) < 10.0);
    }
}
