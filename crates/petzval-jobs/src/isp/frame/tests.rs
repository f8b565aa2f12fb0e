//! What an ISP knows of raw frames, and what is said of them.

use std::sync::Arc;

use super::*;
use crate::event::Lines;
use crate::isp::develop::{Request, pictures_of};

fn frame() -> RawFrame<u32> {
    let info = RawInfo {
        bits: Some(12),
        cfa: Some("RGGB".parse().unwrap()),
        black_level_dn: Some(64.0),
        white_level_dn: Some(4095.0),
        ..RawInfo::default()
    };
    RawFrame { height: 16, width: 16, dn: (0..256).map(|i| 200 + 7 * i).collect(), info }
}

/// What an ISP knows of a frame with this calibration, and what was said.
fn read_with(calibration: &str, sensor: Option<&str>) -> (FrameData, Vec<String>) {
    let frame = frame();
    let calibration = FrameCalibration::from_toml(calibration).unwrap();
    let raw = RawInMemory { name: "frame", frame: &frame, calibration: Some(&calibration) };
    let options = FrameOptions { sensor: sensor.map(Into::into), ..FrameOptions::default() };
    let lines = Arc::new(Lines::default());
    let context = Context::new(crate::built_in_assets(), lines.clone());
    let read = frame_in_memory(raw, &options, &context).unwrap();
    let said = lines.0.lock().unwrap().clone();
    (read.about, said)
}

#[test]
fn white_of_a_merged_frame_is_where_the_merged_frame_saturates() {
    let frames = [1.0, 1.0 / 16.0].map(|time_s| {
        let mut frame = frame();
        frame.info.exposure_s = Some(time_s);
        frame
    });
    // White above black, in digital numbers of the longest exposure, and the light at saturation.
    let white = |calibration: &str, white_dn: Option<f64>| {
        let calibration = FrameCalibration::from_toml(calibration).unwrap();
        let source =
            |frame| Source::Memory(RawInMemory { name: "frame", frame, calibration: Some(&calibration) });
        let options = FrameOptions { white_dn, ..FrameOptions::default() };
        let context = Context::new(crate::built_in_assets(), Arc::new(Lines::default()));
        let merge = Merge { exposures: None, no_motion_check: true };
        // The order of the files does not matter.
        let [read, turned] = [[&frames[0], &frames[1]], [&frames[1], &frames[0]]].map(|frames| {
            let noted = noted_frames(&context);
            read_merged(&frames.map(source), &merge, &options, &noted).unwrap().input.about
        });
        assert_eq!(read, turned);
        let unit = read.black_dn / 64.0;
        ((read.white_dn - read.black_dn) / unit, read.saturation)
    };
    for (calibration, stated, wanted) in [
        ("", None, 16.0 * (4095.0 - 64.0)),
        ("", Some(1064.0), 1000.0),
        ("white_dn = 2064.0\n", None, 2000.0),
    ] {
        let (range, saturation) = white(calibration, stated);
        assert!((range - wanted).abs() < 1e-6 * wanted, "{calibration} {stated:?}: {range}");
        let end = 16.0 * (4095.0 - 64.0) / wanted;
        assert!((saturation - end).abs() < 1e-6 * end, "{calibration} {stated:?}: {saturation}");
    }
}

/// The digital number at which the strongest colour saturates.
fn end_dn(about: &FrameData) -> f64 {
    about.black_dn + about.saturation * strongest(about.response) * (about.white_dn - about.black_dn)
}

/// What an ISP knows of a frame of a sensor whose colours answer unequally, and what was said.
fn read_of_sensor(frame: &RawFrame<u32>) -> (FrameData, Vec<String>) {
    let raw = RawInMemory { name: "frame", frame, calibration: None };
    let options = FrameOptions { sensor: Some("imx249-fitted".into()), ..FrameOptions::default() };
    let lines = Arc::new(Lines::default());
    let context = Context::new(crate::built_in_assets(), lines.clone());
    let about = frame_in_memory(raw, &options, &context).unwrap().about;
    let said = lines.0.lock().unwrap().clone();
    (about, said)
}

