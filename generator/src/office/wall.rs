//! What hangs on the walls or stands along them: pin board, clock, pictures, cabinets, a basket.

use super::palette::*;
use super::{BAY_LENGTH, Bay, WIDTH};
use crate::frame::Frame;
use crate::material::Material;
use crate::random::Random;
use crate::shape::Shape;
use crate::stage::Stage;
use crate::vector::vector;

const CABINET: (f64, f64, f64) = (0.8, 0.78, 0.42);

/// Everything along the walls of a bay.
pub(super) fn things(stage: &mut Stage, bay: &Bay) {
    let end = bay.corner.shifted(BAY_LENGTH - 0.004, 0.0, 0.0).turned(-90.0);
    // Along the wall opposite to the windows.
    let along = bay.corner.shifted(0.0, 0.0, WIDTH - 0.004).turned(180.0);
    // Only the last bay has a wall at its end, between bookcases and door.
    let over_cabinets = along.shifted(-5.7, 1.9, 0.004);
    let clock_at = if bay.is_last { end.shifted(3.98, 2.2, 0.004) } else { over_cabinets };
    clock(stage, &clock_at);
    pin_board(stage, &along.shifted(-3.6, 1.35, 0.009), bay);
    pictures(stage, &along);
    for number in 0..3 {
        let x = -4.9 - 0.82 * f64::from(number);
        cabinet(stage, &along.shifted(x, 0.001, CABINET.2 / 2.0 + 0.02));
    }
    for number in 0..8 {
        let tray_at = tray(bay, number);
        stage.put(
            "tray",
            &BLACK_METAL,
            &tray_at.shifted(0.0, -0.004, 0.0),
            Shape::cuboid(0.25, 0.003, 0.32),
        );
    }
    basket(stage, &bay.corner.shifted(2.15, 0.009, 3.15), bay);
    coat_stand(stage, &bay.corner.shifted(6.75, 0.001, 5.05));
}

/// Where the paper of a tray lies, on the cabinets.
pub(super) fn tray(bay: &Bay, number: u64) -> Frame {
    let x = 4.7 + 0.29 * number as f64;
    bay.corner.shifted(x, CABINET.1 + 0.034, WIDTH - 0.24)
}

fn cabinet(stage: &mut Stage, at: &Frame) {
    let (width, height, depth) = CABINET;
    stage.put("cabinet", &WHITE_LACQUER, at, Shape::cuboid(width, height, depth));
    stage.put(
        "cabinet_top",
        &OAK,
        &at.shifted(0.0, height + 0.001, 0.0),
        Shape::cuboid(width, 0.025, depth),
    );
    for side in [-1.0, 1.0] {
        let door = Shape::cuboid(width / 2.0 - 0.006, height - 0.06, 0.016);
        stage.put(
            "cabinet_door",
            &WHITE_LACQUER,
            &at.shifted(side * width / 4.0, 0.05, depth / 2.0 + 0.01),
            door,
        );
        let knob = Shape::sphere(0.012, 10, 6);
        stage.put("knob", &STEEL, &at.shifted(side * 0.04, 0.5, depth / 2.0 + 0.032), knob);
    }
}

/// A clock of white enamel; `at` is its middle, on the wall.
fn clock(stage: &mut Stage, at: &Frame) {
    let facing = at.tilted(90.0);
    stage.put("clock_rim", &BLACK_METAL, &facing, Shape::cylinder(0.16, 0.02, 40));
    stage.put(
        "clock_face",
        &WHITE_LACQUER,
        &facing.shifted(0.0, 0.0215, 0.0),
        Shape::lathe(&[(0.147, 0.0), (0.0, 0.0)], 40),
    );
    for minute in 0..60 {
        let is_hour = minute % 5 == 0;
        let (width, length) = if is_hour { (0.007, 0.026) } else { (0.0025, 0.012) };
        let mark = at.shifted(0.0, 0.0, 0.0235).rolled(6.0 * f64::from(minute)).shifted(
            0.0,
            0.137 - length,
            0.0,
        );
        stage.put("clock_mark", &BLACK_PLASTIC, &mark, Shape::panel(width, length));
    }
    // Ten past ten and a bit, as all clocks in pictures.
    for (degrees, width, length, z) in
        [(53.0, 0.01, 0.085, 0.026), (-64.0, 0.007, 0.125, 0.028), (130.0, 0.003, 0.13, 0.03)]
    {
        let hand = at.shifted(0.0, 0.0, z).rolled(degrees).shifted(0.0, -0.015, 0.0);
        let material = if z > 0.029 { &PINS[0] } else { &BLACK_PLASTIC };
        stage.put("clock_hand", material, &hand, Shape::panel(width, length));
    }
}

