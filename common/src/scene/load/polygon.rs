//! Cutting polygons into triangles.
//!
//! A convex polygon is a fan about its first corner, as every program does it. A concave one is cut
//! ear by ear (Meisters 1975): a convex corner whose triangle holds no other corner can be cut off.
//! Polygons in space are seen along their area vector.

/// Most corners of a concave polygon: cutting ears takes time with their cube.
const CONCAVE_CORNERS_MAX: usize = 512;

/// Corners of a polygon that is cut without taking memory for it: nearly all have four.
const FEW_CORNERS: usize = 8;

/// What is wrong with a face that [`triangulate`] does not take.
pub(super) fn too_concave(corner_count: usize) -> String {
    format!(
        "a concave face of {corner_count} corners; cut faces of more than {CONCAVE_CORNERS_MAX} \
         corners into triangles in the program that made them"
    )
}

type Point = [f64; 2];

/// Appends triples of corner numbers that cover a polygon of `corner_count` corners, turning the
/// same way. False if it is concave and too large.
pub(super) fn triangulate(
    corner_count: usize,
    corner: impl Fn(usize) -> [f64; 3],
    triangles: &mut Vec<[usize; 3]>,
) -> bool {
    let fan = (2..corner_count).map(|last| [0, last - 1, last]);
    if corner_count <= 3 {
        triangles.extend(fan);
        return true;
    }
    let mut few = [[0.0; 2]; FEW_CORNERS];
    let mut many = Vec::new();
    let points = match few.get_mut(..corner_count) {
        Some(few) => few,
        None => {
            many.resize(corner_count, [0.0; 2]);
            &mut many[..]
        }
    };
    flatten(corner, points);
    if is_fan(points) {
        triangles.extend(fan);
        return true;
    }
    if corner_count > CONCAVE_CORNERS_MAX {
        return false;
    }
    cut_ears(points, triangles);
    true
}

/// Fills in the corners as seen from where the polygon runs counter-clockwise.
fn flatten(corner: impl Fn(usize) -> [f64; 3], flat: &mut [Point]) {
    let mut area = [0.0; 3];
    for number in 0..flat.len() {
        let next = if number + 1 == flat.len() { 0 } else { number + 1 };
        let (p, q) = (corner(number), corner(next));
        for (axis, component) in area.iter_mut().enumerate() {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            *component += (p[u] - q[u]) * (p[v] + q[v]);
        }
    }
    let size = |axis: usize| area[axis].abs();
    let axis = if size(0) > size(1) && size(0) > size(2) {
        0
    } else if size(1) > size(2) {
        1
    } else {
        2
    };
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let turn = if area[axis] < 0.0 { -1.0 } else { 1.0 };
    for (number, point) in flat.iter_mut().enumerate() {
        let p = corner(number);
        *point = [p[u] * turn, p[v]];
    }
}

/// Whether no triangle of the fan about the first corner is turned over.
fn is_fan(points: &[Point]) -> bool {
    !points[1..].windows(2).any(|pair| turn(points[0], pair[0], pair[1]) < 0.0)
}

/// Twice the signed area of a triangle.
fn turn(a: Point, b: Point, c: Point) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

fn cut_ears(points: &[Point], triangles: &mut Vec<[usize; 3]>) {
    let mut left: Vec<usize> = (0..points.len()).collect();
    while left.len() > 3 {
        // A polygon that crosses itself may have no ear; then any corner must do.
        let ear = (0..left.len()).find(|&at| is_ear(points, &left, at)).unwrap_or(0);
        triangles.push(around(&left, ear));
        left.remove(ear);
    }
    triangles.push([left[0], left[1], left[2]]);
}

/// A corner between its neighbors.
fn around(left: &[usize], at: usize) -> [usize; 3] {
    let count = left.len();
    [left[(at + count - 1) % count], left[at], left[(at + 1) % count]]
}

fn is_ear(points: &[Point], left: &[usize], at: usize) -> bool {
    let corners = around(left, at);
    let [a, b, c] = corners.map(|corner| points[corner]);
    let is_inside = |p: Point| turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0;
    let is_corner = |p: Point| p == a || p == b || p == c;
    turn(a, b, c) > 0.0
        && !left.iter().any(|&other| {
            let p = points[other];
            !corners.contains(&other) && !is_corner(p) && is_inside(p)
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn cut(points: &[Point], lift: impl Fn(Point) -> [f64; 3]) -> Vec<[usize; 3]> {
        let mut triangles = Vec::new();
        assert!(triangulate(points.len(), |number| lift(points[number]), &mut triangles));
        triangles
    }

    fn area(points: &[Point]) -> f64 {
        let turns = points[1..].windows(2).map(|pair| turn(points[0], pair[0], pair[1]));
        turns.sum::<f64>() / 2.0
    }

    #[test]
    fn a_concave_polygon_is_covered_once_from_every_side() {
        // An arrow head whose notch the fan about corner 0 would bridge.
        let arrow = [[2.0, 0.0], [4.0, 4.0], [2.0, 1.0], [0.0, 4.0]];
        let turned: Vec<Point> = (0..4).map(|k| arrow[(k + 1) % 4]).collect();
        for points in [arrow.to_vec(), turned] {
            for lift in [
                |p: Point| [p[0], p[1], 7.0],
                |p: Point| [7.0, p[1], p[0]],
                |p: Point| [p[0], p[0] + p[1], p[1]],
            ] {
                let triangles = cut(&points, lift);
                let areas = triangles.iter().map(|t| area(&t.map(|corner| points[corner])));
                let areas: Vec<f64> = areas.collect();
                assert_eq!(triangles.len(), 2);
                assert!(areas.iter().all(|&a| a > 0.0), "{areas:?}");
                assert_eq!(areas.iter().sum::<f64>(), area(&points));
            }
        }
    }

    #[test]
    fn too_many_corners_are_refused_only_where_concave() {
        let circle = |count: usize, dent: f64| {
            move |number: usize| {
                let angle = number as f64 / count as f64 * std::f64::consts::TAU;
                let radius = if number % 2 == 1 { dent } else { 1.0 };
                [libm::cos(angle) * radius, libm::sin(angle) * radius, 0.0]
            }
        };
        let mut triangles = Vec::new();
        assert!(triangulate(2000, circle(2000, 1.0), &mut triangles));
        assert_eq!(triangles.len(), 1998);
        assert!(!triangulate(2000, circle(2000, 0.5), &mut triangles));
    }

    proptest! {
        #[test]
        fn star_shaped_polygons_are_covered(radii in prop::collection::vec(0.1f64..1.0, 4..30)) {
            let points: Vec<Point> = radii.iter().enumerate().map(|(number, radius)| {
                let angle = number as f64 / radii.len() as f64 * std::f64::consts::TAU;
                [libm::cos(angle) * radius, libm::sin(angle) * radius]
            }).collect();
            let triangles = cut(&points, |p| [p[0], p[1], 0.0]);
            prop_assert_eq!(triangles.len(), points.len() - 2);
            let areas: Vec<f64> = triangles.iter().map(|t| area(&t.map(|c| points[c]))).collect();
            prop_assert!(areas.iter().all(|&a| a >= 0.0));
            prop_assert!((areas.iter().sum::<f64>() - area(&points)).abs() < 1e-9);
        }

        #[test]
        fn any_corners_give_triangles(corners in prop::collection::vec(any::<[f64; 3]>(), 3..20)) {
            let mut triangles = Vec::new();
            prop_assert!(triangulate(corners.len(), |number| corners[number], &mut triangles));
            prop_assert_eq!(triangles.len(), corners.len() - 2);
        }
    }
}
