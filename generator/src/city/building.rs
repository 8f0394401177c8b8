//! A building: tiers of floors one on the other, each with four sides and a roof.

use super::Detail;
use super::facade::{Facade, SHOP_HEIGHT};
use super::finish::Finish;
use super::layout::{Cell, Rect};
use super::mesh::{Mesh, PANE, RING, STANDING};
use super::roof;
use super::style::{LANDMARK, Style};
use crate::frame::Frame;
use crate::random::Random;

/// Where the sidewalk is.
pub(super) const STREET_LEVEL: f64 = 0.15;
/// The frame of the world.
pub(super) const WORLD: Frame = Frame::at(0.0, 0.0, 0.0);
/// Quarters of a turn to the front, right, back and left of a building.
const SIDES: u32 = 4;
/// From the camera a building within this many metres may not be a tower.
const TOWERS_FROM: f64 = 250.0;
/// Buildings higher than this have no party walls.
const WINDOWS_ALL_AROUND_FROM: f64 = 26.0;

/// Where a building stands.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lot {
    pub(super) rect: Rect,
    /// Whether the front, right, back and left are free, and not against another building.
    pub(super) is_open: [bool; 4],
    /// Which one on its block.
    pub(super) number: u64,
}

/// Floors of one outline.
#[derive(Clone, Copy, Debug)]
struct Tier {
    rect: Rect,
    bottom: f64,
    top: f64,
}

/// Builds what stands on a lot.
pub(super) fn raise(mesh: &mut Mesh, cell: &Cell, lot: &Lot, detail: Detail) {
    let mut random = cell.random(0xB01D, lot.number);
    let height = height(cell, lot, &mut random);
    let style = Style::draw(&mut random, height);
    let tiers = tiers(lot.rect, height, &style, &mut random);
    // What rises above its neighbors has windows on all sides.
    let is_open = if height > WINDOWS_ALL_AROUND_FROM { [true; 4] } else { lot.is_open };
    stack(mesh, cell, (&Lot { is_open, ..*lot }, &style), &tiers, detail);
}

/// The tower across the avenue: it steps back four times and ends in a spire.
pub(super) fn raise_landmark(mesh: &mut Mesh, cell: &Cell, detail: Detail) {
    let rect = cell.block();
    let heights = [0.0, 38.0, 150.0, 205.0, 236.0];
    let tiers: Vec<Tier> = heights
        .windows(2)
        .zip([0.0, 3.5, 6.5, 9.5])
        .map(|(ends, inset)| Tier { rect: rect.inset(inset), bottom: ends[0], top: ends[1] })
        .collect();
    let lot = Lot { rect, is_open: [true; 4], number: 0 };
    stack(mesh, cell, (&lot, &LANDMARK), &tiers, detail);
    let (x, z) = rect.middle();
    let crown = Frame::at(x, 236.0, z);
    mesh.prism(Finish::Copper, &crown, (8, (7.5, 5.0), (0.0, 9.0)));
    mesh.prism(Finish::Copper, &crown, (8, (5.0, 1.1), (9.0, 30.0)));
    mesh.prism(Finish::Steel, &crown, (4, (0.7, 0.1), (30.0, 62.0)));
}

fn height(cell: &Cell, lot: &Lot, random: &mut Random) -> f64 {
    let central = cell.centrality();
    let (luck, low, high) = (random.unit(), random.between(9.0, 24.0), random.between(0.7, 1.2));
    let is_broad = lot.rect.width().min(lot.rect.depth()) > 24.0;
    let is_tower = is_broad && cell.distance > TOWERS_FROM && luck < 0.1 + 1.3 * central;
    let wanted =
        if is_tower { (55.0 + 190.0 * central) * high } else { low * (1.0 + 1.8 * central) };
    wanted.min(cell.height_max() * (0.75 + 0.25 * luck))
}

