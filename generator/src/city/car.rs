//! Cars: a body and a cabin, on wheels where they are to be seen.

use super::Detail;
use super::finish::Finish;
use super::mesh::{Mesh, RING, SHEET, SOLID, STANDING};
use crate::frame::Frame;
use crate::random::Random;

/// Half of a car's width.
const HALF: f64 = 0.88;

const PAINTS: [Finish; 8] = [
    Finish::WhitePaint,
    Finish::BlackPaint,
    Finish::RedPaint,
    Finish::BluePaint,
    Finish::TaxiPaint,
    Finish::BlackPaint,
    Finish::Panel,
    Finish::TaxiPaint,
];

/// Puts a car that heads along x; `at` is below its middle.
pub(super) fn park(mesh: &mut Mesh, at: &Frame, detail: Detail, random: &mut Random) {
    let paint = *random.pick(&PAINTS);
    let is_van = random.happens(0.18);
    let (low, high, roof) = if is_van { (-2.3, 1.3, 2.0) } else { (-1.7, 0.9, 1.46) };
    let belt = if is_van { 1.05 } else { 0.88 };
    let body = [(-2.2, 2.2), (-HALF, HALF)];
    mesh.tapered(paint, at, ([(-2.2, 2.2), (-HALF, HALF)], body, (0.28, 0.62)), SOLID);
    let shoulder = [(-2.15, 2.05), (-HALF + 0.06, HALF - 0.06)];
    mesh.tapered(paint, at, (body, shoulder, (0.62, belt)), STANDING);
    let (sill, top) = (
        [(low - 0.1, high + 0.55), (-HALF + 0.08, HALF - 0.08)],
        [(low + 0.35, high), (-HALF + 0.24, HALF - 0.24)],
    );
    mesh.tapered(Finish::Glass, at, (sill, top, (belt, roof - 0.05)), RING);
    let brim = [(low + 0.3, high + 0.05), (-HALF + 0.22, HALF - 0.22)];
    mesh.tapered(paint, at, (brim, top, (roof - 0.05, roof)), STANDING);
    if detail >= Detail::Grid {
        wheels(mesh, at, detail);
    }
    if detail >= Detail::Windows {
        lamps_and_bumpers(mesh, at);
    }
    if detail == Detail::Fine {
        trimmings(mesh, at, paint, (low, high, belt, roof));
    }
}

fn wheels(mesh: &mut Mesh, at: &Frame, detail: Detail) {
    let sides = match detail {
        Detail::Fine => 12,
        Detail::Windows => 8,
        _ => 6,
    };
    for (x, z, turn) in
        [(-1.35, HALF, 90.0), (1.35, HALF, 90.0), (-1.35, -HALF, -90.0), (1.35, -HALF, -90.0)]
    {
        // The axle is the y axis of a tilted frame, and points outward.
        let hub = at.shifted(x, 0.33, z).tilted(turn);
        mesh.prism(Finish::Rubber, &hub, (sides, (0.33, 0.33), (-0.2, 0.02)));
        if detail >= Detail::Windows {
            mesh.prism(Finish::Steel, &hub, (8, (0.2, 0.16), (0.02, 0.035)));
        }
    }
}

fn lamps_and_bumpers(mesh: &mut Mesh, at: &Frame) {
    for side in [-1.0, 1.0] {
        let z = (side * 0.62 - 0.18, side * 0.62 + 0.18);
        mesh.block(Finish::WhiteFrame, at, [(2.15, 2.23), (0.55, 0.68), z], STANDING);
        mesh.block(Finish::RedPaint, at, [(-2.23, -2.1), (0.58, 0.72), z], STANDING);
        let mirror = side * (HALF + 0.08);
        let spans = [(0.85, 0.98), (0.9, 1.05), (mirror - 0.09, mirror + 0.09)];
        mesh.block(Finish::BlackPaint, at, spans, SOLID);
    }
    for x in [-2.27, 2.2] {
        let spans = [(x, x + 0.07), (0.3, 0.46), (-HALF + 0.03, HALF - 0.03)];
        mesh.block(Finish::DarkFrame, at, spans, SOLID);
    }
    mesh.block(Finish::Steel, at, [(2.19, 2.21), (0.48, 0.64), (-0.36, 0.36)], SOLID);
}

/// Pillars, handles, plates, wipers and rails.
fn trimmings(
    mesh: &mut Mesh,
    at: &Frame,
    paint: Finish,
    (low, high, belt, roof): (f64, f64, f64, f64),
) {
    for side in [-1.0, 1.0] {
        let z = side * (HALF - 0.15);
        for x in [low + 0.5, (low + high) / 2.0, high - 0.05] {
            let spans = [(x - 0.04, x + 0.04), (belt, roof - 0.04), (z - 0.08, z + 0.08)];
            mesh.block(paint, at, spans, RING);
        }
        let z = side * (HALF - 0.02);
        for x in [-0.6, 0.45] {
            let spans = [(x - 0.1, x + 0.1), (0.74, 0.77), (z - 0.03, z + 0.03)];
            mesh.block(Finish::Steel, at, spans, SOLID);
        }
        let z = side * (HALF - 0.32);
        let spans = [(low + 0.5, high - 0.2), (roof, roof + 0.04), (z - 0.02, z + 0.02)];
        mesh.block(Finish::DarkFrame, at, spans, SOLID);
        let z = side * 0.35;
        let spans = [(high + 0.3, high + 0.33), (belt + 0.02, belt + 0.05), (z - 0.3, z + 0.3)];
        mesh.block(Finish::Rubber, at, spans, SOLID);
    }
    for x in [-2.285, 2.275] {
        mesh.block(Finish::WhiteFrame, at, [(x, x + 0.01), (0.34, 0.44), (-0.26, 0.26)], SOLID);
    }
    mesh.block(
        Finish::Glass,
        at,
        [(low + 0.7, high - 0.4), (roof + 0.01, roof + 0.01), (-0.4, 0.4)],
        SHEET,
    );
}
