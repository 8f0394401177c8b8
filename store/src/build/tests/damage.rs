//! Damaged stores: each damage is found and told by the file's name.

use std::collections::BTreeMap;
use std::fs;

use equilux_common::scene::files::Pack;

use super::scenes::{bare, sheet};
use super::{Built, Loose};
use crate::partition_file::read_partition_from;
use crate::{Cut, Manifest, Store, StoreError, read_partition};

#[test]
fn every_flipped_byte_of_a_partition_is_noticed() {
    let built = Built::new(&mut Loose(sheet(3)), Cut::Count(1));
    let manifest = &built.manifest;
    let mut bytes = fs::read(built.partition_path(0)).unwrap();
    assert!(read_partition_from(bytes.as_slice(), "p", manifest, 0).is_ok());
    for at in 0..bytes.len() {
        for flip in [0x01, 0x80] {
            bytes[at] ^= flip;
            let error = read_partition_from(bytes.as_slice(), "p", manifest, 0).unwrap_err();
            assert!(error.to_string().starts_with("p: "), "{at}: {error}");
            bytes[at] ^= flip;
        }
    }
    for length in 0..bytes.len() {
        let error = read_partition_from(&bytes[..length], "p", manifest, 0).unwrap_err();
        assert!(matches!(error, StoreError::WrongLength { .. }), "{length}: {error}");
    }
    bytes.push(0);
    assert!(read_partition_from(bytes.as_slice(), "p", manifest, 0).is_err());
}

#[test]
fn a_partition_that_names_what_its_model_lacks_is_refused() {
    let built = Built::new(&mut Loose(sheet(3)), Cut::Count(1));
    let bytes = fs::read(built.partition_path(0)).unwrap();
    let refused = |spoil: fn(&mut Manifest)| {
        let mut manifest = built.manifest.clone();
        spoil(&mut manifest);
        read_partition_from(bytes.as_slice(), "p", &manifest, 0).unwrap_err().to_string()
    };
    let primitive = refused(|manifest| manifest.triangle_count -= 1);
    assert!(primitive.contains("an id that is not of the model"), "{primitive}");
    let material = refused(|manifest| manifest.materials.clear());
    assert!(material.contains("names what is not in its tables"), "{material}");
}

#[test]
fn what_is_wrong_with_a_partition_is_told() {
    let built = Built::new(&mut Loose(sheet(3)), Cut::Count(2));
    let path = built.partition_path(1);
    let whole = fs::read(&path).unwrap();
    let message = |bytes: &[u8]| {
        fs::write(&path, bytes).unwrap();
        read_partition(&path, &built.manifest, 1).unwrap_err().to_string()
    };
    let name = path.display();
    let short = message(&whole[..whole.len() - 1]);
    assert!(short.starts_with(&format!("{name}: has ")) && short.contains("copy it"), "{short}");
    let damaged = message(&[&whole[..200], &[!whole[200]], &whole[201..]].concat());
    assert!(damaged.contains("checksum is wrong"), "{damaged}");
    let newer = message(&[&whole[..8], &[9], &whole[9..]].concat());
    assert!(newer.contains("is of version 9") && newer.contains("build the store again"));
    let foreign = message(&[b"PNG", &whole[3..]].concat());
    assert!(foreign.contains("is not a partition"), "{foreign}");
    fs::remove_file(&path).unwrap();
    let missing = read_partition(&path, &built.manifest, 1).unwrap_err().to_string();
    assert!(missing.contains("no such file"), "{missing}");
}

/// Names and bytes of files.
type Files = BTreeMap<String, Vec<u8>>;

fn open(files: &Files) -> Result<Store, StoreError> {
    Store::open(&Pack::from_files(files.clone()).unwrap(), "a/manifest.json")
}

/// The tables of a store with a light, below `a/`.
fn packed() -> Files {
    let mut light = bare([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
    light.material = 1;
    let built = Built::new(&mut Loose(vec![light]), Cut::Count(1));
    let names = ["manifest.json", "luminaires.bin"];
    let file = |name: &str| (format!("a/{name}"), fs::read(built.path().join(name)).unwrap());
    names.into_iter().map(file).collect()
}

#[test]
fn a_store_opens_from_memory() {
    let store = open(&packed()).unwrap();
    assert_eq!(store.luminaires().len(), 1);
}

#[test]
fn what_is_wrong_with_a_manifest_is_told() {
    let manifest = String::from_utf8(packed()["a/manifest.json"].clone()).unwrap();
    for (from, to, complaint) in [
        ("\"equilux_store\": 3", "\"equilux_store\": 7", "version 7"),
        ("\"equilux_store\": 3", "\"equilux\": 1", "is not a store's manifest"),
        ("\"luminaires.bin\"", "\"../luminaires.bin\"", "is no name of a file in the store"),
        ("\"luminaires.bin\"", "\"/luminaires.bin\"", "is no name of a file in the store"),
        ("\"luminaires.bin\"", "\"lights.bin\"", "no such file"),
        ("\"seed\": 1", "\"seed\": -1", "a/manifest.json:"),
        ("\"triangle_count\": 1", "\"triangle_count\": 2", "the model has 2"),
        ("\"width\": 640", "\"width\": 0", "settings: film.width"),
        ("\"vfov\": 38.0", "\"vfov\": 1e300", "camera: a number is too large"),
        ("\"light_samples\": [2, 1]", "\"light_samples\": []", "must not be empty"),
    ] {
        let broken = manifest.replacen(from, to, 1);
        assert_ne!(broken, manifest, "{from} in {manifest}");
        let mut files = packed();
        files.insert("a/manifest.json".into(), broken.into_bytes());
        let error = open(&files).unwrap_err().to_string();
        assert!(error.contains(complaint), "{to}: {error}");
    }
}

#[test]
fn a_damaged_table_is_told() {
    let mut files = packed();
    files.get_mut("a/luminaires.bin").unwrap()[30] ^= 1;
    let error = open(&files).unwrap_err();
    assert!(matches!(error, StoreError::Damaged { ref file } if file == "a/luminaires.bin"));
}
