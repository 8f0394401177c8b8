//! What is being built, quad by quad, on its way to the files.
//!
//! A PLY file has its vertices before its faces and both counts before either, and a city does not
//! fit in memory. So it is built three times over by the same code: once to count, once for the
//! vertices, once for the faces. A mesh knows which of these is going on, and hands out bytes as
//! soon as there are some for a file; what it holds is counts.
//!
//! There are only quads: two triangles each.

use std::ops::ControlFlow;

use super::finish::Finish;
use crate::frame::{Frame, sin_cos};
use crate::vector::{Vector, vector};

/// Bytes of a vertex: three floats.
pub(super) const VERTEX_BYTES: u64 = 12;

/// Bytes of a face: the number of its corners, and four of their indices.
pub(super) const FACE_BYTES: u64 = 17;

/// Triangles of a quad.
pub(super) const QUAD_TRIANGLES: u64 = 2;

/// Bytes of one file that are handed out together: these, and those of the thing that made them
/// that many.
pub(super) const CHUNK_BYTES: usize = 64 << 10;

/// Most sides of a prism.
const PRISM_SIDES_MAX: usize = 16;

/// What a round of building is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pass {
    Count,
    Vertices,
    Faces,
}

/// From where to where, along one axis.
pub(super) type Span = (f64, f64);

/// Corners of a quad, counter-clockwise seen from outside.
pub(super) type Quad = [u8; 4];

// Corner i of a block has the upper end of x, y, z where i has bit 0, 1, 2.
const FRONT: Quad = [4, 5, 7, 6];
const BACK: Quad = [1, 0, 2, 3];
const RIGHT: Quad = [5, 1, 3, 7];
const LEFT: Quad = [0, 4, 6, 2];
const TOP: Quad = [6, 7, 3, 2];
const BOTTOM: Quad = [0, 1, 5, 4];

/// All sides of a block.
pub(super) const SOLID: &[Quad] = &[FRONT, BACK, RIGHT, LEFT, TOP, BOTTOM];
/// A block that stands on something.
pub(super) const STANDING: &[Quad] = &[FRONT, BACK, RIGHT, LEFT, TOP];
/// A block whose back is against a wall.
pub(super) const MOUNTED: &[Quad] = &[FRONT, RIGHT, LEFT, TOP, BOTTOM];
/// An upright one against a wall, whose ends are hidden.
pub(super) const POST: &[Quad] = &[FRONT, RIGHT, LEFT];
/// A level one against a wall, whose ends are hidden.
pub(super) const RAIL: &[Quad] = &[FRONT, TOP, BOTTOM];
/// A wall that stands on a roof, whose ends are hidden.
pub(super) const RIDGE: &[Quad] = &[FRONT, BACK, TOP];
/// An upright one that stands free.
pub(super) const RING: &[Quad] = &[FRONT, BACK, RIGHT, LEFT];
/// A level bar that hangs free, along x.
pub(super) const BAR: &[Quad] = &[FRONT, BACK, TOP, BOTTOM];
/// What lies flat.
pub(super) const SHEET: &[Quad] = &[TOP];
/// What is flat against a wall.
pub(super) const PANE: &[Quad] = &[FRONT];
/// What shines down.
pub(super) const CEILING: &[Quad] = &[BOTTOM];

/// How many there are of something, and how many of those are still to be chosen: for a fixed
/// number of choices spread over all (Knuth's selection sampling, algorithm S).
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Quota {
    pub(super) wanted: u64,
    pub(super) left: u64,
}

impl Quota {
    /// Whether the next one is chosen, given an even number in [0, 1).
    pub(super) fn draw(&mut self, unit: f64) -> bool {
        let is_chosen = self.left as f64 * unit < self.wanted as f64;
        self.left = self.left.saturating_sub(1);
        self.wanted -= u64::from(is_chosen && self.wanted > 0);
        is_chosen
    }

    /// The even share of the next one.
    pub(super) fn share(&mut self) -> u64 {
        let share = self.wanted / self.left.max(1);
        self.left = self.left.saturating_sub(1);
        self.wanted -= share;
        share
    }
}

/// What was built, in numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Tally {
    pub(super) quads: u64,
    /// Quads that emit, among them.
    pub(super) emitters: u64,
    /// Windows that could be lit.
    pub(super) windows: u64,
    /// Trees that could have leaves.
    pub(super) trees: u64,
}

