//! JSON that knows where it stands: every value carries its path and its line, so that whatever is
//! wrong with it can be said to the user in those terms.
//!
//! The text is parsed level by level through `RawValue`, which borrows from it; a value's line
//! follows from its offset.

use std::collections::BTreeSet;
use std::fmt;
use std::ops::RangeInclusive;

use serde::de::{Deserialize, Deserializer, MapAccess, Visitor};
use serde_json::value::RawValue;

use crate::scene::error::{Place, SceneError, nearest};

/// The text of a JSON file and where its lines begin.
#[derive(Debug)]
pub(super) struct Document<'a> {
    file: &'a str,
    text: &'a str,
    line_ends: Vec<usize>,
}

impl<'a> Document<'a> {
    /// The text of the file called `file`.
    pub(super) fn new(file: &'a str, text: &'a str) -> Self {
        Self { file, text, line_ends: text.match_indices('\n').map(|(at, _)| at).collect() }
    }
}

/// A value of a JSON file.
#[derive(Clone, Debug)]
pub(super) struct Node<'a> {
    document: &'a Document<'a>,
    path: String,
    raw: &'a str,
}

/// The members of an object, all with known keys.
pub(super) struct Fields<'a> {
    node: Node<'a>,
    members: Vec<(String, &'a str)>,
}

impl<'a> Node<'a> {
    /// The whole of a file.
    pub(super) fn root(document: &'a Document<'a>) -> Result<Self, SceneError> {
        let raw: &RawValue =
            serde_json::from_str(document.text).map_err(|error| SceneError::Malformed {
                place: Place::line(document.file, error.line()),
                problem: format!("not valid JSON: {error}"),
            })?;
        Ok(Self { document, path: String::new(), raw: raw.get() })
    }

    /// Where the value stands.
    pub(super) fn place(&self) -> Place {
        let Document { file, text, line_ends } = self.document;
        let offset = self.raw.as_ptr() as usize - text.as_ptr() as usize;
        Place::line(file, 1 + line_ends.partition_point(|&end| end < offset))
    }

    /// Says what is wrong with the value.
    pub(super) fn invalid(&self, problem: impl Into<String>) -> SceneError {
        let field = if self.path.is_empty() { "the file".to_owned() } else { self.path.clone() };
        SceneError::InvalidValue { place: self.place(), field, problem: problem.into() }
    }

    fn wrong_type(&self, wanted: &str) -> SceneError {
        const SHOWN_CHARS: usize = 40;
        let mut shown: String = self.raw.chars().take(SHOWN_CHARS).collect();
        if shown.len() < self.raw.len() {
            shown.push('…');
        }
        self.invalid(format!("must be {wanted}, not {}", shown.replace('\n', " ")))
    }

    fn child(&self, step: &str, raw: &'a str) -> Self {
        let dot = if self.path.is_empty() || step.starts_with('[') { "" } else { "." };
        Self { path: format!("{}{dot}{step}", self.path), raw, ..*self }
    }

