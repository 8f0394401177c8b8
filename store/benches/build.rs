//! How fast a store is built and read, and where the time goes: a terrain of some million triangles
//! that is made up as it is read, so that nothing but the building is measured. Reading partitions
//! is compared with reading the bytes of their files to where other bytes were before.
//!
//! `cargo bench -p equilux-store --bench build -- [TRIANGLES [MIB [DIRECTORY]]]`

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

use equilux_common::job::{Filter, PerDepth, Settings};
use equilux_common::scene::camera::Camera;
use equilux_common::scene::error::SceneError;
use equilux_common::scene::triangles::TriangleSource;
use equilux_common::scene::{Environment, Material, Surface, Tables, WorldTriangle};
use equilux_store::{Cut, Manifest, Overture, Phase, Places, Progress, build, read_partition};

/// What a triangle takes in a binary PLY: three indices, a count, and half a vertex and a half.
const PLY_BYTES_PER_TRIANGLE: f64 = 22.0;

/// How often all partitions are read; the best time counts.
const ROUNDS: usize = 5;

/// A sheet of hills, row by row, as scanned terrain comes.
struct Terrain {
    side: u32,
}

impl Terrain {
    fn corner(&self, column: u32, row: u32) -> [f32; 3] {
        let (x, z) = (column as f32, row as f32);
        let wave = |t: f32| (t - t.floor()) * (1.0 - (t - t.floor()));
        let height = 900.0 * wave(x / 701.0) * wave(z / 613.0) + 40.0 * wave(x / 37.0 + z / 41.0);
        [x, height, z]
    }
}

impl TriangleSource for Terrain {
    fn for_each(
        &mut self,
        visit: &mut dyn FnMut(&[WorldTriangle]) -> ControlFlow<()>,
    ) -> Result<(), SceneError> {
        let mut lot = Vec::with_capacity(1024);
        for row in 0..self.side {
            for column in 0..self.side {
                let corner = |x, z| self.corner(column + x, row + z);
                let (a, b, c, d) = (corner(0, 0), corner(0, 1), corner(1, 0), corner(1, 1));
                for corners in [[a, b, c], [c, b, d]] {
                    lot.push(WorldTriangle {
                        corners,
                        normals: None,
                        texcoords: None,
                        material: 0,
                    });
                }
                if lot.len() == 1024 {
                    if visit(&lot).is_break() {
                        return Ok(());
                    }
                    lot.clear();
                }
            }
        }
        let _ = visit(&lot);
        Ok(())
    }
}

#[expect(clippy::disallowed_methods, reason = "it measures")]
fn main() {
    let arguments: Vec<String> =
        std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    let number = |at: usize, default: u32| {
        arguments.get(at).map_or(default, |it| it.parse().expect("a number"))
    };
    let terrain = Terrain { side: (number(0, 10_000_000) / 2).isqrt() };
    let cut = Cut::Size(u64::from(number(1, 64)) << 20);
    let home =
        tempfile::tempdir_in(arguments.get(2).map_or_else(std::env::temp_dir, PathBuf::from));
    let home = home.expect("a directory");
    let directory = home.path().join("store");

    let begin = Instant::now();
    let mut begins: Vec<(Phase, f64)> = Vec::new();
    let manifest = build_terrain(terrain, cut, &directory, &mut |progress| {
        if begins.last().is_none_or(|(phase, _)| *phase != progress.phase) {
            begins.push((progress.phase, begin.elapsed().as_secs_f64()));
        }
        ControlFlow::Continue(())
    });
    let seconds = begin.elapsed().as_secs_f64();
    for (phase, since) in begins {
        eprintln!("{phase:?} from {since:.2} s");
    }
    report(&manifest, seconds);
    read_again(&manifest, &directory);
}

/// Reads all partitions, and their files' bytes alone.
#[expect(clippy::disallowed_methods, reason = "it measures")]
fn read_again(manifest: &Manifest, directory: &Path) {
    let paths = manifest.partitions.iter().map(|entry| directory.join(&entry.file.name));
    let paths: Vec<PathBuf> = paths.collect();
    let largest = manifest.partitions.iter().map(|entry| entry.file.bytes).max().unwrap_or(0);
    let mut bytes = vec![1; usize::try_from(largest).expect("it fits memory")];
    let (mut partitions, mut plain) = (f64::INFINITY, f64::INFINITY);
    for _ in 0..ROUNDS {
        let begin = Instant::now();
        for (number, path) in paths.iter().enumerate() {
            read_partition(path, manifest, number).expect("it was just written");
        }
        partitions = partitions.min(begin.elapsed().as_secs_f64());
        let begin = Instant::now();
        for (path, entry) in paths.iter().zip(&manifest.partitions) {
            let mut file = File::open(path).expect("it was just read");
            file.read_exact(&mut bytes[..entry.file.bytes as usize]).expect("it is as long");
        }
        plain = plain.min(begin.elapsed().as_secs_f64());
    }
    let megabytes = manifest.partition_bytes() as f64 / 1e6;
    eprintln!(
        "read again with {:.0} MB/s, {:.2} of the {:.0} MB/s of their bytes alone",
        megabytes / partitions,
        plain / partitions,
        megabytes / plain
    );
}

fn build_terrain(
    mut terrain: Terrain,
    cut: Cut,
    directory: &Path,
    observer: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Manifest {
    let white =
        Surface::Plain { diffuse: [0.7; 3], diffuse_texture: None, specular: [0.0; 3], alpha: 1.0 };
    let material =
        Material { name: "white".into(), emission: [0.0; 3], surface: white, opacity: 1.0 };
    let tables = Tables {
        materials: vec![material],
        textures: Vec::new(),
        environment: Environment::Constant { radiance: [1.0; 3] },
    };
    let overture = Overture {
        tables: &tables,
        camera: &Camera {
            eye: [0.0, 1000.0, 0.0],
            target: [1.0; 3],
            up: [0.0, 1.0, 0.0],
            vfov: 38.0,
            aperture: 0.0,
            focus_distance: 1.0,
        },
        cameras: &BTreeMap::new(),
        settings: &settings(),
    };
    let places = Places { store: directory, spool: None };
    build(&mut terrain, &overture, cut, &places, observer).expect("there is room")
}

fn settings() -> Settings {
    Settings {
        width: 640,
        height: 480,
        crop: None,
        filter: Filter::Box,
        samples_per_pixel: 64,
        max_depth: 8,
        light_samples: PerDepth::default(),
        indirect_samples: PerDepth::default(),
        roulette_depth: None,
        seed: 0,
    }
}

fn report(manifest: &Manifest, seconds: f64) {
    let triangles = manifest.triangle_count as f64;
    let bytes = manifest.partition_bytes() as f64;
    let sizes = manifest.partitions.iter().map(|partition| partition.memory_bytes as f64);
    let mebibytes = |bytes: f64| bytes / f64::from(1 << 20);
    eprintln!(
        "{triangles} triangles in {seconds:.2} s: {:.2} million a second, {:.0} MB/s of PLY",
        triangles / seconds / 1e6,
        triangles * PLY_BYTES_PER_TRIANGLE / seconds / 1e6
    );
    eprintln!(
        "{} partitions of {:.1} to {:.1} MiB, {:.1} bytes per triangle",
        manifest.partitions.len(),
        mebibytes(sizes.clone().fold(f64::INFINITY, f64::min)),
        mebibytes(sizes.fold(0.0, f64::max)),
        bytes / triangles
    );
}
