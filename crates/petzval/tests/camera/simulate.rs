//! `petzval simulate`: raw frame and developed picture of a photograph.

use std::path::Path;

use crate::common::{data, read, run_fails, run_ok};

fn raw(path: &Path) -> Vec<u16> {
    let picture = image::open(path).unwrap();
    let image::DynamicImage::ImageLuma16(samples) = picture else {
        panic!("{} is not 16-bit gray but {:?}", path.display(), picture.color());
    };
    assert_eq!((samples.width(), samples.height()), (1920, 1200));
    samples.into_raw()
}

#[test]
fn a_photograph_becomes_a_raw_frame_and_a_picture() {
    let folder = tempfile::tempdir().unwrap();
    let photo = data("photos/coffee.png").display().to_string();
    let take = |out: &str, more: &[&str]| {
        let written =
            run_ok(folder.path(), &[&["simulate", "--force", &photo, "--out", out, "--json"], more].concat())
                .json();
        assert_eq!(written.as_array().unwrap().len(), 1);
        assert_eq!(written[0]["image"], "coffee");
        assert_eq!(written[0]["raw"], format!("{out}/coffee-raw.tiff"));
        assert_eq!(written[0]["developed"], format!("{out}/coffee-developed.png"));
        assert_eq!((&written[0]["white_e"], &written[0]["display_white"]), (&16000.0.into(), &1.0.into()));
        folder.path().join(out)
    };
    let (once, again) = (take("once", &["--seed", "5"]), take("again", &["--seed", "5", "--threads", "1"]));
    let (other, clean) = (take("other", &["--seed", "6"]), take("clean", &["--no-noise"]));

    // The same seed gives the same bytes, whatever the number of threads.
    for file in ["coffee-raw.tiff", "coffee-developed.png"] {
        let bytes = |folder: &Path| std::fs::read(folder.join(file)).unwrap();
        assert!(bytes(&once) == bytes(&again), "{file} differs between two runs");
        assert!(bytes(&once) != bytes(&other), "{file} does not depend on the seed");
    }

    // 12-bit numbers on a black level of 119, and a mean that noise does not move.
    let (noisy, clean_dn) = (raw(&once.join("coffee-raw.tiff")), raw(&clean.join("coffee-raw.tiff")));
    assert!(noisy.iter().all(|dn| *dn < 4096));
    assert!(clean_dn.iter().all(|dn| *dn >= 119));
    let mean = |dn: &[u16]| dn.iter().map(|v| f64::from(*v)).sum::<f64>() / dn.len() as f64;
    assert!((mean(&noisy) - mean(&clean_dn)).abs() < 2.0, "{} {}", mean(&noisy), mean(&clean_dn));
    // Shot noise of some thousand electrons at 0.14 DN/e is a few DN.
    let square = |(a, b): (&u16, &u16)| (f64::from(*a) - f64::from(*b)).powi(2);
    let spread = (noisy.iter().zip(&clean_dn).map(square).sum::<f64>() / noisy.len() as f64).sqrt();
    assert!(spread > 2.0 && spread < 20.0, "{spread}");

    let developed = image::open(clean.join("coffee-developed.png")).unwrap();
    assert_eq!((developed.width(), developed.height()), (1920, 1200));
    assert_eq!(developed.color(), image::ColorType::Rgb8);
    // The coffee is brown: red above blue.
    let pixels = developed.to_rgb8();
    let sum = |c: usize| pixels.pixels().map(|p| f64::from(p[c])).sum::<f64>();
    assert!(sum(0) > 1.2 * sum(2));

    let help = run_ok(folder.path(), &["simulate", "--help"]).stdout;
    let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(help.contains("the fixed pattern (DSNU, PRNU, hot pixels) stays"), "{help}");
}

