//! A slanted edge is imaged by a lens onto pixels. The MTF that is measured of the raw frame must be the product of three MTFs: lens,
//! pixel, and the cells on which the picture is computed.

use std::f64::consts::PI;
use std::path::Path;
use std::sync::Arc;

use petzval_camera::image::LinearImage;
use petzval_files::save_png16;
use petzval_jobs::raw::mtf::{self, Region};
use petzval_jobs::{Context, Silent, built_in_assets, simulate};
use petzval_lab::edge_mtf::EdgeMtf;
use petzval_optics::analysis::{AnalysisOptions, FieldMtf, field_mtf};
use petzval_optics::lens::Lens;
use petzval_optics::pupil::field_imaged_at;

const LENS: &str = "cooke-triplet-nominal";

/// Samples of the scene along a side of a pixel.
const SAMPLES: usize = 8;

const PIXEL_UM: f64 = 5.86;

/// Inclination of the edges, degrees.
const ANGLE_DEG: f64 = 5.0;

/// Wavelengths of the blue, green and red channel, um.
const COLOURS_UM: [f64; 3] = [0.486, 0.55, 0.62];

/// Largest difference. The modulus of a difference of MTFs is at most the sum of absolute differences of the PSFs: this bounds the error.
/// PSFs of pictures have an error of 0.02 by their pupil cells, and of 0.03 in the median by the blend of patches beside the axis.
const ON_AXIS: f64 = 0.02;
const BESIDE_AXIS: f64 = 0.05;

/// Where an edge stands or lies.
struct Target {
    /// Rows and columns of the sensor.
    size: [usize; 2],
    /// The point on the edge, in pixels from the middle of the sensor along a row.
    from_middle: f64,
    is_upright: bool,
}

impl Target {
    /// The edge on a scene of [`SAMPLES`] samples a pixel. A sample has the share of its area that is bright, along the normal of the edge.
    fn scene(&self) -> LinearImage {
        let [height, width] = self.size.map(|side| side * SAMPLES);
        let (sin, cos) = ANGLE_DEG.to_radians().sin_cos();
        let light = |i: usize| {
            let middle = |at: usize, side: usize| at as f64 + 0.5 - 0.5 * side as f64;
            let (x, y) = (middle(i % width, width), middle(i / width, height));
            let x = x - self.from_middle * SAMPLES as f64;
            let distance = if self.is_upright { x * cos - y * sin } else { y * cos - x * sin };
            (0.1 + 0.7 * (0.5 + distance).clamp(0.0, 1.0)) as f32
        };
        let plane: Vec<f32> = (0..height * width).map(light).collect();
        LinearImage { channels: 3, height, width, data: plane.repeat(3) }
    }

    /// The edge as `raw mtf` measures it in the green, or the only, channel of a frame that `simulate` takes.
    fn measured(&self, cfa: &str, folder: &Path) -> EdgeMtf {
        let context = Context::new(built_in_assets(), Arc::new(Silent));
        let [height, width] = self.size;
        let sensor = folder.join("sensor.toml");
        std::fs::write(
            &sensor,
            format!(
                "name = \"fine\"\nsource = \"a test\"\nheight = {height}\nwidth = {width}\npixel_um = {PIXEL_UM}\nbits = 16\nblack_level_dn = 100.0\n\
                 gain_dn_per_e = 1.0\nfull_well_e = 65000.0\ndark_current_e_per_s = 0.0\nread_noise_mean_e = 0.0\nread_noise_e = 0.0\n\
                 electronics_mean_dn = 0.0\nelectronics_noise_dn = 0.0\nelectronics = \"before_adc\"\nrelative_qe = [1.0, 1.0, 1.0]\n\
                 cfa = \"{cfa}\"\n"
            ),
        )
        .unwrap();
        let scene = folder.join("edge.png");
        save_png16(&self.scene(), &scene).unwrap();
        let request = simulate::Request {
            images: vec![scene],
            lens: LENS.into(),
            sensor: sensor.display().to_string().into(),
            samples: Some(SAMPLES),
            no_distortion: true,
            no_noise: true,
            white_e: Some(50_000.0),
            out: folder.join("taken"),
            ..simulate::Request::default()
        };
        let taken = simulate::run(&request, &context).unwrap();
        const SIDE: usize = 100;
        let col = (0.5 * width as f64 + self.from_middle) as usize - SIDE / 2;
        let region = Region { row: (height - SIDE) / 2, col, height: SIDE, width: SIDE };
        let request = mtf::Request {
            file: taken.images[0]["raw"].as_str().unwrap().into(),
            regions: vec![region],
            ..mtf::Request::default()
        };
        let response = mtf::run(&request, &context).unwrap();
        assert_eq!((response.light, response.pixel_um), (mtf::Light::Raw, Some(PIXEL_UM)));
        let channels = &response.edges[0].channels;
        let found = channels.iter().find(|of| of.channel == "green").unwrap_or(&channels[0]).clone();
        assert_eq!(found.is_upright, self.is_upright);
        assert!((found.angle_deg - ANGLE_DEG).abs() < 0.1, "{}", found.angle_deg);
        found
    }
}

