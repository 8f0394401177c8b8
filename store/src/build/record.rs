//! Triangles as they lie in spool files: each says only what those before it have not said.
//!
//! Neighbors in a mesh share corners and come close after one another, so a corner is mostly a byte
//! that tells where in a small table of recent ones it is; primitive ids ascend, and materials
//! seldom change. A triangle of a closed mesh takes a dozen bytes instead of 44. Whoever writes and
//! whoever reads remember the same: all that went by in a file, from its beginning.
//!
//! A record begins with 16 bits that tell what it has; then come the primitive id, the material,
//! the corners, normals and texture coordinates. Spool files never leave the machine, so its byte
//! order will do.

use std::io::{self, Read};

use bytemuck::{bytes_of, bytes_of_mut};
use equilux_common::scene::WorldTriangle;

/// The primitive id is not one more than the last.
const HAS_PRIMITIVE: u16 = 1;

/// The material is not the last one.
const HAS_MATERIAL: u16 = 1 << 1;

/// It has normals.
const HAS_NORMALS: u16 = 1 << 2;

/// It has texture coordinates.
const HAS_TEXCOORDS: u16 = 1 << 3;

/// The first of three bits that tell which corners are new.
const NEW_CORNERS: u32 = 4;

/// Likewise for normals.
const NEW_NORMALS: u32 = 7;

/// Likewise for texture coordinates.
const NEW_TEXCOORDS: u32 = 10;

/// Bytes of the largest record.
pub(super) const RECORD_BYTES_MAX: usize = 2 + 4 + 4 + 36 + 36 + 24;

/// What was said so far in a file: some 3 KiB, 8 KiB if triangles have all there is.
#[derive(Debug, Default)]
pub(super) struct Memory {
    primitive: u32,
    material: u32,
    corners: Recent<3>,
    normals: Recent<3>,
    texcoords: Recent<2>,
}

impl Memory {
    /// Appends a record.
    pub(super) fn write(
        &mut self,
        records: &mut Vec<u8>,
        primitive: u32,
        triangle: &WorldTriangle,
    ) {
        let begin = records.len();
        let mut flags = 0;
        records.extend_from_slice(&[0; 2]);
        if primitive != self.primitive.wrapping_add(1) {
            flags |= HAS_PRIMITIVE;
            records.extend_from_slice(bytes_of(&primitive));
        }
        if triangle.material != self.material {
            flags |= HAS_MATERIAL;
            records.extend_from_slice(bytes_of(&triangle.material));
        }
        (self.primitive, self.material) = (primitive, triangle.material);
        flags |= self.corners.write(records, &triangle.corners) << NEW_CORNERS;
        if let Some(normals) = &triangle.normals {
            flags |= HAS_NORMALS | self.normals.write(records, normals) << NEW_NORMALS;
        }
        if let Some(texcoords) = &triangle.texcoords {
            flags |= HAS_TEXCOORDS | self.texcoords.write(records, texcoords) << NEW_TEXCOORDS;
        }
        records[begin..begin + 2].copy_from_slice(bytes_of(&flags));
    }

    /// Takes a record off the front.
    pub(super) fn read(&mut self, records: &mut &[u8]) -> io::Result<(u32, WorldTriangle)> {
        let mut flags = 0u16;
        records.read_exact(bytes_of_mut(&mut flags))?;
        self.primitive = self.primitive.wrapping_add(1);
        if flags & HAS_PRIMITIVE != 0 {
            records.read_exact(bytes_of_mut(&mut self.primitive))?;
        }
        if flags & HAS_MATERIAL != 0 {
            records.read_exact(bytes_of_mut(&mut self.material))?;
        }
        let corners = self.corners.read(records, flags >> NEW_CORNERS)?;
        let mut triangle =
            WorldTriangle { corners, normals: None, texcoords: None, material: self.material };
        if flags & HAS_NORMALS != 0 {
            triangle.normals = Some(self.normals.read(records, flags >> NEW_NORMALS)?);
        }
        if flags & HAS_TEXCOORDS != 0 {
            triangle.texcoords = Some(self.texcoords.read(records, flags >> NEW_TEXCOORDS)?);
        }
        Ok((self.primitive, triangle))
    }
}

/// Entries of [`Recent`]: a place is told by one byte.
const RECENT: usize = 256;

