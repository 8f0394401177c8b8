//! MTL files, line by line.
//!
//! What the keys mean is decided in `material`; here they are only parsed and checked, so that
//! every complaint names its line.

use std::collections::{BTreeMap, BTreeSet};

use super::material::IOR_RANGE;
use super::scene_file::RADIANCE_MAX;
use super::texture::TextureRef;
use super::warnings::Warnings;
use crate::scene::error::{Place, SceneError};

/// Largest reflectance that is taken for a slip (and scaled down) rather than for nonsense.
const REFLECTANCE_MAX: f64 = 1000.0;

/// Largest Phong exponent: GGX's α is then 4·10⁻⁵, a mirror for every purpose.
const EXPONENT_MAX: f64 = 1e9;

/// Number of the last illumination model.
const ILLUM_MAX: f64 = 10.0;

/// Keys with textures and effects that this program does not have.
const IGNORED_MAPS: [&str; 13] = [
    "map_Ka", "map_Ks", "map_Ns", "map_d", "map_Ke", "map_Pr", "map_Pm", "map_Bump", "map_bump",
    "bump", "norm", "disp", "refl",
];

/// The keys of one material, as they stand in the file.
#[derive(Clone, Debug)]
pub(super) struct MtlMaterial {
    pub(super) name: String,
    pub(super) place: Place,
    /// `Kd`.
    pub(super) diffuse: Option<[f64; 3]>,
    /// `map_Kd`.
    pub(super) diffuse_texture: Option<TextureRef>,
    /// `Ks`.
    pub(super) specular: Option<[f64; 3]>,
    /// `Ns`.
    pub(super) shininess: Option<f64>,
    /// `Ke`.
    pub(super) emission: Option<[f64; 3]>,
    /// `Tf`.
    pub(super) filter: Option<[f64; 3]>,
    /// `Ni`.
    pub(super) ior: Option<f64>,
    /// `d`.
    pub(super) dissolve: Option<f64>,
    /// `Tr`.
    pub(super) transparency: Option<f64>,
    /// `illum`.
    pub(super) illum: Option<u8>,
    /// `Pr`.
    pub(super) roughness: Option<f64>,
    /// `Pm`.
    pub(super) metallic: Option<f64>,
}

/// A library of materials by name.
#[derive(Debug, Default)]
pub(super) struct MtlFile {
    materials: BTreeMap<String, MtlMaterial>,
}

impl MtlFile {
    /// Reads the text of the file called `file`.
    pub(super) fn read(
        file: &str,
        text: &str,
        warnings: &mut Warnings,
    ) -> Result<Self, SceneError> {
        let mut library = Self::default();
        let mut current: Option<MtlMaterial> = None;
        let mut ignored = BTreeSet::new();
        for (index, line) in text.lines().enumerate() {
            let line = Line::new(Place::line(file, index + 1), line);
            if line.key == "newmtl" {
                let started = MtlMaterial::named(&line)?;
                library.insert(current.replace(started), warnings);
            } else if let Some(material) = &mut current {
                material.set(&line, warnings)?;
                ignored.extend(IGNORED_MAPS.into_iter().find(|&key| key == line.key));
            } else if !line.key.is_empty() && !line.key.starts_with('#') {
                return Err(line.malformed("stands before the first \"newmtl\""));
            }
        }
        library.insert(current, warnings);
        if !ignored.is_empty() {
            let keys: Vec<&str> = ignored.into_iter().collect();
            warnings.push(format!("{file}: {} not supported and left out", keys.join(", ")));
        }
        Ok(library)
    }

    /// A material by its name.
    pub(super) fn get(&self, name: &str) -> Option<&MtlMaterial> {
        self.materials.get(name)
    }

    /// The names of all materials.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.materials.keys().map(String::as_str)
    }

    fn insert(&mut self, material: Option<MtlMaterial>, warnings: &mut Warnings) {
        let Some(material) = material else { return };
        if let Some(older) = self.materials.insert(material.name.clone(), material) {
            warnings.push(format!(
                "{}: material \"{}\" is described again further down, which holds",
                older.place, older.name
            ));
        }
    }
}

