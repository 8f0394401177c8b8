//! Tiles: rows of rectangles on a wall, hexagons on the floor. Each is one polygon, laid by hand:
//! none lies exactly as its neighbors, which is what makes tiled walls glitter.

use crate::frame::{Frame, sin_cos};
use crate::material::Material;
use crate::random::Random;
use crate::shape::Shape;
use crate::stage::Stage;
use crate::vector::vector;

/// How far tiles stand out from the grout.
pub(super) const THICKNESS: f64 = 0.003;

/// How tiles are laid on a wall.
#[derive(Clone, Copy, Debug)]
pub(super) struct Laying {
    pub(super) noun: &'static str,
    /// Width and height of a tile with its joint.
    pub(super) pitch: (f64, f64),
    /// Width of the joint between tiles.
    pub(super) joint: f64,
    /// Whether every other row is shifted by half a tile.
    pub(super) is_bonded: bool,
    /// Most degrees by which a tile is out of true.
    pub(super) tilt: f64,
}

/// A part of a wall: from a lower left corner, width and height.
#[derive(Clone, Copy, Debug)]
pub(super) struct Area {
    pub(super) left: f64,
    pub(super) bottom: f64,
    pub(super) width: f64,
    pub(super) height: f64,
}

impl Area {
    fn holds(&self, x: f64, y: f64) -> bool {
        let (across, up) = (x - self.left, y - self.bottom);
        (0.0..self.width).contains(&across) && (0.0..self.height).contains(&up)
    }
}

/// Lays tiles over an area of a wall but for a hole; `wall` has +z into the room. Tiles at the
/// sides are cut to fit. `hue` chooses the material of a tile from its middle.
pub(super) fn lay<'m>(
    stage: &mut Stage,
    wall: &Frame,
    (area, hole): (Area, Option<Area>),
    laying: &Laying,
    random: &mut Random,
    hue: &dyn Fn(&mut Random, f64, f64) -> &'m Material,
) {
    let rows = (area.height / laying.pitch.1 + 0.01) as u32;
    for row in 0..rows {
        let y = area.bottom + laying.pitch.1 * f64::from(row);
        let shift = if laying.is_bonded && row % 2 == 1 { 0.5 } else { 0.0 };
        for (left, right) in cuts(area.width, laying.pitch.0, shift) {
            let (width, height) = (right - left - laying.joint, laying.pitch.1 - laying.joint);
            let x = area.left + (left + right) / 2.0;
            let middle = y + laying.pitch.1 / 2.0;
            if width < 0.01 || hole.is_some_and(|hole| hole.holds(x, middle)) {
                continue;
            }
            let at = out_of_true(wall.shifted(x, middle, THICKNESS), laying.tilt, random);
            let tile = Shape::panel(width, height).placed(&Frame::at(0.0, -height / 2.0, 0.0));
            stage.put(laying.noun, hue(random, x, middle), &at, tile);
        }
    }
}

/// Where the tiles of a row begin and end.
fn cuts(width: f64, pitch: f64, shift: f64) -> impl Iterator<Item = (f64, f64)> {
    let count = (width / pitch + 1.99) as u32;
    (0..count).filter_map(move |column| {
        let left = (f64::from(column) - shift) * pitch;
        let (left, right) = (left.max(0.0), (left + pitch).min(width));
        (right - left > 0.01).then_some((left, right))
    })
}

/// Half the distance between opposite sides of a hexagon.
const INRADIUS: f64 = 0.025;
const HEXAGON_JOINT: f64 = 0.003;

/// Lays hexagons on the floor between two x and from z = 0 to `width`. Those at the edges run on
/// under the walls. `hue` chooses the material from a hexagon's column and row.
pub(super) fn lay_hexagons<'m>(
    stage: &mut Stage,
    (from, to): (f64, f64),
    width: f64,
    random: &mut Random,
    hue: &dyn Fn(&mut Random, i64, i64) -> &'m Material,
) {
    let pitch = 2.0 * INRADIUS + HEXAGON_JOINT;
    let (sin60, _) = sin_cos(60.0);
    let rise = pitch * sin60;
    for row in 0..=(width / rise) as i64 {
        let shift = if row % 2 == 1 { 0.5 } else { 0.0 };
        let first = (from / pitch - shift).ceil() as i64;
        let last = (to / pitch - shift).ceil() as i64;
        for column in first..last {
            let x = (column as f64 + shift) * pitch;
            let at = out_of_true(Frame::at(x, 0.0, rise * row as f64), 0.12, random);
            stage.put("hexagon", hue(random, column, row), &at, hexagon());
        }
    }
}

/// A hexagon on the floor, with corners towards +z and −z.
fn hexagon() -> Shape {
    let (_, cos30) = sin_cos(30.0);
    let radius = INRADIUS / cos30;
    let corner = |corner: u32| {
        let (sin, cos) = sin_cos(30.0 + 60.0 * f64::from(corner));
        vector(radius * cos, 0.0, -radius * sin)
    };
    Shape::polygon((0..6).map(corner).collect())
}

fn out_of_true(at: Frame, most: f64, random: &mut Random) -> Frame {
    at.tilted(random.between(-most, most)).turned(random.between(-most, most))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_covered_from_end_to_end() {
        for shift in [0.0, 0.5] {
            let cuts: Vec<(f64, f64)> = cuts(1.03, 0.15, shift).collect();
            assert_eq!(cuts[0].0, 0.0);
            assert!(cuts.last().is_some_and(|last| 1.03 - last.1 < 0.011));
            assert!(cuts.windows(2).all(|pair| (pair[0].1 - pair[1].0).abs() < 1e-12));
        }
    }

    #[test]
    fn hexagons_face_up() {
        let hexagon = hexagon();
        let corner = |index: usize| hexagon.points[index];
        assert!((corner(1) - corner(0)).cross(corner(2) - corner(1)).y > 0.0);
    }
}
