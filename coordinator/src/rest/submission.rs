//! Submissions: a scene by path or in an archive, read and checked before it becomes a job.

use std::sync::Arc;

use axum::Json;
use axum::body::Body;
use axum::extract::{FromRequest, Multipart, Request, State};
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use equilux_common::ids::JobId;
use equilux_common::scene::camera::Camera;
use equilux_common::scene::error::nearest;
use equilux_common::scene::files::{Gathered, Pack};
use equilux_common::scene::load::load;
use serde_json::Value;

use super::problem::Problem;
use super::served::Served;
use super::upload::{Upload, read_body};
use super::wishes::{Wishes, shortened};
use super::{JSON_BYTES_MAX, Rest, view};
use crate::archive::{self, ArchiveError};
use crate::order::{Order, SubmitError};
use crate::scene::JobScene;

/// `POST /jobs`
pub(crate) async fn submit(
    State(rest): State<Rest>,
    request: Request,
) -> Result<Response, Problem> {
    let Ok(permit) = Arc::clone(&rest.submissions).try_acquire_owned() else {
        return Err(Problem::busy("other submissions are being read; send this one again later"));
    };
    let submission = match media_type(&request).as_deref() {
        Some("application/json") => Submission::from_json(&rest, request.into_body()).await?,
        Some("multipart/form-data") => Submission::from_form(&rest, request).await?,
        _ => {
            return Err(Problem::media_type(
                "send JSON (content-type: application/json), or a form \
                 (multipart/form-data) with an archive in the field `scene`",
            ));
        }
    };
    let order = tokio::task::spawn_blocking(move || submission.into_order()).await;
    let order =
        order.map_err(|_| Problem::internal("the scene's reader failed; report this"))??;
    drop(permit);
    let job = rest.handle.submit(order).await.map_err(submit_problem)?;
    Ok(created(&rest, job))
}

fn created(rest: &Rest, job: JobId) -> Response {
    let view = rest.handle.job(job).map_or(Value::Null, |status| view::job(&status));
    let mut response = (StatusCode::CREATED, Json(view)).into_response();
    let location = HeaderValue::from_str(&format!("/api/v1/jobs/{}", job.0));
    response.headers_mut().extend(location.ok().map(|location| (header::LOCATION, location)));
    response
}

fn media_type(request: &Request) -> Option<String> {
    let value = request.headers().get(header::CONTENT_TYPE)?.to_str().ok()?;
    Some(value.split(';').next().unwrap_or_default().trim().to_ascii_lowercase())
}

/// A submission whose body has been read.
struct Submission {
    scene: Scene,
    wishes: Wishes,
}

enum Scene {
    /// Below the served root.
    Served(Served),
    /// An archive, with the scene file's name where it is given, and what it may hold.
    Uploaded { upload: Upload, limits: archive::ArchiveLimits },
}

impl Submission {
    async fn from_json(rest: &Rest, body: Body) -> Result<Self, Problem> {
        let bytes = read_body(body, JSON_BYTES_MAX).await?;
        let document: Value = serde_json::from_slice(&bytes)
            .map_err(|error| Problem::invalid(format!("the body is not JSON: {error}")))?;
        let Value::Object(fields) = document else {
            return Err(Problem::invalid("the body is not a JSON object, {\"scene\": …}"));
        };
        let (mut path, mut wishes) = (None, Wishes::default());
        for (field, value) in &fields {
            match (field.as_str(), value) {
                ("scene", Value::String(text)) => path = Some(text.clone()),
                ("scene", _) => return Err(Problem::invalid("scene: not a text; give a path")),
                _ => wishes.set(field, value)?,
            }
        }
        let path = path.ok_or_else(|| {
            Problem::invalid("scene: missing; give the path of a scene below the served root")
        })?;
        Ok(Self { scene: Scene::Served(Served::new(&rest.options, path)?), wishes })
    }

