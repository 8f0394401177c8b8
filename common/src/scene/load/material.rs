//! How materials are read: from the keys of an MTL file, and from overrides in a scene file.
//!
//! The reading is documented for users in `docs/materials.md`; keep the two in step.

use super::json::{Fields, Node, single};
use super::mtl::MtlMaterial;
use super::scene_file::RADIANCE_MAX;
use super::texture::TextureRef;
use super::warnings::Warnings;
use crate::scene::error::{SceneError, nearest};
use crate::scene::{Material, Surface};

/// Every key that some override may have.
pub(super) const MATERIAL_KEYS: [&str; 14] = [
    "type",
    "emission",
    "opacity",
    "diffuse",
    "diffuse_texture",
    "specular",
    "alpha",
    "reflectance",
    "ior",
    "transmittance",
    "base",
    "base_texture",
    "roughness",
    "metallic",
];

/// Index of refraction where none is given: window glass.
const IOR_DEFAULT: f64 = 1.5;

/// Indices of refraction that are believed.
pub(super) const IOR_RANGE: std::ops::RangeInclusive<f64> = 0.1..=10.0;

/// Least roughness of gloss: smoother surfaces are mirrors and should say so.
const ALPHA_MIN: f64 = 1e-4;

/// Reflectance of what no file says anything about: a middle grey.
const GREY: [f32; 3] = [0.5; 3];

/// Black: what emitters reflect.
const BLACK: [f32; 3] = [0.0; 3];

/// What the sum of diffuse and specular may exceed 1 by before it is taken for a mistake rather
/// than for decimals that were rounded.
const ENERGY_SLACK: f64 = 1e-6;

/// A material whose texture has not been read yet.
#[derive(Clone, Debug)]
pub(super) struct MaterialEntry {
    pub(super) material: Material,
    pub(super) texture: Option<TextureRef>,
}

/// What a scene file changes about a material.
#[derive(Clone, Debug)]
pub(super) struct Override {
    pub(super) place: crate::scene::error::Place,
    surface: Option<(Surface, Option<TextureRef>)>,
    emission: Option<[f32; 3]>,
    opacity: Option<f32>,
}

impl MaterialEntry {
    /// The material of faces that name none, or one that is nowhere described.
    pub(super) fn grey(name: &str) -> Self {
        let surface = lambert(GREY);
        let material = Material { name: name.to_owned(), emission: BLACK, surface, opacity: 1.0 };
        Self { material, texture: None }
    }

    /// Reads an MTL material.
    pub(super) fn from_mtl(mtl: &MtlMaterial, warnings: &mut Warnings) -> Self {
        let emission = mtl.emission.unwrap_or([0.0; 3]).map(single);
        let is_emitter = emission != BLACK;
        let surface = if is_emitter { lambert(BLACK) } else { surface_of(mtl, warnings) };
        let takes_texture = matches!(surface, Surface::Plain { .. } | Surface::Pbr { .. });
        let texture = mtl.diffuse_texture.clone().filter(|_| takes_texture && !is_emitter);
        let opacity = if is_glass(mtl) && !is_emitter { 1.0 } else { opacity_of(mtl) };
        let name = mtl.name.clone();
        Self { material: Material { name, emission, surface, opacity }, texture }
    }

    /// Applies what the scene file says.
    pub(super) fn change(&mut self, change: &Override, warnings: &mut Warnings) {
        if let Some((surface, texture)) = &change.surface {
            self.material.surface = surface.clone();
            self.texture.clone_from(texture);
            if let Surface::Plain { diffuse, specular, .. } = &mut self.material.surface {
                let subject = format!("{}: material \"{}\"", change.place, self.material.name);
                conserve(diffuse, specular, &subject, warnings);
            }
        }
        if let Some(emission) = change.emission {
            self.material.emission = emission;
        }
        if let Some(opacity) = change.opacity {
            self.material.opacity = opacity;
        }
        if self.material.emission != BLACK {
            self.material.surface = lambert(BLACK);
            self.texture = None;
        }
    }
}

const fn lambert(diffuse: [f32; 3]) -> Surface {
    Surface::Plain { diffuse, diffuse_texture: None, specular: BLACK, alpha: 1.0 }
}

