//! Lists, sidecars and files of frames that contradict each other, or what they hold.

use std::path::Path;

use petzval_camera::SensorModel;
use petzval_lab::emva::{Characterization, Kind, Plan, Point, write_series};

use crate::captures::{edit, list, measured, messages, mono, one_gain, restate, series, set_list};
use crate::common::{imx249, within};

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

    // A copy of a frame that is saturated in part is one.
    let kept = std::fs::read(frame("flat-10ms-1.png")).unwrap();
    edit(folder.path(), "flat-10ms-0.png", &|x, _, dn| if x < 60 { 4031 } else { dn });
    std::fs::copy(frame("flat-10ms-0.png"), frame("flat-10ms-1.png")).unwrap();
    let error = measured(folder.path()).unwrap_err().to_string();
    assert!(error.contains("gain-1/flat-10ms-1.png is a copy of gain-1/flat-10ms-0.png"), "{error}");
    std::fs::write(frame("flat-10ms-1.png"), kept).unwrap();

    // Frames that are saturated all over are alike and no copies, wherever they end and whatever is dead or stuck.
    for full_dn in [4095, 4031] {
        for i in 0..2 {
            let of = |x: u32, y: u32| if x == 40 || (x, y) == (3, 4) { 64 } else { full_dn };
            edit(folder.path(), &format!("flat-10ms-{i}.png"), &|x, y, _| of(x, y));
        }
        assert_eq!(messages(&measured(folder.path()).unwrap(), "saturated").len(), 1, "{full_dn}");
    }
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
    // Three of the points are named, by line and setting.
    assert!(error.contains("See line ") && error.contains(" (flat, gain 1, "), "{error}");
    assert_eq!(error.matches("(flat, gain 1, ").count(), 3, "{error}");
    assert!(error.ends_with(" and 1 more"), "{error}");

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
fn a_stuck_bit_is_refused_before_what_follows_from_it() {
    // Bit 3 made K 0.146 +- 0.003 of 0.140; with bit 7 flat frames seemed darker than dark ones.
    for (bit, is) in [(3, 0), (7, 0), (2, 1)] {
        let plan = Plan { flat_ms: (1..=24).map(f64::from).collect(), ..one_gain() };
        let folder = series(&mono(), &plan);
        for entry in std::fs::read_dir(folder.path().join("gain-1")).unwrap() {
            let name = entry.unwrap().file_name().into_string().unwrap();
            edit(folder.path(), &name, &|_, _, dn| (dn & !(1 << bit)) | (is << bit));
        }
        let error = measured(folder.path()).unwrap_err().to_string();
        assert!(error.contains(&format!("bit {bit} of every sample is {is}")), "{error}");
    }
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
    set_list(folder.path(), &list(folder.path()).replace("bits = 12", "bits = 12\ntemperature_c = 25.0"));
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
        ("temperature_c = 60.0", "temperature_c = 60", "[sensor], says 25 (they may differ by 10 °C)"),
    ] {
        let error = says(text).unwrap_err();
        assert!(error.contains("flat-5ms-1.png: ") && error.contains("captures.toml, "), "{error}");
        assert!(error.contains(frame) && error.ends_with(list), "{error}");
    }
    // What a camera rounds is no contradiction.
    says(
        "linear_gain = 1.001\nexposure_s = 0.005004\nbits = 12\nblack_level_dn = 119.2\ntemperature_c = 34.5",
    )
    .unwrap();

    // Nor is a white level: it is the mean reading of a full well, and saturated samples may lie above it.
    for white_dn in [200, 4095] {
        says(&format!("white_level_dn = {white_dn}.0")).unwrap();
    }
}
