//! The heads of PLY files: binary, little endian, quads only.

use super::mesh::{FACE_BYTES, VERTEX_BYTES};

/// The head of a file of so many vertices and faces.
pub(super) fn header(name: &str, (vertices, faces): (u64, u64)) -> String {
    format!(
        "ply\nformat binary_little_endian 1.0\ncomment Equilux city: {name}; metres, y up\n\
         element vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {faces}\nproperty list uchar uint vertex_indices\nend_header\n"
    )
}

/// Bytes that follow the head.
pub(super) const fn body_bytes((vertices, faces): (u64, u64)) -> u64 {
    vertices * VERTEX_BYTES + faces * FACE_BYTES
}