fn is_glass(mtl: &MtlMaterial) -> bool {
    matches!(mtl.illum, Some(4 | 6 | 7 | 9))
}

fn opacity_of(mtl: &MtlMaterial) -> f32 {
    let transparent = mtl.transparency.map(|transparency| 1.0 - transparency);
    single(mtl.dissolve.or(transparent).unwrap_or(1.0))
}

fn surface_of(mtl: &MtlMaterial, warnings: &mut Warnings) -> Surface {
    let unsaid = match (&mtl.diffuse_texture, mtl.specular) {
        (Some(_), _) => 1.0,
        (None, Some(_)) => 0.0,
        (None, None) => f64::from(GREY[0]),
    };
    let diffuse = mtl.diffuse.unwrap_or([unsaid; 3]);
    let specular = mtl.specular.unwrap_or([0.0; 3]);
    let is_specular = specular != [0.0; 3];
    match mtl.illum {
        _ if is_glass(mtl) => glass_of(mtl),
        _ if mtl.roughness.is_some() || mtl.metallic.is_some() => pbr_of(mtl, diffuse, warnings),
        Some(3 | 5) => {
            let mut reflectance = specular.map(single);
            conserve(&mut reflectance, &mut { BLACK }, &subject(mtl), warnings);
            Surface::Mirror { reflectance }
        }
        Some(2 | 8) | None if is_specular => {
            let (mut diffuse, mut specular) = (diffuse.map(single), specular.map(single));
            conserve(&mut diffuse, &mut specular, &subject(mtl), warnings);
            let alpha = alpha_of(mtl.shininess.unwrap_or(0.0));
            Surface::Plain { diffuse, diffuse_texture: None, specular, alpha }
        }
        _ => {
            let mut diffuse = diffuse.map(single);
            conserve(&mut diffuse, &mut { BLACK }, &subject(mtl), warnings);
            lambert(diffuse)
        }
    }
}

/// Light is let through as `Tf` says; files without it often mean `Kd`, and black means that they
/// mean nothing at all.
fn glass_of(mtl: &MtlMaterial) -> Surface {
    let tint = mtl.diffuse.filter(|diffuse| *diffuse != [0.0; 3]);
    let transmittance = mtl.filter.or(tint).unwrap_or([1.0; 3]);
    Surface::Glass {
        ior: single(mtl.ior.unwrap_or(IOR_DEFAULT)),
        transmittance: transmittance.map(|channel| single(channel.min(1.0))),
    }
}

fn pbr_of(mtl: &MtlMaterial, diffuse: [f64; 3], warnings: &mut Warnings) -> Surface {
    const ROUGHNESS_DEFAULT: f64 = 0.5;
    let mut base = diffuse.map(single);
    conserve(&mut base, &mut { BLACK }, &subject(mtl), warnings);
    Surface::Pbr {
        base,
        base_texture: None,
        roughness: single(mtl.roughness.unwrap_or(ROUGHNESS_DEFAULT)),
        metallic: single(mtl.metallic.unwrap_or(0.0)),
    }
}

/// GGX's α for a Phong exponent (Walter et al. 2007, section 5.2: equal width of the lobe).
fn alpha_of(exponent: f64) -> f32 {
    single((2.0 / (exponent + 2.0)).sqrt())
}

fn subject(mtl: &MtlMaterial) -> String {
    format!("{}: material \"{}\"", mtl.place, mtl.name)
}

/// Scales both reflectances down where together they give back more light than there is.
fn conserve(
    diffuse: &mut [f32; 3],
    specular: &mut [f32; 3],
    subject: &str,
    warnings: &mut Warnings,
) {
    let sums = (0..3).map(|channel| f64::from(diffuse[channel]) + f64::from(specular[channel]));
    let most = sums.fold(0.0, f64::max);
    if most <= 1.0 + ENERGY_SLACK {
        return;
    }
    for channel in diffuse.iter_mut().chain(specular) {
        *channel = single(f64::from(*channel) / most);
    }
    warnings.push(format!(
        "{subject} reflects {most} times the light that it gets; it is scaled down to 1"
    ));
}

