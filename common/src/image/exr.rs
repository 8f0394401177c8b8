//! EXR files: every layer as 32-bit floats under the names that compositors expect.
//!
//! Blocks are compressed independently and written in increasing order, so the bytes do not depend
//! on the number of threads that compress them. No attribute tells of the date or the machine.

use std::io::Cursor;

use exr::image::Blocks;
use exr::prelude::{
    AnyChannel, AnyChannels, Compression, Encoding, FlatSamples, Image as ExrImage, Layer,
    LayerAttributes, LineOrder, WritableImage,
};

use super::{Image, ImageError};

type Channels = AnyChannels<FlatSamples>;

/// Lossless; blocks of 16 lines.
const ENCODING: Encoding = Encoding {
    compression: Compression::ZIP16,
    blocks: Blocks::ScanLines,
    line_order: LineOrder::Increasing,
};

pub(super) fn encode(image: &Image) -> Result<Vec<u8>, ImageError> {
    let encoded = exr_image(image);
    let mut bytes = Cursor::new(Vec::new());
    encoded
        .write()
        .to_buffered(&mut bytes)
        .map_err(|error| ImageError::Encoding { format: "EXR", problem: error.to_string() })?;
    Ok(bytes.into_inner())
}

fn exr_image(image: &Image) -> ExrImage<Layer<Channels>> {
    let mut channels = Vec::new();
    add_triple(&mut channels, ["R", "G", "B"], &image.beauty);
    add_triple(&mut channels, ["albedo.R", "albedo.G", "albedo.B"], &image.albedo);
    add_triple(&mut channels, ["N.X", "N.Y", "N.Z"], &image.normal);
    add_triple(&mut channels, ["halfA.R", "halfA.G", "halfA.B"], &image.half_a);
    add_triple(&mut channels, ["halfB.R", "halfB.G", "halfB.B"], &image.half_b);
    channels.push(AnyChannel::new("Z", FlatSamples::F32(image.depth.clone())));
    channels.push(AnyChannel::new("samples", FlatSamples::F32(image.samples.clone())));
    let size = (image.width as usize, image.height as usize);
    let attributes = LayerAttributes::default();
    let channels = AnyChannels::sort(channels.into());
    ExrImage::from_layer(Layer::new(size, attributes, ENCODING, channels))
}

fn add_triple(channels: &mut Vec<AnyChannel<FlatSamples>>, names: [&str; 3], layer: &[[f32; 3]]) {
    for (component, name) in names.into_iter().enumerate() {
        let values = layer.iter().map(|pixel| pixel[component]).collect();
        channels.push(AnyChannel::new(name, FlatSamples::F32(values)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use exr::prelude::{ReadChannels, ReadLayers};
    use proptest::prelude::*;

    const NAMES: [&str; 17] = [
        "B", "G", "N.X", "N.Y", "N.Z", "R", "Z", "albedo.B", "albedo.G", "albedo.R", "halfA.B",
        "halfA.G", "halfA.R", "halfB.B", "halfB.G", "halfB.R", "samples",
    ];

    fn image(width: u32, height: u32, value: impl Fn(usize) -> f32) -> Image {
        let count = width as usize * height as usize;
        let layer = |start: usize| -> Vec<[f32; 3]> {
            (0..count).map(|at| [0, 1, 2].map(|k| value(start + at * 3 + k))).collect()
        };
        Image {
            width,
            height,
            beauty: layer(0),
            half_a: layer(1),
            half_b: layer(2),
            albedo: layer(3),
            normal: layer(4),
            depth: (0..count).map(|at| value(at + 5)).collect(),
            samples: (0..count).map(|at| value(at + 6)).collect(),
        }
    }

    fn decode(bytes: &[u8]) -> Vec<(String, Vec<f32>)> {
        let read = exr::prelude::read().no_deep_data().largest_resolution_level();
        let read = read.all_channels().first_valid_layer().all_attributes().pedantic();
        let image = read.from_buffered(Cursor::new(bytes)).unwrap();
        let channels = image.layer_data.channel_data.list.into_iter();
        channels
            .map(|channel| match channel.sample_data {
                FlatSamples::F32(values) => (channel.name.to_string(), values),
                _ => panic!("{} is not of 32-bit floats", channel.name),
            })
            .collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]

        #[test]
        fn every_layer_comes_back_exactly(
            width in 1u32..40, height in 1u32..40,
            values in prop::collection::vec(prop_oneof![any::<f32>(), Just(f32::INFINITY)], 1..50),
        ) {
            let image = image(width, height, |at| values[at % values.len()]);
            let bytes = encode(&image).unwrap();
            let channels = decode(&bytes);
            let names: Vec<&str> = channels.iter().map(|(name, _)| name.as_str()).collect();
            prop_assert_eq!(&names[..], &NAMES[..]);
            let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
            let triple = |layer: &[[f32; 3]], k: usize| {
                layer.iter().map(|pixel| pixel[k]).collect::<Vec<f32>>()
            };
            let expected = [
                triple(&image.beauty, 2), triple(&image.beauty, 1),
                triple(&image.normal, 0), triple(&image.normal, 1), triple(&image.normal, 2),
                triple(&image.beauty, 0), image.depth.clone(),
                triple(&image.albedo, 2), triple(&image.albedo, 1), triple(&image.albedo, 0),
                triple(&image.half_a, 2), triple(&image.half_a, 1), triple(&image.half_a, 0),
                triple(&image.half_b, 2), triple(&image.half_b, 1), triple(&image.half_b, 0),
                image.samples.clone(),
            ];
            for ((name, values), wanted) in channels.iter().zip(&expected) {
                prop_assert_eq!(bits(values), bits(wanted), "{}", name);
            }
        }
    }

    #[test]
    fn bytes_do_not_depend_on_threads() {
        let image = image(301, 203, |at| (at * 7919 % 1013) as f32);
        let parallel = encode(&image).unwrap();
        let mut alone = Cursor::new(Vec::new());
        exr_image(&image).write().non_parallel().to_buffered(&mut alone).unwrap();
        assert!(parallel == alone.into_inner(), "one thread writes the same bytes as many");
        assert!(parallel == encode(&image).unwrap(), "the same bytes again");
    }
}