#[test]
fn a_frame_that_ends_below_its_sensor_saturates_at_its_own_end() {
    let with = |change: &dyn Fn(&mut RawInfo)| {
        let mut frame = frame();
        change(&mut frame.info);
        end_dn(&read_of_sensor(&frame).0)
    };
    let stated = with(&|info| info.white_level_dn = Some(3064.0));
    assert!((stated - 3064.0).abs() < 1e-6, "{stated}");
    // The converter has 12 bits, and the frame 11.
    let of_bits = with(&|info| (info.bits, info.white_level_dn) = (Some(11), None));
    assert!((of_bits - 2047.0).abs() < 1e-6, "{of_bits}");
    // The sensor ends a little below the largest number, because of its dark.
    let of_sensor = with(&|_| ());
    assert!((4000.0..=4095.0).contains(&of_sensor), "{of_sensor}");
    // Pixels pile up at 3064, and no level is stated.
    let mut piled = highlight(|_| 3064);
    piled.info.white_level_dn = None;
    let (about, said) = read_of_sensor(&piled);
    assert!((end_dn(&about) - 3064.0).abs() < 1e-6, "{about:?}");
    assert!(said.iter().any(|line| line.contains("have the largest number, 3064 DN")), "{said:?}");
}

/// A frame whose left half has these numbers, by a number for each pixel, and whose right half has colours that differ, with noise.
fn highlight(bright: impl Fn(u32) -> u32) -> RawFrame<u32> {
    let dn = |i: u32| {
        let (row, col) = (i / 64, i % 64);
        if col < 32 {
            bright(3 * i)
        } else {
            [900, 1600, 1200][(row % 2 + col % 2) as usize] + hash(3 * i) % 40
        }
    };
    RawFrame { height: 64, width: 64, dn: (0..64 * 64).map(dn).collect(), info: frame().info }
}

fn hash(i: u32) -> u32 {
    i.wrapping_mul(2_654_435_761) >> 16
}

#[test]
fn full_wells_that_scatter_are_warned_of_where_they_would_be_coloured() {
    // A standard deviation of 30 DN about 3064 DN.
    let scattered = |i: u32| 2974 + (0..3).map(|k| hash(i + k) % 61).sum::<u32>();
    let mut frame = highlight(scattered);
    let warning = "pixels of all colours end near one number, from 3002 DN, below the level of saturation of";
    let (_, said) = read_of_sensor(&frame);
    assert!(said.iter().any(|line| line.contains(warning)), "{said:?}");
    assert!(said.iter().any(|line| line.ends_with("then state `white_level_dn = 3002`")), "{said:?}");
    // Answers that are assumed to be equal leave such a highlight neutral.
    let (_, said) = estimated(&frame);
    assert!(said.iter().all(|line| !line.contains("end near one number")), "{said:?}");
    frame.info.white_level_dn = Some(3002.0);
    let (about, said) = read_of_sensor(&frame);
    assert!(said.iter().all(|line| !line.contains("end near one number")), "{said:?}");
    assert!((end_dn(&about) - 3002.0).abs() < 1e-6, "{about:?}");
}

/// A flat frame of so much light, of the range from black to saturation, with these answers of the colours.
fn flat(light: f64, answers: [f64; 3]) -> RawFrame<u32> {
    let dn = |i: usize| {
        let (row, col) = (i / 64, i % 64);
        (64.0 + 4031.0 * light * answers[row % 2 + col % 2]).round() as u32
    };
    RawFrame { height: 64, width: 64, dn: (0..64 * 64).map(dn).collect(), info: frame().info }
}

/// What an ISP knows of a frame whose light is estimated, and what was said.
fn estimated(frame: &RawFrame<u32>) -> (FrameData, Vec<String>) {
    let raw = RawInMemory { name: "frame", frame, calibration: None };
    let options = FrameOptions { auto_balance: true, auto_exposure: true, ..FrameOptions::default() };
    let lines = Arc::new(Lines::default());
    let context = Context::new(crate::built_in_assets(), lines.clone());
    let about = frame_in_memory(raw, &options, &context).unwrap().about;
    let said = lines.0.lock().unwrap().clone();
    (about, said)
}