/// One file in the making.
#[derive(Clone, Debug, Default)]
struct Part {
    vertices: u64,
    faces: u64,
    bytes: Vec<u8>,
}

/// Where the bytes of a file go; it may break off the building.
pub(super) type Outlet<'a> = dyn FnMut(Finish, &[u8]) -> ControlFlow<()> + 'a;

/// All files in the making.
pub(super) struct Mesh<'a> {
    pass: Pass,
    outlet: Option<&'a mut Outlet<'a>>,
    is_stopped: bool,
    parts: Vec<Part>,
    windows: u64,
    trees: u64,
    /// Windows that are to be lit, of those to come.
    pub(super) lit: Quota,
    /// Leaves to be hung, and the trees to come.
    pub(super) leaves: Quota,
}

impl<'a> Mesh<'a> {
    /// One that only counts.
    pub(super) fn counting() -> Self {
        Self::new(Pass::Count, None)
    }

    /// One that hands out vertices or faces.
    pub(super) fn writing(pass: Pass, outlet: &'a mut Outlet<'a>) -> Self {
        Self::new(pass, Some(outlet))
    }

    fn new(pass: Pass, outlet: Option<&'a mut Outlet<'a>>) -> Self {
        Self {
            pass,
            outlet,
            is_stopped: false,
            parts: vec![Part::default(); Finish::ALL.len()],
            windows: 0,
            trees: 0,
            lit: Quota::default(),
            leaves: Quota::default(),
        }
    }

    /// Adds quads over `count` points, which are asked for only if their coordinates matter.
    pub(super) fn put(
        &mut self,
        finish: Finish,
        count: usize,
        point: impl Fn(usize) -> Vector,
        quads: &[Quad],
    ) {
        let part = &mut self.parts[finish as usize];
        match self.pass {
            Pass::Count => {}
            Pass::Vertices => (0..count).for_each(|index| part.push_vertex(point(index))),
            Pass::Faces => quads.iter().for_each(|quad| part.push_face(quad)),
        }
        part.vertices += count as u64;
        part.faces += quads.len() as u64;
        if part.bytes.len() >= CHUNK_BYTES {
            self.flush(finish);
        }
    }

    /// Adds `count` quads that share no points; their corners are asked for only if they matter.
    pub(super) fn strew(
        &mut self,
        finish: Finish,
        count: u64,
        mut corners: impl FnMut() -> [Vector; 4],
    ) {
        if self.pass == Pass::Count {
            let part = &mut self.parts[finish as usize];
            part.vertices += 4 * count;
            part.faces += count;
            return;
        }
        for _ in 0..count {
            let corners =
                if self.pass == Pass::Vertices { corners() } else { [vector(0.0, 0.0, 0.0); 4] };
            self.put(finish, 4, |i| corners[i], &[[0, 1, 2, 3]]);
        }
    }

    /// A block within three spans of a frame's axes, with some of its sides.
    pub(super) fn block(&mut self, finish: Finish, at: &Frame, spans: [Span; 3], sides: &[Quad]) {
        let [x, y, z] = spans;
        self.put(finish, 8, |i| at.point(corner(i, x, y, z)), sides);
    }

    /// A block whose top differs from its bottom in x and z.
    pub(super) fn tapered(
        &mut self,
        finish: Finish,
        at: &Frame,
        (bottom, top, y): ([Span; 2], [Span; 2], Span),
        sides: &[Quad],
    ) {
        let ring = |i: usize| if i & 2 == 0 { bottom } else { top };
        self.put(finish, 8, |i| at.point(corner(i, ring(i)[0], y, ring(i)[1])), sides);
    }

