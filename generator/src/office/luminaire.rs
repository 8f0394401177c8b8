//! The lamp over the desks: a long housing on wires, its tube behind thin bars.
//!
//! Nothing of the lamp lies in front of the tube but the dark bars: a bright rim would be a light
//! that no renderer knows of, and show as noise.

use super::palette::*;
use super::{Bay, HEIGHT};
use crate::frame::Frame;
use crate::shape::Shape;
use crate::stage::Stage;

const LENGTH: f64 = 2.9;
const HANGS_AT: f64 = 2.26;
const BARS: u32 = 28;

/// Hangs the lamp of a bay; its tube is one of the bay's three light sources.
pub(super) fn hang(stage: &mut Stage, bay: &Bay) {
    let at = bay.corner.shifted(3.88, HANGS_AT, 2.0);
    stage.put("lamp_housing", &ALUMINIUM, &at, Shape::cuboid(LENGTH, 0.05, 0.26));
    for side in [-1.0, 1.0] {
        let cap = Shape::cuboid(0.012, 0.056, 0.266);
        stage.put("lamp_cap", &BLACK_METAL, &at.shifted(side * 1.457, -0.003, 0.0), cap);
        let rail = Shape::cuboid(LENGTH, 0.01, 0.004);
        stage.put("lamp_rail", &BLACK_METAL, &at.shifted(0.0, 0.02, side * 0.1335), rail);
        let wire = Shape::cylinder(0.002, HEIGHT - 0.012 - HANGS_AT - 0.052, 5);
        stage.put("lamp_wire", &STEEL, &at.shifted(side * 1.2, 0.051, 0.08), wire);
    }
    for bar in 0..BARS {
        let x = (LENGTH - 0.06) * ((f64::from(bar) + 0.5) / f64::from(BARS) - 0.5);
        let shape = Shape::cuboid(0.004, 0.003, 0.25);
        stage.put("lamp_bar", &BLACK_METAL, &at.shifted(x, -0.007, 0.0), shape);
    }
    // One tube, seen from below behind the bars and from above.
    let below = Frame::at(0.0, -0.002, 0.0).tilted(180.0);
    let below = Shape::sheet(LENGTH - 0.04, 0.24).placed(&below);
    let above = Shape::sheet(LENGTH - 0.04, 0.06).placed(&Frame::at(0.0, 0.052, 0.0));
    stage.put("lamp_tube", &TUBE, &at, below.and(above));
}
