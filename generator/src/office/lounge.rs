//! A corner to sit down in: an armchair by a low round table on a rug.

use super::Bay;
use super::palette::*;
use crate::frame::Frame;
use crate::random::Random;
use crate::shape::{Shape, rounded_rectangle};
use crate::stage::Stage;

/// The corner between the desks and the door.
pub(super) fn corner(stage: &mut Stage, bay: &Bay) {
    let rug = Shape::cylinder(0.95, 0.008, 48);
    stage.put("rug", &RUG, &bay.corner.shifted(4.15, 0.001, 4.4), rug);
    table(stage, &bay.corner.shifted(3.75, 0.01, 4.45), bay);
    armchair(stage, &bay.corner.shifted(4.72, 0.01, 4.5).turned(-62.0));
}

fn table(stage: &mut Stage, at: &Frame, bay: &Bay) {
    stage.put("table_foot", &BLACK_METAL, at, Shape::cylinder(0.2, 0.012, 28));
    stage.put(
        "table_stem",
        &BLACK_METAL,
        &at.shifted(0.0, 0.013, 0.0),
        Shape::cylinder(0.025, 0.39, 14),
    );
    let top = [(0.0, 0.0), (0.33, 0.0), (0.35, 0.012), (0.35, 0.024), (0.0, 0.024)];
    stage.put("table_top", &OAK, &at.shifted(0.0, 0.404, 0.0), Shape::lathe(&top, 36));
    let mut random = Random::new(0x7AB1, bay.index);
    for magazine in 0..5 {
        let place = at.shifted(-0.13, 0.43 + 0.005 * f64::from(magazine), 0.1);
        let turned = place.turned(20.0 + random.between(-16.0, 16.0));
        stage.put("magazine", random.pick(&PRINTS), &turned, Shape::cuboid(0.21, 0.004, 0.28));
    }
    bowl(stage, &at.shifted(0.12, 0.43, -0.08), &mut random);
}

fn bowl(stage: &mut Stage, at: &Frame, random: &mut Random) {
    let bowl = [
        (0.0, 0.0),
        (0.05, 0.0),
        (0.1, 0.03),
        (0.13, 0.075),
        (0.124, 0.075),
        (0.095, 0.036),
        (0.05, 0.008),
        (0.0, 0.008),
    ];
    stage.put("bowl", &CERAMIC[1], at, Shape::lathe(&bowl, 28));
    for apple in 0..6 {
        let out = if apple < 5 { 0.062 } else { 0.0 };
        let place =
            at.turned(72.0 * f64::from(apple)).shifted(out, 0.062 + 0.5 * (0.062 - out), 0.0);
        let shape = Shape::sphere(0.034, 14, 8).scaled(1.0, 0.9, 1.0);
        stage.put("apple", random.pick(&APPLES), &place, shape);
    }
}

/// An armchair on the floor at `at`; who sits in it looks along +z.
fn armchair(stage: &mut Stage, at: &Frame) {
    for (x, z) in [(-0.31, -0.28), (0.31, -0.28), (-0.31, 0.28), (0.31, 0.28)] {
        let leg = Shape::tapered((0.026, 0.026), (0.045, 0.045), 0.17);
        stage.put("armchair_leg", &WALNUT, &at.shifted(x, 0.0, z), leg);
    }
    let seat = Shape::prism(&rounded_rectangle(0.74, 0.7, 0.06, 3), 0.13);
    stage.put("armchair_seat", &LEATHER, &at.shifted(0.0, 0.171, 0.0), seat);
    let pad = Shape::prism(&rounded_rectangle(0.52, 0.58, 0.06, 3), 0.11);
    stage.put("armchair_pad", &LEATHER, &at.shifted(0.0, 0.302, 0.045), pad);
    for side in [-1.0, 1.0] {
        let arm = Shape::prism(&rounded_rectangle(0.1, 0.68, 0.045, 3), 0.27);
        stage.put("armchair_arm", &LEATHER, &at.shifted(side * 0.315, 0.302, 0.0), arm);
    }
    let back = Shape::prism(&rounded_rectangle(0.74, 0.13, 0.05, 3), 0.52);
    stage.put("armchair_back", &LEATHER, &at.shifted(0.0, 0.31, -0.365).tilted(-9.0), back);
    let cushion = Shape::sphere(0.2, 18, 10).scaled(1.0, 1.0, 0.36);
    stage.put("cushion", &CUSHION, &at.shifted(0.06, 0.6, -0.2).tilted(-14.0), cushion);
}
