//! A delivery on its way to the coordinator: film values without the pixels that nothing touched,
//! as on the wire, so that a thousand of them that wait at one door do not fill the memory.

use equilux_common::bundle::Share;
use equilux_common::film::{PixelSums, TileSums};
use equilux_common::ids::JobId;
use equilux_common::message::ToCoordinator;
use equilux_common::unit::Rect;

/// Credit on its way home.
#[derive(Clone, Debug)]
pub(crate) struct Delivery {
    pub(crate) job: JobId,
    pub(crate) share: Share,
    tile: Rect,
    /// The pixels that were touched, by position.
    touched: Vec<(usize, PixelSums)>,
    saturated: u64,
    invalid: u64,
}

impl Delivery {
    pub(crate) fn new(job: JobId, share: Share, sums: &TileSums) -> Self {
        let touched = sums.pixels.iter().copied().enumerate();
        let touched = touched.filter(|(_, pixel)| pixel.as_array().iter().any(|&sum| sum != 0));
        Self {
            job,
            share,
            tile: sums.tile,
            touched: touched.collect(),
            saturated: sums.saturated,
            invalid: sums.invalid,
        }
    }

    /// How many pixels were touched.
    pub(crate) const fn touched_count(&self) -> usize {
        self.touched.len()
    }

    /// The message as it was.
    pub(crate) fn unpack(self) -> ToCoordinator {
        let mut sums = TileSums::new(self.tile);
        for (index, pixel) in self.touched {
            sums.pixels[index] = pixel;
        }
        (sums.saturated, sums.invalid) = (self.saturated, self.invalid);
        ToCoordinator::Delivered { job: self.job, share: self.share, sums }
    }
}
