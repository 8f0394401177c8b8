//! How large a city is and how fine, so that it has the triangles that were asked for.
//!
//! One number decides: how far the plainest buildings reach. Finer ones reach a fixed part of that,
//! until all blocks are as fine as can be. More reach is never fewer triangles, so the largest one
//! that keeps within the budget is found by bisection, over blocks that are counted when asked for.
//! What is left over is for lit windows and, down to the last quad, for leaves.

use super::block;
use super::finish::Finish;
use super::layout::{Cell, Kind, REACH, cells};
use super::mesh::{Mesh, Quota, Tally};
use super::{DETAILS, Detail};

/// What part of the quads blocks may have; the others are lit windows and leaves.
const BLOCKS_PART: f64 = 0.86;
/// What part of the quads may emit, and how many of them at most.
const EMITTERS_PART: f64 = 0.0045;
const EMITTERS_MAX: f64 = 90_000.0;
/// What part of the windows of a block is lit at most.
const LIT_MAX: f64 = 0.3;
/// Where a block has half as many lit windows, and half as many leaves, as it would have nearby.
const LIT_HALF_DISTANCE: f64 = 420.0;
const LEAVES_HALF_DISTANCE: f64 = 130.0;
/// What part of the reach is as fine as can be, at last.
const FINE_PART: f64 = 0.045;
/// Where the search for the reach begins, and by what it grows.
const REACH_MIN: f64 = 40.0;
const REACH_GROWTH: f64 = 1.2;
/// Halvings of the interval in which the reach lies: enough to part any two blocks.
const HALVINGS: u32 = 40;

/// How far a detail reaches, by how far boxes do: from some reach on, a fixed part of the rest. A
/// city has to have a skyline before anything in it is worth a closer look.
const fn reach(detail: Detail, whole: f64) -> f64 {
    let (part, from) = match detail {
        Detail::Massing => (1.0, 0.0),
        Detail::Bands => (0.9, 250.0),
        Detail::Grid => (0.5, 420.0),
        Detail::Windows => (0.16, 600.0),
        Detail::Fine => (FINE_PART, 800.0),
    };
    part * (whole - from)
}

/// A cell, and how it is to be built.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plot {
    pub(super) cell: Cell,
    pub(super) detail: Detail,
    pub(super) lit: Quota,
    pub(super) leaves: Quota,
}

impl Plot {
    /// Builds it.
    pub(super) fn build(&self, mesh: &mut Mesh) {
        mesh.lit = self.lit;
        mesh.leaves = self.leaves;
        block::build(mesh, &self.cell, self.detail);
    }
}

/// Plots for at most so many quads.
pub(super) fn plots(quads: u64) -> Vec<Plot> {
    let mut search = Search::new();
    let budget = (quads as f64 * BLOCKS_PART) as u64;
    let reach = search.reach_within(budget);
    let mut chosen = search.chosen(reach);
    let spent: u64 = chosen.iter().map(|(_, tally)| tally.quads).sum();
    let emitting: u64 = chosen.iter().map(|(_, tally)| tally.emitters).sum();
    let may_emit = (quads as f64 * EMITTERS_PART).min(EMITTERS_MAX) as u64;
    let room = quads.saturating_sub(spent);
    let lit = light(&mut chosen, may_emit.saturating_sub(emitting).min(room));
    hang_leaves(&mut chosen, room - lit);
    chosen.into_iter().map(|(plot, _)| plot).collect()
}

/// Shares out lit windows, and says how many there are.
fn light(chosen: &mut [(Plot, Tally)], wanted: u64) -> u64 {
    let weight = |plot: &Plot, tally: &Tally| {
        tally.windows as f64 * falloff(plot.cell.distance, LIT_HALF_DISTANCE)
    };
    share_out(chosen, wanted, weight, |plot, tally, share| {
        let most = (tally.windows as f64 * LIT_MAX) as u64;
        plot.lit = Quota { wanted: share.min(most), left: tally.windows };
    });
    chosen.iter().map(|(plot, _)| plot.lit.wanted).sum()
}

