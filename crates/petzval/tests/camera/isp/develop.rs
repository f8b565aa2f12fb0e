//! Parameters, and what is developed with them.

use super::write_raws;
use crate::common::{data, read, read_json, run_fails, run_ok};

#[test]
fn parameters_are_shown_and_start_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let shown = run_ok(folder.path(), &["isp", "show", "--json"]).json();
    let all = shown["parameters"].as_array().unwrap();
    for p in all {
        let [value, min, max] = ["value", "min", "max"].map(|key| p[key].as_f64().unwrap());
        assert!(min <= value && value <= max && p["name"].as_str().unwrap().contains('.'), "{p}");
        assert!(p["sentence"].as_str().unwrap().ends_with('.'), "{p}");
    }
    let text = run_ok(folder.path(), &["isp", "show"]).stdout;
    assert_eq!(text.lines().count(), all.len() + 3, "{text}");
    // The file that starts the user's own gives the same values.
    let settings = run_ok(folder.path(), &["isp", "show", "--raw"]).stdout;
    std::fs::write(folder.path().join("own.toml"), &settings).unwrap();
    assert_eq!(run_ok(folder.path(), &["isp", "show", "own.toml", "--json"]).json(), shown);
}

#[cfg(unix)]
#[test]
fn a_picture_has_the_name_that_is_given_whatever_its_bytes() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;

    let folder = tempfile::tempdir().unwrap();
    write_raws(&folder.path().join("raws"));
    let out = OsStr::from_bytes(b"o\xffne.png");
    let mut command = crate::common::petzval(folder.path());
    command.args(["isp", "develop", "raws/left.tiff", "--strip", "--json", "--out"]).arg(out);
    let written = crate::common::outcome(command.output().unwrap());
    assert_eq!(written.code, Some(0), "{}", written.stderr);
    for name in [&b"o\xffne.png"[..], b"o\xffne-strip.html"] {
        assert!(folder.path().join(OsStr::from_bytes(name)).is_file(), "{written:?}");
    }
    let picture = written.json()[0]["picture"].as_str().unwrap().to_owned();
    assert!(picture.ends_with("o\u{fffd}ne.png"), "{picture}");
}

#[test]
fn raw_frames_become_pictures_and_a_strip() {
    let folder = tempfile::tempdir().unwrap();
    write_raws(&folder.path().join("raws"));
    let args = ["isp", "develop", "raws/left.tiff", "raws/right.tiff", "--strip", "--out", "out", "--json"];
    let written = run_ok(folder.path(), &args).json();
    assert_eq!((&written[0]["height"], &written[0]["width"]), (&32.into(), &48.into()));
    let picture = image::open(folder.path().join("out/left.png")).unwrap();
    assert_eq!((picture.color(), picture.width(), picture.height()), (image::ColorType::Rgb8, 48, 32));
    // The name of a file is that of the only picture, and says what it is.
    let one = ["isp", "develop", "raws/left.tiff", "--out"];
    for (name, more) in
        [("one.png", &[][..]), ("clips/one.y4m", &["--format", "y4m"]), ("one.YUV", &["--format", "yuv"])]
    {
        run_ok(folder.path(), &[&one[..], &[name], more].concat());
        assert!(folder.path().join(name).is_file(), "{name}");
    }
    assert_eq!(
        std::fs::read(folder.path().join("one.png")).unwrap(),
        std::fs::read(folder.path().join("out/left.png")).unwrap()
    );
    assert!(std::fs::read(folder.path().join("clips/one.y4m")).unwrap().starts_with(b"YUV4MPEG2"));
    for (args, needles) in [
        (&[&one[..], &["two.y4m"]].concat()[..], &["--out two.y4m", "help: --format y4m"][..]),
        (&[&one[..], &["two.jpg"]].concat(), &["two.jpg: this is the name of a file", "such as two"]),
        (&[&args[..4], &["--out", "both.png"]].concat(), &["both.png", "2 pictures", "name a folder"]),
        (&[&one[..], &["one.png"]].concat(), &["one.png: exists already"]),
    ] {
        run_fails(folder.path(), args, 2, needles);
    }
    // Pages are results, too.
    std::fs::remove_file(folder.path().join("out/left.png")).unwrap();
    run_fails(
        folder.path(),
        &[&one[..], &["out", "--strip"]].concat(),
        2,
        &["left-strip.html: exists already"],
    );
    let strip = read(&folder.path().join("out/left-strip.html"));
    assert!(strip.contains("left.tiff") && strip.contains("<img") && !strip.contains("http"));
    // 16 bits, brighter, with estimated white.
    let more = ["--bits", "16", "--set", "gain.stops=1", "--auto-balance", "--auto-exposure", "--out", "two"];
    let two = run_ok(folder.path(), &[&["isp", "develop", "raws/left.tiff"], &more[..]].concat());
    assert_eq!(two.stdout, "two/left.png\n");
    let deep = image::open(folder.path().join("two/left.png")).unwrap();
    assert_eq!(deep.color(), image::ColorType::Rgb16);
}

