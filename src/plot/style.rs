//! How pictures look: letters, colors, and the space around things.

use std::sync::Once;

use plotters::style::{
    Color, FontDesc, FontFamily, FontStyle, RGBAColor, RGBColor, TextStyle, register_font as add,
};

/// The family that SVGs ask for, and the name of the built-in font.
const FAMILY: &str = "sans-serif";

/// Height of the line that a picture's title stands in.
pub(super) const TITLE_PIXELS: u32 = 46;

/// Space for the numbers and the name of an axis on the left.
pub(super) const LEFT_PIXELS: u32 = 84;

/// The same below.
pub(super) const BELOW_PIXELS: u32 = 52;

/// Ink of axes and letters.
pub(super) const INK: RGBColor = RGBColor(40, 40, 40);

/// Lines of the grid.
pub(super) const GRID: RGBColor = RGBColor(225, 225, 225);

/// What stands back behind the rest.
pub(super) const FAINT: RGBColor = RGBColor(130, 130, 130);

/// What is worse, and what is better.
pub(super) const WITHOUT: RGBColor = RGBColor(204, 102, 51);
pub(super) const WITH: RGBColor = RGBColor(31, 119, 160);

/// Colors that differ for the color-blind too (Okabe & Ito 2008).
const SERIES: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
];

/// The color of the series of this number.
pub(super) const fn series(number: usize) -> RGBColor {
    SERIES[number % SERIES.len()]
}

/// The same for its lesser twin.
pub(super) fn twin(number: usize) -> RGBAColor {
    series(number).mix(0.45)
}

/// Makes the built-in font known, once.
pub(super) fn register_font() {
    static DONE: Once = Once::new();
    DONE.call_once(|| {
        let faces =
            [(FontStyle::Normal, notosans::REGULAR_TTF), (FontStyle::Bold, notosans::BOLD_TTF)];
        for (style, bytes) in faces {
            assert!(add(FAMILY, style, bytes).is_ok(), "the built-in font is broken");
        }
    });
}

/// Letters of a picture's title.
pub(super) fn title() -> TextStyle<'static> {
    TextStyle::from(FontDesc::new(FontFamily::Name(FAMILY), 22.0, FontStyle::Bold)).color(&INK)
}

/// Letters above a panel.
pub(super) fn heading() -> TextStyle<'static> {
    plain(18.0)
}

/// Letters of axes and legends.
pub(super) fn label() -> TextStyle<'static> {
    plain(16.0)
}

fn plain(size: f64) -> TextStyle<'static> {
    TextStyle::from(FontDesc::new(FontFamily::Name(FAMILY), size, FontStyle::Normal)).color(&INK)
}
