//! Light: pure computation of radiance.

pub mod bsdf;
pub mod frame;
pub mod light;
pub mod texture;
pub mod warp;
