//! The Cornell box, as measured at Cornell University's Program of Computer Graphics in 1984 and
//! published with its camera: <https://www.graphics.cornell.edu/online/box/data.html>.
//!
//! Lengths are the measured millimetres; the box is not quite square, and neither is this one.

use crate::files::Files;
use crate::frame::Frame;
use crate::material::Material;
use crate::shape::Shape;
use crate::stage::{About, Stage, View};
use crate::vector::{Vector, vector};

const WHITE: Material = Material::matte("white", [0.725, 0.71, 0.68]);
const GREEN: Material = Material::matte("green", [0.14, 0.45, 0.091]);
const RED: Material = Material::matte("red", [0.63, 0.065, 0.05]);
const LIGHT: Material = Material::light("light", [17.0, 12.0, 4.0]);

const ABOUT: About = About {
    name: "cornell-box",
    shows: "
The box that renderers have been compared by since 1984: five walls, two blocks and one light, all
diffuse. Lengths are in millimetres as measured. The floor, ceiling and walls are the published
quadrilaterals, which are not exactly rectangles.

The light lies half a millimetre under the ceiling, which is left whole above it; the published
data cut a hole instead. No ray can tell the difference, but for the half millimetre.",
    source: "
Vertices and camera: Cornell University Program of Computer Graphics, *Cornell Box Data*,
<https://www.graphics.cornell.edu/online/box/data.html>, measured values published for anyone's use
in comparing renderers. This arrangement of them as OBJ, MTL and JSON is part of Equilux: MIT OR
Apache-2.0.

Cornell published reflectances and emission as spectra, from 400 to 700 nm. The RGB values here are
the customary linear Rec. 709 equivalents, used by most renderers that ship the box: each
reflectance spectrum weighted with the CIE 1931 matching functions under an even illuminant,
converted from XYZ to linear sRGB, and rounded (white 0.725 0.71 0.68, green 0.14 0.45 0.091, red
0.63 0.065 0.05). The light's spectrum gives its hue; its radiance, which the measurements leave
open, is the customary 17 12 4.",
};

/// Makes the Cornell box: 7 objects and 1 light source.
#[must_use]
pub fn cornell_box() -> Files {
    let mut stage = Stage::new(ABOUT);
    let here = Frame::at(0.0, 0.0, 0.0);
    for (noun, material, corners) in walls() {
        stage.put(noun, &material, &here, Shape::polygon(corners.to_vec()));
    }
    let short = [(130., 65.), (82., 225.), (240., 272.), (290., 114.)];
    let tall = [(423., 247.), (265., 296.), (314., 456.), (472., 406.)];
    stage.put("short_block", &WHITE, &here, block(&short, 165.0));
    stage.put("tall_block", &WHITE, &here, block(&tall, 330.0));
    stage.into_files(&View {
        eye: vector(278.0, 273.0, -800.0),
        target: vector(278.0, 273.0, 0.0),
        // Focal length 0.035 with a film of 0.025 by 0.025: 2 atan(0.025 / 0.07).
        vfov: 39.3077,
        size: (512, 512),
        filter: "box",
    })
}

/// The published quadrilaterals, wound so that they face into the box.
fn walls() -> [(&'static str, Material, [Vector; 4]); 6] {
    let floor = [(552.8, 0., 0.), (0., 0., 0.), (0., 0., 559.2), (549.6, 0., 559.2)];
    let ceiling = [(556., 548.8, 0.), (556., 548.8, 559.2), (0., 548.8, 559.2), (0., 548.8, 0.)];
    let back = [(549.6, 0., 559.2), (0., 0., 559.2), (0., 548.8, 559.2), (556., 548.8, 559.2)];
    let right = [(0., 0., 559.2), (0., 0., 0.), (0., 548.8, 0.), (0., 548.8, 559.2)];
    let left = [(552.8, 0., 0.), (549.6, 0., 559.2), (556., 548.8, 559.2), (556., 548.8, 0.)];
    let light =
        [(343., 548.3, 227.), (343., 548.3, 332.), (213., 548.3, 332.), (213., 548.3, 227.)];
    let corners = |points: [(f64, f64, f64); 4]| points.map(|(x, y, z)| vector(x, y, z));
    [
        ("floor", WHITE, corners(floor)),
        ("ceiling", WHITE, corners(ceiling)),
        ("back_wall", WHITE, corners(back)),
        ("right_wall", GREEN, corners(right)),
        ("left_wall", RED, corners(left)),
        ("light", LIGHT, corners(light)),
    ]
}

/// A block without a bottom, over corners that run from +x to −x on the side of the camera.
fn block(corners: &[(f64, f64); 4], height: f64) -> Shape {
    let point = |index: usize, y: f64| vector(corners[index % 4].0, y, corners[index % 4].1);
    let top = (0..4).map(|index| point(index, height)).collect();
    let side = |at: usize| {
        vec![point(at + 1, 0.0), point(at + 1, height), point(at, height), point(at, 0.0)]
    };
    Shape::polygons(std::iter::once(top).chain((0..4).map(side)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn facing(corners: &[Vector]) -> Vector {
        (corners[1] - corners[0]).cross(corners[2] - corners[1]).normalized()
    }

    #[test]
    fn walls_and_light_face_into_the_box() {
        let middle = vector(278., 273., 279.);
        for (noun, _, corners) in walls() {
            assert!(facing(&corners).dot(middle - corners[0]) > 0.0, "{noun}");
        }
    }

    #[test]
    fn blocks_face_outward() {
        for corners in [
            [(130., 65.), (82., 225.), (240., 272.), (290., 114.)],
            [(423., 247.), (265., 296.), (314., 456.), (472., 406.)],
        ] {
            let block = block(&corners, 100.0);
            let total = block.points.iter().fold(vector(0., 0., 0.), |sum, point| sum + *point);
            let middle = total * (1.0 / block.points.len() as f64);
            for face in &block.faces {
                let corners: Vec<Vector> = face.points.iter().map(|&i| block.points[i]).collect();
                assert!(facing(&corners).dot(corners[0] - middle) > 0.0);
            }
        }
    }

    #[test]
    fn it_has_the_published_counts() {
        let counts = cornell_box().counts();
        assert_eq!((counts.objects, counts.lights, counts.triangles), (7, 1, 32));
    }
}
