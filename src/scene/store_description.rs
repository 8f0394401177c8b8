//! What is in a store, for people and for programs: `equilux scene check STORE`.

use std::fmt;
use std::path::Path;

use equilux_common::scene::describe::Bytes;
use equilux_store::{Manifest, Store, StoreError, directory_path, read_partition};
use serde::Serialize;

/// A store in figures.
#[derive(Clone, Debug, Serialize)]
pub(super) struct StoreDescription {
    triangles: u64,
    kept_triangles: u64,
    light_triangles: u64,
    bounds_min: [f32; 3],
    bounds_max: [f32; 3],
    materials: usize,
    textures: usize,
    cameras: Vec<String>,
    width: u32,
    height: u32,
    spp: u32,
    partitions: usize,
    empty_partitions: usize,
    partition_bytes_min: u64,
    partition_bytes_max: u64,
    memory_bytes: u64,
    file_bytes: u64,
}

impl StoreDescription {
    /// Reads and checks all of a store, one partition at a time.
    pub(super) fn of(path: &Path) -> Result<Self, StoreError> {
        let store = Store::open_path(path)?;
        let manifest = store.manifest();
        let directory = directory_path(path);
        for (number, entry) in manifest.partitions.iter().enumerate() {
            read_partition(&directory.join(&entry.file.name), manifest, number)?;
        }
        Ok(Self::of_manifest(manifest))
    }

    fn of_manifest(manifest: &Manifest) -> Self {
        let memory = || manifest.partitions.iter().map(|partition| partition.memory_bytes);
        Self {
            triangles: manifest.triangle_count,
            kept_triangles: manifest.kept_count(),
            light_triangles: manifest.luminaires.count,
            bounds_min: manifest.bounds.lower.into(),
            bounds_max: manifest.bounds.upper.into(),
            materials: manifest.materials.len(),
            textures: manifest.textures.len(),
            cameras: manifest.cameras.keys().cloned().collect(),
            width: manifest.settings.width,
            height: manifest.settings.height,
            spp: manifest.settings.samples_per_pixel,
            partitions: manifest.partitions.len(),
            empty_partitions: memory().filter(|&bytes| bytes == 0).count(),
            partition_bytes_min: memory().min().unwrap_or(0),
            partition_bytes_max: memory().max().unwrap_or(0),
            memory_bytes: memory().sum(),
            file_bytes: manifest.file_bytes(),
        }
    }
}

impl fmt::Display for StoreDescription {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "triangles          {} ({} emit)", self.triangles, self.light_triangles)?;
        if self.kept_triangles != self.triangles {
            writeln!(f, "kept               {} of them, at several places", self.kept_triangles)?;
        }
        let (least, most) = (Bytes(self.partition_bytes_min), Bytes(self.partition_bytes_max));
        writeln!(f, "partitions         {} of {least} to {most}", self.partitions)?;
        if self.empty_partitions > 0 {
            writeln!(f, "empty partitions   {}", self.empty_partitions)?;
        }
        let ([x0, y0, z0], [x1, y1, z1]) = (self.bounds_min, self.bounds_max);
        writeln!(f, "bounds             ({x0} {y0} {z0}) to ({x1} {y1} {z1})")?;
        writeln!(f, "materials          {}", self.materials)?;
        writeln!(f, "textures           {}", self.textures)?;
        if !self.cameras.is_empty() {
            writeln!(f, "other cameras      {}", self.cameras.join(", "))?;
        }
        writeln!(f, "film               {}×{}, {} spp", self.width, self.height, self.spp)?;
        writeln!(f, "memory             {} for all partitions", Bytes(self.memory_bytes))?;
        writeln!(f, "files              {}, all as they were written", Bytes(self.file_bytes))
    }
}
