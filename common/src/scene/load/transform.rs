//! How a scene file says where a model stands.

use super::json::Node;
use crate::scene::error::SceneError;
use crate::scene::placing::{COORDINATE_MAX, Matrix, Transform};

/// Largest entry of a matrix, scale or translation: as the largest coordinate.
const ENTRY_MAX: f64 = COORDINATE_MAX;

/// Least scale factor along an axis; a smaller one flattens any model.
const DETERMINANT_MIN: f64 = 1e-30;

/// Reads either `{translate, rotate, scale}` (scaled first, then turned about x, then y, then z
/// by degrees, then moved) or the 16 numbers of a matrix, row by row, for column vectors.
pub(super) fn read(node: &Node<'_>) -> Result<Transform, SceneError> {
    let transform = if node.is_object() { read_steps(node)? } else { read_matrix(node)? };
    let determinant = transform.determinant();
    if determinant.abs() < DETERMINANT_MIN {
        return Err(node.invalid("flattens the model; every scale must differ from 0"));
    }
    Ok(transform)
}

fn read_steps(node: &Node<'_>) -> Result<Transform, SceneError> {
    let fields = node.fields(&["translate", "rotate", "scale"])?;
    let range = -ENTRY_MAX..=ENTRY_MAX;
    let mut transform = Transform::IDENTITY;
    if let Some(scale) = fields.get("scale") {
        let factors = if scale.is_list() {
            scale.numbers(range.clone())?
        } else {
            [scale.number(range.clone())?; 3]
        };
        for (axis, factor) in factors.into_iter().enumerate() {
            transform.linear[axis][axis] = factor;
        }
    }
    if let Some(rotate) = fields.get("rotate") {
        let degrees: [f64; 3] = rotate.numbers(range.clone())?;
        for (axis, angle) in degrees.into_iter().enumerate() {
            transform.linear = product(&rotation(axis, angle), &transform.linear);
        }
    }
    if let Some(translate) = fields.get("translate") {
        transform.translation = translate.numbers(range)?;
    }
    Ok(transform)
}

fn read_matrix(node: &Node<'_>) -> Result<Transform, SceneError> {
    let entries: [f64; 16] = node.numbers(-ENTRY_MAX..=ENTRY_MAX)?;
    if entries[12..] != [0.0, 0.0, 0.0, 1.0] {
        return Err(node.invalid(
            "the last row must be 0, 0, 0, 1: the matrix is written row by row, \
             with the translation in the 4th, 8th and 12th place",
        ));
    }
    Ok(Transform {
        linear: std::array::from_fn(|row| std::array::from_fn(|column| entries[row * 4 + column])),
        translation: std::array::from_fn(|row| entries[row * 4 + 3]),
    })
}

/// The right-handed turn about a coordinate axis.
fn rotation(axis: usize, degrees: f64) -> Matrix {
    let (sine, cosine) = sine_and_cosine(degrees);
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut matrix = [[0.0; 3]; 3];
    matrix[axis][axis] = 1.0;
    (matrix[u][u], matrix[u][v]) = (cosine, -sine);
    (matrix[v][u], matrix[v][v]) = (sine, cosine);
    matrix
}

/// Exact for quarter turns, which scenes are full of.
fn sine_and_cosine(degrees: f64) -> (f64, f64) {
    match degrees.rem_euclid(360.0) {
        0.0 => (0.0, 1.0),
        90.0 => (1.0, 0.0),
        180.0 => (0.0, -1.0),
        270.0 => (-1.0, 0.0),
        angle => libm::sincos(angle.to_radians()),
    }
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|row| {
        std::array::from_fn(|column| (0..3).map(|k| a[row][k] * b[k][column]).sum())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::load::json::Document;
    use crate::scene::placing::apply;

    fn read_text(text: &str) -> Result<Transform, SceneError> {
        read(&Node::root(&Document::new("t", text)).unwrap())
    }

    #[test]
    fn steps_scale_then_turn_about_x_y_z_then_move() {
        let t =
            read_text(r#"{"scale": 2, "rotate": [90, 0, 90], "translate": [1, 2, 3]}"#).unwrap();
        // y → (x turn) z → (z turn) z; x → x → y.
        assert_eq!(t.point([0.0, 1.0, 0.0]), [1.0, 2.0, 5.0]);
        assert_eq!(t.point([1.0, 0.0, 0.0]), [1.0, 4.0, 3.0]);
    }

    #[test]
    fn a_matrix_is_written_row_by_row() {
        let t = read_text("[1,0,0,5, 0,1,0,6, 0,0,-1,7, 0,0,0,1]").unwrap();
        assert_eq!(t.point([1.0, 1.0, 1.0]), [6.0, 7.0, 6.0]);
        assert!(t.is_mirroring());
        assert!(read_text("[1,0,0,0, 0,1,0,0, 0,0,1,0, 5,6,7,1]").is_err());
    }

    #[test]
    fn normals_stay_perpendicular_under_shear_and_mirroring() {
        let t = read_text("[1,2,0,0, 0,3,0,0, 0,0,-1,0, 0,0,0,1]").unwrap();
        let tangent = t.point([1.0, -1.0, 0.0]);
        let normal = apply(&t.normal_matrix(), [1.0, 1.0, 0.0]);
        assert_eq!((0..3).map(|axis| tangent[axis] * normal[axis]).sum::<f64>(), 0.0);
        assert_eq!(apply(&t.normal_matrix(), [0.0, 0.0, 1.0])[2].signum(), -1.0);
    }

    #[test]
    fn a_flat_transform_is_refused() {
        assert!(read_text(r#"{"scale": [1, 0, 1]}"#).unwrap_err().to_string().contains("flattens"));
    }
}
