//! What is rendered, and how much of it: what rows, lines and pictures are told apart by.

use std::collections::BTreeSet;

use anyhow::bail;
use equilux_common::balancing::Word;
use equilux_common::job::{IMAGE_PIXELS_MAX, SIDE_PIXELS_MAX};
use equilux_simulator::case::Case;
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

use crate::table::time;

/// How much there was to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Extent {
    /// So many times the pixels of the scene.
    Size(u32),
    /// So many seconds of work of one worker.
    Work(f64),
}

/// A model, how much of it was rendered, and by what kind of cluster.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Subject {
    /// What the model is called, as in `Office`.
    pub(crate) model: String,
    /// How much there was to do.
    pub(crate) extent: Extent,
    /// What was the matter with the cluster.
    pub(crate) case: Case,
}

impl Extent {
    /// As tables have it.
    pub(crate) fn cell(self) -> String {
        match self {
            Self::Size(size) => size.to_string(),
            Self::Work(seconds) => time(seconds),
        }
    }

    /// The name of the column that it stands in.
    pub(crate) const fn column(self) -> &'static str {
        match self {
            Self::Size(_) => "Size",
            Self::Work(_) => "Work",
        }
    }
}

impl Subject {
    /// As pictures name it: `Office, size 9`.
    pub(crate) fn label(&self) -> String {
        let model = self.model_cell();
        match self.extent {
            Extent::Size(size) => format!("{model}, size {size}"),
            Extent::Work(seconds) => format!("{model}, {} s of work", time(seconds)),
        }
    }

    /// As tables name it: `Office`, or `Office, straggler`.
    pub(crate) fn model_cell(&self) -> String {
        match self.case_name() {
            Some(case) => format!("{}, {case}", self.model),
            None => self.model.clone(),
        }
    }

    /// The case, if it is not the even one.
    fn case_name(&self) -> Option<&'static str> {
        (self.case != Case::Even).then(|| self.case.name())
    }
}

/// The keys that tell rows of JSON apart. `case` is there if it is not the even one, `work_s` if an
/// amount of work was asked for; `size` is null then.
impl Serialize for Subject {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut keys = serializer.serialize_map(None)?;
        keys.serialize_entry("model", &self.model)?;
        if let Some(case) = self.case_name() {
            keys.serialize_entry("case", case)?;
        }
        match self.extent {
            Extent::Size(size) => keys.serialize_entry("size", &size)?,
            Extent::Work(seconds) => {
                keys.serialize_entry("size", &())?;
                keys.serialize_entry("work_s", &seconds)?;
            }
        }
        keys.end()
    }
}

/// Refuses sizes that make an image of `sides` larger than images may be.
pub(crate) fn check_sizes(sizes: &[u32], sides: (u32, u32)) -> anyhow::Result<()> {
    let (width, height) = (u64::from(sides.0), u64::from(sides.1));
    let size = u64::from(sizes.iter().max().copied().unwrap_or(1));
    let side = width.max(height);
    if width * height * size > IMAGE_PIXELS_MAX
        || side * side * size > u64::from(SIDE_PIXELS_MAX).pow(2)
    {
        bail!(
            "--sizes {size}: {width}x{height} pixels times {size} are more than an image may have; \
             choose a smaller size"
        );
    }
    Ok(())
}

/// Refuses two models of one name, which no table or picture could tell apart.
pub(crate) fn check_models<'a>(models: impl IntoIterator<Item = &'a str>) -> anyhow::Result<()> {
    let mut seen = BTreeSet::new();
    if let Some(twice) = models.into_iter().find(|&name| !seen.insert(name)) {
        bail!("two models are called `{twice}`; leave one out, or rename its directory or file");
    }
    Ok(())
}

/// A scene's name as tables have it: `Office` for `office`.
pub(crate) fn model_name(scene: &str) -> String {
    let mut letters = scene.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_beyond_the_largest_image_are_refused() {
        assert!(check_sizes(&[1, 9], (640, 480)).is_ok());
        let error = check_sizes(&[9, 1000], (640, 480)).unwrap_err().to_string();
        assert!(error.starts_with("--sizes 1000: 640x480 pixels"), "{error}");
        assert!(check_sizes(&[2], (60_000, 1)).is_err());
    }

    #[test]
    fn two_models_of_one_name_are_refused() {
        assert!(check_models(["A", "B"]).is_ok());
        assert!(check_models(["A", "B", "A"]).unwrap_err().to_string().contains("`A`"));
    }

    #[test]
    fn only_cases_other_than_the_even_one_are_named() {
        let subject = |case| Subject { model: "Office".into(), extent: Extent::Size(9), case };
        assert_eq!(subject(Case::Even).label(), "Office, size 9");
        assert_eq!(subject(Case::Straggler).label(), "Office, straggler, size 9");
    }

    #[test]
    fn models_begin_with_a_capital() {
        assert_eq!((model_name("office").as_str(), model_name("").as_str()), ("Office", ""));
    }
}
