//! Images made from films, off the runtime: developing and encoding take a processor's time.

use std::io;
use std::sync::Arc;

use equilux_common::image::{Image, ImageError, write_atomically};
use equilux_common::job::Settings;
use tokio::sync::OwnedSemaphorePermit;

use crate::film::GatheredFilm;
use crate::status::JobStatus;
use crate::store::{ImageFormat, Store};

/// An image that cannot be had.
#[derive(Debug, thiserror::Error)]
pub(crate) enum PictureError {
    /// It cannot be encoded.
    #[error("the image cannot be encoded: {0}")]
    Encode(#[from] ImageError),
    /// It cannot be written.
    #[error("the image cannot be stored: {0}; make room in the data directory")]
    Write(#[from] io::Error),
    /// The encoder fell over.
    #[error("the image's encoder failed; report this")]
    Encoder,
}

/// Develops a film and encodes it. The permit is given back when that is done, whoever still waits
/// for it.
///
/// # Errors
/// If it cannot be encoded.
pub(crate) async fn encode(
    film: GatheredFilm,
    settings: Settings,
    format: ImageFormat,
    permit: Option<OwnedSemaphorePermit>,
) -> Result<Vec<u8>, PictureError> {
    let work = move || {
        let encoded = encoded(&Image::develop(&film.assemble(), &settings), format);
        drop(permit);
        encoded
    };
    tokio::task::spawn_blocking(work).await.map_err(|_| PictureError::Encoder)?
}

/// Develops a film and puts it into the store in every format.
///
/// # Errors
/// If it cannot be encoded or written.
pub(crate) async fn store(
    store: &Arc<Store>,
    film: GatheredFilm,
    status: &JobStatus,
) -> Result<(), PictureError> {
    let (store, job, plan) = (Arc::clone(store), status.id, Arc::clone(&status.plan));
    let work = move || {
        let image = Image::develop(&film.assemble(), &plan.settings);
        store.prepare(job)?;
        for format in [ImageFormat::Exr, ImageFormat::Png] {
            write_atomically(&store.image_path(job, format), &encoded(&image, format)?)?;
        }
        Ok(())
    };
    tokio::task::spawn_blocking(work).await.map_err(|_| PictureError::Encoder)?
}

fn encoded(image: &Image, format: ImageFormat) -> Result<Vec<u8>, PictureError> {
    Ok(match format {
        ImageFormat::Exr => image.to_exr()?,
        ImageFormat::Png => image.to_png()?,
    })
}
