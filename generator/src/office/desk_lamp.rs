//! The desk lamp: a heavy foot, two arms, a shade with the third light source in it.

use super::palette::*;
use crate::frame::Frame;
use crate::shape::Shape;
use crate::stage::Stage;
use crate::vector::vector;

/// Puts the lamp on a desk; it reaches towards +x.
pub(super) fn desk_lamp(stage: &mut Stage, at: &Frame) {
    let foot = [(0.0, 0.0), (0.085, 0.0), (0.085, 0.012), (0.02, 0.022), (0.0, 0.022)];
    stage.put("lamp_foot", &BRASS, at, Shape::lathe(&foot, 24));
    let (root, elbow, tip) =
        (vector(0.0, 0.023, 0.0), vector(-0.1, 0.27, 0.0), vector(0.16, 0.455, 0.02));
    stage.put("lamp_arm", &BRASS, at, Shape::bar(root, elbow, 0.007, 8));
    stage.put("lamp_arm", &BRASS, at, Shape::bar(elbow, tip, 0.006, 8));
    let joint = Shape::sphere(0.014, 12, 8);
    stage.put("lamp_joint", &BLACK_METAL, &at.shifted(elbow.x, elbow.y, elbow.z), joint);
    let head = at.shifted(tip.x, tip.y - 0.035, tip.z).rolled(14.0);
    stage.put("lamp_shade", &PINS[2], &head, shade());
    stage.put(
        "lamp_socket",
        &BLACK_PLASTIC,
        &head.shifted(0.0, -0.002, 0.0),
        Shape::cylinder(0.016, 0.026, 12),
    );
    stage.put("lamp_bulb", &BULB, &head.shifted(0.0, -0.037, 0.0), Shape::sphere(0.036, 16, 10));
}

/// A bell, open below, with a wall of some millimetres.
fn shade() -> Shape {
    let outside = [(0.088, -0.085), (0.072, -0.04), (0.03, 0.028), (0.0, 0.034)];
    let inside = [(0.0, 0.028), (0.027, 0.022), (0.068, -0.043), (0.084, -0.085)];
    let profile: Vec<(f64, f64)> = outside.into_iter().chain(inside).collect();
    // One goes up outside and down inside; the rim closes it.
    let rim = [(0.084, -0.085), (0.088, -0.085)];
    Shape::lathe(&profile[..4], 24).and(Shape::lathe(&profile[4..], 24)).and(Shape::lathe(&rim, 24))
}
