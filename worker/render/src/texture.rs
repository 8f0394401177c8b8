//! Looking up textures: bilinear between texel centers, repeating, v up.
//!
//! A texel's center lies half a texel inside its square, and (0, 0) is the bottom left corner of
//! the image. Eight-bit texels are decoded from sRGB before they are mixed.

use std::sync::LazyLock;

use equilux_common::scene::{Texels, Texture};
use glam::Vec3;

/// Linear value of each sRGB code (IEC 61966-2-1).
static LINEAR_OF_SRGB: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|code| {
        let encoded = code as f64 / 255.0;
        let linear = if encoded <= 0.04045 {
            encoded / 12.92
        } else {
            libm::pow((encoded + 0.055) / 1.055, 2.4)
        };
        linear as f32
    })
});

/// What lies beyond the top and bottom rows.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Rows {
    /// The image again.
    Repeat,
    /// The outermost row.
    Clamp,
}

/// Bytes of memory that its texels take.
pub(crate) fn bytes(texture: &Texture) -> usize {
    match &texture.texels {
        Texels::Srgb8(texels) => size_of_val(texels.as_slice()),
        Texels::Linear(texels) => size_of_val(texels.as_slice()),
    }
}

/// The linear colour of `texture` at `uv`, which repeats outside of 0 to 1. Coordinates that are
/// not finite count as 0; an empty texture is black.
#[must_use]
pub fn lookup(texture: &Texture, uv: [f32; 2]) -> Vec3 {
    lookup_with(texture, uv, Rows::Repeat)
}

/// [`lookup`] with a choice of what lies beyond the top and bottom rows.
pub(crate) fn lookup_with(texture: &Texture, uv: [f32; 2], rows: Rows) -> Vec3 {
    if texture.width == 0 || texture.height == 0 {
        return Vec3::ZERO;
    }
    let (left, right, fx) = neighbors(fraction(uv[0]), texture.width, Rows::Repeat);
    let (above, below, fy) = neighbors(1.0 - fraction(uv[1]), texture.height, rows);
    let row = |y| texel(texture, left, y) * (1.0 - fx) + texel(texture, right, y) * fx;
    row(above) * (1.0 - fy) + row(below) * fy
}

/// The linear colour of a texel; row 0 is at the top.
pub(crate) fn texel(texture: &Texture, x: u32, y: u32) -> Vec3 {
    let index = x as usize + y as usize * texture.width as usize;
    match &texture.texels {
        Texels::Srgb8(texels) => {
            Vec3::from_array(texels[index].map(|code| LINEAR_OF_SRGB[usize::from(code)]))
        }
        Texels::Linear(texels) => Vec3::from_array(texels[index]),
    }
}

/// What is left of `x` after the decimal point, counted upward, from 0 to 1.
fn fraction(x: f32) -> f32 {
    let fraction = x - x.floor();
    if fraction.is_finite() { fraction } else { 0.0 }
}

/// The two texels between whose centers `position` (0 to 1) lies, and how near to the second.
fn neighbors(position: f32, count: u32, beyond: Rows) -> (u32, u32, f32) {
    let x = position * count as f32 - 0.5;
    let floor = x.floor();
    let first = floor as i64;
    let inside = |index: i64| match beyond {
        Rows::Repeat => index.rem_euclid(i64::from(count)),
        Rows::Clamp => index.clamp(0, i64::from(count) - 1),
    };
    (inside(first) as u32, inside(first + 1) as u32, x - floor)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn gray(width: u32, height: u32, values: &[f32]) -> Texture {
        let texels = Texels::Linear(values.iter().map(|&value| [value; 3]).collect());
        Texture { name: "test".into(), width, height, texels }
    }

    fn value(texture: &Texture, u: f32, v: f32) -> f32 {
        lookup(texture, [u, v]).x
    }

    #[test]
    fn v_is_up_and_centers_are_half_a_texel_inside() {
        let texture = gray(2, 2, &[1.0, 2.0, 3.0, 4.0]);
        assert_eq!(value(&texture, 0.25, 0.75), 1.0);
        assert_eq!(value(&texture, 0.75, 0.75), 2.0);
        assert_eq!(value(&texture, 0.25, 0.25), 3.0);
        assert_eq!(value(&texture, 0.75, 0.25), 4.0);
    }

    #[test]
    fn midpoints_are_means() {
        let texture = gray(2, 2, &[1.0, 2.0, 3.0, 4.0]);
        assert_eq!(value(&texture, 0.5, 0.75), 1.5);
        assert_eq!(value(&texture, 0.25, 0.5), 2.0);
        assert_eq!(value(&texture, 0.5, 0.5), 2.5);
        assert_eq!(value(&texture, 0.375, 0.25), 3.25);
    }

    #[test]
    fn it_repeats_and_mixes_over_the_seam() {
        let texture = gray(4, 1, &[0.0, 1.0, 2.0, 4.0]);
        assert_eq!(value(&texture, 0.0, 0.5), 2.0);
        assert_eq!(value(&texture, 1.0, 0.5), 2.0);
        for turn in [-3.0, -1.0, 1.0, 7.0] {
            assert_eq!(value(&texture, 0.375 + turn, 0.5 + turn), 1.0);
        }
    }

    #[test]
    fn clamped_rows_do_not_mix_top_and_bottom() {
        let texture = gray(1, 2, &[1.0, 3.0]);
        assert_eq!(lookup_with(&texture, [0.5, 0.99999], Rows::Clamp).x, 1.0);
        assert_eq!(lookup_with(&texture, [0.5, 0.0], Rows::Clamp).x, 3.0);
        assert_eq!(value(&texture, 0.5, 0.0), 2.0);
    }

    #[test]
    fn srgb_codes_are_decoded() {
        let texels = Texels::Srgb8(vec![[0, 188, 255]]);
        let texture = Texture { name: "test".into(), width: 1, height: 1, texels };
        let linear = lookup(&texture, [0.3, 0.8]);
        assert_eq!(linear.x, 0.0);
        assert!((linear.y - 0.502_886_5).abs() < 1e-6, "{linear}");
        assert_eq!(linear.z, 1.0);
        assert!((LINEAR_OF_SRGB[10] - 0.003_035_27).abs() < 1e-8);
    }

    proptest! {
        #[test]
        fn any_coordinate_gives_a_value_between_the_texels(bits in any::<[u32; 2]>()) {
            let texture = gray(3, 2, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
            let found = value(&texture, f32::from_bits(bits[0]), f32::from_bits(bits[1]));
            prop_assert!((0.999..=6.001).contains(&found), "{found}");
        }
    }
}