#[test]
fn what_cannot_be_read_is_named_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let good = data("photos/coffee.png").display().to_string();
    std::fs::write(folder.path().join("notes.png"), "no picture").unwrap();
    std::fs::write(folder.path().join("cut.png"), &std::fs::read(&good).unwrap()[..2000]).unwrap();
    std::fs::create_dir(folder.path().join("twin")).unwrap();
    std::fs::copy(&good, folder.path().join("twin/coffee.png")).unwrap();
    std::fs::create_dir_all(folder.path().join("shots")).unwrap();
    std::fs::create_dir_all(folder.path().join("done/psf-calibration")).unwrap();
    for empty in ["shots/captures.toml", "done/captures.toml", "done/psf-calibration/psfs.toml"] {
        std::fs::write(folder.path().join(empty), "").unwrap();
    }
    let wide = std::fs::read_to_string(data("sensors/imx249-fitted.toml")).unwrap();
    std::fs::write(folder.path().join("wide.toml"), wide.replace("width = 1920", "width = 4000")).unwrap();
    for (args, needles) in [
        (
            &["notes.png"][..],
            [
                "notes.png: cannot decode the picture",
                "help: give a PNG, JPEG, TIFF, WebP, BMP, OpenEXR or Radiance HDR file",
            ],
        ),
        (&[&good, "cut.png"], ["it is cut off", "help: copy or export the file again"]),
        (&[&good, "--psfs", "shots"], ["--psfs shots: these are captures", "petzval psf-calibrate shots"]),
        (&[&good, "--psfs", "done"], ["--psfs done: these are captures", "are in done/psf-calibration"]),
        (&[&good, "--psfs", "none"], ["none", "results of `petzval psf` or `petzval psf-calibrate`"]),
        (&["nowhere.png"], ["nowhere.png", "No such file"]),
        (&["twin"], ["twin", "folder"]),
        (&[&good, "twin/coffee.png"], ["twin/coffee.png: another image is called `coffee`", "--out"]),
        (&[&good, "--lens", "no-such"], ["no lens called `no-such`", "cooke-triplet-nominal"]),
        (&[&good, "--sensor", "no-such"], ["no sensor called `no-such`", "imx249-fitted"]),
        (&[&good, "--white-e=-1"], ["--white-e -1", "a positive number"]),
        (&[&good, "--samples", "0"], ["--samples 0: must lie between 1 and 8", "4 x 4 samples"]),
        (&[&good, "--samples", "9"], ["--samples 9: must lie between 1 and 8", "4 x 4 samples"]),
        (&[&good, "--samples", "8", "--sensor", "wide.toml"], ["--samples 8: a scene of", "take fewer"]),
        (&[&good, "--gain", "nan"], ["--gain", "positive"]),
        (&[], ["IMAGE", "Usage"]),
    ] {
        run_fails(folder.path(), &[&["simulate", "--force", "--out", "out"], args].concat(), 2, &needles);
    }
}

/// Writes `small.toml`, the usual sensor with fewer pixels.
fn write_small_sensor(folder: &Path) {
    let small = read(&data("sensors/imx249-fitted.toml"))
        .replace("width = 1920", "width = 160")
        .replace("height = 1200", "height = 120");
    std::fs::write(folder.join("small.toml"), small).unwrap();
}

/// A thin lens that spreads light.
const DIVERGING: &str = r#"
name = "diverging"
units = "mm"
[aperture]
entrance_pupil_diameter_mm = 5.0
[object]
distance_mm = inf
[wavelengths]
um = [0.55]
reference_um = 0.55
[fields]
angle_deg = [0.0]
[[surface]]
stop = true
radius_mm = inf
thin_lens = { focal_length_mm = -50.0 }
thickness_mm = 50.0
semi_diameter_mm = 3.0
"#;