fn tiers(rect: Rect, height: f64, style: &Style, random: &mut Random) -> Vec<Tier> {
    let (part, has_penthouse) = (random.between(0.3, 0.6), random.happens(0.3));
    let tier = |inset: f64, bottom: f64, top: f64| Tier { rect: rect.inset(inset), bottom, top };
    if height > 62.0 && style.is_curtain {
        let podium = SHOP_HEIGHT + 3.0 * style.floor;
        vec![tier(0.0, 0.0, podium), tier(4.0, podium, height)]
    } else if height > 62.0 {
        let (low, high) = (height * part, height * (0.35 + 0.65 * part));
        vec![tier(0.0, 0.0, low), tier(2.6, low, high), tier(5.4, high, height)]
    } else if has_penthouse && height > 16.0 {
        vec![tier(0.0, 0.0, height - 3.6), tier(3.0, height - 3.6, height)]
    } else {
        vec![tier(0.0, 0.0, height)]
    }
}

fn stack(
    mesh: &mut Mesh,
    cell: &Cell,
    (lot, style): (&Lot, &Style),
    tiers: &[Tier],
    detail: Detail,
) {
    for (index, tier) in tiers.iter().enumerate() {
        let is_open = if index == 0 { lot.is_open } else { [true; 4] };
        let number = lot.number * 8 + index as u64;
        body(mesh, tier, style, detail);
        for side in 0..SIDES {
            let thing = number * 4 + u64::from(side);
            let mut facade = Facade {
                at: side_frame(&tier.rect.inset(style.depth), tier.bottom, side),
                width: side_width(&tier.rect, side) - 2.0 * style.depth,
                height: tier.top - tier.bottom,
                style,
                detail,
                has_shops: index == 0,
                random: cell.random(0xFACA, thing),
                lights: cell.random(0x1175, thing),
            };
            if is_open[side as usize] {
                facade.build(mesh);
            } else {
                facade.has_shops = false;
                party_wall(mesh, &facade);
            }
        }
        let above = tiers.get(index + 1).map(|next| next.rect);
        if detail >= Detail::Bands {
            let random = cell.random(0x200F, number);
            roof::build(mesh, (&tier.rect, above), (tier.top, style), detail, random);
        }
    }
}

/// What is within the walls; all there is of a tier at first.
fn body(mesh: &mut Mesh, tier: &Tier, style: &Style, detail: Detail) {
    let Tier { rect, bottom, top } = *tier;
    if detail == Detail::Massing {
        mesh.block(style.wall, &WORLD, [rect.x, (bottom, top), rect.z], STANDING);
        return;
    }
    let core = rect.inset(style.depth);
    mesh.block(style.glass, &WORLD, [core.x, (bottom, top), core.z], RING);
    if detail == Detail::Bands {
        bands(mesh, tier, style);
    }
}

/// A ring around every floor: from afar, that is a facade.
fn bands(mesh: &mut Mesh, tier: &Tier, style: &Style) {
    let rect = tier.rect.inset(style.depth * 0.5);
    let floors = (((tier.top - tier.bottom) / style.floor) as u32).max(1);
    let pitch = (tier.top - tier.bottom) / f64::from(floors);
    // Piers are left out, and make up for it by broader bands.
    let broad = if style.is_curtain { style.band } else { 0.58 * pitch };
    for floor in 0..floors {
        let y = tier.bottom + pitch * f64::from(floor + 1);
        mesh.block(style.wall, &WORLD, [rect.x, (y - broad, y), rect.z], RING);
    }
}

/// A wall without windows, against a neighbor that may be lower.
fn party_wall(mesh: &mut Mesh, facade: &Facade<'_>) {
    if facade.detail < Detail::Bands {
        return;
    }
    let (depth, wall) = (facade.style.depth, facade.style.wall);
    let wall = if facade.style.is_curtain { Finish::Concrete } else { wall };
    let spans = [(-depth, facade.width + depth), (0.0, facade.height), (depth, depth)];
    mesh.block(wall, &facade.at, spans, PANE);
}

/// The lower left corner of a side, seen from outside, with z outward.
pub(super) fn side_frame(rect: &Rect, y: f64, side: u32) -> Frame {
    let (x, z) = match side {
        0 => (rect.x.0, rect.z.1),
        1 => (rect.x.1, rect.z.1),
        2 => (rect.x.1, rect.z.0),
        _ => (rect.x.0, rect.z.0),
    };
    Frame::at(x, y, z).turned(90.0 * f64::from(side))
}

pub(super) fn side_width(rect: &Rect, side: u32) -> f64 {
    if side.is_multiple_of(2) { rect.width() } else { rect.depth() }
}
