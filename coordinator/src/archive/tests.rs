//! Archives of strangers: what is accepted, and every way to be refused.

use std::io::{Seek, Write};

use flate2::Compression;
use flate2::write::GzEncoder;
use zip::write::SimpleFileOptions;

use super::*;

const LIMITS: ArchiveLimits = ArchiveLimits { unpacked_bytes_max: 100_000, entries_max: 10 };

fn opened(bytes: &[u8]) -> Result<BTreeMap<String, Vec<u8>>, ArchiveError> {
    let mut file = tempfile::tempfile().expect("a temporary file");
    file.write_all(bytes).expect("room on the disk");
    file.rewind().expect("a file can be rewound");
    unpack(file, LIMITS)
}

fn zip_of(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut writer = zip::ZipWriter::new(io::Cursor::new(Vec::new()));
    for (name, content) in files {
        writer.start_file(*name, SimpleFileOptions::default()).expect("a new entry");
        writer.write_all(content).expect("memory");
    }
    writer.finish().expect("memory").into_inner()
}

fn tar_header(name: &str, entry_type: tar::EntryType, size: u64) -> tar::Header {
    let mut header = tar::Header::new_ustar();
    // Written by hand: the crate refuses to write the very names that are to be refused.
    header.as_ustar_mut().expect("ustar").name[..name.len()].copy_from_slice(name.as_bytes());
    header.set_entry_type(entry_type);
    header.set_size(size);
    header.set_mode(0o644);
    header.set_cksum();
    header
}

fn tar_of(files: &[(&str, tar::EntryType, &[u8])]) -> Vec<u8> {
    let mut builder = tar::Builder::new(Vec::new());
    for (name, entry_type, content) in files {
        let header = tar_header(name, *entry_type, content.len() as u64);
        builder.append(&header, *content).expect("memory");
    }
    builder.into_inner().expect("memory")
}

fn plain_tar(files: &[(&str, &[u8])]) -> Vec<u8> {
    let files: Vec<_> = files.iter().map(|&(n, c)| (n, tar::EntryType::Regular, c)).collect();
    tar_of(&files)
}

fn gz(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).expect("memory");
    encoder.finish().expect("memory")
}

#[test]
fn zip_tar_and_tar_gz_give_the_same_files() {
    let files: [(&str, &[u8]); 2] = [("./scene.json", b"{}"), ("models/a.obj", b"v 0 0 0\n")];
    let expected = BTreeMap::from([
        ("scene.json".to_owned(), b"{}".to_vec()),
        ("models/a.obj".to_owned(), b"v 0 0 0\n".to_vec()),
    ]);
    assert_eq!(opened(&zip_of(&files)).expect("a zip"), expected);
    assert_eq!(opened(&plain_tar(&files)).expect("a tar"), expected);
    assert_eq!(opened(&gz(&plain_tar(&files))).expect("a tar.gz"), expected);
}

#[test]
fn names_that_lead_out_are_refused_in_both_formats() {
    for name in ["../evil", "/etc/evil", "a/../../evil"] {
        for archive in [zip_of(&[(name, b"x")]), plain_tar(&[(name, b"x")])] {
            assert!(matches!(opened(&archive), Err(ArchiveError::BadName { .. })), "{name}");
        }
    }
}

#[test]
fn links_and_devices_are_refused() {
    use tar::EntryType::{Block, Char, Fifo, Link, Symlink};
    for entry_type in [Symlink, Link, Char, Block, Fifo] {
        let archive = tar_of(&[("a", entry_type, b"")]);
        assert!(matches!(opened(&archive), Err(ArchiveError::NotAFile { .. })), "{entry_type:?}");
    }
    let mut writer = zip::ZipWriter::new(io::Cursor::new(Vec::new()));
    writer.add_symlink("a", "/etc/passwd", SimpleFileOptions::default()).expect("memory");
    let archive = writer.finish().expect("memory").into_inner();
    assert!(matches!(opened(&archive), Err(ArchiveError::NotAFile { .. })));
}

#[test]
fn bombs_end_at_the_limit() {
    let zeros = vec![0; 200_000];
    for archive in [
        zip_of(&[("a", &zeros)]),
        plain_tar(&[("a", &zeros)]),
        gz(&plain_tar(&[("a", &zeros)])),
        zip_of(&[("a", &zeros[..60_000]), ("b", &zeros[..60_000])]),
    ] {
        assert!(matches!(opened(&archive), Err(ArchiveError::TooLarge { .. })));
    }
    let names: Vec<String> = (0..11).map(|number| format!("file{number}")).collect();
    let many: Vec<(&str, &[u8])> = names.iter().map(|name| (name.as_str(), &b""[..])).collect();
    for archive in [zip_of(&many), plain_tar(&many)] {
        assert!(matches!(opened(&archive), Err(ArchiveError::TooManyEntries { entries_max: 10 })));
    }
}

#[test]
fn a_size_that_lies_is_not_believed() {
    let mut archive = tar_header("a", tar::EntryType::Regular, 1 << 40).as_bytes().to_vec();
    archive.extend([0; 512]);
    assert!(matches!(opened(&archive), Err(ArchiveError::Truncated { .. })));
}

#[test]
fn truncated_and_unknown_archives_are_told_apart() {
    let noise: Vec<u8> =
        (0..20_000u32).map(|n| (n.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    for whole in
        [zip_of(&[("a", &noise)]), plain_tar(&[("a", &noise)]), gz(&plain_tar(&[("a", &noise)]))]
    {
        let error = opened(&whole[..whole.len() / 2]).expect_err("half an archive");
        assert!(matches!(error, ArchiveError::Truncated { .. }), "{error}");
    }
    for bytes in [&b""[..], b"hello", b"7z\xbc\xaf\x27\x1c", b"PK", &[0; 2000]] {
        assert!(matches!(opened(bytes), Err(ArchiveError::UnknownFormat)));
    }
    assert!(matches!(opened(&gz(b"no tar at all")), Err(_)));
    assert!(matches!(opened(&zip_of(&[])), Err(ArchiveError::Empty)));
    assert!(matches!(
        opened(&zip_of(&[("a", b"1"), ("./a", b"2")])),
        Err(ArchiveError::Duplicate { .. })
    ));
}

#[test]
fn any_flipped_byte_is_refused_or_harmless() {
    let files: [(&str, &[u8]); 2] = [("scene.json", b"{\"equilux\":1}"), ("a.obj", b"v 0 0 0")];
    for whole in [zip_of(&files), plain_tar(&files), gz(&plain_tar(&files))] {
        for position in (0..whole.len()).step_by(3) {
            let mut bytes = whole.clone();
            bytes[position] ^= 0x55;
            let _accepted_or_refused = opened(&bytes);
        }
    }
}
