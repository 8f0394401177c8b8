//! The shipped scenes as programs: a name and a size go in, the text of files comes out.
//!
//! Everything is a pure function of the size: no file, clock or environment is read, the disorder
//! on the desks comes from hashed constants (`random`), and numbers are written in fixed point
//! (`number`). So the files are the same bytes on every machine, and those in `scenes/` can be
//! checked against the program that made them.
//!
//! From the bottom up: `vector` and `frame` place, `shape` builds primitive shapes,
//! `material` names what they are made of, `model` writes them as OBJ, `stage` holds a scene
//! in the making. Above stand the rooms: `office`, `bathroom` and `cornell`. The `city` stands
//! beside them: it is too large to be held, and is handed out as it is built.

mod bathroom;
mod city;
mod cornell;
mod files;
mod frame;
mod material;
mod model;
mod number;
mod office;
mod random;
mod shape;
mod stage;
mod vector;

#[cfg(test)]
mod obj_check;

pub use city::{CITY_TRIANGLES_MAX, CITY_TRIANGLES_MIN, City, CityFile, InvalidTriangles};
pub use cornell::cornell_box;
pub use files::{Counts, File, Files};

/// Largest size factor of [`office()`]: 833,536 objects in about 350 MB of text.
pub const OFFICE_SIZE_MAX: u32 = 256;

/// Largest size factor of [`bathroom()`]: over a million objects in about 240 MB of text.
pub const BATHROOM_SIZE_MAX: u32 = 64;

/// Objects per unit of size that do not emit in [`office()`]; the number is that of the office in
/// Heirich and Arvo 1996.
pub const OFFICE_OBJECTS: u64 = 3_256;

/// Light sources per unit of size in [`office()`], likewise.
pub const OFFICE_LIGHTS: u64 = 3;

/// Objects that do not emit in [`bathroom()`] of size 1; the number is that of the bathroom in
/// Heirich and Arvo 1996.
pub const BATHROOM_OBJECTS: u64 = 18_012;

/// Light sources per unit of size in [`bathroom()`], likewise.
pub const BATHROOM_LIGHTS: u64 = 4;

/// A size factor that no scene can be made for.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the size of {scene} must be from 1 to {most}, not {size}; choose one in that range")]
pub struct InvalidSize {
    /// The scene that was asked for.
    pub scene: &'static str,
    /// The size that was given.
    pub size: u32,
    /// The largest one possible.
    pub most: u32,
}

/// Makes an office of `size` bays in a row, each with [`OFFICE_OBJECTS`] objects and
/// [`OFFICE_LIGHTS`] light sources.
///
/// # Errors
/// If `size` is 0 or more than [`OFFICE_SIZE_MAX`].
pub fn office(size: u32) -> Result<Files, InvalidSize> {
    check("office", size, OFFICE_SIZE_MAX)?;
    Ok(office::build(size))
}

/// Makes a bathroom of `size` bays in a row. That of size 1 has [`BATHROOM_OBJECTS`] objects;
/// larger ones have about as many per bay, and [`BATHROOM_LIGHTS`] light sources in each.
///
/// # Errors
/// If `size` is 0 or more than [`BATHROOM_SIZE_MAX`].
pub fn bathroom(size: u32) -> Result<Files, InvalidSize> {
    check("bathroom", size, BATHROOM_SIZE_MAX)?;
    Ok(bathroom::build(size))
}

fn check(scene: &'static str, size: u32, most: u32) -> Result<(), InvalidSize> {
    if (1..=most).contains(&size) { Ok(()) } else { Err(InvalidSize { scene, size, most }) }
}
