//! The wall with the windows (z = 0): blinds before the panes, sills and radiators below, sky
//! behind.

use super::palette::*;
use super::{BAY_LENGTH, Bay, HEIGHT};
use crate::frame::{Frame, sin_cos};
use crate::random::Random;
use crate::shape::Shape;
use crate::stage::Stage;
use crate::vector::{Vector, vector};

/// Middles of the windows of a bay.
const MIDDLES: [f64; 3] = [1.2, 3.6, 6.0];
const OPENING: f64 = 1.9;
const SILL: f64 = 0.92;
const LINTEL: f64 = 2.46;
/// How deep a window lies in the wall.
const REVEAL: f64 = 0.22;
/// How far down the blinds are let, and how the slats are turned.
const BLINDS: [(f64, f64); 3] = [(0.42, 12.0), (0.66, 14.0), (0.34, 12.0)];
const PITCH: f64 = 0.036;
const SLATS: u32 = 40;

/// The windows of a bay, and all that belongs to them.
pub(super) fn row(stage: &mut Stage, bay: &Bay) {
    stage.put("window_wall", &WALL, &bay.corner, wall());
    let pane =
        |x| Shape::panel(OPENING, LINTEL - SILL).placed(&Frame::at(x, SILL, -REVEAL - 0.002));
    let sky = MIDDLES.into_iter().map(pane).reduce(Shape::and);
    stage.put("sky", &SKY, &bay.corner, sky.unwrap_or_default());
    for (number, x) in MIDDLES.into_iter().enumerate() {
        let at = bay.corner.shifted(x, SILL, 0.0);
        casement(stage, &at);
        let (drop, turn) = BLINDS[number];
        let random = Random::new(0xB11D, bay.index * 3 + number as u64);
        blind(stage, &at.shifted(0.0, 0.0, -0.05), (drop, turn), random);
        radiator(stage, &at.shifted(0.0, 0.12 - SILL, 0.075));
    }
}

/// The wall around the openings and their reveals, as one object.
fn wall() -> Shape {
    let quad = |x0: f64, x1: f64, y0: f64, y1: f64| {
        vec![vector(x0, y0, 0.), vector(x1, y0, 0.), vector(x1, y1, 0.), vector(x0, y1, 0.)]
    };
    let mut polygons =
        vec![quad(0.0, BAY_LENGTH, 0.0, SILL), quad(0.0, BAY_LENGTH, LINTEL, HEIGHT)];
    let mut from = 0.0;
    for middle in MIDDLES {
        let (left, right) = (middle - OPENING / 2.0, middle + OPENING / 2.0);
        polygons.push(quad(from, left, SILL, LINTEL));
        polygons.extend(reveal(left, right));
        from = right;
    }
    polygons.push(quad(from, BAY_LENGTH, SILL, LINTEL));
    Shape::polygons(polygons)
}

/// The four sides of an opening, facing into it.
fn reveal(left: f64, right: f64) -> Vec<Vec<Vector>> {
    let around = [(left, SILL), (right, SILL), (right, LINTEL), (left, LINTEL)];
    let deep = |(x, y): (f64, f64)| vector(x, y, -REVEAL);
    let near = |(x, y): (f64, f64)| vector(x, y, 0.0);
    (0..4)
        .map(|side| {
            let (a, b) = (around[side], around[(side + 1) % 4]);
            vec![near(a), near(b), deep(b), deep(a)]
        })
        .collect()
}

/// Frame, mullion, handle and sill. `at` is in the middle of the opening's lower edge.
fn casement(stage: &mut Stage, at: &Frame) {
    let height = LINTEL - SILL;
    let frame = at.shifted(0.0, 0.0, -0.17);
    for x in [-OPENING / 2.0 + 0.032, 0.0, OPENING / 2.0 - 0.032] {
        let post = Shape::cuboid(0.06, height - 0.006, 0.05);
        stage.put("window_post", &WHITE_PAINT, &frame.shifted(x, 0.003, 0.0), post);
    }
    for x in [-0.459, 0.459] {
        for y in [0.003, height - 0.063] {
            let rail = Shape::cuboid(0.856, 0.06, 0.046);
            stage.put("window_rail", &WHITE_PAINT, &frame.shifted(x, y, 0.0), rail);
        }
    }
    let handle = Shape::cuboid(0.02, 0.12, 0.018);
    stage.put("window_handle", &STEEL, &frame.shifted(0.0, 0.6, 0.036), handle);
    let sill = Shape::cuboid(OPENING + 0.12, 0.03, 0.2);
    stage.put("window_sill", &WHITE_LACQUER, &at.shifted(0.0, -0.034, 0.102), sill);
}

/// A venetian blind: `drop` is the part of the opening that it covers.
fn blind(stage: &mut Stage, at: &Frame, (drop, turn): (f64, f64), mut random: Random) {
    let top = LINTEL - SILL - 0.055;
    let width = OPENING - 0.04;
    stage.put("head_rail", &SLAT, &at.shifted(0.0, top, 0.0), Shape::cuboid(width, 0.045, 0.04));
    let lowest = top - (top - 0.02) * drop;
    let hanging = (((top - lowest - 0.03) / PITCH) as u32).min(SLATS);
    for slat in 0..SLATS {
        // Those that do not hang lie in a stack on the bottom rail.
        let (y, turn) = if slat < hanging {
            (top - PITCH * (f64::from(slat) + 0.7), turn + random.between(-1.5, 1.5))
        } else {
            (lowest + 0.02 + 0.0035 * f64::from(SLATS - slat), 0.0)
        };
        stage.put("slat", &SLAT, &at.shifted(0.0, y, 0.0).tilted(turn), slat_shape(width - 0.01));
    }
    let rail = Shape::cuboid(width - 0.005, 0.016, 0.03);
    stage.put("bottom_rail", &SLAT, &at.shifted(0.0, lowest, 0.0), rail);
    for x in [-0.7, 0.0, 0.7] {
        let cord = Shape::cuboid(0.003, top - lowest - 0.017, 0.0015);
        stage.put("blind_cord", &CORD, &at.shifted(x, lowest + 0.0165, 0.0205), cord);
    }
    let wand = Shape::cylinder(0.004, 0.75, 6);
    stage.put("blind_wand", &WHITE_LACQUER, &at.shifted(-0.86, top - 0.76, 0.035), wand);
}

/// A slat: a shallow arc, two faces wide.
fn slat_shape(width: f64) -> Shape {
    let (sin, cos) = sin_cos(16.0);
    Shape::strip(
        &[(0.0165 * cos, -0.0165 * sin), (0.0, 0.0), (-0.0165 * cos, -0.0165 * sin)],
        width,
    )
}

/// A radiator of upright fins under a window.
fn radiator(stage: &mut Stage, at: &Frame) {
    const FINS: u32 = 22;
    for fin in 0..FINS {
        let x = 0.066 * (f64::from(fin) - f64::from(FINS - 1) / 2.0);
        let shape = Shape::cuboid(0.045, 0.6, 0.07);
        stage.put("radiator_fin", &RADIATOR, &at.shifted(x, 0.0, 0.0), shape);
    }
    for y in [0.04, 0.54] {
        let pipe = Shape::bar(vector(-0.76, y, -0.012), vector(0.76, y, -0.012), 0.014, 8);
        stage.put("radiator_pipe", &RADIATOR, at, pipe);
    }
    let valve = Shape::cylinder(0.022, 0.06, 12);
    stage.put("radiator_valve", &WHITE_LACQUER, &at.shifted(0.78, 0.5, 0.01), valve);
}
