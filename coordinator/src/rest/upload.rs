//! Bodies of submissions, as they come in: counted, and not waited for without end.

use std::io::SeekFrom;
use std::path::Path;
use std::time::Duration;

use axum::body::Body;
use axum::extract::multipart::{Field, Multipart, MultipartError};
use axum::http::StatusCode;
use futures::StreamExt;
use tokio::io::{AsyncSeekExt, AsyncWriteExt};
use tokio::time::timeout;

use super::problem::Problem;
use super::wishes::Wishes;

/// How long a client may send nothing in the middle of a body.
const SILENCE_MAX: Duration = Duration::from_secs(30);

/// Most fields of a form; there are not so many settings.
const FIELDS_MAX: usize = 64;

/// Most bytes of a field that is no archive.
const TEXT_BYTES_MAX: usize = 16 << 10;

/// A form that has been read to its end.
#[derive(Debug)]
pub(crate) struct Upload {
    /// The archive, rewound; it has no name and vanishes when it is closed.
    pub(crate) archive: std::fs::File,
    /// The scene file in the archive, if the form says.
    pub(crate) entry: Option<String>,
    /// The other fields.
    pub(crate) wishes: Wishes,
}

impl Upload {
    /// Reads a form. The archive is put into the directory `temporary` as it comes.
    pub(crate) async fn read(
        mut form: Multipart,
        temporary: &Path,
        bytes_max: u64,
    ) -> Result<Self, Problem> {
        let (mut archive, mut entry, mut wishes) = (None, None, Wishes::default());
        for _ in 0..FIELDS_MAX {
            let next = in_time(form.next_field()).await?;
            let Some(mut field) = next.map_err(|error| form_problem(&error, bytes_max))? else {
                let archive = archive.ok_or_else(|| {
                    Problem::invalid("scene: missing; send the archive in the field `scene`")
                })?;
                return Ok(Self { archive, entry, wishes });
            };
            let name = field.name().unwrap_or_default().to_owned();
            match name.as_str() {
                "scene" if archive.is_none() => {
                    archive = Some(spool(&mut field, temporary, bytes_max).await?);
                }
                "scene" => return Err(Problem::invalid("scene: given twice; send one archive")),
                "entry" => entry = Some(text(&mut field, &name, bytes_max).await?),
                _ => wishes.set_text(&name, &text(&mut field, &name, bytes_max).await?)?,
            }
        }
        Err(Problem::invalid(format!("the form has more than {FIELDS_MAX} fields; send fewer")))
    }
}

/// Reads a whole body of at most `bytes_max`.
pub(crate) async fn read_body(body: Body, bytes_max: usize) -> Result<Vec<u8>, Problem> {
    let mut stream = body.into_data_stream();
    let mut bytes = Vec::new();
    while let Some(chunk) = in_time(stream.next()).await? {
        let chunk =
            chunk.map_err(|error| Problem::invalid(format!("the body broke off: {error}")))?;
        if bytes.len() + chunk.len() > bytes_max {
            return Err(Problem::too_large(bytes_max as u64));
        }
        bytes.extend_from_slice(&chunk);
    }
    Ok(bytes)
}

/// Writes a field's bytes to a nameless file.
async fn spool(
    field: &mut Field<'_>,
    temporary: &Path,
    bytes_max: u64,
) -> Result<std::fs::File, Problem> {
    let failed = |error: std::io::Error| {
        Problem::busy(format!("the archive cannot be put aside here: {error}"))
    };
    let file = tempfile::tempfile_in(temporary).map_err(failed)?;
    let mut file = tokio::fs::File::from_std(file);
    while let Some(chunk) = chunk(field, bytes_max).await? {
        file.write_all(&chunk).await.map_err(failed)?;
    }
    file.seek(SeekFrom::Start(0)).await.map_err(failed)?;
    Ok(file.into_std().await)
}

/// A field's text.
async fn text(field: &mut Field<'_>, name: &str, bytes_max: u64) -> Result<String, Problem> {
    let mut bytes = Vec::new();
    while let Some(chunk) = chunk(field, bytes_max).await? {
        bytes.extend_from_slice(&chunk);
        if bytes.len() > TEXT_BYTES_MAX {
            let name = super::wishes::shortened(name);
            let detail = format!("{name}: more than {TEXT_BYTES_MAX} bytes; send less");
            return Err(Problem::invalid(detail));
        }
    }
    String::from_utf8(bytes)
        .map_err(|_| Problem::invalid(format!("{name}: not UTF-8; send plain text")))
}

async fn chunk(field: &mut Field<'_>, bytes_max: u64) -> Result<Option<bytes::Bytes>, Problem> {
    in_time(field.chunk()).await?.map_err(|error| form_problem(&error, bytes_max))
}

/// Waits for the client, but not without end.
async fn in_time<T>(work: impl Future<Output = T>) -> Result<T, Problem> {
    timeout(SILENCE_MAX, work).await.map_err(|_| Problem::silent(SILENCE_MAX))
}

fn form_problem(error: &MultipartError, bytes_max: u64) -> Problem {
    match error.status() {
        StatusCode::PAYLOAD_TOO_LARGE => Problem::too_large(bytes_max),
        _ => Problem::invalid(format!("the form cannot be read: {}", error.body_text())),
    }
}