    /// A round thing about a frame's y axis with an even number of sides, as wide as `radii` at its
    /// lower and upper end; without a bottom.
    pub(super) fn prism(
        &mut self,
        finish: Finish,
        at: &Frame,
        (sides, radii, y): (usize, (f64, f64), Span),
    ) {
        assert!(sides % 2 == 0 && (4..=PRISM_SIDES_MAX).contains(&sides), "{sides} sides");
        let mut quads = [[0; 4]; PRISM_SIDES_MAX + PRISM_SIDES_MAX / 2];
        let mut count = 0;
        let mut add = |corners: [usize; 4]| {
            quads[count] = corners.map(|corner| corner as u8);
            count += 1;
        };
        // The points run from +x to +z, which is clockwise seen from above.
        for side in 0..sides {
            let next = (side + 1) % sides;
            add([side, side + sides, next + sides, next]);
        }
        for step in (1..sides - 1).step_by(2) {
            add([0, step + 2, step + 1, step].map(|corner| sides + corner));
        }
        let point = |i: usize| {
            let (radius, y) = if i < sides { (radii.0, y.0) } else { (radii.1, y.1) };
            let (sin, cos) = sin_cos(360.0 * (i % sides) as f64 / sides as f64);
            at.point(vector(radius * cos, y, radius * sin))
        };
        self.put(finish, 2 * sides, point, &quads[..count]);
    }

    /// A square bar between two points, without ends.
    pub(super) fn rod(&mut self, finish: Finish, (from, to): (Vector, Vector), radii: (f64, f64)) {
        let at = Frame::along(from, to);
        let ring = |radius: f64| [(-radius, radius); 2];
        let length = (to - from).length();
        self.tapered(finish, &at, (ring(radii.0), ring(radii.1), (0.0, length)), RING);
    }

    /// Tells of a window that could be lit, and whether it is.
    pub(super) fn window(&mut self, unit: f64) -> bool {
        self.windows += 1;
        self.lit.draw(unit)
    }

    /// Tells of a tree, and how many leaves it has.
    pub(super) fn tree(&mut self) -> u64 {
        self.trees += 1;
        self.leaves.share()
    }

    /// Vertices and faces of a finish, so far.
    pub(super) fn counts(&self, finish: Finish) -> (u64, u64) {
        let part = &self.parts[finish as usize];
        (part.vertices, part.faces)
    }

    /// Everything so far.
    pub(super) fn tally(&self) -> Tally {
        let faces = |finish: &Finish| self.counts(*finish).1;
        Tally {
            quads: Finish::ALL.iter().map(faces).sum(),
            emitters: Finish::ALL.iter().filter(|finish| finish.emits()).map(faces).sum(),
            windows: self.windows,
            trees: self.trees,
        }
    }

    /// Whether the outlet broke off; nothing more is handed out then.
    pub(super) const fn is_stopped(&self) -> bool {
        self.is_stopped
    }

    /// Hands out what is left.
    pub(super) fn finish(&mut self) {
        Finish::ALL.into_iter().for_each(|finish| self.flush(finish));
    }

    fn flush(&mut self, finish: Finish) {
        let bytes = &mut self.parts[finish as usize].bytes;
        if let (Some(outlet), false) = (&mut self.outlet, bytes.is_empty() || self.is_stopped) {
            self.is_stopped = outlet(finish, bytes).is_break();
        }
        bytes.clear();
    }
}

impl Part {
    fn push_vertex(&mut self, point: Vector) {
        for coordinate in [point.x, point.y, point.z] {
            self.bytes.extend_from_slice(&(coordinate as f32).to_le_bytes());
        }
    }

    /// Appends a face; its corners count from the vertices so far.
    fn push_face(&mut self, quad: &Quad) {
        let mut bytes = [4; FACE_BYTES as usize];
        for (place, &corner) in bytes[1..].chunks_exact_mut(4).zip(quad) {
            // A finish of the largest city has some hundred million vertices.
            place.copy_from_slice(&((self.vertices + u64::from(corner)) as u32).to_le_bytes());
        }
        self.bytes.extend_from_slice(&bytes);
    }
}

