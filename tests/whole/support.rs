//! Running the program: commands to their end, services until a test is over.

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use tempfile::TempDir;

/// How long anything may take before a test gives up on it.
pub(crate) const PATIENCE: Duration = Duration::from_secs(120);

/// The program.
pub(crate) fn program() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_equilux"));
    command.stdin(Stdio::null()).env_remove("EQUILUX_TOKEN").env_remove("EQUILUX_COORDINATOR");
    command
}

/// Runs the program to its end.
pub(crate) fn equilux<'a>(args: impl IntoIterator<Item = &'a str>) -> Output {
    program().args(args).output().expect("the program starts")
}

/// Runs the program to its end, which must be a good one, and gives its standard output.
pub(crate) fn succeed<'a>(args: impl IntoIterator<Item = &'a str>) -> String {
    let output = equilux(args);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}

/// Runs the program to its end, which must be the exit code 1, and gives its standard error.
pub(crate) fn fail<'a>(args: impl IntoIterator<Item = &'a str>) -> String {
    let output = equilux(args);
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{errors}");
    assert!(!errors.contains("panicked"), "{errors}");
    errors
}

/// A shipped scene's file.
pub(crate) fn shipped(scene: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(scene).join("scene.json");
    path.to_str().expect("the project's path is text").to_owned()
}

/// A directory of its own for a test.
pub(crate) fn directory() -> TempDir {
    tempfile::tempdir().expect("a temporary directory")
}

/// The path of a file in a directory, as an argument.
pub(crate) fn file(directory: &TempDir, name: &str) -> String {
    directory.path().join(name).to_str().expect("text").to_owned()
}

/// A process that is killed when the test is over.
pub(crate) struct Running {
    pub(crate) child: Child,
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Running {
    /// Sends the process a signal by its name.
    pub(crate) fn signal(&self, name: &str) {
        let status = Command::new("kill").args([name, &self.child.id().to_string()]).status();
        assert!(status.expect("kill starts").success());
    }

    /// Waits for the end of the process.
    pub(crate) fn exit_code(&mut self) -> Option<i32> {
        let start = now();
        loop {
            if let Some(status) = self.child.try_wait().expect("a child") {
                return status.code();
            }
            assert!(start.elapsed() < PATIENCE, "the process does not end");
            pause();
        }
    }
}

/// A coordinator with its addresses.
pub(crate) struct Service {
    pub(crate) http: String,
    pub(crate) grpc: String,
    _process: Running,
    _data: TempDir,
}

impl Service {
    /// Starts a coordinator on free ports, with more arguments.
    pub(crate) fn start(args: &[&str]) -> Self {
        Self::start_at("127.0.0.1:0", args)
    }

    /// Starts a coordinator that listens for workers at an address.
    pub(crate) fn start_at(grpc: &str, args: &[&str]) -> Self {
        let data = directory();
        let mut command = program();
        command.args(["coordinator", "--grpc", grpc, "--http", "127.0.0.1:0", "--data"]);
        command.arg(data.path()).args(args).stderr(Stdio::piped());
        let mut process = Running { child: command.spawn().expect("the program starts") };
        let lines = lines_of(process.child.stderr.take().expect("a pipe"));
        let grpc = line_after(&lines, "workers: ");
        let http = line_after(&lines, "jobs: ");
        Self { http, grpc, _process: process, _data: data }
    }

    /// Starts a worker of one thread for this coordinator.
    pub(crate) fn worker(&self) -> Running {
        worker(&self.grpc, &[])
    }

    /// The same with more arguments.
    pub(crate) fn worker_with(&self, args: &[&str]) -> Running {
        worker(&self.grpc, args)
    }
}

/// Starts a worker of one thread for the coordinator at a URL, with more arguments.
pub(crate) fn worker(coordinator: &str, args: &[&str]) -> Running {
    let mut command = program();
    command.args(["worker", "--threads", "1", "--coordinator", coordinator]).args(args);
    command.stderr(Stdio::piped());
    Running { child: command.spawn().expect("the program starts") }
}

/// Waits until something is so.
pub(crate) fn until(what: &str, mut is_so: impl FnMut() -> bool) {
    let start = now();
    while !is_so() {
        assert!(start.elapsed() < PATIENCE, "gave up waiting until {what}");
        pause();
    }
}

/// An address that nobody listens at just now.
pub(crate) fn free_address() -> String {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a free port");
    listener.local_addr().expect("an address").to_string()
}

/// Writes a scene that takes long enough to be disturbed: the Cornell box with many samples.
pub(crate) fn long_render(outfile: &Path, args: &[&str]) -> Command {
    let mut command = program();
    command.args(["render", &shipped("cornell-box"), "--spp", "100000", "--size", "128x128"]);
    command.args(args).arg("-o").arg(outfile).stderr(Stdio::piped());
    command
}

/// What a process says on a pipe, line by line; the pipe is read to its end whatever happens.
pub(crate) fn lines_of(pipe: impl Read + Send + 'static) -> mpsc::Receiver<String> {
    let (sender, receiver) = mpsc::channel();
    start_thread(move || {
        for line in BufReader::new(pipe).lines().map_while(Result::ok) {
            let _ = sender.send(line);
        }
    });
    receiver
}

/// Waits for a line with a prefix and gives the rest of it.
pub(crate) fn line_after(lines: &mpsc::Receiver<String>, prefix: &str) -> String {
    loop {
        let line = lines.recv_timeout(PATIENCE).expect("the process says where it listens");
        if let Some((_, rest)) = line.split_once(prefix) {
            return rest.trim().to_owned();
        }
    }
}

/// The files in a directory, by name.
pub(crate) fn names_in(directory: &TempDir) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(directory.path()).expect("a directory");
    let mut names: Vec<_> =
        entries.map(|entry| entry.expect("an entry").file_name().into()).collect();
    names.sort();
    names
}

/// Processes whose parent is `parent`, as `/proc` has it.
pub(crate) fn children_of(parent: u32) -> Vec<u32> {
    let entries = std::fs::read_dir("/proc").expect("a /proc");
    entries
        .filter_map(|entry| entry.ok()?.file_name().to_str()?.parse().ok())
        .filter(|&process| stat_fields(process).is_some_and(|(_, p)| p == parent))
        .collect()
}

/// Whether a process runs, or would if it were let.
pub(crate) fn is_running(process: u32) -> bool {
    stat_fields(process).is_some_and(|(state, _)| state != 'Z')
}

/// State and parent of a process.
fn stat_fields(process: u32) -> Option<(char, u32)> {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace();
    Some((fields.next()?.chars().next()?, fields.next()?.parse().ok()?))
}

#[expect(clippy::disallowed_methods, reason = "tests of processes wait for them")]
fn pause() {
    std::thread::sleep(Duration::from_millis(20));
}

#[expect(clippy::disallowed_methods, reason = "tests of processes wait for them")]
fn now() -> Instant {
    Instant::now()
}

#[expect(clippy::disallowed_methods, reason = "a pipe that nobody reads stops its writer")]
fn start_thread(run: impl FnOnce() + Send + 'static) {
    std::thread::spawn(run);
}