#[test]
fn light_beyond_the_psf_grid_of_a_lens_out_of_focus_has_its_reason() {
    let folder = tempfile::tempdir().unwrap();
    write_small_sensor(folder.path());
    let lens = read(&data("lenses/cooke-triplet-nominal.toml"));
    for (name, back_mm) in [("moved.toml", "25.125171"), ("far.toml", "26.025171")] {
        std::fs::write(folder.path().join(name), lens.replacen("24.525171", back_mm, 1)).unwrap();
    }
    let photo = data("photos/coffee.png").display().to_string();
    let args = ["simulate", photo.as_str(), "--lens", "moved.toml", "--sensor", "small.toml", "--out", "out"];
    let taken = run_ok(folder.path(), &args);
    assert!(taken.says("cuts off") && taken.says("moved.toml: out of focus"), "{}", taken.stderr);
    assert!(taken.says("`petzval lens focus moved.toml OUT.toml`"), "{}", taken.stderr);
    // From less than half of the light there is no picture of the lens.
    let far = ["simulate", photo.as_str(), "--lens", "far.toml", "--sensor", "small.toml", "--out", "far"];
    run_fails(
        folder.path(),
        &far,
        2,
        &["far.toml: the PSF grid", "no picture of the lens", "`petzval lens focus far.toml"],
    );
    assert!(!folder.path().join("far").exists());
    // A lens that forms no image has no picture, wherever its image plane lies.
    std::fs::write(folder.path().join("diverging.toml"), DIVERGING).unwrap();
    let diverging =
        ["simulate", photo.as_str(), "--lens", "diverging.toml", "--sensor", "small.toml", "--out", "far"];
    run_fails(folder.path(), &diverging, 2, &["diverging.toml: the PSF grid", "forms no image there"]);
    assert!(!folder.path().join("far").exists());
}

