//! A desk: a top on a steel frame, with a pedestal of drawers at the right knee.
//!
//! Its frame stands on the floor under the middle of the top; who works at it sits at +z.

use super::palette::*;
use crate::frame::Frame;
use crate::shape::{Shape, rounded_rectangle};
use crate::stage::Stage;
use crate::vector::vector;

/// Height of what stands on a desk, a millimetre above the wood.
pub(super) const TOP: f64 = 0.741;
pub(super) const WIDTH: f64 = 1.62;
pub(super) const DEPTH: f64 = 0.8;

/// Puts a desk.
pub(super) fn desk(stage: &mut Stage, at: &Frame) {
    let top = Shape::prism(&rounded_rectangle(WIDTH, DEPTH, 0.02, 3), 0.026);
    stage.put("desk_top", &OAK, &at.shifted(0.0, 0.714, 0.0), top);
    for side in [-1.0, 1.0] {
        trestle(stage, &at.shifted(side * 0.76, 0.0, 0.0));
    }
    let apron = Shape::cuboid(1.45, 0.28, 0.012);
    stage.put("desk_apron", &WHITE_LACQUER, &at.shifted(0.0, 0.42, -0.3), apron);
    let tray = Shape::cuboid(1.1, 0.04, 0.1);
    stage.put("cable_tray", &BLACK_METAL, &at.shifted(-0.1, 0.6, -0.22), tray);
    pedestal(stage, &at.shifted(0.49, 0.0, 0.04));
}

fn trestle(stage: &mut Stage, at: &Frame) {
    for z in [-0.34, 0.34] {
        let leg = Shape::cuboid(0.045, 0.668, 0.045);
        stage.put("desk_leg", &BLACK_METAL, &at.shifted(0.0, 0.004, z), leg);
        let foot = Shape::cylinder(0.02, 0.003, 10);
        stage.put("desk_foot", &GREY_PLASTIC, &at.shifted(0.0, 0.0, z), foot);
    }
    let beam = Shape::cuboid(0.045, 0.04, 0.74);
    stage.put("desk_beam", &BLACK_METAL, &at.shifted(0.0, 0.673, 0.0), beam);
}

/// A pedestal on castors with three drawers.
fn pedestal(stage: &mut Stage, at: &Frame) {
    let (width, depth, height) = (0.4, 0.56, 0.55);
    let body = Shape::cuboid(width, height, depth);
    stage.put("pedestal", &WHITE_LACQUER, &at.shifted(0.0, 0.062, 0.0), body);
    for (y, front) in [(0.07, 0.255), (0.331, 0.135), (0.472, 0.135)] {
        let front_at = at.shifted(0.0, y, depth / 2.0 + 0.01);
        stage.put("drawer", &WHITE_LACQUER, &front_at, Shape::cuboid(width - 0.004, front, 0.016));
        let grip = front_at.shifted(0.0, front - 0.045, 0.008);
        let path = [
            vector(-0.06, 0.0, 0.0),
            vector(-0.055, 0.0, 0.022),
            vector(0.055, 0.0, 0.022),
            vector(0.06, 0.0, 0.0),
        ];
        stage.put("drawer_handle", &STEEL, &grip, Shape::pipe(&path, 0.005, 6));
    }
    let lock = Shape::cylinder(0.009, 0.005, 10);
    let keyhole = at.shifted(0.16, 0.582, depth / 2.0 + 0.019).tilted(90.0);
    stage.put("lock", &CHROME, &keyhole, lock);
    for (x, z) in [(-0.15, -0.22), (0.15, -0.22), (-0.15, 0.22), (0.15, 0.22)] {
        let wheel = Shape::cylinder(0.028, 0.022, 12);
        stage.put("castor", &BLACK_PLASTIC, &at.shifted(x + 0.011, 0.029, z).rolled(90.0), wheel);
    }
}
