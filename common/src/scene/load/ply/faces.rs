//! The faces of a PLY file, one after another.

use super::body::Body;
use super::header::{Element, Encoding, Kind, Property};
use super::layout::Layout;
use super::scalar::{ByteOrder, Scalar};
use crate::scene::error::SceneError;
use crate::scene::load::mesh::CORNERS_MAX;

/// Goes over the faces.
#[derive(Debug)]
pub(super) struct Faces<'a, 'b> {
    body: &'b mut Body<'a>,
    element: &'a Element,
    corners_property: usize,
    vertex_count: u64,
    /// Set if a face is nothing but a list of a common kind.
    plain: Option<PlainList>,
    corners: Vec<u32>,
}

/// Lists with a byte for the length and indices of 32 bits, which nearly all files have.
#[derive(Clone, Copy, Debug)]
struct PlainList {
    order: ByteOrder,
    /// Indices below this are in range; those that are negative are not below it.
    limit: u32,
}

/// Length of a plain list with the most items.
const PLAIN_BYTES_MAX: usize = 1 + 255 * 4;

impl PlainList {
    fn of(encoding: Encoding, face: &Element, vertex_count: u64) -> Option<Self> {
        let Encoding::Binary(order) = encoding else { return None };
        let [Property { kind: Kind::List { length: Scalar::Uint8, item }, .. }] =
            face.properties[..]
        else {
            return None;
        };
        let most = match item {
            Scalar::Int32 => i32::MAX as u64 + 1,
            Scalar::Uint32 => u64::from(u32::MAX),
            _ => return None,
        };
        Some(Self { order, limit: u32::try_from(vertex_count.min(most)).unwrap_or(u32::MAX) })
    }

    /// Reads a list; false, without moving, if anything is wrong with it.
    #[inline]
    fn read(self, body: &mut Body<'_>, corners: &mut Vec<u32>) -> Result<bool, SceneError> {
        let Some((&count, ahead)) = body.scan.peek(PLAIN_BYTES_MAX)?.split_first() else {
            return Ok(false);
        };
        let Some(items) = ahead.get(..usize::from(count) * 4) else { return Ok(false) };
        let items = items.as_chunks().0;
        corners.clear();
        match self.order {
            ByteOrder::Little => corners.extend(items.iter().map(|item| u32::from_le_bytes(*item))),
            ByteOrder::Big => corners.extend(items.iter().map(|item| u32::from_be_bytes(*item))),
        }
        let is_good = corners.iter().all(|&corner| corner < self.limit);
        Ok(is_good && body.scan.skip(1 + u64::from(count) * 4))
    }
}

impl<'a, 'b> Faces<'a, 'b> {
    /// Goes to the first face.
    pub(super) fn new(body: &'b mut Body<'a>, layout: &Layout) -> Result<Self, SceneError> {
        let element = body.enter(layout.face_element)?;
        let (corners_property, vertex_count) = (layout.corners_property, layout.vertex_count);
        let plain = PlainList::of(body.encoding(), element, vertex_count);
        Ok(Self { body, element, corners_property, vertex_count, plain, corners: Vec::new() })
    }

    /// The corners of the next face, each the number of a vertex.
    pub(super) fn next(&mut self) -> Result<Option<&[u32]>, SceneError> {
        if self.body.number == self.element.count {
            return Ok(None);
        }
        self.body.begin();
        if let Some(plain) = self.plain
            && plain.read(self.body, &mut self.corners)?
        {
            self.body.number += 1;
            return Ok(Some(&self.corners));
        }
        for (number, property) in self.element.properties.iter().enumerate() {
            match property.kind {
                Kind::List { length, item } if number == self.corners_property => {
                    self.read(length, item)?;
                }
                kind => self.body.skip(kind)?,
            }
        }
        self.body.number += 1;
        Ok(Some(&self.corners))
    }

    /// Says what is wrong with the face that was shown last.
    pub(super) fn malformed(&mut self, problem: &str) -> SceneError {
        self.body.number -= 1;
        self.body.malformed(problem)
    }

    fn read(&mut self, length: Scalar, item: Scalar) -> Result<(), SceneError> {
        let count = self.body.length(length)?;
        if count > CORNERS_MAX as u64 {
            let problem =
                format!("a face of {count} corners; cut it into faces of at most {CORNERS_MAX}");
            return Err(self.body.malformed(&problem));
        }
        self.corners.clear();
        let Encoding::Binary(order) = self.body.encoding() else {
            for _ in 0..count {
                let index = self.body.whole(item)?;
                self.corners.push(self.checked(index)?);
            }
            return Ok(());
        };
        let Some(bytes) = self.body.scan.take(count as usize * item.byte_count())? else {
            return Err(self.body.ends());
        };
        let indices = bytes.chunks_exact(item.byte_count());
        let indices = indices.map(|bytes| item.decode_whole(order, bytes));
        let mut largest = 0;
        self.corners.extend(indices.map(|index| {
            // A negative one turns into a large one.
            largest = largest.max(index as u64);
            index as u32
        }));
        if largest >= self.vertex_count {
            return Err(self.out_of_range(largest as i64));
        }
        Ok(())
    }

    fn checked(&self, index: i64) -> Result<u32, SceneError> {
        match u32::try_from(index) {
            Ok(index) if u64::from(index) < self.vertex_count => Ok(index),
            _ => Err(self.out_of_range(index)),
        }
    }

    fn out_of_range(&self, index: i64) -> SceneError {
        let count = self.vertex_count;
        let problem = format!(
            "vertex {index} is out of range: by its header the file has {count}, counted from 0; \
             correct the header's count of vertices, or make the file anew"
        );
        self.body.malformed(&problem)
    }
}