/// Shares out leaves, all of them.
fn hang_leaves(chosen: &mut [(Plot, Tally)], wanted: u64) {
    let weight = |plot: &Plot, tally: &Tally| {
        tally.trees as f64 * falloff(plot.cell.distance, LEAVES_HALF_DISTANCE)
    };
    share_out(chosen, wanted, weight, |plot, tally, share| {
        plot.leaves = Quota { wanted: share, left: tally.trees };
    });
}

fn falloff(distance: f64, half: f64) -> f64 {
    1.0 / (1.0 + (distance / half) * (distance / half))
}

/// Shares `wanted` out by weight, so that the shares add up to it; if no one has a weight, to none.
fn share_out(
    chosen: &mut [(Plot, Tally)],
    wanted: u64,
    weight: impl Fn(&Plot, &Tally) -> f64,
    mut give: impl FnMut(&mut Plot, &Tally, u64),
) {
    let total: f64 = chosen.iter().map(|(plot, tally)| weight(plot, tally)).sum();
    let (mut sum, mut given) = (0.0, 0);
    for (plot, tally) in chosen {
        sum += weight(plot, tally);
        let until = if sum >= total { wanted } else { (wanted as f64 * (sum / total)) as u64 };
        let share = if weight(plot, tally) > 0.0 { until.saturating_sub(given) } else { 0 };
        given += share;
        give(plot, tally, share);
    }
}

/// All cells, and what was counted of them so far.
struct Search {
    cells: Vec<Cell>,
    tallies: Vec<[Option<Tally>; DETAILS.len()]>,
}

impl Search {
    fn new() -> Self {
        let cells = cells();
        let tallies = vec![[None; DETAILS.len()]; cells.len()];
        Self { cells, tallies }
    }

    /// The largest reach whose blocks have at most `budget` quads.
    fn reach_within(&mut self, budget: u64) -> f64 {
        let most = 2.0 * REACH / FINE_PART;
        let mut fits = 0.0;
        let mut exceeds = REACH_MIN;
        while self.keeps_within(budget, exceeds) {
            if exceeds > most {
                return exceeds;
            }
            (fits, exceeds) = (exceeds, exceeds * REACH_GROWTH);
        }
        for _ in 0..HALVINGS {
            let middle = (fits + exceeds) / 2.0;
            if self.keeps_within(budget, middle) {
                fits = middle;
            } else {
                exceeds = middle;
            }
        }
        fits
    }

    /// Whether the blocks within a reach have at most `budget` quads. Counts no more than it must.
    fn keeps_within(&mut self, budget: u64, reach: f64) -> bool {
        let mut sum = 0;
        for index in 0..self.cells.len() {
            if let Some(detail) = detail_of(&self.cells[index], reach) {
                sum += self.tally(index, detail).quads;
                if sum > budget {
                    return false;
                }
            }
        }
        true
    }

    fn tally(&mut self, index: usize, detail: Detail) -> Tally {
        let cell = &self.cells[index];
        *self.tallies[index][detail as usize].get_or_insert_with(|| {
            let mut mesh = Mesh::counting();
            block::build(&mut mesh, cell, detail);
            mesh.tally()
        })
    }

    /// The plots of a reach.
    fn chosen(&mut self, reach: f64) -> Vec<(Plot, Tally)> {
        let mut chosen = Vec::new();
        for index in 0..self.cells.len() {
            let cell = self.cells[index];
            if let Some(detail) = detail_of(&cell, reach) {
                let none = Quota::default();
                let plot = Plot { cell, detail, lit: none, leaves: none };
                chosen.push((plot, self.tally(index, detail)));
            }
        }
        chosen
    }
}

/// How a cell is built in a city of this reach, if at all. The landmark is in every city.
fn detail_of(cell: &Cell, whole: f64) -> Option<Detail> {
    let least = (cell.kind == Kind::Landmark).then_some(Detail::Massing);
    let reached = |detail: &&Detail| cell.distance < reach(**detail, whole);
    DETAILS.iter().rev().find(reached).copied().or(least)
}

/// Vertices and faces of every finish.
pub(super) fn counts(plots: &[Plot]) -> Vec<(u64, u64)> {
    let mut mesh = Mesh::counting();
    plots.iter().for_each(|plot| plot.build(&mut mesh));
    super::horizon(&mut mesh);
    Finish::ALL.iter().map(|finish| mesh.counts(*finish)).collect()
}
