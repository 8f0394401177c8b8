//! `equilux submit`, `jobs`, `watch`, `fetch` and `cancel`: the REST service from the shell.

use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::{Context, bail, ensure};
use equilux_common::scene::files::{Gathered, Pack};

use crate::args::{FetchArgs, JobArgs, ServiceArgs, SettingsArgs, SubmitArgs, WatchArgs};
use crate::client::{Client, Job};
use crate::interrupt::{INTERRUPTED, Interrupt};
use crate::outputs::Output;
use crate::overrides::{self, Defaults};
use crate::progress::{Moment, Progress};
use equilux_store::is_store;

/// Time between two looks at a job.
const LOOK_INTERVAL: Duration = Duration::from_millis(200);

/// `equilux submit`.
pub(crate) async fn submit(args: SubmitArgs) -> anyhow::Result<ExitCode> {
    let outputs = match args.outfiles.as_slice() {
        [] => Vec::new(),
        files => Output::of_arguments(files, &args.scene)?,
    };
    let client = Client::new(&args.service)?;
    let job = match args.served {
        true => name(&client, &args.scene, &args.settings).await?,
        false => send(&client, &args.scene, &args.settings).await?,
    };
    if !args.watch {
        print_line(&job.id.to_string())?;
        return Ok(ExitCode::SUCCESS);
    }
    follow_and_fetch(&client, job.id, &outputs, false).await
}

/// `equilux render --coordinator`: submits, follows and fetches; an interrupt cancels the job and
/// fetches what there is.
pub(crate) async fn render(
    service: &ServiceArgs,
    scene: &Path,
    settings: &SettingsArgs,
    outputs: &[Output],
    is_quiet: bool,
) -> anyhow::Result<ExitCode> {
    let mut interrupt = Interrupt::listen()?;
    let client = Client::new(service)?;
    let id = send(&client, scene, settings).await?.id;
    tokio::select! {
        code = follow_and_fetch(&client, id, outputs, is_quiet) => code,
        () = interrupt.asked() => {
            client.cancel(id).await?;
            for output in outputs.iter().map(Output::partial) {
                output.write_bytes(&client.image(id, output.format).await?)?;
                eprintln!("cancelled job {id}; wrote {}", output.path.display());
            }
            Ok(ExitCode::from(INTERRUPTED))
        }
    }
}

/// `equilux jobs`.
pub(crate) async fn list(args: ServiceArgs) -> anyhow::Result<ExitCode> {
    for job in Client::new(&args)?.jobs().await? {
        print_line(&line(&job))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// `equilux watch`.
pub(crate) async fn watch(args: WatchArgs) -> anyhow::Result<ExitCode> {
    let client = Client::new(&args.job.service)?;
    follow(&client, args.job.id, args.quiet).await?;
    Ok(ExitCode::SUCCESS)
}

/// `equilux fetch`.
pub(crate) async fn fetch(args: FetchArgs) -> anyhow::Result<ExitCode> {
    let outputs = Output::of_arguments(&args.outfiles, Path::new("image"))?;
    let client = Client::new(&args.job.service)?;
    write_images(&client, args.job.id, &outputs).await?;
    Ok(ExitCode::SUCCESS)
}

/// `equilux cancel`.
pub(crate) async fn cancel(args: JobArgs) -> anyhow::Result<ExitCode> {
    Client::new(&args.service)?.cancel(args.id).await?;
    Ok(ExitCode::SUCCESS)
}

/// Uploads a scene.
async fn send(client: &Client, scene: &Path, settings: &SettingsArgs) -> anyhow::Result<Job> {
    ensure!(
        !is_store(scene),
        "{}: stores are not uploaded; put it below the directory that the service was given by \
         --scenes, and name it by its path there: `equilux submit --served PATH`",
        scene.display()
    );
    let Gathered { pack, entry, loaded } = Pack::gather(scene)?;
    loaded.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
    let fields = overrides::job_fields(settings, &Defaults::of(&loaded))?;
    client.submit(pack.to_bytes(), &entry, &fields).await
}

/// Names a scene that lies with the service.
async fn name(client: &Client, scene: &Path, settings: &SettingsArgs) -> anyhow::Result<Job> {
    let path = scene.to_str().with_context(|| {
        format!("{}: the name is not valid UTF-8; rename the file", scene.display())
    })?;
    client.submit_served(path, overrides::wishes(settings)).await
}

async fn follow_and_fetch(
    client: &Client,
    id: u64,
    outputs: &[Output],
    is_quiet: bool,
) -> anyhow::Result<ExitCode> {
    follow(client, id, is_quiet).await?;
    write_images(client, id, outputs).await?;
    Ok(ExitCode::SUCCESS)
}

/// Shows a job's progress until it ends; an end other than `done` is an error.
async fn follow(client: &Client, id: u64, is_quiet: bool) -> anyhow::Result<()> {
    let mut progress = Progress::new(is_quiet);
    let job = loop {
        let job = client.job(id).await?;
        progress.show(&Moment {
            state: &job.state,
            progress: job.progress,
            elapsed: seconds(job.elapsed_s),
            remaining: job.remaining_s.map(seconds),
            detail: "",
        });
        if job.is_ended() {
            break job;
        }
        tokio::time::sleep(LOOK_INTERVAL).await;
    };
    progress.end();
    match (job.state.as_str(), job.error) {
        ("done", _) => Ok(()),
        (state, Some(error)) => bail!("job {id} {state}: {error}"),
        (state, None) => bail!("job {id} was {state}"),
    }
}

async fn write_images(client: &Client, id: u64, outputs: &[Output]) -> anyhow::Result<()> {
    for output in outputs {
        output.write_bytes(&client.image(id, output.format).await?)?;
        eprintln!("wrote {}", output.path.display());
    }
    Ok(())
}

fn line(job: &Job) -> String {
    let name = job.name.as_deref().unwrap_or("");
    format!("{:>5}  {:<10} {:>4.0}%  {name}", job.id, job.state, job.progress * 100.0)
}

/// Results go to standard output, where a script can read them; a closed pipe is an error, no
/// panic.
pub(crate) fn print_line(text: &str) -> std::io::Result<()> {
    use std::io::Write;
    writeln!(std::io::stdout(), "{text}")
}

/// A duration from another program's number, whatever it is.
fn seconds(number: f64) -> Duration {
    Duration::try_from_secs_f64(number).unwrap_or_default()
}
