//! A part of the model with its own tree: what can be sent, stored and dropped as one.

mod builder;
mod image;
mod press;
mod sections;
mod tasks;

use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use equilux_common::ray::{NO_PRIMITIVE, Ray};
use equilux_common::scene::NO_INDEX;
use equilux_common::scene::placing::Placing;
use glam::Vec3;

pub use self::builder::PartitionBuilder;
pub use self::image::PartitionImage;
pub use self::press::PartitionPress;
pub use self::sections::{InvalidPartition, ModelLimits, SECTION_COUNT};
use self::tasks::{AllOccluded, Closest, ClosestOfAll, Occluded};
use super::Bounds;
use super::block::{Block, BlockWords, Lane};
use super::company::Traversal;
use super::hierarchy::{Node, Stack};
use super::placed::{Place, PlacedObjects};
use super::surface_point::SurfacePoint;
use super::table::Table;
use super::tree::{Hit, Tree};
use super::triangle::Probe;

/// [`Slot::place`] of a triangle that is where it is.
const NO_PLACE: u32 = u32::MAX;

/// Where a triangle is in a partition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slot {
    /// Its position among all triangles of the partition.
    triangle: u32,
    /// Where it is among those of its leaf.
    lane: Lane,
    /// At which place of its object; [`NO_PLACE`] if it is of none.
    place: u32,
}

/// A part of the model with its own tree.
#[derive(Debug)]
pub struct Partition {
    trees: Trees,
    /// Over the triangles that are where they are; they come before those of objects.
    tree: Tree,
    /// What is at several places, if anything is.
    placed: Option<PlacedObjects>,
    attributes: Attributes,
    /// Bounds of the whole model, by which the thickness of rays is measured.
    model_bounds: Bounds,
}

/// All trees over triangles, one after another.
#[derive(Debug)]
struct Trees {
    nodes: Table<Node>,
    triangles: Table<BlockWords>,
    /// Where each tree ends; nothing if there is only one.
    runs: Table<Run>,
}

/// How much of [`Trees`] is one tree's.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Run {
    nodes: u32,
    triangles: u32,
}

/// What shading needs to know of triangles beside their corners.
#[derive(Debug)]
struct Attributes {
    /// Each triangle's material, by its position.
    materials: Table<u32>,
    /// Each triangle's shading normals, by its position, into `normal_table`, or [`NO_INDEX`]
    /// thrice; empty if none has any.
    normals: Table<[u32; 3]>,
    /// Likewise for texture coordinates.
    texcoords: Table<[u32; 3]>,
    normal_table: Table<[f32; 3]>,
    texcoord_table: Table<[f32; 2]>,
}

impl Attributes {
    fn bytes(&self) -> usize {
        let Self { materials, normals, texcoords, normal_table, texcoord_table } = self;
        let of_triangles = size_of_val(&**materials) + size_of_val(&**normals);
        let of_texcoords = size_of_val(&**texcoords) + size_of_val(&**texcoord_table);
        of_triangles + of_texcoords + size_of_val(&**normal_table)
    }
}

impl Slot {
    /// A triangle that is where it is.
    const fn loose(Hit { triangle, lane }: Hit) -> Self {
        Self { triangle, lane, place: NO_PLACE }
    }

    /// A triangle of an object, whose first slot this is, at a place.
    #[expect(clippy::cast_possible_truncation, reason = "there are less than 2³² places")]
    pub(super) const fn placed(first: u32, hit: Hit, place: usize) -> Self {
        Self { triangle: first + hit.triangle, lane: hit.lane, place: place as u32 }
    }

    /// Where its leaf's triangles are.
    const fn leaf(self) -> Range<usize> {
        let first = (self.triangle - self.lane.number as u32) as usize;
        first..first + self.lane.count as usize
    }
}

impl Partition {
    /// How many triangles there are, those of objects counted once.
    #[must_use]
    pub fn triangle_count(&self) -> usize {
        self.attributes.materials.len()
    }

    /// How many triangles there are, those of objects counted at each place.
    #[must_use]
    pub fn primitive_count(&self) -> u64 {
        let placed = self.placed.as_ref().map_or(0, PlacedObjects::primitive_count);
        self.tree.len() as u64 + placed
    }

