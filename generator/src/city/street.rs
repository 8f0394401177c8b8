//! What is between the buildings: asphalt, kerbs, paving, lamps, trees, cars.
//!
//! A cell furnishes the four sides of its own block; everything there is placed in the frame of a
//! side: x along the kerb, z out over the street, y = 0 at the sidewalk.

use super::Detail;
use super::building::{STREET_LEVEL, WORLD, side_frame, side_width};
use super::car;
use super::finish::Finish;
use super::layout::{AVENUE, Cell, Kind, Rect, SIDEWALK, STREET};
use super::mesh::{CEILING, MOUNTED, Mesh, RING, SHEET, SOLID, STANDING};
use super::tree;
use crate::frame::Frame;
use crate::vector::vector;

/// Markings lie this high above the asphalt.
const PAINT_LIFT: f64 = 0.012;
/// Kerb stones.
const KERB: (f64, f64) = (1.2, 0.3);

/// Everything on the ground of a cell.
pub(super) fn pave(mesh: &mut Mesh, cell: &Cell, detail: Detail) {
    let block = cell.block();
    if cell.kind != Kind::Landmark {
        let ground = cell.ground();
        mesh.block(Finish::Asphalt, &WORLD, [ground.x, (0.0, 0.0), ground.z], SHEET);
    }
    let surface = if detail == Detail::Fine { STREET_LEVEL - 0.03 } else { STREET_LEVEL };
    mesh.block(Finish::Pavement, &WORLD, [block.x, (0.0, surface), block.z], STANDING);
    if detail < Detail::Bands || cell.kind == Kind::Landmark {
        return;
    }
    for side in 0..4 {
        let side = Side {
            at: side_frame(&block, STREET_LEVEL, side),
            width: side_width(&block, side),
            street: if faces_avenue(cell, side) { AVENUE } else { STREET },
            number: side,
            detail,
        };
        side.mark(mesh);
        if detail >= Detail::Grid || side.street > STREET {
            side.cars(mesh, cell);
        }
        side.trees(mesh, cell);
        if detail >= Detail::Grid {
            side.lamps(mesh, cell);
        }
        if detail >= Detail::Windows {
            side.kerb(mesh);
        }
        if detail == Detail::Fine {
            side.furniture(mesh, cell);
            side.paving(mesh);
        }
    }
}

/// A lawn with trees, in place of buildings.
pub(super) fn park(mesh: &mut Mesh, cell: &Cell, detail: Detail) {
    let Rect { x, z } = cell.block().inset(SIDEWALK);
    let lawn = [x, (STREET_LEVEL, STREET_LEVEL + 0.12), z];
    mesh.block(Finish::Lawn, &WORLD, lawn, STANDING);
    if detail < Detail::Bands {
        return;
    }
    let mut random = cell.random(0x9A2C, 0);
    for index in 0..44 {
        let (x, z) = (random.between(x.0 + 2.0, x.1 - 2.0), random.between(z.0 + 2.0, z.1 - 2.0));
        let at = Frame::at(x, STREET_LEVEL, z);
        tree::plant(mesh, &at, random.between(8.0, 14.0), detail, cell.random(0x9A2D, index));
    }
    if detail == Detail::Fine {
        grass(mesh, cell);
    }
}

/// Blades of grass all over a park.
fn grass(mesh: &mut Mesh, cell: &Cell) {
    const BLADES: u64 = 60_000;
    let Rect { x, z } = cell.block().inset(SIDEWALK + 0.2);
    let mut random = cell.random(0x62A5, 0);
    let bottom = STREET_LEVEL + 0.12;
    mesh.strew(Finish::Lawn, BLADES, || {
        let foot = vector(random.between(x.0, x.1), bottom, random.between(z.0, z.1));
        let (wide, lean) = (random.between(0.006, 0.014), random.between(-0.05, 0.05));
        let tip = foot + vector(lean, 0.11, lean);
        let (side, thin) = (vector(wide, 0.0, 0.0), vector(0.002, 0.0, 0.0));
        [foot - side, foot + side, tip + thin, tip - thin]
    });
}

fn faces_avenue(cell: &Cell, side: u32) -> bool {
    (cell.column == 0 && side == 3) || (cell.column == -1 && side == 1)
}

/// One side of a block, with half of the street before it.
struct Side {
    at: Frame,
    width: f64,
    /// From kerb to kerb.
    street: f64,
    number: u32,
    detail: Detail,
}

impl Side {
    /// A number for a thing of this side.
    fn thing(&self, index: u64) -> u64 {
        u64::from(self.number) * 512 + index
    }

    /// Lines on the asphalt, and crossings where a street begins.
    fn mark(&self, mesh: &mut Mesh) {
        let y = PAINT_LIFT - STREET_LEVEL;
        let mut paint = |x: (f64, f64), z: (f64, f64)| {
            mesh.block(Finish::Marking, &self.at, [x, (y, y), z], SHEET);
        };
        let half = self.street / 2.0;
        paint((0.0, self.width), (half - 0.25, half - 0.1));
        let lanes = (half / 3.4) as u32;
        for lane in 1..lanes {
            let z = half * f64::from(lane) / f64::from(lanes);
            for dash in 0..(self.width / 6.0) as u32 {
                let x = 6.0 * f64::from(dash) + 1.5;
                paint((x, x + 3.0), (z - 0.06, z + 0.06));
            }
        }
        for stripe in 0..(half / 0.9) as u32 {
            let z = 0.3 + 0.9 * f64::from(stripe);
            paint((-3.6, -0.8), (z, z + 0.45));
            paint((self.width + 0.8, self.width + 3.6), (z, z + 0.45));
        }
    }

