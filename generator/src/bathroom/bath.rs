//! A free-standing bath on a bed of pebbles, before the mosaic.

use super::Bay;
use super::palette::*;
use crate::frame::Frame;
use crate::random::Random;
use crate::shape::{Shape, arc};
use crate::stage::Stage;
use crate::vector::vector;

/// Middle of the bath on the floor.
const MIDDLE: (f64, f64) = (3.98, 1.12);
/// Half its length along z, and half its width along x.
const HALF: (f64, f64) = (0.36, 0.78);
/// Half the sides of the bed, inside.
const BED: (f64, f64) = (0.54, 0.98);
/// Distance of pebbles.
const CELL: f64 = 0.045;

/// Puts bath, tap and the rim of the bed.
pub(super) fn bath(stage: &mut Stage, bay: &Bay) {
    let at = bay.corner.shifted(MIDDLE.0, 0.001, MIDDLE.1);
    tub(stage, &at);
    tap(stage, &at.shifted(-0.1, 0.0, -0.88));
    rim(stage, &at);
    caddy(stage, &at.shifted(0.0, 0.592, 0.1));
}

fn tub(stage: &mut Stage, at: &Frame) {
    let outside = [(0.0, 0.0), (0.72, 0.0), (0.8, 0.06), (0.87, 0.25), (0.95, 0.5), (1.0, 0.58)];
    let lip = [(1.0, 0.59), (0.95, 0.59)];
    let inside = [(0.92, 0.57), (0.85, 0.4), (0.78, 0.18), (0.68, 0.1), (0.0, 0.08)];
    let stretch = |shape: Shape| shape.scaled(HALF.0, 1.0, HALF.1);
    // The outside is enamelled in colour, lip and inside are white.
    let outside = [&outside[..], &lip[..1]].concat();
    stage.put("bath", &ENAMEL, at, stretch(Shape::lathe(&outside, 48)));
    let inside = [&lip[..], &inside[..]].concat();
    stage.put("bath_lining", &PORCELAIN, at, stretch(Shape::lathe(&inside, 48)));
    let water = Shape::lathe(&[(0.865, 0.44), (0.0, 0.44)], 48);
    stage.put("water", &WATER, at, stretch(water));
}

/// A tap that stands on the floor, with a hand shower.
fn tap(stage: &mut Stage, at: &Frame) {
    stage.put("tap_foot", &CHROME, at, Shape::cylinder(0.04, 0.015, 24));
    let mut path = vec![vector(0.0, 0.015, 0.0), vector(0.0, 0.5, 0.0), vector(0.0, 0.86, 0.0)];
    path.extend(arc(
        vector(0.0, 0.88, 0.1),
        vector(0., 0., -0.1),
        vector(0., 0.1, 0.),
        (0.0, 170.0),
    ));
    stage.put("tap_spout", &CHROME, at, Shape::pipe(&path, 0.016, 16));
    let valve = Shape::bar(vector(-0.09, 0.7, 0.0), vector(0.09, 0.7, 0.0), 0.018, 16);
    stage.put("tap_valve", &CHROME, at, valve);
    for side in [-1.0, 1.0] {
        let knob = Shape::cylinder(0.026, 0.02, 20);
        let place = at.shifted(side * 0.091, 0.7, 0.0).rolled(-90.0 * side);
        stage.put("tap_knob", &CHROME, &place, knob);
    }
    let hose = arc(
        vector(-0.06, 0.66, 0.02),
        vector(0.0, 0.0, 0.02),
        vector(0.0, -0.3, 0.0),
        (20.0, 160.0),
    );
    stage.put("shower_hose", &CHROME, at, Shape::pipe(&hose, 0.006, 8));
    let head = [(0.0, 0.0), (0.045, 0.0), (0.04, 0.015), (0.012, 0.03), (0.012, 0.16), (0.0, 0.16)];
    stage.put(
        "hand_shower",
        &CHROME,
        &at.shifted(-0.06, 0.83, 0.03).tilted(-150.0),
        Shape::lathe(&head, 20),
    );
}

/// Four beams around the bed.
fn rim(stage: &mut Stage, at: &Frame) {
    for side in [-1.0, 1.0] {
        let beam = Shape::cuboid(0.05, 0.06, 2.0 * BED.1 + 0.1);
        stage.put("bed_beam", &TEAK, &at.shifted(side * (BED.0 + 0.025), 0.0, 0.0), beam);
        let beam = Shape::cuboid(2.0 * BED.0 - 0.002, 0.06, 0.05);
        stage.put("bed_beam", &TEAK, &at.shifted(0.0, 0.0, side * (BED.1 + 0.025)), beam);
    }
}

/// A tray of slats across the bath, with a book, a candle and a sponge.
fn caddy(stage: &mut Stage, at: &Frame) {
    for slat in 0..5 {
        let z = 0.034 * (f64::from(slat) - 2.0);
        stage.put("caddy_slat", &TEAK, &at.shifted(0.0, 0.0, z), Shape::cuboid(0.78, 0.014, 0.026));
    }
    let on_top = at.shifted(0.0, 0.0155, 0.0);
    stage.put(
        "book",
        &TOWELS[2],
        &on_top.shifted(0.14, 0.0, 0.0).turned(20.0),
        Shape::cuboid(0.16, 0.022, 0.12),
    );
    stage.put("candle", &WAX, &on_top.shifted(-0.2, 0.0, 0.02), Shape::cylinder(0.03, 0.07, 20));
    let sponge = Shape::sphere(0.05, 16, 10).scaled(1.0, 0.7, 0.8);
    stage.put("sponge", &TOWELS[3], &on_top.shifted(-0.06, 0.036, 0.0), sponge);
}

/// Fills the bed with `count` pebbles, or as many as it takes.
pub(super) fn pebbles(stage: &mut Stage, bay: &Bay, count: u64) {
    let mut random = Random::new(0x9EBB, bay.index);
    for (x, z) in cells(&mut random).into_iter().take(count as usize) {
        let at = bay.corner.shifted(MIDDLE.0 + x, 0.0185, MIDDLE.1 + z);
        let place = at.turned(random.between(0.0, 360.0)).tilted(random.between(-9.0, 9.0));
        let size = random.between(0.021, 0.027);
        let shape = Shape::pebble(size).scaled(1.0, 0.62, random.between(0.75, 0.95));
        stage.put("pebble", random.pick(&PEBBLES), &place, shape);
    }
}

/// Places for pebbles on the bed and not under the bath, in no particular order.
fn cells(random: &mut Random) -> Vec<(f64, f64)> {
    let (columns, rows) = ((BED.0 / CELL) as i32, (BED.1 / CELL) as i32);
    let all = (-columns..=columns).flat_map(|column| (-rows..=rows).map(move |row| (column, row)));
    let mut free: Vec<(f64, f64)> = all
        .map(|(column, row)| (f64::from(column) * CELL, f64::from(row) * CELL))
        .filter(|(x, z)| (x / HALF.0).powi(2) + (z / HALF.1).powi(2) > 0.68)
        .collect();
    // Fisher and Yates.
    for last in (1..free.len()).rev() {
        let other = (random.unit() * (last + 1) as f64) as usize;
        free.swap(last, other);
    }
    free.iter()
        .map(|(x, z)| (x + random.between(-0.008, 0.008), z + random.between(-0.008, 0.008)))
        .collect()
}
