//! Closed meshes to be shot at from inside.

use std::collections::BTreeMap;

use equilux_common::scene::{Geometry, NO_INDEX, Triangle};
use glam::Vec3;

/// A mesh of shared corners.
pub(crate) fn mesh(points: &[Vec3], faces: &[[u32; 3]]) -> Geometry {
    let triangles = faces
        .iter()
        .map(|&positions| Triangle {
            positions,
            normals: [NO_INDEX; 3],
            texcoords: [NO_INDEX; 3],
            material: 0,
        })
        .collect();
    let positions = points.iter().map(Vec3::to_array).collect();
    Geometry { positions, triangles, ..Geometry::default() }
}

/// An icosahedron whose faces are halved `level` times along each edge, on a sphere. Corners run
/// counter-clockwise seen from outside.
pub(crate) fn icosphere(level: usize, radius: f32, center: Vec3) -> Geometry {
    let golden = f32::midpoint(1.0, 5f32.sqrt());
    let mut points = Vec::new();
    for (a, b) in [(1.0, golden), (-1.0, golden), (1.0, -golden), (-1.0, -golden)] {
        points.extend([Vec3::new(0.0, a, b), Vec3::new(a, b, 0.0), Vec3::new(b, 0.0, a)]);
    }
    let mut faces = Vec::new();
    for a in 0..12u32 {
        for b in 0..12 {
            for c in 0..12 {
                let [p, q, r] = [a, b, c].map(|index| points[index as usize]);
                let is_edge = |p: Vec3, q: Vec3| (p.distance(q) - 2.0).abs() < 1e-3;
                let is_outward = (q - p).cross(r - p).dot(p) > 0.0;
                if a < b && a < c && is_outward && is_edge(p, q) && is_edge(q, r) && is_edge(r, p) {
                    faces.push([a, b, c]);
                }
            }
        }
    }
    for _ in 0..level {
        faces = halve(&mut points, &faces);
    }
    for point in &mut points {
        *point = point.normalize() * radius + center;
    }
    mesh(&points, &faces)
}

/// An axis-parallel box around zero, each face a grid of `cells` by `cells` squares.
pub(crate) fn subdivided_box(cells: usize, half_side: f32) -> Geometry {
    let corners = [-1.0f32, 1.0].map(|x| [-1.0, 1.0].map(|y| [-1.0, 1.0].map(|z| [x, y, z])));
    let points: Vec<Vec3> = corners.iter().flatten().flatten().map(|&p| Vec3::from(p)).collect();
    let quads =
        [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
    let mut table = BTreeMap::new();
    let mut grid_points = Vec::new();
    let mut faces = Vec::new();
    for quad in quads {
        let [p, q, _, s] = quad.map(|index| points[index]);
        let mut index_at = |column: usize, row: usize| {
            // In whole steps, so that faces agree on what they share.
            let steps = (p * cells as f32) + (q - p) * column as f32 + (s - p) * row as f32;
            let key = steps.to_array().map(|step| step.round() as i64);
            *table.entry(key).or_insert_with(|| {
                grid_points.push(steps / cells as f32 * half_side);
                u32::try_from(grid_points.len() - 1).expect("few points")
            })
        };
        for column in 0..cells {
            for row in 0..cells {
                let [a, b, c, d] = [(0, 0), (1, 0), (1, 1), (0, 1)]
                    .map(|(right, up)| index_at(column + right, row + up));
                faces.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    mesh(&grid_points, &faces)
}

fn halve(points: &mut Vec<Vec3>, faces: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let mut middles = BTreeMap::new();
    let mut middle = |a: u32, b: u32| {
        *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
            points.push(points[a as usize].midpoint(points[b as usize]));
            u32::try_from(points.len() - 1).expect("few points")
        })
    };
    faces
        .iter()
        .flat_map(|&[a, b, c]| {
            let (d, e, f) = (middle(a, b), middle(b, c), middle(c, a));
            [[a, d, f], [d, b, e], [f, e, c], [d, e, f]]
        })
        .collect()
}
