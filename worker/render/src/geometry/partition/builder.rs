//! Triangles on their way into a partition.

use equilux_common::scene::placing::Placing;
use equilux_common::scene::triangles::placements;
use equilux_common::scene::{Geometry, NO_INDEX, Prototype, WorldTriangle};
use glam::Vec3;

use super::{Attributes, InvalidPartition, Partition, Run, Trees};
use crate::geometry::Bounds;
use crate::geometry::block::{BlockWords, LeafTriangle};
use crate::geometry::hierarchy::Node;
use crate::geometry::placed::{Place, PlacedObjects};
use crate::geometry::table::Table;
use crate::geometry::tree::{CAREFUL, Tree};

/// Gathers triangles for a partition.
#[derive(Debug, Default)]
pub struct PartitionBuilder {
    pub(super) triangles: Vec<LeafTriangle>,
    /// In the order of the triangles.
    pub(super) attributes: Lists,
    objects: Vec<Object>,
    recent_normals: Recent<3>,
    recent_texcoords: Recent<2>,
}

/// What is at several places.
#[derive(Debug)]
struct Object {
    /// Its first triangle; it has all from there to the next object's.
    first: usize,
    /// Each with the primitive id of its first triangle there.
    places: Vec<(Placing, u32)>,
}

/// What [`Attributes`] will have.
#[derive(Debug, Default)]
pub(super) struct Lists {
    pub(super) materials: Vec<u32>,
    pub(super) normals: Vec<[u32; 3]>,
    pub(super) texcoords: Vec<[u32; 3]>,
    pub(super) normal_table: Vec<[f32; 3]>,
    pub(super) texcoord_table: Vec<[f32; 2]>,
}

impl PartitionBuilder {
    /// Forgets all that was added, but keeps the memory; so many triangles will be added.
    pub(super) fn clear(&mut self, triangle_count: usize) {
        self.objects.clear();
        self.triangles.clear();
        self.triangles.reserve_exact(triangle_count);
        let Lists { materials, normals, texcoords, normal_table, texcoord_table } =
            &mut self.attributes;
        materials.clear();
        materials.reserve_exact(triangle_count);
        normals.clear();
        texcoords.clear();
        normal_table.clear();
        texcoord_table.clear();
        // The same triangles are to give the same tables, whatever came before.
        self.recent_normals.places.clear();
        self.recent_texcoords.places.clear();
    }

    /// Begins an object: the triangles that are added from now on are in its coordinates, and at
    /// each of these places. Their ids are less there by that which goes with the place.
    pub fn begin_object(&mut self, places: Vec<(Placing, u32)>) {
        self.objects.push(Object { first: self.triangles.len(), places });
    }

    /// Adds a triangle: its primitive id in the whole model, and what it is.
    pub fn push(&mut self, primitive: u32, triangle: &WorldTriangle) {
        let corners = triangle.corners.map(Vec3::from);
        self.triangles.push(LeafTriangle { corners, primitive });
        let before = self.attributes.materials.len();
        self.attributes.materials.push(triangle.material);
        let (recent, table) = (&mut self.recent_normals, &mut self.attributes.normal_table);
        let normals = triangle.normals.map(|normals| normals.map(|n| recent.index_of(n, table)));
        extend(&mut self.attributes.normals, before, normals);
        let (recent, table) = (&mut self.recent_texcoords, &mut self.attributes.texcoord_table);
        let texcoords = triangle.texcoords.map(|all| all.map(|t| recent.index_of(t, table)));
        extend(&mut self.attributes.texcoords, before, texcoords);
    }

    /// All of a model.
    pub(crate) fn of_model(geometry: Geometry, prototypes: Vec<Prototype>) -> Self {
        let placed = prototypes.iter().map(|it| (it.triangle_count(), it.placings.as_slice()));
        let mut places: Vec<Vec<(Placing, u32)>> = vec![Vec::new(); prototypes.len()];
        for placement in placements(geometry.triangles.len() as u64, placed) {
            places[placement.prototype].push((placement.placing, placement.first_primitive));
        }
        let mut builder = Self::of_geometry(geometry);
        for (Prototype { geometry, .. }, places) in prototypes.into_iter().zip(places) {
            builder.begin_object(places);
            for (number, triangle) in (0u32..).zip(&geometry.triangles) {
                builder.push(number, &geometry.world_triangle(triangle));
            }
        }
        builder
    }

