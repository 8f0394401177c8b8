//! What is on the roofs: parapets, stair houses, machines, water tanks.

use super::Detail;
use super::building::{WORLD, side_frame, side_width};
use super::finish::Finish;
use super::layout::Rect;
use super::mesh::{BAR, Mesh, RIDGE, RING, SHEET, SOLID, STANDING};
use super::style::Style;
use super::tree;
use crate::frame::Frame;
use crate::random::Random;
use crate::vector::vector;

const PARAPET: f64 = 0.95;
/// Roofs lower than this may have a garden, and higher than that are those of towers.
const GARDENS_BELOW: f64 = 45.0;
const TOWERS_ABOVE: f64 = 62.0;

/// Roofs a tier over `rect`; where there is a next tier, it stands on the rectangle above.
pub(super) fn build(
    mesh: &mut Mesh,
    (rect, above): (&Rect, Option<Rect>),
    (top, style): (f64, &Style),
    detail: Detail,
    mut random: Random,
) {
    let is_pale = random.happens(0.35);
    let finish = if is_pale { Finish::PaleRoof } else { Finish::Roof };
    let lift = if detail == Detail::Bands { 0.05 } else { 0.0 };
    mesh.block(finish, &WORLD, [rect.x, (top + lift, top + lift), rect.z], SHEET);
    if detail >= Detail::Grid {
        parapet(mesh, rect, top, style);
    }
    if above.is_none() {
        let free = rect.inset(1.6);
        if free.width() > 5.0 && free.depth() > 5.0 {
            let free = Free { rect: free, top };
            free.furnish(mesh, detail, style, &mut random);
        }
    }
}

fn parapet(mesh: &mut Mesh, rect: &Rect, top: f64, style: &Style) {
    for side in 0..4 {
        let at = side_frame(rect, top, side);
        let along = (0.0, side_width(rect, side));
        mesh.block(style.wall, &at, [along, (0.0, PARAPET), (-0.3, 0.0)], RIDGE);
    }
}

/// A roof with room on it.
struct Free {
    rect: Rect,
    top: f64,
}

impl Free {
    fn furnish(&self, mesh: &mut Mesh, detail: Detail, style: &Style, random: &mut Random) {
        self.house(mesh, style, random);
        let has_garden = random.happens(0.3) && self.top < GARDENS_BELOW;
        if detail < Detail::Grid {
            return;
        }
        if has_garden {
            self.garden(mesh, detail, random);
        }
        for _ in 0..4 {
            let (x, z) = (random.unit(), random.unit());
            self.machine(mesh, &self.at(x * 0.85, z * 0.85), detail, random.between(0.8, 1.5));
        }
        let has_tank = random.happens(0.4) && self.top > 14.0;
        let (x, z) = (random.between(0.15, 0.85), random.between(0.15, 0.85));
        if has_tank {
            tank(mesh, &self.at(x, z), detail);
        }
        if detail >= Detail::Windows {
            self.ducts(mesh, random);
            self.skylights(mesh, random);
            let (x, z) = (random.unit(), random.unit());
            antenna(mesh, &self.at(x, z), random.between(3.0, 9.0));
        }
        if detail == Detail::Fine {
            self.cells(mesh, random);
        }
    }

    /// A house for stairs; on towers one for machines, and on some of them a mast.
    fn house(&self, mesh: &mut Mesh, style: &Style, random: &mut Random) {
        let (x, z) = (random.between(0.15, 0.5), random.between(0.15, 0.5));
        let (width, depth) = (random.between(0.2, 0.45), random.between(0.2, 0.45));
        let (has_mast, length) = (random.happens(0.3), random.between(14.0, 38.0));
        let at = self.at(x, z);
        let (width, depth) = (width * self.rect.width(), depth * self.rect.depth());
        let height = if self.top > TOWERS_ABOVE { 6.5 } else { 3.0 };
        let spans = [(0.0, width), (0.0, height), (0.0, depth)];
        mesh.block(style.wall, &at, spans, STANDING);
        if has_mast && self.top > TOWERS_ABOVE {
            let foot = at.shifted(width / 2.0, height, depth / 2.0);
            mesh.prism(Finish::Steel, &foot, (4, (0.6, 0.12), (0.0, length)));
        }
    }

    /// A lawn with small trees, on a part of the roof.
    fn garden(&self, mesh: &mut Mesh, detail: Detail, random: &mut Random) {
        let corner = self.at(0.55, 0.5);
        let (width, depth) = (0.42 * self.rect.width(), 0.46 * self.rect.depth());
        mesh.block(Finish::Wood, &corner, [(0.0, width), (0.0, 0.25), (0.0, depth)], STANDING);
        let lawn = [(0.3, width - 0.3), (0.25, 0.35), (0.3, depth - 0.3)];
        mesh.block(Finish::Lawn, &corner, lawn, STANDING);
        for _ in 0..7 {
            let (x, z) = (random.between(0.08, 0.92) * width, random.between(0.08, 0.92) * depth);
            let at = corner.shifted(x, 0.35, z);
            tree::plant(mesh, &at, random.between(2.2, 3.8), detail, random.clone());
        }
    }