    async fn from_form(rest: &Rest, request: Request) -> Result<Self, Problem> {
        let bytes_max = rest.options.upload_bytes_max;
        let declared = request.headers().get(header::CONTENT_LENGTH);
        let declared = declared.and_then(|length| length.to_str().ok()?.parse::<u64>().ok());
        if declared.is_some_and(|bytes| bytes > bytes_max) {
            return Err(Problem::too_large(bytes_max));
        }
        let form = Multipart::from_request(request, &())
            .await
            .map_err(|rejection| Problem::invalid(rejection.body_text()))?;
        let temporary = rest.options.temporary.clone().unwrap_or_else(std::env::temp_dir);
        let mut upload = Upload::read(form, &temporary, bytes_max).await?;
        let wishes = std::mem::take(&mut upload.wishes);
        let scene = Scene::Uploaded { upload, limits: rest.options.archive };
        Ok(Self { scene, wishes })
    }

    /// Reads the scene; takes its time, and a thread that may block.
    fn into_order(self) -> Result<Order, Problem> {
        let Self { scene, wishes } = self;
        let scene = scene.read()?;
        let camera = camera(&scene, wishes.camera.as_deref())?;
        let title = title(&scene.entry);
        let JobScene { pack, entry, attachments, settings, warnings, .. } = scene;
        Ok(Order {
            pack,
            attachments,
            entry,
            camera,
            settings: wishes.applied_to(settings),
            camera_name: wishes.camera,
            balancing: wishes.balancing,
            topology: wishes.topology,
            workers_min: wishes.workers_min.unwrap_or(1),
            name: wishes.name.unwrap_or(title),
            warnings,
        })
    }
}

impl Scene {
    fn read(self) -> Result<JobScene, Problem> {
        match self {
            Self::Served(served) => served.read(),
            Self::Uploaded { upload, limits } => {
                let files = archive::unpack(upload.archive, limits).map_err(archive_problem)?;
                let pack =
                    Pack::from_files(files).map_err(|error| Problem::archive(error.to_string()))?;
                let entry = match upload.entry {
                    Some(entry) => entry,
                    None => pack.entry_of_archive().map_err(|e| Problem::archive(e.to_string()))?,
                };
                let loaded = load(&pack, &entry).map_err(|error| Problem::of_scene(&error))?;
                Ok(JobScene::of(Gathered { pack, entry, loaded }).0)
            }
        }
    }
}

fn camera(scene: &JobScene, name: Option<&str>) -> Result<Camera, Problem> {
    let Some(name) = name else { return Ok(scene.camera) };
    scene.cameras.get(name).copied().ok_or_else(|| {
        let known = nearest(name, scene.cameras.keys().map(String::as_str));
        let remedy = known.map_or_else(
            || "leave it out for the scene's own".to_owned(),
            |known| format!("did you mean \"{known}\"?"),
        );
        let name = shortened(name);
        Problem::invalid(format!("camera: the scene has no camera \"{name}\"; {remedy}"))
    })
}

/// What a job is called that was given no name: the directory of its scene file or manifest, else
/// its file.
fn title(path: &str) -> String {
    let mut parts = path.rsplit('/');
    let file = parts.next().unwrap_or_default();
    let stem = file.rsplit_once('.').map_or(file, |(stem, _)| stem);
    let is_plain = matches!(stem, "scene" | "manifest");
    let title = if is_plain { parts.next().unwrap_or(stem) } else { stem };
    shortened(title)
}

fn archive_problem(error: ArchiveError) -> Problem {
    match error {
        ArchiveError::Io(_) => Problem::internal(error.to_string()),
        ArchiveError::UnknownFormat => Problem::media_type(error.to_string()),
        _ => Problem::archive(error.to_string()),
    }
}

fn submit_problem(error: SubmitError) -> Problem {
    match error {
        SubmitError::QueueFull | SubmitError::PacksFull | SubmitError::Stopping => {
            Problem::busy(error.to_string())
        }
        SubmitError::Settings(_) | SubmitError::NameTooLong { .. } | SubmitError::NoWorkers => {
            Problem::invalid(error.to_string())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::title;

    #[test]
    fn a_job_is_called_after_its_scene() {
        assert_eq!(title("rooms/office/scene.json"), "office");
        assert_eq!(title("scene.json"), "scene");
        assert_eq!(title("city.store/manifest.json"), "city.store");
        assert_eq!(title("models/teapot.v2.obj"), "teapot.v2");
    }
}
