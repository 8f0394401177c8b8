//! Problem documents: how every error leaves the REST service (RFC 9457).

use axum::extract::Request;
use axum::http::header::{self, HeaderName, HeaderValue};
use axum::http::{Method, StatusCode, Uri};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use equilux_common::scene::error::SceneError;
use equilux_common::scene::files::ReadError;
use serde_json::json;

/// What went wrong with a request, for people and programs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    status: StatusCode,
    kind: &'static str,
    title: &'static str,
    detail: String,
    /// What goes with it besides the document.
    header: Option<(HeaderName, &'static str)>,
}

/// Seconds after which somebody who was turned away for lack of room may come back.
const RETRY_AFTER_S: &str = "5";

impl Problem {
    /// The request itself is wrong; `detail` names the field and says what to do.
    pub(crate) fn invalid(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::BAD_REQUEST, "invalid-request", "the request is not valid", detail)
    }

    /// The scene cannot be rendered; `detail` is the reader's message.
    pub(crate) fn scene(detail: impl Into<String>) -> Self {
        let status = StatusCode::UNPROCESSABLE_ENTITY;
        Self::new(status, "invalid-scene", "the scene cannot be rendered", detail)
    }

    /// The scene that was asked for is no file that is read: nothing there, or nothing to give out.
    pub(crate) fn unreadable(error: &ReadError) -> Self {
        let detail = format!("scene: {error}");
        match error {
            ReadError::Missing { .. } => Self::not_found(detail),
            _ => Self::invalid(detail),
        }
    }

    /// A scene file that is not there is a path that leads nowhere; anything else is a bad scene.
    pub(crate) fn of_scene(error: &SceneError) -> Self {
        match error {
            SceneError::Unreadable(error) => Self::unreadable(error),
            _ => Self::scene(error.to_string()),
        }
    }

    /// The archive is not accepted.
    pub(crate) fn archive(detail: impl Into<String>) -> Self {
        let status = StatusCode::UNPROCESSABLE_ENTITY;
        Self::new(status, "invalid-archive", "the archive is not accepted", detail)
    }

    /// There is nothing of this name.
    pub(crate) fn not_found(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::NOT_FOUND, "not-found", "there is no such thing", detail)
    }

    /// The body is larger than the limit.
    pub(crate) fn too_large(bytes_max: u64) -> Self {
        let detail = format!("the body has more than {bytes_max} bytes; send less");
        let status = StatusCode::PAYLOAD_TOO_LARGE;
        Self::new(status, "body-too-large", "the body is too large", detail)
            .with(header::CONNECTION, "close")
    }

    /// The client began a body and did not go on.
    pub(crate) fn silent(silence_max: std::time::Duration) -> Self {
        let detail = format!("nothing came for {} s; send it again", silence_max.as_secs());
        let status = StatusCode::REQUEST_TIMEOUT;
        Self::new(status, "timeout", "the body did not come in time", detail)
            .with(header::CONNECTION, "close")
    }

    /// The body is in no form that is understood.
    pub(crate) fn media_type(detail: impl Into<String>) -> Self {
        let status = StatusCode::UNSUPPORTED_MEDIA_TYPE;
        Self::new(status, "unsupported-media-type", "the body's media type is not known", detail)
    }

    /// The token is missing or wrong.
    pub(crate) fn unauthorized(detail: impl Into<String>) -> Self {
        let status = StatusCode::UNAUTHORIZED;
        Self::new(status, "unauthorized", "a token is needed", detail)
            .with(header::WWW_AUTHENTICATE, "Bearer")
    }

    /// A page of somebody else speaks through the user's browser.
    pub(crate) fn foreign(detail: impl Into<String>) -> Self {
        let title = "the request comes from a foreign page";
        Self::new(StatusCode::FORBIDDEN, "foreign-origin", title, detail)
    }

    /// The request was meant for another host.
    pub(crate) fn misdirected(detail: impl Into<String>) -> Self {
        let status = StatusCode::MISDIRECTED_REQUEST;
        Self::new(status, "foreign-host", "the request is for another host", detail)
    }

    /// There is no room now.
    pub(crate) fn busy(detail: impl Into<String>) -> Self {
        let status = StatusCode::SERVICE_UNAVAILABLE;
        Self::new(status, "busy", "there is no room now", detail)
            .with(header::RETRY_AFTER, RETRY_AFTER_S)
    }

    /// Something failed here that the client cannot help.
    pub(crate) fn internal(detail: impl Into<String>) -> Self {
        let status = StatusCode::INTERNAL_SERVER_ERROR;
        Self::new(status, "internal", "the coordinator failed", detail)
    }

    fn new(
        status: StatusCode,
        kind: &'static str,
        title: &'static str,
        detail: impl Into<String>,
    ) -> Self {
        Self { status, kind, title, detail: detail.into(), header: None }
    }

    fn with(self, name: HeaderName, value: &'static str) -> Self {
        Self { header: Some((name, value)), ..self }
    }

    fn document(&self, instance: &str) -> String {
        json!({
            "type": format!("/openapi.json#/x-problems/{}", self.kind),
            "title": self.title,
            "status": self.status.as_u16(),
            "detail": self.detail,
            "instance": instance,
        })
        .to_string()
    }
}

impl IntoResponse for Problem {
    /// The document itself is written by [`with_instance`], which knows the path.
    fn into_response(self) -> Response {
        let mut response = self.status.into_response();
        if let Some((name, value)) = self.header.clone() {
            response.headers_mut().insert(name, HeaderValue::from_static(value));
        }
        response.extensions_mut().insert(self);
        response
    }
}

/// Makes every error a problem document that names the request's path; the errors that come from
/// below the handlers too.
pub(crate) async fn with_instance(request: Request, next: Next) -> Response {
    let instance = request.uri().path().to_owned();
    let mut response = next.run(request).await;
    let status = response.status();
    if !(status.is_client_error() || status.is_server_error()) {
        return response;
    }
    let problem = response.extensions_mut().remove::<Problem>().unwrap_or_else(|| {
        let title = status.canonical_reason().unwrap_or("error");
        Problem::new(status, "http", title, "the request cannot be served")
    });
    let body = problem.document(&instance);
    let headers = response.headers_mut();
    headers.remove(header::CONTENT_LENGTH);
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("application/problem+json"));
    *response.body_mut() = body.into();
    response
}

/// For paths that lead nowhere.
pub(crate) async fn no_such_path(uri: Uri) -> Problem {
    Problem::not_found(format!("{} leads nowhere; /openapi.json lists all paths", uri.path()))
}

/// For methods that a path does not know.
pub(crate) async fn no_such_method(method: Method, uri: Uri) -> Problem {
    let detail =
        format!("{} does not know {method}; the header `allow` lists what it knows", uri.path());
    let status = StatusCode::METHOD_NOT_ALLOWED;
    Problem::new(status, "method-not-allowed", "the method is not allowed", detail)
}
