//! What the office is made of. Reflectances and radiances are linear RGB.

use crate::material::Material;

type M = Material;

pub(super) const WALL: M = M::matte("wall", [0.76, 0.73, 0.67]);
pub(super) const ACCENT_WALL: M = M::matte("accent_wall", [0.17, 0.36, 0.37]);
pub(super) const CEILING: M = M::matte("ceiling", [0.8, 0.8, 0.78]);
pub(super) const SHADOW_GAP: M = M::matte("shadow_gap", [0.12, 0.12, 0.12]);
pub(super) const WHITE_PAINT: M = M::glossy("white_paint", [0.7, 0.7, 0.68], 0.04, 120.0);
pub(super) const PARQUET: [M; 5] = [
    M::glossy("parquet_1", [0.44, 0.26, 0.13], 0.12, 700.0),
    M::glossy("parquet_2", [0.49, 0.3, 0.155], 0.12, 700.0),
    M::glossy("parquet_3", [0.39, 0.22, 0.105], 0.12, 700.0),
    M::glossy("parquet_4", [0.54, 0.345, 0.19], 0.12, 700.0),
    M::glossy("parquet_5", [0.46, 0.275, 0.13], 0.12, 700.0),
];
pub(super) const CARPET: [M; 3] = [
    M::matte("carpet_1", [0.15, 0.19, 0.22]),
    M::matte("carpet_2", [0.19, 0.225, 0.245]),
    M::matte("carpet_3", [0.13, 0.2, 0.22]),
];
pub(super) const OAK: M = M::glossy("oak", [0.46, 0.3, 0.16], 0.04, 300.0);
pub(super) const WALNUT: M = M::glossy("walnut", [0.22, 0.115, 0.06], 0.05, 250.0);
pub(super) const WHITE_LACQUER: M = M::glossy("white_lacquer", [0.68, 0.68, 0.67], 0.05, 600.0);
pub(super) const STEEL: M = M::metal("steel", [0.56, 0.56, 0.55], 160.0);
pub(super) const CHROME: M = M::metal("chrome", [0.72, 0.73, 0.74], 1200.0);
pub(super) const BRASS: M = M::metal("brass", [0.72, 0.5, 0.2], 220.0);
pub(super) const BLACK_METAL: M = M::glossy("black_metal", [0.025, 0.025, 0.027], 0.06, 80.0);
pub(super) const BLACK_PLASTIC: M = M::glossy("black_plastic", [0.03, 0.03, 0.032], 0.04, 60.0);
pub(super) const GREY_PLASTIC: M = M::glossy("grey_plastic", [0.3, 0.3, 0.3], 0.04, 60.0);
pub(super) const KEY: M = M::glossy("key", [0.07, 0.07, 0.075], 0.03, 40.0);
pub(super) const KEY_ACCENT: M = M::glossy("key_accent", [0.55, 0.16, 0.05], 0.03, 40.0);
pub(super) const ALUMINIUM: M = M::metal("aluminium", [0.66, 0.66, 0.68], 60.0);
pub(super) const SCREEN: M = M::glossy("screen", [0.012, 0.016, 0.026], 0.05, 2000.0);
pub(super) const SCREEN_TEXT: [M; 5] = [
    M::matte("screen_text_1", [0.7, 0.72, 0.74]),
    M::matte("screen_text_2", [0.15, 0.5, 0.7]),
    M::matte("screen_text_3", [0.25, 0.62, 0.25]),
    M::matte("screen_text_4", [0.75, 0.5, 0.12]),
    M::matte("screen_text_5", [0.66, 0.2, 0.3]),
];
pub(super) const SLAT: M = M::glossy("slat", [0.68, 0.66, 0.6], 0.05, 80.0);
pub(super) const CORD: M = M::matte("cord", [0.6, 0.58, 0.52]);
pub(super) const RADIATOR: M = M::glossy("radiator", [0.64, 0.64, 0.62], 0.05, 150.0);
pub(super) const CHAIR_FABRIC: [M; 4] = [
    M::matte("fabric_rust", [0.42, 0.12, 0.045]),
    M::matte("fabric_teal", [0.045, 0.21, 0.22]),
    M::matte("fabric_mustard", [0.5, 0.3, 0.05]),
    M::matte("fabric_slate", [0.11, 0.13, 0.17]),
];
pub(super) const LEATHER: M = M::glossy("leather", [0.3, 0.13, 0.055], 0.05, 60.0);
pub(super) const CUSHION: M = M::matte("cushion", [0.6, 0.44, 0.14]);
pub(super) const RUG: M = M::matte("rug", [0.56, 0.51, 0.43]);
pub(super) const APPLES: [M; 2] = [
    M::glossy("apple_red", [0.5, 0.05, 0.035], 0.06, 300.0),
    M::glossy("apple_green", [0.36, 0.5, 0.07], 0.06, 300.0),
];
pub(super) const PAPER: M = M::matte("paper", [0.74, 0.73, 0.7]);
pub(super) const NOTES: [M; 5] = [
    M::matte("note_yellow", [0.77, 0.62, 0.12]),
    M::matte("note_pink", [0.74, 0.27, 0.36]),
    M::matte("note_green", [0.38, 0.64, 0.18]),
    M::matte("note_blue", [0.2, 0.48, 0.7]),
    M::matte("note_white", [0.74, 0.73, 0.7]),
];
pub(super) const CORK: M = M::matte("cork", [0.4, 0.23, 0.11]);
pub(super) const PINS: [M; 4] = [
    M::glossy("pin_red", [0.6, 0.04, 0.03], 0.06, 300.0),
    M::glossy("pin_blue", [0.04, 0.12, 0.5], 0.06, 300.0),
    M::glossy("pin_green", [0.05, 0.4, 0.09], 0.06, 300.0),
    M::glossy("pin_white", [0.66, 0.66, 0.66], 0.06, 300.0),
];
pub(super) const BOOKS: [M; 16] = [
    M::glossy("book_burgundy", [0.27, 0.03, 0.04], 0.03, 60.0),
    M::glossy("book_red", [0.5, 0.06, 0.04], 0.03, 60.0),
    M::glossy("book_orange", [0.62, 0.22, 0.04], 0.03, 60.0),
    M::glossy("book_ochre", [0.54, 0.34, 0.08], 0.03, 60.0),
    M::glossy("book_cream", [0.7, 0.62, 0.45], 0.03, 60.0),
    M::glossy("book_white", [0.72, 0.71, 0.68], 0.03, 60.0),
    M::glossy("book_olive", [0.2, 0.22, 0.06], 0.03, 60.0),
    M::glossy("book_green", [0.05, 0.22, 0.09], 0.03, 60.0),
    M::glossy("book_mint", [0.3, 0.54, 0.42], 0.03, 60.0),
    M::glossy("book_teal", [0.03, 0.24, 0.27], 0.03, 60.0),
    M::glossy("book_sky", [0.2, 0.42, 0.62], 0.03, 60.0),
    M::glossy("book_blue", [0.04, 0.11, 0.38], 0.03, 60.0),
    M::glossy("book_navy", [0.02, 0.035, 0.12], 0.03, 60.0),
    M::glossy("book_plum", [0.18, 0.05, 0.19], 0.03, 60.0),
    M::glossy("book_brown", [0.16, 0.08, 0.04], 0.03, 60.0),
    M::glossy("book_black", [0.03, 0.03, 0.03], 0.04, 60.0),
];
pub(super) const TITLES: [M; 3] = [
    M::matte("title_cream", [0.68, 0.6, 0.42]),
    M::matte("title_gold", [0.6, 0.42, 0.12]),
    M::matte("title_dark", [0.05, 0.05, 0.06]),
];
pub(super) const CERAMIC: [M; 4] = [
    M::glossy("ceramic_white", [0.72, 0.71, 0.69], 0.06, 900.0),
    M::glossy("ceramic_blue", [0.06, 0.2, 0.42], 0.06, 900.0),
    M::glossy("ceramic_red", [0.5, 0.07, 0.05], 0.06, 900.0),
    M::glossy("ceramic_green", [0.16, 0.36, 0.2], 0.06, 900.0),
];
pub(super) const TERRACOTTA: M = M::matte("terracotta", [0.48, 0.18, 0.085]);
pub(super) const SOIL: M = M::matte("soil", [0.06, 0.04, 0.028]);
pub(super) const LEAVES: [M; 3] = [
    M::glossy("leaf_1", [0.06, 0.24, 0.05], 0.05, 50.0),
    M::glossy("leaf_2", [0.09, 0.31, 0.07], 0.05, 50.0),
    M::glossy("leaf_3", [0.05, 0.18, 0.06], 0.05, 50.0),
];
pub(super) const STEM: M = M::matte("stem", [0.16, 0.17, 0.06]);
pub(super) const STONE: [M; 2] =
    [M::matte("stone_1", [0.42, 0.39, 0.35]), M::matte("stone_2", [0.26, 0.25, 0.24])];
pub(super) const PRINTS: [M; 5] = [
    M::matte("print_sand", [0.66, 0.54, 0.36]),
    M::matte("print_coral", [0.66, 0.22, 0.14]),
    M::matte("print_sea", [0.08, 0.28, 0.36]),
    M::matte("print_sun", [0.76, 0.52, 0.14]),
    M::matte("print_night", [0.04, 0.07, 0.16]),
];
/// The sky behind the windows, late in the afternoon.
pub(super) const SKY: M = M::light("sky", [2.0, 2.6, 3.3]);
pub(super) const TUBE: M = M::light("tube", [60.0, 52.0, 40.0]);
pub(super) const BULB: M = M::light("bulb", [105.0, 66.0, 30.0]);
