//! Linear light as OpenEXR and NumPy files, without a transfer curve or rounding.

use std::io::Cursor;
use std::path::Path;

use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, SmallVec, WritableImage,
};
use npyz::WriterBuilder;

use petzval_camera::image::{CHANNELS, LinearImage};

use super::ImageError;
use petzval_base::write_whole;

/// The bytes of an OpenEXR file with the named channels, 32-bit floats, row by row. Fails with a message if there is no
/// channel, or if a channel does not have `height x width` values.
pub fn exr_bytes(height: usize, width: usize, channels: &[(&str, &[f32])]) -> Result<Vec<u8>, String> {
    let pixels = height.checked_mul(width).filter(|n| *n > 0 && height.max(width) < (1 << 30));
    let Some(pixels) = pixels.filter(|_| !channels.is_empty()) else {
        return Err(format!("{} channels of {width} x {height} pixels", channels.len()));
    };
    let mut list = SmallVec::new();
    for (name, values) in channels {
        if values.len() != pixels {
            let count = values.len();
            return Err(format!("channel {name}: {count} values do not fill {width} x {height} pixels"));
        }
        let Some(name) = exr::prelude::Text::new_or_none(name) else {
            return Err(format!("channel {name}: the name is not Latin text"));
        };
        list.push(AnyChannel::new(name, FlatSamples::F32(values.to_vec())));
    }
    let (about, list) = (LayerAttributes::default(), AnyChannels::sort(list));
    let layer = Layer::new((width, height), about, Encoding::FAST_LOSSLESS, list);
    let mut out = Cursor::new(Vec::new());
    Image::from_layer(layer).write().to_buffered(&mut out).map_err(|e| e.to_string())?;
    Ok(out.into_inner())
}

/// The bytes of a NumPy array of this shape, last axis fastest: `<f4` for `f32`, `<f8` for `f64`.
pub fn npy_bytes<T: npyz::AutoSerialize + Copy>(shape: &[u64], data: &[T]) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut writer = npyz::WriteOptions::new().default_dtype().shape(shape).writer(&mut bytes).begin_nd()?;
    writer.extend(data.iter().copied())?;
    writer.finish()?;
    Ok(bytes)
}

/// Writes linear light as an OpenEXR file of 32-bit floats. Three planes become the channels `R`, `G`, `B`, one plane `Y`,
/// and any other number `P0`, `P1`, ...
pub fn save_exr(image: &LinearImage, path: &Path) -> Result<(), ImageError> {
    let names: Vec<String> = match image.channels {
        1 => vec!["Y".to_owned()],
        CHANNELS => ["R", "G", "B"].map(str::to_owned).to_vec(),
        n => (0..n).map(|i| format!("P{i}")).collect(),
    };
    let channels: Vec<(&str, &[f32])> =
        names.iter().enumerate().map(|(c, name)| (name.as_str(), image.plane(c))).collect();
    let bytes = exr_bytes(image.height, image.width, &channels)
        .map_err(|reason| ImageError::Encode { name: path.display().to_string(), reason })?;
    write_whole(path, &bytes).map_err(|source| ImageError::Io { path: path.to_owned(), source })
}

/// Writes linear light as a NumPy array `<f4` with the axes plane, row, column.
pub fn save_npy(image: &LinearImage, path: &Path) -> Result<(), ImageError> {
    let shape = [image.channels, image.height, image.width].map(|n| n as u64);
    let bytes = npy_bytes(&shape, &image.data)
        .map_err(|e| ImageError::Encode { name: path.display().to_string(), reason: e.to_string() })?;
    write_whole(path, &bytes).map_err(|source| ImageError::Io { path: path.to_owned(), source })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(channels: usize) -> LinearImage {
        let data = (0..channels * 5 * 7).map(|i| 0.37 * i as f32 - 3.0).collect();
        LinearImage::from_data(channels, 5, 7, data).unwrap()
    }

    #[test]
    fn exr_keeps_every_bit_of_light() {
        let folder = tempfile::tempdir().unwrap();
        for (channels, names) in [(1, &["Y"][..]), (3, &["R", "G", "B"]), (2, &["P0", "P1"])] {
            let (image, path) = (ramp(channels), folder.path().join("light.exr"));
            save_exr(&image, &path).unwrap();
            let back = exr::prelude::read_first_flat_layer_from_file(&path).unwrap();
            assert_eq!(back.layer_data.size, exr::prelude::Vec2(7, 5));
            for (c, name) in names.iter().enumerate() {
                let channel = back.layer_data.channel_data.list.iter().find(|ch| ch.name.eq(name)).unwrap();
                let values: Vec<f32> = channel.sample_data.values_as_f32().collect();
                assert_eq!(values, image.plane(c), "{name}");
            }
        }
    }

    #[test]
    fn npy_keeps_every_bit_of_light() {
        let folder = tempfile::tempdir().unwrap();
        let (image, path) = (ramp(3), folder.path().join("light.npy"));
        save_npy(&image, &path).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let array = npyz::NpyFile::new(&bytes[..]).unwrap();
        assert_eq!(array.shape(), [3, 5, 7]);
        assert_eq!(array.into_vec::<f32>().unwrap(), image.data);
    }

    #[test]
    fn channels_that_do_not_fit_are_refused() {
        assert!(exr_bytes(2, 3, &[("Y", &[0.0; 5])]).unwrap_err().contains("5 values"));
        assert!(exr_bytes(0, 3, &[("Y", &[])]).is_err());
        assert!(exr_bytes(2, 3, &[]).is_err());
    }
}
