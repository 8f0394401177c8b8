//! Partitions for files, pressed one after another out of the same memory.

use equilux_common::scene::WorldTriangle;

use super::builder::Lists;
use super::{PartitionBuilder, PartitionImage};
use crate::geometry::Bounds;
use crate::geometry::block::{BlockWords, lay_blocks};
use crate::geometry::hierarchy::{HierarchyBuilder, leaves};

/// Makes partitions that are written and not traced: their trees are built in less time, and rays
/// take a little more of it.
#[derive(Default)]
pub struct PartitionPress {
    gathered: PartitionBuilder,
    hierarchy: HierarchyBuilder,
    /// What has an entry per triangle, in the order of the leaves.
    triangles: Vec<BlockWords>,
    materials: Vec<u32>,
    normals: Vec<[u32; 3]>,
    texcoords: Vec<[u32; 3]>,
}

impl PartitionPress {
    /// Begins a partition of so many triangles.
    pub fn begin(&mut self, triangle_count: usize) {
        self.gathered.clear(triangle_count);
    }

    /// Adds a triangle: its primitive id in the whole model, and what it is.
    pub fn push(&mut self, primitive: u32, triangle: &WorldTriangle) {
        self.gathered.push(primitive, triangle);
    }

    /// Makes the partition of what has been added since it was begun, which may be nothing.
    pub fn press(&mut self) -> PartitionImage<'_> {
        let PartitionBuilder { triangles, attributes, .. } = &self.gathered;
        let bounds = triangles.iter().map(|triangle| Bounds::around(triangle.corners));
        self.hierarchy.build(bounds);
        let order = self.hierarchy.order();
        lay_blocks(leaves(self.hierarchy.nodes()), triangles, order, &mut self.triangles);
        put_in_order(&mut self.materials, &attributes.materials, order);
        put_in_order(&mut self.normals, &attributes.normals, order);
        put_in_order(&mut self.texcoords, &attributes.texcoords, order);
        let Lists { normal_table, texcoord_table, .. } = &self.gathered.attributes;
        PartitionImage {
            sections: [
                bytemuck::cast_slice(self.hierarchy.nodes()),
                bytemuck::cast_slice(&self.triangles),
                bytemuck::cast_slice(&self.materials),
                bytemuck::cast_slice(&self.normals),
                bytemuck::cast_slice(&self.texcoords),
                bytemuck::cast_slice(normal_table),
                bytemuck::cast_slice(texcoord_table),
                &[],
                &[],
                &[],
            ],
            triangle_count: self.triangles.len(),
            primitive_count: self.triangles.len() as u64,
            loose: self.hierarchy.nodes(),
            placed: &[],
        }
    }
}

/// Fills a list anew, with the entries of another one in some order; it stays empty if that is.
fn put_in_order<T: Copy>(target: &mut Vec<T>, list: &[T], order: &[u32]) {
    target.clear();
    if !list.is_empty() {
        target.reserve_exact(order.len());
        target.extend(order.iter().map(|&index| list[index as usize]));
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn any_triangle() -> impl Strategy<Value = WorldTriangle> {
        let number = || (0i8..5).prop_map(f32::from);
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

    fn pressed(press: &mut PartitionPress, triangles: &[WorldTriangle]) -> Vec<Vec<u8>> {
        press.begin(triangles.len());
        (0u32..).zip(triangles).for_each(|(primitive, triangle)| press.push(primitive, triangle));
        press.press().sections().map(<[u8]>::to_vec).to_vec()
    }

    proptest! {
        #[test]
        fn a_partition_does_not_depend_on_those_before_it(
            before in prop::collection::vec(any_triangle(), 0..60),
            triangles in prop::collection::vec(any_triangle(), 0..60),
        ) {
            let mut press = PartitionPress::default();
            pressed(&mut press, &before);
            let expected = pressed(&mut PartitionPress::default(), &triangles);
            prop_assert_eq!(pressed(&mut press, &triangles), expected);
        }
    }
}
