//! Image files: which ones are asked for, and how they get there.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use equilux_common::image::{Image, write_atomically};

/// The forms that an image can be written in, by the ending of the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    /// All layers, as they are.
    Exr,
    /// The beauty layer through a tone curve.
    Png,
}

/// An image file that is asked for.
#[derive(Clone, Debug)]
pub(crate) struct Output {
    pub(crate) path: PathBuf,
    pub(crate) format: Format,
}

impl Output {
    /// Takes the files named on the command line, or `NAME.exr` after the scene where none is.
    pub(crate) fn of_arguments(files: &[PathBuf], scene: &Path) -> anyhow::Result<Vec<Self>> {
        if files.is_empty() {
            return Ok(vec![Self { path: default_name(scene), format: Format::Exr }]);
        }
        files.iter().map(|path| Self::new(path)).collect()
    }

    fn new(path: &Path) -> anyhow::Result<Self> {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_lowercase();
        let format = match extension.as_str() {
            "exr" => Format::Exr,
            "png" => Format::Png,
            _ => bail!("{}: an image file must end in .exr or .png", path.display()),
        };
        check_file(path)?;
        Ok(Self { path: path.to_path_buf(), format })
    }

    /// The same file's name for an image that is not whole: `NAME.partial.exr`.
    pub(crate) fn partial(&self) -> Self {
        let extension = match self.format {
            Format::Exr => "partial.exr",
            Format::Png => "partial.png",
        };
        Self { path: self.path.with_extension(extension), format: self.format }
    }

    /// Writes the image beside the file and renames it, so that the name never holds half an image.
    pub(crate) fn write(&self, image: &Image) -> anyhow::Result<()> {
        let bytes = match self.format {
            Format::Exr => image.to_exr(),
            Format::Png => image.to_png(),
        };
        let bytes = bytes.with_context(|| format!("{}", self.path.display()))?;
        self.write_bytes(&bytes)
    }

    /// Writes a file that is encoded already.
    pub(crate) fn write_bytes(&self, bytes: &[u8]) -> anyhow::Result<()> {
        Ok(write_atomically(&self.path, bytes)?)
    }
}

/// Makes sure, before the work begins, that a file of that name can be.
pub(crate) fn check_file(path: &Path) -> anyhow::Result<()> {
    if path.is_dir() {
        bail!("{}: is a directory; name a file in it", path.display());
    }
    match path.parent().filter(|parent| !parent.as_os_str().is_empty()) {
        Some(directory) if !directory.is_dir() => {
            bail!(
                "{}: there is no directory {}; make it first",
                path.display(),
                directory.display()
            )
        }
        _ => Ok(()),
    }
}

/// `office.exr` for `scenes/office/scene.json`, `bunny.exr` for `models/bunny.obj`.
fn default_name(scene: &Path) -> PathBuf {
    Path::new(name_of(scene)).with_extension("exr")
}

/// What a scene or a store is called: `office` for `scenes/office/scene.json`.
pub(crate) fn scene_name(scene: &Path) -> String {
    name_of(scene).to_string_lossy().into_owned()
}

fn name_of(scene: &Path) -> &OsStr {
    let stem = scene.file_stem().unwrap_or(OsStr::new("scene"));
    let parent = scene.parent().and_then(Path::file_name);
    match parent {
        Some(directory) if stem == "scene" || stem == "equilux" => directory,
        _ => stem,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_is_named_after_its_scene() {
        assert_eq!(default_name(Path::new("scenes/office/scene.json")), Path::new("office.exr"));
        assert_eq!(default_name(Path::new("models/bunny.obj")), Path::new("bunny.exr"));
        assert_eq!(default_name(Path::new("scene.json")), Path::new("scene.exr"));
        assert_eq!(default_name(Path::new("scenes/office/")), Path::new("office.exr"));
        assert_eq!(default_name(Path::new(".")), Path::new("scene.exr"));
        assert_eq!(scene_name(Path::new("scenes/office/scene.json")), "office");
    }

    #[test]
    fn other_endings_and_missing_directories_are_refused() {
        let scene = Path::new("scene.json");
        for name in ["a.jpg", "a", "missing-directory/a.exr"] {
            assert!(Output::of_arguments(&[name.into()], scene).is_err(), "{name}");
        }
        let outputs = Output::of_arguments(&["a.PNG".into()], scene).unwrap();
        assert_eq!(outputs[0].partial().path, Path::new("a.partial.png"));
    }
}
