//! The space: objects have positions in it, and workers own its regions.
//!
//! An iteration does what the paper describes of its reference 14 (Heirich 1996). Objects are drawn
//! towards those that they have to do with, by a step of the implicit diffusion of positions over
//! the guest (Heirich & Taylor 1995), which is stable however strong the ties. A worker's region is
//! its cell in a power diagram (Aurenhammer 1987): its site is drawn to the center of what it has,
//! and the cell's boundary pushed outwards while it has less than its share, inwards while it has
//! more. An object that lies in the cell of a neighbor goes there, if there is room.
//!
//! Everything is local: an object looks at the regions of the objects it is tied to.

use crate::clusters::{Clusters, Homes};
use crate::guest::Guest;

/// Iterations. Positions come within a percent of where they tend to in seven, for each leaves at
/// most half of the distance; loads follow them.
pub(crate) const ITERATIONS: u32 = 24;

/// How strongly ties draw, against the place in the model: β in (1 + β)x = x₀ + β · mean of x.
const DRAW: f64 = 1.0;

/// How fast boundaries move: part of the square of a cell's radius for a load that is off by all of
/// its share.
const PRESSURE: f64 = 0.5;

/// Weight of a cell at first, as part of its squared radius: larger cells reach farther. It would
/// be 5/3 if they were balls, but then one that spans two towns takes both.
const BALL: f64 = 0.3;

/// Part of its share that a cell takes in beyond it, while objects are on their way. What a cell
/// has no room for stays where it is, so no iteration leaves loads less even than they are
/// allowed to be.
const CROWDING: f64 = 0.1;

/// The cell of a worker.
#[derive(Clone, Copy, Default)]
struct Cell {
    site: [f64; 3],
    /// Square of the radius of its objects, by bytes.
    spread: f64,
    /// What is taken off the squared distance to its site.
    weight: f64,
}

/// Moves objects and boundaries, from these homes on.
pub(crate) fn diffuse_space(
    guest: &Guest,
    clusters: &Clusters,
    shares: &[u64],
    mut homes: Homes,
) -> Homes {
    let start: Vec<_> = guest.objects().iter().map(|it| it.position.map(f64::from)).collect();
    let mut positions = start.clone();
    let mut cells = vec![Cell::default(); shares.len()];
    place(&mut cells, clusters, &positions, &homes);
    for cell in &mut cells {
        cell.weight = cell.spread * BALL;
    }
    for _ in 0..ITERATIONS {
        positions = drawn(clusters, &start, &positions);
        let mut loads = place(&mut cells, clusters, &positions, &homes);
        for ((cell, &share), load) in cells.iter_mut().zip(shares).zip(&loads) {
            if share > 0 {
                let lack = (1.0 - load / share as f64).clamp(-1.0, 1.0);
                cell.weight += PRESSURE * cell.spread * lack;
            }
        }
        homes = assigned(clusters, &cells, shares, &positions, &homes, &mut loads);
    }
    homes
}

/// One step of (1 + β)x = x₀ + β · (mean of the x of those it is tied to, by affinity).
fn drawn(clusters: &Clusters, start: &[[f64; 3]], positions: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let step = |(object, &origin): (usize, &[f64; 3])| {
        let ties = clusters.ties(object);
        let affinity: f64 = ties.iter().map(|tie| tie.1 as f64).sum();
        let mut sum = [0.0; 3];
        for &(other, affinity) in ties {
            for axis in 0..3 {
                sum[axis] += affinity as f64 * positions[other as usize][axis];
            }
        }
        let draw = if affinity > 0.0 { DRAW } else { 0.0 };
        let mean = |axis: usize| if affinity > 0.0 { sum[axis] / affinity } else { 0.0 };
        [0, 1, 2].map(|axis| (origin[axis] + draw * mean(axis)) / (1.0 + draw))
    };
    start.iter().enumerate().map(step).collect()
}

