//! The guest: objects that are to be mapped, and how much they have to do with one another.
//!
//! The word is of graph embedding (Rosenberg 1981): the larger graph, which a smaller one takes in.

/// Bytes of all objects together, at most: sums and products of two stay exact in 128 bits.
pub const GUEST_BYTES_MAX: u64 = 1 << 62;

/// Objects at most: their numbers, and those of workers beside them, fit in 32 bits.
pub const GUEST_OBJECTS_MAX: usize = 1 << 31;

/// What moves as one: a partition of the model, or some other cluster of triangles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Object {
    /// Memory that it takes, in bytes.
    pub bytes: u64,
    /// Where it lies in the model: the center of its bounds.
    pub position: [f32; 3],
}

/// Two objects and what passes between them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tie {
    /// The objects' numbers.
    pub objects: [usize; 2],
    /// Rays that pass from one to the other, either way, or whatever else is to be kept within a
    /// worker, in any unit.
    pub affinity: u64,
}

/// Objects and their ties, without direction: the graph that is mapped.
#[derive(Clone, Debug, PartialEq)]
pub struct Guest {
    objects: Vec<Object>,
    ties: Vec<Tie>,
    bytes: u64,
}

/// Objects or ties that make no guest.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum InvalidGuest {
    /// Nothing to map.
    #[error("there are no objects; map a model of one partition at least")]
    Empty,
    /// Too many.
    #[error("there are {0} objects; at most {GUEST_OBJECTS_MAX} are mapped: make them larger")]
    TooMany(usize),
    /// Shares of memory would mean nothing.
    #[error("object {0} has no bytes; leave it out")]
    Size(usize),
    /// Too large together.
    #[error(
        "the objects have more than {GUEST_BYTES_MAX} bytes together; give sizes in a larger unit"
    )]
    TooLarge,
    /// Nowhere.
    #[error("object {0} lies at {1:?}; a position has three finite coordinates")]
    Position(usize, [f32; 3]),
    /// A tie to nothing.
    #[error("tie {tie} names object {object}; there are {count}, numbered from 0")]
    Tie {
        /// Which tie, from 0.
        tie: usize,
        /// The object that is not there.
        object: usize,
        /// How many objects there are.
        count: usize,
    },
}

impl Guest {
    /// The graph of these objects. Ties may come twice, and then add up; those of an object with
    /// itself and those without affinity mean nothing.
    ///
    /// # Errors
    /// If there are no objects, one has no bytes or no position, they are too many or too large, or
    /// a tie names an object that is not there.
    pub fn new(objects: Vec<Object>, ties: Vec<Tie>) -> Result<Self, InvalidGuest> {
        let count = objects.len();
        if count == 0 {
            return Err(InvalidGuest::Empty);
        }
        if count > GUEST_OBJECTS_MAX {
            return Err(InvalidGuest::TooMany(count));
        }
        let mut bytes = 0u64;
        for (index, object) in objects.iter().enumerate() {
            if object.bytes == 0 {
                return Err(InvalidGuest::Size(index));
            }
            if !object.position.iter().all(|coordinate| coordinate.is_finite()) {
                return Err(InvalidGuest::Position(index, object.position));
            }
            bytes = bytes.saturating_add(object.bytes);
        }
        if bytes > GUEST_BYTES_MAX {
            return Err(InvalidGuest::TooLarge);
        }
        for (tie, Tie { objects, .. }) in ties.iter().enumerate() {
            if let Some(&object) = objects.iter().find(|&&object| object >= count) {
                return Err(InvalidGuest::Tie { tie, object, count });
            }
        }
        Ok(Self { objects, ties, bytes })
    }

    /// All objects, by their number.
    #[must_use]
    pub fn objects(&self) -> &[Object] {
        &self.objects
    }

    /// All ties, as they were given.
    #[must_use]
    pub fn ties(&self) -> &[Tie] {
        &self.ties
    }

    /// Bytes of all objects together; above zero.
    #[must_use]
    pub const fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Affinity of all ties between different objects.
    #[must_use]
    pub fn affinity(&self) -> u128 {
        let ties = self.ties.iter().filter(|tie| tie.objects[0] != tie.objects[1]);
        ties.map(|tie| u128::from(tie.affinity)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn object(bytes: u64) -> Object {
        Object { bytes, position: [0.0; 3] }
    }

    #[test]
    fn mistakes_are_named() {
        let mistake = |objects, ties| Guest::new(objects, ties).expect_err("a mistake").to_string();
        assert!(mistake(vec![], vec![]).contains("no objects"));
        assert!(mistake(vec![object(1), object(0)], vec![]).starts_with("object 1 has no bytes"));
        assert!(mistake(vec![object(GUEST_BYTES_MAX), object(1)], vec![]).contains("more than"));
        assert!(mistake(vec![object(u64::MAX), object(u64::MAX)], vec![]).contains("more than"));
        let nowhere = Object { bytes: 1, position: [0.0, f32::NAN, 0.0] };
        assert!(mistake(vec![nowhere], vec![]).contains("finite coordinates"));
        let tie = Tie { objects: [0, 1], affinity: 1 };
        assert!(mistake(vec![object(1)], vec![tie]).starts_with("tie 0 names object 1"));
    }

    #[test]
    fn a_tie_with_itself_counts_for_nothing() {
        let ties = [[0, 1], [1, 0], [1, 1]].map(|objects| Tie { objects, affinity: u64::MAX });
        let guest = Guest::new(vec![object(1), object(2)], ties.to_vec()).expect("a guest");
        assert_eq!(guest.affinity(), 2 * u128::from(u64::MAX));
        assert_eq!(guest.bytes(), 3);
    }
}
