//! Pictures in OpenEXR files: linear light in the channels R, G, B, or gray in Y.

use std::io::Read;

use ::image::metadata::Orientation;
use exr::meta::MetaData;
use exr::prelude::{AnyChannels, FlatSamples, Layer, Vec2};

use super::head::PictureHead;
use super::ignored::{PrimariesXy, primaries_note};
use crate::exr_layers::{channel_names, read_layers};
use petzval_camera::image::{CHANNELS, LinearImage};

/// What the head of a file says of the layer that [`read`] reads, and of the samples of all layers. Fails with a reason.
pub fn head(source: impl Read, file_bytes: u64) -> Result<PictureHead, String> {
    let damaged = |e: exr::error::Error| format!("not a readable OpenEXR file: {e}");
    let meta = MetaData::read_from_buffered(source, true).map_err(damaged)?;
    let mut sample_bytes = 0u64;
    let mut stored = None;
    for header in &meta.headers {
        let Vec2(width, height) = header.layer_size;
        let channels = &header.channels.list;
        let of_pixel: u64 = channels.iter().map(|c| c.sample_type.bytes_per_sample() as u64).sum();
        let pixels = (width as u64).saturating_mul(height as u64);
        sample_bytes = sample_bytes.saturating_add(pixels.saturating_mul(of_pixel));
        let has = |name: &str| channels.iter().any(|channel| channel.name.eq(name));
        if stored.is_none() && is_picture(has) {
            stored = Some((u32::try_from(width), u32::try_from(height)));
        }
    }
    let Some((Ok(width), Ok(height))) = stored else {
        let names = meta.headers.iter().flat_map(|header| &header.channels.list);
        return Err(no_picture(names.map(|channel| channel.name.to_string()).collect()));
    };
    Ok(PictureHead {
        stored: (width, height),
        orientation: Orientation::NoTransforms,
        file_bytes,
        sample_bytes,
        decoding_bytes: sample_bytes,
    })
}

/// Whether channels of these names are a picture: red, green and blue, or gray. Y beside RY and BY is the luminance of a coloured picture.
fn is_picture(has: impl Fn(&str) -> bool) -> bool {
    ["R", "G", "B"].into_iter().all(&has) || (has("Y") && !has("RY") && !has("BY"))
}

fn no_picture(mut names: Vec<String>) -> String {
    names.truncate(12);
    let names = names.join(", ");
    format!("it has neither the channels R, G and B nor Y without colour (there are {names})")
}

/// Reads the first layer with the channels R, G and B, or Y, and notes what the file says and is not obeyed; fails with a reason.
///
/// OpenEXR colours are premultiplied by alpha: over black they stay as they are.
pub fn read(bytes: &[u8]) -> Result<(LinearImage, Vec<String>), String> {
    let image = read_layers(bytes).map_err(|(reason, _)| reason)?;
    let found = image.layer_data.iter().find_map(|layer| Some((layer, planes(layer)?)));
    let Some((layer, planes)) = found else {
        return Err(no_picture(channel_names(&image)));
    };
    let Vec2(width, height) = layer.size;
    if planes.iter().any(|plane| plane.len() != width * height) {
        return Err("its channels differ in resolution".to_owned());
    }
    let mut data = Vec::with_capacity(CHANNELS * width * height);
    planes.iter().for_each(|plane| data.extend(plane.values_as_f32()));
    let light = LinearImage { channels: CHANNELS, height, width, data };

    // What the file says beyond that is not obeyed.
    let mut notes = Vec::new();
    let shared = &image.attributes;
    if image.layer_data.len() > 1 {
        notes.push(format!("only one of its {} layers is used", image.layer_data.len()));
    }
    let is_used = |name: &str| ["R", "G", "B", "A", "Y"].contains(&name);
    let mut others: Vec<String> = layer.channel_data.list.iter().map(|c| c.name.to_string()).collect();
    others.retain(|name| !is_used(name));
    if !others.is_empty() {
        notes.push(format!("its channels {} are not used", others.join(", ")));
    }
    if let Some(xy) = shared.chromaticities {
        let xy: PrimariesXy = [xy.red, xy.green, xy.blue, xy.white].map(|Vec2(x, y)| [x, y]);
        notes.extend(primaries_note(&xy));
    }
    let window = shared.display_window;
    if layer.attributes.layer_position != window.position || layer.size != window.size {
        notes.push("its display window is ignored: all stored pixels are the picture".to_owned());
    }
    if shared.pixel_aspect != 1.0 {
        notes.push(format!("its pixel aspect of {} is ignored", shared.pixel_aspect));
    }
    if let Some(nits) = layer.attributes.white_luminance {
        notes.push(format!("its luminance of white, {nits} cd/m2, is ignored: 1 is white"));
    }
    Ok((light, notes))
}

/// The three planes of a layer: its red, green and blue, or its gray three times.
fn planes(layer: &Layer<AnyChannels<FlatSamples>>) -> Option<[&FlatSamples; CHANNELS]> {
    let channel = |name: &str| {
        let named = layer.channel_data.list.iter().find(|channel| channel.name.eq(name));
        named.map(|channel| &channel.sample_data)
    };
    if !is_picture(|name| channel(name).is_some()) {
        return None;
    }
    match (channel("R"), channel("G"), channel("B")) {
        (Some(red), Some(green), Some(blue)) => Some([red, green, blue]),
        _ => channel("Y").map(|gray| [gray; CHANNELS]),
    }
}
