use petzval_camera::develop::dark_mean_dn;
use petzval_camera::image::{CHANNELS, LinearImage};
use petzval_camera::psf_calibration::average::{Average, Dark};
use petzval_camera::psf_calibration::capture::{WindowLight, take_frame};
use petzval_camera::psf_calibration::compare::compare;
use petzval_camera::psf_calibration::estimate::{Place, estimate_bank};
use petzval_camera::psf_calibration::manifest::{MANIFEST_FILE, Manifest};
use petzval_camera::psf_calibration::measure::{Frame, Measured, extract_ideal, l1, measure};
use petzval_camera::psf_calibration::merge::{ExposureMean, Merged, merge};
use petzval_camera::psf_calibration::register::explain;
use petzval_camera::psf_calibration::{CROP, FinePsf, Spot, calibrate_position};
use petzval_camera::raw_file::{RawFormat, RawFrame, save_raw_alone};
use petzval_camera::render::{Placement, RenderGeometry, kernel_radius, render};
use petzval_camera::sensor::{Exposure, Noise, NoiseMode, SensorModel};

use super::*;
use crate::assets::Assets;
use crate::pinhole::{PinholeView, Refocus};

/// A blurred point on one position, captured twice and measured.
fn calibration() -> Calibration {
    let sensor =
        SensorModel::from_toml(include_str!("../../../../data/sensors/imx249-calibrated.toml")).unwrap();
    let grid = 64;
    let spot = |i: usize| {
        let (y, x) = ((i / grid) as f64 - 31.5, (i % grid) as f64 - 31.5);
        (-0.5 * (x * x + y * y) / 36.0).exp() / (std::f64::consts::TAU * 36.0)
    };
    let values: Vec<f64> = (0..grid * grid).map(spot).collect();
    let psf = FinePsf {
        grid,
        pitch_um: 1.0,
        values: [values.clone(), values.clone(), values],
        light: [5e6; 3],
        disc_um: 0.0,
    };
    let at = Spot { row: 24.2, col: 23.7, azimuth_rad: 0.0 };
    let light = WindowLight {
        height: 48,
        width: 48,
        placement: Placement { row: 575, col: 1100 },
        rate_e_per_s: psf.land(at, 5.86, (48, 48)),
    };
    let folder = std::env::temp_dir().join(format!("petzval-psf-report-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    for n in 0..2 {
        let noise = Noise { mode: NoiseMode::Exact, seed: 1 };
        let raw = take_frame(&light, &sensor, 0.016, 1.0, &noise, n).unwrap();
        let path = folder.join(format!("{n}.png"));
        save_raw_alone(&RawFrame::from_raw(&raw, &sensor), &path, RawFormat::Png).unwrap();
    }
    let text = "sensor = \"imx249-calibrated\"\n[[position]]\nname = \"<a>\"\nazimuth_deg = 0.0\norigin = [575, 1100]\n\
                [[position.exposure]]\nexposure_ms = 16.0\nframes = [\"0.png\", \"1.png\"]\n";
    std::fs::write(folder.join(MANIFEST_FILE), text).unwrap();
    let manifest = Manifest::from_toml(text).unwrap();
    let position = calibrate_position((&manifest, text), &folder, 0, &sensor, 1, || ()).unwrap();
    std::fs::remove_dir_all(&folder).unwrap();
    let comparison = compare(&position.measured, &position.frame, &psf, 5.86, 0.0, None, "a").unwrap();
    assert!(comparison.l1[1] < 1.5 * position.measured.floor.l1[1]);
    Calibration {
        captures: "bench & <co>".into(),
        sensor: sensor.name,
        lens: Some("triplet".into()),
        positions: vec![(position, Some(comparison))],
        fields: Vec::new(),
    }
}

#[test]
fn page_and_sheet_show_every_psf() {
    let calibration = calibration();
    let text = page(&calibration);
    assert_eq!(text.matches("data:image/png").count(), 6);
    assert!(text.contains("bench &amp; &lt;co&gt;") && text.contains("no dark frames"));
    assert!(!text.contains("NaN") && !text.contains("http"), "self-contained, and every number is one");
    assert!(text.contains("over the other exposures") && text.contains("“Ideal pixels”"));
    // Without a lens nothing is said of columns that are not there.
    let mut alone = self::calibration();
    alone.lens = None;
    alone.positions.iter_mut().for_each(|(_, comparison)| *comparison = None);
    let alone = page(&alone);
    for absent in ["deal pixels", "ame mosaic", "chief ray", "simulated"] {
        assert!(!alone.contains(absent), "{absent}");
    }

    // The peak of the measured PSF is the brightest spot of its picture.
    let sheet = super::sheet::sheet(&calibration);
    assert_eq!(sheet.dimensions(), (104, 6 * 98 + 24));
    let values = &calibration.positions[0].0.measured.psf.values;
    let brightest = (0..CROP * CROP).max_by(|a, b| values[1][*a].total_cmp(&values[1][*b])).unwrap();
    let small = super::sheet::picture(values, super::sheet::Tone::Log);
    let at = small.get_pixel((brightest % CROP) as u32, (brightest / CROP) as u32);
    assert!(at[1] > 240, "{at:?}");
    assert!(small.get_pixel(0, 0)[1] < 140);
}

/// 20 frames of 16 ms of a PSF, measured.
fn taken(psf: &FinePsf, at: Spot, sensor: &SensorModel, seed: u64) -> (Frame, Merged, Measured) {
    const SIDE: usize = 64;
    let placement = Placement { row: 700, col: 1200 };
    let frame = Frame { height: SIDE, width: SIDE, placement, cfa: sensor.cfa };
    let light = psf.land(at, sensor.pixel_um, (SIDE, SIDE));
    // The brightest pixel gathers 25,000 electrons, as `psf-capture` dims the source.
    let peak = light.iter().flatten().fold(0.0f64, |a, b| a.max(*b));
    let rate_e_per_s = light.map(|plane| plane.into_iter().map(|v| v * 25_000.0 / 0.016 / peak).collect());
    let light = WindowLight { height: SIDE, width: SIDE, placement, rate_e_per_s };
    let mut average = Average::default();
    for n in 0..20 {
        let noise = Noise { mode: NoiseMode::Exact, seed };
        let raw = take_frame(&light, sensor, 0.016, 1.0, &noise, n).unwrap();
        average.add(raw.dn.iter().map(|v| f64::from(*v)), sensor.max_dn());
    }
    let exposure = Exposure { white_e: 1.0, time_s: 0.016, linear_gain: 1.0 };
    let dark = Dark::modelled(dark_mean_dn(sensor, &exposure), SIDE * SIDE);
    let merged = merge(&[ExposureMean { time_s: 0.016, light: average, dark }], sensor, 1.0);
    let measured = measure(&merged, &frame, "test", seed).unwrap();
    (frame, merged, measured)
}

/// The traced triplet at 3.2 mm, captured at three azimuths: what the bank says of itself holds at azimuths, phases and noise that it has
/// not seen, through its own operator and through the renderer.
#[test]
fn the_bank_of_a_traced_lens_predicts_new_captures_as_well_as_it_says() {
    let data = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data");
    let assets = Assets::from_folder(&data).unwrap();
    let (lens, sensor) =
        (assets.lens("cooke-triplet-nominal").unwrap().lens, assets.sensor("imx249-calibrated").unwrap());
    let view = PinholeView::new(&lens, &sensor, Some(1500.0), 75.0, true, Refocus::OnSource).unwrap();
    let psf = view.psf(3.2).unwrap().psf;
    fn place((azimuth_rad, (frame, merged, measured)): &(f64, (Frame, Merged, Measured))) -> Place<'_> {
        let (field_radius_mm, azimuth_rad) = (3.2, *azimuth_rad);
        Place { field_radius_mm, azimuth_rad, light_factor: 1.0, frame, merged, measured }
    }
    let captured = |azimuths: &[f64], seed: u64| -> Vec<(f64, (Frame, Merged, Measured))> {
        let at = |k: usize, azimuth_rad: f64| {
            let k = k as f64 + seed as f64;
            let spot = Spot { row: 31.1 + 0.37 * k % 1.0, col: 31.9 + 0.61 * k % 1.0, azimuth_rad };
            (azimuth_rad, taken(&psf, spot, &sensor, seed * 100 + k as u64))
        };
        azimuths.iter().enumerate().map(|(k, azimuth)| at(k, *azimuth)).collect()
    };
    let fitted = captured(&[0.0, 0.56, std::f64::consts::FRAC_PI_2], 1);
    let places: Vec<Place> = fitted.iter().map(place).collect();
    let (bank, fields) = estimate_bank(&places, sensor.pixel_um).unwrap();
    let cells = bank.grid * bank.grid;
    let values: Vec<Vec<f64>> =
        bank.values[..3 * cells].chunks(cells).map(|v| v.iter().map(|v| f64::from(*v)).collect()).collect();
    let shapes: [&[f64]; CHANNELS] = [&values[0], &values[1], &values[2]];

    // New captures: other azimuths, phases and noise. The figure is that of a mean over few positions: half as much again is far out.
    let new = captured(&[2.2, -0.9, -2.6, 0.25], 7);
    let scores: Vec<_> =
        new.iter().map(|n| explain(&place(n), n.1.2.psf.centroid_px[1], shapes, sensor.pixel_um).1).collect();
    let held_out = &fields[0].held_out.score;
    for c in 0..CHANNELS {
        let mean = scores.iter().map(|s| s[c].l1()).sum::<f64>() / scores.len() as f64;
        let said = held_out[c].l1();
        assert!(mean < 1.5 * said, "channel {c}: {mean} where {said} was promised");
    }

    // A point through the whole renderer at a patch whose azimuth was never captured, every colour in every pixel.
    let geometry =
        RenderGeometry { sensor_height: 1200, sensor_width: 1920, pixel_um: 5.86, patches: (9, 9) };
    let (x, y) = geometry.patch_centre_um(6 * 9 + 5);
    let azimuth_rad = y.atan2(x);
    let pixel = |um: f64, side: f64| (um / 5.86 + 0.5 * (side - 1.0)).round() as usize;
    let radius = kernel_radius(&geometry, &bank.layout()).unwrap();
    let mut scene = LinearImage::zeros(CHANNELS, 41 + 2 * radius, 41 + 2 * radius);
    (0..CHANNELS).for_each(|c| scene.set(c, 20 + radius, 20 + radius, 1.0));
    let placement = Placement { row: pixel(y, 1200.0) - 20, col: pixel(x, 1920.0) - 20 };
    let out = render(&geometry, &bank, &scene, placement).unwrap();
    let planes: [Vec<f64>; CHANNELS] =
        std::array::from_fn(|c| out.plane(c).iter().map(|v| f64::from(*v)).collect());
    let rendered = extract_ideal(&planes, 41, (9, 9));
    // The bank's middle is the green centroid.
    let [across, outward] = psf.centroid_um(1).map(|um| um / 5.86);
    let (sin, cos) = azimuth_rad.sin_cos();
    let spot = Spot {
        row: 20.0 - (outward * sin - across * cos),
        col: 20.0 - (outward * cos + across * sin),
        azimuth_rad,
    };
    let truth = extract_ideal(&psf.land(spot, 5.86, (41, 41)), 41, (9, 9));
    for c in 0..CHANNELS {
        let error = l1(&rendered[c], &truth[c]);
        // Every colour in every pixel, not the mosaic's only, and no fitted middle: twice the held-out figure. That is some forty
        // times the noise floor in red: what three azimuths leave open.
        assert!(error < 2.0 * held_out[c].l1(), "channel {c}: {error}");
    }
}
