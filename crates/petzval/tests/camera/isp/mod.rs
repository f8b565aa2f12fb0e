//! `petzval isp`.

mod develop;
mod external;
mod frames;
mod tune;

use std::path::Path;

use crate::common::{data, run_ok};

/// Writes raw frames of a known sensor: two parts of a photograph behind a GRBG mosaic, with their sidecars.
pub fn write_raws(folder: &Path) {
    let photo = image::open(data("photos/coffee.png")).unwrap().into_rgb8();
    std::fs::create_dir_all(folder).unwrap();
    for (name, at) in [("left", (20, 60)), ("right", (240, 120))] {
        let frame = image::ImageBuffer::<image::Luma<u16>, _>::from_fn(48, 32, |x, y| {
            let channel = match (x % 2, y % 2) {
                (1, 0) => 0,
                (0, 1) => 2,
                _ => 1,
            };
            let encoded = f64::from(photo.get_pixel(at.0 + x, at.1 + y).0[channel]) / 255.0;
            let response = [0.6, 1.0, 0.7][channel];
            image::Luma([(119.0 + 3000.0 * response * encoded.powf(2.2)).round() as u16])
        });
        frame.save(folder.join(format!("{name}.tiff"))).unwrap();
        let sidecar = "bits = 12\ncfa = \"GRBG\"\nblack_level_dn = 119\nwhite_level_dn = 4000\nsensor = \"imx249-fitted\"\n";
        std::fs::write(folder.join(format!("{name}.tiff.toml")), sidecar).unwrap();
    }
}

pub const TRUTH: [&str; 3] = ["gain.stops=0.6", "white_balance.red=1.25", "white_balance.blue=0.8"];

/// Develops the raws with the true settings as references.
pub fn write_references(folder: &Path) {
    let set: Vec<&str> = TRUTH.iter().flat_map(|change| ["--set", change]).collect();
    let raws = ["isp", "develop", "raws/left.tiff", "raws/right.tiff", "--bits", "16", "--out", "reference"];
    run_ok(folder, &[&raws[..], &set].concat());
}
