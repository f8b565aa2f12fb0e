//! Spectral images as OpenEXR files with a channel per band.

use std::path::Path;

use exr::meta::MetaData;
use exr::prelude::{AttributeValue, FlatSamples, Text, Vec2};

use crate::exr_layers::{Wrong, channel_names, read_layers};
use petzval_camera::spectral::SpectralImage;

const HINT: &str = "name the channels by their wavelength: `S0.450,5nm`, `450.5nm` or `w450`; those of a picture in three colours `R`, `G` and `B`";

/// Attribute that holds the unit of radiance.
const UNIT_ATTRIBUTE: &str = "emissiveUnits";

/// Reads the channels that are named by a wavelength, from the first layer that has any. Values are multiplied by `scale`.
/// Without a scale the file's unit, if it states one, must be that of all spectral images.
pub fn read(bytes: &[u8], scale: Option<f64>) -> Result<SpectralImage, Wrong> {
    // Read the pixels, and find the first layer with channels named by wavelengths.
    let picture = read_layers(bytes)?;
    for layer in &picture.layer_data {
        let channels = layer.channel_data.list.iter();
        let mut bands: Vec<(f64, &FlatSamples)> =
            channels.filter_map(|c| Some((wavelength_um(&c.name.to_string())?, &c.sample_data))).collect();
        if bands.is_empty() {
            continue;
        }
        bands.sort_by(|a, b| a.0.total_cmp(&b.0));
        let Vec2(width, height) = layer.size;
        if bands.iter().any(|(_, samples)| samples.len() != width * height) {
            let hint = "give every channel at full resolution";
            return Err(("channels of different resolution".to_owned(), hint));
        }
        let said = [&layer.attributes.other, &picture.attributes.other];
        if let (None, Some(unit)) = (scale, said.iter().find_map(|attributes| unit(attributes)))
            && !is_radiance_per_nm(&unit)
        {
            let unit: String = unit.chars().take(80).collect();
            return Err((format!("its values are in `{unit}` (attribute {UNIT_ATTRIBUTE})"), UNIT_HINT));
        }
        let factor = scale.unwrap_or(1.0);
        let mut data = Vec::with_capacity(bands.len() * width * height);
        for (_, samples) in &bands {
            data.extend(samples.values_as_f32().map(|v| (f64::from(v) * factor) as f32));
        }
        let wavelength_um = bands.iter().map(|(um, _)| *um).collect();
        return Ok(SpectralImage { wavelength_um, height, width, data });
    }
    let mut found = channel_names(&picture);
    found.truncate(12);
    Err((format!("no channel is named by a wavelength (there are {})", found.join(", ")), HINT))
}

const UNIT_HINT: &str =
    "write the factor to W m-2 sr-1 nm-1 as `scale = ...` into a file of the same name that ends with .toml";

fn unit(attributes: &std::collections::HashMap<Text, AttributeValue>) -> Option<String> {
    attributes.iter().find_map(|(name, value)| match value {
        AttributeValue::Text(text) if name.eq(UNIT_ATTRIBUTE) => Some(text.to_string()),
        _ => None,
    })
}

/// Whether a unit is that of radiance per nm; dots, spaces and carets do not matter. Programs that write the layout of
/// Fichet et al. omit the nm but mean it.
fn is_radiance_per_nm(unit: &str) -> bool {
    let plain: String =
        unit.chars().filter(|c| c.is_ascii_alphanumeric() || *c == '-').collect::<String>().to_lowercase();
    matches!(plain.as_str(), "wm-2sr-1" | "wm-2sr-1nm-1" | "wm-2nm-1sr-1")
}

/// Whether a file holds a picture, in red, green and blue or gray, and no band.
pub fn is_picture(path: &Path) -> bool {
    let Ok(meta) = MetaData::read_from_file(path, true) else { return false };
    let names: Vec<String> =
        meta.headers.iter().flat_map(|h| &h.channels.list).map(|c| c.name.to_string()).collect();
    let has = |name: &str| names.iter().any(|n| n == name);
    !names.iter().any(|name| wavelength_um(name).is_some())
        && (has("Y") || ["R", "G", "B"].into_iter().all(has))
}

/// Wavelength, um, in the name of a channel; `None` for other names. Of the Stokes components only the intensity S0 is read.
pub fn wavelength_um(name: &str) -> Option<f64> {
    let text = name.strip_prefix("S0.").unwrap_or(name).replace(',', ".");
    let nm = match text.strip_suffix("nm") {
        Some(number) => number.trim().trim_start_matches(['w', 'W']).parse::<f64>().ok()?,
        None => text.strip_prefix(['w', 'W'])?.parse::<f64>().ok()?,
    };
    (10.0..=100_000.0).contains(&nm).then_some(nm / 1000.0)
}
