//! Prints how near every method of demosaicing comes to a folder of pictures, as the tables of the literature do.
//!
//! Each picture, as it is encoded, is reduced to the mosaic of an RGGB array, with and without Gaussian noise, and demosaiced; the
//! result is rounded to 8 bits. PSNR is over the three colours, 8 pixels of border left out, mean over the pictures.
//!
//! `cargo run --release -p petzval-files --example demosaic_table -- FOLDER`

use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;

use petzval_camera::develop::Demosaic;
use petzval_camera::image::{LinearImage, srgb_encode};
use petzval_camera::quality::psnr;
use petzval_camera::render::Placement;
use petzval_camera::sensor::CfaPattern;
use petzval_files::load_image;
use rand::SeedableRng;
use rand_distr::{Distribution, Normal};

/// Pixels left out at the border.
const BORDER: usize = 8;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("give a folder of pictures")?;
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(&folder)?.map(|entry| Ok(entry?.path())).collect::<Result<_, std::io::Error>>()?;
    files.sort();
    files.retain(|path| path.extension().is_some_and(|e| e == "png"));
    if files.is_empty() {
        return Err(format!("{folder} has no PNG file").into());
    }
    println!("{} pictures of {folder}", files.len());
    println!("| noise | {} |", Demosaic::ALL.map(Demosaic::name).join(" | "));
    println!("|---|---|---|---|---|");
    let mut seconds = [0.0; 4];
    let mut pixels = 0;
    for sigma in [0.0_f32, 0.05] {
        let mut sums = [0.0; 4];
        for (i, path) in files.iter().enumerate() {
            let mut picture = load_image(path)?.light;
            picture.data.iter_mut().for_each(|v| *v = srgb_encode(*v));
            let (height, width) = (picture.height, picture.width);
            let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(i as u64);
            let noise = Normal::new(0.0, sigma)?;
            let mosaic: Vec<f32> = (0..height * width)
                .map(|k| {
                    let plane = CfaPattern::RGGB.colour(k / width, k % width).plane().unwrap_or(1);
                    picture.plane(plane)[k] + noise.sample(&mut rng)
                })
                .collect();
            let truth = inner(&picture)?;
            for (k, method) in Demosaic::ALL.into_iter().enumerate() {
                let start = Instant::now();
                let rgb = method.apply(&mosaic, height, width, CfaPattern::RGGB, Placement::default())?;
                seconds[k] += start.elapsed().as_secs_f64();
                sums[k] += psnr(&truth, &inner(&rgb)?)?;
            }
            pixels += height * width;
        }
        let row = sums.map(|sum| format!("{:.2}", sum / files.len() as f64));
        println!("| {sigma} | {} |", row.join(" | "));
    }
    let speed = seconds.map(|s| format!("{:.1}", 1e9 * s / pixels as f64));
    println!("| ms per million pixels | {} |", speed.join(" | "));
    Ok(())
}

/// The values of a picture without its border, rounded to 8 bits.
fn inner(picture: &LinearImage) -> Result<Vec<f32>, Box<dyn Error>> {
    let [height, width] = [picture.height, picture.width].map(|side| side.saturating_sub(2 * BORDER));
    let inner = picture.crop(BORDER, BORDER, height, width)?;
    Ok(inner.data.iter().map(|v| (v.clamp(0.0, 1.0) * 255.0).round() / 255.0).collect())
}
