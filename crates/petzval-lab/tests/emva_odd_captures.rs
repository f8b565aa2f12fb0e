//! Captures that mislead: each either is an error, or gives a warning and leaves the numbers right.

mod common;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use common::bench::Bench;
use common::{imx249, within};
use petzval_camera::SensorModel;
use petzval_lab::emva::{
    CaptureError, Captures, Characterization, Kind, Options, Plan, Point, Warning, characterize, sensor_toml,
    write_series,
};

fn mono() -> SensorModel {
    SensorModel { cfa: "mono".parse().unwrap(), clear_response: [1.0 / 3.0; 3], ..imx249() }
}

/// One gain of a small sensor.
fn one_gain() -> Plan {
    Plan { height: 80, width: 80, gains: vec![1.0], format: "png".into(), seed: 5, ..Plan::default() }
}

/// A series in a folder that goes when it is dropped.
fn series(sensor: &SensorModel, plan: &Plan) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_series(sensor, plan, folder.path(), &|| Ok(())).unwrap();
    folder
}

fn measured(folder: &Path) -> Result<Characterization, CaptureError> {
    characterize(&Captures::open(folder)?, &Options::default(), &|_| Ok(()))
}

fn list(folder: &Path) -> String {
    std::fs::read_to_string(folder.join("captures.toml")).unwrap()
}

fn set_list(folder: &Path, text: &str) {
    std::fs::write(folder.join("captures.toml"), text).unwrap();
}

fn edit(folder: &Path, name: &str, change: &dyn Fn(u32, u32, u16) -> u16) {
    let path = folder.join("gain-1").join(name);
    let mut picture = image::open(&path).unwrap().into_luma16();
    picture.enumerate_pixels_mut().for_each(|(x, y, p)| p.0[0] = change(x, y, p.0[0]));
    picture.save(&path).unwrap();
}

