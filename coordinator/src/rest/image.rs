//! A job's image: developed from what is committed while it renders, from the store afterwards.

use std::sync::Arc;

use axum::body::Body;
use axum::extract::{Path, State};
use axum::http::{HeaderValue, header};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use futures::stream::{self, Stream};
use tokio::fs::File;
use tokio::io::{self, AsyncReadExt};

use super::problem::Problem;
use super::{Rest, jobs};
use crate::handle::ImageSource;
use crate::picture;
use crate::store::ImageFormat;

/// Bytes of a stored image that are read at a time.
const CHUNK_BYTES: usize = 64 << 10;

/// `GET /jobs/{id}/image.exr`
pub(crate) async fn exr(
    State(rest): State<Rest>,
    Path(id): Path<String>,
) -> Result<Response, Problem> {
    image(&rest, &id, ImageFormat::Exr).await
}

/// `GET /jobs/{id}/image.png`
pub(crate) async fn png(
    State(rest): State<Rest>,
    Path(id): Path<String>,
) -> Result<Response, Problem> {
    image(&rest, &id, ImageFormat::Png).await
}

async fn image(rest: &Rest, id: &str, format: ImageFormat) -> Result<Response, Problem> {
    let job = jobs::found(rest, id)?.id;
    let gone = || Problem::not_found(format!("the image of {job} is not kept any more"));
    let body = match rest.handle.image(job, format).ok_or_else(gone)? {
        ImageSource::Film { film, settings } => {
            let permit = Arc::clone(&rest.encodings).acquire_owned().await.ok();
            let encoded = picture::encode(film, settings, format, permit).await;
            Body::from(encoded.map_err(|error| Problem::internal(error.to_string()))?)
        }
        ImageSource::File(path) => {
            let file = File::open(path).await.map_err(|_| gone())?;
            Body::from_stream(chunks(file))
        }
    };
    let mut response = body.into_response();
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(format.media_type()));
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    Ok(response)
}

/// The file's bytes as they are read.
fn chunks(file: File) -> impl Stream<Item = io::Result<Bytes>> {
    stream::try_unfold(file, |mut file| async move {
        let mut chunk = Vec::with_capacity(CHUNK_BYTES);
        let count = file.read_buf(&mut chunk).await?;
        Ok((count > 0).then(|| (Bytes::from(chunk), file)))
    })
}
