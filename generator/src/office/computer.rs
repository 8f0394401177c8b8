//! What is plugged in: screen, keyboard, mouse, the machine under the desk, telephone.

use super::desk::TOP;
use super::palette::*;
use crate::frame::Frame;
use crate::random::Random;
use crate::shape::{Shape, rounded_rectangle};
use crate::stage::Stage;
use crate::vector::vector;

/// Puts a computer on and under a desk; `place` tells it from all others.
pub(super) fn computer(stage: &mut Stage, desk: &Frame, place: u64) {
    let mut random = Random::new(0xC0DE, place);
    let turn = random.between(-7.0, 7.0);
    screen(stage, &desk.shifted(-0.08, TOP, -0.2).turned(turn), &mut random);
    keyboard(stage, &desk.shifted(-0.1, TOP, 0.17).turned(random.between(-4.0, 4.0)), place);
    mouse(stage, &desk.shifted(0.24, TOP, 0.19).turned(random.between(-25.0, 10.0)));
    telephone(stage, &desk.shifted(0.58, TOP, -0.12).turned(random.between(-30.0, -5.0)));
    tower(stage, &desk.shifted(-0.55, 0.0, 0.0));
}

/// A screen on its foot, with something on it.
fn screen(stage: &mut Stage, at: &Frame, random: &mut Random) {
    let foot = Shape::prism(&rounded_rectangle(0.26, 0.2, 0.03, 3), 0.012);
    stage.put("screen_foot", &ALUMINIUM, at, foot);
    let neck = Shape::tapered((0.07, 0.03), (0.05, 0.024), 0.22);
    stage.put("screen_neck", &ALUMINIUM, &at.shifted(0.0, 0.013, -0.03), neck);
    let face = at.shifted(0.0, 0.115, 0.012).tilted(-4.0);
    stage.put("screen_case", &BLACK_PLASTIC, &face, Shape::cuboid(0.62, 0.37, 0.026));
    let glass = face.shifted(0.0, 0.018, 0.0145);
    stage.put("screen", &SCREEN, &glass, Shape::panel(0.594, 0.336));
    let led = Shape::cuboid(0.008, 0.003, 0.002);
    stage.put("screen_led", &SCREEN_TEXT[2], &face.shifted(0.28, 0.007, 0.015), led);
    if random.happens(0.5) { program(stage, &glass, random) } else { chart(stage, &glass, random) }
}

/// Indented lines of coloured words.
fn program(stage: &mut Stage, glass: &Frame, random: &mut Random) {
    for line in 0..17 {
        let y = 0.31 - 0.018 * f64::from(line);
        let mut x = -0.27 + 0.025 * (random.between(0.0, 4.0)).floor();
        for _ in 0..3 {
            let width = random.between(0.03, 0.12);
            let word = Shape::panel(width, 0.008);
            let at = glass.shifted(x + width / 2.0, y, 0.0012);
            stage.put("screen_word", random.pick(&SCREEN_TEXT), &at, word);
            x += width + 0.012;
        }
    }
}

/// Columns of a chart over a few lines of text.
fn chart(stage: &mut Stage, glass: &Frame, random: &mut Random) {
    for column in 0..26 {
        let height = 0.03 + 0.12 * random.unit() + 0.004 * f64::from(column);
        let at = glass.shifted(-0.262 + 0.021 * f64::from(column), 0.02, 0.0012);
        let hue = &SCREEN_TEXT[1 + column as usize / 7 % 4];
        stage.put("screen_column", hue, &at, Shape::panel(0.015, height));
    }
    for line in 0..25 {
        let width = random.between(0.05, 0.15);
        let (column, row) = (f64::from(line % 3), f64::from(line / 3));
        let at = glass.shifted(-0.19 + 0.19 * column, 0.315 - 0.0145 * row, 0.0012);
        stage.put("screen_word", &SCREEN_TEXT[0], &at, Shape::panel(width, 0.006));
    }
}