/// Each patch has the PSF of its own place.
#[test]
fn a_lens_without_symmetry_takes_photographs() {
    let folder = tempfile::tempdir().unwrap();
    write_small_sensor(folder.path());
    let lens = read(&data("lenses/cooke-triplet-nominal.toml"));
    let gap = "thickness_mm = 8.11\n";
    for (name, placement) in
        [("hardly", "tilt_deg = [1e-9, 0.0, 0.0]"), ("off", "decenter_mm = [0.07, 0.07]")]
    {
        let placed =
            lens.replacen(gap, &format!("placement = {{ {placement}, axis = \"returns\" }}\n{gap}"), 1);
        assert_ne!(placed, lens);
        std::fs::write(folder.path().join(format!("{name}.toml")), placed).unwrap();
    }
    let photo = data("photos/coffee.png").display().to_string();
    let args = |lens: &str, out: &str| -> Vec<String> {
        let words = [
            "simulate",
            &photo,
            "--sensor",
            "small.toml",
            "--picture-format",
            "png16",
            "--no-noise",
            "--no-distortion",
        ];
        let words = words.iter().map(|word| (*word).to_owned());
        words.chain(["--lens".to_owned(), lens.to_owned(), "--out".to_owned(), out.to_owned()]).collect()
    };
    let take = |lens: &str, out: &str| {
        let args = args(lens, out);
        let taken = run_ok(folder.path(), &args.iter().map(String::as_str).collect::<Vec<_>>());
        (developed16(&folder.path().join(out).join("coffee-developed.png")), taken)
    };
    let rms = |a: &[[f64; 3]], b: &[[f64; 3]]| {
        let square = |(a, b): (&[f64; 3], &[f64; 3])| (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f64>();
        (a.iter().zip(b).map(square).sum::<f64>() / (3 * a.len()) as f64).sqrt()
    };
    // A tilt of a billionth of a degree leaves the picture of the symmetric lens.
    let ((symmetric, _), (hardly, said)) = (take("cooke-triplet-nominal", "a"), take("hardly.toml", "b"));
    assert!(said.says("PSFs are traced at"), "{}", said.stderr);
    assert!(rms(&symmetric, &hardly) < 1.5 / 255.0, "{}", rms(&symmetric, &hardly));
    let (off, _) = take("off.toml", "c");
    assert!(rms(&symmetric, &off) > 3.0 / 255.0, "{}", rms(&symmetric, &off));
    // What turns PSFs about the axis is refused by name.
    for (more, needle) in [(&["--restore"][..], "--restore"), (&["--samples", "2"], "--samples 2")] {
        let args = args("off.toml", "d");
        let args: Vec<&str> = args.iter().map(String::as_str).chain(more.iter().copied()).collect();
        run_fails(folder.path(), &args, 2, &[needle, "a lens without rotational symmetry"]);
    }
    assert!(!folder.path().join("d").exists());
}

#[test]
fn a_result_that_cannot_be_written_leaves_no_others() {
    let folder = tempfile::tempdir().unwrap();
    write_small_sensor(folder.path());
    let photo = data("photos/coffee.png").display().to_string();
    let simulate =
        ["simulate", "--force", photo.as_str(), "--sensor", "small.toml", "--picture-format", "npy"];
    let args = [&simulate[..], &["--out", "out"]].concat();
    let all = ["coffee-calibration.toml", "coffee-developed.npy", "coffee-raw.tiff", "coffee-raw.tiff.toml"];
    for blocked in all {
        let folder_there = folder.path().join("out").join(blocked);
        std::fs::create_dir_all(&folder_there).unwrap();
        let needles =
            [&format!("{blocked}: cannot be written: this is a folder"), "choose a folder with --out"];
        run_fails(folder.path(), &args, 2, &needles);
        std::fs::remove_dir(folder_there).unwrap();
    }
    // Without the obstacle all files are written, and nothing else.
    run_ok(folder.path(), &args);
    let mut files: Vec<String> = std::fs::read_dir(folder.path().join("out"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    files.sort();
    assert_eq!(files, all);
}

/// Pixels of a 16-bit sRGB picture, 0..1.
fn developed16(path: &Path) -> Vec<[f64; 3]> {
    let picture = image::open(path).unwrap();
    assert_eq!(picture.color(), image::ColorType::Rgb16);
    picture.to_rgb16().pixels().map(|p| p.0.map(|v| f64::from(v) / 65535.0)).collect()
}

#[test]
fn overexposed_white_stays_white_and_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    // Black on the left, white on the right.
    image::RgbImage::from_fn(240, 160, |x, _| image::Rgb([if x < 120 { 60 } else { 255 }; 3]))
        .save(folder.path().join("bright.png"))
        .unwrap();
    let take = |more: &[&str]| {
        let args =
            ["simulate", "--force", "bright.png", "--json", "--size", "160x240", "--picture-format", "png16"];
        run_ok(folder.path(), &[&args[..], more].concat())
    };
    let over = take(&["--white-e", "16000", "--gain", "4"]);
    for needle in
        ["bright: ", "of the pixels are saturated", "2.82 times", "at gain 4", "--white-e 5600 or --gain 1.4"]
    {
        assert!(over.stderr.contains(needle), "{needle}: {}", over.stderr);
    }
    let facts = over.json();
    assert!((facts[0]["display_white"].as_f64().unwrap() - 0.3547).abs() < 1e-3, "{facts}");
    assert!((facts[0]["saturated_share"].as_f64().unwrap() - 0.5).abs() < 0.02, "{facts}");
    for pixel in
        developed16(&folder.path().join("bright-developed.png")).chunks(240).flat_map(|row| &row[140..])
    {
        assert!(pixel.iter().all(|v| *v > 0.99), "{pixel:?}");
    }
    // The suggested exposure does not saturate white, and gives no message.
    for more in [
        &["--white-e", "5600", "--gain", "4"][..],
        &["--white-e", "16000", "--gain", "1.4"],
        &["--gain", "4"],
    ] {
        let held = take(more);
        assert!(!held.stderr.contains("saturated"), "{}", held.stderr);
    }
    assert_eq!(take(&["--gain", "4"]).json()[0]["white_e"], 4000.0);
    let args = ["simulate", "--force", "bright.png", "--out", "out", "--time-s", "9000"];
    run_fails(folder.path(), &args, 2, &["--time-s 9000", "dark current alone", "less time"]);
}

#[test]
fn a_full_well_below_the_end_of_the_converter_is_the_white_level() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(data("sensors/imx249-fitted.toml")).unwrap();
    std::fs::write(folder.path().join("small.toml"), text.replace("33723.0", "9000.0")).unwrap();
    image::RgbImage::from_pixel(32, 24, image::Rgb([255; 3])).save(folder.path().join("white.png")).unwrap();
    let args = [
        "simulate",
        "--force",
        "white.png",
        "--sensor",
        "small.toml",
        "--size",
        "24x32",
        "--white-e",
        "30000",
        "--no-noise",
    ];
    run_ok(folder.path(), &args);
    // 119 + 1.15 + 0.14 (9000 + 3.25) = 1380.6.
    let sidecar = std::fs::read_to_string(folder.path().join("white-raw.tiff.toml")).unwrap();
    assert!(sidecar.contains("white_level_dn = 1380.0"), "{sidecar}");
    let shown = run_ok(folder.path(), &["raw", "show", "white-raw.tiff", "--json"]).json();
    let text = shown.to_string();
    assert!(text.contains("\"saturated\":192") && text.contains("\"saturated\":384"), "{text}");
    assert_eq!(run_ok(folder.path(), &[&args[..7], &["--json"]].concat()).json()[0]["white_e"], 5000.0);
}

#[test]
fn a_sensor_beyond_the_registers_of_the_isp_or_without_range_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(data("sensors/imx249-fitted.toml")).unwrap();
    let write = |name: &str, from: &str, to: &str| {
        assert!(text.contains(from), "{text}");
        std::fs::write(folder.path().join(name), text.replace(from, to)).unwrap();
    };
    image::RgbImage::from_pixel(32, 24, image::Rgb([90; 3])).save(folder.path().join("gray.png")).unwrap();
    let args = |sensor| {
        ["simulate", "--force", "gray.png", "--size", "24x32", "--isp", "neutral", "--sensor", sensor]
    };
    write("faint.toml", "relative_qe = [0.82,", "relative_qe = [0.02,");
    let said = run_ok(folder.path(), &args("faint.toml")).stderr;
    assert!(said.contains("warning: gray: its white balance multiplies red by 50.00"), "{said}");
    write("shallow.toml", "33723.0", "1.0");
    run_fails(
        folder.path(),
        &args("shallow.toml"),
        2,
        &["shallow.toml", "`full_well_e = 1`", "raise --gain"],
    );
    write("high.toml", "black_level_dn = 119.0", "black_level_dn = 4095.0");
    run_fails(
        folder.path(),
        &args("high.toml"),
        2,
        &["high.toml", "`black_level_dn = 4095` leaves no range", "lower"],
    );
}

