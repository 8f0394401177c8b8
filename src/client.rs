//! A client of the REST service: what the subcommands that talk to one need of it.

use std::time::Duration;

use anyhow::{Context, anyhow, bail};
use reqwest::header::CONTENT_TYPE;
use reqwest::multipart::{Form, Part};
use reqwest::{Method, RequestBuilder, Response, StatusCode};
use serde::Deserialize;
use serde_json::{Map, Value};

use crate::args::ServiceArgs;
use crate::outputs::Format;

/// How long a connection may take to stand.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(10);

/// A service that can be talked to.
#[derive(Debug)]
pub(crate) struct Client {
    http: reqwest::Client,
    base: String,
    token: Option<String>,
}

/// A job as the service shows it.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Job {
    /// Its number.
    pub(crate) id: u64,
    /// The state's word.
    pub(crate) state: String,
    /// From 0 to 1.
    pub(crate) progress: f64,
    /// Since it began.
    pub(crate) elapsed_s: f64,
    /// Until it is done, if that can be told.
    pub(crate) remaining_s: Option<f64>,
    /// What the user calls it.
    #[serde(default)]
    pub(crate) name: Option<String>,
    /// What went wrong.
    #[serde(default)]
    pub(crate) error: Option<String>,
}

/// An RFC 9457 problem document.
#[derive(Debug, Deserialize)]
struct Problem {
    title: Option<String>,
    detail: Option<String>,
}

impl Job {
    /// Whether nothing more will happen to it.
    pub(crate) fn is_ended(&self) -> bool {
        matches!(self.state.as_str(), "done" | "failed" | "cancelled")
    }
}

impl Client {
    /// A client of the service at an address such as `http://127.0.0.1:8080`.
    pub(crate) fn new(service: &ServiceArgs) -> anyhow::Result<Self> {
        let http = reqwest::Client::builder().connect_timeout(CONNECT_TIMEOUT).build()?;
        let base = service.coordinator.trim_end_matches('/').to_owned();
        if !base.starts_with("http://") {
            bail!("{base}: a service's address begins with http://");
        }
        Ok(Self { http, base, token: service.token.clone() })
    }

    /// Sends a scene as an archive, with fields that replace its settings.
    pub(crate) async fn submit(
        &self,
        archive: Vec<u8>,
        entry: &str,
        fields: &Map<String, Value>,
    ) -> anyhow::Result<Job> {
        let mut form = Form::new().text("entry", entry.to_owned());
        for (name, value) in fields {
            let text = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
            form = form.text(name.clone(), text);
        }
        let form = form.part("scene", Part::bytes(archive).file_name("scene.tar"));
        let request = self.request(Method::POST, "/api/v1/jobs").multipart(form);
        Ok(self.send(request).await?.json().await?)
    }

    /// Names a scene below the service's root, with fields that replace its settings.
    pub(crate) async fn submit_served(
        &self,
        path: &str,
        mut fields: Map<String, Value>,
    ) -> anyhow::Result<Job> {
        fields.insert("scene".into(), path.into());
        let request = self.request(Method::POST, "/api/v1/jobs");
        let request = request.header(CONTENT_TYPE, "application/json");
        Ok(self.send(request.body(Value::Object(fields).to_string())).await?.json().await?)
    }

    /// All jobs that the service remembers.
    pub(crate) async fn jobs(&self) -> anyhow::Result<Vec<Job>> {
        Ok(self.send(self.request(Method::GET, "/api/v1/jobs")).await?.json().await?)
    }

    /// One job.
    pub(crate) async fn job(&self, id: u64) -> anyhow::Result<Job> {
        let request = self.request(Method::GET, &format!("/api/v1/jobs/{id}"));
        Ok(self.send(request).await?.json().await?)
    }

    /// Stops a job.
    pub(crate) async fn cancel(&self, id: u64) -> anyhow::Result<()> {
        self.send(self.request(Method::DELETE, &format!("/api/v1/jobs/{id}"))).await?;
        Ok(())
    }

    /// A job's image file, finished or not.
    pub(crate) async fn image(&self, id: u64, format: Format) -> anyhow::Result<Vec<u8>> {
        let name = match format {
            Format::Exr => "image.exr",
            Format::Png => "image.png",
        };
        let request = self.request(Method::GET, &format!("/api/v1/jobs/{id}/{name}"));
        Ok(self.send(request).await?.bytes().await?.to_vec())
    }

    fn request(&self, method: Method, path: &str) -> RequestBuilder {
        let request = self.http.request(method, format!("{}{path}", self.base));
        match &self.token {
            Some(token) => request.bearer_auth(token),
            None => request,
        }
    }

    async fn send(&self, request: RequestBuilder) -> anyhow::Result<Response> {
        let response = request.send().await.with_context(|| {
            format!("{}: no service answers; start one with `equilux coordinator`", self.base)
        })?;
        if response.status().is_success() { Ok(response) } else { Err(problem(response).await) }
    }
}

/// What a response that is no success says went wrong.
async fn problem(response: Response) -> anyhow::Error {
    let status = response.status();
    let problem: Option<Problem> = response.json().await.ok();
    let detail = problem.and_then(|problem| problem.detail.or(problem.title));
    let remedy = match status {
        StatusCode::UNAUTHORIZED => " (give its token with --token or EQUILUX_TOKEN)",
        _ => "",
    };
    anyhow!("the service answers {status}: {}{remedy}", detail.unwrap_or_default())
}
