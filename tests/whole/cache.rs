//! What workers keep on disk: links to what is there already, and copies that may be spoilt.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use crate::full_disk::limited;
use crate::support::{
    Service, directory, fail, file, line_after, lines_of, names_in, program, shipped, succeed,
};

const SETTINGS: [&str; 4] = ["--size", "40x32", "--spp", "2"];

/// Bytes and dates of all files below a directory.
fn state(directory: &Path) -> BTreeMap<PathBuf, (Vec<u8>, SystemTime)> {
    let entries = std::fs::read_dir(directory).expect("a directory");
    let paths = entries.map(|entry| entry.expect("an entry").path());
    let states = paths.flat_map(|path| match path.is_dir() {
        true => state(&path),
        false => {
            let date = path.metadata().and_then(|it| it.modified()).expect("a date");
            let bytes = std::fs::read(&path).expect("a file");
            BTreeMap::from([(path, (bytes, date))])
        }
    });
    states.collect()
}

fn image(path: &str) -> Vec<u8> {
    std::fs::read(path).expect("an image")
}

/// The office in four partitions of half a megabyte.
fn office_store(store: &str) {
    succeed(["scene", "build", &shipped("office"), "-o", store, "--partitions", "4", "--quiet"]);
}

#[test]
fn workers_on_this_machine_copy_no_partition_and_change_none() {
    let (home, spool) = (directory(), directory());
    let (store, ours, theirs) =
        (file(&home, "a.store"), file(&home, "ours.png"), file(&home, "theirs.png"));
    office_store(&store);
    let before = state(Path::new(&store));
    succeed(["render", &store, "--quiet", "-o", &ours].into_iter().chain(SETTINGS));
    // They may write files of 100 KiB: enough for all but partitions, and they would complain.
    let mut render = limited(200);
    render.args(["render", &store, "--workers", "2", "--threads", "1", "--quiet", "-o", &theirs]);
    render.args(SETTINGS).arg("--spool").arg(spool.path()).env("TMPDIR", "/no/such/directory");
    let output = render.output().expect("a shell");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && errors.is_empty(), "{errors}");
    assert!(image(&ours) == image(&theirs), "another image");
    assert!(state(Path::new(&store)) == before, "the store is not what it was");
    assert!(names_in(&spool).is_empty(), "{:?}", names_in(&spool));
}

#[test]
fn what_is_spoilt_in_a_cache_is_fetched_again() {
    let (root, cache) = (directory(), directory());
    office_store(&file(&root, "office.store"));
    let service = Service::start(&["--scenes", root.path().to_str().expect("text")]);
    let submit = |outfile: &str| {
        let args = ["submit", "--served", "office.store", "--coordinator", &service.http];
        succeed(args.into_iter().chain(["--watch", "-o", outfile]).chain(SETTINGS));
        image(outfile)
    };
    let arguments = ["--cache", cache.path().to_str().expect("text")];
    let worker = service.worker_with(&arguments);
    let first = submit(&file(&root, "first.exr"));
    drop(worker);
    let packs = cache.path().join("packs");
    let kept = state(&packs);
    // Four partitions and the rest.
    assert_eq!(kept.len(), 5);
    for (number, (path, (bytes, _))) in kept.iter().enumerate() {
        let mut spoilt = bytes.clone();
        match number % 2 {
            0 => spoilt[bytes.len() / 2] ^= 1,
            _ => spoilt.truncate(bytes.len() / 2),
        }
        std::fs::write(path, spoilt).expect("room");
    }
    let mut worker = service.worker_with(&arguments);
    let lines = lines_of(worker.child.stderr.take().expect("a pipe"));
    assert!(submit(&file(&root, "second.exr")) == first, "another image");
    for _ in &kept {
        let rest = line_after(&lines, ".pack ");
        assert_eq!(rest, "is damaged and is fetched again");
    }
    let bytes = |(path, (bytes, _))| (path, bytes);
    let mended: Vec<(PathBuf, Vec<u8>)> = state(&packs).into_iter().map(bytes).collect();
    assert!(mended == kept.into_iter().map(bytes).collect::<Vec<_>>(), "it is not mended");
}

/// Root may do anything, so these are places where nobody can have a directory.
#[test]
fn a_place_that_cannot_be_written_is_named_with_a_remedy() {
    let home = directory();
    let (scene, outfile) = (shipped("cornell-box"), file(&home, "a.png"));
    std::fs::write(home.path().join("file"), "").expect("room");
    for place in [&file(&home, "file/cache"), "/proc/equilux"] {
        let worker = ["worker", "--coordinator", "127.0.0.1:1", "--cache", place];
        let errors = fail(worker);
        let is_told = errors.contains(place) && errors.contains("name another one with --cache");
        assert!(is_told, "{errors}");
        for more in [&["--workers", "1"][..], &["--memory", "3MiB"]] {
            let render = ["render", &scene, "--quiet", "-o", &outfile, "--spool", place];
            let errors = fail(render.into_iter().chain(more.iter().copied()));
            assert!(errors.contains(place) && errors.contains("by --spool"), "{errors}");
        }
    }
    let mut nowhere = program();
    nowhere.args(["render", &scene, "--workers", "1", "--quiet", "-o", &outfile]);
    let output = nowhere.env("TMPDIR", "/no/such/directory").output().expect("it starts");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(errors.contains("/no/such/directory") && errors.contains("--spool"), "{errors}");
    assert_eq!(names_in(&home), [PathBuf::from("file")]);
}