    fn of_geometry(geometry: Geometry) -> Self {
        let Geometry { positions, normals, texcoords, triangles, .. } = geometry;
        let place = |index: u32| Vec3::from(positions[index as usize]);
        let leaf = |(primitive, triangle): (u32, &equilux_common::scene::Triangle)| LeafTriangle {
            corners: triangle.positions.map(place),
            primitive,
        };
        let has = |any: bool, of: Vec<[u32; 3]>| if any { of } else { Vec::new() };
        let attributes = Lists {
            materials: triangles.iter().map(|triangle| triangle.material).collect(),
            normals: has(!normals.is_empty(), triangles.iter().map(|t| t.normals).collect()),
            texcoords: has(!texcoords.is_empty(), triangles.iter().map(|t| t.texcoords).collect()),
            normal_table: normals,
            texcoord_table: texcoords,
        };
        let triangles = (0u32..).zip(&triangles).map(leaf).collect();
        Self { triangles, attributes, ..Self::default() }
    }

    /// How many triangles have been added.
    #[must_use]
    pub const fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    /// Builds the tree over what has been added, which may be nothing. `model_bounds` are those of
    /// the whole model: what is hit then depends on the model alone, not on how it is cut.
    #[must_use]
    pub fn build(self, model_bounds: &Bounds) -> Partition {
        let first_of_objects = self.objects.first().map_or(self.triangles.len(), |it| it.first);
        let (loose, mut order) = Tree::build(&self.triangles[..first_of_objects], CAREFUL);
        let mut built = vec![loose];
        for (number, object) in self.objects.iter().enumerate() {
            let end = self.objects.get(number + 1).map_or(self.triangles.len(), |it| it.first);
            let (tree, own) = Tree::build(&self.triangles[object.first..end], CAREFUL);
            let first = u32::try_from(object.first).expect("triangles are limited");
            order.extend(own.into_iter().map(|index| first + index));
            built.push(tree);
        }
        drop(self.triangles);
        let (trees, built) = Trees::join(built);
        let mut built = built.into_iter();
        let tree = built.next().unwrap_or_default();
        let places = places_of(&self.objects);
        let is_placed = !self.objects.is_empty();
        let placed = is_placed.then(|| PlacedObjects::build(tree.len(), built.collect(), &places));
        let Lists { materials, normals, texcoords, normal_table, texcoord_table } = self.attributes;
        let attributes = Attributes {
            materials: in_order(&materials, &order).into(),
            normals: in_order(&normals, &order).into(),
            texcoords: in_order(&texcoords, &order).into(),
            normal_table: normal_table.into(),
            texcoord_table: texcoord_table.into(),
        };
        Partition { trees, tree, placed, attributes, model_bounds: *model_bounds }
    }
}

fn places_of(objects: &[Object]) -> Vec<Place> {
    let mut places = Vec::new();
    for (number, object) in (0u32..).zip(objects) {
        let at = |(placing, first): &(Placing, u32)| Place::new(placing, *first, number);
        places.extend(object.places.iter().map(at));
    }
    places
}

impl Trees {
    /// Lays trees one after another; gives them as they are there.
    fn join(trees: Vec<Tree>) -> (Self, Vec<Tree>) {
        if let [tree] = trees.as_slice() {
            let (nodes, triangles) = (tree.hierarchy().nodes().clone(), tree.triangles().clone());
            return (Self { nodes, triangles, runs: Table::default() }, trees);
        }
        let run = |tree: &Tree| Run {
            nodes: u32::try_from(tree.hierarchy().nodes().len()).expect("nodes are limited"),
            triangles: u32::try_from(tree.len()).expect("triangles are limited"),
        };
        let runs: Vec<Run> = trees.iter().map(run).collect();
        let nodes: Vec<Node> =
            trees.iter().flat_map(|tree| tree.hierarchy().nodes().iter().copied()).collect();
        let triangles: Vec<BlockWords> =
            trees.iter().flat_map(|tree| tree.triangles().iter().copied()).collect();
        drop(trees);
        let joined = Self { nodes: nodes.into(), triangles: triangles.into(), runs: runs.into() };
        let trees = joined.split().expect("they were trees before");
        (joined, trees)
    }

