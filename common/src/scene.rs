//! A scene in memory: what the readers make of the user's files and what light is computed from.
//!
//! Everything is in world space, checked, and in an order that depends on the files alone. Colours
//! are linear with Rec. 709 primaries, angles are gone, indices are in range, vertices are finite.

use bytemuck::{Pod, Zeroable};

pub mod camera;
pub mod describe;
pub mod error;
pub mod files;
pub mod load;
pub mod placing;
pub mod triangles;

pub use load::stream;
use serde::{Deserialize, Serialize};

use self::placing::Placing;

/// A scene, ready to be rendered.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Triangles and what they are made of, but for those of prototypes.
    pub geometry: Geometry,
    /// Models that are placed several times.
    pub prototypes: Vec<Prototype>,
    /// What all parts of the geometry share.
    pub tables: Tables,
}

/// A model that is placed several times and kept once, in its own coordinates.
#[derive(Clone, Debug)]
pub struct Prototype {
    /// Its triangles, in its own coordinates. There is at least one.
    pub geometry: Geometry,
    /// Where it is placed.
    pub placings: Vec<Placing>,
}

/// What all parts of a scene's geometry share, however it is cut.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tables {
    /// Materials, by [`Triangle::material`].
    pub materials: Vec<Material>,
    /// Textures, by the texture indices in materials.
    pub textures: Vec<Texture>,
    /// Light from everywhere.
    pub environment: Environment,
}

impl Tables {
    /// Whether triangles of a material emit.
    #[must_use]
    pub fn is_luminous(&self, material: u32) -> bool {
        self.materials[material as usize].emission != [0.0; 3]
    }
}

/// A triangle on its own, in world space, with all that shading needs: what models are streamed as.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorldTriangle {
    /// Corners, counter-clockwise seen from the side that the face normal points to.
    pub corners: [[f32; 3]; 3],
    /// Shading normals at the corners, unit length, if it has any.
    pub normals: Option<[[f32; 3]; 3]>,
    /// Texture coordinates at the corners, v up, if it has any.
    pub texcoords: Option<[[f32; 2]; 3]>,
    /// Its material, into [`Tables::materials`].
    pub material: u32,
}

/// An index that means "none" in [`Triangle::normals`] and [`Triangle::texcoords`].
pub const NO_INDEX: u32 = u32::MAX;

/// Triangles over shared vertex tables. A triangle's position in `triangles` is its primitive id,
/// or that less the first one of a [`Placement`](triangles::Placement).
#[derive(Clone, Debug, Default)]
pub struct Geometry {
    /// Vertex positions.
    pub positions: Vec<[f32; 3]>,
    /// Shading normals, unit length.
    pub normals: Vec<[f32; 3]>,
    /// Texture coordinates, v up.
    pub texcoords: Vec<[f32; 2]>,
    /// The triangles.
    pub triangles: Vec<Triangle>,
    /// What the user would call objects: named runs of triangles, in order, without gaps.
    pub objects: Vec<Object>,
}

/// A triangle by its corners, counter-clockwise seen from the side that its face normal points to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Triangle {
    /// Corners, into [`Geometry::positions`].
    pub positions: [u32; 3],
    /// Shading normals at the corners, or [`NO_INDEX`] thrice.
    pub normals: [u32; 3],
    /// Texture coordinates at the corners, or [`NO_INDEX`] thrice.
    pub texcoords: [u32; 3],
    /// Its material, into [`Tables::materials`].
    pub material: u32,
}

/// A triangle that emits: every machine needs to know all of them, wherever their partitions are.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Luminaire {
    /// Its primitive id.
    pub primitive: u32,
    /// Its material, into [`Tables::materials`].
    pub material: u32,
    /// Its corners, as in [`WorldTriangle::corners`].
    pub corners: [[f32; 3]; 3],
}

/// A named run of triangles.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Object {
    /// Its name in the file.
    pub name: String,
    /// Its first triangle.
    pub first_triangle: u32,
    /// How many triangles it has.
    pub triangle_count: u32,
}

/// What a surface is made of. Every surface reflects on both sides.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// Its name in the file.
    pub name: String,
    /// Radiance (W·m⁻²·sr⁻¹ per channel) that leaves the side the face normal points to. A material
    /// that emits reflects nothing.
    pub emission: [f32; 3],
    /// How it reflects and transmits.
    pub surface: Surface,
    /// Fraction of light that does not pass straight through, 0 to 1.
    pub opacity: f32,
}

/// How a surface scatters light.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Surface {
    /// `diffuse`/π plus `specular` × D·G/(4 cos cos), with the isotropic GGX distribution of
    /// `alpha`, Smith's G and no Fresnel term; no gloss where `specular` is zero.
    Plain {
        /// Albedo of the diffuse part; multiplied by the texture where there is one.
        diffuse: [f32; 3],
        /// Texture of the diffuse part.
        diffuse_texture: Option<u32>,
        /// Reflectance of the gloss.
        specular: [f32; 3],
        /// Its roughness, Walter et al. 2007's α.
        alpha: f32,
    },
    /// A perfect mirror, without Fresnel term.
    Mirror {
        /// Fraction reflected.
        reflectance: [f32; 3],
    },
    /// Smooth glass: reflects and refracts by Fresnel's equations.
    Glass {
        /// Index of refraction of the inside (where the face normal does not point), over 1.
        ior: f32,
        /// Fraction of refracted light that is let through.
        transmittance: [f32; 3],
    },
    /// The metallic-roughness model of MTL's PBR extension: a diffuse base under a GGX coat of
    /// reflectance F₀ = 4% for dielectrics, `base` for metals, with Schlick's Fresnel term.
    Pbr {
        /// Base colour; multiplied by the texture where there is one.
        base: [f32; 3],
        /// Texture of the base colour.
        base_texture: Option<u32>,
        /// Perceptual roughness; GGX's α is its square.
        roughness: f32,
        /// 0 dielectric, 1 metal.
        metallic: f32,
    },
}

/// An image that is wrapped around things: bilinear, repeating, v up, linear colour.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Its file, for messages.
    pub name: String,
    /// Width in texels.
    pub width: u32,
    /// Height in texels.
    pub height: u32,
    /// Texels row by row, the top row first.
    pub texels: Texels,
}

/// The texels of a texture in the form that takes the least memory.
#[derive(Clone, Debug, PartialEq)]
pub enum Texels {
    /// Eight bits per channel, sRGB transfer curve; decoded when looked up.
    Srgb8(Vec<[u8; 3]>),
    /// Linear.
    Linear(Vec<[f32; 3]>),
}

/// Light that comes from where there is no surface.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Environment {
    /// None: black.
    #[default]
    Black,
    /// The same radiance from everywhere.
    Constant {
        /// W·m⁻²·sr⁻¹ per channel.
        radiance: [f32; 3],
    },
    /// An image in latitude and longitude: its middle is toward −z, its top toward +y.
    Image {
        /// The image, into [`Tables::textures`]; linear.
        texture: u32,
        /// Factor on its radiance.
        scale: f32,
        /// Turn about +y in degrees, counter-clockwise seen from above.
        rotation: f32,
    },
}