#[test]
fn a_frame_with_a_cast_is_exposed_by_its_balanced_colours() {
    for answers in [[1.0; 3], [0.3, 1.0, 0.3], [1.0, 0.35, 1.0], [0.9, 1.0, 0.3]] {
        let frame = flat(0.4, answers);
        let (about, _) = estimated(&frame);
        let range = about.white_dn - about.black_dn;
        for (i, colour) in [(0, 0), (1, 1), (65, 2)] {
            let light = (f64::from(frame.dn[i]) - about.black_dn) / range / about.response[colour];
            assert!((light - 0.18).abs() < 0.002, "{answers:?} {colour}: {light}");
        }
        // The strongest colour saturates at 4095 DN before and after.
        let end_dn = about.black_dn + about.saturation * strongest(about.response) * range;
        assert!((end_dn - 4095.0).abs() < 1e-6, "{answers:?}: {end_dn}");
    }
}

#[test]
fn a_dark_frame_is_exposed_as_far_as_digital_gain_goes() {
    // 4.17 EV above the light of the frame.
    let (about, said) = estimated(&flat(0.01, [1.0; 3]));
    let light = f64::from(flat(0.01, [1.0; 3]).dn[0] - 64) / (about.white_dn - about.black_dn);
    assert!((light - 0.18).abs() < 0.002, "{light}");
    assert!(!said.iter().any(|line| line.contains("automatic exposure")), "{said:?}");
    // Numbers of few bits have too few steps, which is said.
    let mut frame = flat(0.0, [1.0; 3]);
    frame.info.white_level_dn = Some(80.0);
    frame.dn.iter_mut().for_each(|dn| *dn = 64);
    let (about, said) = estimated(&frame);
    assert!((about.white_dn - about.black_dn - LEAST_RANGE_DN).abs() < 1e-9, "{about:?}");
    assert!(said.iter().any(|line| line.contains("by 3.0 EV, the most that its 16 DN")), "{said:?}");
}

#[test]
fn white_of_a_calibration_below_the_black_level_is_named_with_both() {
    let (frame, calibration) = (frame(), FrameCalibration::from_toml("white_dn = 50.0\n").unwrap());
    let raw = RawInMemory { name: "frame", frame: &frame, calibration: Some(&calibration) };
    let context = Context::new(crate::built_in_assets(), Arc::new(Lines::default()));
    let error = frame_in_memory(raw, &FrameOptions::default(), &context).unwrap_err().to_string();
    assert!(error.contains("frame: `white_dn = 50`: not above the black level of 64 DN"), "{error}");
}

#[test]
fn black_levels_that_differ_by_whole_numbers_are_subtracted_exactly() {
    for (tile, wanted) in [
        // Their means are 107.5, 107.45 and 107.625.
        ([100.0, 110.0, 90.0, 130.0], 108.0),
        ([100.2, 110.2, 90.2, 129.2], 107.2),
        ([100.0, 110.5, 90.0, 130.0], 107.625),
    ] {
        let level = common_level(&tile).unwrap();
        assert!((level - wanted).abs() < 1e-9, "{tile:?}: {level}");
    }
    let tile = [100.0, 110.0, 90.0, 130.0];
    let mut frame = frame();
    frame.info.black_tile_dn = Some(tile.to_vec());
    frame.info.black_level_dn = Some(107.5);
    let raw = RawInMemory { name: "frame", frame: &frame, calibration: None };
    let context = Context::new(crate::built_in_assets(), Arc::new(Lines::default()));
    let read = frame_in_memory(raw, &FrameOptions::default(), &context).unwrap();
    for (i, (found, stored)) in read.dn.iter().zip(&frame.dn).enumerate() {
        let level = tile[i / 16 % 2 * 2 + i % 2];
        assert_eq!(f64::from(*found) - read.about.black_dn, f64::from(*stored) - level, "{i}");
    }
}

#[test]
fn levels_of_the_tile_are_not_subtracted_from_companded_numbers() {
    let mut frame = frame();
    let (companded_dn, linear_dn) = (vec![0, 4095], vec![0, 65535]);
    frame.info.companding = Some(petzval_camera::isp::Companding { companded_dn, linear_dn });
    frame.info.white_level_dn = None;
    let context = Context::new(crate::built_in_assets(), Arc::new(Lines::default()));
    for (levels, is_refused) in [("[60, 62, 62, 64]", true), ("[62, 62, 62, 62]", false)] {
        let text = format!("[[black_at_gain]]\nlinear_gain = 1.0\nblack_dn = {levels}\n");
        let calibration = FrameCalibration::from_toml(&text).unwrap();
        let raw = RawInMemory { name: "frame", frame: &frame, calibration: Some(&calibration) };
        let read = frame_in_memory(raw, &FrameOptions::default(), &context);
        let is_named = read.is_err_and(|error| error.to_string().contains("the frame is companded"));
        assert_eq!(is_named, is_refused, "{levels}");
    }
}

