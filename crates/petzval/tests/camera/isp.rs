//! `petzval isp`.

use std::path::Path;

use crate::common::{self, data, read, read_json, run_fails, run_ok};

/// Writes raw frames of a known sensor: two parts of a photograph behind a GRBG mosaic, with their sidecars.
fn write_raws(folder: &Path) {
    let photo = image::open(data("photos/coffee.png")).unwrap().into_rgb8();
    std::fs::create_dir_all(folder).unwrap();
    for (name, at) in [("left", (20, 60)), ("right", (240, 120))] {
        let frame = image::ImageBuffer::<image::Luma<u16>, _>::from_fn(48, 32, |x, y| {
            let channel = match (x % 2, y % 2) {
                (1, 0) => 0,
                (0, 1) => 2,
                _ => 1,
            };
            let encoded = f64::from(photo.get_pixel(at.0 + x, at.1 + y).0[channel]) / 255.0;
            let response = [0.6, 1.0, 0.7][channel];
            image::Luma([(119.0 + 3000.0 * response * encoded.powf(2.2)).round() as u16])
        });
        frame.save(folder.join(format!("{name}.tiff"))).unwrap();
        let sidecar = "bits = 12\ncfa = \"GRBG\"\nblack_level_dn = 119\nwhite_level_dn = 4000\nsensor = \"imx249-fitted\"\n";
        std::fs::write(folder.join(format!("{name}.tiff.toml")), sidecar).unwrap();
    }
}

const TRUTH: [&str; 3] = ["gain.stops=0.6", "white_balance.red=1.25", "white_balance.blue=0.8"];

/// Develops the raws with the true settings as references.
fn write_references(folder: &Path) {
    let set: Vec<&str> = TRUTH.iter().flat_map(|change| ["--set", change]).collect();
    let raws = ["isp", "develop", "raws/left.tiff", "raws/right.tiff", "--bits", "16", "--out", "reference"];
    run_ok(folder, &[&raws[..], &set].concat());
}

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

/// Writes a frame of 32-bit numbers as NumPy does, with its sidecar.
fn write_npy(path: &Path, (height, width): (usize, usize), dn: &[u32], sidecar: &str) {
    let head = format!("{{'descr': '<u4', 'fortran_order': False, 'shape': ({height}, {width}), }}");
    let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    bytes.extend(format!("{head:<117}\n").bytes());
    bytes.extend(dn.iter().flat_map(|dn| dn.to_le_bytes()));
    std::fs::write(path, bytes).unwrap();
    std::fs::write(format!("{}.toml", path.display()), format!("cfa = \"GRBG\"\n{sidecar}")).unwrap();
}

#[test]
fn frames_of_up_to_24_bits_and_companded_ones_give_the_same_picture() {
    let folder = tempfile::tempdir().unwrap();
    let raws = folder.path().join("raws");
    write_raws(&raws);
    // The frame of 12 bits without its sensor, so that the noise is assumed for all in the same way.
    let twelve = image::open(raws.join("left.tiff")).unwrap().into_luma16().into_raw();
    let twelve: Vec<u32> = twelve.into_iter().map(u32::from).collect();
    let size = (32, 48);
    let levels = "bits = 12\nblack_level_dn = 119\nwhite_level_dn = 4000\n";
    write_npy(&raws.join("twelve.npy"), size, &twelve, levels);
    let twenty: Vec<u32> = twelve.iter().map(|dn| dn * 256).collect();
    let levels = format!("black_level_dn = {}\nwhite_level_dn = {}\n", 119 * 256, 4000 * 256);
    write_npy(&raws.join("twenty.npy"), size, &twenty, &format!("bits = 20\n{levels}"));
    // The sensor sends 12 bits of the 20.
    let (sent, light) = ([0, 1024, 2048, 4095], [0, 8192, 65_536, 1_048_575]);
    let companded = |dn: u32| {
        let k = light.iter().position(|knot| dn <= *knot).unwrap().max(1);
        let share = f64::from(dn - light[k - 1]) / f64::from(light[k] - light[k - 1]);
        sent[k - 1] + (share * f64::from(sent[k] - sent[k - 1])).round() as u32
    };
    let knots = format!("[companding]\ncompanded_dn = {sent:?}\nlinear_dn = {light:?}\n");
    let dn: Vec<u32> = twenty.iter().map(|dn| companded(*dn)).collect();
    write_npy(&raws.join("companded.npy"), size, &dn, &format!("bits = 12\n{levels}{knots}"));

    let names = ["twelve", "twenty", "companded"];
    let files = names.map(|name| format!("raws/{name}.npy"));
    let mut args = vec!["isp", "develop", "--out", "out"];
    args.extend(files.iter().map(String::as_str));
    run_ok(folder.path(), &args);
    let picture = |name: &str| {
        image::open(folder.path().join(format!("out/{name}.png"))).unwrap().into_rgb8().into_raw()
    };
    let [twelve, twenty, companded] = names.map(picture);
    let largest = |a: &[u8], b: &[u8]| a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
    assert!(twelve.iter().max().unwrap() - twelve.iter().min().unwrap() > 100);
    assert!(largest(&twelve, &twenty) <= 1, "{}", largest(&twelve, &twenty));
    // A step of the last part of the curve is 480 of a million.
    assert!(largest(&twenty, &companded) <= 2, "{}", largest(&twenty, &companded));

    // Nothing but black, and nothing but saturated.
    let levels = "bits = 24\nblack_level_dn = 4096\nwhite_level_dn = 16777215\n";
    write_npy(&raws.join("black.npy"), size, &[4096; 32 * 48], levels);
    write_npy(&raws.join("white.npy"), size, &[16_777_215; 32 * 48], levels);
    for preset in ["neutral", "real-time"] {
        let args = ["isp", "develop", "raws/black.npy", "raws/white.npy", "--preset", preset, "--force"];
        run_ok(folder.path(), &[&args[..], &["--out", "out"]].concat());
        assert!(picture("black").iter().all(|v| *v <= 1), "{preset}");
        assert!(picture("white").iter().all(|v| *v >= 254), "{preset}");
    }
    let shown = run_ok(folder.path(), &["raw", "show", "raws/companded.npy"]).stdout;
    assert!(shown.contains("4 knots, expanded to 1048575 DN"), "{shown}");

    // What measures light takes neither.
    for (file, says) in [("companded", "companded"), ("twenty", "more than 16 bits")] {
        let file = format!("raws/{file}.npy");
        run_fails(folder.path(), &["raw", "mtf", &file], 2, &[&file, says, "petzval isp develop"]);
    }
    let wrong = "[companding]\ncompanded_dn = [0, 1024, 8191]\nlinear_dn = [0, 1024, 1048575]\n";
    write_npy(&raws.join("wrong.npy"), size, &dn, &format!("bits = 12\n{wrong}"));
    let args = ["isp", "develop", "raws/wrong.npy", "--out", "no"];
    let says =
        ["wrong.npy.toml:4:16", "companded_dn = [0, 1024, 8191]", "the knot 8191 is above 4095", "last knot"];
    run_fails(folder.path(), &args, 2, &says);
}

