//! A cell of the city: its ground, and a block divided into lots.

use super::Detail;
use super::building::{Lot, raise, raise_landmark};
use super::layout::{Cell, Kind, Rect, SIDEWALK};
use super::mesh::Mesh;
use super::street;

/// Builds all of a cell.
pub(super) fn build(mesh: &mut Mesh, cell: &Cell, detail: Detail) {
    street::pave(mesh, cell, detail);
    match cell.kind {
        Kind::Landmark => raise_landmark(mesh, cell, detail),
        Kind::Park => street::park(mesh, cell, detail),
        Kind::Buildings => lots(cell).iter().for_each(|lot| raise(mesh, cell, lot, detail)),
    }
}

/// Divides a block: the more of a downtown it is in, the larger are the lots.
fn lots(cell: &Cell) -> Vec<Lot> {
    let mut random = cell.random(0x1075, 0);
    let luck = random.unit() - 0.9 * cell.centrality();
    let (columns, rows) = match luck {
        _ if luck < -0.35 => (1, 1),
        _ if luck < 0.0 => (2, 1),
        _ if luck < 0.35 => (2, 2),
        _ if luck < 0.75 => (3, 2),
        _ => (4, 2),
    };
    let Rect { x, z } = cell.block().inset(SIDEWALK);
    let edge = |(low, high): (f64, f64), part: usize, count: usize| {
        low + (high - low) * part as f64 / count as f64
    };
    let lot = |index: usize| {
        let (column, row) = (index % columns, index / columns);
        Lot {
            rect: Rect {
                x: (edge(x, column, columns), edge(x, column + 1, columns)),
                z: (edge(z, row, rows), edge(z, row + 1, rows)),
            },
            is_open: [row + 1 == rows, column + 1 == columns, row == 0, column == 0],
            number: index as u64,
        }
    };
    (0..columns * rows).map(lot).collect()
}
