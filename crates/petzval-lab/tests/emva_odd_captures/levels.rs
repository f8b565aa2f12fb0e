//! Levels: where the black lies, and where light is clipped.

use petzval_camera::SensorModel;
use petzval_lab::emva::{Plan, Warning, sensor_toml};

use crate::captures::{change, edit, list, measured, messages, mono, one_gain, restate, series, set_list};
use crate::common::bench::Bench;
use crate::common::{imx249, within};

#[test]
fn full_pixels_do_not_count_in_the_ratios_of_the_colours() {
    // Blue is full at 12000 electrons while green still grows; the converter ends at 28400.
    let sensor = SensorModel { full_well_e: 12_000.0, ..imx249() };
    let plan = Plan {
        height: 160,
        width: 240,
        gains: vec![1.0, 1.77, 10.0],
        level: 1.2,
        seed: 7,
        ..Plan::default()
    };
    let found = measured(series(&sensor, &plan).path()).unwrap();
    within("alpha", found.joint.red_over_green, 0.82, 3.5);
    within("beta", found.joint.blue_over_green, 1.25, 3.5);
    // At gain 1 no sample is at the end of the converter, and saturation is reported all the same.
    assert!(messages(&found, "saturated").iter().any(|w| w.contains("at gain 1 ")), "{:?}", found.warnings);
}

#[test]
fn a_sound_series_into_saturation_is_monotonic() {
    // On the plateau the dark signal that is subtracted still grows, by 0.35 DN from point to point.
    let sensor = SensorModel { full_well_e: 15_000.0, dark_current_e_per_s: 2500.0, ..mono() };
    let plan = Plan { flat_ms: (1..=12).map(f64::from).collect(), level: 1.4, ..one_gain() };
    let found = measured(series(&sensor, &plan).path()).unwrap();
    assert!(messages(&found, "not-monotonic").is_empty(), "{:?}", found.warnings);
    assert_eq!(messages(&found, "saturated").len(), 1, "{:?}", found.warnings);
    within("K", found.joint.gain_dn_per_e, 0.14, 3.5);
}

#[test]
fn a_sound_series_into_saturation_has_no_other_warning() {
    // A full well, and a converter at its end: there frames have no noise at all.
    for full_well_e in [15_000.0, 60_000.0] {
        let sensor = SensorModel { full_well_e, ..imx249() };
        let plan = Plan { flat_ms: (1..=24).map(f64::from).collect(), level: 1.6, ..one_gain() };
        let found = measured(series(&sensor, &plan).path()).unwrap();
        let names: Vec<&str> = found.warnings.iter().map(Warning::name).collect();
        assert_eq!(names, ["saturated"], "{full_well_e}: {:?}", found.warnings);
    }
}

#[test]
fn a_falling_series_is_not_monotonic() {
    let folder = series(&mono(), &one_gain());
    for i in 0..2 {
        edit(folder.path(), &format!("flat-10ms-{i}.png"), &|_, _, dn| dn / 2);
    }
    let found = measured(folder.path()).unwrap();
    let found_messages = messages(&found, "not-monotonic");
    assert!(found_messages.len() == 1 && found_messages[0].contains("10 ms"), "{:?}", found.warnings);
}

#[test]
fn the_dark_mean_reveals_an_even_light_leak() {
    let folder = series(&mono(), &one_gain());
    for i in 0..2 {
        edit(folder.path(), &format!("dark-30ms-{i}.png"), &|_, _, dn| dn + 40);
    }
    let found = measured(folder.path()).unwrap();
    let leak = found.warnings.iter().find_map(|w| match w {
        Warning::DarkNotLinear { exposure_ms, reduced_chi2, .. } => Some((*exposure_ms, *reduced_chi2)),
        _ => None,
    });
    let (exposure_ms, reduced_chi2) = leak.unwrap_or_else(|| panic!("{:?}", found.warnings));
    assert!(exposure_ms == 30.0 && reduced_chi2 > 100.0, "{exposure_ms} ms {reduced_chi2}");
    assert_eq!(messages(&found, "dark-current-disagrees").len(), 1, "{:?}", found.warnings);
}

