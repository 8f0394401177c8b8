//! What lies about on desks: paper, notes, pens, mugs, and the stock of copy paper.

use super::Bay;
use super::desk::TOP;
use super::palette::*;
use crate::frame::Frame;
use crate::random::Random;
use crate::shape::{Shape, arc};
use crate::stage::Stage;
use crate::vector::vector;

/// Sheets in a tray of the paper stock, at most.
const TRAY_SHEETS: u64 = 60;
/// Trays of the paper stock, at most.
const TRAYS: u64 = 8;

/// Litters a desk; `place` tells it from all others.
pub(super) fn things(stage: &mut Stage, desk: &Frame, place: u64) {
    let mut random = Random::new(0xDE5C, place);
    mug(stage, &desk.shifted(0.4, TOP, 0.12).turned(random.between(0.0, 360.0)), place);
    pen_pot(stage, &desk.shifted(-0.5, TOP, -0.27), &mut random);
    papers(stage, &desk.shifted(-0.52, TOP, 0.13), &mut random);
    pile_of_books(
        stage,
        &desk.shifted(0.6, TOP, -0.29).turned(random.between(-10.0, 10.0)),
        &mut random,
    );
    notes(stage, &desk.shifted(0.24, TOP, -0.02), &mut random);
    calculator(stage, &desk.shifted(0.62, TOP, 0.2).turned(random.between(-25.0, 5.0)));
}

fn mug(stage: &mut Stage, at: &Frame, place: u64) {
    let cup = at.shifted(0.0, 0.004, 0.0);
    let glaze = &CERAMIC[(place % 4) as usize];
    let wall = [
        (0.0, 0.0),
        (0.036, 0.0),
        (0.039, 0.008),
        (0.039, 0.09),
        (0.036, 0.09),
        (0.036, 0.008),
        (0.0, 0.008),
    ];
    stage.put("mug", glaze, &cup, Shape::lathe(&wall, 18));
    let ear =
        arc(vector(0.036, 0.047, 0.0), vector(0.032, 0., 0.), vector(0., 0.028, 0.), (-85.0, 85.0));
    stage.put("mug_handle", glaze, &cup, Shape::pipe(&ear, 0.005, 6));
    stage.put(
        "coffee",
        &WALNUT,
        &cup.shifted(0.0, 0.075, 0.0),
        Shape::lathe(&[(0.035, 0.0), (0.0, 0.0)], 18),
    );
    stage.put("coaster", &CORK, at, Shape::cylinder(0.048, 0.003, 16));
}

fn pen_pot(stage: &mut Stage, at: &Frame, random: &mut Random) {
    let pot = [(0.0, 0.0), (0.038, 0.0), (0.038, 0.1), (0.035, 0.1), (0.035, 0.004), (0.0, 0.004)];
    stage.put("pen_pot", &BLACK_METAL, at, Shape::lathe(&pot, 16));
    for pen in 0..7 {
        let lean = at
            .turned(51.4 * f64::from(pen) + random.between(-12.0, 12.0))
            .shifted(0.0, 0.006, 0.004)
            .tilted(random.between(7.0, 12.0));
        let barrel = Shape::cylinder(0.0035, random.between(0.13, 0.17), 6);
        stage.put("pen", random.pick(&BOOKS), &lean, barrel);
    }
}

/// Loose sheets, one on the other, none quite straight.
fn papers(stage: &mut Stage, at: &Frame, random: &mut Random) {
    for sheet in 0..12 {
        let y = 0.0012 * f64::from(sheet);
        let (x, z) = (random.between(-0.03, 0.03), random.between(-0.03, 0.03));
        let turned = at.shifted(x, y, z).turned(random.between(-14.0, 14.0));
        stage.put("sheet", &PAPER, &turned, Shape::sheet(0.21, 0.297));
    }
    let pen = at.shifted(0.02, 0.0185, 0.05).turned(random.between(20.0, 70.0)).tilted(90.0);
    stage.put("pen", random.pick(&PINS), &pen, Shape::cylinder(0.004, 0.14, 8));
}

fn pile_of_books(stage: &mut Stage, at: &Frame, random: &mut Random) {
    let mut y = 0.0;
    for _ in 0..4 {
        let thickness = random.between(0.018, 0.042);
        let book = Shape::cuboid(random.between(0.22, 0.27), thickness, random.between(0.15, 0.19));
        let turned = at.shifted(0.0, y, 0.0).turned(random.between(-9.0, 9.0));
        stage.put("book", random.pick(&BOOKS), &turned, book);
        y += thickness + 0.001;
    }
}

fn notes(stage: &mut Stage, at: &Frame, random: &mut Random) {
    for note in 0..3 {
        let place = at.shifted(0.05 * f64::from(note), 0.001 + 0.0012 * f64::from(note), 0.02);
        let turned = place.turned(random.between(-30.0, 30.0));
        stage.put("note", random.pick(&NOTES), &turned, Shape::sheet(0.075, 0.075));
    }
}

fn calculator(stage: &mut Stage, at: &Frame) {
    stage.put("calculator", &BLACK_PLASTIC, at, Shape::cuboid(0.075, 0.012, 0.13));
    stage.put("display", &STONE[0], &at.shifted(0.0, 0.0135, -0.045), Shape::sheet(0.06, 0.022));
    for key in 0..20 {
        let (x, z) = (f64::from(key % 4), f64::from(key / 4));
        let cap = Shape::tapered((0.012, 0.011), (0.01, 0.009), 0.003);
        let material = if key % 4 == 3 { &KEY_ACCENT } else { &GREY_PLASTIC };
        let place = at.shifted(-0.0255 + 0.017 * x, 0.0132, -0.019 + 0.0175 * z);
        stage.put("calculator_key", material, &place, cap);
    }
}

/// The stock of copy paper in open trays on the cabinets: `count` sheets.
pub(super) fn copy_paper(stage: &mut Stage, bay: &Bay, count: u64) {
    assert!(count <= TRAYS * TRAY_SHEETS, "{count} sheets are more than the trays hold");
    let mut random = Random::new(0x5EE7, bay.index);
    for sheet in 0..count {
        let (tray, layer) = (sheet / TRAY_SHEETS, sheet % TRAY_SHEETS);
        let at = super::wall::tray(bay, tray)
            .shifted(
                random.between(-0.004, 0.004),
                0.0013 * layer as f64,
                random.between(-0.004, 0.004),
            )
            .turned(random.between(-1.5, 1.5));
        stage.put("sheet", &PAPER, &at, Shape::sheet(0.21, 0.297));
    }
}
