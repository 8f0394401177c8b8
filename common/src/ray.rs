//! A ray in flight: all that any worker needs to go on with it.

use bytemuck::{Pod, Zeroable};

/// A hit primitive of [`Ray::hit_primitive`] that means "nothing so far".
pub const NO_PRIMITIVE: u32 = u32::MAX;

/// A ray in flight (the paper's (p, ω, I) of section 2, with the integers that name its place in
/// its path and its closest hit so far). 68 bytes, no padding, in the order of the wire.
///
/// A *shadow ray* uses the same record: [`Ray::throughput`] is then the contribution that it makes
/// if nothing lies nearer than [`Ray::distance`], and [`Ray::hit_primitive`] the light's own
/// primitive, which does not count as lying before itself.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Ray {
    /// Where the ray starts, in scene units.
    pub origin: [f32; 3],
    /// Where it goes; unit length.
    pub direction: [f32; 3],
    /// Product of bsdf·cos/pdf so far, per channel. For a shadow ray: throughput × radiance.
    pub throughput: [f32; 3],
    /// Distance of the closest hit so far; infinity if none. For a shadow ray: where the light is.
    pub distance: f32,
    /// The primitive hit so far, or [`NO_PRIMITIVE`]. For a shadow ray: the light's, if it has one.
    pub hit_primitive: u32,
    /// The partition that the primitive hit so far is in; of no meaning while there is none, and in
    /// shadow rays.
    pub hit_partition: u32,
    /// Index of the pixel in the full image, `x + y · width`.
    pub pixel: u32,
    /// Which of the pixel's samples this is.
    pub sample_index: u32,
    /// Names the branch of the path's tree; 0 for the camera ray and while nothing branches.
    pub branch: u32,
    /// Solid-angle density with which the direction was drawn, times the number of directions drawn
    /// with it; 0 after a camera or a specular event, where no light sample competes.
    pub pdf: f32,
    /// Scattering events so far; a camera ray has 0.
    pub depth: u16,
    /// Which share of its bundle the ray belongs to: an index into `Bundle::shares`.
    pub share: u8,
    /// Bits of [`ray_flags`].
    pub flags: u8,
}

/// The bits of [`Ray::flags`].
pub mod ray_flags {
    /// Only delta events (mirror, glass) lie between the camera and this ray.
    pub const SPECULAR_PATH: u8 = 1;
}
