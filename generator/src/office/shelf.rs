//! Bookcases at the end of the bay, and the books in them.

use super::palette::*;
use super::{BAY_LENGTH, Bay};
use crate::frame::Frame;
use crate::random::Random;
use crate::shape::Shape;
use crate::stage::Stage;
use crate::vector::vector;

const CASES: u64 = 4;
const WIDTH: f64 = 0.9;
const HEIGHT: f64 = 2.12;
const DEPTH: f64 = 0.3;
const BOARD: f64 = 0.022;
const SHELVES: u64 = 6;
/// From one shelf to the next.
const RISE: f64 = (HEIGHT - 0.08 - BOARD) / SHELVES as f64;

/// The bookcases of a bay, side by side against its end.
pub(super) fn row(stage: &mut Stage, bay: &Bay) {
    let wall = bay.corner.shifted(BAY_LENGTH - 0.005, 0.001, 0.0).turned(-90.0);
    for number in 0..CASES {
        let at = wall.shifted(0.55 + (WIDTH + 0.004) * number as f64, 0.0, DEPTH / 2.0);
        bookcase(stage, &at);
        for shelf in 0..SHELVES {
            let place = (bay.index * CASES + number) * SHELVES + shelf;
            let board = at.shifted(0.0, 0.08 + BOARD + 0.001 + RISE * shelf as f64, 0.0);
            fill(stage, &board, Random::new(0xB00C, place));
        }
    }
    on_top(stage, &wall.shifted(0.55, HEIGHT + 0.001, DEPTH / 2.0));
}

/// An empty bookcase on the floor, open towards +z.
fn bookcase(stage: &mut Stage, at: &Frame) {
    let inner = WIDTH - 2.0 * BOARD;
    for side in [-1.0, 1.0] {
        let cheek = Shape::cuboid(BOARD, HEIGHT, DEPTH);
        stage.put(
            "bookcase_side",
            &WALNUT,
            &at.shifted(side * (WIDTH - BOARD) / 2.0, 0.0, 0.0),
            cheek,
        );
    }
    let back = Shape::cuboid(inner - 0.002, HEIGHT - 0.002, 0.008);
    stage.put("bookcase_back", &WALNUT, &at.shifted(0.0, 0.001, -DEPTH / 2.0 + 0.006), back);
    let plinth = Shape::cuboid(inner - 0.002, 0.076, 0.018);
    stage.put("bookcase_plinth", &WALNUT, &at.shifted(0.0, 0.002, DEPTH / 2.0 - 0.03), plinth);
    for shelf in 0..=SHELVES {
        let board = Shape::cuboid(inner - 0.002, BOARD - 0.002, DEPTH - 0.016);
        let y = 0.08 + RISE * shelf as f64;
        stage.put("shelf", &WALNUT, &at.shifted(0.0, y, 0.005), board);
    }
}

/// Fills a shelf from the left with books, sometimes with something else; `at` is on its middle.
fn fill(stage: &mut Stage, at: &Frame, mut random: Random) {
    let right = WIDTH / 2.0 - BOARD - 0.004;
    let mut x = -right;
    let end = if random.happens(0.3) { right - random.between(0.12, 0.3) } else { right };
    while let Some(next) = run_of_books(stage, at, (x, end), &mut random) {
        x = next;
    }
    if right - x > 0.17 {
        ornament(stage, &at.shifted((x + right) / 2.0 + 0.02, 0.0, 0.03), &mut random);
    }
}

/// Some books of a kind, such as the volumes of a set; gives where the next may stand.
fn run_of_books(
    stage: &mut Stage,
    at: &Frame,
    (mut x, end): (f64, f64),
    random: &mut Random,
) -> Option<f64> {
    let count = if random.happens(0.35) { 2 + (random.unit() * 4.0) as u32 } else { 1 };
    let cover = random.pick(&BOOKS);
    let (thickness, height) = (random.between(0.016, 0.044), random.between(0.185, 0.285));
    let depth = random.between(0.15, 0.21);
    let (has_title, lettering) = (random.happens(0.45), random.pick(&TITLES));
    for _ in 0..count {
        if x + thickness > end {
            return None;
        }
        let back = random.between(0.0, 0.012);
        let book = Shape::cuboid(thickness - 0.0012, height, depth);
        let place = at.shifted(x + thickness / 2.0, 0.0, 0.12 - depth / 2.0 - back);
        stage.put("book", cover, &place, book);
        if has_title {
            let title = Shape::panel(thickness - 0.006, height * 0.22);
            let spine = place.shifted(0.0, height * 0.6, depth / 2.0 + 0.0012);
            stage.put("book_title", lettering, &spine, title);
        }
        x += thickness;
    }
    lean(stage, at, (x, end), random).or(Some(x))
}

/// Now and then a book leans against the one before it.
fn lean(stage: &mut Stage, at: &Frame, (x, end): (f64, f64), random: &mut Random) -> Option<f64> {
    let (thickness, height, degrees) = (0.022, 0.22, 11.0);
    // A leaning book takes its height's sine besides its thickness.
    let takes = 0.068;
    if x + takes > end || !random.happens(0.07) {
        return None;
    }
    let foot = at.shifted(x + takes - thickness / 2.0, 0.005, 0.03).rolled(degrees);
    stage.put("book", random.pick(&BOOKS), &foot, Shape::cuboid(thickness, height, 0.16));
    Some(x + takes + 0.006)
}

/// Something to look at between books.
fn ornament(stage: &mut Stage, at: &Frame, random: &mut Random) {
    let choice = (random.unit() * 3.0) as u32;
    match choice {
        0 => stage.put("vase", random.pick(&CERAMIC), at, vase()),
        1 => stage.put(
            "globe",
            random.pick(&PRINTS),
            &at.shifted(0.0, 0.061, 0.0),
            Shape::sphere(0.06, 18, 10),
        ),
        _ => stage.put(
            "ornament",
            &BRASS,
            &at.turned(30.0),
            Shape::tapered((0.09, 0.09), (0.012, 0.012), 0.15),
        ),
    }
}

/// A vase, closed at the top.
pub(super) fn vase() -> Shape {
    let profile = [
        (0.0, 0.0),
        (0.03, 0.0),
        (0.048, 0.03),
        (0.055, 0.07),
        (0.045, 0.115),
        (0.022, 0.15),
        (0.02, 0.175),
        (0.027, 0.19),
        (0.0, 0.19),
    ];
    Shape::lathe(&profile, 18)
}

/// Boxes and rolled plans on the bookcases.
fn on_top(stage: &mut Stage, at: &Frame) {
    for (x, width, height, turn) in
        [(0.1, 0.34, 0.22, 4.0), (0.5, 0.3, 0.16, -6.0), (2.3, 0.36, 0.26, 3.0)]
    {
        let place = at.shifted(x, 0.0, 0.0).turned(turn);
        stage.put("archive_box", &CORK, &place, Shape::cuboid(width, height, 0.25));
        let lid = Shape::cuboid(width + 0.008, 0.05, 0.258);
        stage.put("archive_lid", &NOTES[4], &place.shifted(0.0, height + 0.001, 0.0), lid);
    }
    for (number, y) in [0.026, 0.026, 0.072].into_iter().enumerate() {
        let z = [-0.03, 0.025, -0.002][number];
        let roll = Shape::bar(vector(1.1, y, z), vector(1.85, y, z), 0.025, 14);
        stage.put("rolled_plan", &PAPER, at, roll);
    }
}
