//! Faces of a model turned into triangles of the scene, one at a time.

use std::ops::ControlFlow;

use super::vertices::Vertices;
use crate::scene::WorldTriangle;
use crate::scene::error::SceneError;
use crate::scene::load::judging::{Verdict, judge};
use crate::scene::load::materials::ModelMaterials;
use crate::scene::load::mesh::{Face, Reply};
use crate::scene::load::polygon;
use crate::scene::load::warnings::{Warnings, bad_vertices};
use crate::scene::placing::Placing;
use crate::scene::triangles::{BATCH_TRIANGLES, TRIANGLES_MAX};

/// What a pass over a scene has come upon.
#[derive(Debug, Default)]
pub(super) struct Tally {
    /// Triangles that were shown.
    pub(super) kept: u64,
    /// Triangles and faces without area.
    pub(super) degenerate: u64,
    pub(super) has_light: bool,
    /// Whether there are more triangles than may be shown.
    pub(super) is_overfull: bool,
    pub(super) warnings: Warnings,
}

/// Shows triangles, some at a time.
pub(super) struct Showing<'a> {
    pub(super) visit: &'a mut dyn FnMut(&[WorldTriangle]) -> ControlFlow<()>,
    /// Which materials emit.
    pub(super) emits: &'a [bool],
    pub(super) waiting: Vec<WorldTriangle>,
    pub(super) tally: Tally,
}

impl Showing<'_> {
    #[inline]
    fn push(&mut self, triangle: WorldTriangle) -> ControlFlow<()> {
        self.tally.has_light |= self.emits[triangle.material as usize];
        self.waiting.push(triangle);
        if self.waiting.len() < BATCH_TRIANGLES { ControlFlow::Continue(()) } else { self.flush() }
    }

    /// Shows those that wait.
    pub(super) fn flush(&mut self) -> ControlFlow<()> {
        if self.waiting.is_empty() {
            return ControlFlow::Continue(());
        }
        let kept = self.tally.kept + self.waiting.len() as u64;
        if kept > TRIANGLES_MAX {
            self.tally.is_overfull = true;
            return ControlFlow::Break(());
        }
        self.tally.kept = kept;
        let flow = (self.visit)(&self.waiting);
        self.waiting.clear();
        flow
    }
}

/// Places one model.
pub(super) struct Placer<'a, 'b> {
    file: &'a str,
    placing: Placing,
    materials: &'a ModelMaterials,
    vertices: Vertices<'a>,
    showing: &'b mut Showing<'a>,
    /// The number and name of the object that is going by, and its triangles with bad corners.
    object: u64,
    name: String,
    bad: u64,
    points: Vec<[f64; 3]>,
    cut: Vec<[usize; 3]>,
}

impl<'a, 'b> Placer<'a, 'b> {
    pub(super) fn new(
        file: &'a str,
        placing: Placing,
        materials: &'a ModelMaterials,
        vertices: Vertices<'a>,
        showing: &'b mut Showing<'a>,
    ) -> Self {
        Self {
            file,
            placing,
            materials,
            vertices,
            showing,
            object: 0,
            name: String::new(),
            bad: 0,
            points: Vec::new(),
            cut: Vec::new(),
        }
    }

    /// Cuts a face into triangles and shows those that stay.
    #[inline]
    pub(super) fn face(&mut self, face: &Face<'_>) -> Result<Reply, SceneError> {
        if face.part.object != self.object || self.name.is_empty() {
            self.begin_object(face);
        }
        if face.positions.len() == 3 {
            return self.triangle(face, [0, 1, 2]);
        }
        self.polygon(face)
    }

    fn polygon(&mut self, face: &Face<'_>) -> Result<Reply, SceneError> {
        self.points.clear();
        for &index in face.positions {
            self.points.push(self.vertices.raw_position(index)?.map(f64::from));
        }
        self.cut.clear();
        let points = &self.points;
        if !polygon::triangulate(points.len(), |number| points[number], &mut self.cut) {
            return Ok(Reply::TooConcave);
        }
        for at in 0..self.cut.len() {
            if self.triangle(face, self.cut[at])? == Reply::Enough {
                return Ok(Reply::Enough);
            }
        }
        Ok(Reply::Next)
    }

    /// Shows the triangle of these corners of a face, if it stays.
    #[inline]
    fn triangle(&mut self, face: &Face<'_>, numbers: [usize; 3]) -> Result<Reply, SceneError> {
        let [a, b, c] = numbers.map(|number| face.positions[number]);
        let vertices = &mut self.vertices;
        let corners = [vertices.position(a)?, vertices.position(b)?, vertices.position(c)?];
        let corners = match judge(corners) {
            Verdict::Kept(corners) => self.placing.order(corners),
            Verdict::Degenerate => {
                self.showing.tally.degenerate += 1;
                return Ok(Reply::Next);
            }
            Verdict::Bad => {
                self.bad += 1;
                return Ok(Reply::Next);
            }
        };
        let triangle = WorldTriangle {
            corners,
            normals: self.normals(face, numbers)?,
            texcoords: self.texcoords(face, numbers)?,
            material: self.materials.of(face.part.material),
        };
        Ok(match self.showing.push(triangle) {
            ControlFlow::Continue(()) => Reply::Next,
            ControlFlow::Break(()) => Reply::Enough,
        })
    }

    /// The normals at the corners, if all of them can be used.
    #[inline]
    fn normals(
        &mut self,
        face: &Face<'_>,
        numbers: [usize; 3],
    ) -> Result<Option<[[f32; 3]; 3]>, SceneError> {
        if face.normals.is_empty() {
            return Ok(None);
        }
        let mut normals = [[0.0; 3]; 3];
        for (normal, number) in normals.iter_mut().zip(numbers) {
            let Some(placed) = self.vertices.normal(face.normals[number])? else {
                return Ok(None);
            };
            *normal = placed;
        }
        Ok(Some(self.placing.order(normals)))
    }

    #[inline]
    fn texcoords(
        &mut self,
        face: &Face<'_>,
        numbers: [usize; 3],
    ) -> Result<Option<[[f32; 2]; 3]>, SceneError> {
        if face.texcoords.is_empty() {
            return Ok(None);
        }
        let mut texcoords = [[0.0; 2]; 3];
        for (texcoord, number) in texcoords.iter_mut().zip(numbers) {
            *texcoord = self.vertices.texcoord(face.texcoords[number])?;
        }
        Ok(Some(self.placing.order(texcoords)))
    }

    #[cold]
    fn begin_object(&mut self, face: &Face<'_>) {
        self.warn();
        self.object = face.part.object;
        self.name.clone_from(&face.part.name);
    }

    fn warn(&mut self) {
        let bad = std::mem::take(&mut self.bad);
        self.showing.tally.warnings.extend(bad_vertices(self.file, &self.name, bad));
    }

    /// Tells what was wrong with the model, once all of it was shown.
    pub(super) fn finish(mut self) -> Result<u64, SceneError> {
        self.warn();
        Ok(self.vertices.count_lost_texcoords()?)
    }
}
