//! What a submission says besides its scene: settings that go before those of the scene file.

use equilux_common::job::{PerDepth, Settings};
use std::str::FromStr;
use std::sync::Arc;

use equilux_common::balancing::Balancing;
use equilux_common::scene::error::nearest;
use equilux_common::topology::{Graph, InvalidGraph, Topology};
use equilux_common::unit::Rect;
use serde_json::Value;

use super::problem::Problem;

/// Settings of a submission; what is not given stays as the scene file has it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Wishes {
    spp: Option<u32>,
    width: Option<u32>,
    height: Option<u32>,
    max_depth: Option<u32>,
    seed: Option<u64>,
    crop: Option<Rect>,
    light_samples: Option<PerDepth>,
    indirect_samples: Option<PerDepth>,
    /// The camera's name in the scene.
    pub(crate) camera: Option<String>,
    /// How work is spread.
    pub(crate) balancing: Balancing,
    /// Who exchanges work with whom.
    pub(crate) topology: Topology,
    /// What people call the job.
    pub(crate) name: Option<String>,
    /// Do not start with fewer workers than this.
    pub(crate) workers_min: Option<u32>,
}

/// All fields, for messages.
const FIELDS: [&str; 17] = [
    "spp",
    "width",
    "height",
    "max_depth",
    "seed",
    "crop",
    "light_samples",
    "indirect_samples",
    "camera",
    "balance",
    "diffusion_step",
    "give_first",
    "exchange",
    "mapping",
    "topology",
    "name",
    "workers_min",
];

/// A field that is not understood.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum InvalidWish {
    /// There is no such field.
    #[error("unknown field `{field}`; {remedy}")]
    Unknown {
        /// The field.
        field: String,
        /// What to write instead.
        remedy: String,
    },
    /// Edges that make no topology.
    #[error("topology: {0}")]
    Topology(InvalidGraph),
    /// Its value is none that it can have.
    #[error("{field}: {given} is not {expected}")]
    Value {
        /// The field.
        field: &'static str,
        /// The value.
        given: String,
        /// What is expected.
        expected: &'static str,
    },
}

impl From<InvalidWish> for Problem {
    fn from(error: InvalidWish) -> Self {
        Self::invalid(error.to_string())
    }
}

impl Wishes {
    /// Takes a field of a JSON submission.
    pub(crate) fn set(&mut self, field: &str, value: &Value) -> Result<(), InvalidWish> {
        let Some(field) = FIELDS.into_iter().find(|known| *known == field) else {
            return Err(InvalidWish::unknown(field));
        };
        let given = Given { field, value };
        match field {
            "spp" => self.spp = Some(given.number()?),
            "width" => self.width = Some(given.number()?),
            "height" => self.height = Some(given.number()?),
            "max_depth" => self.max_depth = Some(given.number()?),
            "seed" => self.seed = Some(given.seed()?),
            "crop" => self.crop = Some(given.crop()?),
            "light_samples" => self.light_samples = Some(given.per_depth()?),
            "indirect_samples" => self.indirect_samples = Some(given.per_depth()?),
            "camera" => self.camera = Some(given.text()?.to_owned()),
            "balance" => self.balancing.balance = given.word("one of diffusion, stealing, none")?,
            "diffusion_step" => self.balancing.step = given.word("explicit or implicit")?,
            "give_first" => self.balancing.give_first = given.word("samples or rays")?,
            "exchange" => self.balancing.exchange = given.word("on or off")?,
            "mapping" => self.balancing.mapping = given.word("bisection or diffusion")?,
            "topology" => self.topology = given.topology()?,
            "name" => self.name = Some(given.name()?),
            "workers_min" => self.workers_min = Some(given.number()?),
            _ => unreachable!("`{field}` is in the list of fields"),
        }
        Ok(())
    }

    /// Takes a field of a form, where everything is text: numbers and lists as in JSON.
    pub(crate) fn set_text(&mut self, field: &str, text: &str) -> Result<(), InvalidWish> {
        let is_text = !text.starts_with("[[")
            && matches!(
                field,
                "camera"
                    | "balance"
                    | "diffusion_step"
                    | "give_first"
                    | "exchange"
                    | "mapping"
                    | "topology"
                    | "name"
            );
        let parsed = if is_text { None } else { serde_json::from_str(text.trim()).ok() };
        let listed = || (field == "crop").then(|| serde_json::from_str(&format!("[{text}]")).ok());
        let value = parsed.or_else(|| listed().flatten());
        self.set(field, &value.unwrap_or_else(|| Value::String(text.into())))
    }

    /// The settings of the scene with what is wished for in their place.
    pub(crate) fn applied_to(&self, settings: Settings) -> Settings {
        Settings {
            width: self.width.unwrap_or(settings.width),
            height: self.height.unwrap_or(settings.height),
            crop: self.crop.or(settings.crop),
            samples_per_pixel: self.spp.unwrap_or(settings.samples_per_pixel),
            max_depth: self.max_depth.unwrap_or(settings.max_depth),
            seed: self.seed.unwrap_or(settings.seed),
            light_samples: self.light_samples.clone().unwrap_or(settings.light_samples),
            indirect_samples: self.indirect_samples.clone().unwrap_or(settings.indirect_samples),
            filter: settings.filter,
            roulette_depth: settings.roulette_depth,
        }
    }
}

impl InvalidWish {
    fn unknown(field: &str) -> Self {
        let remedy = match nearest(field, FIELDS) {
            Some(known) => format!("did you mean `{known}`?"),
            None => format!("known are scene, entry, {}", FIELDS.join(", ")),
        };
        Self::Unknown { field: shortened(field), remedy }
    }
}

/// A value that is to be read as a field's.
#[derive(Clone, Copy)]
struct Given<'a> {
    field: &'static str,
    value: &'a Value,
}