/// The texts of the warnings of one name.
fn messages(found: &Characterization, name: &str) -> Vec<String> {
    found.warnings.iter().filter(|w| w.name() == name).map(ToString::to_string).collect()
}

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
fn points_without_signal_and_uneven_points_are_named() {
    let folder = series(&mono(), &one_gain());
    for i in 0..2 {
        edit(folder.path(), &format!("flat-2.5ms-{i}.png"), &|_, _, dn| 116 + dn % 4);
        edit(folder.path(), &format!("flat-5ms-{i}.png"), &|x, _, dn| dn + 4 * x as u16);
    }
    let found = measured(folder.path()).unwrap();
    let (dark, uneven) = (messages(&found, "no-signal"), messages(&found, "not-uniform"));
    assert!(dark.len() == 1 && dark[0].contains("2.5 ms"), "{:?}", found.warnings);
    assert!(uneven.len() == 1 && uneven[0].contains("5 ms"), "{:?}", found.warnings);
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
fn only_the_wrong_gain_is_named() {
    let plan = Plan { height: 160, width: 240, gains: vec![1.0, 2.0, 4.0], ..one_gain() };
    let folder = series(&mono(), &plan);
    set_list(folder.path(), &list(folder.path()).replace("linear_gain = 4.0", "linear_gain = 5.0"));
    let found = measured(folder.path()).unwrap();
    let blamed: Vec<f64> = found
        .warnings
        .iter()
        .filter_map(|w| match w {
            Warning::GainNotProportional { linear_gain, .. } => Some(*linear_gain),
            _ => None,
        })
        .collect();
    assert_eq!(blamed, [5.0], "{:?}", found.warnings);
}

#[test]
fn movement_in_a_late_frame_is_not_flicker() {
    let plan = Plan { stack: 5, ..one_gain() };
    let folder = series(&mono(), &plan);
    edit(folder.path(), "flat-7.5ms-stack-3.png", &|x, y, dn| if x < 20 && y < 20 { dn + 400 } else { dn });
    let found = measured(folder.path()).unwrap();
    let moved = found.warnings.iter().find_map(|w| match w {
        Warning::Moved { point, frame, difference_dn, .. } => Some((point.clone(), *frame, *difference_dn)),
        _ => None,
    });
    let (point, frame, difference_dn) = moved.unwrap_or_else(|| panic!("{:?}", found.warnings));
    assert!(point.contains("flat, gain 1, 7.5 ms, 5 frames") && frame == 4, "{point} {frame}");
    assert!((difference_dn - 400.0).abs() < 20.0, "{difference_dn}");
    assert!(messages(&found, "flicker").is_empty(), "{:?}", found.warnings);
}

#[test]
fn a_second_stack_and_a_lone_one_are_named() {
    // Two series with stacks at 4 and at 5 ms, in one list.
    let folder = tempfile::tempdir().unwrap();
    let mut points = Vec::new();
    for (name, flat_ms, seed) in [("a", vec![2.0, 4.0, 6.0], 1), ("b", vec![3.0, 5.0, 7.0], 2)] {
        let plan = Plan { flat_ms, dark_ms: vec![], stack: 4, seed, ..one_gain() };
        write_series(&mono(), &plan, &folder.path().join(name), &|| Ok(())).unwrap();
        let text = list(&folder.path().join(name)).replace("gain-1/", &format!("{name}/gain-1/"));
        points.extend(text.split("[[point]]").skip(1).map(|p| format!("[[point]]{p}")));
    }
    let head = "[sensor]\nname = \"two\"\nbits = 12\n\n";
    set_list(folder.path(), &format!("{head}{}", points.concat()));
    let found = measured(folder.path()).unwrap();
    let more = messages(&found, "more-stacks");
    assert!(
        more.len() == 1 && more[0].contains("5 ms") && messages(&found, "lone-stack").is_empty(),
        "{more:?}"
    );

    points.retain(|p| !(p.contains("b/gain-1") && p.contains("dark") && p.contains("stack")));
    set_list(folder.path(), &format!("{head}{}", points.concat()));
    let found = measured(folder.path()).unwrap();
    let lone = messages(&found, "lone-stack");
    assert!(
        lone.len() == 1 && lone[0].contains("5 ms") && messages(&found, "more-stacks").is_empty(),
        "{lone:?}"
    );
    assert_eq!(found.gains[0].channels[0].spatial.as_ref().unwrap().exposure_s, 0.004);
}

#[test]
fn repeated_and_copied_frames_are_errors() {
    let folder = series(&mono(), &one_gain());
    let whole = list(folder.path());
    let frame = |name: &str| folder.path().join("gain-1").join(name);

    // The same file at two points.
    set_list(folder.path(), &whole.replace("flat-5ms-1.png", "flat-2.5ms-1.png"));
    let error = measured(folder.path()).unwrap_err().to_string();
    assert!(error.contains("gain-1/flat-2.5ms-1.png is listed twice, first in line"), "{error}");

    // The same contents under another name, at one point and across points.
    set_list(folder.path(), &whole);
    for (from, to) in [("flat-5ms-0.png", "flat-5ms-1.png"), ("dark-20ms-0.png", "dark-30ms-0.png")] {
        let kept = std::fs::read(frame(to)).unwrap();
        std::fs::copy(frame(from), frame(to)).unwrap();
        let error = measured(folder.path()).unwrap_err().to_string();
        assert!(error.contains(&format!("gain-1/{to} is a copy of gain-1/{from}")), "{error}");
        std::fs::write(frame(to), kept).unwrap();
    }

    // Frames that are clipped all over are alike and no copies.
    for i in 0..2 {
        edit(folder.path(), &format!("flat-10ms-{i}.png"), &|_, _, _| 4095);
    }
    assert_eq!(messages(&measured(folder.path()).unwrap(), "saturated").len(), 1);
}

#[test]
fn photons_are_stated_at_all_flat_points_of_a_gain_or_at_none() {
    let plan = Plan { quantum_efficiency: Some(0.5), ..one_gain() };
    let folder = series(&mono(), &plan);
    let whole = list(folder.path());
    let mut seen = 0;
    let less: Vec<&str> = whole
        .lines()
        .filter(|line| {
            seen += usize::from(line.starts_with("photons"));
            !(line.starts_with("photons") && seen == 2)
        })
        .collect();
    set_list(folder.path(), &less.join("\n"));
    let error = measured(folder.path()).unwrap_err().to_string();
    assert!(error.contains("flat, gain 1, 5 ms, 2 frames states no photons"), "{error}");
    assert!(error.contains("captures.toml:") && error.contains("in line"), "{error}");
}

#[test]
fn the_system_gain_needs_no_known_light() {
    let folder = series(&mono(), &one_gain());
    let mut text = list(folder.path());
    let points: Vec<String> = text.split("[[point]]").map(str::to_owned).collect();
    for (i, ms) in ["5.0", "7.5", "10.0"].iter().enumerate() {
        let flat = points.iter().filter(|p| p.contains("\"flat\"")).nth(i + 1).unwrap();
        text = text.replace(flat, &flat.replace(&format!("exposure_ms = {ms}"), "exposure_ms = 2.5"));
    }
    set_list(folder.path(), &text);
    let found = measured(folder.path()).unwrap();
    let channel = &found.gains[0].channels[0];
    assert!(channel.points.len() == 4 && channel.points.iter().all(|p| p.exposure_s == 0.0025));
    within("K", found.joint.gain_dn_per_e, 0.14, 3.5);
    let reason = channel.figure("LE_min").unwrap().best().reason().unwrap().to_string();
    assert!(reason.contains("the light is not known"), "{reason}");
}

#[test]
fn exposure_times_are_printed_as_they_were_written() {
    let point = Point {
        kind: Kind::Dark,
        linear_gain: 1.0,
        exposure_s: 1e-3 * 9.0,
        photons: None,
        black_level_dn: None,
        frames: Vec::new(),
        line: 1,
    };
    assert_eq!(point.label(), "dark, gain 1, 9 ms, 0 frames");
}

/// Shifts all samples of a series left, as some cameras write them, and states other bits.
fn restate(folder: &Path, shift: u32, bits: u32) {
    for entry in std::fs::read_dir(folder.join("gain-1")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        edit(folder, &name, &|_, _, dn| dn << shift);
    }
    set_list(folder, &list(folder).replace("bits = 12", &format!("bits = {bits}")));
}

#[test]
fn wrong_bits_are_reported() {
    // The converter ends below the full well: what is clipped at 4095 piles up there, and does not count.
    let sensor = SensorModel { full_well_e: 60_000.0, ..mono() };
    let plan = Plan { level: 1.02, flat_ms: vec![2.0, 4.0, 6.0, 8.0, 10.0], ..one_gain() };
    let folder = series(&sensor, &plan);
    assert!(messages(&measured(folder.path()).unwrap(), "top-not-reached").is_empty());
    restate(folder.path(), 0, 14);
    let found = measured(folder.path()).unwrap();
    let said = messages(&found, "top-not-reached");
    assert_eq!(said.len(), 1, "{:?}", found.warnings);
    assert!(said[0].contains("above 4095 of 16383, where samples pile up"), "{}", said[0]);
    assert!(said[0].contains("12 bits hold all samples"), "{}", said[0]);
    within("K", found.joint.gain_dn_per_e, 0.14, 3.5);
    assert!(messages(&found, "saturated")[0].contains("1 of 5"), "{:?}", found.warnings);

    let folder = series(&sensor, &plan);
    restate(folder.path(), 4, 16);
    let found = measured(folder.path()).unwrap();
    let said = messages(&found, "common-factor");
    assert!(said.len() == 1 && said[0].contains("multiple of 16"), "{:?}", found.warnings);
    assert!(said[0].contains("12 bits in 16") && said[0].contains("down by 4 bits"), "{}", said[0]);
    assert!(messages(&found, "top-not-reached").is_empty(), "{:?}", found.warnings);
    within("K", found.joint.gain_dn_per_e, 16.0 * 0.14, 3.5);
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
fn useless_captures_are_refused() {
    let folder = series(&mono(), &one_gain());
    let whole = list(folder.path());
    let refused = |text: &str| {
        set_list(folder.path(), text);
        measured(folder.path()).unwrap_err().to_string()
    };
    // Flat and dark are swapped.
    let swapped =
        whole.replace("\"flat\"", "\"x\"").replace("\"dark\"", "\"flat\"").replace("\"x\"", "\"dark\"");
    let error = refused(&swapped);
    assert!(
        error.contains("darker than the dark ones at 4 of 4 points: are flat and dark swapped?"),
        "{error}"
    );

    // No light: the flat frames are dark ones of another time of the day.
    let other = series(&mono(), &Plan { seed: 6, ..one_gain() });
    for ms in ["2.5", "5", "7.5", "10"] {
        for i in 0..2 {
            let from = other.path().join(format!("gain-1/dark-{ms}ms-{i}.png"));
            std::fs::copy(from, folder.path().join(format!("gain-1/flat-{ms}ms-{i}.png"))).unwrap();
        }
    }
    let error = refused(&whole);
    assert!(error.contains("at none of 4 points are the flat frames brighter"), "{error}");

    // Too much of it.
    let bright = series(&SensorModel { full_well_e: 15_000.0, ..mono() }, &Plan { level: 8.0, ..one_gain() });
    let error = measured(bright.path()).unwrap_err().to_string();
    assert!(error.contains("all 4 flat points are clipped or above 70 % of saturation"), "{error}");
}

#[test]
fn a_mosaic_that_the_list_leaves_out_is_named() {
    let plan = Plan { stack: 6, ..one_gain() };
    let folder = series(&imx249(), &plan);
    let is_named = |found: &Characterization| {
        messages(found, "fit-departs").iter().any(|w| w.contains("PRNU") && w.contains("another mosaic"))
    };
    assert!(!is_named(&measured(folder.path()).unwrap()));
    let text = list(folder.path());
    let without: Vec<&str> = text.lines().filter(|line| !line.starts_with("cfa")).collect();
    assert!(without.len() + 1 == text.lines().count());
    set_list(folder.path(), &without.join("\n"));
    let found = measured(folder.path()).unwrap();
    assert!(is_named(&found), "{:?}", found.warnings);
    assert!(messages(&found, "other-mosaic").is_empty(), "{:?}", found.warnings);

    // Pairs alone show it as well; so do those of a mosaic that begins at another place.
    let folder = series(&imx249(), &one_gain());
    let pairs = list(folder.path());
    assert!(messages(&measured(folder.path()).unwrap(), "other-mosaic").is_empty());
    let of_pairs: Vec<&str> = pairs.lines().filter(|line| !line.starts_with("cfa")).collect();
    for text in [of_pairs.join("\n"), pairs.replace("\"RGGB\"", "\"GRBG\"")] {
        set_list(folder.path(), &text);
        let said = messages(&measured(folder.path()).unwrap(), "other-mosaic");
        assert!(said.len() == 1 && said[0].contains("state it in `cfa`"), "{said:?}");
    }
}

#[test]
fn a_quantum_efficiency_above_one_gives_a_warning() {
    let plan = Plan { quantum_efficiency: Some(0.6), ..one_gain() };
    let folder = series(&mono(), &plan);
    assert!(messages(&measured(folder.path()).unwrap(), "quantum-efficiency-above-one").is_empty());
    let half = |line: &str| match line.strip_prefix("photons = ") {
        Some(photons) => format!("photons = {}", 0.5 * photons.parse::<f64>().unwrap()),
        None => line.to_owned(),
    };
    let text: Vec<String> = list(folder.path()).lines().map(half).collect();
    set_list(folder.path(), &text.join("\n"));
    let said = messages(&measured(folder.path()).unwrap(), "quantum-efficiency-above-one");
    assert!(said.len() == 1 && said[0].contains("more electrons than photons"), "{said:?}");
}

/// The list of one gain with the frames of each point as `name` makes them of kind and exposure time in milliseconds.
fn with_frames(folder: &Path, name: &dyn Fn(&str, &str) -> String) -> String {
    let text = list(folder);
    let mut points = text.split("[[point]]");
    let head = points.next().unwrap().to_owned();
    points.fold(head, |done, point| {
        let value = |key: &str| {
            let line = point.lines().find(|line| line.starts_with(key)).unwrap();
            line.split(" = ").nth(1).unwrap().trim_matches('"').trim_end_matches(".0").to_owned()
        };
        let kept: String = point
            .lines()
            .take_while(|line| !line.starts_with("frames"))
            .fold(String::new(), |kept, line| kept + line + "\n");
        let frames = name(&value("kind"), &value("exposure_ms"));
        format!("{done}[[point]]{kept}frames = [\"{frames}\"]\n\n")
    })
}

#[test]
fn wildcards_name_all_frames_that_match() {
    let folder = series(&mono(), &one_gain());
    let by_name = measured(folder.path()).unwrap();
    // Sidecars of the frames match the pattern too, and are no frames.
    for i in 0..2 {
        std::fs::write(folder.path().join(format!("gain-1/flat-5ms-{i}.png.toml")), "bits = 12\n").unwrap();
    }
    set_list(folder.path(), &with_frames(folder.path(), &|kind, ms| format!("gain-*/{kind}-{ms}ms-*")));
    assert_eq!(measured(folder.path()).unwrap(), by_name);

    let whole = list(folder.path());
    for (pattern, says) in [
        ("gain-1/flut-*.png", "`gain-1/flut-*.png` matches no file"),
        ("gain-1/[", "`gain-1/[`"),
        ("gain-1/flat-2.5ms-0.*", "2.5 ms, 1 frame: two are needed"),
        ("gain-1/flat-*.png", "is listed twice, first in line"),
    ] {
        set_list(folder.path(), &whole.replace("gain-*/flat-2.5ms-*", pattern));
        let error = measured(folder.path()).unwrap_err().to_string();
        assert!(error.contains(says) && error.contains("captures.toml: line"), "{pattern}: {error}");
    }
}

#[test]
fn pages_of_a_file_are_frames() {
    use tiff::encoder::{TiffEncoder, colortype::Gray16};
    let folder = series(&mono(), &one_gain());
    let by_name = measured(folder.path()).unwrap();
    let frame = |kind: &str, ms: &str, i: usize| folder.path().join(format!("gain-1/{kind}-{ms}ms-{i}.png"));
    set_list(
        folder.path(),
        &with_frames(folder.path(), &|kind, ms| {
            let name = format!("{kind}-{ms}ms.tiff");
            let mut file = std::fs::File::create(folder.path().join(&name)).unwrap();
            let mut tiff = TiffEncoder::new(&mut file).unwrap();
            for i in 0..2 {
                let picture = image::open(frame(kind, ms, i)).unwrap().into_luma16();
                tiff.write_image::<Gray16>(80, 80, &picture).unwrap();
            }
            name
        }),
    );
    assert_eq!(measured(folder.path()).unwrap(), by_name);

    // A page that is a copy of another is named by its number.
    let picture = image::open(frame("flat", "5", 0)).unwrap().into_luma16();
    let mut file = std::fs::File::create(folder.path().join("flat-5ms.tiff")).unwrap();
    let mut tiff = TiffEncoder::new(&mut file).unwrap();
    (0..2).for_each(|_| tiff.write_image::<Gray16>(80, 80, &picture).unwrap());
    let error = measured(folder.path()).unwrap_err().to_string();
    assert!(error.contains("flat-5ms.tiff, page 2 is a copy of flat-5ms.tiff, page 1"), "{error}");
}

#[test]
fn a_sidecar_that_contradicts_the_list_is_an_error() {
    let folder = series(&mono(), &one_gain());
    let sidecar = folder.path().join("gain-1/flat-5ms-1.png.toml");
    let says = |text: &str| {
        std::fs::write(&sidecar, text).unwrap();
        measured(folder.path()).map_err(|error| error.to_string())
    };
    for (text, frame, list) in [
        ("linear_gain = 2.0", "linear_gain = 2", "says 1"),
        ("exposure_s = 0.0025", "exposure_s = 0.0025", "says 0.005"),
        ("cfa = \"RGGB\"", "cfa = RGGB", "[sensor], says mono"),
        ("bits = 14", "bits = 14", "[sensor], says 12"),
        ("black_level_dn = 64.0", "black_level_dn = 64", "[sensor], says 119"),
    ] {
        let error = says(text).unwrap_err();
        assert!(error.contains("flat-5ms-1.png: ") && error.contains("captures.toml, "), "{error}");
        assert!(error.contains(frame) && error.ends_with(list), "{error}");
    }
    // What a camera rounds is no contradiction.
    says("linear_gain = 1.001\nexposure_s = 0.005004\nbits = 12\nblack_level_dn = 119.2").unwrap();
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
fn points_with_movement_count_neither_for_the_gain_nor_as_saturation() {
    let plan = Plan { flat_ms: vec![2.0, 4.0, 6.0, 8.0, 10.0], ..one_gain() };
    let folder = series(&mono(), &plan);
    edit(folder.path(), "flat-4ms-1.png", &|x, y, dn| if x < 20 && y < 20 { dn + 400 } else { dn });
    let found = measured(folder.path()).unwrap();
    assert_eq!(messages(&found, "moved").len(), 1, "{:?}", found.warnings);
    let channel = &found.gains[0].channels[0];
    assert!(!channel.transfer.saturated && channel.points.len() == 4, "{:?}", channel.transfer);
    within("K", found.joint.gain_dn_per_e, 0.14, 3.5);

    // Points of one setting, whose light alone differs, have one label: only the point that moved is left out.
    let at_4_ms = |point: &str| -> String {
        let is_flat = point.contains("flat");
        let line = |l: &str| {
            if is_flat && l.starts_with("exposure_ms") {
                "exposure_ms = 4.0\n".to_owned()
            } else {
                format!("{l}\n")
            }
        };
        point.lines().map(line).collect()
    };
    let text = list(folder.path());
    let points: Vec<String> = text.split("[[point]]").map(at_4_ms).collect();
    set_list(folder.path(), &points.join("[[point]]"));
    let found = measured(folder.path()).unwrap();
    assert_eq!(messages(&found, "moved").len(), 1, "{:?}", found.warnings);
    assert_eq!(found.gains[0].channels[0].points.len(), 4, "{:?}", found.warnings);
    within("K", found.joint.gain_dn_per_e, 0.14, 3.5);
}

#[test]
fn one_point_with_swapped_frames_is_refused_and_one_with_wrong_photons_is_named() {
    let plan = Plan { quantum_efficiency: Some(0.6), flat_ms: vec![2.0, 4.0, 6.0, 8.0, 10.0], ..one_gain() };
    let folder = series(&mono(), &plan);
    let (text, mut points) = (list(folder.path()), 0);
    let ten_times = |line: &str| match line.strip_prefix("photons = ") {
        Some(photons) => {
            points += 1;
            let factor = if points == 3 { 0.1 } else { 1.0 };
            format!("photons = {}", factor * photons.parse::<f64>().unwrap())
        }
        None => line.to_owned(),
    };
    let wrong: Vec<String> = text.lines().map(ten_times).collect();
    set_list(folder.path(), &wrong.join("\n"));
    let found = measured(folder.path()).unwrap();
    assert_eq!(messages(&found, "not-linear").len(), 1, "{:?}", found.warnings);

    set_list(folder.path(), &text);
    let name = |kind: &str, i: u32| folder.path().join(format!("gain-1/{kind}-4ms-{i}.png"));
    for i in 0..2 {
        std::fs::rename(name("flat", i), folder.path().join("kept.png")).unwrap();
        std::fs::rename(name("dark", i), name("flat", i)).unwrap();
        std::fs::rename(folder.path().join("kept.png"), name("dark", i)).unwrap();
    }
    let error = measured(folder.path()).unwrap_err().to_string();
    assert!(error.contains("darker than the dark ones at 1 of 5 points"), "{error}");
}

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

#[test]
fn a_dead_column_and_stuck_pixels_drop_no_point() {
    let folder = series(&mono(), &one_gain());
    let sound = measured(folder.path()).unwrap();
    let names: Vec<String> = std::fs::read_dir(folder.path().join("gain-1"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .filter(|name| name.ends_with(".png"))
        .collect();
    for name in &names {
        // Column 33 gives zero, and 80 pixels the largest number.
        edit(folder.path(), name, &|x, y, dn| match (x, (x + 80 * y) % 79) {
            (33, _) => 0,
            (_, 5) => 4095,
            _ => dn,
        });
    }
    let found = measured(folder.path()).unwrap();
    assert!(messages(&found, "clipped-at-zero").is_empty(), "{:?}", found.warnings);
    let points = |of: &Characterization| {
        let gain = &of.gains[0];
        (gain.dark.points.len(), gain.channels[0].points.len(), gain.channels[0].points[0].share_at_max)
    };
    assert_eq!(points(&found), points(&sound));
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

/// Changes the frames of a folder whose names begin alike, by column, row and digital number.
fn change(folder: &Path, start: &str, of: &dyn Fn(u32, u32, u16) -> u16) {
    let frames = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    for path in frames.filter(|path| path.file_name().unwrap().to_str().unwrap().starts_with(start)) {
        let mut frame = image::open(&path).unwrap().into_luma16();
        frame.enumerate_pixels_mut().for_each(|(x, y, dn)| dn.0[0] = of(x, y, dn.0[0]));
        frame.save(&path).unwrap();
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
fn a_glow_has_no_hot_pixels() {
    let folder = tempfile::tempdir().unwrap();
    Bench::default().write(folder.path());
    change(folder.path(), "dark-0-0.08-", &|x, y, dn| {
        dn + (30.0 * (-f64::from(x + y) / 40.0).exp()).round() as u16
    });
    let found = measured(folder.path()).unwrap();
    assert_eq!(messages(&found, "light-leak").len(), 1, "{:?}", found.warnings);
    assert!(messages(&found, "hot-pixels").is_empty(), "{:?}", found.warnings);
    let pixels = found.gains[0].pixel_dark_currents.as_ref().unwrap();
    assert!(pixels.outliers > 100, "{pixels:?}");
    for figure in [found.joint.hot_pixel_share, found.joint.hot_pixel_e_per_s] {
        assert!(figure.value().is_none(), "{figure:?}");
    }
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
