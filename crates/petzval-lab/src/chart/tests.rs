//! Charts whose colours, noise and sharpness are known.

use petzval_base::Cancel;
use petzval_camera::image::{LinearImage, srgb_encode};
use petzval_camera::isp::RgbPicture;
use petzval_camera::psf::PsfBank;
use petzval_camera::render::{Placement, RenderGeometry, Window, light_on_pixels};
use petzval_camera::spectral::{
    ChartData, Illuminant, TestChart, apply, colour_checker, d65_white, seen_under,
};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

use super::*;

const CHART: TestChart = TestChart { height: 500, width: 700 };

fn wanted() -> Vec<[f64; 3]> {
    let light = Illuminant::named("D65").unwrap();
    colour_checker(ChartData::Ohta).iter().map(|(_, curve)| seen_under(curve, &light)).collect()
}

/// The chart as a perfect camera would show it, its light times `factor`, with noise of `sigma` of white in the encoded values.
fn picture(factor: f64, sigma: f32) -> RgbPicture {
    let (_, _, srgb_of_xyz) = d65_white();
    let linear: Vec<[f64; 3]> = wanted().iter().map(|xyz| apply(&srgb_of_xyz, *xyz)).collect();
    let noise = Normal::new(0.0, sigma).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut data = Vec::new();
    let scene = CHART.draw();
    for c in 0..3 {
        for (a, b, share) in &scene.pixels {
            let share = f64::from(*share);
            let light = (1.0 - share) * linear[*a as usize][c] + share * linear[*b as usize][c];
            let encoded = srgb_encode((factor * light).clamp(0.0, 1.0) as f32) + noise.sample(&mut rng);
            data.push((encoded.clamp(0.0, 1.0) * 65535.0).round() as u16);
        }
    }
    RgbPicture { height: CHART.height, width: CHART.width, bits: 16, data }
}

#[test]
fn a_perfect_picture_has_no_errors_but_the_blur_of_its_pixels() {
    let figures = measure(&picture(1.0, 0.0), &CHART, &wanted(), |at| at);
    // Cyan lies outside sRGB: its red is cut off at zero.
    let errors: Vec<f64> = figures.patches.iter().map(|p| p.delta_e_2000).collect();
    assert!(errors.iter().enumerate().all(|(i, e)| i == 17 || *e < 0.02), "{errors:?}");
    assert!((figures.normalised.factor - 1.0).abs() < 1e-3);
    for edge in &figures.edges {
        assert!(edge.failures.is_empty(), "{:?}", edge.failures);
        // The response of a square pixel falls to a half at 0.603 cycles.
        let mtf50 = edge.mtf50_per_px.unwrap();
        assert!((mtf50 - 0.603).abs() < 0.012, "{}: {mtf50}", edge.contrast);
        assert!(edge.overshoot.unwrap() < 0.01 && edge.undershoot.unwrap() < 0.01);
    }
}

#[test]
fn an_edge_that_cannot_be_measured_has_no_figures() {
    let mut flat = picture(1.0, 0.0);
    flat.data.fill(0x4000);
    for edge in &measure(&flat, &CHART, &wanted(), |at| at).edges {
        assert_eq!(edge.failures.len(), 4, "{:?}", edge.failures);
        assert_eq!(
            (edge.mtf50_per_px, edge.overshoot, edge.undershoot, edge.overshoot_error),
            (None, None, None, None)
        );
    }
}

#[test]
fn darkness_counts_only_in_lightness_as_developed() {
    let figures = measure(&picture(0.7, 0.0), &CHART, &wanted(), |at| at);
    assert!((figures.normalised.factor - 1.0 / 0.7).abs() < 1e-3);
    assert!(figures.as_developed.mean_delta_e_2000 > 5.0 && figures.normalised.mean_delta_e_2000 < 0.2);
}

#[test]
fn noise_of_the_patches_is_that_of_the_picture() {
    let sigma = 0.02;
    let figures = measure(&picture(0.8, sigma), &CHART, &wanted(), |at| at);
    // Independent noise of three colours: luma has the root of the sum of the squared shares.
    let luma = f64::from(sigma) * (0.2126_f64.powi(2) + 0.7152_f64.powi(2) + 0.0722_f64.powi(2)).sqrt();
    let cb =
        f64::from(sigma) * (0.9278_f64.powi(2) + 0.2126_f64.powi(2) + 0.7152_f64.powi(2)).sqrt() / 1.8556;
    let cr =
        f64::from(sigma) * (0.7874_f64.powi(2) + 0.0722_f64.powi(2) + 0.7152_f64.powi(2)).sqrt() / 1.5748;
    // 1600 pixels: the standard deviation is known to 1.8 %.
    for (i, patch) in figures.patches.iter().enumerate().take(23).skip(19) {
        for (found, wanted) in [(patch.noise.luma, luma), (patch.noise.cb, cb), (patch.noise.cr, cr)] {
            assert!((found / wanted - 1.0).abs() < 0.08, "patch {i}: {found} {wanted}");
        }
        assert!((10.0..40.0).contains(&patch.noise.snr_db.unwrap()), "{:?}", patch.noise);
    }
}

