//! Triangles one by one, for those who must not hold a model in memory.

use std::ops::ControlFlow;

use super::error::SceneError;
use super::{Geometry, Luminaire, NO_INDEX, Scene, Triangle, WorldTriangle};

/// Most triangles that are shown at once.
pub(super) const BATCH_TRIANGLES: usize = 1024;

/// Where the triangles of a scene come from, any number of times in the same order: a triangle's
/// position in it is its primitive id.
pub trait TriangleSource {
    /// Shows all triangles in order, some at a time, until told to break off.
    ///
    /// # Errors
    /// If what they come from cannot be read any more, or is not what it was.
    fn for_each(
        &mut self,
        visit: &mut dyn FnMut(&[WorldTriangle]) -> ControlFlow<()>,
    ) -> Result<(), SceneError>;
}

impl TriangleSource for &Geometry {
    fn for_each(
        &mut self,
        visit: &mut dyn FnMut(&[WorldTriangle]) -> ControlFlow<()>,
    ) -> Result<(), SceneError> {
        let mut batch = Vec::with_capacity(BATCH_TRIANGLES);
        for triangles in self.triangles.chunks(BATCH_TRIANGLES) {
            batch.clear();
            batch.extend(triangles.iter().map(|triangle| self.world_triangle(triangle)));
            if visit(&batch).is_break() {
                break;
            }
        }
        Ok(())
    }
}

impl Scene {
    /// The triangles that emit, by their primitive ids.
    #[must_use]
    pub fn luminaires(&self) -> Vec<Luminaire> {
        let numbered = (0u32..).zip(&self.geometry.triangles);
        let luminous = numbered.filter(|(_, triangle)| self.tables.is_luminous(triangle.material));
        let luminaire = |(primitive, triangle)| {
            let WorldTriangle { corners, material, .. } = self.geometry.world_triangle(triangle);
            Luminaire { primitive, material, corners }
        };
        luminous.map(luminaire).collect()
    }
}

impl Geometry {
    /// One of its triangles on its own.
    #[must_use]
    pub fn world_triangle(&self, triangle: &Triangle) -> WorldTriangle {
        let has_normals = triangle.normals[0] != NO_INDEX;
        let has_texcoords = triangle.texcoords[0] != NO_INDEX;
        WorldTriangle {
            corners: triangle.positions.map(|index| self.positions[index as usize]),
            normals: has_normals.then(|| triangle.normals.map(|at| self.normals[at as usize])),
            texcoords: has_texcoords
                .then(|| triangle.texcoords.map(|at| self.texcoords[at as usize])),
            material: triangle.material,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_triangles_come_in_order_until_it_is_enough() {
        let triangle = |material| Triangle {
            positions: [0, 1, 2],
            normals: [2, 1, 0],
            texcoords: [NO_INDEX; 3],
            material,
        };
        let count = 3 * u32::try_from(BATCH_TRIANGLES).expect("few") / 2;
        let geometry = Geometry {
            positions: vec![[0.0; 3], [1.0; 3], [2.0; 3]],
            normals: vec![[3.0; 3], [4.0; 3], [5.0; 3]],
            triangles: (0..count).map(triangle).collect(),
            ..Geometry::default()
        };
        let mut seen = Vec::new();
        (&geometry)
            .for_each(&mut |batch| {
                seen.extend_from_slice(batch);
                ControlFlow::Continue(())
            })
            .expect("it is in memory");
        let materials: Vec<u32> = seen.iter().map(|triangle| triangle.material).collect();
        assert_eq!(materials, (0..count).collect::<Vec<_>>());
        assert_eq!(seen[0].corners, [[0.0; 3], [1.0; 3], [2.0; 3]]);
        assert_eq!(seen[0].normals, Some([[5.0; 3], [4.0; 3], [3.0; 3]]));
        assert_eq!(seen[0].texcoords, None);

        let mut batches = 0;
        let broken_off = (&geometry).for_each(&mut |_| {
            batches += 1;
            ControlFlow::Break(())
        });
        assert!(broken_off.is_ok() && batches == 1);
    }
}
