//! One side of a building: a wall with windows in real depth, as fine as asked for.
//!
//! Behind everything is a plane of glass (z = 0 of the facade's frame; x runs along the wall, y up,
//! z outward). Before it stands a grid of piers and of bands at the floors; what is left between
//! them are the openings.

use super::Detail;
use super::finish::Finish;
use super::mesh::{MOUNTED, Mesh, PANE, POST, RAIL, RING, SOLID, Span};
use super::style::Style;
use crate::frame::Frame;
use crate::random::Random;
use crate::vector::vector;

/// Height of a ground floor with shops.
pub(super) const SHOP_HEIGHT: f64 = 4.7;
/// What part of a band lies below its floor.
const BAND_BELOW: f64 = 0.35;
/// How far lights hang before what they shine from.
const LIGHT_GAP: f64 = 0.03;

/// A side of a building.
#[derive(Clone, Debug)]
pub(super) struct Facade<'a> {
    /// At the lower left corner of the glass, seen from outside.
    pub(super) at: Frame,
    pub(super) width: f64,
    pub(super) height: f64,
    pub(super) style: &'a Style,
    pub(super) detail: Detail,
    /// Whether its lowest floor is one of shops.
    pub(super) has_shops: bool,
    /// For what differs from window to window.
    pub(super) random: Random,
    /// For which of them are lit.
    pub(super) lights: Random,
}