    /// Bytes of memory that it takes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.image().bytes()
    }

    /// How many of these are nodes and triangles: what is left without what shading alone needs.
    #[must_use]
    pub fn tree_bytes(&self) -> usize {
        self.bytes() - self.attributes.bytes()
    }

    /// Boxes that hold all triangles, and little else: at most `most`, at least one if there are
    /// triangles.
    #[must_use]
    pub fn boxes(&self, most: usize) -> Vec<Bounds> {
        self.image().boxes(most)
    }

    /// Improves the ray's closest hit so far (`distance`, `hit_primitive`) by what is found here,
    /// if anything is.
    pub fn intersect(&self, ray: &mut Ray, stack: &mut Stack) -> Option<Slot> {
        self.intersect_probed(&self.probe(ray), ray, stack)
    }

    /// [`Self::intersect`] for a ray that has been made ready.
    pub(crate) fn intersect_probed(
        &self,
        probe: &Probe,
        ray: &mut Ray,
        stack: &mut Stack,
    ) -> Option<Slot> {
        let instructions = stack.instructions;
        instructions.run(Closest { partition: self, probe, ray, stack })
    }

    /// Whether anything lies nearer than the shadow ray's `distance`, apart from the light that it
    /// goes to (`hit_primitive`).
    #[must_use]
    pub fn is_occluded(&self, ray: &Ray, stack: &mut Stack) -> bool {
        self.is_occluded_probed(&self.probe(ray), ray, stack)
    }

    /// [`Self::is_occluded`] for a ray that has been made ready.
    pub(crate) fn is_occluded_probed(&self, probe: &Probe, ray: &Ray, stack: &mut Stack) -> bool {
        let instructions = stack.instructions;
        instructions.run(Occluded { partition: self, probe, ray, stack })
    }

    /// [`Self::intersect`] for each ray of a bundle.
    pub fn intersect_all(
        &self,
        rays: &mut [Ray],
        slots: &mut [Option<Slot>],
        traversal: Traversal,
        stack: &mut Stack,
    ) {
        let instructions = stack.instructions;
        instructions.run(ClosestOfAll { partition: self, rays, slots, traversal, stack });
    }

    /// [`Self::is_occluded`] for each ray of a bundle.
    pub fn are_occluded(
        &self,
        rays: &[Ray],
        are_occluded: &mut [bool],
        traversal: Traversal,
        stack: &mut Stack,
    ) {
        let instructions = stack.instructions;
        instructions.run(AllOccluded { partition: self, rays, are_occluded, traversal, stack });
    }

    /// Where the triangle is that the ray has hit; nothing if it has hit none that is here.
    #[must_use]
    pub fn locate(&self, ray: &Ray, stack: &mut Stack) -> Option<Slot> {
        let mut again = Ray { hit_primitive: NO_PRIMITIVE, ..*ray };
        let slot = self.intersect(&mut again, stack)?;
        (again.hit_primitive == ray.hit_primitive).then_some(slot)
    }

    /// The material of a triangle.
    #[must_use]
    pub fn material(&self, slot: Slot) -> u32 {
        self.attributes.materials[slot.triangle as usize]
    }

    /// What is known of the surface where the ray has hit a triangle; nothing if the ray lies in
    /// the triangle's plane.
    #[must_use]
    pub fn surface_point(&self, ray: &Ray, slot: Slot) -> Option<SurfacePoint> {
        let index = slot.triangle as usize;
        let placing = self.place_of(slot).map(Place::placing);
        let corners = self.corners(slot);
        let weights = self.probe(ray).barycentrics(&corners)?;
        let mut point = SurfacePoint::new(&corners, weights, Vec3::from(ray.direction));
        let Attributes { normals, texcoords, normal_table, texcoord_table, .. } = &self.attributes;
        let normals = indices(normals, index)
            .map(|indices| indices.map(|index| normal_table[index as usize]))
            .and_then(|normals| placed_normals(placing.as_ref(), normals));
        let texcoords = indices(texcoords, index)
            .map(|indices| indices.map(|index| texcoord_table[index as usize]))
            .map(|texcoords| in_order(placing.as_ref(), texcoords));
        point.set_attributes(weights, normals, texcoords);
        Some(point)
    }

    /// Where the object of a triangle is, if it is of one.
    fn place_of(&self, slot: Slot) -> Option<&Place> {
        let placed = self.placed.as_ref().filter(|_| slot.place != NO_PLACE)?;
        placed.places.get(slot.place as usize)
    }

    /// A triangle's corners in the world.
    fn corners(&self, slot: Slot) -> [Vec3; 3] {
        let block = Block::new(&self.trees.triangles, slot.leaf());
        let corners = block.corners(usize::from(slot.lane.number));
        self.place_of(slot).map_or(corners, |place| place.corners(&corners))
    }

    #[inline(always)]
    fn probe(&self, ray: &Ray) -> Probe {
        Probe::new(ray, &self.model_bounds)
    }
}

/// Normals as they point where they are placed; none if one of them points nowhere.
fn placed_normals(placing: Option<&Placing>, normals: [[f32; 3]; 3]) -> Option<[Vec3; 3]> {
    let Some(placing) = placing else { return Some(normals.map(Vec3::from)) };
    let [a, b, c] = normals.map(|normal| placing.normal(normal));
    Some(placing.order([a?, b?, c?]).map(Vec3::from))
}

/// What the corners have, in the order in which the corners of a placed triangle are.
fn in_order<T>(placing: Option<&Placing>, corners: [T; 3]) -> [T; 3] {
    match placing {
        Some(placing) => placing.order(corners),
        None => corners,
    }
}

/// A triangle's indices, if it has any.
fn indices(table: &[[u32; 3]], slot: usize) -> Option<[u32; 3]> {
    table.get(slot).copied().filter(|indices| indices[0] != NO_INDEX)
}
