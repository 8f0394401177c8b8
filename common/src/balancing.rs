//! How work is spread while a job runs.

use std::str::FromStr;

/// Who moves work to whom.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Balance {
    /// Idle workers ask their neighbors, in amounts that a diffusion step gives.
    #[default]
    Diffusion,
    /// Idle workers ask one neighbor at a time, drawn at random, for half of what it has: the
    /// yardstick (Blumofe & Leiserson, *Scheduling multithreaded computations by work stealing*,
    /// 1999).
    Stealing,
    /// Everybody keeps what the start gave (the paper's T₁).
    None,
}

/// The form of the diffusion step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DiffusionStep {
    /// Of first order and explicit (Cybenko 1989).
    Explicit,
    /// Implicit, stable for every diffusivity (Heirich & Taylor 1995). It asks those far above the
    /// others and spares the rest, which takes fewer messages.
    #[default]
    Implicit,
}

/// What a worker gives away first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum GiveFirst {
    /// Camera samples that nobody has started.
    #[default]
    Samples,
    /// Rays closest to the end of their paths (the paper's section 3).
    Rays,
}

/// Whether partitions of a model that is cut are exchanged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Exchange {
    /// Who has no work takes copies of its neighbors' partitions, and rays with them (the paper's
    /// section 5.2).
    #[default]
    On,
    /// Every worker traces what it is home to.
    Off,
}

/// How the partitions of a model that is cut are given homes (the paper's section 5.1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mapping {
    /// In runs, in the order of a recursive bisection.
    #[default]
    Bisection,
    /// By diffusion, until partitions that exchange rays are at home together.
    Diffusion,
}

/// How work is spread while a job runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Balancing {
    /// Who moves work to whom.
    pub balance: Balance,
    /// With diffusion: by which step.
    pub step: DiffusionStep,
    /// What goes first.
    pub give_first: GiveFirst,
    /// With diffusion: whether copies of partitions go with the rays that need them.
    pub exchange: Exchange,
    /// Who is home to which partition.
    pub mapping: Mapping,
}

/// A word that names nothing.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{given}` is unknown; one of {expected} is expected")]
pub struct UnknownWord {
    given: String,
    expected: String,
}

/// A setting that has one word for each of its values, on the command line and in REST.
pub trait Word: Copy + Sized + 'static {
    /// Every value.
    const ALL: &'static [Self];

    /// The word for it.
    fn name(self) -> &'static str;

    /// All words.
    fn words() -> Vec<&'static str> {
        Self::ALL.iter().map(|value| value.name()).collect()
    }
}

macro_rules! words {
    ($($of:ident { $($variant:ident = $word:literal),+ })+) => {$(
        impl Word for $of {
            const ALL: &'static [Self] = &[$(Self::$variant),+];

            fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $word),+
                }
            }
        }

        impl FromStr for $of {
            type Err = UnknownWord;

            fn from_str(word: &str) -> Result<Self, UnknownWord> {
                let named = Self::ALL.iter().copied().find(|value| value.name() == word);
                let expected = || Self::words().join(", ");
                named.ok_or_else(|| UnknownWord { given: word.into(), expected: expected() })
            }
        }
    )+};
}

words! {
    Balance { Diffusion = "diffusion", Stealing = "stealing", None = "none" }
    DiffusionStep { Explicit = "explicit", Implicit = "implicit" }
    GiveFirst { Samples = "samples", Rays = "rays" }
    Exchange { On = "on", Off = "off" }
    Mapping { Bisection = "bisection", Diffusion = "diffusion" }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_word_is_read_as_it_is_written() {
        for balance in Balance::ALL {
            assert_eq!(balance.name().parse(), Ok(*balance));
        }
        let unknown = "stealin".parse::<Balance>().expect_err("no such word").to_string();
        assert_eq!(unknown, "`stealin` is unknown; one of diffusion, stealing, none is expected");
    }
}