/// Corner `index` of a block.
fn corner(index: usize, x: Span, y: Span, z: Span) -> Vector {
    let end = |span: Span, bit: usize| if index & bit == 0 { span.0 } else { span.1 };
    vector(end(x, 1), end(y, 2), end(z, 4))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The quads of what is built, as points.
    fn quads(build: impl Fn(&mut Mesh)) -> Vec<[Vector; 4]> {
        let bytes = |pass| {
            let mut bytes = Vec::new();
            let mut outlet = |_, chunk: &[u8]| {
                bytes.extend_from_slice(chunk);
                ControlFlow::Continue(())
            };
            let mut mesh = Mesh::writing(pass, &mut outlet);
            build(&mut mesh);
            mesh.finish();
            drop(mesh);
            bytes
        };
        let floats = bytes(Pass::Vertices);
        let floats: Vec<f64> = floats
            .chunks_exact(4)
            .map(|four| f64::from(f32::from_le_bytes(four.try_into().unwrap())))
            .collect();
        let points: Vec<Vector> =
            floats.chunks_exact(3).map(|xyz| vector(xyz[0], xyz[1], xyz[2])).collect();
        let faces = bytes(Pass::Faces);
        let corner = |four: &[u8]| points[u32::from_le_bytes(four.try_into().unwrap()) as usize];
        faces
            .chunks_exact(17)
            .map(|face| {
                assert_eq!(face[0], 4);
                std::array::from_fn(|i| corner(&face[1 + 4 * i..5 + 4 * i]))
            })
            .collect()
    }

    /// Six times the volume within.
    fn volume(quads: &[[Vector; 4]]) -> f64 {
        quads.iter().map(|[a, b, c, d]| a.dot(b.cross(*c)) + a.dot(c.cross(*d))).sum()
    }

    #[test]
    fn blocks_and_prisms_face_outward() {
        let at = Frame::at(5.0, 6.0, -7.0).turned(30.0).tilted(10.0);
        let spans = [(1.0, 3.0), (-1.0, 2.0), (0.0, 4.0)];
        let block = quads(|mesh| mesh.block(Finish::Steel, &at, spans, SOLID));
        assert!((volume(&block) / 6.0 - 24.0).abs() < 1e-3);
        let square = [(-1.0, 1.0); 2];
        let shape = (square, square, (0.0, 3.0));
        let block = quads(|mesh| mesh.tapered(Finish::Steel, &at, shape, SOLID));
        assert!((volume(&block) / 6.0 - 12.0).abs() < 1e-3);
        // A prism has no bottom; about the origin, that adds nothing to the volume.
        let at = Frame::at(0.0, 0.0, 0.0);
        let prism = quads(|mesh| mesh.prism(Finish::Steel, &at, (16, (1.0, 1.0), (0.0, 2.0))));
        assert_eq!(prism.len(), 16 + 7);
        assert!((volume(&prism) / 6.0 / (2.0 * std::f64::consts::PI) - 1.0).abs() < 0.03);
    }

    #[test]
    fn every_pass_counts_the_same() {
        let tallies = [Pass::Count, Pass::Vertices, Pass::Faces].map(|pass| {
            let mut mesh = Mesh::new(pass, None);
            let at = Frame::at(0.0, 0.0, 0.0);
            mesh.block(Finish::Lamp, &at, [(0.0, 1.0); 3], STANDING);
            mesh.prism(Finish::Bark, &at, (6, (1.0, 0.5), (0.0, 1.0)));
            (mesh.tally(), mesh.counts(Finish::Bark))
        });
        assert_eq!(tallies[0].0, Tally { quads: 5 + 8, emitters: 5, windows: 0, trees: 0 });
        assert!(tallies.iter().all(|tally| *tally == tallies[0]));
    }

    #[test]
    fn a_quota_is_met_exactly() {
        let mut quota = Quota { wanted: 7, left: 40 };
        let mut random = crate::random::Random::new(1, 1);
        let chosen = (0..40).filter(|_| quota.draw(random.unit())).count();
        assert_eq!(chosen, 7);
        let mut quota = Quota { wanted: 100, left: 7 };
        assert_eq!((0..7).map(|_| quota.share()).sum::<u64>(), 100);
    }

    #[test]
    fn bytes_come_in_small_pieces_until_the_outlet_breaks_off() {
        let mut pieces = Vec::new();
        let mut outlet = |_, bytes: &[u8]| {
            pieces.push(bytes.len());
            if pieces.len() < 3 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        let mut mesh = Mesh::writing(Pass::Vertices, &mut outlet);
        for _ in 0..5000 {
            mesh.block(Finish::Steel, &Frame::at(0., 0., 0.), [(0.0, 1.0); 3], SOLID);
        }
        assert!(mesh.is_stopped());
        drop(mesh);
        assert_eq!(pieces.len(), 3);
        assert!(pieces.iter().all(|&piece| piece < CHUNK_BYTES + 200), "{pieces:?}");
    }
}
