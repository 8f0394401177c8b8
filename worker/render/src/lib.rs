//! Light: pure computation of radiance.

pub mod bsdf;
#[cfg(test)]
mod chi_square;
pub mod frame;
pub mod geometry;
pub mod light;
pub mod texture;
pub mod warp;