#[test]
fn a_black_level_that_the_dark_frames_do_not_have_is_named_with_both() {
    // The dark frames lie at 119 DN, 1.15 DN of the electronics and 3.25 electrons of 0.14 DN: 120.6 DN.
    let folder = series(&mono(), &one_gain());
    let right = list(folder.path());
    assert!(messages(&measured(folder.path()).unwrap(), "black-level-differs").is_empty());
    for stated in ["0.0", "64.0", "140.0", "500.0"] {
        let wrong = right.replace("black_level_dn = 119.0", &format!("black_level_dn = {stated}"));
        assert_ne!(wrong, right);
        set_list(folder.path(), &wrong);
        let said = messages(&measured(folder.path()).unwrap(), "black-level-differs");
        let level = stated.trim_end_matches(".0");
        assert!(
            said.len() == 1
                && said[0].contains(&format!("states a black level of {level} DN"))
                && said[0].contains("dark frames lie at 120."),
            "{stated}: {said:?}"
        );
    }
    // A column of stuck pixels raises the mean of the dark frames by 50 DN, and is no black level.
    set_list(folder.path(), &right);
    for entry in std::fs::read_dir(folder.path().join("gain-1")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        if name.ends_with(".png") {
            edit(folder.path(), &name, &|x, _, dn| if x == 40 { 4095 } else { dn });
        }
    }
    let found = measured(folder.path()).unwrap();
    assert!(messages(&found, "black-level-differs").is_empty(), "{:?}", found.warnings);
}

#[test]
fn gains_that_are_clipped_at_zero_do_not_count() {
    // At gain 31.62 the dark frames are 1.7 standard deviations above zero, at gain 1 fifteen.
    let sensor = SensorModel { black_level_dn: 15.0, ..imx249() };
    let plan = Plan { height: 160, width: 240, seed: 7, ..Plan::default() };
    let found = measured(series(&sensor, &plan).path()).unwrap();
    assert!(
        messages(&found, "clipped-at-zero")
            .iter()
            .any(|w| w.contains("31.62") && w.contains("does not count"))
    );
    let last = found.gains.last().unwrap();
    assert!(last.dark.points.is_empty() && last.channels.is_empty(), "{last:?}");
    within("sigma_r^2", found.joint.read_variance_e2, 16.0, 3.5);
    within("mu_r", found.joint.read_noise_mean_e, 3.25, 3.5);
    within("BL + mu_el", found.joint.dark_offset_dn, 16.15, 3.5);
    within("K", found.joint.gain_dn_per_e, 0.14, 3.5);
}

#[test]
fn slightly_clipped_points_are_left_out() {
    // One sample in a hundred is clipped: too little for the fall of the noise, and enough to be seen.
    let sensor = SensorModel { full_well_e: 60_000.0, ..mono() };
    let folder = series(&sensor, &Plan { level: 0.985, ..one_gain() });
    restate(folder.path(), 0, 14);
    let found = measured(folder.path()).unwrap();
    let channel = &found.gains[0].channels[0];
    let shares: Vec<f64> = channel.points.iter().map(|p| p.share_at_max).collect();
    assert!(shares[..3] == [0.0; 3] && (0.001..0.3).contains(&shares[3]), "{shares:?}");
    assert!(channel.transfer.used <= 3, "{:?}", channel.transfer);
}

#[test]
fn stuck_pixels_do_not_count_as_clipping() {
    let plan = Plan { flat_ms: vec![2.0, 4.0, 6.0, 8.0, 10.0], ..one_gain() };
    let folder = series(&mono(), &plan);
    for entry in std::fs::read_dir(folder.path().join("gain-1")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        if name.starts_with("flat") {
            edit(folder.path(), &name, &|x, y, dn| if y == 7 && x < 3 { 4095 } else { dn });
        }
    }
    let found = measured(folder.path()).unwrap();
    assert_eq!(found.gains[0].channels[0].transfer.used, 5);
    assert!(messages(&found, "saturated").is_empty(), "{:?}", found.warnings);
    within("K", found.joint.gain_dn_per_e, 0.14, 3.5);
}

#[test]
fn black_levels_of_the_colours_are_named() {
    let bench = Bench { cfa: "RGGB", ..Bench::default() };
    let folder = tempfile::tempdir().unwrap();
    bench.write(folder.path());
    assert!(messages(&measured(folder.path()).unwrap(), "black-levels-of-colours").is_empty());
    let frames = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path());
    for path in frames.filter(|path| path.extension().is_some_and(|ending| ending == "tiff")) {
        let mut frame = image::open(&path).unwrap().into_luma16();
        for (x, y, dn) in frame.enumerate_pixels_mut() {
            dn.0[0] += [0, 3, 5, 9][(y % 2 * 2 + x % 2) as usize];
        }
        frame.save(&path).unwrap();
    }
    let said = messages(&measured(folder.path()).unwrap(), "black-levels-of-colours");
    let levels = said[0].split("row by row: ").nth(1).unwrap().split(" DN").next().unwrap();
    let levels: Vec<f64> = levels.split(", ").map(|level| level.parse().unwrap()).collect();
    let is_near = |(found, truth): (&f64, f64)| (found - truth).abs() < 0.05;
    assert!(levels.iter().zip([64.0, 67.0, 69.0, 73.0]).all(is_near), "{said:?}");
}