/// A board of cork with notes under pins; `at` is the middle of its lower edge.
fn pin_board(stage: &mut Stage, at: &Frame, bay: &Bay) {
    let (width, height) = (1.5, 0.9);
    stage.put("pin_board", &CORK, at, Shape::cuboid(width - 0.002, height - 0.002, 0.016));
    frame_around(stage, &at.shifted(0.0, -0.001, 0.005), (width, height), &OAK);
    let mut random = Random::new(0x9128, bay.index);
    for note in 0..30 {
        let (column, row) = (f64::from(note % 6), f64::from(note / 6));
        let x = -0.6 + 0.24 * column + random.between(-0.05, 0.05);
        let y = 0.07 + 0.165 * row + random.between(-0.02, 0.02);
        let lift = 0.0095 + 0.0012 * f64::from(note % 7);
        let place = at.shifted(x, y, lift).rolled(random.between(-9.0, 9.0));
        let (w, h) = if random.happens(0.4) { (0.15, 0.11) } else { (0.09, 0.09) };
        stage.put("note", random.pick(&NOTES), &place, Shape::panel(w, h));
        let pin = place.shifted(0.0, h - 0.012, 0.01);
        stage.put("pin", random.pick(&PINS), &pin, Shape::pebble(0.006));
    }
}

/// Four mouldings around a rectangle that stands on `at`.
fn frame_around(stage: &mut Stage, at: &Frame, (width, height): (f64, f64), material: &Material) {
    const BAR: f64 = 0.025;
    for side in [-1.0, 1.0] {
        let post = Shape::cuboid(BAR, height + 2.0 * BAR, 0.024);
        stage.put("frame", material, &at.shifted(side * (width + BAR) / 2.0, -BAR, 0.0), post);
    }
    for y in [-BAR, height] {
        stage.put(
            "frame",
            material,
            &at.shifted(0.0, y, 0.0),
            Shape::cuboid(width - 0.002, BAR, 0.024),
        );
    }
}

/// Framed prints in a row.
fn pictures(stage: &mut Stage, along: &Frame) {
    for (number, x) in [-0.7, -1.5, -2.3].into_iter().enumerate() {
        let at = along.shifted(x, 1.4, 0.007);
        stage.put("picture", &PAPER, &at, Shape::cuboid(0.498, 0.698, 0.012));
        frame_around(stage, &at.shifted(0.0, -0.001, 0.0065), (0.5, 0.7), &BLACK_METAL);
        for part in 0..5 {
            let y = 0.1 + 0.1 * f64::from(part);
            let width = 0.36 - 0.05 * f64::from((part + number as u32 * 2) % 5);
            let band = Shape::panel(width, 0.08);
            let material = &PRINTS[(part as usize + number) % PRINTS.len()];
            stage.put("print", material, &at.shifted(0.0, y, 0.0075), band);
        }
    }
}

/// A waste basket, with what did not get written.
fn basket(stage: &mut Stage, at: &Frame, bay: &Bay) {
    let wall = [(0.0, 0.0), (0.11, 0.0), (0.14, 0.3), (0.136, 0.3), (0.106, 0.006), (0.0, 0.006)];
    stage.put("basket", &BLACK_METAL, at, Shape::lathe(&wall, 28));
    let mut random = Random::new(0xBA5E, bay.index);
    for ball in 0..9 {
        let out = if ball < 8 { random.between(0.02, 0.075) } else { 0.24 };
        let y = if ball < 8 { 0.14 + 0.022 * f64::from(ball) } else { 0.036 };
        let place = at
            .turned(137.5 * f64::from(ball))
            .shifted(0.0, y, out)
            .tilted(random.between(0.0, 90.0));
        stage.put("crumpled_paper", &PAPER, &place, Shape::pebble(0.036).scaled(1.0, 0.85, 1.1));
    }
}

fn coat_stand(stage: &mut Stage, at: &Frame) {
    let foot = [(0.0, 0.0), (0.17, 0.0), (0.17, 0.015), (0.03, 0.035), (0.0, 0.035)];
    stage.put("coat_stand_foot", &BLACK_METAL, at, Shape::lathe(&foot, 24));
    stage.put(
        "coat_stand",
        &BLACK_METAL,
        &at.shifted(0.0, 0.036, 0.0),
        Shape::cylinder(0.016, 1.7, 12),
    );
    for hook in 0..4 {
        let turned = at.turned(90.0 * f64::from(hook) + 30.0);
        let path = [vector(0.0, 1.58, 0.017), vector(0.0, 1.6, 0.09), vector(0.0, 1.68, 0.13)];
        stage.put("coat_hook", &BLACK_METAL, &turned, Shape::pipe(&path, 0.008, 6));
    }
}