    /// The trees, in order: there is at least one.
    pub(super) fn split(&self) -> Result<Vec<Tree>, InvalidPartition> {
        let whole = [Run {
            nodes: u32::try_from(self.nodes.len()).unwrap_or(u32::MAX),
            triangles: u32::try_from(self.triangles.len()).unwrap_or(u32::MAX),
        }];
        let runs = if self.runs.is_empty() { &whole[..] } else { &self.runs };
        let (mut node, mut triangle) = (0usize, 0usize);
        let mut trees = Vec::with_capacity(runs.len());
        for run in runs {
            let (nodes, triangles) =
                (node..node + run.nodes as usize, triangle..triangle + run.triangles as usize);
            (node, triangle) = (nodes.end, triangles.end);
            let is_there = node <= self.nodes.len() && triangle <= self.triangles.len();
            if !is_there || nodes.is_empty() != triangles.is_empty() {
                return Err(InvalidPartition::Lengths);
            }
            trees.push(Tree::from_parts(self.nodes.slice(nodes), self.triangles.slice(triangles))?);
        }
        let is_all = node == self.nodes.len() && triangle == self.triangles.len();
        if is_all { Ok(trees) } else { Err(InvalidPartition::Lengths) }
    }
}

impl Partition {
    /// A whole model in one partition.
    #[must_use]
    pub fn new(geometry: Geometry) -> Self {
        let model_bounds = Bounds::of_model(&geometry, &[]);
        PartitionBuilder::of_model(geometry, Vec::new()).build(&model_bounds)
    }
}

/// Adds a triangle's indices to a list that stays empty as long as no triangle has any.
fn extend(list: &mut Vec<[u32; 3]>, before: usize, indices: Option<[u32; 3]>) {
    if indices.is_some() && list.is_empty() {
        list.resize(before, [NO_INDEX; 3]);
    }
    if indices.is_some() || !list.is_empty() {
        list.push(indices.unwrap_or([NO_INDEX; 3]));
    }
}

fn in_order<T: Copy>(list: &[T], order: &[u32]) -> Vec<T> {
    if list.is_empty() {
        return Vec::new();
    }
    order.iter().map(|&index| list[index as usize]).collect()
}

/// Entries of [`Recent`]: corners of neighboring triangles come close after one another.
const RECENT: usize = 1 << 14;

/// Where values of a table were put lately, so that most are put there once: a place for each hash.
#[derive(Debug)]
struct Recent<const N: usize> {
    /// Indices into the table; empty until the first value comes.
    places: Vec<u32>,
}

impl<const N: usize> Default for Recent<N> {
    fn default() -> Self {
        Self { places: Vec::new() }
    }
}

impl<const N: usize> Recent<N> {
    /// The index of a value in the table; adds it unless it is known.
    fn index_of(&mut self, value: [f32; N], table: &mut Vec<[f32; N]>) -> u32 {
        if self.places.is_empty() {
            self.places.resize(RECENT, NO_INDEX);
        }
        let bits = value.map(f32::to_bits);
        let place = &mut self.places[place_of(&bits)];
        let is_known = |known: &[f32; N]| known.map(f32::to_bits) == bits;
        if !table.get(*place as usize).is_some_and(is_known) {
            *place = u32::try_from(table.len()).expect("three for each of less than 2³⁰ triangles");
            table.push(value);
        }
        *place
    }
}

fn place_of(bits: &[u32]) -> usize {
    let mixed = bits.iter().fold(0u64, |hash, &bits| {
        (hash ^ u64::from(bits)).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(23)
    });
    mixed as usize % RECENT
}
