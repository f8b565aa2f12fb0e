//! The loop closes: simulate a calibration series, characterise it, recover the truth.

mod common;

use std::path::Path;

use common::{imx249, within};
use petzval_camera::SensorModel;
use petzval_camera::sensor::NonUniformity;
use petzval_lab::emva::histogram_fit::{ModelParameters, fit_histograms_from};
use petzval_lab::emva::{
    Captures, Characterization, Options, Plan, Values, Warning, characterize, result_xml, sensor_toml,
    write_series,
};

/// The paper's series on a part of the sensor.
fn small() -> Plan {
    Plan { height: 160, width: 240, seed: 7, ..Plan::default() }
}

fn loop_closed(sensor: &SensorModel, plan: &Plan, options: &Options) -> Characterization {
    let folder = tempfile::tempdir().unwrap();
    write_series(sensor, plan, folder.path(), &|| Ok(())).unwrap();
    characterize(&Captures::open(folder.path()).unwrap(), options, &|_| Ok(())).unwrap()
}

#[test]
fn the_papers_series_recovers_the_papers_sensor() {
    let sensor = imx249();
    let found = loop_closed(&sensor, &small(), &Options { fit_histograms: true, ..Options::default() });
    let joint = &found.joint;
    // Ten numbers at 3.5 standard errors: a false alarm once in 200 seeds; this seed is fixed.
    for (what, measured, truth) in [
        ("K", joint.gain_dn_per_e, 0.14),
        ("mu_I", joint.dark_current_e_per_s, 25.0),
        ("sigma_r^2", joint.read_variance_e2, 16.0),
        ("mu_r", joint.read_noise_mean_e, 3.25),
        ("sigma_el", joint.electronics_noise_dn, 0.92),
        ("BL + mu_el", joint.dark_offset_dn, 120.15),
        ("mu_el", joint.electronics_mean_dn, 1.15),
        ("alpha", joint.red_over_green, 0.82),
        ("beta", joint.blue_over_green, 1.25),
    ] {
        within(what, measured, truth, 3.5);
    }
    // The errors are small enough to mean something.
    assert!(joint.gain_dn_per_e.standard_error().unwrap() < 0.001);
    assert!(joint.read_variance_e2.standard_error().unwrap() < 0.3);
    assert!(found.warnings.is_empty(), "{:?}", found.warnings);

    // The read noise of a single gain is wrong at gain 1, where electronics noise dominates.
    let naive = joint.rows[0].naive_read_variance_e2.value().unwrap();
    assert!((naive - 59.2).abs() < 3.0, "{naive}");

    // Without saturation its figures are not resolved.
    let green = &found.gains[0].channels[1];
    assert!(green.figure("u_e_sat").unwrap().best().reason().is_some());
    assert!(green.figure("QE").unwrap().best().reason().is_some());

    let fit = found.histogram_fit.as_ref().unwrap();
    assert!(fit.converged, "{} steps", fit.steps);
    within("fitted K", fit.gain_dn_per_e, 0.14, 3.5);
    within("fitted beta", fit.blue_over_green, 1.25, 3.5);
    let mean = fit.histograms.iter().map(|h| h.after.reduced_chi2).sum::<f64>() / fit.histograms.len() as f64;
    assert!((mean - 1.0).abs() < 0.05, "mean reduced chi^2 {mean}");

    // The sensor file loads, and holds the numbers of the histogram fit where it has them.
    let text = sensor_toml(&found).unwrap();
    let back = petzval_files::parse_sensor(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
    assert_eq!(Some(back.gain_dn_per_e), fit.gain_dn_per_e.value());
    assert_eq!((back.black_level_dn, back.bits, back.cfa), (119.0, 12, sensor.cfa));
    // Without hot pixels the mean of the dark frames is the dark current.
    assert!(joint.hot_pixel_share.reason().is_some() && back.nonuniformity.hot_pixel_share == 0.0);
    assert_eq!(Some(back.dark_current_e_per_s), fit.dark_current_e_per_s.value());
    within("median mu_I", joint.dark_current_median_e_per_s, 25.0, 3.5);
    within("ordinary mu_I", joint.dark_current_ordinary_e_per_s, 25.0, 3.5);
    assert!(text.contains("gain_dn_per_e = 0.1") && text.contains("DN/e-"), "{text}");
    let xml = result_xml(green, Values::Corrected).unwrap();
    assert!(xml.contains("<u_e_sat>") && xml.contains("<value>None</value>"), "{xml}");
}

#[test]
fn the_histogram_fit_recovers_changed_parameters() {
    let found = loop_closed(&imx249(), &small(), &Options::default());
    let truth = ModelParameters {
        gain_dn_per_e: 0.14,
        read_noise_mean_e: 3.25,
        dark_offset_dn: 120.15,
        electronics_noise_dn: 0.92,
        red_over_green: 0.82,
        blue_over_green: 1.25,
        read_noise_e: 4.0,
        dark_current_e_per_s: 25.0,
        full_well_e: 33723.0,
    };
    let moved = ModelParameters {
        gain_dn_per_e: 0.128,
        read_noise_mean_e: 4.2,
        dark_offset_dn: 119.6,
        electronics_noise_dn: 0.75,
        red_over_green: 0.9,
        blue_over_green: 1.1,
        read_noise_e: 3.5,
        dark_current_e_per_s: 40.0,
        ..truth
    };
    let fit = fit_histograms_from(&moved, 12, &found.histograms, &|| Ok(())).unwrap().unwrap();
    assert!(fit.converged, "{} steps", fit.steps);
    for (what, measured, truth) in [
        ("K", fit.gain_dn_per_e, truth.gain_dn_per_e),
        ("mu_r", fit.read_noise_mean_e, truth.read_noise_mean_e),
        ("BL + mu_el", fit.dark_offset_dn, truth.dark_offset_dn),
        ("sigma_el", fit.electronics_noise_dn, truth.electronics_noise_dn),
        ("alpha", fit.red_over_green, truth.red_over_green),
        ("beta", fit.blue_over_green, truth.blue_over_green),
        ("sigma_r", fit.read_noise_e, truth.read_noise_e),
        ("mu_I", fit.dark_current_e_per_s, truth.dark_current_e_per_s),
    ] {
        within(what, measured, truth, 3.5);
    }
    let worst = |f: fn(&petzval_lab::emva::HistogramComparison) -> f64| {
        fit.histograms.iter().map(f).fold(0.0_f64, f64::max)
    };
    assert!(worst(|h| h.before.total_variation) > 0.3 && worst(|h| h.after.total_variation) < 0.12);
    assert!(!fit.histograms.iter().any(petzval_lab::emva::HistogramComparison::has_dark_tail));
}

#[test]
fn saturation_linearity_and_non_uniformity_are_found_in_a_mono_sensor() {
    // A hard saturation at the full well of 15000 e- = 119 + 2100 DN.
    let sensor = SensorModel {
        cfa: "mono".parse().unwrap(),
        clear_response: [1.0 / 3.0; 3],
        full_well_e: 15_000.0,
        nonuniformity: NonUniformity {
            specimen: 4,
            dsnu_pixel_e: 6.0,
            dsnu_row_e: 3.0,
            dsnu_column_e: 4.0,
            prnu_pixel_percent: 1.0,
            prnu_row_percent: 0.5,
            prnu_column_percent: 0.7,
            ..NonUniformity::default()
        },
        ..imx249()
    };
    let plan = Plan {
        height: 120,
        width: 160,
        gains: vec![1.0],
        flat_ms: (1..=24).map(|i| 0.5 * f64::from(i)).collect(),
        stack: 12,
        level: 1.2,
        quantum_efficiency: Some(0.6),
        seed: 3,
        ..Plan::default()
    };
    let found = loop_closed(&sensor, &plan, &Options::default());
    let channel = &found.gains[0].channels[0];
    let best = |name: &str| channel.figure(name).unwrap().best();
    within("K", best("K"), 0.14, 3.5);
    within("QE", best("QE"), 60.0, 3.5);
    // The peak of the noise lies within one step of the exposures before the full well.
    let saturation = best("u_e_sat").value().unwrap();
    assert!((13_500.0..=15_600.0).contains(&saturation), "{saturation}");
    assert!(channel.transfer.linearity.as_ref().unwrap().max_percent < 1.0);
    // Total dark noise with the electronics: sqrt(16 + 0.92^2 / 0.14^2).
    within("sigma_d", best("sigma_d"), (16.0 + 0.92_f64.powi(2) / 0.14_f64.powi(2)).sqrt(), 3.5);
    // What the specimen was drawn from comes back, split into pixels, rows and columns.
    let total = |pixel: f64, row: f64, column: f64| pixel.hypot(row).hypot(column);
    for (name, truth) in [
        ("DSNU1288_pixel", 6.0),
        ("DSNU1288_row", 3.0),
        ("DSNU1288_col", 4.0),
        ("DSNU1288", total(6.0, 3.0, 4.0)),
        ("PRNU1288_pixel", 1.0),
        ("PRNU1288_row", 0.5),
        ("PRNU1288_col", 0.7),
        ("PRNU1288", total(1.0, 0.5, 0.7)),
    ] {
        within(name, best(name), truth, 3.5);
    }
    for name in ["DSNU1288_pixel", "PRNU1288_pixel"] {
        let relative = best(name).standard_error().unwrap() / best(name).value().unwrap();
        assert!(relative < 0.015, "{name}: {relative}");
    }

    // Release 4 without a filter, in digital numbers: rows and columns of the specimen and what is left of the pixels.
    for (name, truth_e) in [("s_2_y_pixel_dark", 6.0_f64), ("s_2_y_row_dark", 3.0), ("s_2_y_col_dark", 4.0)] {
        let figure = channel.figure(name).unwrap();
        within(name, figure.value, (0.14 * truth_e).powi(2), 3.5);
        assert!(figure.corrected.is_none());
    }
    for name in ["s_2_y", "s_2_y_dark", "s_2_y_cav", "s_2_y_rav", "s_2_y_measured", "sigma_2_y_stack"] {
        assert!(channel.figure(name).unwrap().value.standard_error().unwrap() > 0.0, "{name}");
    }

    // A sensor without non-uniformity: what is left of its variances is noise (eight numbers, four standard errors).
    let even = SensorModel { nonuniformity: NonUniformity::default(), ..sensor };
    let flat_ms = vec![1.0, 4.0, 8.0];
    let none = loop_closed(&even, &Plan { flat_ms, level: 0.6, ..plan }, &Options::default());
    let spatial = none.gains[0].channels[0].spatial.as_ref().unwrap();
    for part in [spatial.dark_components, spatial.flat_components] {
        for component in [part.total, part.row, part.column, part.pixel] {
            within("non-uniformity", component, 0.0, 4.0);
        }
    }
    // One gain cannot separate read from electronics noise: the file says so, and still loads.
    let text = sensor_toml(&found).unwrap();
    assert!(text.contains("# read_noise_e: not resolved"), "{text}");
    let back = petzval_files::parse_sensor(&text).unwrap();
    assert!((back.read_noise_e - best("sigma_d").value().unwrap()).abs() < 1e-9);
}

#[test]
fn a_series_is_the_same_on_any_number_of_threads_and_after_interruptions() {
    let (one, two) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let plan = Plan { height: 40, width: 60, gains: vec![1.0, 10.0], stack: 4, ..Plan::default() };
    let sensor = imx249();
    let pool = |n: usize| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
    pool(1).install(|| write_series(&sensor, &plan, one.path(), &|| Ok(()))).unwrap();
    pool(2).install(|| write_series(&sensor, &plan, two.path(), &|| Ok(()))).unwrap();
    let frame = Path::new("gain-10/flat-5ms-1.tiff");
    let bytes = |folder: &Path| std::fs::read(folder.join(frame)).unwrap();
    assert!(bytes(one.path()) == bytes(two.path()));

    // A frame that is missing is made again, alike; the others are kept.
    std::fs::remove_file(two.path().join(frame)).unwrap();
    let written = write_series(&sensor, &plan, two.path(), &|| Ok(())).unwrap();
    assert_eq!(written.frames - written.kept, 1);
    assert!(bytes(one.path()) == bytes(two.path()));

    let found = |n: usize, folder: &Path| {
        let captures = Captures::open(folder).unwrap();
        pool(n).install(|| characterize(&captures, &Options::default(), &|_| Ok(()))).unwrap()
    };
    let (a, b) = (found(1, one.path()), found(2, one.path()));
    assert_eq!(a, b);

    // Another series does not mix with it.
    let other = Plan { seed: 2, ..plan };
    let error = write_series(&sensor, &other, one.path(), &|| Ok(())).unwrap_err();
    assert!(error.to_string().contains("another series"), "{error}");
}

#[test]
fn odd_captures_give_warnings() {
    let folder = tempfile::tempdir().unwrap();
    let sensor = SensorModel { cfa: "mono".parse().unwrap(), ..imx249() };
    let plan = Plan { height: 80, width: 80, gains: vec![1.0], format: "png".into(), ..Plan::default() };
    write_series(&sensor, &plan, folder.path(), &|| Ok(())).unwrap();
    let edit = |name: &str, change: &dyn Fn(u32, u32, u16) -> u16| {
        let path = folder.path().join("gain-1").join(name);
        let mut picture = image::open(&path).unwrap().into_luma16();
        picture.enumerate_pixels_mut().for_each(|(x, y, p)| p.0[0] = change(x, y, p.0[0]));
        picture.save(&path).unwrap();
    };
    // The lamp flickers, something moves through the picture, light leaks into a dark frame, the black level is low.
    edit("flat-2.5ms-1.png", &|_, _, dn| dn + 20);
    edit("flat-5ms-1.png", &|x, y, dn| if x < 20 && y < 20 { dn + 90 } else { dn });
    edit("dark-20ms-0.png", &|x, _, dn| dn + (x / 10) as u16);
    edit("dark-20ms-1.png", &|x, _, dn| dn + (x / 10) as u16);
    edit("dark-30ms-0.png", &|_, _, dn| dn.saturating_sub(120));
    edit("dark-30ms-1.png", &|_, _, dn| dn.saturating_sub(120));
    let found =
        characterize(&Captures::open(folder.path()).unwrap(), &Options::default(), &|_| Ok(())).unwrap();
    let has = |name: &str, point: &str| {
        found.warnings.iter().any(|w| w.name() == name && w.to_string().contains(point))
    };
    assert!(has("flicker", "flat, gain 1, 2.5 ms"), "{:?}", found.warnings);
    assert!(has("moved", "flat, gain 1, 5 ms"), "{:?}", found.warnings);
    assert!(has("light-leak", "dark, gain 1, 20 ms"), "{:?}", found.warnings);
    assert!(has("clipped-at-zero", "dark, gain 1, 30 ms"), "{:?}", found.warnings);
    assert!(
        !found.warnings.iter().any(|w| matches!(w, Warning::Moved { point, .. } if point.contains("10 ms")))
    );
}

#[test]
fn hot_pixels_are_reported_and_do_not_count_as_noise() {
    let folder = tempfile::tempdir().unwrap();
    let sensor = imx249();
    let plan = Plan { format: "png".into(), ..small() };
    write_series(&sensor, &plan, folder.path(), &|| Ok(())).unwrap();
    // One pixel in five hundred is hot, by 25 DN at gain 1, in every frame of 30 ms.
    for i in 0..2 {
        let path = folder.path().join(format!("gain-1/dark-30ms-{i}.png"));
        let mut picture = image::open(&path).unwrap().into_luma16();
        let hot = |x: u32, y: u32| (y * 240 + x).is_multiple_of(500);
        picture.enumerate_pixels_mut().filter(|(x, y, _)| hot(*x, *y)).for_each(|(_, _, p)| p.0[0] += 25);
        picture.save(&path).unwrap();
    }
    let options = Options { fit_histograms: true, ..Options::default() };
    let found = characterize(&Captures::open(folder.path()).unwrap(), &options, &|_| Ok(())).unwrap();
    let tail = found.warnings.iter().find_map(|w| match w {
        Warning::DarkTail { point, share, mean_dn } => Some((point.clone(), *share, *mean_dn)),
        _ => None,
    });
    let (point, share, mean_dn) = tail.unwrap_or_else(|| panic!("{:?}", found.warnings));
    assert_eq!(point, "dark, gain 1, 30 ms");
    assert!((share - 0.002).abs() < 2e-4 && (mean_dn - 25.0).abs() < 1.0, "{share} {mean_dn}");
    let fit = found.histogram_fit.unwrap();
    within("sigma_el", fit.electronics_noise_dn, 0.92, 3.5);
}

#[test]
fn the_sensor_file_takes_the_numbers_of_the_histogram_fit() {
    let mut sensor = imx249();
    sensor.nonuniformity =
        NonUniformity { specimen: 3, dsnu_pixel_e: 3.0, prnu_pixel_percent: 0.8, ..NonUniformity::default() };
    let plan = small();
    let fitted = loop_closed(&sensor, &plan, &Options { fit_histograms: true, ..Options::default() });
    let fit = fitted.histogram_fit.as_ref().unwrap();
    assert!(fit.is_sound() && fit.dsnu_e.value().is_some(), "{:?}", fit.dsnu_e);
    let model = petzval_files::parse_sensor(&sensor_toml(&fitted).unwrap()).unwrap();
    let value = |m: petzval_lab::emva::Measured| m.value().unwrap();
    assert_eq!(model.gain_dn_per_e, value(fit.gain_dn_per_e));
    assert_eq!(model.electronics_noise_dn, value(fit.electronics_noise_dn));
    assert_eq!(model.relative_qe, [value(fit.red_over_green), 1.0, value(fit.blue_over_green)]);
    assert_eq!(model.read_noise_e, value(fitted.joint.read_noise_e));
    assert_eq!(model.nonuniformity.dsnu_pixel_e, value(fit.dsnu_e));
    assert_eq!(model.nonuniformity.prnu_pixel_percent, value(fit.prnu_percent));
    assert!((model.black_level_dn + model.electronics_mean_dn - value(fit.dark_offset_dn)).abs() < 1e-9);

    let plain = loop_closed(&sensor, &plan, &Options::default());
    let model = petzval_files::parse_sensor(&sensor_toml(&plain).unwrap()).unwrap();
    assert_eq!(model.gain_dn_per_e, value(plain.joint.gain_dn_per_e));
    assert_eq!(model.nonuniformity.dsnu_pixel_e, 0.0);
}
