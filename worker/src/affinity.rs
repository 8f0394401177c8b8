//! What partitions of a store have to do with one another, as far as their boxes tell.
//!
//! The chance that a ray passes from one partition to another is taken to be in proportion to the
//! surface of the space that both reach into: by the measure of lines, so many of all rays that
//! cross the model cross that space as well (Santaló, *Integral geometry*, 1976). What rays really
//! do depends on light and camera; this needs nothing but the store.

use equilux_mapping::{Guest, InvalidGuest, Object, Tie};
use equilux_render::geometry::Bounds;
use equilux_store::Manifest;

/// Partitions that are apart by less than such a part of the model's extent have something to do
/// with each other: most rays that leave one enter the other.
const REACH: f64 = 1.0 / 256.0;

/// An affinity that stands for all of the model's surface.
const AFFINITY_MAX: f64 = 1e9;

/// The partitions of a store, with their places and ties; none if there are none.
///
/// # Errors
/// If their sizes are beyond all that can be.
pub fn guest(manifest: &Manifest) -> Result<Option<Guest>, InvalidGuest> {
    if manifest.partitions.is_empty() {
        return Ok(None);
    }
    let hulls: Vec<Bounds> = manifest.partitions.iter().map(|entry| hull(&entry.boxes)).collect();
    let objects = manifest.partitions.iter().zip(&hulls);
    let objects = objects.map(|(entry, hull)| Object {
        bytes: entry.memory_bytes.max(1),
        position: ((hull.lower + hull.upper) * 0.5).to_array(),
    });
    Guest::new(objects.collect(), ties(&hulls)).map(Some)
}

fn ties(hulls: &[Bounds]) -> Vec<Tie> {
    let model = hull(hulls);
    let reach = extent(&model).into_iter().fold(0.0, f64::max) * REACH;
    let surface = area(extent(&model)).max(f64::MIN_POSITIVE);
    let mut ties = Vec::new();
    for (second, hull) in hulls.iter().enumerate() {
        for (first, other) in hulls[..second].iter().enumerate() {
            let Some(common) = common(hull, other, reach) else { continue };
            let affinity = (area(common) / surface * AFFINITY_MAX).min(AFFINITY_MAX) as u64;
            ties.push(Tie { objects: [first, second], affinity: affinity.max(1) });
        }
    }
    ties
}

/// The box around boxes; a point if there are none.
fn hull(boxes: &[Bounds]) -> Bounds {
    boxes.iter().fold(Bounds::EMPTY, |hull, other| hull.joined(other)).or_origin()
}

/// Edges of a box.
fn extent(bounds: &Bounds) -> [f64; 3] {
    let (lower, upper) = (bounds.lower.to_array(), bounds.upper.to_array());
    std::array::from_fn(|axis| f64::from(upper[axis]) - f64::from(lower[axis]))
}

/// Half of the surface of a box with these edges.
fn area([x, y, z]: [f64; 3]) -> f64 {
    x * y + y * z + z * x
}

/// The edges of the space that two boxes have in common if both are `reach` larger.
fn common(a: &Bounds, b: &Bounds, reach: f64) -> Option<[f64; 3]> {
    let [a_lower, a_upper, b_lower, b_upper] =
        [a.lower, a.upper, b.lower, b.upper].map(|corner| corner.to_array().map(f64::from));
    let edge = |axis: usize| {
        a_upper[axis].min(b_upper[axis]) - a_lower[axis].max(b_lower[axis]) + 2.0 * reach
    };
    let edges = [0, 1, 2].map(edge);
    edges.iter().all(|&edge| edge >= 0.0).then_some(edges)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube(corner: [f32; 3]) -> Bounds {
        let corner = corner.into();
        Bounds { lower: corner, upper: corner + 1.0 }
    }

    #[test]
    fn partitions_are_tied_by_the_surface_that_both_reach() {
        let hulls = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [9.0, 9.0, 9.0]];
        let ties = ties(&hulls.map(cube));
        let pairs: Vec<_> = ties.iter().map(|tie| tie.objects).collect();
        assert_eq!(pairs, [[0, 1], [0, 2], [1, 2]], "the last one is far away");
        assert!(ties[0].affinity == ties[2].affinity, "a side each");
        assert!(ties[0].affinity > 5 * ties[1].affinity, "more than an edge: {ties:?}");
    }

    #[test]
    fn partitions_in_one_point_are_tied() {
        let ties = ties(&[Bounds { lower: [2.0; 3].into(), upper: [2.0; 3].into() }; 2]);
        assert_eq!(ties, [Tie { objects: [0, 1], affinity: 1 }]);
    }
}
