//! The Hilbert curve over a grid that is neither square nor a power of two wide.

/// The cells of a grid along a Hilbert curve (Hilbert 1891) over the smallest square of a power of
/// two that holds it. Squares that lie beyond the grid are passed over whole.
pub(crate) fn cells(columns: u32, rows: u32) -> Vec<(u32, u32)> {
    let mut cells = Vec::with_capacity(columns as usize * rows as usize);
    let side = u64::from(columns.max(rows)).next_power_of_two().cast_signed();
    let whole = Square { corner: (0, 0), along: (1, 0), across: (0, 1), side };
    whole.visit((columns.into(), rows.into()), &mut cells);
    cells
}

/// A part of the curve: a square, entered at a corner, and left at the other end of the side
/// `along`.
#[derive(Clone, Copy)]
struct Square {
    corner: (i64, i64),
    along: (i64, i64),
    across: (i64, i64),
    side: i64,
}

impl Square {
    /// Puts down the cells that lie in a grid with so many columns and rows.
    fn visit(self, grid: (i64, i64), cells: &mut Vec<(u32, u32)>) {
        let last = self.at(self.side - 1, self.side - 1);
        if self.corner.0.min(last.0) >= grid.0 || self.corner.1.min(last.1) >= grid.1 {
            return;
        }
        if self.side == 1 {
            let number = |place: i64| u32::try_from(place).expect("within the grid");
            cells.push((number(self.corner.0), number(self.corner.1)));
            return;
        }
        self.quarters().into_iter().for_each(|quarter| quarter.visit(grid, cells));
    }

    fn at(self, along: i64, across: i64) -> (i64, i64) {
        let place = |corner, a, b| corner + a * along + b * across;
        (
            place(self.corner.0, self.along.0, self.across.0),
            place(self.corner.1, self.along.1, self.across.1),
        )
    }

    /// The first and the last lie across, the two between them along.
    fn quarters(self) -> [Self; 4] {
        let side = self.side / 2;
        let (along, across) = (self.along, self.across);
        let back = |(x, y): (i64, i64)| (-x, -y);
        let quarter = |corner, along, across| Self { corner, along, across, side };
        [
            quarter(self.corner, across, along),
            quarter(self.at(0, side), along, across),
            quarter(self.at(side, side), along, across),
            quarter(self.at(2 * side - 1, side - 1), back(across), back(along)),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_cell_is_visited_once(columns in 1u32..70, rows in 1u32..70) {
            let mut visited = cells(columns, rows);
            visited.sort_unstable();
            let all = (0..columns).flat_map(|x| (0..rows).map(move |y| (x, y)));
            prop_assert_eq!(visited, all.collect::<Vec<_>>());
        }
    }

    #[test]
    fn neighbors_on_the_curve_are_neighbors_on_the_grid() {
        assert_eq!(cells(2, 2), [(0, 0), (0, 1), (1, 1), (1, 0)]);
        for pair in cells(32, 32).windows(2) {
            assert_eq!(pair[0].0.abs_diff(pair[1].0) + pair[0].1.abs_diff(pair[1].1), 1);
        }
    }

    #[test]
    fn a_long_row_costs_no_more_than_its_cells() {
        assert_eq!(cells(1 << 16, 1).len(), 1 << 16);
    }
}
