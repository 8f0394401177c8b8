//! What the bathroom is made of. Reflectances and radiances are linear RGB.

use crate::material::Material;

type M = Material;

pub(super) const GROUT: M = M::matte("grout", [0.5, 0.48, 0.45]);
pub(super) const DARK_GROUT: M = M::matte("dark_grout", [0.16, 0.17, 0.17]);
pub(super) const CEILING: M = M::matte("ceiling", [0.78, 0.77, 0.75]);
pub(super) const WHITE_TILES: [M; 3] = [
    M::glossy("white_tile_1", [0.74, 0.73, 0.7], 0.06, 3000.0),
    M::glossy("white_tile_2", [0.71, 0.705, 0.685], 0.06, 3000.0),
    M::glossy("white_tile_3", [0.76, 0.75, 0.725], 0.06, 3000.0),
];
pub(super) const METRO_TILES: [M; 4] = [
    M::glossy("metro_tile_1", [0.05, 0.22, 0.17], 0.07, 3000.0),
    M::glossy("metro_tile_2", [0.06, 0.26, 0.2], 0.07, 3000.0),
    M::glossy("metro_tile_3", [0.04, 0.19, 0.155], 0.07, 3000.0),
    M::glossy("metro_tile_4", [0.075, 0.29, 0.22], 0.07, 3000.0),
];
pub(super) const TRIM: M = M::glossy("trim_tile", [0.03, 0.07, 0.06], 0.08, 3000.0);
/// From the bottom of the mosaic to its top.
pub(super) const MOSAIC: [M; 9] = [
    M::glossy("mosaic_1", [0.015, 0.07, 0.11], 0.08, 1500.0),
    M::glossy("mosaic_2", [0.02, 0.12, 0.17], 0.08, 1500.0),
    M::glossy("mosaic_3", [0.03, 0.2, 0.25], 0.08, 1500.0),
    M::glossy("mosaic_4", [0.06, 0.29, 0.33], 0.08, 1500.0),
    M::glossy("mosaic_5", [0.13, 0.4, 0.42], 0.08, 1500.0),
    M::glossy("mosaic_6", [0.27, 0.52, 0.51], 0.08, 1500.0),
    M::glossy("mosaic_7", [0.42, 0.61, 0.57], 0.08, 1500.0),
    M::glossy("mosaic_8", [0.58, 0.68, 0.62], 0.08, 1500.0),
    M::glossy("mosaic_gold", [0.46, 0.31, 0.09], 0.3, 300.0),
];
pub(super) const HEXAGONS: [M; 4] = [
    M::glossy("hexagon_1", [0.66, 0.64, 0.6], 0.1, 1200.0),
    M::glossy("hexagon_2", [0.62, 0.605, 0.57], 0.1, 1200.0),
    M::glossy("hexagon_3", [0.7, 0.68, 0.64], 0.1, 1200.0),
    M::glossy("hexagon_dark", [0.045, 0.055, 0.06], 0.1, 1200.0),
];
pub(super) const MIRROR: M = M::mirror("mirror", [0.9, 0.93, 0.91]);
pub(super) const CHROME: M = M::mirror("chrome", [0.75, 0.76, 0.78]);
pub(super) const BRASS: M = M::metal("brass", [0.75, 0.53, 0.22], 500.0);
pub(super) const PORCELAIN: M = M::glossy("porcelain", [0.76, 0.76, 0.745], 0.07, 4000.0);
pub(super) const ENAMEL: M = M::glossy("enamel", [0.03, 0.1, 0.09], 0.07, 2000.0);
pub(super) const OAK: M = M::glossy("oak", [0.44, 0.27, 0.13], 0.05, 200.0);
pub(super) const TEAK: M = M::glossy("teak", [0.31, 0.16, 0.07], 0.05, 150.0);
pub(super) const STONE_TOP: M = M::glossy("stone_top", [0.62, 0.6, 0.57], 0.08, 1500.0);
pub(super) const WATER: M = M::glossy("water", [0.18, 0.34, 0.36], 0.2, 20000.0);
pub(super) const BLACK: M = M::glossy("black", [0.03, 0.03, 0.03], 0.05, 200.0);
pub(super) const TOWELS: [M; 4] = [
    M::matte("towel_coral", [0.68, 0.26, 0.17]),
    M::matte("towel_white", [0.76, 0.75, 0.72]),
    M::matte("towel_mustard", [0.64, 0.43, 0.11]),
    M::matte("towel_sand", [0.62, 0.52, 0.4]),
];
pub(super) const BOTTLES: [M; 6] = [
    M::glossy("bottle_amber", [0.3, 0.11, 0.02], 0.08, 1500.0),
    M::glossy("bottle_green", [0.05, 0.2, 0.08], 0.08, 1500.0),
    M::glossy("bottle_blue", [0.05, 0.16, 0.38], 0.08, 1500.0),
    M::glossy("bottle_white", [0.72, 0.72, 0.7], 0.06, 800.0),
    M::glossy("bottle_rose", [0.6, 0.26, 0.27], 0.06, 800.0),
    M::glossy("bottle_black", [0.03, 0.03, 0.035], 0.06, 800.0),
];
pub(super) const LABEL: M = M::matte("label", [0.7, 0.67, 0.6]);
pub(super) const WAX: M = M::matte("wax", [0.74, 0.68, 0.55]);
pub(super) const PEARLS: [M; 3] = [
    M::glossy("pearl_1", [0.66, 0.35, 0.37], 0.1, 300.0),
    M::glossy("pearl_2", [0.68, 0.62, 0.5], 0.1, 300.0),
    M::glossy("pearl_3", [0.3, 0.5, 0.52], 0.1, 300.0),
];
pub(super) const PEBBLES: [M; 4] = [
    M::glossy("pebble_1", [0.44, 0.42, 0.39], 0.04, 60.0),
    M::glossy("pebble_2", [0.31, 0.3, 0.285], 0.04, 60.0),
    M::glossy("pebble_3", [0.55, 0.52, 0.47], 0.04, 60.0),
    M::glossy("pebble_4", [0.2, 0.2, 0.2], 0.04, 60.0),
];
pub(super) const TERRACOTTA: M = M::matte("terracotta", [0.5, 0.2, 0.1]);
pub(super) const SOIL: M = M::matte("soil", [0.06, 0.04, 0.028]);
pub(super) const LEAVES: [M; 3] = [
    M::glossy("leaf_1", [0.07, 0.27, 0.06], 0.05, 60.0),
    M::glossy("leaf_2", [0.1, 0.34, 0.08], 0.05, 60.0),
    M::glossy("leaf_3", [0.055, 0.2, 0.07], 0.05, 60.0),
];
pub(super) const PANEL_LIGHT: M = M::light("panel_light", [8.6, 8.1, 7.2]);
pub(super) const GLOBE_LIGHT: M = M::light("globe_light", [8.5, 6.8, 4.8]);
