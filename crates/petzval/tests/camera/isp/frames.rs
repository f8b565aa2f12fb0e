//! What is known of a raw frame before it is developed: its numbers, levels, calibration and exposures.

use std::path::Path;

use super::write_raws;
use crate::common::{data, read, run_fails, run_ok};

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
    // Those of the other order contradict the sidecars and the frames.
    let quiet = run_ok(folder.path(), &[&["isp", "develop", "--out", "quiet"], &given[..]].concat());
    assert!(!quiet.says("as motion") && !quiet.says("times the exposure"), "{}", quiet.stderr);
    let wrong = [&["isp", "develop", "--out", "wrong"], &merged[..], &["--exposures", "1,4"]].concat();
    let wrong = run_ok(folder.path(), &wrong);
    for words in [
        "short/coffee-raw.tiff: --exposures gives it 4 times the exposure of long/coffee-raw.tiff",
        "of the two frames it has 0.25 times",
        "of the merged frame was taken as motion",
    ] {
        assert!(wrong.says(words), "{words}: {}", wrong.stderr);
    }
    let refused = [&["isp", "develop", "--out", "no"], &merged[..], &["--exposures", "4,2,1"]].concat();
    run_fails(folder.path(), &refused, 2, &["number of exposures", "one for each frame"]);
}

/// Writes a picture whose EXIF data state an orientation: 3 is half a turn.
fn write_with_orientation(picture: &image::RgbImage, exif: u8, to: &Path) {
    use image::ImageEncoder;
    let mut bytes = Vec::new();
    let mut encoder = image::codecs::png::PngEncoder::new(&mut bytes);
    let about = [&b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0"[..], &[exif], &[0; 6]].concat();
    encoder.set_exif_metadata(about).unwrap();
    encoder.write_image(picture, picture.width(), picture.height(), image::ExtendedColorType::Rgb8).unwrap();
    std::fs::write(to, bytes).unwrap();
}

#[test]
fn pictures_are_turned_as_their_frames_say_and_so_is_what_is_tuned() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    write_raws(&at("raws"));
    std::fs::remove_file(at("raws/right.tiff")).unwrap();
    let sidecar = read(&at("raws/left.tiff.toml"));
    let develop = |out: &str| run_ok(folder.path(), &["isp", "develop", "raws/left.tiff", "--out", out]);
    let open = |out: &str| image::open(at(out).join("left.png")).unwrap().into_rgb8();
    assert!(!develop("stored").says("orientation"));
    let stored = open("stored");

    std::fs::write(at("raws/left.tiff.toml"), format!("{sidecar}orientation = 6\n")).unwrap();
    let run = develop("turned");
    assert!(run.says("its orientation is 6: the picture is turned by a quarter clockwise"), "{}", run.stderr);
    assert_eq!(open("turned"), image::imageops::rotate90(&stored));
    // The numbers of a mosaic stay where they are.
    let run = run_ok(folder.path(), &["raw", "convert", "raws/left.tiff", "kept.npy"]);
    assert!(run.says("kept.npy.toml keeps `orientation = 6`"), "{}", run.stderr);
    assert!(read(&at("kept.npy.toml")).contains("orientation = 6\n"));

    let tune = |reference: &'static str, out: &'static str| {
        [
            "isp",
            "tune",
            "raws",
            "--reference",
            reference,
            "--vary",
            "gain",
            "--evaluations",
            "8",
            "--out",
            out,
        ]
    };
    let start = |reference: &'static str, out: &'static str| {
        let run = run_ok(folder.path(), &[&tune(reference, out)[..], &["--json"]].concat());
        (run.json()["start"].as_f64().unwrap(), run.says("its reference is turned by an orientation"))
    };
    let sizes = ["left.png: 48 x 32 pixels", "left.tiff has 32 x 48"];
    run_fails(folder.path(), &tune("stored", "no"), 2, &sizes);
    let (score, _) = start("turned", "quarter");
    assert!(score > 40.0, "{score}");

    // A reference that its file turns, of a frame that states no orientation, and of one that states the same.
    std::fs::create_dir(at("half")).unwrap();
    write_with_orientation(&stored, 3, &at("half/left.png"));
    for (line, is_alike) in [("", false), ("orientation = 3\n", true)] {
        std::fs::write(at("raws/left.tiff.toml"), format!("{sidecar}{line}")).unwrap();
        let (score, is_named) = start("half", if is_alike { "alike" } else { "unlike" });
        assert_eq!((score > 40.0, is_named), (is_alike, !is_alike), "{line}: {score}");
    }
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
    let [red, green, blue] = mean_of(&folder.path().join("right/ramp.png"), 185, 200);
    assert!((red - green).abs() < 6.0 && (blue - green).abs() < 6.0, "{red} {green} {blue}");
}

#[test]
fn a_black_level_above_the_light_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let raw = folder.path().join("ramp.tiff");
    for (black, is_named) in [(900, true), (64, false)] {
        write_ramp(&raw, 4095, [64; 4], &format!("black_level_dn = {black}\nwhite_level_dn = 4095\n"));
        let run = run_ok(folder.path(), &["isp", "develop", "ramp.tiff", "--out", "out", "--force"]);
        assert_eq!(run.stderr.contains("below the black level of 900 DN"), is_named, "{}", run.stderr);
    }
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
fn frames_that_no_isp_takes_are_refused_with_what_it_takes() {
    let folder = tempfile::tempdir().unwrap();
    let levels = "bits = 12\nblack_level_dn = 119\nwhite_level_dn = 4000\n";
    let args = ["isp", "develop", "frame.npy", "--out", "out"];
    write_npy(&folder.path().join("frame.npy"), (32, 48), &[500; 32 * 48], levels);
    let sidecar = folder.path().join("frame.npy.toml");
    let bayer = read(&sidecar);
    for cfa in ["RW/WB", "mono"] {
        std::fs::write(&sidecar, bayer.replace("GRBG", cfa)).unwrap();
        run_fails(folder.path(), &args, 2, &["frame.npy", cfa, "take Bayer mosaics alone"]);
    }
    write_npy(&folder.path().join("frame.npy"), (33, 48), &[500; 33 * 48], levels);
    run_fails(
        folder.path(),
        &args,
        2,
        &[
            "size of the frame is 48 x 33; it must be even in rows and columns, and at least 16 x 16",
            "drop the last row or column",
        ],
    );
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
    run_fails(folder.path(), &["raw", "show", "big.raw"], 2, &["big.raw", "67108864 bytes", "4 x 2 pixels"]);
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
