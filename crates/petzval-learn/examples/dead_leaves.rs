//! Writes a sheet of generated training pictures.
//!
//! `cargo run --release -p petzval-learn --example dead_leaves -- SHEET.png`

use std::error::Error;
use std::path::PathBuf;

use petzval_camera::image::{CHANNELS, LinearImage};
use petzval_files::save_png;
use petzval_learn::dataset::dead_leaves;

/// Side of a picture, and the gap between two, pixels.
const SIDE: usize = 222;
const GAP: usize = 6;

/// Rows and columns of the sheet.
const ROWS: usize = 2;
const COLUMNS: usize = 4;

fn main() -> Result<(), Box<dyn Error>> {
    let path = PathBuf::from(std::env::args().nth(1).ok_or("give the file of the sheet")?);
    let (height, width) = (ROWS * (SIDE + GAP) - GAP, COLUMNS * (SIDE + GAP) - GAP);
    let mut sheet = LinearImage {
        data: vec![1.0; CHANNELS * height * width],
        ..LinearImage::zeros(CHANNELS, height, width)
    };
    for item in 0..ROWS * COLUMNS {
        let picture = dead_leaves(SIDE, 1, 0, item as u32);
        let (top, left) = (item / COLUMNS * (SIDE + GAP), item % COLUMNS * (SIDE + GAP));
        for c in 0..CHANNELS {
            for row in 0..SIDE {
                let line = &picture.plane(c)[row * SIDE..(row + 1) * SIDE];
                sheet.plane_mut(c)[(top + row) * width + left..][..SIDE].copy_from_slice(line);
            }
        }
    }
    Ok(save_png(&sheet, &path)?)
}