impl<'a> Given<'a> {
    fn number(self) -> Result<u32, InvalidWish> {
        let number = self.value.as_u64().and_then(|number| u32::try_from(number).ok());
        number.ok_or_else(|| self.wrong("a whole number from 0 to 4294967295"))
    }

    fn seed(self) -> Result<u64, InvalidWish> {
        self.value.as_u64().ok_or_else(|| self.wrong("a whole number from 0 to 2^64 - 1"))
    }

    fn text(self) -> Result<&'a str, InvalidWish> {
        self.value.as_str().ok_or_else(|| self.wrong("a text"))
    }

    fn name(self) -> Result<String, InvalidWish> {
        let name = self.text()?;
        if name.chars().any(char::is_control) {
            return Err(self.wrong("a text without control characters"));
        }
        Ok(name.to_owned())
    }

    fn numbers(self) -> Option<Vec<u32>> {
        let numbers = self.value.as_array()?.iter();
        numbers.map(|number| u32::try_from(number.as_u64()?).ok()).collect()
    }

    fn crop(self) -> Result<Rect, InvalidWish> {
        match self.numbers().as_deref() {
            Some(&[x0, y0, x1, y1]) if x0 < x1 && y0 < y1 => Ok(Rect { x0, y0, x1, y1 }),
            _ => Err(self.wrong("[x0, y0, x1, y1] with x0 < x1 and y0 < y1")),
        }
    }

    fn per_depth(self) -> Result<PerDepth, InvalidWish> {
        let numbers = self.number().map(|number| vec![number]).ok().or_else(|| self.numbers());
        let counts = numbers.and_then(|numbers| PerDepth::new(numbers).ok());
        counts.ok_or_else(|| self.wrong("a count from 0 to 1024, or a list of one per depth"))
    }

    fn word<T: FromStr>(self, expected: &'static str) -> Result<T, InvalidWish> {
        let value = self.value.as_str().and_then(|word| word.parse().ok());
        value.ok_or_else(|| self.wrong(expected))
    }

    fn topology(self) -> Result<Topology, InvalidWish> {
        if self.value.is_array() {
            let edges: Vec<[usize; 2]> = serde_json::from_value(self.value.clone())
                .map_err(|_| self.wrong("a list of edges, as in [[0, 1], [1, 2]]"))?;
            let graph = Graph::new(&edges).map_err(InvalidWish::Topology)?;
            return Ok(Topology::Graph(Arc::new(graph)));
        }
        self.word("complete, ring, torus2d, torus3d, hypercube or a list of edges")
    }

    fn wrong(self, expected: &'static str) -> InvalidWish {
        InvalidWish::Value {
            field: self.field,
            given: shortened(&self.value.to_string()),
            expected,
        }
    }
}

/// A value short enough for a message.
pub(crate) fn shortened(text: &str) -> String {
    const CHARACTERS_MAX: usize = 100;
    if text.chars().count() <= CHARACTERS_MAX {
        return text.into();
    }
    text.chars().take(CHARACTERS_MAX).chain(['…']).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use equilux_common::balancing::Balance;
    use serde_json::json;

    #[test]
    fn json_and_text_mean_the_same() {
        let (mut from_json, mut from_text) = (Wishes::default(), Wishes::default());
        for (field, value, text) in [
            ("spp", json!(16), "16"),
            ("crop", json!([0, 1, 20, 30]), "0,1,20,30"),
            ("light_samples", json!([4, 1]), "[4, 1]"),
            ("indirect_samples", json!(2), " 2 "),
            ("camera", json!("7"), "7"),
            ("balance", json!("none"), "none"),
            ("diffusion_step", json!("implicit"), "implicit"),
            ("give_first", json!("rays"), "rays"),
            ("exchange", json!("off"), "off"),
            ("mapping", json!("diffusion"), "diffusion"),
            ("topology", json!([[0, 1], [1, 2]]), "[[0,1],[1,2]]"),
            ("topology", json!("ring"), "ring"),
            ("name", json!("true"), "true"),
            ("seed", json!(u64::MAX), "18446744073709551615"),
        ] {
            from_json.set(field, &value).expect(field);
            from_text.set_text(field, text).expect(field);
        }
        assert_eq!(from_json, from_text);
        assert_eq!(from_json.seed, Some(u64::MAX));
        assert_eq!(from_json.balancing.balance, Balance::None);
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (field, value, expected) in [
            ("sp", json!(1), "unknown field `sp`; did you mean `spp`?"),
            ("qqqq", json!(1), "unknown field `qqqq`; known are scene"),
            ("spp", json!(-4), "spp: -4 is not a whole number"),
            ("spp", json!(1.5), "spp: 1.5 is not"),
            ("width", json!("wide"), "width: \"wide\" is not"),
            ("height", json!(1u64 << 40), "height: 1099511627776 is not"),
            ("seed", json!(null), "seed: null is not"),
            ("crop", json!([3, 0, 3, 5]), "crop: [3,0,3,5] is not"),
            ("crop", json!([0, 0, 5]), "crop: [0,0,5] is not"),
            ("light_samples", json!([]), "light_samples: [] is not"),
            ("indirect_samples", json!(2000), "indirect_samples: 2000 is not"),
            ("balance", json!("magic"), "balance: \"magic\" is not one of"),
            ("topology", json!(3), "topology: 3 is not complete, ring"),
            ("topology", json!([[0, 1], [2, 3]]), "no way leads from vertex 0 to vertex 2"),
            ("name", json!("a\nb"), "name: \"a\\nb\" is not"),
        ] {
            let error = Wishes::default().set(field, &value).expect_err(field).to_string();
            assert!(error.contains(expected), "{error}");
        }
    }
}
