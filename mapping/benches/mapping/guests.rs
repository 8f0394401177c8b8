//! Graphs to map: grids, random geometric graphs, and something like a city.
//!
//! Objects are numbered in the order of a recursive bisection, as partitions of a store are.

use std::collections::BTreeMap;

use equilux_mapping::{Guest, Object, Tie};

/// Makes a graph of about so many objects, another one for each seed.
type Make = fn(usize, u64) -> Guest;

/// Kinds of graphs, by name.
pub(crate) const KINDS: [(&str, Make); 3] =
    [("grid", grid), ("geometric", geometric), ("city", city)];

/// Random numbers: SplitMix64 (Steele, Lea & Flood 2014), always the same.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    /// From `least` to `most`, both included.
    pub(crate) fn integer(&mut self, least: u64, most: u64) -> u64 {
        least + self.next() % (most - least + 1)
    }

    /// From 0 to 1.
    fn unit(&mut self) -> f32 {
        self.integer(0, (1 << 24) - 1) as f32 / (1 << 24) as f32
    }
}

/// A grid of objects of equal size, about so many, six neighbors each, affinities from 1 to 100.
fn grid(count: usize, seed: u64) -> Guest {
    let side = (1..).find(|side| side * side * side >= count).expect("some side");
    let mut random = Random(seed);
    let at = |x: usize, y: usize, z: usize| (z * side + y) * side + x;
    let mut objects = Vec::new();
    let mut ties = Vec::new();
    for (z, y, x) in (0..side * side * side).map(|i| (i / side / side, i / side % side, i % side)) {
        objects.push(Object { bytes: 100, position: [x, y, z].map(|it| it as f32) });
        for (is_inside, other) in [
            (x + 1 < side, at(x + 1, y, z)),
            (y + 1 < side, at(x, y + 1, z)),
            (z + 1 < side, at(x, y, z + 1)),
        ] {
            let affinity = random.integer(1, 100);
            if is_inside {
                ties.push(Tie { objects: [at(x, y, z), other], affinity });
            }
        }
    }
    in_order(&objects, &ties)
}

/// Points at random in a cube, sizes from 50 to 150, tied to all within a distance that leaves
/// about twelve, equally strongly.
fn geometric(count: usize, seed: u64) -> Guest {
    let mut random = Random(seed);
    let objects: Vec<_> = (0..count)
        .map(|_| Object { bytes: random.integer(50, 150), position: [0; 3].map(|_| random.unit()) })
        .collect();
    let radius = (12.0 * 3.0 / (4.0 * std::f32::consts::PI * count as f32)).cbrt();
    let near = |d2: f32| (d2 < radius * radius).then_some(10);
    let ties = ties_within(&objects, radius, near);
    in_order(&objects, &ties)
}

/// Towns of very unequal sizes on a plain, sizes of objects from 20 to 320; affinities fall with
/// the square of the distance. A tenth as many ties as there are
/// objects lead far away.
fn city(count: usize, seed: u64) -> Guest {
    let mut random = Random(seed);
    let town_count = (count / 200).max(3);
    let towns: Vec<[f32; 2]> = (0..town_count).map(|_| [0; 2].map(|_| random.unit())).collect();
    let objects: Vec<_> = (0..count)
        .map(|_| {
            let town = towns[(random.unit() * random.unit() * town_count as f32) as usize];
            let offset =
                [0; 2].map(|_| (random.unit() + random.unit() + random.unit() - 1.5) * 1.5);
            let width = 1.0 / (town_count as f32).sqrt();
            let [x, y] = [0, 1].map(|axis| town[axis] + offset[axis] * width);
            let z = random.unit() * random.unit() * 0.3 * width;
            Object { bytes: 20 << random.integer(0, 4), position: [x, y, z] }
        })
        .collect();
    let radius = 2.0 / (count as f32).sqrt();
    let fall = |d2: f32| Some((100.0 / (1.0 + 16.0 * d2 / (radius * radius))) as u64);
    let mut ties = ties_within(&objects, radius, fall);
    for _ in 0..count / 10 {
        let objects = [0; 2].map(|_| random.integer(0, count as u64 - 1) as usize);
        ties.push(Tie { objects, affinity: 5 });
    }
    in_order(&objects, &ties)
}

/// Ties all pairs within `radius`, with an affinity by their squared distance.
fn ties_within(objects: &[Object], radius: f32, affinity: impl Fn(f32) -> Option<u64>) -> Vec<Tie> {
    let cell = |at: [f32; 3]| at.map(|it| (it / radius).floor() as i64);
    let mut cells: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
    for (index, object) in objects.iter().enumerate() {
        cells.entry(cell(object.position)).or_default().push(index);
    }
    let mut ties = Vec::new();
    for (a, object) in objects.iter().enumerate() {
        let [x, y, z] = cell(object.position);
        for step in 0..27 {
            let near = [x + step % 3 - 1, y + step / 3 % 3 - 1, z + step / 9 - 1];
            for &b in cells.get(&near).into_iter().flatten().filter(|&&b| b > a) {
                let [p, q] = [object, &objects[b]].map(|it| it.position);
                let d2: f32 = [0, 1, 2].map(|axis| (p[axis] - q[axis]).powi(2)).iter().sum();
                let tie = affinity(d2).filter(|_| d2 < radius * radius);
                ties.extend(tie.map(|affinity| Tie { objects: [a, b], affinity }));
            }
        }
    }
    ties
}

/// Renumbers objects in the order of a recursive bisection by bytes, across the longest axis.
fn in_order(objects: &[Object], ties: &[Tie]) -> Guest {
    let mut order: Vec<_> = (0..objects.len()).collect();
    bisect(objects, &mut order);
    let mut numbers = vec![0; objects.len()];
    order.iter().enumerate().for_each(|(number, &object)| numbers[object] = number);
    let ties = ties.iter().map(|tie| Tie { objects: tie.objects.map(|it| numbers[it]), ..*tie });
    let objects = order.iter().map(|&object| objects[object]).collect();
    Guest::new(objects, ties.collect()).expect("a valid guest")
}

fn bisect(objects: &[Object], order: &mut [usize]) {
    if order.len() < 2 {
        return;
    }
    let extent = |axis: usize| {
        let along = order.iter().map(|&object| objects[object].position[axis]);
        let (least, most) = along.fold((f32::MAX, f32::MIN), |(a, b), it| (a.min(it), b.max(it)));
        most - least
    };
    let axis = (0..3).max_by(|&a, &b| extent(a).total_cmp(&extent(b))).expect("three axes");
    order.sort_by(|&a, &b| {
        let [a, b] = [a, b].map(|it| (objects[it].position[axis], it));
        a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
    });
    let half = order.iter().map(|&object| objects[object].bytes).sum::<u64>() / 2;
    let mut before = 0;
    let reaches_half = |&object: &usize| {
        before += objects[object].bytes;
        before >= half
    };
    let middle = order.iter().position(reaches_half).unwrap_or(0);
    let (low, high) = order.split_at_mut((middle + 1).min(order.len() - 1));
    bisect(objects, low);
    bisect(objects, high);
}
