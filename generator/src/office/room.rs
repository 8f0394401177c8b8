//! The shell of the office: walls, parquet and carpet, ceiling, door.

use super::palette::*;
use super::{BAY_LENGTH, Bay, HEIGHT, WIDTH};
use crate::frame::Frame;
use crate::random::Random;
use crate::shape::Shape;
use crate::stage::Stage;
use crate::vector::{Vector, vector};

/// Height of the carpet that the desks stand on, with a millimetre to spare.
pub(super) const CARPET_TOP: f64 = 0.009;

const PLANK: (f64, f64) = (1.2, 0.15);
const PANEL: f64 = 0.6;
/// The carpet tiles: where they begin in a bay, their side and how many there are.
const CARPET_CORNER: (f64, f64) = (1.95, 0.5);
const TILE: f64 = 0.5;
const CARPET_TILES: (u32, u32) = (8, 6);

/// Walls, and what is fixed along them at the floor.
pub(super) fn shell(stage: &mut Stage, bay: &Bay) {
    let x = BAY_LENGTH / 2.0;
    let wall = Shape::panel(BAY_LENGTH, HEIGHT);
    stage.put("wall", &WALL, &bay.corner.shifted(x, 0.0, WIDTH).turned(180.0), wall);
    let board = Shape::cuboid(BAY_LENGTH - 0.1, 0.07, 0.012);
    let far = bay.corner.shifted(x, 0.002, WIDTH - 0.008);
    stage.put("skirting", &WHITE_PAINT, &far, board.clone());
    stage.put("skirting", &WHITE_PAINT, &bay.corner.shifted(x, 0.002, 0.008), board);
    if bay.is_first {
        let wall = Shape::panel(WIDTH, HEIGHT);
        stage.put("wall", &WALL, &bay.corner.shifted(0.0, 0.0, WIDTH / 2.0).turned(90.0), wall);
    }
    if bay.is_last {
        let end = bay.corner.shifted(BAY_LENGTH, 0.0, WIDTH / 2.0).turned(-90.0);
        stage.put("wall", &ACCENT_WALL, &end, Shape::panel(WIDTH, HEIGHT));
        door(stage, &end.shifted(1.98, 0.0, 0.0));
    }
}

/// Parquet over a dark ground, and carpet tiles under the desks.
pub(super) fn floor(stage: &mut Stage, bay: &Bay) {
    let ground = Shape::sheet(BAY_LENGTH, WIDTH);
    let middle = bay.corner.shifted(BAY_LENGTH / 2.0, -0.004, WIDTH / 2.0);
    stage.put("ground", &SHADOW_GAP, &middle, ground);
    let rows = (WIDTH / PLANK.1).round() as u64;
    for row in 0..rows {
        plank_row(stage, bay, row, Random::new(0x9A7C, bay.index * rows + row));
    }
    carpet(stage, bay);
}

/// A row of planks, broken at random, cut off at the ends of the bay.
fn plank_row(stage: &mut Stage, bay: &Bay, row: u64, mut random: Random) {
    let z = PLANK.1 * (row as f64 + 0.5);
    let mut from = -random.between(0.0, PLANK.0);
    while from < BAY_LENGTH {
        let (start, end) = (from.max(0.0), (from + PLANK.0).min(BAY_LENGTH));
        from += PLANK.0;
        let length = end - start - 0.002;
        if length < 0.02 {
            continue;
        }
        let plank = Shape::sheet(length, PLANK.1 - 0.002);
        let at = bay.corner.shifted((start + end) / 2.0, 0.0, z);
        stage.put("plank", random.pick(&PARQUET), &at, plank);
    }
}

fn carpet(stage: &mut Stage, bay: &Bay) {
    let mut random = Random::new(0xCA47, bay.index);
    for column in 0..CARPET_TILES.0 {
        for row in 0..CARPET_TILES.1 {
            let x = CARPET_CORNER.0 + TILE * (f64::from(column) + 0.5);
            let z = CARPET_CORNER.1 + TILE * (f64::from(row) + 0.5);
            let tile = Shape::cuboid(TILE - 0.002, 0.006, TILE - 0.002);
            let at = bay.corner.shifted(x, 0.002, z);
            stage.put("carpet_tile", random.pick(&CARPET), &at, tile);
        }
    }
}

/// Ceiling panels below a dark void.
pub(super) fn ceiling(stage: &mut Stage, bay: &Bay) {
    let facing_down = |x: f64, y: f64, z: f64| bay.corner.shifted(x, y, z).tilted(180.0);
    let middle = facing_down(BAY_LENGTH / 2.0, HEIGHT, WIDTH / 2.0);
    stage.put("ceiling", &SHADOW_GAP, &middle, Shape::sheet(BAY_LENGTH, WIDTH));
    let (columns, rows) = ((BAY_LENGTH / PANEL) as u32, (WIDTH / PANEL) as u32);
    for column in 0..columns {
        for row in 0..rows {
            let (x, z) = (PANEL * (f64::from(column) + 0.5), PANEL * (f64::from(row) + 0.5));
            let panel = Shape::sheet(PANEL - 0.008, PANEL - 0.008);
            stage.put("ceiling_panel", &CEILING, &facing_down(x, HEIGHT - 0.01, z), panel);
        }
    }
    for x in [1.5, 5.7] {
        let at = facing_down(x, HEIGHT - 0.012, WIDTH - 0.9);
        stage.put("smoke_detector", &WHITE_LACQUER, &at, Shape::cylinder(0.05, 0.03, 16));
    }
}

/// A door in a wall: `at` is on the floor in its middle, with +z into the room.
fn door(stage: &mut Stage, at: &Frame) {
    let (width, height) = (0.92, 2.08);
    let leaf = Shape::cuboid(width, height, 0.03);
    stage.put("door", &OAK, &at.shifted(0.0, 0.006, 0.02), leaf);
    for y in [0.22, 1.14] {
        let panel = Shape::cuboid(width - 0.28, 0.74, 0.008);
        stage.put("door_panel", &OAK, &at.shifted(0.0, y, 0.041), panel);
    }
    for side in [-1.0, 1.0] {
        let post = Shape::cuboid(0.07, height + 0.08, 0.05);
        stage.put("door_frame", &WHITE_PAINT, &at.shifted(side * 0.5, 0.002, 0.028), post);
    }
    let lintel = Shape::cuboid(width + 0.005, 0.07, 0.05);
    stage.put("door_frame", &WHITE_PAINT, &at.shifted(0.0, height + 0.012, 0.028), lintel);
    handle(stage, &at.shifted(-0.38, 1.02, 0.0385));
    for y in [0.3, 1.7] {
        let hinge = Shape::cylinder(0.008, 0.1, 8);
        stage.put("hinge", &STEEL, &at.shifted(0.448, y, 0.047), hinge);
    }
}

fn handle(stage: &mut Stage, at: &Frame) {
    let plate = Shape::cuboid(0.035, 0.2, 0.004);
    stage.put("door_plate", &STEEL, &at.shifted(0.0, -0.12, 0.0), plate);
    let path: [Vector; 4] = [
        vector(0.0, 0.0, 0.004),
        vector(0.0, 0.0, 0.05),
        vector(0.015, 0.0, 0.06),
        vector(0.12, 0.0, 0.06),
    ];
    stage.put("door_handle", &STEEL, at, Shape::pipe(&path, 0.009, 10));
}