/// Values that went by lately, each at the place that its hash says.
#[derive(Debug, Default)]
struct Recent<const N: usize> {
    /// None until the first value comes; zeros before anything is put there.
    values: Vec<[f32; N]>,
}

impl<const N: usize> Recent<N> {
    /// Appends the places of three values, or the values themselves if they are new; three bits for
    /// which are.
    #[inline]
    fn write(&mut self, records: &mut Vec<u8>, values: &[[f32; N]; 3]) -> u16 {
        let mut new = 0;
        for (bit, value) in values.iter().enumerate() {
            let place = place_of(value);
            let known = &mut self.values()[usize::from(place)];
            if known.map(f32::to_bits) == value.map(f32::to_bits) {
                records.push(place);
            } else {
                *known = *value;
                records.extend_from_slice(bytemuck::cast_slice(value));
                new |= 1 << bit;
            }
        }
        new
    }

    #[inline]
    fn read(&mut self, records: &mut &[u8], new: u16) -> io::Result<[[f32; N]; 3]> {
        let mut values = [[0.0; N]; 3];
        for (bit, value) in values.iter_mut().enumerate() {
            if new & (1 << bit) == 0 {
                let mut place = 0u8;
                records.read_exact(bytes_of_mut(&mut place))?;
                *value = self.values()[usize::from(place)];
            } else {
                records.read_exact(bytemuck::cast_slice_mut(value))?;
                self.values()[usize::from(place_of(value))] = *value;
            }
        }
        Ok(values)
    }

    #[inline]
    fn values(&mut self) -> &mut [[f32; N]; RECENT] {
        if self.values.is_empty() {
            self.values.resize(RECENT, [0.0; N]);
        }
        self.values.first_chunk_mut().expect("it has just as many")
    }
}

#[inline]
fn place_of<const N: usize>(value: &[f32; N]) -> u8 {
    let mixed = value.iter().fold(0u64, |hash, component| {
        (hash ^ u64::from(component.to_bits())).wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(23)
    });
    mixed as u8
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn any_triangle() -> impl Strategy<Value = WorldTriangle> {
        let number = || prop_oneof![(-2i8..3).prop_map(f32::from), Just(-0.0), Just(f32::MAX)];
        let vectors = move || prop::array::uniform3(prop::array::uniform3(number()));
        let texcoords = prop::array::uniform3(prop::array::uniform2(number()));
        (vectors(), prop::option::of(vectors()), prop::option::of(texcoords), 0u32..3).prop_map(
            |(corners, normals, texcoords, material)| WorldTriangle {
                corners,
                normals,
                texcoords,
                material,
            },
        )
    }

    proptest! {
        #[test]
        fn what_is_read_is_to_the_bit_what_was_written(
            triangles in prop::collection::vec((any_triangle(), 0u32..3), 0..200),
        ) {
            let (mut memory, mut records, mut primitive) = (Memory::default(), Vec::new(), 0);
            for (triangle, step) in &triangles {
                primitive += step;
                let begin = records.len();
                memory.write(&mut records, primitive, triangle);
                prop_assert!(records.len() - begin <= RECORD_BYTES_MAX);
            }
            let (mut memory, mut records, mut primitive) = (Memory::default(), &records[..], 0);
            for (triangle, step) in &triangles {
                primitive += step;
                let (found_primitive, found) = memory.read(&mut records).unwrap();
                prop_assert_eq!(found_primitive, primitive);
                // Minus zero equals zero, but is another number.
                prop_assert_eq!(format!("{found:?}"), format!("{triangle:?}"));
            }
            prop_assert!(records.is_empty());
            prop_assert!(memory.read(&mut records).is_err());
        }
    }

    #[test]
    fn a_triangle_of_a_mesh_takes_a_dozen_bytes() {
        let corner = |x: u16, z: u16| [f32::from(x), 0.3, f32::from(z)];
        let (mut memory, mut records) = (Memory::default(), Vec::new());
        for number in 0..2000u16 {
            let (x, z) = (number % 40, number / 40);
            let corners = [corner(x, z), corner(x, z + 1), corner(x + 1, z)];
            let triangle = WorldTriangle { corners, normals: None, texcoords: None, material: 1 };
            memory.write(&mut records, u32::from(number), &triangle);
        }
        assert!(records.len() < 2000 * 20, "{}", records.len());
    }
}
