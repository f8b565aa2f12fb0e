//! Pictures in OpenEXR files: linear light in the channels R, G, B, or gray in Y.

use exr::prelude::{AnyChannels, FlatSamples, Layer, Vec2};

use super::ignored::{PrimariesXy, primaries_note};
use crate::exr_layers::{channel_names, read_layers};
use petzval_camera::image::{CHANNELS, LinearImage};

/// Reads the first layer with the channels R, G and B, or Y, and notes what the file says and is not obeyed; fails with a reason.
///
/// OpenEXR colours are premultiplied by alpha: over black they stay as they are.
pub fn read(bytes: &[u8]) -> Result<(LinearImage, Vec<String>), String> {
    let image = read_layers(bytes).map_err(|(reason, _)| reason)?;
    let found = image.layer_data.iter().find_map(|layer| Some((layer, planes(layer)?)));
    let Some((layer, planes)) = found else {
        let mut names = channel_names(&image);
        names.truncate(12);
        return Err(format!(
            "it has neither the channels R, G and B nor Y without colour (there are {})",
            names.join(", ")
        ));
    };
    let Vec2(width, height) = layer.size;
    if planes.iter().any(|plane| plane.len() != width * height) {
        return Err("its channels differ in resolution".to_owned());
    }
    let data = planes.iter().flat_map(|plane| plane.values_as_f32()).collect();
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
    if let (Some(red), Some(green), Some(blue)) = (channel("R"), channel("G"), channel("B")) {
        return Some([red, green, blue]);
    }
    // Y beside RY and BY is the luminance of a coloured picture.
    let gray = channel("Y").filter(|_| channel("RY").is_none() && channel("BY").is_none());
    gray.map(|gray| [gray; CHANNELS])
}
