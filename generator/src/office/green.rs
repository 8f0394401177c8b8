//! Plants: a large one on the floor, small ones on sills and shelves.

use super::palette::*;
use super::{BAY_LENGTH, Bay};
use crate::frame::Frame;
use crate::random::Random;
use crate::shape::Shape;
use crate::stage::Stage;
use crate::vector::vector;

/// The plants of a bay.
pub(super) fn plants(stage: &mut Stage, bay: &Bay) {
    let mut random = Random::new(0x6EE4, bay.index);
    floor_plant(stage, &bay.corner.shifted(6.75, 0.001, 4.02), &mut random);
    for x in [3.1, 5.55] {
        pot_plant(stage, &bay.corner.shifted(x, 0.918, 0.12), &mut random);
    }
    let on_shelf = bay.corner.shifted(BAY_LENGTH - 0.16, 2.123, 1.95);
    pot_plant(stage, &on_shelf, &mut random);
}

/// A tall plant of broad leaves on bent stems.
fn floor_plant(stage: &mut Stage, at: &Frame, random: &mut Random) {
    let pot = [(0.0, 0.0), (0.15, 0.0), (0.2, 0.36), (0.18, 0.36), (0.17, 0.31), (0.0, 0.31)];
    stage.put("plant_pot", &CERAMIC[0], at, Shape::lathe(&pot, 28));
    stage.put(
        "soil",
        &SOIL,
        &at.shifted(0.0, 0.32, 0.0),
        Shape::lathe(&[(0.172, 0.0), (0.0, 0.01)], 16),
    );
    for stone in 0..24 {
        let out = random.between(0.06, 0.15);
        let place = at.turned(15.0 * f64::from(stone)).shifted(0.0, 0.335, out);
        let pebble = Shape::pebble(random.between(0.008, 0.016));
        stage.put("pebble", random.pick(&STONE), &place, pebble);
    }
    for stem in 0..9 {
        let turned = at.turned(40.0 * f64::from(stem) + random.between(-12.0, 12.0));
        let (reach, height) = (random.between(0.12, 0.3), random.between(0.6, 1.25));
        let tip = vector(0.0, 0.32 + height, reach);
        let path = [vector(0.0, 0.32, 0.02), vector(0.0, 0.32 + height * 0.55, reach * 0.35), tip];
        stage.put("stem", &STEM, &turned, Shape::pipe(&path, 0.006, 5));
        for leaf in 0..6 {
            let place = turned
                .shifted(
                    0.0,
                    tip.y - 0.07 * f64::from(leaf),
                    tip.z * (1.0 - 0.07 * f64::from(leaf)),
                )
                .turned(137.5 * f64::from(leaf))
                .tilted(random.between(-28.0, 22.0));
            let size = random.between(0.2, 0.3);
            stage.put(
                "leaf",
                random.pick(&LEAVES),
                &place,
                Shape::leaf(size, size * 0.5, size * 0.4),
            );
        }
    }
}

/// A small plant in a clay pot.
fn pot_plant(stage: &mut Stage, at: &Frame, random: &mut Random) {
    let pot = [
        (0.0, 0.0),
        (0.05, 0.0),
        (0.065, 0.1),
        (0.072, 0.1),
        (0.072, 0.12),
        (0.06, 0.12),
        (0.056, 0.1),
        (0.0, 0.1),
    ];
    stage.put("plant_pot", &TERRACOTTA, at, Shape::lathe(&pot, 20));
    stage.put(
        "soil",
        &SOIL,
        &at.shifted(0.0, 0.106, 0.0),
        Shape::lathe(&[(0.055, 0.0), (0.0, 0.004)], 12),
    );
    for leaf in 0..22 {
        let place = at
            .shifted(0.0, 0.11 + 0.004 * f64::from(leaf), 0.0)
            .turned(137.5 * f64::from(leaf))
            .tilted(-10.0 - 2.2 * f64::from(leaf) + random.between(-8.0, 8.0));
        let size = random.between(0.11, 0.17);
        stage.put(
            "leaf",
            random.pick(&LEAVES),
            &place,
            Shape::leaf(size, size * 0.42, size * 0.35),
        );
    }
}
