//! The lamp over the desks: a long housing on wires, with louvres before its tube.

use super::palette::*;
use super::{Bay, HEIGHT};
use crate::frame::Frame;
use crate::shape::Shape;
use crate::stage::Stage;

const LENGTH: f64 = 2.9;
const HANGS_AT: f64 = 2.26;
const LOUVRES: u32 = 28;

/// Hangs the lamp of a bay; its tube is one of the bay's three light sources.
pub(super) fn hang(stage: &mut Stage, bay: &Bay) {
    let at = bay.corner.shifted(3.88, HANGS_AT, 2.0);
    stage.put("lamp_housing", &ALUMINIUM, &at, Shape::cuboid(LENGTH, 0.03, 0.17));
    for side in [-1.0, 1.0] {
        let cheek = Shape::cuboid(LENGTH, 0.05, 0.006);
        stage.put("lamp_cheek", &ALUMINIUM, &at.shifted(0.0, -0.052, side * 0.082), cheek);
        let cap = Shape::cuboid(0.006, 0.05, 0.154);
        let end = at.shifted(side * (LENGTH / 2.0 - 0.004), -0.052, 0.0);
        stage.put("lamp_cap", &ALUMINIUM, &end, cap);
        let wire = Shape::cylinder(0.002, HEIGHT - 0.012 - HANGS_AT - 0.031, 5);
        stage.put("lamp_wire", &STEEL, &at.shifted(side * 1.2, 0.031, 0.08), wire);
    }
    for louvre in 0..LOUVRES {
        let x = (LENGTH - 0.06) * ((f64::from(louvre) + 0.5) / f64::from(LOUVRES) - 0.5);
        let fin = Shape::cuboid(0.002, 0.028, 0.15);
        stage.put("lamp_louvre", &WHITE_LACQUER, &at.shifted(x, -0.048, 0.0), fin);
    }
    // One tube, seen from below between the louvres and from above.
    let below =
        Shape::sheet(LENGTH - 0.04, 0.13).placed(&Frame::at(0.0, -0.006, 0.0).tilted(180.0));
    let above = Shape::sheet(LENGTH - 0.04, 0.13).placed(&Frame::at(0.0, 0.036, 0.0));
    stage.put("lamp_tube", &TUBE, &at, below.and(above));
}
