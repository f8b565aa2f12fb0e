//! Noise that the converter, the camera or the lamp has changed.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use petzval_camera::SensorModel;
use petzval_lab::emva::{Plan, sensor_toml};

use crate::captures::{change, measured, messages, mono, one_gain, series};
use crate::common::bench::Bench;
use crate::common::within;

#[test]
fn coarse_steps_of_the_converter_widen_every_error() {
    // Dark noise of an eighth of a digital number, whose mean lies anywhere between two of them.
    let (mut of_gain, mut of_dark) = (Vec::new(), Vec::new());
    for (seed, black_level_dn) in [(1, 6.0), (2, 6.25), (3, 6.5), (4, 6.75)] {
        let sensor = SensorModel {
            bits: 8,
            gain_dn_per_e: 0.03,
            black_level_dn,
            electronics_mean_dn: 0.0,
            electronics_noise_dn: 0.0,
            ..mono()
        };
        let plan = Plan { flat_ms: (1..=10).map(f64::from).collect(), seed, ..one_gain() };
        let folder = series(&sensor, &plan);
        let found = measured(folder.path()).unwrap();
        let z = |m: petzval_lab::emva::Measured, truth: f64| {
            (m.value().unwrap() - truth) / m.standard_error().unwrap()
        };
        of_gain.push(z(found.joint.gain_dn_per_e, 0.03));
        of_dark.extend(
            found.joint.dark_current_e_per_s.value().map(|_| z(found.joint.dark_current_e_per_s, 25.0)),
        );
        assert_eq!(messages(&found, "dark-noise-limit").len(), 1, "{:?}", found.warnings);
        assert!(messages(&found, "dark-current-disagrees").is_empty(), "{:?}", found.warnings);
        assert!(messages(&found, "dark-not-linear").is_empty(), "{:?}", found.warnings);
        let figure = found.gains[0].channels[0].figure("sigma_d").unwrap().best();
        assert!(figure.value().is_some() && figure.standard_error().is_none(), "{figure:?}");
    }
    assert!(of_gain.iter().chain(&of_dark).all(|z| z.abs() < 3.5), "{of_gain:?} {of_dark:?}");
}

/// Digital numbers of a frame, row by row, and its columns.
type Frame<'a> = (&'a [u16], usize);

/// A pixel and its neighbours: left, right, above, below, and the diagonal ones.
type Filter<'a> = &'a dyn Fn(f64, &[f64; 8]) -> f64;