    /// Cars along the kerb, and some on their way.
    fn cars(&self, mesh: &mut Mesh, cell: &Cell) {
        let mut random = cell.random(0xCA25, self.thing(0));
        let place = |x: f64, z: f64| self.at.shifted(x, -STREET_LEVEL, z);
        for index in 1..(self.width / 5.6) as u32 {
            let x = 5.6 * f64::from(index) + random.between(-0.4, 0.4);
            if random.happens(0.72) {
                car::park(mesh, &place(x, 1.25).turned(180.0), self.detail, &mut random);
            }
        }
        let lanes = if self.street > STREET { &[4.6, 7.9, 11.2, 14.2][..] } else { &[4.6][..] };
        for &z in lanes {
            let mut x = random.between(0.0, 26.0);
            while x < self.width {
                car::park(mesh, &place(x, z).turned(180.0), self.detail, &mut random);
                x += random.between(7.0, 38.0);
            }
        }
    }

    fn trees(&self, mesh: &mut Mesh, cell: &Cell) {
        let pitch = if self.street > STREET { 8.5 } else { 12.0 };
        let count = (self.width / pitch) as u32;
        for index in 0..count {
            let x = self.width * (f64::from(index) + 0.5) / f64::from(count);
            let random = cell.random(0x72EE, self.thing(u64::from(index)));
            tree::plant(mesh, &self.at.shifted(x, 0.0, -1.0), 8.6, self.detail, random);
        }
    }

    fn lamps(&self, mesh: &mut Mesh, cell: &Cell) {
        let reach = if self.street > STREET { 2.6 } else { 1.6 };
        for part in [0.03, 0.36, 0.68] {
            let at = self.at.shifted(self.width * part, 0.0, -0.5);
            mesh.prism(Finish::DarkFrame, &at, (6, (0.11, 0.06), (0.0, 8.2)));
            let arm = [(-0.05, 0.05), (8.1, 8.2), (0.0, reach)];
            mesh.block(Finish::DarkFrame, &at, arm, MOUNTED);
            let head = [(-0.16, 0.16), (8.04, 8.16), (reach - 0.7, reach)];
            mesh.block(Finish::DarkFrame, &at, head, STANDING);
            // They burn where they can be seen; each is a light that every machine must hold.
            let burns = cell.distance < LAMPS_WITHIN;
            let lens = if burns { Finish::Lamp } else { Finish::Glass };
            let spans = [(-0.12, 0.12), (8.04, 8.04), (reach - 0.65, reach - 0.05)];
            mesh.block(lens, &at, spans, CEILING);
        }
    }

    fn kerb(&self, mesh: &mut Mesh) {
        let count = (self.width / KERB.0) as u32;
        let length = self.width / f64::from(count);
        for index in 0..count {
            let x = length * f64::from(index);
            let spans = [(x, x + length - 0.015), (-STREET_LEVEL, 0.012), (-KERB.1, 0.02)];
            mesh.block(Finish::Kerb, &self.at, spans, STANDING);
        }
    }

    /// Benches, bollards and bins.
    fn furniture(&self, mesh: &mut Mesh, cell: &Cell) {
        let mut random = cell.random(0xF02A, self.thing(0));
        for index in 0..(self.width / 2.0) as u32 {
            let at = self.at.shifted(2.0 * f64::from(index) + 1.0, 0.0, -0.55);
            match (random.unit() * 10.0) as u32 {
                0 => bench(mesh, &at.shifted(0.0, 0.0, -1.2)),
                1 => mesh.prism(Finish::Copper, &at, (12, (0.28, 0.32), (0.0, 0.95))),
                _ => mesh.prism(Finish::DarkFrame, &at, (8, (0.07, 0.055), (0.0, 0.85))),
            }
        }
    }

    /// Slabs with joints, laid to the buildings.
    fn paving(&self, mesh: &mut Mesh) {
        const SLAB: f64 = 0.6;
        const JOINT: f64 = 0.012;
        let is_long = self.number.is_multiple_of(2);
        let (start, end) =
            if is_long { (0.0, self.width) } else { (SIDEWALK, self.width - SIDEWALK) };
        let (columns, rows) = ((end - start) / SLAB, (SIDEWALK - KERB.1) / SLAB);
        for row in 0..rows as u32 {
            for column in 0..columns as u32 {
                let (x, z) = (start + SLAB * f64::from(column), -KERB.1 - SLAB * f64::from(row));
                let spans = [(x, x + SLAB - JOINT), (-0.03, 0.0), (z - SLAB + JOINT, z)];
                mesh.block(Finish::Pavement, &self.at, spans, STANDING);
            }
        }
    }
}

/// How far lamps burn.
const LAMPS_WITHIN: f64 = 1800.0;

fn bench(mesh: &mut Mesh, at: &Frame) {
    for slat in 0..5 {
        let z = 0.1 * f64::from(slat);
        mesh.block(Finish::Wood, at, [(-0.8, 0.8), (0.42, 0.46), (z, z + 0.08)], SOLID);
        let y = 0.5 + z;
        mesh.block(Finish::Wood, at, [(-0.8, 0.8), (y, y + 0.08), (-0.06, -0.02)], SOLID);
    }
    for x in [-0.65, 0.6] {
        mesh.block(Finish::DarkFrame, at, [(x, x + 0.05), (0.0, 0.42), (0.0, 0.48)], RING);
    }
}
