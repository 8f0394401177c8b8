//! The vertices of a PLY file, one after another.

use super::body::Body;
use super::header::{Element, Kind};
use super::layout::{Layout, ROW_NUMBERS_MAX};
use crate::scene::error::SceneError;
use crate::scene::load::json::single;

/// Reads all vertices and shows each as the row of numbers that the layout says.
pub(super) fn for_each_vertex(
    body: &mut Body<'_>,
    layout: &Layout,
    mut visit: impl FnMut(&[f32]) -> Result<(), SceneError>,
) -> Result<(), SceneError> {
    let element = body.enter(layout.vertex_element)?;
    let mut row = [0.0; ROW_NUMBERS_MAX];
    let row = &mut row[..layout.row_numbers];
    while body.number < element.count {
        body.begin();
        match &layout.fixed_row {
            None => read(body, element, layout, row)?,
            Some(fixed) => match body.scan.take(fixed.byte_count())? {
                Some(bytes) => fixed.decode(bytes, row),
                None => return Err(body.ends()),
            },
        }
        visit(row)?;
        body.number += 1;
    }
    Ok(())
}

/// Reads a vertex number by number.
fn read(
    body: &mut Body<'_>,
    element: &Element,
    layout: &Layout,
    row: &mut [f32],
) -> Result<(), SceneError> {
    for (property, place) in element.properties.iter().zip(&layout.vertex_properties) {
        match (property.kind, place) {
            (Kind::Single(scalar), Some(place)) => row[*place] = single(body.scalar(scalar)?),
            (kind, _) => body.skip(kind)?,
        }
    }
    Ok(())
}
