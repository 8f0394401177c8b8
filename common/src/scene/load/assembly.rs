//! Putting models together: vertices into world space, bad faces out, objects in order.

use super::judging::{Verdict, is_good_texcoord, judge};
use super::materials::ModelMaterials;
use super::mesh::{Mesh, MeshTriangle};
use super::warnings::{Warnings, bad_vertices, lost_texcoords};
use crate::scene::error::{Place, SceneError};
use crate::scene::placing::Placing;
use crate::scene::{Geometry, NO_INDEX, Object, Triangle};

/// Most triangles, vertices, normals or texture coordinates of a scene. As many triangles take
/// 10 GiB before there is a tree over them; a few lines that place a large model a thousand times
/// over must not use up a machine. Indices then also fit 32 bits.
pub(super) const TABLE_ENTRIES_MAX: usize = 1 << 28;

/// The geometry of a scene as it grows.
#[derive(Debug, Default)]
pub(super) struct Assembly {
    pub(super) geometry: Geometry,
    /// How many entries the tables of other geometry of the scene have, as [`table_lengths`] tells.
    pub(super) elsewhere: [usize; 4],
    /// Triangles dropped because they have no area.
    pub(super) degenerate_count: u64,
}

/// A model and all that is needed to place it.
pub(super) struct Placement<'a> {
    pub(super) file: &'a str,
    pub(super) mesh: &'a Mesh,
    pub(super) placing: Placing,
    pub(super) materials: ModelMaterials,
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
        self.degenerate_count += placement.mesh.thin_faces;
        for (object, triangles) in objects(placement.mesh) {
            let name = &placement.mesh.objects[object as usize];
            let before = skipped;
            self.add_object(name, triangles, placement, &tables, &mut skipped);
            let bad = skipped - before;
            warnings.extend(bad_vertices(placement.file, name, bad));
        }
        Ok(())
    }

    fn check_room(&self, placement: &Placement<'_>) -> Result<(), SceneError> {
        let mesh = placement.mesh;
        let more =
            [mesh.positions.len(), mesh.normals.len(), mesh.texcoords.len(), mesh.triangles.len()];
        let here = table_lengths(&self.geometry);
        let count = |table: usize| here[table] + self.elsewhere[table] + more[table];
        if (0..4).all(|table| count(table) <= TABLE_ENTRIES_MAX) {
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
        let (mesh, placing) = (placement.mesh, &placement.placing);
        let geometry = &mut self.geometry;
        let start = |length: usize| u32::try_from(length).unwrap_or(NO_INDEX);
        let mut tables = Tables {
            positions: start(geometry.positions.len()),
            normals: start(geometry.normals.len()),
            texcoords: start(geometry.texcoords.len()),
            good_positions: Vec::with_capacity(mesh.positions.len()),
            good_normals: Vec::with_capacity(mesh.normals.len()),
        };
        for position in &mesh.positions {
            let p = placing.position(*position);
            tables.good_positions.push(p.is_some());
            geometry.positions.push(p.unwrap_or_default());
        }
        for normal in &mesh.normals {
            let n = placing.normal(*normal);
            tables.good_normals.push(n.is_some());
            geometry.normals.push(n.unwrap_or([0.0, 0.0, 1.0]));
        }
        let mut lost = 0;
        for texcoord in &mesh.texcoords {
            let is_good = is_good_texcoord(*texcoord);
            lost += u64::from(!is_good);
            geometry.texcoords.push(if is_good { *texcoord } else { [0.0; 2] });
        }
        warnings.extend(lost_texcoords(placement.file, lost));
        tables
    }

    fn add_object(
        &mut self,
        name: &str,
        triangles: &[MeshTriangle],
        placement: &Placement<'_>,
        tables: &Tables,
        skipped: &mut u64,
    ) {
        let first = self.geometry.triangles.len();
        for triangle in triangles {
            let corner = |index: u32| {
                let is_good = tables.good_positions[index as usize];
                is_good.then(|| self.geometry.positions[(index + tables.positions) as usize])
            };
            match judge(triangle.positions.map(corner)) {
                Verdict::Kept(_) => {
                    self.geometry.triangles.push(place(triangle, placement, tables));
                }
                Verdict::Degenerate => self.degenerate_count += 1,
                Verdict::Bad => *skipped += 1,
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
}

/// How many positions, normals, texture coordinates and triangles there are.
pub(super) const fn table_lengths(geometry: &Geometry) -> [usize; 4] {
    let Geometry { positions, normals, texcoords, triangles, .. } = geometry;
    [positions.len(), normals.len(), texcoords.len(), triangles.len()]
}

/// The model's objects that have triangles, in order.
fn objects(mesh: &Mesh) -> impl Iterator<Item = (u32, &[MeshTriangle])> {
    let runs = mesh.triangles.chunk_by(|one, next| one.object == next.object);
    runs.map(|run| (run[0].object, run))
}

fn place(triangle: &MeshTriangle, placement: &Placement<'_>, tables: &Tables) -> Triangle {
    let has_normals = triangle.normals[0] != NO_INDEX
        && triangle.normals.iter().all(|&index| tables.good_normals[index as usize]);
    let has_texcoords = triangle.texcoords[0] != NO_INDEX;
    let shift = |has: bool, indices: [u32; 3], start: u32| {
        let moved = indices.map(|index| if has { index + start } else { NO_INDEX });
        placement.placing.order(moved)
    };
    Triangle {
        positions: shift(true, triangle.positions, tables.positions),
        normals: shift(has_normals, triangle.normals, tables.normals),
        texcoords: shift(has_texcoords, triangle.texcoords, tables.texcoords),
        material: placement.materials.of(triangle.material),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::files::LargeFile;
    use crate::scene::load::json::{Document, Node};
    use crate::scene::load::obj;
    use crate::scene::load::transform;

    fn assemble(text: &str, transform: &str) -> (Assembly, Vec<String>) {
        let mesh = obj::read(&LargeFile::in_memory("a.obj", text.as_bytes().into())).unwrap();
        let document = Document::new("t", transform);
        let transform = transform::read(&Node::root(&document).unwrap()).unwrap();
        let placement = Placement {
            file: "a.obj",
            mesh: &mesh,
            placing: Placing::new(transform),
            materials: ModelMaterials::uniform(5),
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