#[test]
fn a_window_of_the_sensor_equals_its_part_of_a_whole_frame() {
    let folder = tempfile::tempdir().unwrap();
    let photo = data("photos/coffee.png").display().to_string();
    let take = |out: &str, more: &[&str]| {
        let args = ["simulate", "--force", photo.as_str(), "--out", out, "--no-noise"];
        run_ok(folder.path(), &[&args[..], more].concat());
        let picture = image::open(folder.path().join(out).join("coffee-raw.tiff")).unwrap();
        picture.into_luma16()
    };
    let (whole, part) = (take("whole", &[]), take("part", &["--size", "90x130"]));
    assert_eq!(part.dimensions(), (130, 90));
    // (1200 - 90) / 2 = 555, one less for a whole tile of the mosaic.
    let off = part.enumerate_pixels().map(|(x, y, dn)| dn[0].abs_diff(whole.get_pixel(x + 894, y + 554)[0]));
    let off: Vec<u16> = off.collect();
    assert!(off.iter().all(|d| *d <= 1) && off.iter().filter(|d| **d > 0).count() < 40);
    let sidecar = std::fs::read_to_string(folder.path().join("part/coffee-raw.tiff.toml")).unwrap();
    assert!(sidecar.contains("cfa = \"RGGB\""), "{sidecar}");
    for size in ["9x9999", "1x9", "90", "ax9"] {
        run_fails(folder.path(), &["simulate", "--force", &photo, "--size", size], 2, &["--size"]);
    }
}

