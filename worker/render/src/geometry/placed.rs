//! Objects at several places: a tree over the places, and under it one tree for each object.
//!
//! Triangles are tested where they are: their corners are moved into the world and rounded as they
//! would be if the model were placed when it is read, so a hit is the same to the bit. Only boxes
//! are tested in the object's own coordinates, against a ray that is moved there and made thick by
//! all that is rounded on the way. A hit must also lie within the interval that this ray spends in
//! the triangle's own box, so that no tree over the object's triangles, or over a part of them,
//! culls a hit that counts.

use bytemuck::{Pod, Zeroable};
use equilux_common::ray::Ray;
use equilux_common::scene::placing::{Placing, Transform};
use glam::{DVec3, Vec3};

use super::Bounds;
use super::block::Block;
use super::hierarchy::{Hierarchy, Stack};
use super::lanes::Lanes;
use super::partition::Slot;
use super::slab::{Slab, thickness};
use super::table::Table;
use super::thick_ray::ThickRay;
use super::tree::{CAREFUL, Frame, Tree};
use super::triangle::Probe;

/// Bound on what rounding moves a corner, a ray's origin or a point on it by, over the magnitudes
/// that go into it: 2⁻²².
const ROUNDING: f32 = 1.0 / 4_194_304.0;

/// Factor on the thickness of a ray, for what is rounded when the thickness itself is found.
const SLACK: f32 = 1.01;

/// An object at a place.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Place {
    transform: Transform,
    /// The inverse of its linear part.
    inverse: [[f32; 3]; 3],
    /// The primitive id of the object's first triangle here.
    first_primitive: u32,
    /// Which object of the partition.
    pub(super) object: u32,
    /// 1 if the transform mirrors, 0 if it does not.
    is_mirroring: u32,
}

/// The objects of a partition, and their places.
#[derive(Debug)]
pub(super) struct PlacedObjects {
    pub(super) hierarchy: Hierarchy,
    /// In the order of the hierarchy's leaves.
    pub(super) places: Table<Place>,
    pub(super) objects: Vec<PlacedObject>,
}

/// An object in its own coordinates.
#[derive(Debug)]
pub(super) struct PlacedObject {
    pub(super) tree: Tree,
    /// Its first triangle's position among all of the partition.
    pub(super) first_slot: u32,
}

impl Place {
    /// An object, the ids of whose triangles begin with this one here.
    pub(super) fn new(placing: &Placing, first_primitive: u32, object: u32) -> Self {
        let transform = *placing.transform();
        #[expect(clippy::cast_possible_truncation, reason = "rounded; the ray is thick enough")]
        let inverse = transform.inverse().map(|row| row.map(|entry| entry as f32));
        let is_mirroring = u32::from(transform.is_mirroring());
        Self { transform, inverse, first_primitive, object, is_mirroring }
    }

    /// Whether it could have been made of its transform, and rays can be moved by that.
    pub(super) fn is_sound(&self) -> bool {
        let made = Self::new(&self.placing(), self.first_primitive, self.object);
        self.transform.is_reversible() && bytemuck::bytes_of(&made) == bytemuck::bytes_of(self)
    }

    /// The transform with what else there is to know of it.
    pub(super) fn placing(&self) -> Placing {
        Placing::new(self.transform)
    }

    /// The id that a triangle of the object has here.
    #[inline]
    pub(super) const fn primitive(&self, local: u32) -> u32 {
        self.first_primitive.wrapping_add(local)
    }

    /// Whether ids of all triangles up to this one are below a count.
    pub(super) fn is_within(&self, last: u32, count: u64) -> bool {
        u64::from(self.first_primitive) + u64::from(last) < count
    }

    /// A triangle's corners in the world.
    #[inline]
    pub(super) fn corners(&self, corners: &[Vec3; 3]) -> [Vec3; 3] {
        let [a, b, c] = corners.map(|corner| Vec3::from(self.transform.corner(corner.into())));
        if self.is_mirroring == 0 { [a, b, c] } else { [a, c, b] }
    }

    /// A box around what lies within these bounds of the object.
    pub(super) fn around(&self, bounds: &Bounds) -> Bounds {
        let [lower, upper] = self.placing().around([bounds.lower.into(), bounds.upper.into()]);
        Bounds { lower: lower.into(), upper: upper.into() }
    }

    /// A ray in the coordinates of the object, made thick by what may be wrong with corners and
    /// points in the world.
    #[inline]
    fn slab(&self, probe: &Probe, error: Vec3) -> Slab {
        let rows = self.inverse.map(Vec3::from);
        let moved = probe.origin.as_dvec3() - DVec3::from(self.transform.translation);
        let origin = rows.map(|row| row.as_dvec3().dot(moved)).map(|entry| entry as f32);
        let direction = rows.map(|row| row.dot(probe.direction));
        let error = error + moved.as_vec3().abs() * ROUNDING;
        let thickness = rows.map(|row| row.abs().dot(error) * SLACK);
        Slab::thick(origin.into(), direction.into(), thickness.into())
    }
}

impl PlacedObject {
    /// Objects with these trees, which follow one with `loose` triangles.
    pub(super) fn of_trees(loose: usize, trees: Vec<Tree>) -> Vec<Self> {
        let mut first = loose;
        let object = |tree: Tree| {
            let first_slot = u32::try_from(first).expect("triangles are limited");
            first += tree.len();
            Self { tree, first_slot }
        };
        trees.into_iter().map(object).collect()
    }
}