    /// A place on the roof, in parts of its width and depth.
    fn at(&self, x: f64, z: f64) -> Frame {
        let Rect { x: (x0, x1), z: (z0, z1) } = self.rect;
        Frame::at(x0 + (x1 - x0) * x, self.top, z0 + (z1 - z0) * z)
    }

    /// A box that cools, with fans on it where it is to be fine.
    fn machine(&self, mesh: &mut Mesh, at: &Frame, detail: Detail, size: f64) {
        let at = at.shifted(0.0, 0.3, 0.0);
        let spans = [(-size, size), (0.0, size), (-0.6 * size, 0.6 * size)];
        mesh.block(Finish::Steel, &at, spans, SOLID);
        if detail < Detail::Windows {
            return;
        }
        for x in [-0.5, 0.5] {
            let fan = at.shifted(x * size, size, 0.0);
            mesh.prism(Finish::DarkFrame, &fan, (12, (0.42 * size, 0.42 * size), (0.0, 0.12)));
        }
        if detail == Detail::Fine {
            for louver in 0..8 {
                let y = size * (0.1 + 0.1 * f64::from(louver));
                let spans = [(-0.9 * size, 0.9 * size), (y, y + 0.03), (0.0, 0.6 * size + 0.03)];
                mesh.block(Finish::DarkFrame, &at, spans, BAR);
            }
        }
    }

    /// Ducts across the roof.
    fn ducts(&self, mesh: &mut Mesh, random: &mut Random) {
        for _ in 0..2 {
            let at = self.at(0.0, random.between(0.1, 0.9));
            let length = self.rect.width() * random.between(0.4, 0.95);
            mesh.block(Finish::Steel, &at, [(0.0, length), (0.35, 0.85), (0.0, 0.6)], SOLID);
            for foot in 0..(length / 2.5) as u32 {
                let x = 0.5 + 2.5 * f64::from(foot);
                mesh.block(Finish::DarkFrame, &at, [(x, x + 0.1), (0.0, 0.35), (0.05, 0.55)], RING);
            }
        }
    }

    /// A row of hipped windows in the roof.
    fn skylights(&self, mesh: &mut Mesh, random: &mut Random) {
        let (start, z) = (random.between(0.05, 0.4), random.between(0.1, 0.85));
        for index in 0..4 {
            let at = self.at(start, z).shifted(2.6 * f64::from(index), 0.0, 0.0);
            let curb = [(-0.95, 0.95), (0.0, 0.35), (-0.7, 0.7)];
            mesh.block(Finish::WhiteFrame, &at, curb, STANDING);
            let (eaves, ridge) = ([(-0.9, 0.9), (-0.65, 0.65)], [(-0.5, 0.5), (-0.03, 0.03)]);
            mesh.tapered(Finish::Glass, &at, (eaves, ridge, (0.35, 0.8)), STANDING);
        }
    }

    /// Rows of solar cells on stands, on a part of the roof.
    fn cells(&self, mesh: &mut Mesh, random: &mut Random) {
        let start = random.between(0.3, 0.7);
        let rows = ((1.0 - start) * self.rect.depth() / 1.9) as u32;
        for row in 0..rows {
            let at = self.at(0.05, start).shifted(0.0, 0.5, 1.9 * f64::from(row)).tilted(25.0);
            for column in 0..(self.rect.width() * 0.8 / 1.1) as u32 {
                let x = 1.1 * f64::from(column);
                let spans = [(x, x + 1.0), (0.0, 0.04), (-0.8, 0.8)];
                mesh.block(Finish::BluePaint, &at, spans, SOLID);
            }
        }
    }
}

/// A water tank of wood on legs.
fn tank(mesh: &mut Mesh, at: &Frame, detail: Detail) {
    let sides = if detail == Detail::Grid { 8 } else { 16 };
    for (x, z) in [(-1.1, -1.1), (1.1, -1.1), (1.1, 1.1), (-1.1, 1.1)] {
        let leg = [(x - 0.12, x + 0.12), (0.0, 3.2), (z - 0.12, z + 0.12)];
        mesh.block(Finish::DarkFrame, at, leg, RING);
    }
    mesh.block(Finish::DarkFrame, at, [(-1.6, 1.6), (3.0, 3.2), (-1.6, 1.6)], SOLID);
    mesh.prism(Finish::Wood, at, (sides, (1.75, 1.65), (3.2, 6.6)));
    mesh.prism(Finish::Roof, at, (sides, (1.85, 0.1), (6.6, 7.7)));
    if detail == Detail::Fine {
        for hoop in 0..7 {
            let y = 3.4 + 0.45 * f64::from(hoop);
            mesh.prism(Finish::DarkFrame, at, (16, (1.78, 1.78), (y, y + 0.05)));
        }
    }
}

fn antenna(mesh: &mut Mesh, at: &Frame, height: f64) {
    let point = |x: f64, y: f64| at.point(vector(x, y, 0.0));
    mesh.rod(Finish::Steel, (point(0.0, 0.0), point(0.0, height)), (0.06, 0.03));
    for step in 1..4 {
        let y = height * (1.0 - 0.12 * f64::from(step));
        mesh.rod(Finish::Steel, (point(-0.7, y), point(0.7, y)), (0.02, 0.02));
    }
}
