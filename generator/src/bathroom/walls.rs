//! The shell of the bathroom: grout, and tiles on it everywhere but on the ceiling.

use super::palette::*;
use super::tiles::{Area, Laying, lay, lay_hexagons};
use super::{BAY_LENGTH, Bay, HEIGHT, WIDTH, mirror};
use crate::frame::Frame;
use crate::material::Material;
use crate::random::Random;
use crate::shape::Shape;
use crate::stage::Stage;

/// Up to here the walls are green.
const DADO: f64 = 0.98;
/// Height of the dark strip above it.
const STRIP: f64 = 0.06;

const METRO: Laying =
    Laying { noun: "metro_tile", pitch: (0.15, 0.07), joint: 0.003, is_bonded: true, tilt: 0.35 };
const TRIM_STRIP: Laying =
    Laying { noun: "trim_tile", pitch: (0.15, STRIP), joint: 0.002, is_bonded: false, tilt: 0.2 };
const SQUARES: Laying =
    Laying { noun: "square_tile", pitch: (0.1, 0.1), joint: 0.003, is_bonded: false, tilt: 0.3 };
const MOSAIC_LAYING: Laying =
    Laying { noun: "mosaic", pitch: (0.033, 0.033), joint: 0.003, is_bonded: false, tilt: 1.2 };

/// The walls of a bay and its ceiling.
pub(super) fn shell(stage: &mut Stage, bay: &Bay) {
    let near = bay.corner;
    let far = bay.corner.shifted(BAY_LENGTH, 0.0, WIDTH).turned(180.0);
    // Both mirrors hang opposite each other; seen from the far wall, x runs the other way.
    tiled_wall(stage, &near, BAY_LENGTH, Some(mirror::hole(false)), salt(bay, 0));
    tiled_wall(stage, &far, BAY_LENGTH, Some(mirror::hole(true)), salt(bay, 1));
    if bay.is_first {
        let end = bay.corner.shifted(0.0, 0.0, WIDTH).turned(90.0);
        tiled_wall(stage, &end, WIDTH, None, salt(bay, 2));
    }
    if bay.is_last {
        let end = bay.corner.shifted(BAY_LENGTH, 0.0, 0.0).turned(-90.0);
        mosaic_wall(stage, &end, (WIDTH, HEIGHT), salt(bay, 3));
    } else {
        screen(stage, bay);
    }
    let middle = bay.corner.shifted(BAY_LENGTH / 2.0, HEIGHT, WIDTH / 2.0).tilted(180.0);
    stage.put("ceiling", &CEILING, &middle, Shape::sheet(BAY_LENGTH, WIDTH));
}

/// Hexagons, with dark flowers strewn between the light ones.
pub(super) fn floor(stage: &mut Stage, bay: &Bay) {
    let middle = bay.corner.shifted(BAY_LENGTH / 2.0, -0.0025, WIDTH / 2.0);
    stage.put("floor_grout", &GROUT, &middle, Shape::sheet(BAY_LENGTH, WIDTH));
    let from = BAY_LENGTH * bay.index as f64;
    let mut random = salt(bay, 4);
    lay_hexagons(stage, (from, from + BAY_LENGTH), WIDTH, &mut random, &|random, column, row| {
        let is_dark = (column + row / 2 * 3).rem_euclid(6) == 0 && row % 4 == 0;
        if is_dark { &HEXAGONS[3] } else { random.pick(&HEXAGONS[..3]) }
    });
}

fn salt(bay: &Bay, wall: u64) -> Random {
    Random::new(0x711E, bay.index * 8 + wall)
}

/// Green below, white above; `wall` is at the lower left corner.
fn tiled_wall(stage: &mut Stage, wall: &Frame, width: f64, hole: Option<Area>, mut random: Random) {
    let grout = Shape::panel(width, HEIGHT);
    stage.put("wall_grout", &GROUT, &wall.shifted(width / 2.0, 0.0, 0.0), grout);
    let part = |bottom: f64, height: f64| (Area { left: 0.0, bottom, width, height }, hole);
    lay(stage, wall, part(0.0, DADO), &METRO, &mut random, &|r, _, _| r.pick(&METRO_TILES));
    lay(stage, wall, part(DADO, STRIP), &TRIM_STRIP, &mut random, &|_, _, _| &TRIM);
    let above = DADO + STRIP;
    let white = part(above, HEIGHT - above);
    lay(stage, wall, white, &SQUARES, &mut random, &|r, _, _| r.pick(&WHITE_TILES));
}

/// Mosaic that fades from deep water to foam; `wall` is at the lower left corner.
fn mosaic_wall(stage: &mut Stage, wall: &Frame, (width, height): (f64, f64), mut random: Random) {
    let grout = Shape::panel(width, height);
    stage.put("wall_grout", &DARK_GROUT, &wall.shifted(width / 2.0, 0.0, 0.0), grout);
    let all = Area { left: 0.0, bottom: 0.0, width, height };
    lay(stage, wall, (all, None), &MOSAIC_LAYING, &mut random, &|random, x, y| fade(random, x, y));
}

fn fade(random: &mut Random, x: f64, y: f64) -> &'static Material {
    if random.happens(0.018) {
        return &MOSAIC[8];
    }
    // A swell along the wall, and grains of chance.
    let swell = 0.14 * libm::sin(2.1 * x + 0.6) + 0.07 * libm::sin(5.3 * x);
    let shade = (y + swell) / HEIGHT * 8.0 + random.between(-1.1, 1.1);
    &MOSAIC[shade.clamp(0.0, 7.0) as usize]
}

/// Between bays stands a screen that leaves a way on either side, mosaic on both faces.
fn screen(stage: &mut Stage, bay: &Bay) {
    let (width, height) = (2.0, 2.2);
    let middle = bay.corner.shifted(BAY_LENGTH - 0.05, 0.001, 1.3);
    stage.put("screen", &DARK_GROUT, &middle, Shape::cuboid(0.098, height, width));
    let front = middle.shifted(-0.05, 0.0, -width / 2.0).turned(-90.0);
    mosaic_wall(stage, &front, (width, height), salt(bay, 5));
    let rear = middle.shifted(0.05, 0.0, width / 2.0).turned(90.0);
    mosaic_wall(stage, &rear, (width, height), salt(bay, 6));
}