impl Override {
    /// Reads one; `type` replaces the whole surface, without it the surface stays.
    pub(super) fn read(node: &Node<'_>) -> Result<Self, SceneError> {
        let fields = node.fields(&MATERIAL_KEYS)?;
        let emission = fields.get("emission").map(|node| node.triple(0.0..=RADIANCE_MAX));
        let opacity = fields.get("opacity").map(|node| node.float(0.0..=1.0));
        let surface = match fields.get("type") {
            Some(kind) => Some(read_surface(&kind, &fields)?),
            None => {
                allow(&fields, &[], "needs a \"type\": plain, mirror, glass or pbr")?;
                None
            }
        };
        let (emission, opacity) = (emission.transpose()?, opacity.transpose()?);
        Ok(Self { place: node.place(), surface, emission, opacity })
    }
}

fn read_surface(
    kind: &Node<'_>,
    fields: &Fields<'_>,
) -> Result<(Surface, Option<TextureRef>), SceneError> {
    let fraction =
        |key: &str, default: f32| fields.get(key).map_or(Ok(default), |node| node.float(0.0..=1.0));
    let color = |key: &str, default: [f32; 3]| {
        fields.get(key).map_or(Ok(default), |node| node.triple(0.0..=1.0))
    };
    let alpha = || fields.get("alpha").map_or(Ok(0.1), |node| node.float(ALPHA_MIN..=1.0));
    let texture = |key: &str| fields.get(key).map(|node| texture_of(&node)).transpose();
    let colored = |key: &str, texture: &Option<TextureRef>| {
        color(key, if texture.is_some() { [1.0; 3] } else { GREY })
    };
    match kind.word(&["plain", "mirror", "glass", "pbr"])? {
        "plain" => {
            allow(fields, &["diffuse", "diffuse_texture", "specular", "alpha"], "is not of plain")?;
            let image = texture("diffuse_texture")?;
            let diffuse = colored("diffuse", &image)?;
            let (specular, alpha) = (color("specular", BLACK)?, alpha()?);
            Ok((Surface::Plain { diffuse, diffuse_texture: None, specular, alpha }, image))
        }
        "mirror" => {
            allow(fields, &["reflectance"], "is not of mirror")?;
            Ok((Surface::Mirror { reflectance: color("reflectance", [1.0; 3])? }, None))
        }
        "glass" => {
            allow(fields, &["ior", "transmittance"], "is not of glass")?;
            let ior = fields.get("ior").map_or(Ok(IOR_DEFAULT), |node| node.number(IOR_RANGE))?;
            let transmittance = color("transmittance", [1.0; 3])?;
            Ok((Surface::Glass { ior: single(ior), transmittance }, None))
        }
        _ => {
            allow(fields, &["base", "base_texture", "roughness", "metallic"], "is not of pbr")?;
            let image = texture("base_texture")?;
            let base = colored("base", &image)?;
            let (roughness, metallic) = (fraction("roughness", 0.5)?, fraction("metallic", 0.0)?);
            Ok((Surface::Pbr { base, base_texture: None, roughness, metallic }, image))
        }
    }
}

fn texture_of(node: &Node<'_>) -> Result<TextureRef, SceneError> {
    Ok(TextureRef { file: node.string()?, place: node.place() })
}