#[test]
fn a_long_thin_picture_is_laid_on_the_sensor() {
    let folder = tempfile::tempdir().unwrap();
    image::RgbImage::from_fn(200_000, 2, |x, _| image::Rgb([if x < 100_000 { 40 } else { 200 }; 3]))
        .save(folder.path().join("thin.png"))
        .unwrap();
    run_ok(folder.path(), &["simulate", "--force", "thin.png", "--no-noise"]);
    // Its middle: dark on the left, bright on the right.
    let dn = raw(&folder.path().join("thin-raw.tiff"));
    let mean = |columns: std::ops::Range<usize>| {
        let sum: f64 = dn.chunks(1920).flat_map(|row| &row[columns.clone()]).map(|v| f64::from(*v)).sum();
        sum / (1200 * columns.len()) as f64
    };
    let (left, right) = (mean(400..500), mean(1420..1520));
    assert!(right - 119.0 > 5.0 * (left - 119.0), "{left} {right}");
}

/// A developed picture in linear light, red plane, row by row.
fn red(path: &Path) -> Vec<f32> {
    let bytes = std::fs::read(path).unwrap();
    let array = npyz::NpyFile::new(&bytes[..]).unwrap();
    let pixels = (array.shape()[1] * array.shape()[2]) as usize;
    array.into_vec::<f32>().unwrap()[..pixels].to_vec()
}

#[test]
fn an_exr_picture_is_linear_light_and_what_files_say_beyond_it_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let (height, width) = (120, 192);
    // Light of 0.2, and a highlight of 40 in the middle.
    let mut light = petzval::camera::image::LinearImage::filled(3, height, width, 0.2);
    for (row, col) in (50..70).flat_map(|row| (86..106).map(move |col| (row, col))) {
        (0..3).for_each(|c| light.set(c, row, col, 40.0));
    }
    petzval::files::save_exr(&light, &folder.path().join("light.exr")).unwrap();
    let options =
        ["--place", "centre", "--size", "120x192", "--no-noise", "--picture-format", "npy", "--json"];
    let taken = run_ok(folder.path(), &[&["simulate", "--force", "light.exr"], &options[..]].concat());
    assert!(taken.stderr.contains("the scene is brighter than white there"), "{}", taken.stderr);
    let developed = red(&folder.path().join("light-developed.npy"));
    let even: f32 = developed[10 * width + 20..][..40].iter().sum::<f32>() / 40.0;
    assert!((even - 0.2).abs() < 0.004, "{even}");
    assert!(developed[60 * width + 96] > 1.2);

    // A PNG of linear light.
    let file = std::fs::File::create(folder.path().join("gamma.png")).unwrap();
    let mut encoder = png::Encoder::new(file, 64, 48);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_source_gamma(png::ScaledFloat::new(1.0));
    encoder.write_header().unwrap().write_image_data(&[90; 64 * 48 * 3]).unwrap();
    for more in [&[][..], &["--qe", "imx219"]] {
        let args = ["simulate", "--force", "gamma.png", "--size", "32x32"];
        let said = run_ok(folder.path(), &[&args[..], more].concat()).stderr;
        let note = "warning: gamma.png: its gamma of 1.0000 (gAMA) is ignored: values are taken as sRGB";
        assert_eq!(said.matches(note).count(), 1, "{said}");
    }
}