#[test]
fn a_raw_frame_with_its_calibration_gives_the_picture_of_the_simulation() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(data("photos/coffee.png"), folder.path().join("coffee.png")).unwrap();
    image::RgbImage::from_pixel(48, 30, image::Rgb([180; 3])).save(folder.path().join("flat.png")).unwrap();
    let simulate = ["simulate", "coffee.png", "flat.png", "--isp", "quality", "--no-noise", "--out", "taken"];
    let written = run_ok(folder.path(), &[&simulate[..], &["--json"]].concat()).json();
    assert_eq!(written[0]["calibration"], "taken/coffee-calibration.toml");
    let open = |path: &str| image::open(folder.path().join(path)).unwrap().into_rgb8();
    let develop = |out: &str, more: &[&str]| {
        let args = ["isp", "develop", "taken/coffee-raw.tiff", "taken/flat-raw.tiff", "--out", out];
        run_ok(folder.path(), &[&args[..], &["--preset", "quality"], more].concat());
        ["coffee", "flat"].map(|name| open(&format!("{out}/{name}-raw.png")))
    };
    // Shading and distortion of the lens are undone as the simulation undoes them, to the bit.
    let simulated = ["coffee", "flat"].map(|name| open(&format!("taken/{name}-isp.png")));
    assert!(develop("calibrated", &[]) == simulated);

    // Without the calibration the corners stay dark, and things where the lens brings them.
    let sidecar = |name: &str| folder.path().join(format!("taken/{name}-raw.tiff.toml"));
    let text = read(&sidecar("coffee"));
    for name in ["coffee", "flat"] {
        let (text, line) = (read(&sidecar(name)), format!("calibration = \"{name}-calibration.toml\"\n"));
        assert!(text.contains(&line), "{text}");
        std::fs::write(sidecar(name), text.replace(&line, "")).unwrap();
    }
    let white_dn = (119.0 + 0.14 * written[0]["white_e"].as_f64().unwrap()).to_string();
    let without = develop("without", &["--white-dn", &white_dn]);
    assert!(without[0] != simulated[0]);
    let mean = |picture: &image::RgbImage, at: [u32; 2]| {
        let part = image::imageops::crop_imm(picture, at[0], at[1], 60, 60).to_image();
        part.pixels().map(|p| f64::from(p[1])).sum::<f64>() / 3600.0
    };
    let centres = [&simulated[1], &without[1]].map(|picture| mean(picture, [930, 570]));
    assert!((centres[0] - centres[1]).abs() < 2.0, "{centres:?}");
    for corner in [[0, 0], [1860, 0], [0, 1140], [1860, 1140]] {
        let [bright, dark] = [&simulated[1], &without[1]].map(|picture| mean(picture, corner));
        assert!((bright - centres[0]).abs() < 2.0, "{corner:?}: {bright} {centres:?}");
        assert!(dark < centres[0] - 6.0, "{corner:?}: {dark} {centres:?}");
    }

    // A calibration that went lost is named.
    std::fs::write(sidecar("coffee"), &text).unwrap();
    let lost = folder.path().join("lost.toml");
    std::fs::rename(folder.path().join("taken/coffee-calibration.toml"), lost).unwrap();
    let args = ["isp", "develop", "taken/coffee-raw.tiff", "--out", "no"];
    let says = ["coffee-raw.tiff.toml: `calibration = \"coffee-calibration.toml\"`", "copy the calibration"];
    run_fails(folder.path(), &args, 2, &says);
}

