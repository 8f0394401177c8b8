//! How the buildings of a city differ: what they are made of, and the rhythm of their windows.

use super::finish::Finish;
use crate::random::Random;

/// The measures and finishes of a facade.
#[derive(Clone, Copy, Debug)]
pub(super) struct Style {
    pub(super) wall: Finish,
    pub(super) glass: Finish,
    /// Frames and bars of windows.
    pub(super) frame: Finish,
    /// Sills, cornices and the ground floor.
    pub(super) trim: Finish,
    /// About how wide a window is with its pier, and how high a floor is.
    pub(super) bay: f64,
    pub(super) floor: f64,
    /// Width of a pier between windows, and height of the wall between floors.
    pub(super) pier: f64,
    pub(super) band: f64,
    /// How far the wall stands out before the glass.
    pub(super) depth: f64,
    /// What part of the windows has a balcony.
    pub(super) balconies: f64,
    /// Whether it is of glass and metal rather than a wall with holes.
    pub(super) is_curtain: bool,
}

const BRICK: Style = Style {
    wall: Finish::RedBrick,
    glass: Finish::Glass,
    frame: Finish::WhiteFrame,
    trim: Finish::Limestone,
    bay: 3.1,
    floor: 3.4,
    pier: 1.3,
    band: 1.35,
    depth: 0.28,
    balconies: 0.0,
    is_curtain: false,
};

const CURTAIN: Style = Style {
    wall: Finish::Panel,
    glass: Finish::TintedGlass,
    frame: Finish::DarkFrame,
    trim: Finish::Panel,
    bay: 3.2,
    floor: 3.9,
    pier: 0.22,
    band: 0.95,
    depth: 0.16,
    balconies: 0.0,
    is_curtain: true,
};

const LOW: [Style; 10] = [
    BRICK,
    Style { wall: Finish::BrownBrick, frame: Finish::DarkFrame, trim: Finish::Trim, ..BRICK },
    Style { wall: Finish::PaleBrick, bay: 2.7, pier: 1.2, trim: Finish::Trim, ..BRICK },
    Style { wall: Finish::Limestone, trim: Finish::Limestone, bay: 3.4, depth: 0.36, ..BRICK },
    Style { wall: Finish::Plaster, frame: Finish::DarkFrame, balconies: 0.45, ..BRICK },
    Style {
        wall: Finish::Concrete,
        trim: Finish::Concrete,
        frame: Finish::DarkFrame,
        bay: 3.8,
        pier: 0.8,
        band: 1.2,
        balconies: 0.3,
        ..BRICK
    },
    Style { wall: Finish::BrownBrick, trim: Finish::Limestone, bay: 3.6, pier: 1.1, ..BRICK },
    Style { wall: Finish::DarkFrame, glass: Finish::Glass, bay: 3.4, ..CURTAIN },
    Style { wall: Finish::PaleBrick, frame: Finish::DarkFrame, balconies: 0.25, ..BRICK },
    Style { wall: Finish::WhiteFrame, frame: Finish::DarkFrame, pier: 0.7, band: 1.0, ..BRICK },
];

const HIGH: [Style; 7] = [
    CURTAIN,
    Style { wall: Finish::DarkFrame, trim: Finish::DarkFrame, bay: 2.9, ..CURTAIN },
    Style { wall: Finish::WhiteFrame, pier: 0.5, band: 0.7, depth: 0.35, ..CURTAIN },
    Style { wall: Finish::Limestone, pier: 1.3, band: 1.1, depth: 0.45, floor: 3.7, ..BRICK },
    Style { wall: Finish::Concrete, trim: Finish::Concrete, pier: 1.0, depth: 0.5, ..BRICK },
    Style { wall: Finish::BrownBrick, pier: 1.3, depth: 0.4, ..BRICK },
    Style { glass: Finish::Glass, wall: Finish::Panel, pier: 0.3, band: 1.4, ..CURTAIN },
];

/// The landmark's.
pub(super) const LANDMARK: Style = Style {
    wall: Finish::Limestone,
    trim: Finish::Limestone,
    pier: 1.2,
    band: 1.0,
    depth: 0.5,
    floor: 3.8,
    ..BRICK
};

impl Style {
    /// That of a building as high as this.
    pub(super) fn draw(random: &mut Random, height: f64) -> Self {
        *random.pick(if height > 62.0 { &HIGH[..] } else { &LOW[..] })
    }
}
