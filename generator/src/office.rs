//! The office: a room with windows on one side, four workplaces in the middle, shelves at the end.
//!
//! A larger office is a hall of several bays in a row along x; the camera stays in the first.

mod chair;
mod computer;
mod desk;
mod desk_lamp;
mod desktop;
mod green;
mod lounge;
mod luminaire;
mod palette;
mod room;
mod shelf;
mod wall;
mod window;

use crate::files::Files;
use crate::frame::Frame;
use crate::stage::{About, Stage, View};
use crate::vector::vector;
use crate::{OFFICE_LIGHTS, OFFICE_OBJECTS};

/// Length of a bay along x.
const BAY_LENGTH: f64 = 7.2;
/// From the wall with the windows (z = 0) to the one opposite.
const WIDTH: f64 = 5.4;
/// From the floor to the ceiling.
const HEIGHT: f64 = 2.8;

const ABOUT: About = About {
    name: "office",
    shows: "
An office for four towards evening: parquet, windows with venetian blinds and a pale sky behind
them, desks with drawers, screens and keyboards, chairs on castors, shelves full of books, a pin
board, a clock, plants and paper. It is modelled after nothing but the numbers in Heirich and Arvo,
*Scalable Photorealistic Rendering of Complex Scenes* (1996): their office had 3,256 objects and 3
light sources.

A *geometric object* is one `o` of `office.obj`, a primitive shape such as a book, a key or a slat;
a *light source* is one of `lights.obj`: the sky behind the windows, the lamp hung over the desks,
and the bulb of the desk lamp. Lengths are in metres.",
    source: "
Made by `equilux scene generate office` (the program is in `generator/`); it is our own work and
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

/// Makes an office of `size` bays.
pub(crate) fn build(size: u32) -> Files {
    let mut stage = Stage::new(ABOUT);
    for index in 0..u64::from(size) {
        let corner = Frame::at(BAY_LENGTH * index as f64, 0.0, 0.0);
        let is_last = index + 1 == u64::from(size);
        furnish(&mut stage, &Bay { index, corner, is_first: index == 0, is_last });
    }
    let files = stage.into_files(&View {
        eye: vector(0.42, 1.62, 4.92),
        target: vector(4.35, 0.95, 2.25),
        vfov: 50.0,
        size: (640, 480),
        filter: "tent",
    });
    let (counts, bays) = (files.counts(), u64::from(size));
    assert_eq!(counts.objects, bays * OFFICE_OBJECTS, "a bay lacks objects or has too many");
    assert_eq!(counts.lights, bays * OFFICE_LIGHTS, "a bay has three lights");
    files
}

fn furnish(stage: &mut Stage, bay: &Bay) {
    room::shell(stage, bay);
    room::floor(stage, bay);
    room::ceiling(stage, bay);
    window::row(stage, bay);
    luminaire::hang(stage, bay);
    workplaces(stage, bay);
    shelf::row(stage, bay);
    wall::things(stage, bay);
    green::plants(stage, bay);
    lounge::corner(stage, bay);
    let wanted = (bay.index + 1) * OFFICE_OBJECTS;
    // What is still missing is paper, as in any office: 79 to 275 sheets in the bays of the
    // largest one, and a dozen fewer in a last bay, which has an end wall. The trays hold 480.
    desktop::copy_paper(stage, bay, wanted.saturating_sub(stage.object_count()));
}

/// Two pairs of desks, face to face.
fn workplaces(stage: &mut Stage, bay: &Bay) {
    let places = [(3.05, 2.42, 0.0), (4.72, 2.42, 0.0), (3.05, 1.58, 180.0), (4.72, 1.58, 180.0)];
    for (number, (x, z, turn)) in places.into_iter().enumerate() {
        let place = bay.index * 4 + number as u64;
        let at = bay.corner.shifted(x, room::CARPET_TOP, z).turned(turn);
        desk::desk(stage, &at);
        computer::computer(stage, &at, place);
        desktop::things(stage, &at, place);
        chair::at_desk(stage, &at, place);
    }
    let at = bay.corner.shifted(3.05, room::CARPET_TOP, 2.42);
    desk_lamp::desk_lamp(stage, &at.shifted(-0.62, desk::TOP, -0.12));
}