#[test]
fn stuck_pixels_and_dead_columns_move_neither_the_black_level_nor_the_dark_noise() {
    for stack in [0, 8] {
        let bench = Bench { linear_gains: vec![1.0, 2.0, 4.0], stack, ..Bench::default() };
        let folder = tempfile::tempdir().unwrap();
        bench.write(folder.path());
        let sound = measured(folder.path()).unwrap();
        assert!(messages(&sound, "dark-defects").is_empty(), "{stack}: {:?}", sound.warnings);
        let frames = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path());
        for path in frames.filter(|path| path.extension().is_some_and(|ending| ending == "tiff")) {
            // Eighty of 38,400 pixels are stuck at 4095, two columns at 64: the mean moves by 80 x 4031 / 38,400 = 8.398 DN, the variance by 1 %.
            let mut frame = image::open(&path).unwrap().into_luma16();
            for (x, y, dn) in frame.enumerate_pixels_mut() {
                dn.0[0] = match (x, (x + 240 * y) % 480) {
                    (50 | 171, _) => 64,
                    (_, 7) => 4095,
                    _ => dn.0[0],
                };
            }
            frame.save(&path).unwrap();
        }
        let found = measured(folder.path()).unwrap();
        let said = messages(&found, "dark-defects");
        let pixels = found.gains.len();
        assert!(
            said.len() == pixels && said[0].contains("(400)") && said[0].contains("+8.398 DN off"),
            "{stack}: {said:?}"
        );
        let joint = &found.joint;
        within("BL + mu_el", joint.dark_offset_dn, 64.0, 3.5);
        within("mu_el", joint.electronics_mean_dn, 0.0, 3.5);
        within("sigma_r^2", joint.read_variance_e2, 9.0, 3.5);
        within("mu_I", joint.dark_current_e_per_s, 5.0, 3.5);
        let text = sensor_toml(&found).unwrap();
        let back = petzval_files::parse_sensor(&text).unwrap();
        assert!(back.electronics_mean_dn.abs() < 0.05, "{stack}: {text}");
    }
}

#[test]
fn dark_frames_that_are_clamped_above_zero_do_not_count() {
    let bench = Bench { size: [96, 128], read_noise_e: 5.0, ..Bench::default() };
    let folder = tempfile::tempdir().unwrap();
    bench.write(folder.path());
    assert!(messages(&measured(folder.path()).unwrap(), "clamped").is_empty());
    // Three of four dark exposures beyond those of the flat frames are clamped one standard deviation below the black level.
    for exposure_s in ["0.02", "0.04", "0.06"] {
        change(folder.path(), &format!("dark-0-{exposure_s}-"), &|_, _, dn| dn.max(62));
    }
    let found = measured(folder.path()).unwrap();
    let said = messages(&found, "clamped");
    assert!(said.len() == 3 && said.iter().all(|w| w.contains("pile up at 62 DN")), "{:?}", found.warnings);
    assert_eq!(found.gains[0].dark.points.len(), 7);
    within("K", found.joint.gain_dn_per_e, 0.38, 3.5);
}

#[test]
fn an_error_of_full_points_counts_those_that_moved() {
    let sensor = SensorModel { full_well_e: 15_000.0, ..mono() };
    let plan = Plan { flat_ms: vec![0.5, 1.0, 4.0, 6.0, 8.0, 10.0], level: 8.0, ..one_gain() };
    let folder = series(&sensor, &plan);
    assert!(measured(folder.path()).is_ok());
    for ms in ["0.5", "1"] {
        let name = format!("flat-{ms}ms-1.png");
        edit(folder.path(), &name, &|x, y, dn| if x < 20 && y < 20 { dn + 400 } else { dn });
    }
    let error = measured(folder.path()).unwrap_err().to_string();
    for part in ["2 of 6 flat points are left out, 2 because their frames differ", "all others are clipped"] {
        assert!(error.contains(part), "{error}");
    }
}
