//! Reading any bytes as a picture ends soon and without a panic, with a picture or with an error.
//!
//! Every kind is read 2000 times; `PETZVAL_MUTATIONS=1000000` makes it a million.

use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};

use image::{DynamicImage, ImageFormat, Rgb, RgbImage};
use petzval_files::load_image_bytes;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A small picture as a file of a kind.
fn file(format: ImageFormat) -> Vec<u8> {
    let colour = |x: u32, y: u32| Rgb([(7 * x % 251) as u8, (11 * y % 241) as u8, ((x * y) % 239) as u8]);
    let picture = DynamicImage::from(RgbImage::from_fn(24, 17, colour));
    let picture = if format == ImageFormat::Hdr { picture.to_rgb32f().into() } else { picture };
    let mut bytes = Cursor::new(Vec::new());
    picture.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

fn mutated(file: &[u8], random: &mut impl Rng) -> Vec<u8> {
    let mut bytes = file.to_vec();
    for _ in 0..random.random_range(1..4) {
        // Heads decide how the rest is read.
        let most = if random.random() { bytes.len().min(64) } else { bytes.len() };
        let at = random.random_range(0..=most);
        let end = (at + random.random_range(0..12)).min(bytes.len());
        match random.random_range(0..6) {
            0 => bytes.truncate(at),
            1 => drop(bytes.drain(at..end)),
            2 => {
                let copy = bytes[at..end].to_vec();
                bytes.splice(at..at, copy);
            }
            _ if at < bytes.len() => bytes[at] = random.random(),
            _ => {}
        }
    }
    bytes
}

#[test]
fn no_bytes_of_a_picture_make_its_reader_panic() {
    let times = std::env::var("PETZVAL_MUTATIONS").map_or(2000, |times| times.parse().unwrap());
    let formats = [
        ImageFormat::Png,
        ImageFormat::Jpeg,
        ImageFormat::Tiff,
        ImageFormat::WebP,
        ImageFormat::Bmp,
        ImageFormat::Hdr,
        ImageFormat::Pnm,
    ];
    for (seed, format) in (0..).zip(formats) {
        let whole = file(format);
        assert!(load_image_bytes(&whole, "whole").is_ok(), "{format:?}");
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut read = 0;
        for _ in 0..times {
            let bytes = mutated(&whole, &mut random);
            let found = catch_unwind(AssertUnwindSafe(|| load_image_bytes(&bytes, "mutated")));
            let found = found.unwrap_or_else(|_| panic!("{format:?}: {}", bytes.escape_ascii()));
            read += usize::from(found.is_ok_and(|picture| picture.light.data.iter().all(|v| v.is_finite())));
        }
        // PNG has checksums, so that most changes are found.
        assert!(read > 0 && read < times, "{format:?}: {read} of {times}");
    }
}
