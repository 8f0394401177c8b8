//! Pictures of what was measured or predicted, each as SVG and as PNG.
//!
//! A picture is a value that knows how to draw itself on any surface. It needs nothing of the
//! machine: PNGs have their letters from a font that is part of the program, and SVGs leave them to
//! whoever shows them.

mod axis;
mod efficiency;
mod finishes;
mod heat;
mod messages;
mod series;
mod style;

use std::io::Cursor;
use std::path::{Path, PathBuf};

use anyhow::Context;
use equilux_common::image::write_atomically;
use image::{ImageFormat, RgbImage};
use plotters::coord::Shift;
use plotters::prelude::{
    BitMapBackend, DrawingArea, DrawingAreaErrorKind, DrawingBackend, IntoDrawingArea, SVGBackend,
};

pub(crate) use efficiency::{Efficiencies, EfficiencyLine};
pub(crate) use finishes::{Figure2, Finishes};
pub(crate) use heat::{HeatMaps, Loads, LoadsOverTime};
pub(crate) use messages::{MessageLine, Messages, Sent};

/// Where something is drawn.
pub(crate) type Area<B> = DrawingArea<B, Shift>;

/// What comes of drawing.
pub(crate) type Drawn<B> = Result<(), DrawingAreaErrorKind<<B as DrawingBackend>::ErrorType>>;

/// Something that can be drawn.
pub(crate) trait Picture {
    /// The name of its files, without the ending.
    fn name(&self) -> String;

    /// Width and height in pixels.
    fn sides(&self) -> (u32, u32);

    /// Draws it on a white ground of that size.
    ///
    /// # Errors
    /// If the surface cannot be drawn on.
    fn draw<B: DrawingBackend>(&self, area: &Area<B>) -> Drawn<B>;
}

/// Writes a picture as SVG and PNG and gives both names.
pub(crate) fn write(picture: &impl Picture, directory: &Path) -> anyhow::Result<[PathBuf; 2]> {
    style::register_font();
    let [svg, png] =
        ["svg", "png"].map(|ending| directory.join(format!("{}.{ending}", picture.name())));
    let text = draw_svg(picture).with_context(|| format!("{}", svg.display()))?;
    write_atomically(&svg, text.as_bytes())?;
    let bytes = draw_png(picture).with_context(|| format!("{}", png.display()))?;
    write_atomically(&png, &bytes)?;
    Ok([svg, png])
}

fn draw_svg(picture: &impl Picture) -> anyhow::Result<String> {
    let mut text = String::new();
    draw(picture, &SVGBackend::with_string(&mut text, picture.sides()).into_drawing_area())?;
    Ok(text)
}

fn draw_png(picture: &impl Picture) -> anyhow::Result<Vec<u8>> {
    let (width, height) = picture.sides();
    let mut image = RgbImage::new(width, height);
    draw(picture, &BitMapBackend::with_buffer(&mut image, (width, height)).into_drawing_area())?;
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, ImageFormat::Png)?;
    Ok(bytes.into_inner())
}

fn draw<B: DrawingBackend>(picture: &impl Picture, area: &Area<B>) -> anyhow::Result<()>
where
    B::ErrorType: 'static,
{
    area.fill(&plotters::style::WHITE)?;
    picture.draw(area)?;
    Ok(area.present()?)
}