/// Replaces the frames of a folder, point by point, by what `make` makes of them in their order.
fn remake(folder: &Path, make: &dyn Fn(&[Frame<'_>]) -> Vec<Vec<u16>>) {
    let mut points: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        if let Some((point, _)) = name.strip_suffix(".tiff").and_then(|stem| stem.rsplit_once('-')) {
            points.entry(point.to_owned()).or_default().push(path);
        }
    }
    let place = |path: &PathBuf| -> usize {
        let stem = path.file_stem().unwrap().to_str().unwrap();
        stem.rsplit_once('-').unwrap().1.parse().unwrap()
    };
    for paths in points.values_mut() {
        paths.sort_by_key(place);
        let frames: Vec<_> = paths.iter().map(|path| image::open(path).unwrap().into_luma16()).collect();
        let given: Vec<Frame<'_>> =
            frames.iter().map(|frame| (frame.as_raw().as_slice(), frame.width() as usize)).collect();
        for ((path, frame), made) in paths.iter().zip(&frames).zip(make(&given)) {
            image::ImageBuffer::<image::Luma<u16>, _>::from_raw(frame.width(), frame.height(), made)
                .unwrap()
                .save(path)
                .unwrap();
        }
    }
}

/// A frame through a function of its neighbours `step` pixels apart, row by row; at the edges the pixel stands for those that are missing.
fn of_neighbours((dn, width): Frame<'_>, step: usize, of: Filter<'_>) -> Vec<u16> {
    let (step, columns, rows) = (step as i64, width as i64, (dn.len() / width) as i64);
    let pixel = |i: usize| {
        let (row, column) = (i as i64 / columns, i as i64 % columns);
        let at = |down: i64, right: i64| {
            let (row, column) = (row + down * step, column + right * step);
            let is_inside = (0..rows).contains(&row) && (0..columns).contains(&column);
            f64::from(if is_inside { dn[(row * columns + column) as usize] } else { dn[i] })
        };
        let around = [at(0, -1), at(0, 1), at(-1, 0), at(1, 0), at(-1, -1), at(-1, 1), at(1, -1), at(1, 1)];
        of(f64::from(dn[i]), &around).round() as u16
    };
    (0..dn.len()).map(pixel).collect()
}

#[test]
fn a_filter_in_the_camera_is_named_and_withdraws_what_rests_on_the_noise() {
    let low_pass = |own: f64, around: &[f64; 8]| 0.8 * own + 0.05 * around[..4].iter().sum::<f64>();
    let along_rows = |own: f64, around: &[f64; 8]| 0.8 * own + 0.1 * (around[0] + around[1]);
    let no_defects = |own: f64, around: &[f64; 8]| {
        let (low, high) = around.iter().fold((own + 1e4, -1e4), |(l, h), v| (v.min(l), v.max(h)));
        own.clamp(low, high)
    };
    let filters: [(Filter<'_>, &str); 3] =
        [(&low_pass, "along columns"), (&along_rows, "along rows), as after"), (&no_defects, "on diagonals")];
    for (cfa, step, colours) in [("mono", 1, 1), ("RGGB", 2, 3)] {
        let bench = Bench { cfa, size: [120, 160], stack: 4, prnu: 0.008, ..Bench::default() };
        let folder = tempfile::tempdir().unwrap();
        bench.write(folder.path());
        let clean = measured(folder.path()).unwrap();
        assert!(messages(&clean, "shared-noise").is_empty(), "{cfa}: {:?}", clean.warnings);
        within("K", clean.joint.gain_dn_per_e, 0.38, 3.5);
        for (filter, way) in filters {
            bench.write(folder.path());
            remake(folder.path(), &|frames| {
                frames.iter().map(|frame| of_neighbours(*frame, step, filter)).collect()
            });
            let found = measured(folder.path()).unwrap();
            let said = messages(&found, "shared-noise");
            assert!(said.len() == colours && said[0].contains(way), "{cfa}, {way}: {:?}", found.warnings);
            let is_of_gain = |w: &String| w.contains("the fit of K");
            assert!(!messages(&found, "fit-departs").iter().any(is_of_gain), "{way}: {:?}", found.warnings);
            let channel = &found.gains[0].channels[0];
            for name in ["K", "QE", "sigma_d", "DSNU1288", "PRNU1288"] {
                let figure = channel.figure(name).unwrap().best();
                assert!(figure.value().is_none(), "{cfa}, {way}: {name} {figure:?}");
            }
            // R is a ratio of means.
            within("R", channel.figure("R").unwrap().best(), 0.19, 5.0);
            assert!(found.joint.gain_dn_per_e.value().is_none() && sensor_toml(&found).is_err());
            assert!(found.gains[0].line_noise.row_dn2.value().is_none());
        }
    }
}

#[test]
fn frames_that_contain_the_one_before_are_named_where_a_stack_shows_it() {
    let mixed = |frames: &[Frame<'_>]| {
        let mut before: Option<Vec<u16>> = None;
        let next = |(dn, _): &Frame<'_>| {
            let mix = |(own, before): (&u16, &u16)| {
                (0.7 * f64::from(*own) + 0.3 * f64::from(*before)).round() as u16
            };
            let made = before.take().map_or(dn.to_vec(), |last| dn.iter().zip(&last).map(mix).collect());
            before = Some(made.clone());
            made
        };
        frames.iter().map(next).collect::<Vec<_>>()
    };
    let bench = Bench { linear_gains: vec![1.0, 2.0], size: [96, 120], stack: 12, ..Bench::default() };
    let folder = tempfile::tempdir().unwrap();
    bench.write(folder.path());
    let clean = measured(folder.path()).unwrap();
    assert!(messages(&clean, "shared-noise").is_empty(), "{:?}", clean.warnings);
    within("K", clean.joint.gain_dn_per_e, 0.38, 3.5);
    remake(folder.path(), &mixed);
    let found = measured(folder.path()).unwrap();
    let said = messages(&found, "shared-noise");
    assert!(said.len() == 1 && said[0].contains("the frame before (correlation +0.2"), "{said:?}");
    assert!(found.gains[0].channels[0].figure("K").unwrap().best().value().is_none());
    // The other gain has no stack, and is filtered all the same.
    assert!(found.joint.gain_dn_per_e.value().is_none(), "{:?}", found.joint.gain_dn_per_e);
}

#[test]
fn numbers_that_are_compressed_widen_the_error_of_k() {
    let bench = Bench { flat_e: (1..=12).map(|i| 700.0 * f64::from(i)).collect(), ..Bench::default() };
    let folder = tempfile::tempdir().unwrap();
    bench.write(folder.path());
    let clean = measured(folder.path()).unwrap();
    assert!(messages(&clean, "compressed").is_empty(), "{:?}", clean.warnings);
    within("K", clean.joint.gain_dn_per_e, 0.38, 3.5);
    // Above 80 DN the numbers are apart by nine tenths of the shot noise.
    let mut codes: Vec<f64> = (0..80).map(f64::from).collect();
    while codes[codes.len() - 1] < 4095.0 {
        let last = codes[codes.len() - 1];
        codes.push((last + (0.9 * (0.38 * (last - 64.0)).sqrt()).max(1.0)).min(4095.0));
    }
    let codes: Vec<u16> = codes.iter().map(|code| code.round() as u16).collect();
    let nearest = |dn: u16| codes.iter().copied().min_by_key(|code| code.abs_diff(dn)).unwrap();
    let table: Vec<u16> = (0..4096).map(nearest).collect();
    for kind in ["dark", "flat"] {
        change(folder.path(), kind, &|_, _, dn| table[usize::from(dn)]);
    }
    let found = measured(folder.path()).unwrap();
    let said = messages(&found, "compressed");
    assert!(said.len() == 1 && said[0].contains("the error of K contains"), "{:?}", found.warnings);
    let k = found.joint.gain_dn_per_e;
    assert!(k.value().unwrap() > 1.04 * 0.38, "{k:?}");
    within("K of steps", k, 0.38, 1.5);
    assert!(
        messages(&found, "fit-departs").iter().all(|w| !w.contains("the fit of K")),
        "{:?}",
        found.warnings
    );
}

#[test]
fn steps_of_compression_in_the_dark_are_in_the_errors_of_dark_figures() {
    // A table of square roots, whose numbers are 4 DN apart at the black level: three and a half times the dark noise.
    let codes: Vec<u16> = (0..256_u32).map(|i| (f64::from(i * i) / 16.0).round() as u16).collect();
    let nearest = |dn: u16| codes.iter().copied().min_by_key(|code| code.abs_diff(dn)).unwrap();
    let table: Vec<u16> = (0..4096).map(nearest).collect();
    for (seed, black_dn) in [(1, 64.0), (2, 65.0), (3, 66.0), (4, 67.0)] {
        let bench = Bench {
            size: [96, 144],
            dark_current_e_per_s: 40.0,
            dark_s: vec![0.05, 0.1, 0.2, 0.3],
            dsnu_e: 1.0,
            stack: 8,
            black_dn: vec![black_dn],
            seed,
            ..Bench::default()
        };
        let folder = tempfile::tempdir().unwrap();
        bench.write(folder.path());
        for kind in ["dark", "flat"] {
            change(folder.path(), kind, &|_, _, dn| table[usize::from(dn)]);
        }
        let found = measured(folder.path()).unwrap();
        let said = messages(&found, "compressed");
        assert!(said.len() == 1 && said[0].contains("In the dark the steps are 4."), "{:?}", found.warnings);
        let (gain, k2) = (&found.gains[0], 0.38_f64.powi(2));
        within("slope of the dark variance", gain.dark.variance.slope, 40.0 * k2, 3.5);
        let rounding = gain.dark.points[0].step_dn.powi(2) / 12.0;
        within("dark variance", gain.dark.variance.intercept, 9.0 * k2 + rounding, 3.5);
        within("slope of the dark mean", gain.dark.mean.slope, 40.0 * 0.38, 3.5);
        let pixels = gain.pixel_dark_currents.as_ref().unwrap();
        within("dark current of the pixels", pixels.ordinary_dn_per_s, 40.0 * 0.38, 3.5);
        within("DSNU^2", gain.channels[0].spatial.as_ref().unwrap().dark_components.total, k2, 3.5);
    }
}

#[test]
fn light_that_flickers_from_row_to_row_is_left_out_of_k() {
    for (cfa, colours) in [("mono", 1), ("RGGB", 3)] {
        let bench = Bench { cfa, row_noise_e: 0.3, ..Bench::default() };
        let folder = tempfile::tempdir().unwrap();
        bench.write(folder.path());
        let clean = measured(folder.path()).unwrap();
        assert!(messages(&clean, "row-flicker").is_empty(), "{cfa}: {:?}", clean.warnings);
        // A twohundredth of the light, in waves of ten rows that each frame meets at another phase.
        remake(folder.path(), &|frames| {
            let flickers = |(k, (dn, width)): (usize, &Frame<'_>)| {
                let wave = |row: usize| (std::f64::consts::TAU * row as f64 / 10.0 + 2.1 * k as f64).sin();
                let of =
                    |(i, dn): (usize, &u16)| 64.0 + (f64::from(*dn) - 64.0) * (1.0 + 0.005 * wave(i / width));
                dn.iter().enumerate().map(|pixel| of(pixel).round() as u16).collect::<Vec<u16>>()
            };
            frames.iter().enumerate().map(flickers).collect()
        });
        let found = measured(folder.path()).unwrap();
        let said = messages(&found, "row-flicker");
        assert!(said.len() == colours && messages(&found, "moved").is_empty(), "{cfa}: {:?}", found.warnings);
        let k = found.joint.gain_dn_per_e;
        assert!((k.value().unwrap() / 0.38 - 1.0).abs() < 0.015, "{cfa}: {k:?}");
        within("K", k, 0.38, 3.5);
        // The library counts it as noise.
        let of_library = found.gains[0].channels[0].figure("K").unwrap().value.value().unwrap();
        assert!(of_library > 1.03 * 0.38, "{cfa}: {of_library}");
    }
}
