//! Triangles one by one, for those who must not hold a model in memory.

use std::ops::ControlFlow;

use super::error::SceneError;
use super::load::Bounds;
use super::placing::Placing;
use super::{Geometry, Luminaire, NO_INDEX, Prototype, Scene, Triangle, WorldTriangle};

/// Most triangles of a scene, those of prototypes counted at each place: their numbers have 32
/// bits, and one of these means "none".
pub const TRIANGLES_MAX: u64 = u32::MAX as u64;

/// Most triangles that are shown at once.
pub(super) const BATCH_TRIANGLES: usize = 1024;

/// A prototype at one of its places.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Which prototype.
    pub prototype: usize,
    /// Where.
    pub placing: Placing,
    /// The primitive id of its first triangle here.
    pub first_primitive: u32,
}

/// All placements of prototypes: of each, its number of triangles and its placings. The ids of
/// their triangles follow those of the `loose` triangles, placement by placement.
///
/// There must be no more than [`TRIANGLES_MAX`] in all.
pub fn placements<'a>(
    loose: u64,
    prototypes: impl Iterator<Item = (u64, &'a [Placing])>,
) -> impl Iterator<Item = Placement> {
    let mut next = loose;
    let each = prototypes.enumerate().flat_map(|(prototype, (count, placings))| {
        placings.iter().map(move |&placing| (prototype, count, placing))
    });
    each.map(move |(prototype, count, placing)| {
        let first_primitive = u32::try_from(next).unwrap_or(u32::MAX);
        next += count;
        Placement { prototype, placing, first_primitive }
    })
}

/// Where the triangles of a scene come from, any number of times in the same order: a triangle's
/// position in it is its primitive id.
pub trait TriangleSource {
    /// Shows all triangles but those of prototypes in order, some at a time, until told to break
    /// off.
    ///
    /// # Errors
    /// If what they come from cannot be read any more, or is not what it was.
    fn for_each(
        &mut self,
        visit: &mut dyn FnMut(&[WorldTriangle]) -> ControlFlow<()>,
    ) -> Result<(), SceneError>;

    /// Where each prototype is placed.
    fn placings(&self) -> &[Vec<Placing>] {
        &[]
    }

    /// Shows the triangles of a prototype, in its own coordinates. For the first time, prototypes
    /// are shown in order, after all other triangles.
    ///
    /// # Errors
    /// As [`Self::for_each`].
    fn for_each_of(
        &mut self,
        _prototype: usize,
        _visit: &mut dyn FnMut(&[WorldTriangle]) -> ControlFlow<()>,
    ) -> Result<(), SceneError> {
        Ok(())
    }
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
    /// How many triangles there are, those of prototypes counted at each place.
    #[must_use]
    pub fn triangle_count(&self) -> u64 {
        let placed =
            self.prototypes.iter().map(|it| it.triangle_count() * it.placings.len() as u64);
        self.geometry.triangles.len() as u64 + placed.sum::<u64>()
    }

    /// All placements of prototypes, by ascending primitive ids.
    pub fn placements(&self) -> impl Iterator<Item = Placement> {
        let prototypes = self.prototypes.iter();
        placements(
            self.geometry.triangles.len() as u64,
            prototypes.map(|it| (it.triangle_count(), it.placings.as_slice())),
        )
    }

    /// The triangles that emit, by their primitive ids.
    #[must_use]
    pub fn luminaires(&self) -> Vec<Luminaire> {
        let luminous: Vec<Vec<Luminaire>> =
            self.prototypes.iter().map(|it| self.luminaires_of(&it.geometry)).collect();
        let placed = self.placements().flat_map(|placement| {
            luminous[placement.prototype].iter().map(move |it| it.placed(&placement))
        });
        self.luminaires_of(&self.geometry).into_iter().chain(placed).collect()
    }

    /// How many triangles emit, those of prototypes counted at each place.
    #[must_use]
    pub fn luminaire_count(&self) -> u64 {
        let count = |geometry: &Geometry| {
            let triangles = geometry.triangles.iter();
            triangles.filter(|triangle| self.tables.is_luminous(triangle.material)).count() as u64
        };
        let placed =
            self.prototypes.iter().map(|it| count(&it.geometry) * it.placings.len() as u64);
        count(&self.geometry) + placed.sum::<u64>()
    }

    fn luminaires_of(&self, geometry: &Geometry) -> Vec<Luminaire> {
        let numbered = (0u32..).zip(&geometry.triangles);
        let luminous = numbered.filter(|(_, triangle)| self.tables.is_luminous(triangle.material));
        let luminaire = |(primitive, triangle)| {
            let WorldTriangle { corners, material, .. } = geometry.world_triangle(triangle);
            Luminaire { primitive, material, corners }
        };
        luminous.map(luminaire).collect()
    }
}

impl Luminaire {
    /// What a triangle that emits becomes at a place of its prototype.
    #[must_use]
    pub fn placed(&self, placement: &Placement) -> Self {
        let Placement { placing, first_primitive, .. } = placement;
        Self {
            primitive: first_primitive + self.primitive,
            material: self.material,
            corners: placing.order(self.corners.map(|corner| placing.corner(corner))),
        }
    }
}

impl Prototype {
    /// How many triangles it has at one place.
    #[must_use]
    pub const fn triangle_count(&self) -> u64 {
        self.geometry.triangles.len() as u64
    }

    /// A box around it at each place, by least and greatest corner.
    pub fn boxes(&self) -> impl Iterator<Item = [[f32; 3]; 2]> {
        let bounds = Bounds::of(&self.geometry, &[]);
        let around = move |placing: &Placing| bounds.map(|it| placing.around([it.min, it.max]));
        self.placings.iter().filter_map(around)
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
