//! An embedded cluster: a coordinator in this process, and workers here or as processes of their
//! own. However it ends, nothing is left running: processes end when their standard input does, and
//! the system closes that even if this process is killed.

use std::process::Stdio;
use std::sync::Arc;
use std::time::Duration;

use anyhow::Context;
use equilux_coordinator::embedded::EmbeddedServer;
use equilux_coordinator::handle::Handle;
use equilux_coordinator_core::event::Hello;
use equilux_render::geometry::Instructions;
use equilux_worker::{CoordinatorLink, SceneSource};
use equilux_worker_core::Config;
use futures::future::join_all;
use tempfile::TempDir;
use tokio::process::{Child, ChildStdin, Command};
use tokio::task::JoinHandle;
use tokio::time::timeout;

/// How long workers may take to end.
const END_TIMEOUT: Duration = Duration::from_secs(3);

/// Relative speed of a thread; there is nobody to compare with.
const SPEED: u32 = 1000;

/// A coordinator with workers of its own.
pub(crate) struct Cluster {
    /// The way in.
    pub(crate) handle: Handle,
    workers: Workers,
}

enum Workers {
    /// A task of this process.
    Here(JoinHandle<std::io::Result<()>>),
    /// Processes that talk gRPC over loopback.
    Processes(Processes),
}

struct Processes {
    children: Vec<Child>,
    /// Held apart, for waiting for a child closes its standard input.
    lifelines: Vec<ChildStdin>,
    _server: EmbeddedServer,
    /// Where they keep the scene; goes with the cluster.
    _cache: TempDir,
}

impl Cluster {
    /// One worker in this process, which gets the scene from where it is loaded already, and may
    /// use so much memory for the partitions of one that is not.
    pub(crate) async fn here(
        threads: Option<u32>,
        memory: Option<u64>,
        scenes: Arc<dyn SceneSource>,
    ) -> anyhow::Result<Self> {
        let handle = Handle::start(None);
        let threads = threads.unwrap_or_else(|| threads_for(1));
        let hello =
            Hello { name: "here".into(), address: "".into(), threads, speed: SPEED, memory };
        let connection = handle.connect(hello).await?;
        let (worker, incarnation) = (connection.worker, connection.incarnation);
        let config = Config { worker, incarnation, threads, speed: SPEED, memory };
        let link = CoordinatorLink { incoming: connection.incoming, outgoing: connection.outgoing };
        let task = tokio::spawn(equilux_worker::drive_local(config, link, scenes));
        Ok(Self { handle, workers: Workers::Here(task) })
    }

    /// So many processes of this program on this machine, each of which may use so much memory for
    /// partitions. All keep what they fetch in `cache`.
    pub(crate) async fn of_processes(
        count: u32,
        threads: Option<u32>,
        memory: Option<u64>,
        cache: TempDir,
    ) -> anyhow::Result<Self> {
        let handle = Handle::start(None);
        let server = EmbeddedServer::start(handle.clone()).await?;
        let threads = threads.unwrap_or_else(|| threads_for(count));
        let coordinator = format!("http://{}", server.address());
        let spawn = |_| spawn(&coordinator, threads, memory, &cache);
        let mut children = (0..count).map(spawn).collect::<anyhow::Result<Vec<_>>>()?;
        let lifelines = children.iter_mut().filter_map(|child| child.stdin.take()).collect();
        let processes = Processes { children, lifelines, _server: server, _cache: cache };
        Ok(Self { handle, workers: Workers::Processes(processes) })
    }

    /// The processes of the workers that run, if they are processes of their own.
    pub(crate) fn process_ids(&self) -> Vec<u32> {
        match &self.workers {
            Workers::Here(_) => Vec::new(),
            Workers::Processes(processes) => {
                processes.children.iter().filter_map(Child::id).collect()
            }
        }
    }

    /// Lets the workers end by themselves, and makes them if they do not.
    pub(crate) async fn end(self) {
        let Workers::Processes(Processes { mut children, lifelines, .. }) = self.workers else {
            return;
        };
        drop(lifelines);
        let ended = join_all(children.iter_mut().map(Child::wait));
        // Dropping those that are left kills them.
        let _in_time = timeout(END_TIMEOUT, ended).await.is_ok();
    }

    /// Waits until there is no worker any more, and says why.
    pub(crate) async fn all_workers_ended(&mut self) -> String {
        match &mut self.workers {
            Workers::Here(task) => match task.await {
                Ok(Ok(())) => "the worker ended".into(),
                Ok(Err(error)) => format!("the worker cannot start its threads: {error}"),
                Err(error) => format!("the worker failed: {error}"),
            },
            Workers::Processes(processes) => {
                let statuses = join_all(processes.children.iter_mut().map(Child::wait)).await;
                let status = statuses.into_iter().find_map(Result::ok);
                status.map_or_else(|| "all ended".into(), |status| format!("the first: {status}"))
            }
        }
    }
}

/// Compute threads of each of so many workers on this machine.
fn threads_for(workers: u32) -> u32 {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    u32::try_from(cores).unwrap_or(1).div_ceil(workers)
}

/// Starts a worker. It has a process group of its own, so that Ctrl-C reaches this process alone,
/// which knows what to do.
fn spawn(
    coordinator: &str,
    threads: u32,
    memory: Option<u64>,
    cache: &TempDir,
) -> anyhow::Result<Child> {
    let program = std::env::current_exe().context("cannot find this program's own file")?;
    let memory = memory.map(|bytes| ["--memory".to_owned(), bytes.to_string()]);
    Command::new(program)
        .args(["worker", "--until-stdin-closes", "--quiet", "--coordinator", coordinator])
        .args(["--threads", &threads.to_string(), "--cache"])
        .arg(cache.path())
        .args(memory.into_iter().flatten())
        .args(["--instructions", Instructions::chosen().name()])
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .process_group(0)
        .kill_on_drop(true)
        .spawn()
        .context("cannot start a worker process")
}
