//! The four light sources of a bay: two panels in the ceiling, two globes before the mirror.

use super::palette::*;
use super::{Bay, HEIGHT};
use crate::frame::Frame;
use crate::shape::Shape;
use crate::stage::Stage;
use crate::vector::vector;

/// Side of a panel.
const PANEL: f64 = 1.2;
const GLOBE: f64 = 0.1;

/// Puts the lights.
pub(super) fn four(stage: &mut Stage, bay: &Bay) {
    for x in [1.3, 3.5] {
        panel(stage, &bay.corner.shifted(x, HEIGHT, 1.7));
    }
    for x in [0.42, 2.68] {
        sconce(stage, &bay.corner.shifted(x, 1.98, 0.055));
    }
}

/// A panel in a low frame; `at` is on the ceiling.
fn panel(stage: &mut Stage, at: &Frame) {
    let light = Shape::sheet(PANEL, PANEL);
    stage.put("panel_light", &PANEL_LIGHT, &at.shifted(0.0, -0.01, 0.0).tilted(180.0), light);
    for turn in [0.0, 90.0, 180.0, 270.0] {
        let bar = Shape::cuboid(PANEL + 0.03, 0.028, 0.024);
        let side = at.turned(turn).shifted(0.014, -0.03, PANEL / 2.0 + 0.014);
        stage.put("panel_frame", &BRASS, &side, bar);
    }
}

/// A globe on a bent arm; `at` is on the mirror.
fn sconce(stage: &mut Stage, at: &Frame) {
    let rose = Shape::cylinder(0.035, 0.012, 20);
    stage.put("sconce_rose", &BRASS, &at.shifted(0.0, -0.175, 0.0).tilted(90.0), rose);
    let arm = [
        vector(0.0, -0.175, 0.012),
        vector(0.0, -0.175, 0.1),
        vector(0.0, -0.165, 0.125),
        vector(0.0, -0.125, 0.13),
    ];
    stage.put("sconce_arm", &BRASS, at, Shape::pipe(&arm, 0.008, 10));
    let cup = [(0.0, -0.104), (0.02, -0.1), (0.045, -0.078), (0.0, -0.0785)];
    let before = at.shifted(0.0, 0.0, 0.13);
    stage.put("sconce_cup", &BRASS, &before.shifted(0.0, -0.028, 0.0), Shape::lathe(&cup, 20));
    stage.put("globe_light", &GLOBE_LIGHT, &before, Shape::sphere(GLOBE, 20, 12));
}