/// Makes sure that no parameter of another type of surface is given.
fn allow(fields: &Fields<'_>, own: &[&str], problem: &str) -> Result<(), SceneError> {
    const ALWAYS: [&str; 3] = ["type", "emission", "opacity"];
    for (key, node) in fields.members() {
        if !own.contains(&key) && !ALWAYS.contains(&key) {
            let known = own.iter().chain(&ALWAYS).copied();
            let hint = match nearest(key, known) {
                Some(name) if !own.is_empty() => format!("; did you mean \"{name}\"?"),
                _ => String::new(),
            };
            return Err(node.invalid(format!("{problem}{hint}")));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::load::json::Document;
    use crate::scene::load::mtl::MtlFile;

    fn material(keys: &str) -> (MaterialEntry, Vec<String>) {
        let text = format!("newmtl m\n{keys}\n");
        let mut warnings = Warnings::default();
        let file = MtlFile::read("a.mtl", &text, &mut warnings).unwrap();
        let entry = MaterialEntry::from_mtl(file.get("m").unwrap(), &mut warnings);
        (entry, warnings.into_messages())
    }

    fn surface(keys: &str) -> Surface {
        material(keys).0.material.surface
    }

    #[test]
    fn plain_mtl_is_read_by_the_contract() {
        let plain = Surface::Plain {
            diffuse: [0.5; 3],
            diffuse_texture: None,
            specular: [0.25; 3],
            alpha: 0.1,
        };
        let keys = "Kd .5 .5 .5\nKs .25 .25 .25\nNs 198";
        assert_eq!(surface(&format!("{keys}\nillum 2")), plain);
        assert_eq!(surface(keys), plain);
        assert_eq!(surface(&format!("{keys}\nillum 1")), lambert([0.5; 3]));
        assert_eq!(
            surface(&format!("{keys}\nillum 3")),
            Surface::Mirror { reflectance: [0.25; 3] }
        );
        assert_eq!(surface("Kd 1 0 0"), lambert([1.0, 0.0, 0.0]));
    }

    #[test]
    fn emitters_reflect_nothing() {
        let (entry, _) = material("Kd 1 1 1\nKe 3 2 1\nmap_Kd a.png");
        assert_eq!(entry.material.emission, [3.0, 2.0, 1.0]);
        assert_eq!(entry.material.surface, lambert(BLACK));
        assert!(entry.texture.is_none());
    }

    #[test]
    fn transparency_is_glass_or_opacity() {
        let glass = Surface::Glass { ior: 1.33, transmittance: [0.8, 0.9, 1.0] };
        let (entry, _) = material("illum 7\nNi 1.33\nKd .8 .9 1\nd 0.1");
        assert_eq!((entry.material.surface, entry.material.opacity), (glass, 1.0));
        assert_eq!(material("Kd 1 1 1\nTr 0.75").0.material.opacity, 0.25);
        assert_eq!(material("Kd 1 1 1\nTr 0.75\nd 0.5").0.material.opacity, 0.5);
        let clear = Surface::Glass { ior: 1.5, transmittance: [1.0; 3] };
        assert_eq!(surface("illum 4\nKd 0 0 0"), clear);
    }

    #[test]
    fn the_pbr_extension_is_read() {
        let pbr =
            Surface::Pbr { base: [0.5; 3], base_texture: None, roughness: 0.25, metallic: 1.0 };
        assert_eq!(surface("Kd .5 .5 .5\nPr .25\nPm 1\nillum 2\nKs 1 1 1"), pbr);
    }

    #[test]
    fn too_much_light_is_scaled_down_with_a_warning() {
        let (entry, warnings) = material("Kd .75 .5 0\nKs .75 .5 0\nNs 10\nillum 2");
        let Surface::Plain { diffuse, specular, .. } = entry.material.surface else { panic!() };
        assert_eq!(diffuse, specular);
        assert_eq!(diffuse[0], 0.5);
        assert!(warnings[0].starts_with("a.mtl:1: material \"m\" reflects 1.5 times"));
        assert!(material("Kd .7 .7 .7\nKs .3 .3 .3\nillum 2").1.is_empty());
    }

    #[test]
    fn overrides_replace_the_surface_or_leave_it() {
        let read =
            |text: &str| Override::read(&Node::root(&Document::new("s.json", text)).unwrap());
        let mut warnings = Warnings::default();
        let mut entry = MaterialEntry::grey("m");
        entry.change(&read(r#"{"opacity": 0.5}"#).unwrap(), &mut warnings);
        assert_eq!((entry.material.opacity, &entry.material.surface), (0.5, &lambert(GREY)));
        let mirror = read(r#"{"type": "mirror", "reflectance": [1, 1, 0.5]}"#).unwrap();
        entry.change(&mirror, &mut warnings);
        assert_eq!(entry.material.surface, Surface::Mirror { reflectance: [1.0, 1.0, 0.5] });
        let error = read(r#"{"type": "mirror", "diffuse": [1, 1, 1]}"#).unwrap_err().to_string();
        assert!(error.contains("s.json:1: diffuse: is not of mirror"), "{error}");
        let error = read(r#"{"diffuse": [1, 1, 1]}"#).unwrap_err().to_string();
        assert!(error.contains("needs a \"type\""), "{error}");
        let error = read(r#"{"type": "glass", "ior": -1}"#).unwrap_err().to_string();
        assert!(error.contains("ior: -1 is not from 0.1 to 10"), "{error}");
    }
}
