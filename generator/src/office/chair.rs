//! A swivel chair: five legs on castors, a gas spring, seat, back and arms.

use super::palette::*;
use crate::frame::{Frame, sin_cos};
use crate::random::Random;
use crate::shape::{Shape, rounded_rectangle};
use crate::stage::Stage;
use crate::vector::vector;

const SEAT: f64 = 0.46;

/// Puts the chair of a desk, pushed back and turned a little.
pub(super) fn at_desk(stage: &mut Stage, desk: &Frame, place: u64) {
    let mut random = Random::new(0xCA1B, place);
    let (x, z) = (random.between(-0.22, 0.02), random.between(0.6, 0.78));
    let turn = 180.0 + random.between(-38.0, 38.0);
    let fabric = &CHAIR_FABRIC[(place % 4) as usize];
    chair(stage, &desk.shifted(x, 0.0, z).turned(turn), fabric);
}

/// A chair on the floor at `at`; who sits in it looks along +z.
fn chair(stage: &mut Stage, at: &Frame, fabric: &crate::material::Material) {
    for leg in 0..5 {
        star_leg(stage, &at.turned(72.0 * f64::from(leg) + 18.0));
    }
    stage.put(
        "chair_hub",
        &BLACK_PLASTIC,
        &at.shifted(0.0, 0.07, 0.0),
        Shape::cylinder(0.04, 0.07, 14),
    );
    let spring = Shape::cylinder(0.025, 0.24, 14);
    stage.put("gas_spring", &CHROME, &at.shifted(0.0, 0.141, 0.0), spring);
    stage.put(
        "chair_plate",
        &BLACK_METAL,
        &at.shifted(0.0, 0.382, 0.0),
        Shape::cuboid(0.22, 0.025, 0.3),
    );
    let seat = Shape::prism(&rounded_rectangle(0.5, 0.48, 0.1, 4), 0.055);
    stage.put("chair_seat", fabric, &at.shifted(0.0, SEAT - 0.052, 0.0), seat);
    back(stage, at, fabric);
    for side in [-1.0, 1.0] {
        let post = Shape::cuboid(0.03, 0.24, 0.05);
        stage.put("chair_arm_post", &BLACK_PLASTIC, &at.shifted(side * 0.268, 0.43, -0.02), post);
        let rest = Shape::prism(&rounded_rectangle(0.07, 0.26, 0.03, 2), 0.025);
        stage.put("chair_arm", &BLACK_PLASTIC, &at.shifted(side * 0.268, 0.671, 0.02), rest);
    }
}

/// A curved, upholstered back on a spine.
fn back(stage: &mut Stage, at: &Frame, fabric: &crate::material::Material) {
    let spine = [
        vector(0.0, 0.395, -0.14),
        vector(0.0, 0.4, -0.25),
        vector(0.0, 0.47, -0.31),
        vector(0.0, 0.75, -0.325),
    ];
    stage.put("chair_spine", &BLACK_METAL, at, Shape::pipe(&spine, 0.016, 8));
    let (thickness, half, radius) = (0.045, 25.0, 0.52);
    let edge = |radius: f64, part: f64| {
        let (sin, cos) = sin_cos(half * part);
        (radius * sin, radius * (1.0 - cos))
    };
    let parts = [-1.0, -0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0];
    let inner = parts.iter().map(|&part| edge(radius, part));
    let outer = parts.iter().rev().map(|&part| {
        let (x, z) = edge(radius + thickness, part);
        (x, z - thickness)
    });
    // Walk from +x to +z to −x: along the front first, then back along the rear.
    let outline: Vec<(f64, f64)> = inner.rev().chain(outer.rev()).collect();
    let cushion = Shape::prism(&outline, 0.44);
    stage.put("chair_back", fabric, &at.shifted(0.0, 0.55, -0.262).tilted(-7.0), cushion);
}

/// One of the legs, along +z, with its castor.
fn star_leg(stage: &mut Stage, at: &Frame) {
    let leg = Shape::tapered((0.045, 0.03), (0.026, 0.02), 0.27);
    stage.put("chair_leg", &ALUMINIUM, &at.shifted(0.0, 0.105, 0.03).tilted(97.0), leg);
    let castor = at.shifted(0.0, 0.0, 0.29);
    stage.put(
        "castor_stem",
        &BLACK_METAL,
        &castor.shifted(0.0, 0.03, 0.0),
        Shape::cuboid(0.012, 0.035, 0.02),
    );
    for x in [-0.008, 0.028] {
        let wheel = Shape::cylinder(0.027, 0.02, 12);
        stage.put("castor", &BLACK_PLASTIC, &castor.shifted(x, 0.0275, 0.0).rolled(90.0), wheel);
    }
}