#[test]
fn detail_finer_than_the_pixels_aliases() {
    let folder = tempfile::tempdir().unwrap();
    // A grating of 0.8 cycles a pixel, at four samples a pixel.
    let samples = 4;
    let (height, width) = (64 * samples, 96 * samples);
    let value = |col: usize| {
        let pixels = (col as f32 + 0.5) / samples as f32 - 48.0;
        0.3 + 0.3 * (std::f32::consts::TAU * 0.8 * pixels).cos()
    };
    let plane: Vec<f32> = (0..height * width).map(|i| value(i % width)).collect();
    let grating = petzval::camera::image::LinearImage::from_data(3, height, width, plane.repeat(3)).unwrap();
    petzval::files::save_exr(&grating, &folder.path().join("grating.exr")).unwrap();
    std::fs::write(folder.path().join("small.toml"), {
        let text = std::fs::read_to_string(data("sensors/imx249-fitted.toml")).unwrap();
        text.replace("height = 1200", "height = 64").replace("width = 1920", "width = 96")
    })
    .unwrap();
    let take = |more: &[&str]| {
        let options = ["--no-distortion", "--no-noise", "--sensor", "small.toml"];
        run_ok(folder.path(), &[&["simulate", "--force", "grating.exr"], &options[..], more].concat());
        let raw = image::open(folder.path().join("grating-raw.tiff")).unwrap().into_luma16();
        // Green pixels of a row in the middle: every second column. 0.8 cycles a pixel are 1.6 between them, which
        // is seen as 0.4.
        let row: Vec<f64> = (17..80).step_by(2).map(|x| f64::from(raw.get_pixel(x, 32)[0])).collect();
        let mean = row.iter().sum::<f64>() / row.len() as f64;
        // Amplitude at a frequency in cycles per sample, over 30 of them: whole periods of 0.4.
        let amplitude = |frequency: f64| {
            let part = |turn: f64| {
                let phase = |i: usize| std::f64::consts::TAU * (frequency * i as f64 + turn);
                (0..30).map(|i| (row[i] - mean) * phase(i).cos()).sum::<f64>()
            };
            part(0.0).hypot(part(0.25)) / 15.0 / (mean - 119.0)
        };
        (amplitude(0.4), amplitude(0.2))
    };
    let (alias, other) = take(&["--samples", "4"]);
    // The squares of the pixels pass sinc(0.8) = 0.23 of the contrast, the lens a part of it.
    assert!(alias > 0.005 && alias < 0.23, "{alias}");
    assert!(other < 0.3 * alias, "{alias} {other}");
    // Over the spectrum the samples are collected likewise.
    let (over_bands, _) = take(&["--samples", "4", "--qe", "imx219", "--three-band"]);
    assert!(over_bands > 0.005 && over_bands < 0.23, "{over_bands}");
}

#[test]
fn menon_leaves_less_false_colour_than_bilinear() {
    let folder = tempfile::tempdir().unwrap();
    let photo = data("photos/china.png").display().to_string();
    let take = |out: &str, more: &[&str]| {
        // The same blur, no noise: the pictures differ by the demosaic alone.
        let args = [
            "simulate",
            "--force",
            &photo,
            "--out",
            out,
            "--no-noise",
            "--place",
            "centre",
            "--size",
            "300x400",
        ];
        run_ok(folder.path(), &[&args[..], more].concat());
        image::open(folder.path().join(out).join("china-developed.png")).unwrap().to_rgb8()
    };
    let default = take("bilinear", &[]);
    let menon = take("menon", &["--demosaic", "menon", "--domain", "stabilised"]);
    // False colour alternates from pixel to pixel: it shows in the second difference of red minus green along the rows.
    assert_ne!(default, menon);
    let colour_noise = |picture: &image::RgbImage| {
        let (width, height) = picture.dimensions();
        let at = |x: u32, y: u32| {
            let p = picture.get_pixel(x, y);
            f64::from(p[0]) - f64::from(p[1])
        };
        let second = |x: u32, y: u32| (2.0 * at(x, y) - at(x - 1, y) - at(x + 1, y)).abs();
        (1..height - 1)
            .flat_map(|y| (1..width - 1).map(move |x| (x, y)))
            .map(|(x, y)| second(x, y))
            .sum::<f64>()
    };
    assert!(colour_noise(&menon) < 0.9 * colour_noise(&default));
    let wrong =
        ["simulate", "--force", &photo, "--sensor", "imx250-mono", "--demosaic", "menon", "--out", "x"];
    run_fails(folder.path(), &wrong, 2, &["--demosaic menon", "Bayer", "bilinear"]);
}

