//! What pixels, rows and columns have of their own: noise of lines, flicker of stacks, pixels that do not answer light, coarse steps.

mod common;

use std::path::Path;

use common::{imx249, small_mono, within};
use petzval_camera::SensorModel;
use petzval_camera::sensor::NonUniformity;
use petzval_lab::emva::{
    Captures, Characterization, Measured, Options, Plan, characterize, sensor_toml, write_series,
};

/// A series in a folder that goes when it is dropped.
fn series(sensor: &SensorModel, plan: &Plan) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_series(sensor, plan, folder.path(), &|| Ok(())).unwrap();
    folder
}

fn measured(folder: &Path) -> Characterization {
    characterize(&Captures::open(folder).unwrap(), &Options::default(), &|_| Ok(())).unwrap()
}

fn plan() -> Plan {
    Plan {
        height: 160,
        width: 240,
        gains: vec![1.0],
        flat_ms: vec![2.0, 4.0, 6.0],
        format: "png".into(),
        seed: 1,
        ..Plan::default()
    }
}

/// Changes the pixels of all frames whose names have such a beginning and such a part: number of the frame, column, row, digital number.
fn edit(folder: &Path, [begin, part]: [&str; 2], change: &dyn Fn(usize, u32, u32, u16) -> u16) {
    let mut names: Vec<_> =
        std::fs::read_dir(folder.join("gain-1")).unwrap().map(|e| e.unwrap().path()).collect();
    names.retain(|path| {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        name.starts_with(begin) && name.contains(part)
    });
    names.sort();
    assert!(!names.is_empty(), "no frames {begin} {part}");
    for (k, path) in names.iter().enumerate() {
        let mut picture = image::open(path).unwrap().into_luma16();
        picture.enumerate_pixels_mut().for_each(|(x, y, p)| p.0[0] = change(k, x, y, p.0[0]));
        picture.save(path).unwrap();
    }
}

fn warnings(found: &Characterization, name: &str) -> Vec<String> {
    found.warnings.iter().filter(|w| w.name() == name).map(ToString::to_string).collect()
}

fn figure(found: &Characterization, name: &str) -> Measured {
    found.gains[0].channels[0].figure(name).unwrap().best()
}

#[test]
fn noise_of_rows_and_columns_is_measured_and_is_no_movement() {
    let lines = |row_noise_e, column_noise_e| NonUniformity {
        dsnu_pixel_e: 1.0,
        dsnu_row_e: 0.4,
        row_noise_e,
        column_noise_e,
        ..NonUniformity::default()
    };
    let bayer = |of| SensorModel { nonuniformity: of, ..imx249() };
    for (name, sensor, row_e, column_e) in [
        ("mono, half an electron", small_mono(10_500.0, lines(0.5, 0.0)), 0.5, 0.0),
        ("mono, more than of pixels", small_mono(10_500.0, lines(4.0, 1.5)), 4.0, 1.5),
        ("Bayer", bayer(lines(2.0, 6.0)), 2.0, 6.0),
    ] {
        let plan = Plan { gains: vec![1.0, 2.0, 4.0], stack: 12, ..plan() };
        let folder = series(&sensor, &plan);
        let found = measured(folder.path());
        for warning in ["moved", "flicker", "dark-not-linear", "light-leak"] {
            assert!(warnings(&found, warning).is_empty(), "{name}: {:?}", found.warnings);
        }
        let joint = &found.joint;
        within(&format!("{name}: rows"), joint.row_noise_e, row_e, 3.5);
        if column_e > 0.0 {
            within(&format!("{name}: columns"), joint.column_noise_e, column_e, 3.5);
        }
        within(&format!("{name}: K"), joint.gain_dn_per_e, sensor.gain_dn_per_e, 3.5);
        // What the noise of rows leaves in the mean of twelve frames is no DSNU of rows.
        let spatial = found.gains[0].channels[0].spatial.as_ref().unwrap();
        let of_rows = spatial.dark_components.row;
        within(&format!("{name}: DSNU of rows"), of_rows, (0.4 * sensor.gain_dn_per_e).powi(2), 3.5);

        // The sensor file has each noise once.
        let back = petzval_files::parse_sensor(&sensor_toml(&found).unwrap()).unwrap();
        assert!(
            (back.nonuniformity.row_noise_e / row_e - 1.0).abs() < 0.15,
            "{name}: {:?}",
            back.nonuniformity
        );
        assert!((back.read_noise_e / sensor.read_noise_e - 1.0).abs() < 0.1, "{name}: {}", back.read_noise_e);
    }
}