    /// The members of an object; `known` are the keys that it may have.
    pub(super) fn fields(&self, known: &[&str]) -> Result<Fields<'a>, SceneError> {
        let fields = self.any_fields()?;
        for (key, raw) in &fields.members {
            if !known.contains(&key.as_str()) {
                let node = self.child(key, raw);
                return Err(SceneError::UnknownKey {
                    place: node.place(),
                    key: node.path,
                    nearest: nearest(key, known.iter().copied()),
                });
            }
        }
        Ok(fields)
    }

    /// The members of an object whose keys are the user's.
    pub(super) fn any_fields(&self) -> Result<Fields<'a>, SceneError> {
        let object: Object<'a> =
            serde_json::from_str(self.raw).map_err(|_| self.wrong_type("an object {…}"))?;
        let mut members: Vec<(String, &'a str)> = Vec::new();
        let mut keys = BTreeSet::new();
        for (key, raw) in object.0 {
            if !keys.insert(key.clone()) {
                return Err(self.child(&key, raw.get()).invalid("is given twice; remove one"));
            }
            members.push((key, raw.get()));
        }
        Ok(Fields { node: self.clone(), members })
    }

    /// Whether the value is an object.
    pub(super) fn is_object(&self) -> bool {
        self.raw.starts_with('{')
    }

    /// Whether the value is a list.
    pub(super) fn is_list(&self) -> bool {
        self.raw.starts_with('[')
    }

    /// The items of a list.
    pub(super) fn items(&self) -> Result<Vec<Self>, SceneError> {
        let items: Vec<&'a RawValue> =
            serde_json::from_str(self.raw).map_err(|_| self.wrong_type("a list […]"))?;
        let child =
            |(index, raw): (usize, &&'a RawValue)| self.child(&format!("[{index}]"), raw.get());
        Ok(items.iter().enumerate().map(child).collect())
    }

    /// A list of just `N` numbers of a range.
    pub(super) fn numbers<const N: usize>(
        &self,
        range: RangeInclusive<f64>,
    ) -> Result<[f64; N], SceneError> {
        let items = self.items()?;
        if items.len() != N {
            return Err(self.invalid(format!("must be {N} numbers, not {}", items.len())));
        }
        let mut numbers = [0.0; N];
        for (number, item) in numbers.iter_mut().zip(&items) {
            *number = item.number(range.clone())?;
        }
        Ok(numbers)
    }

    /// The same in single precision.
    pub(super) fn triple(&self, range: RangeInclusive<f64>) -> Result<[f32; 3], SceneError> {
        Ok(self.numbers::<3>(range)?.map(single))
    }

    /// A number of a range.
    pub(super) fn number(&self, range: RangeInclusive<f64>) -> Result<f64, SceneError> {
        let is_number = self.raw.starts_with(|first: char| first == '-' || first.is_ascii_digit());
        if !is_number {
            return Err(self.wrong_type("a number"));
        }
        let number = serde_json::from_str(self.raw).unwrap_or(f64::INFINITY);
        if !range.contains(&number) {
            let (least, most) = range.into_inner();
            return Err(self.invalid(format!("{} is not from {least} to {most}", self.raw)));
        }
        Ok(number)
    }

    /// A number of a range in single precision.
    pub(super) fn float(&self, range: RangeInclusive<f64>) -> Result<f32, SceneError> {
        self.number(range).map(single)
    }

    /// A whole number of a range.
    pub(super) fn whole(&self, range: RangeInclusive<u64>) -> Result<u64, SceneError> {
        match serde_json::from_str(self.raw) {
            Ok(number) if range.contains(&number) => Ok(number),
            _ => {
                let (least, most) = range.into_inner();
                Err(self.wrong_type(&format!("a whole number from {least} to {most}")))
            }
        }
    }

    /// A whole number of a range of 32 bits.
    pub(super) fn count(&self, range: RangeInclusive<u32>) -> Result<u32, SceneError> {
        let (least, most) = range.into_inner();
        let number = self.whole(u64::from(least)..=u64::from(most))?;
        Ok(u32::try_from(number).unwrap_or(most))
    }

    /// A text.
    pub(super) fn string(&self) -> Result<String, SceneError> {
        serde_json::from_str(self.raw).map_err(|_| self.wrong_type("a text in quotes"))
    }

    /// One of some words.
    pub(super) fn word(&self, known: &[&'static str]) -> Result<&'static str, SceneError> {
        let word = self.string()?;
        known.iter().copied().find(|&candidate| candidate == word).ok_or_else(|| {
            self.invalid(format!("\"{word}\" is none of \"{}\"", known.join("\", \"")))
        })
    }
}

impl<'a> Fields<'a> {
    /// The member `key`; `null` counts as absent.
    pub(super) fn get(&self, key: &str) -> Option<Node<'a>> {
        let (_, raw) = self.members.iter().find(|(name, raw)| name == key && *raw != "null")?;
        Some(self.node.child(key, raw))
    }

    /// The member `key`, which must be there.
    pub(super) fn require(&self, key: &str, remedy: &'static str) -> Result<Node<'a>, SceneError> {
        self.get(key).ok_or_else(|| SceneError::MissingKey {
            place: self.node.place(),
            key: self.node.child(key, self.node.raw).path,
            remedy,
        })
    }

    /// All members in the order of the file.
    pub(super) fn members(&self) -> impl Iterator<Item = (&str, Node<'a>)> {
        self.members.iter().map(|(key, raw)| (key.as_str(), self.node.child(key, raw)))
    }
}

/// An object's members in the order of the file, keys that come twice included.
struct Object<'a>(Vec<(String, &'a RawValue)>);

impl<'de: 'a, 'a> Deserialize<'de> for Object<'a> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Members;

        impl<'de> Visitor<'de> for Members {
            type Value = Object<'de>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an object")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
                let mut members = Vec::new();
                while let Some(member) = map.next_entry()? {
                    members.push(member);
                }
                Ok(Object(members))
            }
        }

        deserializer.deserialize_map(Members)
    }
}

#[expect(clippy::cast_possible_truncation, reason = "callers check the range first")]
pub(super) const fn single(number: f64) -> f32 {
    number as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "{\n \"a\": {\"b\": [1, 2.5]},\n \"c\": \"x\",\n \"d\": 1e999\n}";

    #[test]
    fn values_know_their_path_and_line() {
        let document = Document::new("s.json", TEXT);
        let root = Node::root(&document).unwrap();
        let fields = root.fields(&["a", "c", "d"]).unwrap();
        let items = fields.get("a").unwrap().fields(&["b"]).unwrap().get("b").unwrap();
        assert_eq!(items.items().unwrap()[1].path, "a.b[1]");
        assert_eq!(items.numbers::<2>(0.0..=9.0).unwrap(), [1.0, 2.5]);
        let error = fields.get("c").unwrap().float(0.0..=1.0).unwrap_err().to_string();
        assert_eq!(error, "s.json:3: c: must be a number, not \"x\"");
        let error = fields.get("d").unwrap().float(0.0..=1.0).unwrap_err().to_string();
        assert_eq!(error, "s.json:4: d: 1e999 is not from 0 to 1");
    }

    #[test]
    fn unknown_and_doubled_keys_are_errors() {
        let document = Document::new("s.json", TEXT);
        let root = Node::root(&document).unwrap();
        let error = root.fields(&["a", "c", "dd"]).err().unwrap().to_string();
        assert_eq!(error, "s.json:4: unknown key \"d\"; did you mean \"dd\"?");
        let document = Document::new("s.json", "{\"a\": 1,\n\"a\": 2}");
        let root = Node::root(&document).unwrap();
        let error = root.fields(&["a"]).err().unwrap().to_string();
        assert_eq!(error, "s.json:2: a: is given twice; remove one");
    }

    #[test]
    fn broken_syntax_names_its_line() {
        let error =
            Node::root(&Document::new("s.json", "{\n\"a\": 1,,\n}")).unwrap_err().to_string();
        assert!(error.starts_with("s.json:2: not valid JSON"), "{error}");
    }
}