const RESPONSE: &str = "response = [0.5, 1.0, 0.6]\n";
const NOISE: &str = "[noise]\nshot = 1e-3\nread = 1e-5\n";

#[test]
fn only_what_the_calibration_leaves_open_is_assumed_with_a_warning() {
    for (calibration, wanted) in [
        (String::new(), Some("its noise and its answer to white light are assumed")),
        (RESPONSE.to_owned(), Some("unknown: its noise is assumed")),
        (NOISE.to_owned(), Some("unknown: its answer to white light is assumed")),
        (format!("{RESPONSE}{NOISE}"), None),
    ] {
        let (_, said) = read_with(&calibration, None);
        let found = said.iter().find(|line| line.contains("the sensor is unknown"));
        assert_eq!(found.is_some(), wanted.is_some(), "{calibration}: {said:?}");
        assert!(wanted.is_none_or(|wanted| found.unwrap().contains(wanted)), "{said:?}");
    }
}

#[test]
fn what_is_said_of_many_frames_is_said_once_with_a_count() {
    let (frame, calibration) = (frame(), FrameCalibration::from_toml(RESPONSE).unwrap());
    let lines = Arc::new(Lines::default());
    let context = Context::new(crate::built_in_assets(), lines.clone());
    let said = |sensor: Option<&str>| {
        let options = FrameOptions { sensor: sensor.map(Into::into), ..FrameOptions::default() };
        let noted = noted_frames(&context);
        for name in ["a", "b", "c"] {
            let raw = RawInMemory { name, frame: &frame, calibration: Some(&calibration) };
            read_one(Source::Memory(raw), &options, &noted).unwrap();
        }
        drop(noted);
        std::mem::take(&mut *lines.0.lock().unwrap())
    };
    let counts = "its calibration counts before --sensor, in response; remove what the sensor should give";
    let with_sensor = said(Some("imx249-fitted"));
    assert!(with_sensor.contains(&format!("a and 2 other frames: {counts}")), "{with_sensor:?}");
    let assumed = "the sensor is unknown: its noise is assumed; --sensor names it";
    let without = said(None);
    assert!(without.contains(&format!("warning: a and 2 other frames: {assumed}")), "{without:?}");
    for lines in [with_sensor, without] {
        assert!(lines.iter().all(|line| !line.contains("b: ") && !line.contains("c: ")), "{lines:?}");
    }
}

#[test]
fn a_calibration_counts_before_the_sensor_that_a_call_names() {
    let name = Some("imx249-fitted");
    let (sensor, said) = read_with("", name);
    assert!(said.iter().all(|line| !line.contains("--sensor")), "{said:?}");
    let (both, said) = read_with(RESPONSE, name);
    assert_eq!(both.response, [0.5, 1.0, 0.6]);
    assert_eq!(both.noise, sensor.noise);
    // Green saturates first, at the white level, which is white.
    assert!((both.saturation - 1.0).abs() < 1e-9, "{}", both.saturation);
    assert!(said.iter().any(|line| line.contains("counts before --sensor, in response;")), "{said:?}");
    let (both, said) = read_with(NOISE, name);
    assert_eq!((both.response, both.noise), (sensor.response, NoiseProfile { shot: 1e-3, read: 1e-5 }));
    assert!(said.iter().any(|line| line.contains("counts before --sensor, in noise;")), "{said:?}");
}

#[test]
fn a_black_level_of_the_calibration_that_contradicts_the_sidecar_is_noted() {
    let known = format!("{RESPONSE}{NOISE}");
    let ladder = "[[black_at_gain]]\nlinear_gain = 1.0\nblack_dn = 194\n";
    for (levels, is_noted) in [
        (format!("black_dn = 194.0\n{known}"), true),
        (format!("black_dn = 34.0\n{known}"), true),
        (format!("{known}{ladder}"), true),
        // The dark current of a simulated frame.
        (format!("black_dn = 66.0\n{known}"), false),
        (known.clone(), false),
    ] {
        let (about, said) = read_with(&levels, None);
        let found: Vec<&String> = said.iter().filter(|line| line.contains("`black_level_dn = 64`")).collect();
        assert_eq!(found.len(), usize::from(is_noted), "{levels}: {said:?}");
        let wanted = format!("frame: its calibration has a black level of {} DN and counts", about.black_dn);
        assert!(found.iter().all(|line| line.starts_with(&wanted)), "{found:?}");
    }
}