#[test]
fn windows_follow_the_picture() {
    // The same chart, moved by eight pixels to the right and four down.
    let still = picture(1.0, 0.0);
    let size = still.height * still.width;
    let moved_from = |i: usize| {
        let (row, col) = (i % size / still.width, i % still.width);
        i / size * size + row.saturating_sub(4) * still.width + col.saturating_sub(8)
    };
    let data = (0..3 * size).map(|i| still.data[moved_from(i)]).collect();
    let moved =
        measure(&RgbPicture { data, ..still.clone() }, &CHART, &wanted(), |[x, y]| [x + 8.0, y + 4.0]);
    let still = measure(&still, &CHART, &wanted(), |at| at);
    assert_eq!(moved.patches, still.patches);
    assert_eq!(moved.edges[0], still.edges[0]);
}

/// The MTF50 of the edges of the chart behind a lens whose PSF is a Gauss curve of so many pixels, drawn with so many samples a pixel.
fn mtf50_behind_a_lens(sigma_px: f64, samples: usize, as_points: bool) -> f64 {
    let (_, _, srgb_of_xyz) = d65_white();
    let linear: Vec<[f64; 3]> = wanted().iter().map(|xyz| apply(&srgb_of_xyz, *xyz)).collect();
    let scene = TestChart { height: CHART.height * samples, width: CHART.width * samples }.draw();
    let plane = |c: usize| {
        let light = &linear;
        scene.pixels.iter().map(move |(a, b, share)| {
            let share = f64::from(*share);
            ((1.0 - share) * light[*a as usize][c] + share * light[*b as usize][c]) as f32
        })
    };
    let data = (0..3).flat_map(plane).collect();
    let means = LinearImage { channels: 3, height: scene.height, width: scene.width, data };
    let scene = if as_points { means.point_values() } else { means };
    // Cells of a tenth of a pixel: their own blur is a thousandth of the MTF.
    let (grid, pixel_um, pitch_um) = (60, 4.0, 0.4);
    let cell = |i: usize| (-0.5 * ((i as f64 - 29.5) * pitch_um / (sigma_px * pixel_um)).powi(2)).exp();
    let psf: Vec<f64> = (0..grid * grid).map(|i| cell(i / grid) * cell(i % grid)).collect();
    let sum: f64 = psf.iter().sum();
    let values = psf.iter().map(|v| (v / sum) as f32).collect::<Vec<_>>().repeat(3);
    let bank = PsfBank { field_radius_mm: vec![0.0], grid, pitch_um, values, illumination: vec![1.0; 3] };
    let (sensor_height, sensor_width) = (CHART.height, CHART.width);
    let geometry = RenderGeometry { sensor_height, sensor_width, pixel_um, patches: (1, 1) };
    let window =
        Window { placement: Placement { row: 0, col: 0 }, height: sensor_height, width: sensor_width };
    let light =
        light_on_pixels(&geometry, &bank, &scene, None, &window, samples, &Cancel::default()).unwrap();
    let data = light.data.iter().map(|v| (srgb_encode(v.clamp(0.0, 1.0)) * 65535.0).round() as u16).collect();
    let picture = RgbPicture { height: sensor_height, width: sensor_width, bits: 16, data };
    let figures = measure(&picture, &CHART, &wanted(), |at| at);
    figures.edges[0].mtf50_per_px.unwrap()
}

#[test]
fn an_edge_behind_a_lens_has_the_mtf_of_lens_and_pixel() {
    use std::f64::consts::PI;
    let sigma_px = 0.45;
    // The transfer of the Gauss curve, of a pixel and of the cells of the PSF; it falls to a half once.
    let sinc = |x: f64| (PI * x).sin() / (PI * x);
    let mtf = |f: f64| (-2.0 * (PI * sigma_px * f).powi(2)).exp() * sinc(f) * sinc(0.1 * f);
    let wanted = (1..10_000).map(|i| f64::from(i) * 1e-4).find(|f| mtf(*f) < 0.5).unwrap();
    let [plain, as_points] = [false, true].map(|as_points| mtf50_behind_a_lens(sigma_px, 2, as_points));
    assert!((as_points / wanted - 1.0).abs() < 0.006, "{as_points} {wanted}");
    // Means that are integrated twice are what this is about.
    assert!(plain / wanted < 0.985, "{plain} {wanted}");
}
