//! A worker's name: the same in every life of it, different for every worker.
//!
//! Names lie in numbered slots in the cache directory. A process takes the first slot that no other
//! holds, and keeps it by a lock until it ends. So a worker that is started again finds its name,
//! and workers that share a directory do not share a name.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::hash::{BuildHasher, RandomState};
use std::io::{self, Read, Seek, Write};
use std::path::Path;

/// Most workers that share one cache directory.
const SLOTS_MAX: usize = 1024;

/// Letters of a name: 128 bits in hexadecimal digits.
const NAME_LETTERS: usize = 32;

/// A name, and the lock that keeps it for this process.
#[derive(Debug)]
pub(crate) struct Identity {
    name: String,
    _slot: Option<File>,
}

impl Identity {
    /// Takes a name from the slots in `directory`; where that cannot be, invents one.
    pub(crate) fn claim(directory: &Path) -> Self {
        let slots = directory.join("workers");
        let claimed = fs::create_dir_all(&slots).ok().and_then(|()| {
            (0..SLOTS_MAX).find_map(|slot| claim_slot(&slots.join(format!("{slot}.name"))).ok()?)
        });
        claimed.unwrap_or_else(|| Self { name: random_name(), _slot: None })
    }

    pub(crate) fn name(&self) -> &str {
        &self.name
    }
}

/// The name in a slot, or none if another process holds it.
fn claim_slot(path: &Path) -> io::Result<Option<Identity>> {
    let mut slot =
        OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path)?;
    match slot.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => return Ok(None),
        Err(TryLockError::Error(error)) => return Err(error),
    }
    let mut name = String::new();
    let is_read = (&slot).take(NAME_LETTERS as u64 + 1).read_to_string(&mut name).is_ok();
    if !(is_read && is_name(&name)) {
        name = random_name();
        slot.set_len(0)?;
        slot.rewind()?;
        slot.write_all(name.as_bytes())?;
    }
    Ok(Some(Identity { name, _slot: Some(slot) }))
}

fn is_name(text: &str) -> bool {
    text.len() == NAME_LETTERS && text.bytes().all(|byte| byte.is_ascii_hexdigit())
}

/// From the system's source of randomness, by way of the standard library.
fn random_name() -> String {
    let number = || RandomState::new().hash_one(std::process::id());
    format!("{:016x}{:016x}", number(), number())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_last_and_are_not_shared() {
        let directory = tempfile::tempdir().unwrap();
        let first = Identity::claim(directory.path());
        let second = Identity::claim(directory.path());
        assert_ne!(first.name(), second.name());
        assert!(is_name(first.name()));
        let name = first.name().to_owned();
        drop(first);
        assert_eq!(Identity::claim(directory.path()).name(), name);
    }

    #[test]
    fn a_spoilt_slot_gets_a_new_name_and_a_missing_directory_does_not_matter() {
        let directory = tempfile::tempdir().unwrap();
        fs::create_dir(directory.path().join("workers")).unwrap();
        fs::write(directory.path().join("workers/0.name"), [0xff; 99]).unwrap();
        let name = Identity::claim(directory.path()).name().to_owned();
        assert!(is_name(&name));
        assert_eq!(Identity::claim(directory.path()).name(), name);
        let file = directory.path().join("file");
        fs::write(&file, "").unwrap();
        assert!(is_name(Identity::claim(&file).name()));
    }
}
