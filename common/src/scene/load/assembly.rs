//! Putting models together: vertices into world space, bad faces out, objects in order.

use super::COORDINATE_MAX;
use super::json::single;
use super::obj::{ObjModel, ObjTriangle};
use super::transform::Transform;
use super::warnings::Warnings;
use crate::scene::error::{Place, SceneError};
use crate::scene::{Geometry, NO_INDEX, Object, Triangle};

/// Most triangles, vertices, normals or texture coordinates of a scene. As many triangles take
/// 10 GiB before there is a tree over them; a few lines that place a large model a thousand times
/// over must not use up a machine. Indices then also fit 32 bits.
const TABLE_ENTRIES_MAX: usize = 1 << 28;

/// Least doubled area: below it the normal is lost in single precision.
const DOUBLE_AREA_MIN: f64 = 1e-37;

/// The geometry of a scene as it grows.
#[derive(Debug, Default)]
pub(super) struct Assembly {
    pub(super) geometry: Geometry,
    /// Triangles dropped because they have no area.
    pub(super) degenerate_count: usize,
}

/// A model and all that is needed to place it.
pub(super) struct Placement<'a> {
    pub(super) file: &'a str,
    pub(super) model: &'a ObjModel,
    pub(super) transform: Transform,
    /// Scene materials by the model's material numbers.
    pub(super) materials: &'a [u32],
    /// The scene material of faces that name none.
    pub(super) default_material: u32,
}

/// What became of a model's vertex tables.
struct Tables {
    /// What to add to a model's indices.
    positions: u32,
    normals: u32,
    texcoords: u32,
    /// Which of the model's positions and normals can be used.
    good_positions: Vec<bool>,
    good_normals: Vec<bool>,
}

impl Assembly {
    /// Adds a model.
    pub(super) fn add(
        &mut self,
        placement: &Placement<'_>,
        warnings: &mut Warnings,
    ) -> Result<(), SceneError> {
        self.check_room(placement)?;
        let tables = self.add_vertices(placement, warnings);
        let mut skipped = 0;
        self.degenerate_count += placement.model.thin_faces;
        for (object, triangles) in objects(placement.model) {
            let name = &placement.model.objects[object as usize];
            let before = skipped;
            self.add_object(name, triangles, placement, &tables, &mut skipped);
            if skipped > before {
                warnings.push(format!(
                    "{}: object \"{name}\": {} triangles with infinite, NaN or huge vertices \
                     are left out",
                    placement.file,
                    skipped - before
                ));
            }
        }
        Ok(())
    }

    fn check_room(&self, placement: &Placement<'_>) -> Result<(), SceneError> {
        let (geometry, model) = (&self.geometry, placement.model);
        let counts = [
            geometry.positions.len() + model.positions.len(),
            geometry.normals.len() + model.normals.len(),
            geometry.texcoords.len() + model.texcoords.len(),
            geometry.triangles.len() + model.triangles.len(),
        ];
        if counts.into_iter().all(|count| count <= TABLE_ENTRIES_MAX) {
            return Ok(());
        }
        Err(SceneError::TooLarge {
            place: Place::file(placement.file),
            problem: format!(
                "with it the scene has more than {TABLE_ENTRIES_MAX} triangles or vertices"
            ),
        })
    }

    fn add_vertices(&mut self, placement: &Placement<'_>, warnings: &mut Warnings) -> Tables {
        let (model, transform) = (placement.model, &placement.transform);
        let geometry = &mut self.geometry;
        let start = |length: usize| u32::try_from(length).unwrap_or(NO_INDEX);
        let mut tables = Tables {
            positions: start(geometry.positions.len()),
            normals: start(geometry.normals.len()),
            texcoords: start(geometry.texcoords.len()),
            good_positions: Vec::with_capacity(model.positions.len()),
            good_normals: Vec::with_capacity(model.normals.len()),
        };
        for position in &model.positions {
            let p = transform.point(position.map(f64::from));
            let is_good = p.iter().all(|component| component.abs() <= COORDINATE_MAX);
            geometry.positions.push(if is_good { p.map(single) } else { [0.0; 3] });
            tables.good_positions.push(is_good);
        }
        for normal in &model.normals {
            let n = unit(transform.normal(normal.map(f64::from)));
            tables.good_normals.push(n.is_some());
            geometry.normals.push(n.unwrap_or([0.0, 0.0, 1.0]).map(single));
        }
        let mut lost = 0;
        for texcoord in &model.texcoords {
            let is_good = texcoord.iter().all(|t| f64::from(t.abs()) <= COORDINATE_MAX);
            lost += usize::from(!is_good);
            geometry.texcoords.push(if is_good { *texcoord } else { [0.0; 2] });
        }
        if lost > 0 {
            let file = placement.file;
            warnings.push(format!(
                "{file}: {lost} texture coordinates that are infinite, NaN or huge count as 0 0"
            ));
        }
        tables
    }

    fn add_object(
        &mut self,
        name: &str,
        triangles: &[ObjTriangle],
        placement: &Placement<'_>,
        tables: &Tables,
        skipped: &mut usize,
    ) {
        let first = self.geometry.triangles.len();
        for triangle in triangles {
            if !triangle.positions.iter().all(|&index| tables.good_positions[index as usize]) {
                *skipped += 1;
                continue;
            }
            let placed = place(triangle, placement, tables);
            if self.is_degenerate(&placed) {
                self.degenerate_count += 1;
            } else {
                self.geometry.triangles.push(placed);
            }
        }
        let count = self.geometry.triangles.len() - first;
        if count > 0 {
            let narrow = |number: usize| u32::try_from(number).unwrap_or(NO_INDEX);
            self.geometry.objects.push(Object {
                name: name.to_owned(),
                first_triangle: narrow(first),
                triangle_count: narrow(count),
            });
        }
    }

