//! Reads the layers of an OpenEXR file, spectral or not.

use std::io::Cursor;

use exr::meta::MetaData;
use exr::prelude::*;

use crate::limits::MAX_VALUES;

/// What is wrong with a file, and what to do.
pub type Wrong = (String, &'static str);

/// The layers of a file at full resolution, with all channels and attributes.
pub type ExrLayers = Image<Layers<AnyChannels<FlatSamples>>>;

/// Largest compression of an OpenEXR image. A header that claims more is damaged.
const MOST_COMPRESSED: usize = 2000;

/// Reads all layers. The size in the header is checked before memory is allocated for it.
pub fn read_layers(bytes: &[u8]) -> std::result::Result<ExrLayers, Wrong> {
    let damaged =
        |e: Error| (format!("not a readable OpenEXR file: {e}"), "give an OpenEXR file of plain pixels");
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), true).map_err(damaged)?;
    let claimed = meta.headers.iter().try_fold(0usize, |sum, header| {
        let pixels = header.layer_size.0.checked_mul(header.layer_size.1)?;
        sum.checked_add(pixels.checked_mul(header.channels.list.len())?)
    });
    let possible = MAX_VALUES.min(bytes.len().saturating_mul(MOST_COMPRESSED));
    if claimed.is_none_or(|n| n > possible) {
        let reason = format!("{} bytes cannot hold what the header claims, or it is too large", bytes.len());
        return Err((reason, "give an OpenEXR file of at most 2 GiB of pixels"));
    }
    exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(damaged)
}

/// Names of the channels of all layers.
pub fn channel_names(image: &ExrLayers) -> Vec<String> {
    let channels = image.layer_data.iter().flat_map(|layer| &layer.channel_data.list);
    channels.map(|channel| channel.name.to_string()).collect()
}