#[test]
fn strong_noise_of_rows_and_columns_is_no_movement() {
    for seed in 1..=8 {
        let noisy = NonUniformity { row_noise_e: 10.0, column_noise_e: 6.0, ..NonUniformity::default() };
        let rows_alone = NonUniformity { row_noise_e: 10.0, ..NonUniformity::default() };
        for (of, column_e) in [(noisy, 6.0), (rows_alone, 0.0)] {
            let sensor = SensorModel { dark_current_e_per_s: 0.0, ..small_mono(10_500.0, of) };
            let found = measured(series(&sensor, &Plan { seed, ..plan() }).path());
            assert!(warnings(&found, "moved").is_empty(), "seed {seed}: {:?}", found.warnings);
            let (lines, k2) = (found.gains[0].line_noise, sensor.gain_dn_per_e.powi(2));
            within(&format!("seed {seed}: rows"), lines.row_dn2, 100.0 * k2, 3.5);
            within(&format!("seed {seed}: columns"), lines.column_dn2, column_e * column_e * k2, 3.5);
            let pixel_dn2 = 2.3_f64.powi(2) * k2 + 0.3_f64.powi(2) + 1.0 / 12.0;
            within(&format!("seed {seed}: pixels"), lines.pixel_dn2, pixel_dn2, 3.5);
        }
    }
}

#[test]
fn coarse_steps_of_the_converter_widen_the_error_of_the_noise_of_rows() {
    // Rows of up to 0.3 DN of noise among pixels of 0.18 DN, whose mean lies anywhere between two digital numbers.
    for (row_noise_e, dsnu_pixel_e) in [(0.0, 0.0), (2.0, 0.0), (2.0, 1.5), (5.0, 0.0), (5.0, 10.0)] {
        for (seed, black_level_dn) in [(1, 64.0), (2, 64.25), (3, 64.5), (4, 64.75)] {
            let of = NonUniformity { row_noise_e, dsnu_pixel_e, ..NonUniformity::default() };
            let sensor = SensorModel {
                gain_dn_per_e: 0.06,
                black_level_dn,
                read_noise_e: 3.0,
                electronics_noise_dn: 0.0,
                ..small_mono(60_000.0, of)
            };
            let found = measured(series(&sensor, &Plan { seed, ..plan() }).path());
            let lines = found.gains[0].line_noise;
            let what = format!("rows of {row_noise_e}, DSNU {dsnu_pixel_e}, black level {black_level_dn}");
            assert!(warnings(&found, "moved").is_empty(), "{what}: {:?}", found.warnings);
            within(&what, lines.row_dn2, (row_noise_e * sensor.gain_dn_per_e).powi(2), 3.0);
            within(&format!("columns; {what}"), lines.column_dn2, 0.0, 3.5);
        }
    }
}

#[test]
fn noise_of_rows_without_dark_frames_says_so() {
    let sensor = small_mono(10_500.0, NonUniformity { row_noise_e: 2.0, ..NonUniformity::default() });
    let folder = series(&sensor, &plan());
    // All dark frames are cut off at digital number 0.
    edit(folder.path(), ["dark", ""], &|_, _, _, dn| dn.saturating_sub(64));
    let found = measured(folder.path());
    let why = found.joint.row_noise_e.reason().unwrap().to_string();
    assert_eq!(why, "no usable dark frames", "{:?}", found.joint.row_noise_e);
}

#[test]
fn movement_is_seen_beside_noise_of_rows() {
    let noisy = NonUniformity { row_noise_e: 3.0, column_noise_e: 3.0, ..NonUniformity::default() };
    let sensor = small_mono(10_500.0, noisy);
    for (what, covered) in [
        ("a corner", Box::new(|x: u32, y: u32| x < 50 && y < 40) as Box<dyn Fn(u32, u32) -> bool>),
        ("a strip of rows", Box::new(|_, y| y < 30)),
        ("a strip of columns", Box::new(|x, _| x >= 200)),
        ("half of the frame", Box::new(|x, _| x < 120)),
    ] {
        let folder = series(&sensor, &plan());
        let darker = |k: usize, x: u32, y: u32, dn: u16| if k == 1 && covered(x, y) { dn - 20 } else { dn };
        edit(folder.path(), ["flat-4ms", ""], &darker);
        let found = measured(folder.path());
        let moved = warnings(&found, "moved");
        assert!(moved.len() == 1 && moved[0].contains("flat, gain 1, 4 ms"), "{what}: {:?}", found.warnings);
    }
}