#[test]
fn restoration_brings_back_detail_that_the_lens_blurs() {
    let folder = tempfile::tempdir().unwrap();
    // A perfect lens 0.06 mm out of focus: a disc of 2.3 pixels.
    let soft = "name = \"soft\"\nsource = \"this test\"\nunits = \"mm\"\naperture = { entrance_pupil_diameter_mm = 5.7 }\n\
                object = { distance_mm = inf }\nwavelengths = { um = [0.486, 0.55, 0.62] }\nfields = { angle_deg = [0.0, 15.0] }\n\
                [[surface]]\nradius_mm = inf\nthickness_mm = 25.10\nsemi_diameter_mm = 2.85\nstop = true\n\
                thin_lens = { focal_length_mm = 25.04 }\n";
    std::fs::write(folder.path().join("soft.toml"), soft).unwrap();
    let photo = data("photos/china.png").display().to_string();
    let take = |out: &str, more: &[&str]| {
        let args = ["simulate", "--force", &photo, "--out", out, "--place", "centre", "--size", "200x300"];
        let lens =
            ["--lens", "soft.toml", "--no-distortion", "--demosaic", "menon", "--domain", "stabilised"];
        run_ok(folder.path(), &[&args[..], &lens, more].concat());
        image::open(folder.path().join(out).join("china-developed.png")).unwrap().to_rgb8()
    };
    let truth = image::open(&photo).unwrap().to_rgb8();
    let (left, top) = ((truth.width() - 300) / 2, (truth.height() - 200) / 2);
    let squares = |picture: &image::RgbImage| -> f64 {
        let inner = (20..180).flat_map(|y| (20..280).map(move |x| (x, y)));
        inner
            .map(|(x, y)| {
                let (a, b) = (picture.get_pixel(x, y), truth.get_pixel(left + x, top + y));
                (0..3).map(|c| (f64::from(a[c]) - f64::from(b[c])).powi(2)).sum::<f64>()
            })
            .sum()
    };
    let (blurred, restored) = (take("blurred", &[]), take("restored", &["--restore"]));
    assert!(squares(&restored) < 0.9 * squares(&blurred), "{} {}", squares(&restored), squares(&blurred));
    let wrong = ["simulate", "--force", &photo, "--restore=-1", "--out", "x"];
    run_fails(folder.path(), &wrong, 2, &["--restore", "0.003"]);
}

#[test]
fn an_image_signal_processor_undoes_shading_and_distortion_of_the_lens() {
    let folder = tempfile::tempdir().unwrap();
    // Gray with a white vertical line near the right edge, as a pinhole would show it.
    let line = image::RgbImage::from_fn(360, 240, |x, _| {
        image::Rgb([if (330..334).contains(&x) { 230 } else { 110 }; 3])
    });
    line.save(folder.path().join("line.png")).unwrap();
    let take = |more: &[&str]| {
        let args = ["simulate", "--force", "line.png", "--no-noise", "--isp", "neutral", "--out", "out"];
        run_ok(folder.path(), &[&args, more].concat());
        image::open(folder.path().join("out/line-isp.png")).unwrap().to_luma8()
    };
    let picture = take(&[]);
    assert_eq!(picture.dimensions(), (1920, 1200));
    // Its column of the brightest light at the top, in the middle and at the bottom; the line is blurred most in the corners.
    let column = |picture: &image::GrayImage, row: u32| {
        let (mut sum, mut all) = (0.0, 0.0);
        for x in 1650..1920 {
            let light = (f64::from(picture.get_pixel(x, row)[0]) - 160.0).max(0.0);
            (sum, all) = (sum + light * f64::from(x), all + light);
        }
        assert!(all > 0.0, "no line in row {row}");
        sum / all
    };
    let [top, middle, bottom] = [40, 600, 1160].map(|row| column(&picture, row));
    assert!((top - middle).abs() < 2.0 && (bottom - middle).abs() < 2.0, "{top} {middle} {bottom}");
    // Gray is as bright in the corner as in the middle.
    let gray = |x: u32, y: u32| {
        let mean: f64 = (0..400).map(|i| f64::from(picture.get_pixel(x + i % 20, y + i / 20)[0])).sum();
        mean / 400.0
    };
    assert!((gray(30, 30) - gray(950, 590)).abs() < 3.0, "{} {}", gray(30, 30), gray(950, 590));
    let wrong = ["simulate", "--force", "line.png", "--isp", "nowhere", "--out", "x"];
    run_fails(folder.path(), &wrong, 2, &["nowhere", "automotive"]);
    assert!(!folder.path().join("x").exists());
}
