//! The kinds of rays that are told apart, for a kernel that is fast with one may be slow with
//! another.

use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

/// A kind of rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// From the camera.
    Primary,
    /// From where camera rays hit, cosine-distributed.
    Diffuse1,
    /// From where those hit, likewise.
    Diffuse2,
    /// From where camera rays hit, to a point of a light.
    Shadow1,
    /// From where [`Kind::Diffuse1`] hit, likewise.
    Shadow2,
}

impl Kind {
    /// All, in the order of [`ByKind`].
    pub(super) const ALL: [Self; 5] =
        [Self::Primary, Self::Diffuse1, Self::Diffuse2, Self::Shadow1, Self::Shadow2];

    /// As tables and JSON have it.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Primary => "primary",
            Self::Diffuse1 => "diffuse1",
            Self::Diffuse2 => "diffuse2",
            Self::Shadow1 => "shadow1",
            Self::Shadow2 => "shadow2",
        }
    }

    /// Whether it is only asked if anything is in these rays' way.
    pub(super) const fn is_shadow(self) -> bool {
        matches!(self, Self::Shadow1 | Self::Shadow2)
    }
}

/// One thing for each kind of rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ByKind<T>(pub(super) [T; 5]);

impl<T> ByKind<T> {
    /// All, with their kinds.
    pub(super) fn iter(&self) -> impl Iterator<Item = (Kind, &T)> {
        Kind::ALL.into_iter().zip(&self.0)
    }

    /// What a function makes of each.
    pub(super) fn map<U>(&self, of: impl FnMut(&T) -> U) -> ByKind<U> {
        ByKind(self.0.each_ref().map(of))
    }
}

/// A key for each kind.
impl<T: Serialize> Serialize for ByKind<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut keys = serializer.serialize_map(Some(self.0.len()))?;
        for (kind, value) in self.iter() {
            keys.serialize_entry(kind.name(), value)?;
        }
        keys.end()
    }
}
