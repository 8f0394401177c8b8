//! The toilet, opposite to the bath: bowl, seat, lid, flush plate, paper and brush.

use super::palette::*;
use super::{Bay, WIDTH};
use crate::frame::Frame;
use crate::shape::Shape;
use crate::stage::Stage;
use crate::vector::vector;

/// Puts the toilet of a bay at the far wall.
pub(super) fn toilet(stage: &mut Stage, bay: &Bay) {
    let at = bay.corner.shifted(3.75, 0.001, WIDTH - 0.005).turned(180.0);
    let box_in = Shape::cuboid(0.6, 1.06, 0.12);
    stage.put("cistern", &OAK, &at.shifted(0.0, 0.0, 0.06), box_in);
    for (x, width) in [(-0.035, 0.1), (0.06, 0.06)] {
        let plate = Shape::cuboid(width, 0.11, 0.008);
        stage.put("flush_plate", &CHROME, &at.shifted(x, 0.86, 0.126), plate);
    }
    bowl(stage, &at.shifted(0.0, 0.0, 0.4));
    paper(stage, &at.shifted(0.5, 0.7, 0.0));
    brush(stage, &at.shifted(-0.42, 0.0, 0.1));
}

fn bowl(stage: &mut Stage, at: &Frame) {
    let body = [(0.0, 0.0), (0.1, 0.0), (0.11, 0.1), (0.15, 0.26), (0.185, 0.39), (0.0, 0.39)];
    stage.put("toilet_bowl", &PORCELAIN, at, Shape::lathe(&body, 32).scaled(1.0, 1.0, 1.35));
    let seat = Shape::cylinder(0.19, 0.018, 36).scaled(1.0, 1.0, 1.35);
    stage.put("toilet_seat", &PORCELAIN, &at.shifted(0.0, 0.392, 0.0), seat);
    let lid = [(0.0, 0.0), (0.188, 0.0), (0.19, 0.012), (0.17, 0.02), (0.0, 0.024)];
    stage.put(
        "toilet_lid",
        &OAK,
        &at.shifted(0.0, 0.412, 0.0),
        Shape::lathe(&lid, 36).scaled(1.0, 1.0, 1.35),
    );
    for x in [-0.07, 0.07] {
        let hinge =
            Shape::bar(vector(x - 0.02, 0.42, -0.262), vector(x + 0.02, 0.42, -0.262), 0.01, 10);
        stage.put("toilet_hinge", &CHROME, at, hinge);
    }
}

fn paper(stage: &mut Stage, at: &Frame) {
    let path = [vector(-0.08, 0.0, 0.006), vector(-0.08, 0.0, 0.07), vector(0.075, 0.0, 0.07)];
    stage.put("paper_holder", &CHROME, at, Shape::pipe(&path, 0.007, 10));
    let roll = Shape::bar(vector(-0.045, -0.012, 0.07), vector(0.06, -0.012, 0.07), 0.055, 24);
    stage.put("paper_roll", &TOWELS[1], at, roll);
}

fn brush(stage: &mut Stage, at: &Frame) {
    let pot = [(0.0, 0.0), (0.045, 0.0), (0.05, 0.14), (0.046, 0.14), (0.042, 0.006), (0.0, 0.006)];
    stage.put("brush_pot", &BLACK, at, Shape::lathe(&pot, 24));
    stage.put("brush", &CHROME, &at.shifted(0.0, 0.008, 0.0), Shape::cylinder(0.008, 0.36, 10));
}