#[test]
fn frames_of_ones_own_camera_are_calibrated_by_hand_and_converted_with_it() {
    let folder = tempfile::tempdir().unwrap();
    let raws = folder.path().join("raws");
    write_raws(&raws);
    let develop = |raw: &str, out: &str| {
        run_ok(folder.path(), &["isp", "develop", raw, "--out", out]);
        let picture = std::fs::read_dir(folder.path().join(out)).unwrap().next().unwrap().unwrap().path();
        image::open(picture).unwrap().into_rgb8().into_raw()
    };
    let plain = develop("raws/left.tiff", "plain");
    // A lens that takes half of the light away everywhere.
    let planes = "[0.5, 0.5, 0.5, 0.5]";
    let calibration = format!("[shading]\nrows = 2\ncols = 2\nplanes = [{planes}, {planes}, {planes}]\n");
    std::fs::write(raws.join("lens.toml"), &calibration).unwrap();
    let sidecar = raws.join("left.tiff.toml");
    std::fs::write(&sidecar, format!("{}calibration = \"lens.toml\"\n", read(&sidecar))).unwrap();
    let corrected = develop("raws/left.tiff", "corrected");
    let sum = |picture: &[u8]| picture.iter().map(|v| f64::from(*v)).sum::<f64>();
    // Twice the light is 2^(1 / 2.4) of the encoded value, nearly.
    let ratio = sum(&corrected) / sum(&plain);
    assert!((1.2..1.5).contains(&ratio), "{ratio}");

    // A converted frame finds it from its own folder.
    std::fs::create_dir(folder.path().join("elsewhere")).unwrap();
    run_ok(folder.path(), &["raw", "convert", "raws/left.tiff", "elsewhere/left.npy"]);
    assert!(develop("elsewhere/left.npy", "again") == corrected);

    std::fs::write(raws.join("lens.toml"), calibration.replace("rows = 2", "rows = 3")).unwrap();
    let args = ["isp", "develop", "raws/left.tiff", "--out", "no"];
    run_fails(folder.path(), &args, 2, &["raws/lens.toml", "`shading`", "three planes of rows x cols"]);
}

/// Simulates the coffee cup at one exposure; white saturates the sensor at about 23,000 electrons.
fn expose(folder: &Path, name: &str, white_e: &str, time_s: &str) -> String {
    let args = ["simulate", "coffee.png", "--size", "120x160", "--white-e", white_e, "--time-s", time_s];
    std::fs::copy(data("photos/coffee.png"), folder.join("coffee.png")).unwrap();
    run_ok(folder, &[&args[..], &["--no-distortion", "--out", name]].concat());
    format!("{name}/coffee-raw.tiff")
}

#[test]
fn exposures_are_merged_before_they_are_developed() {
    let folder = tempfile::tempdir().unwrap();
    // The longer exposure saturates in three quarters of the range of the picture, the shorter one nowhere.
    let long = expose(folder.path(), "long", "64000", "0.02");
    let short = expose(folder.path(), "short", "16000", "0.005");
    let develop = |out: &'static str, more: &[&str]| {
        run_ok(folder.path(), &[&["isp", "develop", "--out", out], more].concat()).stdout
    };
    // White of the shorter exposure, in digital numbers of each frame: 119 + 0.14 e.
    let merged = [long.as_str(), short.as_str(), "--merge", "--white-dn", "9080"];
    assert_eq!(develop("merged", &merged), "merged/coffee-raw.png\n");
    develop("single", &[&short, "--white-dn", "2360"]);
    let open = |out: &str| {
        image::open(folder.path().join(out).join("coffee-raw.png")).unwrap().into_rgb8().into_raw()
    };
    let (both, one) = (open("merged"), open("single"));
    let mean = |v: &[u8]| v.iter().map(|v| f64::from(*v)).sum::<f64>() / v.len() as f64;
    // The same picture, with less noise.
    assert!((mean(&both) - mean(&one)).abs() < 2.0, "{} {}", mean(&both), mean(&one));
    assert!(both.iter().any(|v| *v > 200));
    // Exposures can be given, and have to belong to the frames.
    let given = [&merged[..], &["--exposures", "4,1"]].concat();
    develop("given", &given);
    assert_eq!(open("given"), both);
    let refused = [&["isp", "develop", "--out", "no"], &merged[..], &["--exposures", "4,2,1"]].concat();
    run_fails(folder.path(), &refused, 2, &["number of exposures", "one for each frame"]);
}

#[test]
fn a_developed_chart_is_measured() {
    let folder = tempfile::tempdir().unwrap();
    // A sensor of fewer, larger pixels.
    let sensor = read(&data("sensors/imx249-fitted.toml"));
    let sensor = sensor.replace("height = 1200", "height = 400").replace("width = 1920", "width = 560");
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
    let table = run_ok(folder.path(), &args).stdout;
    for words in ["dE00", "neutral 6.5", "4.1:1", "table/chart.html"] {
        assert!(table.contains(words), "{table}");
    }
}

