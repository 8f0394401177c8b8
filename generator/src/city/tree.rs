//! Trees: a trunk that forks, and as many leaves as are left over for it.
//!
//! Leaves are what fills a city up to the number of triangles that was asked for. Few of them are
//! large and many are small, so that a tree is as dense with any number.

use super::Detail;
use super::finish::Finish;
use super::mesh::Mesh;
use crate::frame::Frame;
use crate::random::Random;
use crate::vector::{Vector, vector};

/// Area of all leaves of a tree, in parts of its crown's radius squared.
const LEAF_AREA: f64 = 11.0;
/// Largest length of a leaf.
const LEAF_LENGTH_MAX: f64 = 1.4;
/// Width of a leaf in parts of its length. Its area is half of their product.
const LEAF_WIDTH: f64 = 0.62;

/// Plants a tree of about this height.
pub(super) fn plant(mesh: &mut Mesh, at: &Frame, height: f64, detail: Detail, mut random: Random) {
    let height = height * random.between(0.8, 1.2);
    let trunk = height * 0.42;
    let radius = 0.022 * height;
    let at = at.turned(random.between(0.0, 360.0));
    let sides = if detail >= Detail::Windows { 8 } else { 4 };
    mesh.prism(Finish::Bark, &at, (sides, (radius * 1.3, radius * 0.8), (0.0, trunk)));
    let crown = Crown {
        middle: at.point(vector(0.0, height * 0.66, 0.0)),
        radius: height * random.between(0.27, 0.36),
        half_height: height * 0.36,
    };
    let fork = at.point(vector(0.0, trunk * 0.95, 0.0));
    branches(mesh, (&crown, fork), radius * 0.7, (detail, &mut random));
    let leaf = *random.pick(&[Finish::Leaf, Finish::Leaf, Finish::DarkLeaf, Finish::GoldenLeaf]);
    let count = mesh.tree();
    crown.hang(mesh, leaf, count, &mut random);
}

/// Where the leaves are.
struct Crown {
    middle: Vector,
    radius: f64,
    half_height: f64,
}

impl Crown {
    /// A place in the crown, nearer to its surface than to its middle, and the way out from there.
    fn place(&self, random: &mut Random) -> (Vector, Vector) {
        let out = direction(random);
        let depth = 1.0 - random.unit() * random.unit() * 0.65;
        // Clumps: some directions reach further than others.
        let clump = 0.82 + 0.18 * (out.x * 7.0 + out.y * 5.0 + out.z * 9.0 + self.middle.x).fract();
        let reach = depth * clump;
        let offset =
            vector(out.x * self.radius, out.y * self.half_height, out.z * self.radius) * reach;
        (self.middle + offset, out)
    }

    fn hang(&self, mesh: &mut Mesh, finish: Finish, count: u64, random: &mut Random) {
        let area = LEAF_AREA * self.radius * self.radius / count.max(1) as f64;
        let length = (area / (0.5 * LEAF_WIDTH)).sqrt().min(LEAF_LENGTH_MAX);
        mesh.strew(finish, count, || {
            let (place, out) = self.place(random);
            let facing = out + direction(random) * 0.8 + vector(0.0, 0.3, 0.0);
            let along = facing.cross(direction(random));
            // Two directions that are nearly the same do not span a leaf.
            let along = if along.length() > 1e-3 { along } else { facing.any_perpendicular() };
            let along = along.normalized();
            let across = along.cross(facing).normalized();
            let (along, across) = (along * (length / 2.0), across * (length * LEAF_WIDTH / 2.0));
            [place - along, place + across, place + along, place - across]
        });
    }
}

/// From the fork into the crown.
fn branches(
    mesh: &mut Mesh,
    (crown, fork): (&Crown, Vector),
    radius: f64,
    (detail, random): (Detail, &mut Random),
) {
    let (count, twigs) = match detail {
        Detail::Fine => (9, 6),
        Detail::Windows => (6, 2),
        Detail::Grid => (3, 0),
        _ => (0, 0),
    };
    for _ in 0..count {
        let (end, _) = crown.place(random);
        mesh.rod(Finish::Bark, (fork, end), (radius, radius * 0.3));
        for _ in 0..twigs {
            let start = fork + (end - fork) * random.between(0.4, 0.9);
            let (tip, _) = crown.place(random);
            let tip = start + (tip - start) * 0.4;
            mesh.rod(Finish::Bark, (start, tip), (radius * 0.3, radius * 0.1));
        }
    }
}

/// Some direction: even over a ball, so that no sine is needed.
fn direction(random: &mut Random) -> Vector {
    loop {
        let mut side = || random.between(-1.0, 1.0);
        let v = vector(side(), side(), side());
        let square = v.dot(v);
        if (0.01..1.0).contains(&square) {
            return v * (1.0 / square.sqrt());
        }
    }
}