    fn is_degenerate(&self, triangle: &Triangle) -> bool {
        let corner = |index: u32| self.geometry.positions[index as usize].map(f64::from);
        let [a, b, c] = triangle.positions.map(corner);
        let edge = |to: [f64; 3]| -> [f64; 3] { std::array::from_fn(|axis| to[axis] - a[axis]) };
        let (ab, ac) = (edge(b), edge(c));
        let cross: [f64; 3] = std::array::from_fn(|axis| {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            ab[u] * ac[v] - ab[v] * ac[u]
        });
        cross.iter().all(|component| component.abs() < DOUBLE_AREA_MIN)
    }
}

/// The model's objects that have triangles, in order.
fn objects(model: &ObjModel) -> impl Iterator<Item = (u32, &[ObjTriangle])> {
    let runs = model.triangles.chunk_by(|one, next| one.object == next.object);
    runs.map(|run| (run[0].object, run))
}

fn place(triangle: &ObjTriangle, placement: &Placement<'_>, tables: &Tables) -> Triangle {
    let material = placement.materials.get(triangle.material as usize);
    let has_normals = triangle.normals[0] != NO_INDEX
        && triangle.normals.iter().all(|&index| tables.good_normals[index as usize]);
    let has_texcoords = triangle.texcoords[0] != NO_INDEX;
    let shift = |has: bool, indices: [u32; 3], start: u32| {
        let moved = indices.map(|index| if has { index + start } else { NO_INDEX });
        // A mirrored corner order turns the other way: turn it back, so that the face normal stays
        // on the outside.
        if placement.transform.is_mirroring() { [moved[0], moved[2], moved[1]] } else { moved }
    };
    Triangle {
        positions: shift(true, triangle.positions, tables.positions),
        normals: shift(has_normals, triangle.normals, tables.normals),
        texcoords: shift(has_texcoords, triangle.texcoords, tables.texcoords),
        material: material.copied().unwrap_or(placement.default_material),
    }
}

fn unit(v: [f64; 3]) -> Option<[f64; 3]> {
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    (length.is_finite() && length > f64::MIN_POSITIVE)
        .then(|| v.map(|component| component / length))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::load::json::{Document, Node};

    fn assemble(text: &str, transform: &str) -> (Assembly, Vec<String>) {
        let model = ObjModel::read("a.obj", text.as_bytes()).unwrap();
        let document = Document::new("t", transform);
        let transform = Transform::read(&Node::root(&document).unwrap()).unwrap();
        let placement = Placement {
            file: "a.obj",
            model: &model,
            transform,
            materials: &[],
            default_material: 5,
        };
        let (mut assembly, mut warnings) = (Assembly::default(), Warnings::default());
        assembly.add(&placement, &mut warnings).unwrap();
        assembly.add(&placement, &mut warnings).unwrap();
        (assembly, warnings.into_messages())
    }

    #[test]
    fn mirrored_models_keep_their_outside() {
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 2\nf 1//1 2//1 3//1\n";
        let (assembly, _) = assemble(text, r#"{"scale": [-1, 1, 3]}"#);
        let geometry = assembly.geometry;
        let [a, b, c] = geometry.triangles[1].positions.map(|i| geometry.positions[i as usize]);
        let z = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        assert!(z > 0.0, "the face still looks toward +z");
        assert_eq!(geometry.normals[1], [0.0, 0.0, 1.0]);
        assert_eq!(geometry.triangles[1].material, 5);
    }

    #[test]
    fn bad_vertices_and_flat_triangles_are_left_out_and_counted() {
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv nan 0 0\nv inf 0 0\nv 2 0 0\nv 1e30 0 0\n\
                    o bad\nf 1 2 4\nf 1 2 5\nf 1 2 7\nf 1 2 3\no flat\nf 1 1 2\nf 1 2 6\nf 1 2\n\
                    o good\nf 3 2 1\n";
        let (assembly, warnings) = assemble(text, "{}");
        assert_eq!(assembly.degenerate_count, 6);
        let names: Vec<&str> =
            assembly.geometry.objects.iter().map(|object| object.name.as_str()).collect();
        assert_eq!(names, ["bad", "good", "bad", "good"]);
        assert_eq!(warnings.len(), 1);
        assert!(warnings[0].starts_with("a.obj: object \"bad\": 3 triangles with infinite"));
        let runs: Vec<_> = assembly
            .geometry
            .objects
            .iter()
            .map(|o| (o.first_triangle, o.triangle_count))
            .collect();
        assert_eq!(runs, [(0, 1), (1, 1), (2, 1), (3, 1)]);
    }

    #[test]
    fn bad_normals_fall_back_to_the_face() {
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 0\nvn 0 nan 0\nvn 1 0 0\n\
                    f 1//1 2//1 3//1\nf 1//2 2//2 3//3\nf 1//3 2//3 3//3\n";
        let (assembly, _) = assemble(text, "{}");
        let normals: Vec<_> = assembly.geometry.triangles.iter().map(|t| t.normals).collect();
        assert_eq!(normals[..2], [[NO_INDEX; 3]; 2]);
        assert_ne!(normals[2], [NO_INDEX; 3]);
    }
}