#[test]
fn what_cannot_be_developed_or_tuned_is_named_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    write_raws(&folder.path().join("raws"));
    write_references(folder.path());
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("bad.toml", "[settings.white_balance]\nred = 99.0\n");
    write(
        "lab.toml",
        "name = \"a\"\ncommand = [\"true\"]\n[[parameter]]\nname = \"a.b\"\nmin = 0\nmax = 1\ndefault = 2\n",
    );
    std::fs::create_dir(folder.path().join("empty")).unwrap();
    std::fs::create_dir(folder.path().join("small")).unwrap();
    for name in ["left", "right"] {
        image::RgbImage::new(30, 30).save(folder.path().join(format!("small/{name}.png"))).unwrap();
    }
    let raw = "raws/left.tiff";
    let develop = |more: &[&'static str]| [&["develop", raw, "--out", "out"], more].concat();
    let tune = |reference: &'static str, more: &[&'static str]| {
        [&["tune", "raws", "--reference", reference, "--out", "out"], more].concat()
    };
    for (args, needles) in [
        (
            develop(&["--set", "white_balance.rde=2"]),
            ["--set white_balance.rde=2", "did you mean white_balance.red"],
        ),
        (develop(&["--set", "white_balance.red=99"]), ["--set white_balance.red=99", "must lie between"]),
        (develop(&["--set", "white_balance.red"]), ["--set white_balance.red", "stage.key=value"]),
        (develop(&["--preset", "nowhere"]), ["nowhere", "neither a file nor"]),
        (develop(&["--isp", "bad.toml"]), ["bad.toml:2:7", "must lie between"]),
        (develop(&["--isp", "lab.toml"]), ["lab.toml:3", "the key `sentence` is missing"]),
        (develop(&["--bits", "9"]), ["--bits 9", "8, 10 or 16"]),
        (develop(&["--white-dn", "50"]), ["--white-dn 50", "black level of 119 DN"]),
        (develop(&["raws/left.tiff.toml"]), ["left.tiff.toml", "gray TIFF or PNG"]),
        (develop(&["--sensor", "imx999"]), ["imx999", "neither a file nor"]),
        (tune("empty", &[]), ["--reference empty", "holds no file"]),
        (tune("small", &[]), ["left.png: 30 x 30 pixels", "32 x 48"]),
        (tune("reference", &["--vary", "gain.grün"]), ["--vary gain.grün", "did you mean"]),
        (tune("reference", &["--objective", "beauty"]), ["--objective beauty", "psnr_db"]),
        (tune("reference", &["--evaluations", "3"]), ["--evaluations 3", "one generation"]),
        (vec!["tune", "--resume", "empty"], ["search.json", "--out folder"]),
        (vec!["tune", "raws"], ["--reference", "required"]),
    ] {
        run_fails(folder.path(), &[&["isp"], &args[..]].concat(), 2, &needles);
    }
}

#[test]
fn spoiled_settings_are_tuned_back_and_a_resumed_search_is_the_same() {
    let folder = tempfile::tempdir().unwrap();
    write_raws(&folder.path().join("raws"));
    write_references(folder.path());
    let tune = |out: &str, evaluations: &str| {
        let args = ["isp", "tune", "raws", "--reference", "reference", "--vary", "gain,white_balance"];
        run_ok(folder.path(), &[&args[..], &["--evaluations", evaluations, "--out", out, "--json"]].concat())
            .json()
    };
    let whole = tune("whole", "320");
    let [start, best] = ["start", "best"].map(|key| whole[key].as_f64().unwrap());
    assert!(best > start + 15.0 && best > 45.0, "{start} {best}: {whole}");
    for p in whole["parameters"].as_array().unwrap() {
        let truth: f64 = TRUTH
            .iter()
            .find_map(|t| t.split_once('=').filter(|(name, _)| *name == p["name"]))
            .map_or(f64::NAN, |(_, value)| value.parse().unwrap());
        let tuned = p["best"].as_f64().unwrap();
        assert!((tuned - truth).abs() < 0.02, "{p}");
    }
    // The tuned settings give the score again.
    let args =
        ["isp", "develop", "raws/left.tiff", "--isp", "whole/tuned.toml", "--bits", "16", "--out", "again"];
    run_ok(folder.path(), &args);

    // In two parts.
    tune("parts", "130");
    let more = ["isp", "tune", "--resume", "parts", "--evaluations", "320", "--json"];
    let parts = run_ok(folder.path(), &more).json();
    assert_eq!(parts["best"], whole["best"]);
    let at = |name: &str, file: &str| folder.path().join(name).join(file);
    assert_eq!(read(&at("parts", "tuned.toml")), read(&at("whole", "tuned.toml")));
    let without_time = |name: &str| {
        let mut history = read_json(&at(name, "history.json"));
        for generation in history.as_array_mut().unwrap() {
            generation.as_object_mut().unwrap().remove("seconds").unwrap();
        }
        history
    };
    assert_eq!(without_time("parts"), without_time("whole"));

    // A finished search stays as it is: its budget is kept with it.
    let finished = run_ok(folder.path(), &["isp", "tune", "--resume", "parts", "--json"]);
    assert!(finished.says("nothing is left"), "{}", finished.stderr);
    assert_eq!(finished.json()["evaluations"], whole["evaluations"]);
    assert_eq!(without_time("parts"), without_time("whole"));
    run_fails(
        folder.path(),
        &["isp", "tune", "--resume", "parts", "--evaluations", "0"],
        2,
        &["--evaluations 0"],
    );

    // A folder that holds a search, and one whose frames have changed.
    let again = ["isp", "tune", "raws", "--reference", "reference", "--out", "whole"];
    run_fails(folder.path(), &again, 2, &["--out whole", "already holds a search"]);
    write_raws(&folder.path().join("raws"));
    std::fs::remove_file(folder.path().join("raws/right.tiff")).unwrap();
    run_fails(folder.path(), &more, 2, &["have changed since the search began"]);
}

