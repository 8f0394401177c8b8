//! What becomes of a model's vertices and triangles when it is placed, decided in one place for
//! models in memory and models that are streamed.

use crate::scene::placing::COORDINATE_MAX;

/// Least doubled area: below it the normal is lost in single precision.
const DOUBLE_AREA_MIN: f64 = 1e-37;

/// What becomes of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Verdict {
    /// It stays, with these corners.
    Kept([[f32; 3]; 3]),
    /// A corner is infinite, NaN or huge.
    Bad,
    /// It has no area.
    Degenerate,
}

/// Whether texture coordinates can be worked with; such as cannot count as 0 0.
#[inline]
pub(super) fn is_good_texcoord(texcoord: [f32; 2]) -> bool {
    texcoord.iter().all(|t| f64::from(t.abs()) <= COORDINATE_MAX)
}

/// Decides on a triangle by its corners once they are placed, in any order.
#[inline]
pub(super) fn judge(corners: [Option<[f32; 3]>; 3]) -> Verdict {
    match corners {
        [Some(a), Some(b), Some(c)] if has_area([a, b, c]) => Verdict::Kept([a, b, c]),
        [Some(_), Some(_), Some(_)] => Verdict::Degenerate,
        _ => Verdict::Bad,
    }
}

#[inline]
fn has_area(corners: [[f32; 3]; 3]) -> bool {
    let [a, b, c] = corners.map(|corner| corner.map(f64::from));
    let edge = |to: [f64; 3]| -> [f64; 3] { std::array::from_fn(|axis| to[axis] - a[axis]) };
    let (ab, ac) = (edge(b), edge(c));
    let cross: [f64; 3] = std::array::from_fn(|axis| {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        ab[u] * ac[v] - ab[v] * ac[u]
    });
    !cross.iter().all(|component| component.abs() < DOUBLE_AREA_MIN)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::placing::{Placing, Transform};

    #[test]
    fn triangles_are_judged_by_their_corners() {
        let placing = Placing::new(Transform::IDENTITY);
        let judged = |points: [[f32; 3]; 3]| judge(points.map(|p| placing.position(p)));
        let (a, b, c) = ([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
        assert_eq!(judged([a, b, c]), Verdict::Kept([a, b, c]));
        assert_eq!(judged([a, b, b]), Verdict::Degenerate);
        assert_eq!(judged([a, b, [f32::NAN, 0.0, 0.0]]), Verdict::Bad);
        assert_eq!(judged([a, a, [2e9, 0.0, 0.0]]), Verdict::Bad);
    }
}
