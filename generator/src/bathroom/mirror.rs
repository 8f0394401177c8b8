//! The two mirrors on opposite walls. The near one leans forward a little, as mirrors over basins
//! do: the rooms in the mirrors then go round a bend instead of ending in the dark.

use super::palette::*;
use super::tiles::Area;
use super::{BAY_LENGTH, Bay, WIDTH};
use crate::frame::Frame;
use crate::shape::Shape;
use crate::stage::Stage;

const LEFT: f64 = 0.3;
const BOTTOM: f64 = 1.14;
const SIZE: (f64, f64) = (2.7, 1.2);
/// Width of the brass frame, which lies within the mirror's area.
const FRAME: f64 = 0.018;
/// By how many degrees the near mirror leans forward.
const LEAN: f64 = 1.7;

/// The part of a wall that stays without tiles; on the far wall, x runs the other way.
pub(super) fn hole(is_far: bool) -> Area {
    let left = if is_far { BAY_LENGTH - LEFT - SIZE.0 } else { LEFT };
    Area { left, bottom: BOTTOM, width: SIZE.0, height: SIZE.1 }
}

/// Hangs both mirrors of a bay.
pub(super) fn pair(stage: &mut Stage, bay: &Bay) {
    let x = LEFT + SIZE.0 / 2.0;
    mirror(stage, &bay.corner.shifted(x, BOTTOM, 0.004).tilted(LEAN));
    let far = bay.corner.shifted(x, BOTTOM, WIDTH - 0.004).turned(180.0);
    mirror(stage, &far);
}

fn mirror(stage: &mut Stage, at: &Frame) {
    let (width, height) = SIZE;
    let glass = Shape::panel(width - FRAME, height - FRAME);
    stage.put("mirror", &MIRROR, &at.shifted(0.0, FRAME / 2.0, 0.004), glass);
    for y in [0.0, height - FRAME] {
        let rail = Shape::cuboid(width, FRAME, 0.02);
        stage.put("mirror_frame", &BRASS, &at.shifted(0.0, y, 0.011), rail);
    }
    for side in [-1.0, 1.0] {
        let post = Shape::cuboid(FRAME, height - 2.0 * FRAME - 0.002, 0.02);
        let x = side * (width - FRAME) / 2.0;
        stage.put("mirror_frame", &BRASS, &at.shifted(x, FRAME + 0.001, 0.011), post);
    }
}
