use petzval_camera::render::Placement;
use petzval_camera::sensor::{Noise, NoiseMode};
use petzval_files::raw_file::{RawFormat, RawFrame, save_raw_alone};
use petzval_lab::psf_calibration::capture::{WindowLight, take_frame};
use petzval_lab::psf_calibration::compare::compare;
use petzval_lab::psf_calibration::manifest::{MANIFEST_FILE, Manifest};
use petzval_lab::psf_calibration::{CROP, FinePsf, Spot, calibrate_position};

use super::*;

/// A blurred point on one position, captured twice and measured.
fn calibration() -> Calibration {
    let sensor = petzval_files::parse_sensor(include_str!(
        "../../../petzval-data/data/sensors/imx249-calibrated.toml"
    ))
    .unwrap();
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
    let position = calibrate_position((&manifest, text), &folder, 0, &sensor, 1, || Ok(())).unwrap();
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
    assert!(text.contains("bench &amp; &lt;co&gt;") && text.contains("No dark frames"));
    assert!(!text.contains("NaN") && !text.contains("http"), "self-contained, and every number is one");
    crate::page::assert_readable(&text);
    // The summary comes first, and says what the measurement does not cover.
    let (summary, rest) = text.split_once("id=\"psfs\"").unwrap();
    for words in [
        "<dt>positions</dt><dd>1</dd>",
        "<dt>frames</dt><dd>2</dd>",
        "No dark frames",
        "Measured and simulated PSFs differ no more than noise alone makes them.",
        "1 of 1",
        "Nothing was measured farther",
    ] {
        assert!(summary.contains(words) && !rest.contains(words), "{words}");
    }
    let position = &calibration.positions[0].0;
    let floor = crate::number::fixed(position.measured.floor.l1[1], 3);
    assert!(summary.contains(&format!("<dt>the same by noise alone</dt><dd>{floor}</dd>")));
    assert!(text.contains("over the other exposures") && text.contains("“Ideal pixels”"));
    // Without a lens nothing is said of columns that are not there.
    let mut alone = self::calibration();
    alone.lens = None;
    alone.positions.iter_mut().for_each(|(_, comparison)| *comparison = None);
    let alone = page(&alone);
    for absent in ["deal pixels", "ame mosaic", "chief ray", "imulated"] {
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