impl MtlMaterial {
    fn named(line: &Line<'_>) -> Result<Self, SceneError> {
        if line.rest.is_empty() {
            return Err(line.malformed("\"newmtl\" needs a name"));
        }
        Ok(Self {
            name: line.rest.to_owned(),
            place: line.place.clone(),
            diffuse: None,
            diffuse_texture: None,
            specular: None,
            shininess: None,
            emission: None,
            filter: None,
            ior: None,
            dissolve: None,
            transparency: None,
            illum: None,
            roughness: None,
            metallic: None,
        })
    }

    fn set(&mut self, line: &Line<'_>, warnings: &mut Warnings) -> Result<(), SceneError> {
        match line.key {
            "Kd" => self.diffuse = Some(line.color(REFLECTANCE_MAX)?),
            "Ks" => self.specular = Some(line.color(REFLECTANCE_MAX)?),
            "Tf" => self.filter = Some(line.color(REFLECTANCE_MAX)?),
            "Ke" => self.emission = Some(line.color(RADIANCE_MAX)?),
            "Ns" => self.shininess = Some(line.number(0.0..=EXPONENT_MAX)?),
            "Ni" => self.ior = Some(line.number(IOR_RANGE)?),
            "d" => self.dissolve = Some(line.number(0.0..=1.0)?),
            "Tr" => self.transparency = Some(line.number(0.0..=1.0)?),
            "Pr" => self.roughness = Some(line.number(0.0..=1.0)?),
            "Pm" => self.metallic = Some(line.number(0.0..=1.0)?),
            "illum" => self.illum = Some(line.illum()?),
            "map_Kd" | "map_kd" => self.diffuse_texture = Some(line.texture(warnings)?),
            _ => {}
        }
        Ok(())
    }
}

/// A line: its key and what follows.
struct Line<'a> {
    place: Place,
    key: &'a str,
    rest: &'a str,
}

impl<'a> Line<'a> {
    fn new(place: Place, line: &'a str) -> Self {
        let line = line.trim();
        let (key, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        Self { place, key, rest: rest.trim() }
    }

    fn malformed(&self, problem: &str) -> SceneError {
        SceneError::Malformed { place: self.place.clone(), problem: problem.to_owned() }
    }

    /// The words up to a comment.
    fn words(&self) -> impl Iterator<Item = &'a str> {
        self.rest.split('#').next().unwrap_or("").split_whitespace()
    }

    fn parse(&self, word: &str, range: &std::ops::RangeInclusive<f64>) -> Result<f64, SceneError> {
        let (least, most) = (range.start(), range.end());
        match word.parse::<f64>() {
            Ok(number) if range.contains(&number) => Ok(number),
            Ok(_) => {
                Err(self.malformed(&format!("{}: {word} is not from {least} to {most}", self.key)))
            }
            Err(_) => Err(self.malformed(&format!("{}: \"{word}\" is not a number", self.key))),
        }
    }

    /// The first number; `d` may have the option `-halo` before it.
    fn number(&self, range: std::ops::RangeInclusive<f64>) -> Result<f64, SceneError> {
        match self.words().find(|&word| word != "-halo") {
            Some(word) => self.parse(word, &range),
            None => Err(self.malformed(&format!("{}: the number is missing", self.key))),
        }
    }

