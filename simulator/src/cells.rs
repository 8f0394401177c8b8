//! The cells of a recorded image, under the pixels of another one.

use std::time::Duration;

use equilux_common::costs::SceneCosts;
use equilux_common::job::Settings;
use equilux_common::unit::{Rect, Unit};

/// Which cell each pixel of an image lies in.
#[derive(Debug)]
pub(crate) struct CellGrid {
    cell_columns: u32,
    /// The column and the row of cells that each column and row of the image lies in.
    column_of: Vec<u32>,
    row_of: Vec<u32>,
}

impl CellGrid {
    /// For images of these settings.
    pub(crate) fn new(costs: &SceneCosts, settings: &Settings) -> Self {
        let side = costs.cell_side_pixels;
        let cells_of =
            |pixels, recorded| positions(pixels, recorded).map(|pixel| pixel / side).collect();
        Self {
            cell_columns: costs.cell_counts().0,
            column_of: cells_of(settings.width, costs.width),
            row_of: cells_of(settings.height, costs.height),
        }
    }

    /// The cell of a pixel.
    pub(crate) fn cell(&self, x: u32, y: u32) -> usize {
        let (column, row) = (self.column_of[x as usize], self.row_of[y as usize]);
        (column + row * self.cell_columns) as usize
    }
}

/// The mean compute time of one sample of every pixel of an image of this size.
pub(crate) fn pass_cost(costs: &SceneCosts, width: u32, height: u32) -> Duration {
    let counts = |side, recorded| {
        let mut pixels = vec![0_u64; recorded as usize];
        positions(side, recorded).for_each(|position| pixels[position as usize] += 1);
        pixels
    };
    let (columns, rows) = (counts(width, costs.width), counts(height, costs.height));
    let (cell_columns, _) = costs.cell_counts();
    let mut nanos = 0.0;
    for (y, row) in rows.iter().enumerate() {
        for (x, column) in columns.iter().enumerate() {
            let (cell_x, cell_y) =
                (x as u32 / costs.cell_side_pixels, y as u32 / costs.cell_side_pixels);
            let cell = &costs.cells[(cell_x + cell_y * cell_columns) as usize];
            nanos += (row * column) as f64 * cell.path_nanos();
        }
    }
    Duration::from_secs_f64(nanos / 1e9)
}

/// For each position of an image, the one of the recorded image at the same relative place.
fn positions(side: u32, recorded: u32) -> impl Iterator<Item = u32> {
    let place = move |pixel| u64::from(pixel) * u64::from(recorded) / u64::from(side.max(1));
    (0..side).map(move |pixel| u32::try_from(place(pixel)).unwrap_or(u32::MAX))
}

/// The rows of a unit's tile that a range of its paths touches.
pub(crate) fn rows(unit: &Unit, first_path: u32, end: u32) -> Rect {
    let ((_, y0, _), (_, y1, _)) = (unit.path(first_path), unit.path(end - 1));
    Rect { y0, y1: y1 + 1, ..unit.tile }
}