#[test]
fn flicker_of_a_stack_is_no_non_uniformity() {
    let uneven = NonUniformity { dsnu_pixel_e: 3.0, prnu_pixel_percent: 0.8, ..NonUniformity::default() };
    let sensor = small_mono(10_500.0, uneven);
    let folder = series(&sensor, &Plan { flat_ms: vec![4.0, 8.0, 12.0], stack: 12, ..plan() });
    let steady = measured(folder.path());
    // The light of the stack changes by 3 %, evenly over its frames.
    let brighter =
        |k: usize, _, _, dn: u16| 64 + ((f64::from(dn) - 64.0) * (1.0 + 0.003 * k as f64)).round() as u16;
    edit(folder.path(), ["flat", "stack"], &brighter);
    let found = measured(folder.path());
    let name = "PRNU1288_pixel";
    within(name, figure(&steady, name), 0.8, 3.5);
    within(name, figure(&found, name), 0.8, 3.5);
    let [before, after] = [&steady, &found].map(|f| figure(f, name).value().unwrap());
    assert!((after / before - 1.0).abs() < 0.01, "{before} {after}");
}

#[test]
fn pixels_that_do_not_answer_light_are_listed_and_left_out() {
    let uneven = NonUniformity { dsnu_pixel_e: 1.5, prnu_pixel_percent: 0.8, ..NonUniformity::default() };
    let bayer = SensorModel { nonuniformity: uneven, ..imx249() };
    for (name, sensor) in [("mono", small_mono(10_500.0, uneven)), ("Bayer", bayer)] {
        let folder = series(&sensor, &Plan { flat_ms: vec![4.0, 8.0, 12.0], stack: 12, ..plan() });
        // Five pixels are stuck at 4095 and three are dead: rows and columns.
        let stuck = [[10, 10], [11, 10], [40, 77], [100, 200], [159, 239]];
        let dead = [[0, 3], [70, 71], [120, 8]];
        let is = |list: &[[u32; 2]], x: u32, y: u32| list.contains(&[y, x]);
        let broken = |_, x, y, dn| {
            if is(&stuck, x, y) {
                4095
            } else if is(&dead, x, y) {
                0
            } else {
                dn
            }
        };
        edit(folder.path(), ["flat", ""], &broken);
        edit(folder.path(), ["dark", ""], &broken);
        let found = measured(folder.path());

        let mut listed: Vec<[u32; 2]> = found.gains[0]
            .channels
            .iter()
            .flat_map(|c| &c.spatial.as_ref().unwrap().defects)
            .map(|d| [d.row as u32, d.column as u32])
            .collect();
        listed.sort_unstable();
        let mut truth: Vec<[u32; 2]> = stuck.iter().chain(&dead).copied().collect();
        truth.sort_unstable();
        assert_eq!(listed, truth, "{name}");
        assert!(!warnings(&found, "defect-pixels").is_empty(), "{name}: {:?}", found.warnings);
        // Stuck pixels are neither a light leak nor an uneven field.
        for warning in ["light-leak", "not-uniform", "moved"] {
            assert!(warnings(&found, warning).is_empty(), "{name}: {:?}", found.warnings);
        }
        within(&format!("{name}: DSNU"), figure(&found, "DSNU1288_pixel"), 1.5, 3.5);
        // The means of the standard are over all pixels; those without the defects are known as well.
        for channel in &found.gains[0].channels {
            let spatial = channel.spatial.as_ref().unwrap();
            let pixels = 160.0 * 240.0 / if name == "mono" { 1.0 } else { 4.0 };
            let pixels = if channel.colour.name() == "green" { 2.0 * pixels } else { pixels };
            let lost = spatial.defects.len() as f64 / pixels;
            let bias = spatial.signal_bias.unwrap_or(0.0);
            assert!((bias + lost).abs() < 0.03 * lost + 1e-12, "{name}: {bias} for {lost}");
        }
        within(&format!("{name}: PRNU"), figure(&found, "PRNU1288_pixel"), 0.8, 3.5);
        let spatial = found.gains[0].channels[0].spatial.as_ref().unwrap();
        let [_, dark] = spatial.components_with_defects.as_ref().unwrap();
        let with = dark.total.value().unwrap();
        assert!(with > 100.0 * spatial.dark_components.total.value().unwrap(), "{name}: {with}");
        let text = sensor_toml(&found).unwrap();
        let back = petzval_files::parse_sensor(&text).unwrap();
        assert!((back.nonuniformity.dsnu_pixel_e - 1.5).abs() < 0.2 && text.contains("# 8 pixels"), "{text}");
    }
}