/// Six numbers of a preset at the ends of their ranges, and what 500 settings make of them on noisy frames, against a search three times as long
/// from the preset itself.
#[test]
fn six_spoiled_numbers_are_recovered_within_500_settings() {
    let folder = tempfile::tempdir().unwrap();
    let photos = [data("photos/coffee.png"), data("photos/chelsea.png")];
    let taken = "--place centre --size 64x96 --gain 4 --white-e 4000 --no-distortion --out";
    let simulate = |out: &[&str]| {
        let photos = photos.iter().map(|p| p.to_str().unwrap());
        let args: Vec<&str> = ["simulate"]
            .into_iter()
            .chain(photos)
            .chain(taken.split(' '))
            .chain(out.iter().copied())
            .collect();
        run_ok(folder.path(), &args);
    };
    simulate(&["raws"]);
    simulate(&["clean", "--no-noise", "--isp", "neutral"]);
    let reference = folder.path().join("reference");
    std::fs::create_dir(&reference).unwrap();
    for name in ["coffee", "chelsea"] {
        let clean = folder.path().join(format!("clean/{name}-isp.png"));
        std::fs::copy(clean, reference.join(format!("{name}.png"))).unwrap();
    }

    let spoiled = [
        "bayer_denoise.strength=0",
        "luma_denoise.strength=1",
        "luma_denoise.threshold=10",
        "chroma_denoise.strength=0",
        "sharpen.amount=4",
        "sharpen.sigma=2.5",
    ];
    let names: Vec<&str> = spoiled.iter().map(|set| set.split_once('=').unwrap().0).collect();
    let vary = names.join(",");
    let tune = |evaluations: &str, out: &str, set: &[&str]| {
        let args =
            ["isp", "tune", "raws", "--reference", "reference", "--preset", "quality", "--vary", &vary];
        let more = ["--evaluations", evaluations, "--out", out, "--json"];
        let set = set.iter().flat_map(|change| ["--set", change]);
        run_ok(folder.path(), &args.into_iter().chain(more).chain(set).collect::<Vec<_>>()).json()
    };
    let tuned = tune("1500", "tuned", &[]);
    let recovered = tune("500", "recovered", &spoiled);
    assert!(recovered["evaluations"].as_u64().unwrap() <= 500, "{recovered}");
    let squared_error =
        |result: &serde_json::Value, key: &str| 10f64.powf(-result[key].as_f64().unwrap() / 10.0);
    let best = squared_error(&tuned, "best");
    assert!(squared_error(&recovered, "start") > 10.0 * best, "{recovered}");
    assert!(squared_error(&recovered, "best") < 1.05 * best, "{recovered} {tuned}");
}

#[cfg(unix)]
#[test]
fn an_external_isp_is_shown_tuned_and_its_failure_loses_nothing() {
    let folder = tempfile::tempdir().unwrap();
    write_raws(&folder.path().join("raws"));
    let lab = folder.path().join("lab");
    std::fs::create_dir(&lab).unwrap();
    let book = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../book/src/examples");
    for file in ["external-isp.sh", "external-isp.toml"] {
        std::fs::copy(book.join(file), lab.join(file)).unwrap();
    }
    let text = run_ok(folder.path(), &["isp", "show", "lab/external-isp.toml"]).stdout;
    assert!(text.starts_with("Ten-line ISP: 2 parameters") && text.contains("tone.gamma"), "{text}");
    let develop = ["isp", "develop", "raws/left.tiff", "raws/right.tiff", "--isp", "lab/external-isp.toml"];
    let set = ["--set", "tone.gain=1.6", "--bits", "16", "--strip", "--out", "reference"];
    run_ok(folder.path(), &[&develop[..], &set].concat());

    let args = ["isp", "tune", "raws", "--reference", "reference", "--isp", "lab/external-isp.toml"];
    let more = ["--evaluations", "31", "--out", "out", "--json"];
    let found = run_ok(folder.path(), &[&args[..], &more].concat()).json();
    assert!(found["best"].as_f64().unwrap() > found["start"].as_f64().unwrap());
    // The tuned settings know their ISP, from any folder.
    let shown = run_ok(&lab, &["isp", "show", "../out/tuned.toml", "--json"]).json();
    assert_eq!(shown["name"], "Ten-line ISP");
    assert_eq!(shown["parameters"][0]["value"], found["parameters"][0]["best"]);

    // The device goes away: the search stops with a clear error, and continues once it is back.
    let script = std::fs::read(lab.join("external-isp.sh")).unwrap();
    std::fs::write(lab.join("external-isp.sh"), "echo the device is off >&2; exit 4\n").unwrap();
    let resume = ["isp", "tune", "--resume", "out", "--evaluations", "43", "--json"];
    run_fails(folder.path(), &resume, 1, &["the device is off", "exit status: 4", "Ten-line ISP"]);
    std::fs::write(lab.join("external-isp.sh"), script).unwrap();
    let more = run_ok(folder.path(), &resume).json();
    assert!(more["evaluations"].as_u64().unwrap() > 31);
}

/// Writes an external ISP that hangs after so many calls, with a process of its own.
#[cfg(unix)]
fn write_hanging(folder: &Path, calls: usize) {
    let book = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../book/src/examples");
    let hang = "{ sleep 61 & echo $! > child; sleep 62; }";
    let script = format!(
        "echo call >> calls\n[ $(wc -l < calls) -le {calls} ] || {hang}\n{}",
        read(&book.join("external-isp.sh"))
    );
    let about = read(&book.join("external-isp.toml")).replacen(
        "\n\n",
        "\ntimeout_s = 60\nretries = 2\nparallel = 2\n\n",
        1,
    );
    std::fs::create_dir_all(folder).unwrap();
    std::fs::write(folder.join("external-isp.sh"), script).unwrap();
    std::fs::write(folder.join("external-isp.toml"), about).unwrap();
}

