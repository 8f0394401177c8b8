//! What things are made of, and how MTL says it. The README of each scene
//! says how that is read.

use crate::number::numbers;

/// A material of an MTL file. Reflectances and emission are linear RGB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Material {
    pub(crate) name: &'static str,
    diffuse: [f64; 3],
    specular: [f64; 3],
    exponent: f64,
    emission: [f64; 3],
    illum: u8,
}

impl Material {
    /// Purely diffuse.
    pub(crate) const fn matte(name: &'static str, diffuse: [f64; 3]) -> Self {
        let none = [0.0; 3];
        Self { name, diffuse, specular: none, exponent: 0.0, emission: none, illum: 1 }
    }

    /// Diffuse under a gloss of reflectance `specular` and Phong exponent `exponent`.
    pub(crate) const fn glossy(
        name: &'static str,
        diffuse: [f64; 3],
        specular: f64,
        exponent: f64,
    ) -> Self {
        let matte = Self::matte(name, diffuse);
        Self { specular: [specular; 3], exponent, illum: 2, ..matte }
    }

    /// Metal: all gloss, coloured.
    pub(crate) const fn metal(name: &'static str, specular: [f64; 3], exponent: f64) -> Self {
        Self { specular, exponent, illum: 2, ..Self::matte(name, [0.0; 3]) }
    }

    /// A perfect mirror.
    pub(crate) const fn mirror(name: &'static str, specular: [f64; 3]) -> Self {
        Self { specular, illum: 3, ..Self::matte(name, [0.0; 3]) }
    }

    /// A light of this radiance (W·m⁻²·sr⁻¹ per channel), which leaves its front.
    pub(crate) const fn light(name: &'static str, emission: [f64; 3]) -> Self {
        Self { emission, ..Self::matte(name, [0.0; 3]) }
    }

    /// Whether it is that of a light source.
    pub(crate) fn emits(&self) -> bool {
        self.emission != [0.0; 3]
    }

    /// Its entry in an MTL file.
    pub(crate) fn to_mtl(self) -> String {
        let mut text = format!("newmtl {}\nKd {}\n", self.name, numbers(&self.diffuse, 4));
        if self.specular != [0.0; 3] {
            text += &format!("Ks {}\n", numbers(&self.specular, 4));
        }
        if self.exponent > 0.0 {
            text += &format!("Ns {}\n", numbers(&[self.exponent], 1));
        }
        if self.emits() {
            text += &format!("Ke {}\n", numbers(&self.emission, 4));
        }
        text + &format!("illum {}\n\n", self.illum)
    }

    /// Whether it reflects no more light than falls on it, in any channel.
    pub(crate) fn conserves_energy(&self) -> bool {
        let both = self.diffuse.iter().zip(self.specular);
        both.into_iter().all(|(kd, ks)| *kd >= 0.0 && ks >= 0.0 && kd + ks <= 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_entry_has_what_the_material_has() {
        let gloss = Material::glossy("varnish", [0.3, 0.2, 0.1], 0.04, 200.0);
        let text = "newmtl varnish\nKd 0.3 0.2 0.1\nKs 0.04 0.04 0.04\nNs 200\nillum 2\n\n";
        assert_eq!(gloss.to_mtl(), text);
        let lamp = Material::light("lamp", [1.0, 2.5, 3.0]);
        assert_eq!(lamp.to_mtl(), "newmtl lamp\nKd 0 0 0\nKe 1 2.5 3\nillum 1\n\n");
        assert!(lamp.emits() && !gloss.emits());
    }

    #[test]
    fn too_much_reflectance_is_told() {
        assert!(!Material::glossy("x", [0.5, 0.9, 0.1], 0.2, 10.0).conserves_energy());
        assert!(Material::glossy("x", [0.5, 0.7, 0.1], 0.2, 10.0).conserves_energy());
    }
}