#[test]
fn dead_columns_bias_the_means_of_the_standard_by_their_share() {
    let uneven = NonUniformity { dsnu_pixel_e: 1.5, prnu_pixel_percent: 0.8, ..NonUniformity::default() };
    let sensor = small_mono(10_500.0, uneven);
    let plan =
        Plan { quantum_efficiency: Some(0.6), flat_ms: vec![2.0, 4.0, 6.0, 8.0, 10.0], stack: 12, ..plan() };
    let folder = series(&sensor, &plan);
    let before = measured(folder.path());
    // Two of 240 columns are dead.
    let broken = |_, x, _, dn| if x == 50 || x == 171 { 0 } else { dn };
    edit(folder.path(), ["flat", ""], &broken);
    edit(folder.path(), ["dark", ""], &broken);
    let found = measured(folder.path());
    let channel = &found.gains[0].channels[0];
    assert_eq!(channel.spatial.as_ref().unwrap().defects.len(), 2 * 160);
    for name in ["R", "QE"] {
        let [whole, of_all] = [&before, &found].map(|f| figure(f, name).value().unwrap());
        let of_others = channel.without_defects(name).unwrap().value().unwrap();
        assert!((of_all / whole - (1.0 - 2.0 / 240.0)).abs() < 0.003, "{name}: {of_all} of {whole}");
        assert!((of_others / whole - 1.0).abs() < 0.003, "{name}: {of_others} of {whole}");
    }
    assert!(before.gains[0].channels[0].without_defects("R").is_none());
    let warning = warnings(&found, "defect-pixels");
    assert!(
        warning[0].contains("R, QE and u_e_sat are 0.83 % too low by them; without them R 0."),
        "{warning:?}"
    );
}

#[test]
fn an_offset_of_some_pixels_is_no_dark_current() {
    let uneven = NonUniformity { dsnu_pixel_e: 1.5, prnu_pixel_percent: 0.8, ..NonUniformity::default() };
    let sensor = small_mono(10_500.0, uneven);
    let folder = series(&sensor, &Plan { dark_ms: vec![20.0, 100.0], stack: 12, ..plan() });
    let before = measured(folder.path());
    assert!(warnings(&before, "bright-pixels").is_empty(), "{:?}", before.warnings);
    // Thirty pixels lie 75 DN above the others, in every frame.
    let raised = |_, x: u32, y: u32, dn: u16| if x == 40 + y && y < 30 { dn + 75 } else { dn };
    edit(folder.path(), ["flat", ""], &raised);
    edit(folder.path(), ["dark", ""], &raised);
    let found = measured(folder.path());
    let spatial = found.gains[0].channels[0].spatial.as_ref().unwrap();
    assert_eq!((spatial.bright, spatial.defects.len()), (30, 0));
    let without = spatial.dark_components_without_bright.unwrap().pixel.root();
    let k = found.gains[0].channels[0].transfer.gain_dn_per_e;
    within("DSNU without the bright pixels", without.over(k), 1.5, 3.5);
    assert!(figure(&found, "DSNU1288_pixel").value().unwrap() > 3.0);
    let warning = warnings(&found, "bright-pixels");
    assert!(warning.len() == 1 && warning[0].contains("30 pixels are brighter"), "{warning:?}");
    // What is not resolved is a dark current.
    let reason = found.joint.hot_pixel_share.reason().unwrap().to_string();
    assert!(reason.starts_with("0 pixels have a dark current above the noise"), "{reason}");
    let text = sensor_toml(&found).unwrap();
    assert!(text.contains("# pixels that are bright in the dark at every exposure time: 30"), "{text}");
}

#[test]
fn coarse_steps_of_the_converter_widen_the_error_of_dsnu() {
    // Pixels that differ by 0.09 to 0.6 DN under temporal noise of 0.2 DN, whose mean lies anywhere between two digital numbers.
    for dsnu_pixel_e in [1.5, 10.0] {
        for (seed, black_level_dn) in [(1, 64.0), (2, 64.25), (3, 64.5), (4, 64.75)] {
            let sensor = SensorModel {
                gain_dn_per_e: 0.06,
                black_level_dn,
                read_noise_e: 3.0,
                electronics_noise_dn: 0.0,
                ..small_mono(60_000.0, NonUniformity { dsnu_pixel_e, ..NonUniformity::default() })
            };
            let folder =
                series(&sensor, &Plan { flat_ms: vec![20.0, 40.0, 60.0], stack: 16, seed, ..plan() });
            let found = measured(folder.path());
            // The variance has a value and an error in any case; its root is a figure only where it is above noise.
            let of_pixels = found.gains[0].channels[0].spatial.as_ref().unwrap().dark_components.pixel;
            let truth = (dsnu_pixel_e * sensor.gain_dn_per_e).powi(2);
            within(&format!("{dsnu_pixel_e}, {black_level_dn}"), of_pixels, truth, 3.0);
            if dsnu_pixel_e > 5.0 {
                within("DSNU", figure(&found, "DSNU1288_pixel"), dsnu_pixel_e, 3.0);
            }
            let warning = warnings(&found, "rounding");
            assert!(warning.len() == 1 && warning[0].contains("DSNU"), "{:?}", found.warnings);
        }
    }
}