impl PlacedObjects {
    /// Builds the tree over places of objects. Their trees follow one with `loose` triangles.
    pub(super) fn build(loose: usize, trees: Vec<Tree>, places: &[Place]) -> Self {
        let objects = PlacedObject::of_trees(loose, trees);
        let bounds: Vec<Bounds> = objects.iter().map(|object| object.tree.bounds()).collect();
        // What has no triangles has no bounds either, and is nowhere.
        let is_there = |place: &&Place| objects[place.object as usize].tree.len() > 0;
        let places: Vec<Place> = places.iter().filter(is_there).copied().collect();
        let around = |place: &Place| place.around(&bounds[place.object as usize]);
        let (hierarchy, order) = Hierarchy::build(places.iter().map(around), CAREFUL);
        let places: Vec<Place> = order.iter().map(|&index| places[index as usize]).collect();
        Self { hierarchy, places: places.into(), objects }
    }

    /// Triangles, counted at each place.
    pub(super) fn primitive_count(&self) -> u64 {
        let count = |place: &Place| self.objects[place.object as usize].tree.len() as u64;
        self.places.iter().map(count).sum()
    }

    /// Improves the ray's closest hit, if it can; says where that is.
    #[inline(always)]
    pub(super) fn closest<L: Lanes>(
        &self,
        lanes: L,
        (probe, model_bounds): (&Probe, &Bounds),
        ray: &mut Ray,
        stack: &mut Stack,
    ) -> Option<Slot> {
        let error = error_in_world(probe, model_bounds);
        let mut found = None;
        let (outer, inner) = stack.split();
        let thick = ThickRay::new(lanes, &probe.slab);
        let mut walk = self.hierarchy.walk(lanes, &thick, outer);
        while let Some(leaf) = walk.next_leaf(ray.distance) {
            for place in leaf {
                let moved = Moved::new(&self.places[place], probe, error);
                let object = &self.objects[moved.place.object as usize];
                let thick = ThickRay::new(lanes, &moved.slab);
                if let Some(hit) = object.tree.closest(lanes, (&moved, &thick), ray, inner) {
                    found = Some(Slot::placed(object.first_slot, hit, place));
                }
            }
        }
        found
    }

    /// Whether any triangle but `ray.hit_primitive` is nearer than `ray.distance`.
    #[inline(always)]
    pub(super) fn is_occluded<L: Lanes>(
        &self,
        lanes: L,
        (probe, model_bounds): (&Probe, &Bounds),
        ray: &Ray,
        stack: &mut Stack,
    ) -> bool {
        let error = error_in_world(probe, model_bounds);
        let (outer, inner) = stack.split();
        let thick = ThickRay::new(lanes, &probe.slab);
        let mut walk = self.hierarchy.walk_unordered(lanes, (&thick, ray.distance), outer);
        while let Some(leaf) = walk.next_leaf() {
            for place in &self.places[leaf] {
                let moved = Moved::new(place, probe, error);
                let object = &self.objects[place.object as usize];
                let thick = ThickRay::new(lanes, &moved.slab);
                if object.tree.is_occluded(lanes, (&moved, &thick), ray, inner) {
                    return true;
                }
            }
        }
        false
    }
}

/// What may be wrong with a triangle test in the world, and with the corners that it is given.
fn error_in_world(probe: &Probe, model_bounds: &Bounds) -> Vec3 {
    let farthest = model_bounds.lower.abs().max(model_bounds.upper.abs()).max_element();
    thickness(probe.origin, model_bounds) * 2.0 + Vec3::splat(farthest * ROUNDING)
}

/// A ray that is moved into the coordinates of an object.
struct Moved<'a> {
    place: &'a Place,
    probe: &'a Probe,
    slab: Slab,
}

impl<'a> Moved<'a> {
    #[inline]
    fn new(place: &'a Place, probe: &'a Probe, error: Vec3) -> Self {
        Self { place, probe, slab: place.slab(probe, error) }
    }
}

impl Frame for Moved<'_> {
    #[inline(always)]
    fn primitive(&self, local: u32) -> u32 {
        self.place.primitive(local)
    }

    #[inline(always)]
    fn candidates<L: Lanes>(
        &self,
        lanes: L,
        ray: &ThickRay,
        block: &Block<'_>,
        farthest: f32,
    ) -> u32 {
        let (x, y, z) = (around(lanes, block, 0), around(lanes, block, 1), around(lanes, block, 2));
        let bounds = [[x.0, y.0, z.0], [x.1, y.1, z.1]];
        ray.meets(lanes, &bounds, farthest) & ((1 << block.len()) - 1)
    }

    #[inline(always)]
    fn distance(&self, corners: &[Vec3; 3], farthest: f32) -> Option<f32> {
        let (near, far) = self.slab.interval_around(corners);
        if !(near <= far && near <= farthest) {
            return None;
        }
        self.probe.distance(&self.place.corners(corners), (near, far), farthest)
    }
}

/// The bounds of each triangle on an axis.
#[inline(always)]
fn around<L: Lanes>(lanes: L, block: &Block<'_>, axis: usize) -> (L::Floats, L::Floats) {
    let a = lanes.load_some(block.coordinates(0, axis));
    let b = lanes.load_some(block.coordinates(1, axis));
    let c = lanes.load_some(block.coordinates(2, axis));
    (lanes.min(a, lanes.min(b, c)), lanes.max(a, lanes.max(b, c)))
}