/// Runs the command until the external ISP in the folder `lab` hangs, and sends a signal. Nothing of the ISP may be left.
#[cfg(unix)]
fn signalled(folder: &Path, signal: &str, args: &[&str]) -> common::Outcome {
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};

    let (temporary, child_file) = (folder.join("temporary"), folder.join("lab/child"));
    std::fs::create_dir_all(&temporary).unwrap();
    let mut command = common::petzval(folder);
    command.args(args).env("TMPDIR", &temporary).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut running = command.spawn().unwrap();
    let began = Instant::now();
    while !std::fs::read_to_string(&child_file).is_ok_and(|child| child.ends_with('\n')) {
        let is_over = running.try_wait().unwrap().is_some() || began.elapsed() > Duration::from_secs(120);
        if is_over {
            running.kill().unwrap();
            panic!(
                "{args:?}: the ISP never hangs: {:?}",
                common::outcome(running.wait_with_output().unwrap())
            );
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(std::fs::read_dir(&temporary).unwrap().next().is_some());
    let signalled = Instant::now();
    assert!(Command::new("kill").args(["-s", signal, &running.id().to_string()]).status().unwrap().success());
    let outcome = common::outcome(running.wait_with_output().unwrap());
    assert!(signalled.elapsed() < Duration::from_secs(5), "{args:?}: {:?}", signalled.elapsed());
    // After SIGKILL somebody else has to remove it.
    let is_left = || std::fs::read_dir(&temporary).unwrap().next().is_some();
    let patience = if signal == "KILL" { Duration::from_secs(5) } else { Duration::ZERO };
    while is_left() && signalled.elapsed() < patience {
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(!is_left(), "{args:?}: a folder is left");
    // A process that was killed may need a moment to disappear.
    let state = || std::fs::read_to_string(format!("/proc/{}/stat", read(&child_file).trim()));
    let is_gone = (0..200).any(|_| {
        std::thread::sleep(Duration::from_millis(10));
        state().map_or(true, |stat| stat.contains(") Z "))
    });
    assert!(is_gone, "{args:?}: {:?}", state());
    std::fs::remove_file(&child_file).unwrap();
    std::fs::remove_file(folder.join("lab/calls")).unwrap();
    outcome
}

#[cfg(unix)]
#[test]
fn a_signal_stops_an_external_isp_that_hangs_and_what_was_finished_stays() {
    let folder = tempfile::tempdir().unwrap();
    let lab = folder.path().join("lab");
    write_raws(&folder.path().join("raws"));
    std::fs::copy(data("photos/coffee.png"), folder.path().join("coffee.png")).unwrap();
    write_hanging(&lab, 1);
    let isp = ["--isp", "lab/external-isp.toml"];
    let develop = ["isp", "develop", "raws/left.tiff", "raws/right.tiff", "--out", "out"];
    let stopped = signalled(folder.path(), "INT", &[&develop[..], &isp].concat());
    assert_eq!(stopped.code, Some(1), "{}", stopped.stderr);
    assert!(stopped.says("right.tiff: the external ISP Ten-line ISP was stopped"), "{}", stopped.stderr);
    assert!(folder.path().join("out/left.png").is_file() && !folder.path().join("out/right.png").exists());

    write_hanging(&lab, 0);
    let simulate = ["simulate", "coffee.png", "--size", "32x48", "--no-distortion", "--out", "simulated"];
    let stopped = signalled(folder.path(), "TERM", &[&simulate[..], &isp].concat());
    assert_eq!(stopped.code, Some(1), "{}", stopped.stderr);
    assert!(stopped.says("Ten-line ISP was stopped"), "{}", stopped.stderr);
    assert_eq!(std::fs::read_dir(folder.path().join("simulated")).unwrap().count(), 0);
}

/// Killed without a word, the command cannot stop anything itself.
#[cfg(target_os = "linux")]
#[test]
fn an_external_isp_dies_with_its_master_and_leaves_no_folder() {
    let folder = tempfile::tempdir().unwrap();
    let lab = folder.path().join("lab");
    write_raws(&folder.path().join("raws"));
    write_hanging(&lab, 0);
    let develop = ["isp", "develop", "raws/left.tiff", "raws/right.tiff", "--isp", "lab/external-isp.toml"];
    let killed = signalled(folder.path(), "KILL", &[&develop[..], &["--out", "out"]].concat());
    assert_eq!((killed.code, killed.stderr.as_str()), (None, ""));
}

#[cfg(unix)]
#[test]
fn a_signal_stops_searches_and_trainings_with_an_isp_that_hangs_and_both_resume() {
    let folder = tempfile::tempdir().unwrap();
    let lab = folder.path().join("lab");
    write_raws(&folder.path().join("raws"));
    write_references(folder.path());
    let isp = ["--isp", "lab/external-isp.toml"];
    // Two frames, and six settings in a generation: the second generation is interrupted.
    write_hanging(&lab, 2 + 12 + 4);
    let tune = ["isp", "tune", "raws", "--reference", "reference", "--evaluations", "13", "--out", "search"];
    let stopped = signalled(folder.path(), "INT", &[&tune[..], &isp].concat());
    assert_eq!(stopped.code, Some(75), "{}", stopped.stderr);
    let history = |name: &str| read_json(&folder.path().join(name)).as_array().unwrap().len();
    assert_eq!(history("search/history.json"), 1);
    write_hanging(&lab, 1000);
    // As many settings as the search began with.
    run_ok(folder.path(), &["isp", "tune", "--resume", "search"]);
    assert_eq!(history("search/history.json"), 2);

    // The second step is interrupted.
    write_hanging(&lab, 70);
    let sizes = ["--steps", "3", "--base-channels", "8", "--levels", "2", "--out", "proxy"];
    let train = [&["train", "isp-proxy"], &isp[..], &sizes].concat();
    let stopped = signalled(folder.path(), "TERM", &train);
    assert_eq!(stopped.code, Some(75), "{}", stopped.stderr);
    let kept = read_json(&folder.path().join("proxy/training.json"))["step"].as_u64().unwrap();
    assert!(kept < 3 && stopped.says(&format!("stopped after {kept} steps; --resume continues")), "{kept}");
}

#[test]
fn a_proxy_is_trained_described_and_developed_with() {
    let folder = tempfile::tempdir().unwrap();
    write_raws(&folder.path().join("raws"));
    let settings = folder.path().join("mine.toml");
    std::fs::write(&settings, "about = \"A preset of one's own.\"\n").unwrap();
    let train = [
        "train",
        "isp-proxy",
        "--isp",
        "mine.toml",
        "--vary",
        "gain.stops,gamma",
        "--steps",
        "3",
        "--base-channels",
        "8",
        "--levels",
        "2",
    ];
    let done = run_ok(folder.path(), &[&train[..], &["--out", "proxy", "--json"]].concat()).json();
    let gap = &done["gap"];
    assert_eq!((&done["steps"], &done["varied"], &gap["frames"]), (&3.into(), &3.into(), &27.into()));
    assert!(gap["gradient_cosine"].as_f64().unwrap().abs() <= 1.0, "{gap}");
    assert_eq!(gap["scores"].as_array().unwrap().len(), 3);
    let card: toml::Table = read(&folder.path().join("proxy/proxy.toml")).parse().unwrap();
    assert_eq!(card["gap"]["frames"].as_integer(), Some(27));
    assert!(read(&folder.path().join("proxy/proxy.html")).contains("proxy, frame 1"));

    // It is an ISP like others, in the parameters that it knows.
    let develop = ["isp", "develop", "raws/left.tiff", "--isp", "proxy/proxy.toml", "--out", "out"];
    run_ok(folder.path(), &[&develop[..], &["--set", "gain.stops=0.5"]].concat());
    assert_eq!(image::open(folder.path().join("out/left.png")).unwrap().width(), 48);
    let unknown = [&develop[..], &["--set", "sharpen.amount=0.7", "--force"]].concat();
    run_fails(folder.path(), &unknown, 2, &["sharpen.amount"]);

    // A finished training stays as it is, and another does not overwrite it.
    let again = run_ok(folder.path(), &["train", "isp-proxy", "--resume", "proxy", "--json"]).json();
    assert_eq!(again["gap"], done["gap"]);
    run_fails(folder.path(), &[&train[..], &["--out", "proxy"]].concat(), 2, &["already holds a training"]);
    run_fails(folder.path(), &["train", "isp-proxy", "--resume", "raws"], 2, &["training.json"]);

    // The ISP is no longer the one that is imitated.
    std::fs::write(&settings, "about = \"Brighter.\"\n[settings.gain]\nstops = 0.5\n").unwrap();
    let changed = ["mine.toml", "no longer those with which this training began"];
    run_fails(folder.path(), &["train", "isp-proxy", "--resume", "proxy"], 2, &changed);
}

#[test]
fn a_mosaic_is_no_reference_and_pairs_are_named() {
    let folder = tempfile::tempdir().unwrap();
    write_raws(&folder.path().join("raws"));
    write_references(folder.path());
    let args = ["isp", "tune", "raws", "--reference", "raws", "--vary", "gain", "--out", "out"];
    run_fails(folder.path(), &args, 2, &["left.tiff", "raw frame, not a picture", "left.png in colour"]);
    assert!(!folder.path().join("out").exists());
    // A mosaic without a sidecar, in another folder, under another ending.
    std::fs::create_dir(folder.path().join("mosaics")).unwrap();
    for name in ["left", "right"] {
        let raw = image::open(folder.path().join(format!("raws/{name}.tiff"))).unwrap().into_luma16();
        raw.save(folder.path().join(format!("mosaics/{name}.png"))).unwrap();
    }
    let args = ["isp", "tune", "raws", "--reference", "mosaics", "--vary", "gain", "--out", "out"];
    run_fails(folder.path(), &args, 2, &["mosaics/left.png", "raw frame, not a picture"]);

    // Pictures beside the frames are taken, and every pair is named.
    for name in ["left", "right"] {
        let at = |name: String| folder.path().join("raws").join(name);
        for ending in ["tiff", "tiff.toml"] {
            std::fs::rename(at(format!("{name}.{ending}")), at(format!("{name}-raw.{ending}"))).unwrap();
        }
        std::fs::copy(folder.path().join(format!("reference/{name}.png")), at(format!("{name}.png")))
            .unwrap();
    }
    std::fs::create_dir(folder.path().join("frames")).unwrap();
    for name in ["left-raw.tiff", "left-raw.tiff.toml"] {
        std::fs::copy(folder.path().join("raws").join(name), folder.path().join("frames").join(name))
            .unwrap();
    }
    let args = [
        "isp",
        "tune",
        "frames",
        "--reference",
        "raws",
        "--vary",
        "gain",
        "--evaluations",
        "8",
        "--out",
        "out",
    ];
    let run = run_ok(folder.path(), &[&args[..], &["--json"]].concat());
    assert!(run.stderr.contains("frames/left-raw.tiff -> raws/left.png"), "{}", run.stderr);
    assert_eq!(run.json()["pairs"][0]["reference"], "raws/left.png");
}

/// A gray ramp with noise, cut off at a number, as a 12-bit RGGB frame.
fn write_ramp(path: &Path, cut: u16, offsets: [u16; 4], sidecar: &str) {
    let hash = |i: u32| (i.wrapping_mul(2_654_435_761) >> 16) % 31;
    let frame = image::ImageBuffer::<image::Luma<u16>, _>::from_fn(200, 120, |x, y| {
        let response = [0.6, 1.0, 1.0, 0.7][(y % 2 * 2 + x % 2) as usize];
        let light = response * (300.0 + 20.0 * f64::from(x)) + f64::from(hash(y * 200 + x));
        let offset = offsets[(y % 2 * 2 + x % 2) as usize];
        image::Luma([(offset + light as u16).min(cut)])
    });
    frame.save(path).unwrap();
    let sidecar = format!("bits = 12\ncfa = \"RGGB\"\nsensor = \"imx249-fitted\"\n{sidecar}");
    std::fs::write(path.with_extension("tiff.toml"), sidecar).unwrap();
}

/// Mean of a column band of a developed picture, by colour.
fn mean_of(path: &Path, from: u32, to: u32) -> [f64; 3] {
    let picture = image::open(path).unwrap().into_rgb8();
    let mut sums = [0.0; 3];
    let pixels = || (40..80).flat_map(move |y| (from..to).map(move |x| (x, y)));
    for (x, y) in pixels() {
        let pixel = picture.get_pixel(x, y).0;
        (0..3).for_each(|c| sums[c] += f64::from(pixel[c]));
    }
    sums.map(|sum| sum / pixels().count() as f64)
}

#[test]
fn a_white_level_above_saturation_is_named_and_highlights_stay_neutral() {
    let folder = tempfile::tempdir().unwrap();
    let raw = folder.path().join("ramp.tiff");
    write_ramp(&raw, 2600, [64; 4], "black_level_dn = 64\nwhite_level_dn = 4095\n");
    let run = run_ok(folder.path(), &["isp", "develop", "ramp.tiff", "--out", "out"]);
    for words in ["2600 DN", "below the white level of 4095 DN", "white_level_dn"] {
        assert!(run.stderr.contains(words), "{words}: {}", run.stderr);
    }
    let [red, green, blue] = mean_of(&folder.path().join("out/ramp.png"), 185, 200);
    assert!((red - green).abs() < 6.0 && (blue - green).abs() < 6.0, "{red} {green} {blue}");
    // With the right level there is nothing to say.
    write_ramp(&raw, 2600, [64; 4], "black_level_dn = 64\nwhite_level_dn = 2600\n");
    let run = run_ok(folder.path(), &["isp", "develop", "ramp.tiff", "--out", "right"]);
    assert!(!run.stderr.contains("white level"), "{}", run.stderr);
}

#[test]
fn black_levels_of_the_tile_and_the_gain_are_subtracted() {
    let folder = tempfile::tempdir().unwrap();
    let raw = folder.path().join("ramp.tiff");
    let (even, uneven) = ([64; 4], [34, 64, 74, 104]);
    let develop = |offsets: [u16; 4], sidecar: &str, out: &str| {
        write_ramp(&raw, 4095, offsets, &format!("white_level_dn = 4095\n{sidecar}"));
        run_ok(folder.path(), &["isp", "develop", "ramp.tiff", "--out", out]);
        mean_of(&folder.path().join(out).join("ramp.png"), 2, 20)
    };
    let wanted = develop(even, "black_level_dn = 64\n", "even");
    let found = develop(uneven, "black_level_dn = [34, 64, 74, 104]\n", "tile");
    let wrong = develop(uneven, "black_level_dn = 69\n", "one");
    let table = "[[black_at_gain]]\nlinear_gain = 1.0\nblack_dn = [14, 44, 54, 84]\n\
                 [[black_at_gain]]\nlinear_gain = 3.0\nblack_dn = [54, 84, 94, 124]\n";
    std::fs::write(folder.path().join("camera.toml"), table).unwrap();
    let by_gain = develop(uneven, "linear_gain = 2.0\ncalibration = \"camera.toml\"\n", "gain");
    let off = |found: [f64; 3]| (0..3).map(|c| (found[c] - wanted[c]).abs()).fold(0.0, f64::max);
    assert!(off(found) < 1.5, "{found:?} {wanted:?}");
    assert!(off(wrong) > 3.0, "{wrong:?} {wanted:?}");
    // The gain of 2 also strengthens denoising a little.
    assert!(off(by_gain) < 2.5, "{by_gain:?} {wanted:?}");
    std::fs::write(
        folder.path().join("ramp.tiff.toml"),
        "bits = 12\ncfa = \"RGGB\"\nblack_level_dn = [1, 2, 3]\n",
    )
    .unwrap();
    let args = ["isp", "develop", "ramp.tiff", "--out", "no"];
    run_fails(folder.path(), &args, 2, &["ramp.tiff.toml:3", "3 levels for a tile of 4 pixels"]);
}

#[test]
fn a_hostile_sidecar_is_refused_before_anything_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    // A file of 64 MB is not read where the sidecar says 16 bytes, and neither is a sidecar of 64 MB.
    let sparse = |name: &str| std::fs::File::create(at(name)).unwrap().set_len(64 << 20).unwrap();
    sparse("big.raw");
    std::fs::write(at("big.raw.toml"), "height = 2\nwidth = 4\nbits = 16\npacking = \"u16le\"\n").unwrap();
    let started = std::time::Instant::now();
    run_fails(folder.path(), &["raw", "show", "big.raw"], 2, &["big.raw", "67108864 bytes", "2x4 pixels"]);
    std::fs::write(at("a.raw"), [0; 16]).unwrap();
    sparse("a.raw.toml");
    run_fails(folder.path(), &["raw", "show", "a.raw"], 2, &["a.raw.toml", "at most 1048576 bytes are read"]);
    for (layout, words) in [
        ("height = 4000000000\nwidth = 4000000000", "at most 2^28"),
        ("height = 2\nwidth = 4\nheader_bytes = 9223372036854775807", "16 bytes"),
    ] {
        std::fs::write(at("a.raw.toml"), format!("{layout}\nbits = 16\npacking = \"u16le\"\n")).unwrap();
        run_fails(folder.path(), &["raw", "show", "a.raw"], 2, &["a.raw", words]);
    }
    assert!(started.elapsed().as_secs() < 20);
}
