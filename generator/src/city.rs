//! The city: a downtown at the end of an avenue, late on a sunny day, of any size.
//!
//! It is too large for memory, so it is never held: a [`City`] is a plan of some thousand blocks,
//! and writing it builds one block after the other and hands out the bytes of its files as they
//! come. With more triangles the city is first larger, and then finer: window frames, sills,
//! balconies with their bars, kerb stones, paving, leaves. Nothing is cut up only to be more.
//!
//! From the bottom up: `finish` is what things are made of, `mesh` turns them into bytes, `layout`
//! says where they are. `style`, `facade`, `roof` and `building`, `car`, `tree` and `street` build
//! them, `block` puts them together, `plan` decides how much there is of everything. `sky`, `ply`
//! and `scene_file` write what is not triangles.

mod block;
mod building;
mod car;
mod facade;
mod finish;
mod layout;
mod mesh;
mod plan;
mod ply;
mod roof;
mod scene_file;
mod sky;
mod street;
mod style;
#[cfg(test)]
mod tests;
mod tree;

use std::ops::ControlFlow;

use finish::Finish;
use mesh::{Mesh, Pass, SHEET};
use plan::Plot;

/// Fewest triangles of a city.
pub const CITY_TRIANGLES_MIN: u64 = 1_000;

/// Most triangles of a city: 20 GB.
pub const CITY_TRIANGLES_MAX: u64 = 1_000_000_000;

/// How far the ground reaches in every direction, and how far it lies below the streets.
const HORIZON: (f64, f64) = (9_600.0, 0.4);

/// How fine a block is built.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Detail {
    /// Boxes.
    Massing,
    /// Boxes of glass with bands around each floor; bare streets with cars.
    Bands,
    /// Windows in depth; machines on the roofs, lamps.
    Grid,
    /// Sills, blinds, bars; kerb stones.
    Windows,
    /// Frames, curtains, balconies, bricks, paving.
    Fine,
}

/// All of them, in their order.
const DETAILS: [Detail; 5] =
    [Detail::Massing, Detail::Bands, Detail::Grid, Detail::Windows, Detail::Fine];

/// A number of triangles that no city can be made of.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the triangles of a city must be from {CITY_TRIANGLES_MIN} to {CITY_TRIANGLES_MAX}, not {given}; \
     choose a number in that range"
)]
pub struct InvalidTriangles {
    /// The number that was given.
    pub given: u64,
}

/// A file of a city.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CityFile {
    /// Its name, relative to the scene's directory; without separators.
    pub name: String,
    /// Its size.
    pub bytes: u64,
}

/// A city that can be written.
#[derive(Clone, Debug)]
pub struct City {
    plots: Vec<Plot>,
    /// The finishes in use, with their vertices and faces, in the order of their files.
    parts: Vec<(Finish, (u64, u64))>,
    scene_json: String,
    sky: Vec<u8>,
}

impl City {
    /// Plans a city of at most `triangles` triangles, and fewer by at most one if there are trees
    /// in it, as there are from some ten thousand triangles on. That takes a few seconds for the
    /// largest.
    ///
    /// # Errors
    /// If there are fewer than [`CITY_TRIANGLES_MIN`] or more than [`CITY_TRIANGLES_MAX`].
    pub fn new(triangles: u64) -> Result<Self, InvalidTriangles> {
        if !(CITY_TRIANGLES_MIN..=CITY_TRIANGLES_MAX).contains(&triangles) {
            return Err(InvalidTriangles { given: triangles });
        }
        // One quad is the horizon.
        let plots = plan::plots(triangles / mesh::QUAD_TRIANGLES - 1);
        let counts = plan::counts(&plots);
        let parts = Finish::ALL.into_iter().zip(counts).filter(|(_, (_, faces))| *faces > 0);
        let parts: Vec<_> = parts.collect();
        let scene_json = scene_file::json(parts.iter().map(|(finish, _)| *finish));
        Ok(Self { plots, parts, scene_json, sky: sky::exr() })
    }

    /// How many triangles it has.
    #[must_use]
    pub fn triangle_count(&self) -> u64 {
        self.parts.iter().map(|(_, (_, faces))| faces * mesh::QUAD_TRIANGLES).sum()
    }

    /// How many of them emit.
    #[must_use]
    pub fn emitter_count(&self) -> u64 {
        let emitting = self.parts.iter().filter(|(finish, _)| finish.emits());
        emitting.map(|(_, (_, faces))| faces * mesh::QUAD_TRIANGLES).sum()
    }

    /// Its files; the scene file is the last.
    #[must_use]
    pub fn files(&self) -> Vec<CityFile> {
        let file =
            |name: &str, bytes: usize| CityFile { name: name.to_owned(), bytes: bytes as u64 };
        let models = self.parts.iter().map(|(finish, counts)| {
            let header = ply::header(finish.name(), *counts).len() as u64;
            CityFile { name: finish.file(), bytes: header + ply::body_bytes(*counts) }
        });
        let others = [file(sky::FILE, self.sky.len()), file("scene.json", self.scene_json.len())];
        models.chain(others).collect()
    }

    /// Hands out the bytes of all files, in pieces of some dozen KiB: `sink` is told which of
    /// [`City::files`] a piece continues. The pieces of a file come in their order, those of
    /// different files in turns.
    ///
    /// # Errors
    /// The first one of `sink`; nothing is handed out after it.
    pub fn write<E>(&self, mut sink: impl FnMut(usize, &[u8]) -> Result<(), E>) -> Result<(), E> {
        for (index, (finish, counts)) in self.parts.iter().enumerate() {
            sink(index, ply::header(finish.name(), *counts).as_bytes())?;
        }
        for pass in [Pass::Vertices, Pass::Faces] {
            self.write_pass(pass, &mut sink)?;
        }
        let first = self.parts.len();
        let others = [(first, &self.sky[..]), (first + 1, self.scene_json.as_bytes())];
        for (index, bytes) in others {
            bytes.chunks(mesh::CHUNK_BYTES).try_for_each(|chunk| sink(index, chunk))?;
        }
        Ok(())
    }

    fn write_pass<E>(
        &self,
        pass: Pass,
        sink: &mut impl FnMut(usize, &[u8]) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut result = Ok(());
        let mut outlet = |finish: Finish, bytes: &[u8]| {
            let index = self.parts.partition_point(|(other, _)| *other < finish);
            result = sink(index, bytes);
            if result.is_ok() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        let mut mesh = Mesh::writing(pass, &mut outlet);
        for plot in &self.plots {
            if mesh.is_stopped() {
                break;
            }
            plot.build(&mut mesh);
        }
        horizon(&mut mesh);
        mesh.finish();
        drop(mesh);
        result
    }
}

/// The ground as far as one can see.
fn horizon(mesh: &mut Mesh) {
    let (reach, depth) = HORIZON;
    let side = (-reach, reach);
    mesh.block(Finish::Ground, &building::WORLD, [side, (-depth, -depth), side], SHEET);
}
