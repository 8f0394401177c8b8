//! Disks that are full: told, and nothing is lost or left.
//!
//! A limit on the size of files stands for them: what is beyond it fails in the middle of a file.

use std::path::Path;
use std::process::{Command, Stdio};

use tempfile::TempDir;

use crate::support::{
    Running, Service, directory, file, lines_of, names_in, program, shipped, succeed,
};

/// The program where files end at so many half kilobytes.
pub(crate) fn limited(most: u32) -> Command {
    let script = format!("trap '' XFSZ; ulimit -f {most}; exec \"$0\" \"$@\"");
    let mut command = Command::new("sh");
    command.args(["-c", &script]).arg(program().get_program()).stdin(Stdio::null());
    command
}

/// Runs the program where files end early, which must say so and leave nothing in a directory.
fn fails(most: u32, place: &TempDir, args: &[&str]) {
    let output = limited(most).args(args).output().expect("a shell");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{args:?}: {errors}");
    assert!(errors.contains("cannot be written"), "{args:?}: {errors}");
    assert!(!errors.contains("panicked"), "{args:?}: {errors}");
    assert!(names_in(place).is_empty(), "{args:?}: {:?}", names_in(place));
}

#[test]
fn what_is_not_whole_is_not_left() {
    let (place, scene) = (directory(), shipped("office"));
    let here = place.path().to_str().expect("text");
    let outside = directory();
    let (store, image) = (file(&place, "a.store"), file(&place, "a.exr"));
    let elsewhere = file(&outside, "a.png");
    fails(200, &place, &["scene", "build", &scene, "-o", &store, "--partitions", "4"]);
    let spooled = ["render", &scene, "--memory", "3MiB", "--spool", here, "-o", &elsewhere];
    fails(200, &place, &spooled);
    assert!(names_in(&outside).is_empty());
    fails(8, &place, &["render", &scene, "--size", "128x96", "--spp", "1", "-o", &image]);
    let city = file(&place, "cities/here");
    for most in [8, 1000] {
        let generate = ["scene", "generate", "city", "--triangles", "60000", "-o", &city];
        fails(most, &place, &generate);
    }
}

#[test]
fn a_quiet_render_tells_that_its_workers_cannot_keep_what_they_fetch() {
    let place = directory();
    let (scene, image) = (shipped("cornell-box"), file(&place, "a.png"));
    let mut render = limited(4);
    render.args(["render", &scene, "--size", "8x6", "--spp", "1", "--workers", "1", "--quiet"]);
    let output = render.args(["-o", &image]).output().expect("a shell");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let complaints = errors.lines().filter(|line| line.contains("cannot write to the cache"));
    assert_eq!(complaints.count(), 1, "{errors}");
    assert!(errors.contains("--spool"), "{errors}");
}

#[test]
fn a_worker_goes_on_without_its_cache() {
    let (root, cache) = (directory(), directory());
    let store = file(&root, "office.store");
    let scene = shipped("office");
    succeed(["scene", "build", &scene, "-o", &store, "--partitions", "4", "--quiet"]);
    let service = Service::start(&["--scenes", root.path().to_str().expect("text")]);
    let mut worker = limited(200);
    worker.args(["worker", "--threads", "1", "--coordinator", &service.grpc, "--cache"]);
    worker.arg(cache.path()).stderr(Stdio::piped());
    let mut worker = Running { child: worker.spawn().expect("a shell") };
    let lines = lines_of(worker.child.stderr.take().expect("a pipe"));
    let settings = ["--size", "40x32", "--spp", "2"];
    let (there, here) = (file(&root, "there.exr"), file(&root, "here.exr"));
    let submit = ["submit", "--served", "office.store", "--watch", "-o", &there];
    let coordinator = ["--coordinator", &service.http];
    succeed(submit.into_iter().chain(coordinator).chain(settings));
    succeed(["render", &scene, "-o", &here, "--quiet"].into_iter().chain(settings));
    let read = |path: &str| std::fs::read(Path::new(path)).expect("an image");
    assert!(read(&there) == read(&here), "another image");
    drop(worker);
    let complaints: Vec<String> = lines.iter().filter(|line| line.contains("cache")).collect();
    assert_eq!(complaints.len(), 1, "{complaints:?}");
    assert!(names_in(&cache).iter().all(|path| path.extension().is_none()), "{cache:?}");
}
