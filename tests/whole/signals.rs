//! Ctrl-C: once leaves a usable partial image, twice leaves at once.

use std::path::PathBuf;
use std::process::Stdio;

use crate::support::{
    Running, children_of, directory, is_running, line_after, lines_of, long_render, names_in,
    program, until,
};

#[test]
fn one_interrupt_leaves_a_partial_image() {
    for way in [&["--threads", "1"][..], &["--workers", "2", "--threads", "1"]] {
        let outputs = directory();
        let outfile = outputs.path().join("a.exr");
        let mut command = long_render(&outfile, way);
        let mut process = Running { child: command.spawn().expect("it starts") };
        let lines = lines_of(process.child.stderr.take().expect("a pipe"));
        line_after(&lines, "rendering ");
        process.signal("-INT");
        assert_eq!(process.exit_code(), Some(130));
        assert_eq!(names_in(&outputs), [PathBuf::from("a.partial.exr")]);
        let image = std::fs::read(outputs.path().join("a.partial.exr")).expect("an image");
        assert!(image.starts_with(&[0x76, 0x2f, 0x31, 0x01]), "no EXR");
    }
}

#[test]
fn two_interrupts_leave_at_once_and_leave_nobody_behind() {
    let outputs = directory();
    let mut command =
        long_render(&outputs.path().join("a.exr"), &["--workers", "2", "--threads", "1"]);
    let mut process = Running { child: command.spawn().expect("it starts") };
    let lines = lines_of(process.child.stderr.take().expect("a pipe"));
    line_after(&lines, "rendering ");
    let workers = children_of(process.child.id());
    assert_eq!(workers.len(), 2);
    process.signal("-INT");
    process.signal("-INT");
    assert_eq!(process.exit_code(), Some(130));
    assert!(!outputs.path().join("a.exr").exists());
    until("the workers are gone", || workers.iter().all(|&worker| !is_running(worker)));
}

#[test]
fn an_interrupted_city_leaves_nothing() {
    let place = directory();
    let mut command = program();
    command.args(["scene", "generate", "city", "--triangles", "50000000", "-o"]);
    command.arg(place.path().join("cities/here")).stderr(Stdio::piped());
    let mut process = Running { child: command.spawn().expect("it starts") };
    let lines = lines_of(process.child.stderr.take().expect("a pipe"));
    line_after(&lines, "writing ");
    process.signal("-INT");
    assert_eq!(process.exit_code(), Some(130));
    assert!(names_in(&place).is_empty());
}

#[test]
fn a_request_to_terminate_ends_it_as_an_interrupt_does() {
    let outputs = directory();
    let mut command = long_render(&outputs.path().join("a.exr"), &["--threads", "1"]);
    let mut process = Running { child: command.spawn().expect("it starts") };
    let lines = lines_of(process.child.stderr.take().expect("a pipe"));
    line_after(&lines, "rendering ");
    process.signal("-TERM");
    assert_eq!(process.exit_code(), Some(130));
}