/// A keyboard of 84 keys, in rows of their usual widths.
fn keyboard(stage: &mut Stage, at: &Frame, place: u64) {
    const UNIT: f64 = 0.0186;
    let base = Shape::prism(&rounded_rectangle(0.3, 0.13, 0.008, 2), 0.01);
    let at = at.shifted(0.0, 0.004, 0.0).tilted(4.0);
    stage.put("keyboard", &BLACK_METAL, &at, base);
    let one = |count: usize| vec![1.0; count];
    let rows = [
        one(15),
        [one(13), vec![2.0]].concat(),
        [vec![1.5], one(12), vec![1.5]].concat(),
        [vec![1.75], one(11), vec![2.25]].concat(),
        [vec![2.25], one(10), vec![2.75]].concat(),
        vec![1.25, 1.25, 1.25, 6.0, 1.25, 1.0, 1.0, 1.0, 1.0],
    ];
    for (row, widths) in rows.iter().enumerate() {
        let mut x = -7.5 * UNIT;
        for (column, width) in widths.iter().enumerate() {
            let (size, z) = (width * UNIT, UNIT * (row as f64 - 2.5));
            let cap = key_cap(size - 0.0026, UNIT - 0.0026);
            let is_accent = column == 0 && row == 0 || (row, column) == (3, 12);
            let material = if is_accent && place.is_multiple_of(2) { &KEY_ACCENT } else { &KEY };
            stage.put("key", material, &at.shifted(x + size / 2.0, 0.011, z), cap);
            x += size;
        }
    }
}

/// A key without its bottom.
fn key_cap(x: f64, z: f64) -> Shape {
    let mut cap = Shape::tapered((x, z), (x - 0.004, z - 0.005), 0.007);
    cap.faces.remove(0);
    cap
}

fn mouse(stage: &mut Stage, at: &Frame) {
    let body =
        Shape::lathe(&[(0.0, 0.0), (0.03, 0.0), (0.028, 0.016), (0.014, 0.03), (0.0, 0.033)], 14);
    stage.put("mouse", &BLACK_PLASTIC, &at.shifted(0.0, 0.002, 0.0), body.scaled(1.0, 1.0, 1.8));
    let mat = Shape::cuboid(0.22, 0.0015, 0.18);
    stage.put("mouse_mat", &CHAIR_FABRIC[3], at, mat);
    let wheel = Shape::cylinder(0.008, 0.005, 10);
    stage.put("mouse_wheel", &GREY_PLASTIC, &at.shifted(0.0025, 0.031, -0.03).rolled(90.0), wheel);
}

/// A desk telephone with twelve keys and its handset.
fn telephone(stage: &mut Stage, at: &Frame) {
    let at = at.shifted(0.0, 0.006, 0.0).tilted(9.0);
    stage.put("telephone", &GREY_PLASTIC, &at, Shape::cuboid(0.17, 0.03, 0.19));
    for key in 0..12 {
        let (column, row) = (f64::from(key % 3), f64::from(key / 3));
        let cap = Shape::tapered((0.016, 0.013), (0.013, 0.01), 0.005);
        let key_at = at.shifted(0.01 + 0.024 * column, 0.031, 0.0 + 0.02 * row);
        stage.put("telephone_key", &WHITE_LACQUER, &key_at, cap);
    }
    stage.put("display", &SCREEN, &at.shifted(0.035, 0.0315, -0.05), Shape::sheet(0.08, 0.04));
    let path = [
        vector(-0.055, 0.036, 0.085),
        vector(-0.055, 0.062, 0.055),
        vector(-0.055, 0.062, -0.055),
        vector(-0.055, 0.036, -0.085),
    ];
    stage.put(
        "handset",
        &BLACK_PLASTIC,
        &at.shifted(0.0, 0.012, 0.0),
        Shape::pipe(&path, 0.016, 10),
    );
}

/// The machine: a case with slots in its front.
fn tower(stage: &mut Stage, at: &Frame) {
    stage.put("tower", &BLACK_METAL, at, Shape::cuboid(0.18, 0.42, 0.42));
    for slot in 0..8 {
        let bar = Shape::cuboid(0.13, 0.006, 0.004);
        let y = 0.06 + 0.018 * f64::from(slot);
        stage.put("tower_slot", &GREY_PLASTIC, &at.shifted(0.0, y, 0.2135), bar);
    }
    let button = Shape::cylinder(0.01, 0.004, 10);
    stage.put("tower_button", &STEEL, &at.shifted(0.05, 0.38, 0.2115).tilted(90.0), button);
}