/// The MTF of the lens where its image is `radius_mm` from the axis, at every multiple of 1/100 cycle per pixel.
fn of_lens(radius_mm: f64, wavelengths_um: &[f64]) -> FieldMtf {
    let lens = built_in_assets().lens(LENS).unwrap().lens;
    let lens = Lens { wavelengths_um: wavelengths_um.to_vec(), reference_um: COLOURS_UM[1], ..lens };
    let field = match radius_mm {
        0.0 => 0.0,
        _ => field_imaged_at(&lens.at_wavelength(COLOURS_UM[1]), radius_mm, 0.1).unwrap().to_degrees(),
    };
    let options = AnalysisOptions {
        pupil_cells: 512,
        max_frequency_per_mm: Some(mtf::per_mm(0.5, PIXEL_UM)),
        frequency_points: 51,
        ..AnalysisOptions::default()
    };
    field_mtf(&lens, field, &options).unwrap()
}

/// Cells of the PSFs of pictures, um.
const CELL_UM: f64 = 1.0;

/// The response of a square of so many pixels a side across an inclined edge.
fn of_square(side_px: f64, frequency: f64) -> f64 {
    let sinc = |x: f64| if x == 0.0 { 1.0 } else { (PI * x).sin() / (PI * x) };
    let (sin, cos) = ANGLE_DEG.to_radians().sin_cos();
    sinc(frequency * side_px * cos) * sinc(frequency * side_px * sin)
}

/// The response of all that lies between the scene and the frame apart from the lens: the pixel; the samples of the scene; and the cells of the
/// PSF, over which a quadratic B-spline spreads every ray. That is a square cell three times over.
fn beside_the_lens(frequency: f64) -> f64 {
    of_square(1.0, frequency)
        * of_square(1.0 / SAMPLES as f64, frequency)
        * of_square(CELL_UM / PIXEL_UM, frequency).powi(3)
}

/// The largest difference up to Nyquist's frequency.
fn largest_difference(found: &EdgeMtf, lens: &[f64]) -> f64 {
    let at = |frequency: f64| {
        let k = found.frequency_per_px.iter().position(|f| (f - frequency).abs() < 1e-9).unwrap();
        found.modulation[k]
    };
    (0..=50)
        .map(|k| (at(0.01 * k as f64) - lens[k] * beside_the_lens(0.01 * k as f64)).abs())
        .fold(0.0, f64::max)
}

#[test]
fn the_mtf_of_a_raw_frame_is_that_of_lens_and_pixel() {
    // The first is on the axis, the others where meridional and sagittal sections differ.
    for (cfa, size, from_middle, is_upright) in [
        ("mono", [160, 200], 0.0, true),
        ("RGGB", [160, 200], 0.0, true),
        ("mono", [160, 1400], 600.0, true),
        ("mono", [160, 1400], 600.0, false),
        ("GRBG", [160, 1400], 600.0, false),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let found = Target { size, from_middle, is_upright }.measured(cfa, folder.path());
        // A pixel without a filter sees the mean of the three colours.
        let seen_um = if cfa == "mono" { &COLOURS_UM[..] } else { &COLOURS_UM[1..2] };
        let lens = of_lens(1e-3 * PIXEL_UM * from_middle, seen_um).geometric;
        let lens = if is_upright { lens.tangential } else { lens.sagittal };
        let difference = largest_difference(&found, &lens);
        let most = if from_middle == 0.0 { ON_AXIS } else { BESIDE_AXIS };
        assert!(difference < most, "{cfa} at {from_middle}: {difference}");
    }
}
