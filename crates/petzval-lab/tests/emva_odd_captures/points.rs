//! Points that moved, are uneven, or have another light than the list states.

use petzval_lab::emva::{Characterization, Plan, Warning};

use crate::captures::{change, edit, list, measured, messages, mono, one_gain, series, set_list};
use crate::common::bench::Bench;
use crate::common::within;

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