/// Puts each site in the center of its objects; gives the bytes of each cell. A cell without
/// objects stays as it is.
fn place(
    cells: &mut [Cell],
    clusters: &Clusters,
    positions: &[[f64; 3]],
    homes: &Homes,
) -> Vec<f64> {
    let mut loads = vec![0.0; cells.len()];
    let mut sums = vec![[0.0; 3]; cells.len()];
    for (object, position) in positions.iter().enumerate() {
        let (home, bytes) = (homes.of(object) as usize, clusters.bytes(object) as f64);
        loads[home] += bytes;
        for axis in 0..3 {
            sums[home][axis] += bytes * position[axis];
        }
    }
    for ((cell, sum), &load) in cells.iter_mut().zip(sums).zip(&loads) {
        if load > 0.0 {
            *cell = Cell { site: sum.map(|it| it / load), spread: 0.0, ..*cell };
        }
    }
    for (object, position) in positions.iter().enumerate() {
        let home = homes.of(object) as usize;
        let part = clusters.bytes(object) as f64 / loads[home];
        cells[home].spread += part * squared_distance(*position, cells[home].site);
    }
    loads
}

/// Each object's cell: the nearest that has room, among its own and those of the objects that it is
/// tied to.
fn assigned(
    clusters: &Clusters,
    cells: &[Cell],
    shares: &[u64],
    positions: &[[f64; 3]],
    homes: &Homes,
    loads: &mut [f64],
) -> Homes {
    let limits: Vec<_> = shares.iter().map(|&share| share as f64 * (1.0 + CROWDING)).collect();
    let mut homes = homes.clone();
    for (object, &position) in positions.iter().enumerate() {
        let power = |home: u32| {
            let cell = cells[home as usize];
            squared_distance(position, cell.site) - cell.weight
        };
        let own = homes.of(object);
        let bytes = clusters.bytes(object) as f64;
        let ties = clusters.ties(object).iter();
        let others = ties.map(|tie| homes.of(tie.0 as usize));
        let others = others
            .filter(|&home| home != own && loads[home as usize] + bytes <= limits[home as usize]);
        let best = others
            .map(|home| (power(home), home))
            .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        if let Some((_, best)) = best.filter(|best| best.0 < power(own)) {
            loads[own as usize] -= bytes;
            loads[best as usize] += bytes;
            homes.set(object, best);
        }
    }
    homes
}

fn squared_distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    [0, 1, 2].map(|axis| (a[axis] - b[axis]) * (a[axis] - b[axis])).iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::guest::{Object, Tie};

    /// Objects side by side, each tied to the next.
    fn row(count: u16) -> Guest {
        let object = |x| Object { bytes: 1, position: [f32::from(x), 0.0, 0.0] };
        let tie = |x: u16| Tie { objects: [x.into(), usize::from(x) + 1], affinity: 1 };
        let ties = (0..count - 1).map(tie).collect();
        Guest::new((0..count).map(object).collect(), ties).expect("a valid guest")
    }

    #[test]
    fn regions_that_lie_across_each_other_part() {
        let guest = row(100);
        let clusters = Clusters::of(&guest, 2);
        // Nine in ten of each half are at home there, one in ten in the other one.
        let home = |object: u32| (object / 50) ^ u32::from(object % 10 == 4);
        let homes = Homes::new((0..100).map(home).collect(), 2);
        assert!(clusters.cut(&homes) > 20);
        let homes = diffuse_space(&guest, &clusters, &[50, 50], homes);
        assert_eq!(clusters.cut(&homes), 1);
    }

    #[test]
    fn boundaries_move_until_loads_are_what_they_should_be() {
        let guest = row(100);
        let clusters = Clusters::of(&guest, 2);
        let homes = Homes::new((0..100).map(|object| object / 50).collect(), 2);
        let homes = diffuse_space(&guest, &clusters, &[30, 70], homes);
        let load = homes.of_first(100).iter().filter(|&&home| home == 0).count();
        assert!((25..=35).contains(&load), "{load}");
        assert_eq!(clusters.cut(&homes), 1);
    }

    #[test]
    fn objects_are_drawn_half_of_the_way() {
        let guest = row(2);
        let clusters = Clusters::of(&guest, 1);
        let start = [[0.0; 3], [1.0, 0.0, 0.0]];
        let mut positions = start.to_vec();
        for _ in 0..60 {
            positions = drawn(&clusters, &start, &positions);
        }
        // x = (x₀ + x′) / 2 and x′ = (x₀′ + x) / 2.
        assert!((positions[0][0] - 1.0 / 3.0).abs() < 1e-12, "{positions:?}");
        assert!((positions[1][0] - 2.0 / 3.0).abs() < 1e-12, "{positions:?}");
    }
}
