//! What a generator hands out: names and texts, in a fixed order. Writing them is for the caller.

/// A file of a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct File {
    /// Its name, relative to the scene's directory; without separators.
    pub name: String,
    /// What is in it.
    pub text: String,
}

/// What a scene consists of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counts {
    /// Geometric objects: those that do not emit.
    pub objects: u64,
    /// Light sources: objects that emit.
    pub lights: u64,
    /// Triangles of both, polygons of n corners counted as n − 2.
    pub triangles: u64,
}

/// All files of a scene, `scene.json` first.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Files {
    files: Vec<File>,
    counts: Counts,
}

impl Files {
    pub(crate) fn new(counts: Counts, named: Vec<(String, String)>) -> Self {
        let files = named.into_iter().map(|(name, text)| File { name, text }).collect();
        Self { files, counts }
    }

    /// The files, in a fixed order.
    pub fn iter(&self) -> std::slice::Iter<'_, File> {
        self.files.iter()
    }

    /// The text of the file of this name.
    #[must_use]
    pub fn text(&self, name: &str) -> Option<&str> {
        self.files.iter().find(|file| file.name == name).map(|file| file.text.as_str())
    }

    /// What the scene consists of.
    #[must_use]
    pub fn counts(&self) -> Counts {
        self.counts
    }
}

impl<'a> IntoIterator for &'a Files {
    type Item = &'a File;
    type IntoIter = std::slice::Iter<'a, File>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl IntoIterator for Files {
    type Item = File;
    type IntoIter = std::vec::IntoIter<File>;

    fn into_iter(self) -> Self::IntoIter {
        self.files.into_iter()
    }
}