#[test]
fn the_dark_of_a_simulated_calibration_is_no_other_black_level() {
    let assets = crate::built_in_assets();
    let sensor = assets.sensor("imx249-fitted").unwrap();
    // Little light for white, and much dark current.
    for (white_e, time_s, linear_gain) in [(200.0, 0.02, 1.0), (20_000.0, 10.0, 1.0), (500.0, 0.02, 32.0)] {
        let about = FrameData::of_sensor(&sensor, &Exposure { white_e, time_s, linear_gain }).unwrap();
        let calibration = FrameCalibration::of(&about);
        let mut frame = frame();
        frame.info = RawInfo {
            sensor: Some(sensor.name.clone()),
            black_level_dn: Some(sensor.black_level_dn),
            exposure_s: Some(f64::from(time_s)),
            linear_gain: Some(f64::from(linear_gain)),
            ..frame.info
        };
        let raw = RawInMemory { name: "frame", frame: &frame, calibration: Some(&calibration) };
        let lines = Arc::new(Lines::default());
        let context = Context::new(crate::built_in_assets(), lines.clone());
        let read = frame_in_memory(raw, &FrameOptions::default(), &context).unwrap();
        assert_eq!(read.about.black_dn, about.black_dn);
        let said = lines.0.lock().unwrap().clone();
        assert!(said.iter().all(|line| !line.contains("black level of")), "{said:?}");
    }
}

#[test]
fn a_calibration_beyond_the_registers_of_the_isp_is_warned_of_once_for_many_frames() {
    let matrix = "colour_matrix = [[8.5, -3.75, -3.75], [-3.75, 8.5, -3.75], [-3.75, -3.75, 8.5]]\n";
    let frame = frame();
    let said = |calibration: &str| {
        let calibration = FrameCalibration::from_toml(calibration).unwrap();
        let raws =
            ["a", "b"].map(|name| RawInMemory { name, frame: &frame, calibration: Some(&calibration) });
        let lines = Arc::new(Lines::default());
        let context = Context::new(crate::built_in_assets(), lines.clone());
        pictures_of(&Request::default(), &raws, &context).unwrap();
        std::mem::take(&mut *lines.0.lock().unwrap())
    };
    let beyond = said(&format!("{matrix}response = [0.02, 1.0, 0.7]\n{NOISE}"));
    for wanted in [
        "warning: a and another frame: its colour matrix has 8.50 at row",
        "warning: a and another frame: its white balance multiplies red by 50.00",
    ] {
        assert_eq!(beyond.iter().filter(|line| line.starts_with(wanted)).count(), 1, "{wanted}: {beyond:?}");
    }
    let within = said(&format!("{}{RESPONSE}{NOISE}", matrix.replace("8.5", "7.5").replace("3.75", "3.25")));
    assert!(within.iter().all(|line| !line.contains("registers")), "{within:?}");
}

#[test]
fn keys_that_are_missing_are_named_before_the_numbers_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.png");
    let mut png = std::io::Cursor::new(Vec::new());
    image::GrayImage::from_pixel(8, 8, image::Luma([90]))
        .write_to(&mut png, image::ImageFormat::Png)
        .unwrap();
    let whole = png.into_inner();
    // Its head is whole, and its numbers cannot be read.
    std::fs::write(&path, &whole[..whole.len() - 26]).unwrap();
    let context = Context::new(crate::built_in_assets(), Arc::new(Lines::default()));
    let error = || read_frame(&path, &FrameOptions::default(), &context).unwrap_err().to_string();
    assert!(
        error().contains("neither the file nor its sidecar gives `cfa`, `black_level_dn`"),
        "{}",
        error()
    );
    std::fs::write(sidecar_path(&path), "cfa = \"RGGB\"\n").unwrap();
    assert!(error().contains("neither the file nor its sidecar gives `black_level_dn`"), "{}", error());
    std::fs::write(sidecar_path(&path), "cfa = \"RGGB\"\nblack_level_dn = 4.0\n").unwrap();
    assert!(!error().contains("neither"), "{}", error());
}
