//! The vanity under the near mirror: a cabinet with drawers, a stone top, two bowls with taps.

use super::Bay;
use super::palette::*;
use crate::frame::Frame;
use crate::shape::{Shape, arc};
use crate::stage::Stage;
use crate::vector::vector;

/// Where the vanity stands along the wall.
const MIDDLE: f64 = 1.65;
const WIDTH: f64 = 2.5;
const DEPTH: f64 = 0.5;
const BODY: (f64, f64) = (0.34, 0.46);
/// What stands on the vanity stands a millimetre above its top.
pub(super) const TOP: f64 = 0.842;

/// Puts the vanity of a bay.
pub(super) fn vanity(stage: &mut Stage, bay: &Bay) {
    let at = bay.corner.shifted(MIDDLE, 0.0, 0.006 + DEPTH / 2.0);
    let body = Shape::cuboid(WIDTH - 0.02, BODY.1, DEPTH - 0.02);
    stage.put("vanity", &OAK, &at.shifted(0.0, BODY.0, 0.0), body);
    stage.put(
        "vanity_top",
        &STONE_TOP,
        &at.shifted(0.0, 0.802, 0.005),
        Shape::cuboid(WIDTH, 0.039, DEPTH),
    );
    for column in 0..4 {
        for row in 0..2 {
            let x = (WIDTH - 0.04) / 4.0 * (f64::from(column) - 1.5);
            let y = BODY.0 + 0.012 + 0.224 * f64::from(row);
            drawer(stage, &at.shifted(x, y, DEPTH / 2.0 + 0.0005));
        }
    }
    for (x, z) in [(-1.2, -0.18), (1.2, -0.18), (-1.2, 0.18), (1.2, 0.18)] {
        let leg = Shape::cylinder(0.018, BODY.0 - 0.002, 16);
        stage.put("vanity_leg", &BRASS, &at.shifted(x, 0.001, z), leg);
    }
    for x in [-0.62, 0.62] {
        bowl(stage, &at.shifted(x, TOP, 0.02));
        tap(stage, &at.shifted(x, TOP, -0.17));
    }
}

fn drawer(stage: &mut Stage, at: &Frame) {
    let width = (WIDTH - 0.04) / 4.0 - 0.006;
    stage.put("drawer", &OAK, at, Shape::cuboid(width, 0.214, 0.018));
    let path = [
        vector(-0.08, 0.0, 0.0),
        vector(-0.075, 0.0, 0.028),
        vector(0.075, 0.0, 0.028),
        vector(0.08, 0.0, 0.0),
    ];
    stage.put(
        "drawer_handle",
        &BRASS,
        &at.shifted(0.0, 0.15, 0.0095),
        Shape::pipe(&path, 0.006, 8),
    );
}

/// A bowl that stands on the top, with its drain.
fn bowl(stage: &mut Stage, at: &Frame) {
    let profile = [
        (0.0, 0.0),
        (0.1, 0.0),
        (0.15, 0.03),
        (0.19, 0.085),
        (0.205, 0.135),
        (0.2, 0.14),
        (0.194, 0.135),
        (0.178, 0.088),
        (0.14, 0.04),
        (0.09, 0.016),
        (0.0, 0.012),
    ];
    stage.put("basin", &PORCELAIN, at, Shape::lathe(&profile, 40).scaled(1.15, 1.0, 0.85));
    let drain = Shape::cylinder(0.022, 0.004, 20);
    stage.put("drain", &CHROME, &at.shifted(0.0, 0.0145, 0.0), drain);
}

/// A tall tap of chrome, reaching over the bowl, with a lever at its side.
fn tap(stage: &mut Stage, at: &Frame) {
    let foot = [(0.0, 0.0), (0.028, 0.0), (0.026, 0.01), (0.018, 0.014), (0.0, 0.014)];
    stage.put("tap_foot", &CHROME, at, Shape::lathe(&foot, 24));
    let mut path = vec![vector(0.0, 0.014, 0.0), vector(0.0, 0.1, 0.0), vector(0.0, 0.2, 0.0)];
    let bend =
        arc(vector(0.0, 0.22, 0.07), vector(0.0, 0.0, -0.07), vector(0.0, 0.07, 0.0), (0.0, 180.0));
    path.extend(bend);
    path.push(vector(0.0, 0.19, 0.14));
    stage.put("tap_spout", &CHROME, at, Shape::pipe(&path, 0.012, 16));
    stage.put(
        "tap_lever_base",
        &CHROME,
        &at.shifted(0.014, 0.09, 0.0).rolled(-90.0),
        Shape::cylinder(0.011, 0.025, 16),
    );
    let lever = Shape::bar(vector(0.044, 0.09, 0.0), vector(0.075, 0.15, 0.0), 0.004, 10);
    stage.put("tap_lever", &CHROME, at, lever);
}
