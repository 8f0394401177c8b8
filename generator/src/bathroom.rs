//! The bathroom: tiles all over, a vanity with two basins, a bath on pebbles, and two mirrors that
//! face each other, so that the room goes on for ever.
//!
//! A larger bathroom is a hall of several bays in a row along x; the camera stays in the first.

mod accessories;
mod basin;
mod bath;
mod lights;
mod mirror;
mod palette;
mod plumbing;
mod tiles;
mod walls;

use crate::files::Files;
use crate::frame::Frame;
use crate::stage::{About, Stage, View};
use crate::vector::vector;
use crate::{BATHROOM_LIGHTS, BATHROOM_OBJECTS};

/// Length of a bay along x.
const BAY_LENGTH: f64 = 4.6;
/// From the wall with the vanity (z = 0) to the one opposite.
const WIDTH: f64 = 3.4;
/// From the floor to the ceiling.
const HEIGHT: f64 = 2.6;

const ABOUT: About = About {
    name: "bathroom",
    shows: "
A bathroom of tiles: hexagons on the floor, metro tiles and squares on the walls, a mosaic behind
the bath. Two large mirrors face each other across the vanity and show the room again and again,
round a bend, since one of them leans forward by a degree or two. It is modelled after nothing but
the numbers in Heirich and Arvo, *Scalable Photorealistic Rendering of Complex Scenes* (1996):
their bathroom had 18,012 objects and 4 light sources, and mirrors that face each other.

A *geometric object* is one `o` of `bathroom.obj`, a primitive shape such as a tile, a pebble or a
tap; a *light source* is one of `lights.obj`: two ceiling panels and two globes. Lengths are in
metres.

With the scene's `max_depth` of 8, a path sees at most six mirrors in a row before it must find a
lit surface; what lies deeper is dark. Raise it to look further.",
    source: "
Made by `equilux scene generate bathroom` (the program is in `generator/`); it is our own work and
part of Equilux: MIT OR Apache-2.0.",
};

/// One bay of the hall.
#[derive(Clone, Copy, Debug)]
struct Bay {
    /// Where it stands in the row.
    index: u64,
    /// The corner on the floor with the least coordinates.
    corner: Frame,
    is_first: bool,
    is_last: bool,
}

/// Makes a bathroom of `size` bays.
pub(crate) fn build(size: u32) -> Files {
    let mut stage = Stage::new(ABOUT);
    let bays = u64::from(size);
    for index in 0..bays {
        let corner = Frame::at(BAY_LENGTH * index as f64, 0.0, 0.0);
        furnish(
            &mut stage,
            &Bay { index, corner, is_first: index == 0, is_last: index + 1 == bays },
        );
    }
    let files = stage.into_files(&View {
        eye: vector(1.0, 1.5, 3.02),
        target: vector(2.55, 1.28, 0.3),
        vfov: 58.0,
        size: (640, 480),
        filter: "tent",
    });
    let counts = files.counts();
    assert!(size > 1 || counts.objects == BATHROOM_OBJECTS, "{} objects", counts.objects);
    assert_eq!(counts.lights, bays * BATHROOM_LIGHTS, "a bay has four lights");
    files
}

fn furnish(stage: &mut Stage, bay: &Bay) {
    walls::shell(stage, bay);
    walls::floor(stage, bay);
    mirror::pair(stage, bay);
    lights::four(stage, bay);
    basin::vanity(stage, bay);
    bath::bath(stage, bay);
    plumbing::toilet(stage, bay);
    accessories::things(stage, bay);
    // The bed of the bath takes as many pebbles as are missing.
    let wanted = (bay.index + 1) * BATHROOM_OBJECTS;
    bath::pebbles(stage, bay, wanted.saturating_sub(stage.object_count()));
}