impl Facade<'_> {
    /// Builds all of it.
    pub(super) fn build(mut self, mesh: &mut Mesh) {
        if self.detail >= Detail::Grid {
            self.grid(mesh);
        }
        if self.has_shops {
            self.shops(mesh);
        }
        for floor in 0..self.floors() {
            for bay in 0..self.bays() {
                self.window(mesh, self.bay(bay), self.opening(floor));
            }
        }
    }

    /// Floors above the shops.
    pub(super) fn floors(&self) -> u32 {
        (((self.height - self.base()) / self.style.floor) as u32).max(1)
    }

    /// Where a floor's band lies; that above the highest floor is the last.
    pub(super) fn band(&self, floor: u32) -> Span {
        let level = self.level(floor);
        let below = level - BAND_BELOW * self.style.band;
        let above = level + (1.0 - BAND_BELOW) * self.style.band;
        (below.max(0.0), above.min(self.height))
    }

    fn base(&self) -> f64 {
        if self.has_shops { SHOP_HEIGHT } else { 0.0 }
    }

    fn level(&self, floor: u32) -> f64 {
        let part = f64::from(floor) / f64::from(self.floors());
        self.base() + (self.height - self.base()) * part
    }

    fn bays(&self) -> u32 {
        ((self.width / self.style.bay).round() as u32).max(1)
    }

    fn bay_width(&self) -> f64 {
        self.width / f64::from(self.bays())
    }

    /// Between two piers.
    fn bay(&self, bay: u32) -> Span {
        let (width, half) = (self.bay_width(), self.style.pier / 2.0);
        (f64::from(bay) * width + half, f64::from(bay + 1) * width - half)
    }

    /// Between two bands.
    fn opening(&self, floor: u32) -> Span {
        (self.band(floor).1, self.band(floor + 1).0)
    }

    /// Piers and bands.
    fn grid(&self, mesh: &mut Mesh) {
        let Style { wall, pier, depth, .. } = *self.style;
        let (width, last) = (self.bay_width(), self.bays());
        for index in 0..=last {
            let middle = f64::from(index) * width;
            let left = if index == 0 { -depth } else { middle - pier / 2.0 };
            let right = if index == last { middle + depth } else { middle + pier / 2.0 };
            mesh.block(wall, &self.at, [(left, right), (0.0, self.height), (0.0, depth)], POST);
        }
        let along = (-depth * 0.9, self.width + depth * 0.9);
        let first = u32::from(!self.has_shops);
        for floor in first..=self.floors() {
            mesh.block(wall, &self.at, [along, self.band(floor), (0.0, depth * 0.88)], RAIL);
        }
        if self.detail >= Detail::Windows {
            self.cornice(mesh);
        }
    }

    /// A ledge along the top, on brackets where it is to be fine.
    fn cornice(&self, mesh: &mut Mesh) {
        let Style { trim, depth, is_curtain, .. } = *self.style;
        if is_curtain {
            return;
        }
        let (top, out) = (self.height, depth + 0.42);
        let along = (-out, self.width + out);
        mesh.block(trim, &self.at, [along, (top - 0.3, top + 0.08), (0.0, out)], MOUNTED);
        let step = if self.detail == Detail::Fine { 0.5 } else { 1.6 };
        let count = (self.width / step) as u32;
        for index in 0..count {
            let x = self.width * (f64::from(index) + 0.5) / f64::from(count);
            let spans = [(x - 0.11, x + 0.11), (top - 0.75, top - 0.3), (0.0, out - 0.1)];
            mesh.block(trim, &self.at, spans, MOUNTED);
        }
    }

    /// The ground floor: a fascia with signs, a plinth, awnings.
    fn shops(&mut self, mesh: &mut Mesh) {
        let Style { trim, depth, frame, .. } = *self.style;
        if self.detail < Detail::Grid {
            return;
        }
        let fascia = [(-depth, self.width + depth), (3.75, 4.45), (0.0, depth + 0.12)];
        mesh.block(trim, &self.at, fascia, MOUNTED);
        mesh.block(trim, &self.at, [fascia[0], (0.0, 0.45), (0.0, depth + 0.06)], MOUNTED);
        let shops = (self.bays() / 2).max(1);
        for shop in 0..shops {
            let width = self.width / f64::from(shops);
            let span = (f64::from(shop) * width + 0.5, f64::from(shop + 1) * width - 0.5);
            self.shop(mesh, span);
            if self.detail >= Detail::Windows {
                mullions(mesh, &self.at, frame, (span, (0.45, 3.75)));
            }
        }
    }

    fn shop(&mut self, mesh: &mut Mesh, along: Span) {
        let (is_sign, is_awning) = (self.random.happens(0.35), self.random.happens(0.5));
        let (unit, tint) = (self.lights.unit(), self.lights.unit());
        let depth = self.style.depth;
        if mesh.window(unit * 0.4) {
            let finish = if tint < 0.75 { Finish::WarmWindow } else { Finish::PaleWindow };
            mesh.block(finish, &self.at, [along, (0.5, 3.6), (LIGHT_GAP, LIGHT_GAP)], PANE);
        }
        if is_sign && mesh.window(tint) {
            let finish = if unit < 0.2 { Finish::RedSign } else { Finish::BlueSign };
            let front = depth + 0.12 + LIGHT_GAP;
            let spans = [(along.0 + 0.6, along.1 - 0.6), (3.9, 4.3), (front, front)];
            mesh.block(finish, &self.at, spans, PANE);
        }
        if is_awning && self.detail >= Detail::Windows {
            let finishes = [Finish::RedPaint, Finish::Blind, Finish::Copper, Finish::BluePaint];
            awning(mesh, &self.at, *self.random.pick(&finishes), (along, depth));
        }
    }

    fn window(&mut self, mesh: &mut Mesh, along: Span, up: Span) {
        let (unit, tint) = (self.lights.unit(), self.lights.unit());
        if mesh.window(unit) {
            let finish = if tint < 0.8 { Finish::WarmWindow } else { Finish::PaleWindow };
            // Without a grid there is a wall where the glass would be.
            let gap = match self.detail {
                Detail::Massing => self.style.depth + LIGHT_GAP,
                _ => LIGHT_GAP,
            };
            mesh.block(finish, &self.at, [along, up, (gap, gap)], PANE);
        }
        if self.detail >= Detail::Windows {
            self.fittings(mesh, along, up);
        }
        if self.detail == Detail::Fine {
            self.fine_fittings(mesh, along, up);
        }
    }

    /// Sill, bars, blind, and here and there a box that cools.
    fn fittings(&mut self, mesh: &mut Mesh, along: Span, up: Span) {
        let Style { frame, trim, depth, is_curtain, .. } = *self.style;
        mullions(mesh, &self.at, frame, (along, up));
        let (has_blind, drop) = (self.random.happens(0.5), self.random.unit());
        if has_blind {
            let lowest = up.1 - (up.1 - up.0) * (0.15 + 0.8 * drop * drop);
            let spans = [along, (lowest, up.1), (0.012, 0.012)];
            mesh.block(Finish::Blind, &self.at, spans, PANE);
        }
        if is_curtain {
            return;
        }
        let sill = [(along.0 - 0.1, along.1 + 0.1), (up.0 - 0.12, up.0), (0.0, depth + 0.08)];
        mesh.block(trim, &self.at, sill, MOUNTED);
        let head = [(along.0 - 0.12, along.1 + 0.12), (up.1, up.1 + 0.2), (0.0, depth + 0.03)];
        mesh.block(trim, &self.at, head, MOUNTED);
        if self.random.happens(0.07) {
            let x = along.0 + 0.3;
            let spans = [(x, x + 0.65), (up.0, up.0 + 0.42), (-0.02, depth + 0.3)];
            mesh.block(Finish::Steel, &self.at, spans, MOUNTED);
        }
    }

    /// What only a near look or a large city shows.
    fn fine_fittings(&mut self, mesh: &mut Mesh, along: Span, up: Span) {
        let Style { frame, wall, depth, balconies, is_curtain, .. } = *self.style;
        casement(mesh, &self.at, frame, (along, up));
        let (has_balcony, has_curtain) = (self.random.happens(balconies), self.random.happens(0.4));
        if has_curtain {
            curtain(mesh, &self.at, (along, up));
        }
        if is_curtain {
            fins(mesh, &self.at, frame, (along, up, depth));
            return;
        }
        courses(mesh, &self.at, wall, ((along.1, along.1 + self.style.pier), up, depth));
        if has_balcony {
            balcony(mesh, &self.at, self.style, (along, up.0));
        }
    }
}

