//! Models that are streamed: PLY files as they are, OBJ files by way of temporary files.

use std::path::Path;

use super::spool::{Spool, SpoolWriter};
use super::spooled_faces::{ObjSpools, for_each_face};
use super::table::TableFile;
use super::vertices::{Column, VertexFiles};
use crate::scene::error::SceneError;
use crate::scene::files::LargeFile;
use crate::scene::load::mesh::{Face, MaterialNames, Reply};
use crate::scene::load::obj_reader::read_obj;
use crate::scene::load::ply::{PlyFile, RowFormat};

/// A model whose faces can be gone over any number of times.
#[derive(Debug)]
pub(super) struct StreamedModel {
    pub(super) file: LargeFile,
    pub(super) materials: MaterialNames,
    pub(super) vertices: VertexFiles,
    /// How many triangles its faces are cut into; an estimate for some files.
    pub(super) triangle_count: u64,
    faces: Faces,
    /// Temporary files that are there for as long as the model is.
    _spools: Vec<Spool>,
}

/// Where the faces of a model are.
#[derive(Debug)]
enum Faces {
    Ply(PlyFile),
    /// In a temporary file; the number of faces that are too thin to be in it.
    Spooled {
        file: LargeFile,
        thin: u64,
    },
}

impl StreamedModel {
    /// A PLY file. Its vertices are read where they are, unless they are of different lengths.
    pub(super) fn ply(file: LargeFile, spool: &Path, number: usize) -> Result<Self, SceneError> {
        let ply = PlyFile::new(file.clone())?;
        let mut spools = Vec::new();
        let (vertex_file, offset, format) = match ply.vertex_rows()? {
            Some((offset, format)) => (file.clone(), offset, format),
            None => {
                let mut writer = SpoolWriter::new(spool, &format!("model-{number}-vertices"))?;
                ply.for_each_vertex(&mut |row| writer.write_row(row))?;
                let spooled = writer.finish()?;
                let vertex_file = spooled.file.clone();
                spools.push(spooled);
                (vertex_file, 0, RowFormat::packed(ply.row_numbers()))
            }
        };
        let (normals_at, texcoords_at) = ply.attributes();
        let column = |at: Option<usize>| Column { table: 0, at: at.unwrap_or(0) };
        let table = TableFile {
            file: vertex_file,
            offset,
            format,
            row_count: ply.vertex_count(),
            cache_eighths: 8,
            positions_at: Some(0),
            normals_at,
            texcoords_at,
        };
        Ok(Self {
            file,
            materials: PlyFile::material_names(),
            vertices: VertexFiles {
                tables: vec![table],
                positions: Column::default(),
                normals: column(normals_at),
                texcoords: column(texcoords_at),
            },
            triangle_count: ply.triangle_estimate(),
            faces: Faces::Ply(ply),
            _spools: spools,
        })
    }

    /// An OBJ file, which is written down in binary form once it has been checked.
    pub(super) fn obj(file: LargeFile, spool: &Path, number: usize) -> Result<Self, SceneError> {
        let opened = file.open()?;
        let mut writers = ObjSpools::new(spool, number)?;
        let outline = read_obj(file.name(), &opened, &mut writers)?;
        opened.check_unchanged()?;
        drop(opened);
        let [positions, texcoords, normals, faces] = writers.finish()?;
        let [position_count, texcoord_count, normal_count] = outline.counts;
        let table = |spool: &Spool, row_count, number_count| TableFile {
            file: spool.file.clone(),
            offset: 0,
            format: RowFormat::packed(number_count),
            row_count,
            cache_eighths: number_count,
            positions_at: None,
            normals_at: None,
            texcoords_at: None,
        };
        let at = Some(0);
        let tables = vec![
            TableFile { positions_at: at, ..table(&positions, position_count, 3) },
            TableFile { normals_at: at, ..table(&normals, normal_count, 3) },
            TableFile { texcoords_at: at, ..table(&texcoords, texcoord_count, 2) },
        ];
        Ok(Self {
            file,
            materials: outline.materials,
            vertices: VertexFiles {
                tables,
                positions: Column::default(),
                normals: Column { table: 1, at: 0 },
                texcoords: Column { table: 2, at: 0 },
            },
            triangle_count: outline.triangle_count,
            faces: Faces::Spooled { file: faces.file.clone(), thin: outline.thin_faces },
            _spools: vec![positions, texcoords, normals, faces],
        })
    }

    /// Shows all faces of three corners or more until told that it is enough; the number of those
    /// that have fewer.
    pub(super) fn for_each_face(
        &self,
        visit: &mut dyn FnMut(&Face<'_>) -> Result<Reply, SceneError>,
    ) -> Result<u64, SceneError> {
        match &self.faces {
            Faces::Ply(ply) => ply.for_each_face(visit),
            Faces::Spooled { file, thin } => {
                for_each_face(file, self.file.name(), visit)?;
                Ok(*thin)
            }
        }
    }
}
