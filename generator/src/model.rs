//! Objects as OBJ text.
//!
//! Every thing that is put becomes one `o` with its own points; indices are relative (negative),
//! which keeps lines short however large the model grows.

use std::collections::BTreeMap;

use crate::material::Material;
use crate::number::{NORMAL_DECIMALS, POSITION_DECIMALS, numbers};
use crate::shape::{Face, Shape};

/// An OBJ file in the making.
#[derive(Clone, Debug, Default)]
pub(crate) struct Model {
    text: String,
    materials: BTreeMap<&'static str, Material>,
    named: BTreeMap<&'static str, u32>,
    objects: u64,
    triangles: u64,
}

impl Model {
    /// Starts a file with a comment that says what it is, and the MTL file that it refers to.
    pub(crate) fn new(comment: &str, mtl: &str) -> Self {
        Self { text: format!("# {comment}\nmtllib {mtl}\n"), ..Self::default() }
    }

    /// Adds one object; it is called by its noun and a number.
    pub(crate) fn add(&mut self, noun: &'static str, material: &Material, shape: &Shape) {
        let number = self.named.entry(noun).or_insert(0);
        *number += 1;
        let known = self.materials.entry(material.name).or_insert(*material);
        assert_eq!(known, material, "two materials of one name");
        self.text += &format!("o {noun}_{number}\nusemtl {}\n", material.name);
        self.objects += 1;
        self.triangles += shape.triangle_count();
        self.write(shape);
    }

    /// How many objects it has.
    pub(crate) fn object_count(&self) -> u64 {
        self.objects
    }

    /// How many triangles its polygons make.
    pub(crate) fn triangle_count(&self) -> u64 {
        self.triangles
    }

    /// The materials in use, by name.
    pub(crate) fn materials(&self) -> &BTreeMap<&'static str, Material> {
        &self.materials
    }

    /// The finished text.
    pub(crate) fn into_text(self) -> String {
        self.text
    }

    fn write(&mut self, shape: &Shape) {
        for point in &shape.points {
            let coordinates = numbers(&[point.x, point.y, point.z], POSITION_DECIMALS);
            self.text += &format!("v {coordinates}\n");
        }
        for normal in &shape.normals {
            let coordinates = numbers(&[normal.x, normal.y, normal.z], NORMAL_DECIMALS);
            self.text += &format!("vn {coordinates}\n");
        }
        for face in &shape.faces {
            self.write_face(face, shape.points.len(), shape.normals.len());
        }
    }

    fn write_face(&mut self, face: &Face, points: usize, normals: usize) {
        self.text.push('f');
        for (corner, &point) in face.points.iter().enumerate() {
            self.text += &format!(" -{}", points - point);
            if let Some(&normal) = face.normals.get(corner) {
                self.text += &format!("//-{}", normals - normal);
            }
        }
        self.text.push('\n');
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Frame;

    #[test]
    fn an_object_is_written_as_obj() {
        let mut model = Model::new("a test", "a.mtl");
        let paper = Material::matte("paper", [0.7; 3]);
        let sheet = Shape::sheet(2.0, 1.0).placed(&Frame::at(1., 0.5, 0.));
        model.add("sheet", &paper, &sheet);
        model.add("sheet", &paper, &sheet);
        let sheet = "usemtl paper\nv 0 0.5 0.5\nv 2 0.5 0.5\nv 2 0.5 -0.5\nv 0 0.5 -0.5\n\
                     f -4 -3 -2 -1\n";
        let text = format!("# a test\nmtllib a.mtl\no sheet_1\n{sheet}o sheet_2\n{sheet}");
        assert_eq!((model.object_count(), model.triangle_count()), (2, 4));
        assert_eq!(model.into_text(), text);
    }
}