    /// Three channels, or one for all three.
    fn color(&self, most: f64) -> Result<[f64; 3], SceneError> {
        let words: Vec<&str> = self.words().collect();
        if let Some(kind @ ("spectral" | "xyz")) = words.first().copied() {
            let key = self.key;
            return Err(self.malformed(&format!("{key}: \"{kind}\" is not read; give R G B")));
        }
        let range = 0.0..=most;
        match words[..] {
            [all] => Ok([self.parse(all, &range)?; 3]),
            [red, green, blue, ..] => Ok([
                self.parse(red, &range)?,
                self.parse(green, &range)?,
                self.parse(blue, &range)?,
            ]),
            _ => Err(self.malformed(&format!("{}: must be three numbers, R G B", self.key))),
        }
    }

    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the range was checked"
    )]
    fn illum(&self) -> Result<u8, SceneError> {
        let number = self.number(0.0..=ILLUM_MAX)?;
        if number.fract() == 0.0 {
            Ok(number as u8)
        } else {
            Err(self.malformed("illum: must be a whole number from 0 to 10"))
        }
    }

    /// The file name, which may hold spaces, after any options.
    fn texture(&self, warnings: &mut Warnings) -> Result<TextureRef, SceneError> {
        let mut rest = self.rest;
        while let Some((option, after)) = split_option(rest) {
            warnings.push(format!("{}: option {option} of {} is left out", self.place, self.key));
            rest = after;
        }
        if rest.is_empty() {
            return Err(self.malformed(&format!("{}: the file name is missing", self.key)));
        }
        Ok(TextureRef { file: rest.to_owned(), place: self.place.clone() })
    }
}

/// Takes an option with its values off the front of a texture statement.
fn split_option(text: &str) -> Option<(&str, &str)> {
    let next = |text: &'_ str| -> Option<(usize, usize)> {
        let start = text.len() - text.trim_start().len();
        let length = text[start..].find(char::is_whitespace).unwrap_or(text.len() - start);
        (length > 0).then_some((start, start + length))
    };
    let (start, end) = next(text)?;
    let option = &text[start..end];
    let (least, most) = match option {
        "-blendu" | "-blendv" | "-cc" | "-clamp" | "-imfchan" | "-texres" | "-bm" | "-boost"
        | "-type" => (1, 1),
        "-mm" => (2, 2),
        "-o" | "-s" | "-t" => (1, 3),
        _ => return None,
    };
    let mut rest = &text[end..];
    for count in 0..most {
        let Some((start, end)) = next(rest) else { break };
        if count >= least && rest[start..end].parse::<f64>().is_err() {
            break;
        }
        rest = &rest[end..];
    }
    Some((option, rest.trim_start()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read(text: &str) -> Result<MtlFile, SceneError> {
        MtlFile::read("a.mtl", text, &mut Warnings::default())
    }

    #[test]
    fn names_and_textures_may_hold_spaces() {
        let text = "# c\r\nnewmtl dark wood\r\nKd 0.5 # grey\r\nmap_Kd -s 1 2 -bm 1 a b.png\r\n";
        let file = read(text).unwrap();
        let material = file.get("dark wood").unwrap();
        assert_eq!(material.diffuse, Some([0.5; 3]));
        let texture = material.diffuse_texture.clone().unwrap();
        assert_eq!((texture.file.as_str(), texture.place.line), ("a b.png", Some(4)));
    }

    #[test]
    fn bad_numbers_name_file_and_line() {
        for (line, wanted) in [
            ("Kd 1 2", "a.mtl:2: Kd: must be three numbers, R G B"),
            ("Kd a b c", "a.mtl:2: Kd: \"a\" is not a number"),
            ("Kd nan 0 0", "a.mtl:2: Kd: nan is not from 0 to 1000"),
            ("Ke 0 -1 0", "a.mtl:2: Ke: -1 is not from 0 to 1000000000"),
            ("Ke inf 0 0", "a.mtl:2: Ke: inf is not"),
            ("Ns", "a.mtl:2: Ns: the number is missing"),
            ("d 2", "a.mtl:2: d: 2 is not from 0 to 1"),
            ("illum 2.5", "a.mtl:2: illum: must be a whole number"),
            ("map_Kd", "a.mtl:2: map_Kd: the file name is missing"),
            ("newmtl", "a.mtl:2: \"newmtl\" needs a name"),
        ] {
            let error = read(&format!("newmtl m\n{line}\n")).unwrap_err().to_string();
            assert!(error.starts_with(wanted), "{line}: {error}");
        }
        assert!(read("Kd 1 1 1").unwrap_err().to_string().contains("before the first"));
    }

    proptest! {
        #[test]
        fn arbitrary_text_never_panics(text in "(newmtl|Kd|map_Kd|illum|d|-s|\\PC| |\n|[0-9.-])*") {
            let _ = read(&text);
        }
    }
}
