//! What the city is made of: a finish is a material of the scene and a PLY file of its own.
//!
//! Colours are linear RGB. No surface has a texture: what looks like brick or paving is made of
//! triangles where the city is fine enough, and of one colour where it is not.

use crate::number::numbers;

/// Decimals of colours and radiances in the scene file.
const COLOR_DECIMALS: u32 = 4;

/// How a surface scatters or emits.
#[derive(Clone, Copy, Debug)]
enum Surface {
    /// Diffuse.
    Matte([f64; 3]),
    /// Diffuse under a coat of this roughness.
    Coated([f64; 3], f64),
    /// Metal, or glass with a metallic film, of this roughness.
    Metal([f64; 3], f64),
    /// A light of this radiance, on the front of its faces.
    Light([f64; 3]),
}

/// Declares the finishes with their names and surfaces, so that a file has one place.
macro_rules! finishes {
    ($($variant:ident $name:literal $surface:expr;)*) => {
        /// A material of the city.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        #[repr(u8)]
        pub(super) enum Finish { $(
            #[doc = $name]
            $variant,
        )* }

        impl Finish {
            /// All of them, in the order of their files.
            pub(super) const ALL: [Self; [$($name),*].len()] = [$(Self::$variant),*];

            /// Its name in the scene file, and that of its PLY file without the ending.
            pub(super) const fn name(self) -> &'static str {
                match self { $(Self::$variant => $name,)* }
            }

            const fn surface(self) -> Surface {
                match self { $(Self::$variant => $surface,)* }
            }
        }
    };
}

use Surface::{Coated, Light, Matte, Metal};

finishes! {
    Ground "ground" Matte([0.13, 0.12, 0.1]);
    Asphalt "asphalt" Coated([0.055, 0.055, 0.058], 0.75);
    Marking "marking" Matte([0.62, 0.61, 0.57]);
    Pavement "pavement" Matte([0.31, 0.3, 0.28]);
    Kerb "kerb" Matte([0.4, 0.39, 0.37]);
    Lawn "lawn" Matte([0.1, 0.17, 0.045]);
    RedBrick "brick-red" Matte([0.33, 0.125, 0.075]);
    BrownBrick "brick-brown" Matte([0.235, 0.14, 0.09]);
    PaleBrick "brick-pale" Matte([0.46, 0.335, 0.215]);
    Limestone "limestone" Matte([0.55, 0.48, 0.375]);
    Concrete "concrete" Matte([0.38, 0.37, 0.35]);
    Plaster "plaster" Matte([0.62, 0.53, 0.38]);
    Panel "panel" Metal([0.46, 0.47, 0.49], 0.42);
    DarkFrame "frame-dark" Coated([0.03, 0.03, 0.032], 0.4);
    WhiteFrame "frame-white" Coated([0.6, 0.59, 0.56], 0.4);
    Trim "trim" Matte([0.5, 0.46, 0.4]);
    Glass "glass" Coated([0.016, 0.021, 0.025], 0.12);
    TintedGlass "glass-tinted" Metal([0.16, 0.22, 0.26], 0.16);
    Blind "blind" Matte([0.5, 0.47, 0.4]);
    Roof "roof" Matte([0.15, 0.145, 0.14]);
    PaleRoof "roof-pale" Matte([0.36, 0.35, 0.33]);
    Steel "steel" Metal([0.5, 0.5, 0.5], 0.45);
    Copper "copper" Coated([0.14, 0.33, 0.26], 0.6);
    Wood "wood" Matte([0.23, 0.13, 0.07]);
    Bark "bark" Matte([0.12, 0.085, 0.06]);
    Leaf "leaf" Matte([0.11, 0.2, 0.04]);
    DarkLeaf "leaf-dark" Matte([0.06, 0.125, 0.03]);
    GoldenLeaf "leaf-golden" Matte([0.36, 0.23, 0.045]);
    WhitePaint "car-white" Coated([0.62, 0.62, 0.61], 0.22);
    BlackPaint "car-black" Coated([0.02, 0.021, 0.024], 0.2);
    RedPaint "car-red" Coated([0.42, 0.03, 0.025], 0.22);
    BluePaint "car-blue" Coated([0.04, 0.1, 0.26], 0.22);
    TaxiPaint "car-taxi" Coated([0.72, 0.42, 0.02], 0.25);
    Rubber "rubber" Matte([0.025, 0.025, 0.025]);
    WarmWindow "window-warm" Light([2.6, 1.55, 0.62]);
    PaleWindow "window-pale" Light([1.5, 1.45, 1.25]);
    Lamp "lamp" Light([9.0, 6.6, 3.4]);
    RedSign "sign-red" Light([3.2, 0.28, 0.16]);
    BlueSign "sign-blue" Light([0.25, 1.0, 3.0]);
}

impl Finish {
    /// Whether it is that of a light.
    pub(super) const fn emits(self) -> bool {
        matches!(self.surface(), Light(_))
    }

    /// The name of its PLY file.
    pub(super) fn file(self) -> String {
        format!("{}.ply", self.name())
    }

    /// What the scene file says of it.
    pub(super) fn to_json(self) -> String {
        let list = |color: [f64; 3]| numbers(&color, COLOR_DECIMALS).replace(' ', ", ");
        let pbr = |base, roughness, metallic| {
            let roughness = numbers(&[roughness], COLOR_DECIMALS);
            let base = list(base);
            format!(
                "{{ \"type\": \"pbr\", \"base\": [{base}], \"roughness\": {roughness}, \
                 \"metallic\": {metallic} }}"
            )
        };
        match self.surface() {
            Matte(color) => format!("{{ \"type\": \"plain\", \"diffuse\": [{}] }}", list(color)),
            Coated(base, roughness) => pbr(base, roughness, 0),
            Metal(base, roughness) => pbr(base, roughness, 1),
            Light(radiance) => {
                format!("{{ \"type\": \"plain\", \"emission\": [{}] }}", list(radiance))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finishes_have_names_of_their_own_and_reflect_no_more_than_arrives() {
        for (index, finish) in Finish::ALL.into_iter().enumerate() {
            assert_eq!(finish as usize, index);
            assert!(Finish::ALL[..index].iter().all(|other| other.name() != finish.name()));
            match finish.surface() {
                Matte(color) | Coated(color, _) | Metal(color, _) => {
                    assert!(color.iter().all(|c| (0.0..0.9).contains(c)), "{finish:?}");
                }
                Light(radiance) => assert!(radiance.iter().all(|c| *c > 0.0), "{finish:?}"),
            }
        }
    }

    #[test]
    fn a_finish_is_told_as_the_scene_file_wants_it() {
        let lamp = r#"{ "type": "plain", "emission": [9, 6.6, 3.4] }"#;
        assert_eq!(Finish::Lamp.to_json(), lamp);
        let rubber = r#"{ "type": "plain", "diffuse": [0.025, 0.025, 0.025] }"#;
        assert_eq!(Finish::Rubber.to_json(), rubber);
        let steel =
            r#"{ "type": "pbr", "base": [0.5, 0.5, 0.5], "roughness": 0.45, "metallic": 1 }"#;
        assert_eq!(Finish::Steel.to_json(), steel);
    }
}