/// An upright and a level bar across an opening.
fn mullions(mesh: &mut Mesh, at: &Frame, frame: Finish, (along, up): (Span, Span)) {
    let x = (along.0 + along.1) / 2.0;
    mesh.block(frame, at, [(x - 0.035, x + 0.035), up, (0.0, 0.07)], POST);
    let y = up.0 + 0.68 * (up.1 - up.0);
    mesh.block(frame, at, [along, (y - 0.03, y + 0.03), (0.0, 0.06)], RAIL);
}

/// The frame around an opening, and thin bars within.
fn casement(mesh: &mut Mesh, at: &Frame, frame: Finish, (along, up): (Span, Span)) {
    for x in [along.0, along.1 - 0.06] {
        mesh.block(frame, at, [(x, x + 0.06), up, (0.0, 0.09)], POST);
    }
    for y in [up.0, up.1 - 0.06] {
        mesh.block(frame, at, [along, (y, y + 0.06), (0.0, 0.09)], RAIL);
    }
    for part in [0.23, 0.45, 0.84] {
        let y = up.0 + part * (up.1 - up.0);
        mesh.block(frame, at, [along, (y - 0.012, y + 0.012), (0.0, 0.04)], RAIL);
    }
    for part in [0.25, 0.75] {
        let x = along.0 + part * (along.1 - along.0);
        mesh.block(frame, at, [(x - 0.012, x + 0.012), up, (0.0, 0.04)], POST);
    }
}

/// Two curtains in folds, drawn to the sides.
fn curtain(mesh: &mut Mesh, at: &Frame, (along, up): (Span, Span)) {
    const FOLDS: usize = 6;
    let width = 0.28 * (along.1 - along.0);
    for start in [along.0, along.1 - width] {
        let point = |i: usize| {
            let part = (i / 2) as f64 / FOLDS as f64;
            let y = if i.is_multiple_of(2) { up.0 } else { up.1 };
            at.point(vector(
                start + width * part,
                y,
                if (i / 2).is_multiple_of(2) { 0.02 } else { 0.05 },
            ))
        };
        let quad = |fold: usize| [2 * fold, 2 * fold + 2, 2 * fold + 3, 2 * fold + 1];
        let quads: [_; FOLDS] = std::array::from_fn(|fold| quad(fold).map(|i| i as u8));
        mesh.put(Finish::Blind, 2 * FOLDS + 2, point, &quads);
    }
}

/// Blades that shade a curtain wall.
fn fins(mesh: &mut Mesh, at: &Frame, frame: Finish, (along, up, depth): (Span, Span, f64)) {
    for step in 0..5 {
        let y = up.1 - 0.12 * f64::from(step);
        mesh.block(frame, at, [along, (y - 0.03, y), (depth - 0.02, depth + 0.22)], SOLID);
    }
}

/// Bricks or ashlars on the pier beside an opening.
fn courses(mesh: &mut Mesh, at: &Frame, wall: Finish, (along, up, depth): (Span, Span, f64)) {
    const HEIGHT: f64 = 0.24;
    const JOINT: f64 = 0.025;
    let count = ((up.1 - up.0) / HEIGHT) as u32;
    let middle = (along.0 + along.1) / 2.0;
    for course in 0..count {
        let y = up.0 + HEIGHT * f64::from(course);
        let split = middle + if course % 2 == 0 { 0.12 } else { -0.12 };
        for (x0, x1) in [(along.0, split - JOINT), (split, along.1)] {
            let spans = [(x0, x1), (y, y + HEIGHT - JOINT), (depth, depth + 0.02)];
            mesh.block(wall, at, spans, MOUNTED);
        }
    }
}

fn balcony(mesh: &mut Mesh, at: &Frame, style: &Style, (along, floor): (Span, f64)) {
    const REACH: f64 = 1.1;
    let (inner, outer) = (style.depth, style.depth + REACH);
    let wide = (along.0 - 0.25, along.1 + 0.25);
    mesh.block(style.trim, at, [wide, (floor - 0.16, floor), (inner, outer)], MOUNTED);
    let rail = (floor + 1.0, floor + 1.05);
    mesh.block(style.frame, at, [wide, rail, (outer - 0.08, outer - 0.03)], SOLID);
    for x in [wide.0 + 0.03, wide.1 - 0.08] {
        mesh.block(style.frame, at, [(x, x + 0.05), rail, (inner, outer - 0.03)], SOLID);
    }
    let count = ((wide.1 - wide.0) / 0.12) as u32;
    for index in 0..count {
        let x = wide.0 + 0.05 + 0.12 * f64::from(index);
        let bar = [(x, x + 0.018), (floor, rail.0), (outer - 0.066, outer - 0.048)];
        mesh.block(style.frame, at, bar, RING);
    }
}

/// A sloping cloth over a shop window, with its front hem.
fn awning(mesh: &mut Mesh, at: &Frame, finish: Finish, (along, depth): (Span, f64)) {
    let (inner, outer) = (depth + 0.13, depth + 1.5);
    let line = [(3.7, inner), (3.05, outer), (2.8, outer)];
    let point = |i: usize| {
        let (y, z) = line[i / 2];
        at.point(vector(if i.is_multiple_of(2) { along.0 } else { along.1 }, y, z))
    };
    mesh.put(finish, 6, point, &[[2, 3, 1, 0], [4, 5, 3, 2]]);
}
