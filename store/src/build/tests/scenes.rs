//! Scenes as nobody would make them.

use equilux_common::scene::WorldTriangle;
use proptest::prelude::*;

/// A triangle without attributes.
pub(super) fn bare(corners: [[f32; 3]; 3]) -> WorldTriangle {
    WorldTriangle { corners, normals: None, texcoords: None, material: 0 }
}

/// A wavy sheet of `2 · side²` triangles.
pub(super) fn sheet(side: u32) -> Vec<WorldTriangle> {
    let corner = |x: u32, z: u32| {
        let (x, z) = (x as f32, z as f32);
        [x, (x * 0.37 - z * 0.21).fract(), z]
    };
    let quads = (0..side * side).map(|quad| (quad % side, quad / side));
    let triangles = quads.flat_map(|(x, z)| {
        let [a, b] = [corner(x, z), corner(x + 1, z)];
        let [c, d] = [corner(x, z + 1), corner(x + 1, z + 1)];
        [bare([a, c, b]), bare([b, c, d])]
    });
    triangles.collect()
}

/// Any scene: clusters, crowds in one point, giants across everything, with attributes or without.
pub(super) fn any_scene() -> impl Strategy<Value = Vec<WorldTriangle>> {
    let crowd = (any_place(), any_size(), 0usize..400).prop_flat_map(|(place, size, count)| {
        proptest::collection::vec(any_triangle(place, size), count)
    });
    let same = (any_place().prop_flat_map(|place| any_triangle(place, 1.0)), 0usize..400)
        .prop_map(|(triangle, count)| vec![triangle; count]);
    let giant = any_triangle([0.0; 3], 1e10).prop_map(|triangle| vec![triangle]);
    proptest::collection::vec(prop_oneof![crowd, same, giant], 0..5)
        .prop_map(|parts| parts.concat())
}

fn any_place() -> impl Strategy<Value = [f32; 3]> {
    let coordinate = prop_oneof![Just(0.0f32), -1.0f32..1.0, -1e9f32..1e9, -1e-30f32..1e-30];
    [coordinate.clone(), coordinate.clone(), coordinate]
}

fn any_size() -> impl Strategy<Value = f32> {
    prop_oneof![Just(0.0f32), Just(1e-40), Just(1e-3), Just(1.0), Just(1e6)]
}

fn any_triangle(place: [f32; 3], size: f32) -> impl Strategy<Value = WorldTriangle> {
    let number = || -1.0f32..1.0;
    let corners = proptest::array::uniform3(proptest::array::uniform3(number()));
    let normals =
        proptest::option::of(proptest::array::uniform3(proptest::array::uniform3(number())));
    let texcoords =
        proptest::option::of(proptest::array::uniform3(proptest::array::uniform2(number())));
    (corners, normals, texcoords, 0u32..3).prop_map(
        move |(corners, normals, texcoords, material)| {
            let moved = |axis: usize, x: f32| place[axis] + size * x;
            let corners = corners.map(|[x, y, z]| [moved(0, x), moved(1, y), moved(2, z)]);
            WorldTriangle { corners, normals, texcoords, material }
        },
    )
}