#[test]
fn pictures_are_written_as_luma_and_colour_differences() {
    let folder = tempfile::tempdir().unwrap();
    write_raws(&folder.path().join("raws"));
    let develop = |more: &[&'static str]| {
        let args = [&["isp", "develop", "raws/left.tiff", "--out", "out", "--format"], more].concat();
        run_ok(folder.path(), &args).stdout
    };
    assert_eq!(develop(&["y4m"]), "out/left.y4m\n");
    let y4m = std::fs::read(folder.path().join("out/left.y4m")).unwrap();
    let head = b"YUV4MPEG2 W48 H32 F25:1 XCOLORRANGE=LIMITED C420mpeg2\nFRAME\n";
    assert!(y4m.starts_with(head));
    let luma = &y4m[head.len()..][..48 * 32];
    assert_eq!(y4m.len(), head.len() + 48 * 32 * 3 / 2);
    // The luma of BT.709 of the PNG, in 16 to 235.
    assert_eq!(develop(&["png"]), "out/left.png\n");
    let png = image::open(folder.path().join("out/left.png")).unwrap().into_rgb8();
    for (pixel, y) in png.pixels().zip(luma) {
        let [r, g, b] = pixel.0.map(f64::from);
        let wanted = 16.0 + 219.0 / 255.0 * (0.2126 * r + 0.7152 * g + 0.0722 * b);
        assert!((f64::from(*y) - wanted).abs() < 1.1, "{y} {wanted}");
    }
    // Bare planes of 10 bits: two bytes for each value.
    let more = ["yuv", "--bits", "10", "--chroma", "422", "--luma", "bt601", "--range", "full"];
    assert_eq!(develop(&more), "out/left.yuv\n");
    assert_eq!(std::fs::metadata(folder.path().join("out/left.yuv")).unwrap().len(), 48 * 32 * 2 * 2);
    let refused = ["isp", "develop", "raws/left.tiff", "--out", "out", "--format", "y4m", "--bits", "16"];
    run_fails(folder.path(), &refused, 2, &["--bits 16", "8 or 10"]);
}

#[test]
fn a_developed_chart_is_measured() {
    let folder = tempfile::tempdir().unwrap();
    // A sensor of fewer, larger pixels.
    let sensor = read(&data("sensors/imx249-fitted.toml"));
    let sensor = sensor.replace("height = 1200", "height = 300").replace("width = 1920", "width = 420");
    std::fs::write(folder.path().join("small.toml"), sensor).unwrap();
    let chart = |out: &str, more: &[&str]| {
        let args = ["isp", "chart", "--sensor", "small.toml", "--out", out, "--json"];
        run_ok(folder.path(), &[&args[..], more].concat()).json()
    };
    let plain = chart("plain", &[]);
    let figures = &plain["figures"];
    let number = |of: &serde_json::Value| of.as_f64().unwrap_or_else(|| panic!("{of}"));
    assert_eq!(read_json(&folder.path().join("plain/chart.json")), plain);
    // The matrix was fitted to these patches; what is left are its own errors.
    let error = number(&figures["as_developed"]["mean_delta_e_2000"]);
    assert!(error > 0.5 && error < 4.0, "{error}");
    assert!((number(&figures["normalised"]["factor"]) - 1.0).abs() < 0.05);
    let edges = figures["edges"].as_array().unwrap();
    assert_eq!((figures["patches"].as_array().unwrap().len(), edges.len()), (24, 11));
    let sharp = |figures: &serde_json::Value| number(&figures["edges"][0]["mtf50_per_px"]);
    assert!((0.1..0.6).contains(&sharp(figures)), "{}", sharp(figures));
    for edge in edges {
        assert!(edge["failures"].as_array().unwrap().is_empty(), "{edge}");
    }
    let noise =
        |figures: &serde_json::Value, patch: usize| number(&figures["patches"][patch]["noise"]["snr_db"]);
    assert!(noise(figures, 18) > noise(figures, 23) + 5.0);
    // Less light is noisier, sharpening is sharper, and the table shows it.
    let dark = chart("dark", &["--gain", "8"]);
    assert!(noise(&dark["figures"], 20) < noise(figures, 20) - 5.0);
    let sharper = chart("sharper", &["--set", "sharpen.amount=2"]);
    assert!(sharp(&sharper["figures"]) > sharp(figures) + 0.02);
    let page = read(&folder.path().join("plain/chart.html"));
    assert!(page.contains("moderate red") && page.contains("MTF50") && !page.contains("http://localhost"));
    let args = ["isp", "chart", "--sensor", "small.toml", "--no-noise", "--out", "table"];
    let unclipped = run_ok(folder.path(), &args);
    assert!(!unclipped.says("clipped"), "{}", unclipped.stderr);
    let bright =
        ["isp", "chart", "--sensor", "small.toml", "--no-noise", "--out", "bright", "--set", "gain.stops=1"];
    let bright = run_ok(folder.path(), &bright);
    assert!(
        bright.says("the white patch is clipped: it has L* 100.0") && bright.says("--white-e"),
        "{}",
        bright.stderr
    );
    let table = unclipped.stdout;
    for words in ["dE00", "neutral 6.5", "4.1:1", "table/chart.html"] {
        assert!(table.contains(words), "{table}");
    }
}
