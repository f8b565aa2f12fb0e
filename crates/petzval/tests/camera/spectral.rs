//! `petzval simulate` over the spectrum: built-in scenes, spectral images, photographs under a light.

use std::path::Path;

use crate::common::{data, run_fails, run_ok};
use image::{DynamicImage, Rgb};
use petzval::camera::spectral::{
    ChartData, Illuminant, PixelOptics, Spectrum, apply, bradford, colour_checker, d65_white, delta_e_1976,
    lab, xyz_of_reflectance,
};
use petzval::optics::analysis::image_f_number;
use petzval::optics::lens::{Lens, ObjectDistance};
use petzval::optics::solve::with_paraxial_focus;

/// A sensor of 192x120 pixels with the curves of the IMX219, so that a test takes no time.
fn small_sensor(folder: &Path, more: &str) -> String {
    let text = std::fs::read_to_string(data("sensors/imx249-fitted.toml")).unwrap();
    let curves = std::fs::read_to_string(data("quantum-efficiency/imx219.toml")).unwrap();
    let text = text.replace("height = 1200", "height = 120").replace("width = 1920", "width = 192");
    let path = folder.join("small.toml");
    std::fs::write(&path, format!("{text}\n[quantum_efficiency]\n{curves}{more}")).unwrap();
    path.display().to_string()
}

fn developed(path: &Path) -> image::RgbImage {
    let picture = image::open(path).unwrap();
    assert!(matches!(picture, DynamicImage::ImageRgb8(_)));
    picture.to_rgb8()
}

fn mean(picture: &image::RgbImage, rows: std::ops::Range<u32>, cols: std::ops::Range<u32>) -> [f64; 3] {
    let mut sum = [0.0; 3];
    let n = f64::from((rows.end - rows.start) * (cols.end - cols.start));
    for y in rows {
        for x in cols.clone() {
            let Rgb(rgb) = picture.get_pixel(x, y);
            (0..3).for_each(|c| sum[c] += f64::from(rgb[c]) / n);
        }
    }
    sum
}

#[test]
fn the_colour_checker_has_its_colours_under_any_light() {
    let folder = tempfile::tempdir().unwrap();
    let sensor = small_sensor(folder.path(), "");
    for (light, matrix_mean) in [("D65", 3.70), ("A", 5.38), ("daylight:5000", 3.82)] {
        let args = [
            "simulate",
            "--force",
            "scene:colorchecker",
            "--sensor",
            &sensor,
            "--illuminant",
            light,
            "--illuminance-lux",
            "1000",
        ];
        let out =
            run_ok(folder.path(), &[&args[..], &["--bands", "12", "--out", "chart", "--json"]].concat())
                .json();
        let chart = &out[0];
        assert_eq!(
            (chart["image"].as_str(), chart["illuminance_lux"].as_f64()),
            (Some("colorchecker"), Some(1000.0))
        );
        assert!(chart["white_e"].as_f64().unwrap() > 1000.0);
        // The requested time, not the 32-bit float next to it.
        assert_eq!(chart["time_s"].as_f64(), Some(0.005));
        assert_eq!(chart["bands_um"].as_array().unwrap().len(), 12);
        let fitted = chart["colour_matrix"]["mean_delta_e_1976"].as_f64().unwrap();
        assert!((fitted - matrix_mean).abs() < 0.2, "{light}: {fitted}");
        let picture = developed(&folder.path().join("chart/colorchecker-developed.png"));
        assert_eq!((picture.width(), picture.height()), (192, 120));
        // Cells of 25.7 pixels, from row 5.6 and column 16.3 on: white, and the blue, green, red of the third row.
        let patch = |row: u32, col: u32| {
            let (y, x) = (6 + 26 * row + 12, 16 + 26 * col + 12);
            mean(&picture, y..y + 6, x..x + 6)
        };
        let white = patch(3, 0);
        assert!(white.iter().all(|v| (v - 243.0).abs() < 12.0), "{light}: white {white:?}");
        let (blue, green, red) = (patch(2, 0), patch(2, 1), patch(2, 2));
        assert!(
            blue[2] > 1.4 * blue[0] && green[1] > 1.3 * green[0] && red[0] > 2.0 * red[2],
            "{light}: {blue:?} {green:?} {red:?}"
        );
    }
}

#[test]
fn twice_the_light_gives_twice_the_electrons_and_noise_is_keyed_by_the_seed() {
    let folder = tempfile::tempdir().unwrap();
    let sensor = small_sensor(folder.path(), "");
    let take = |out: &str, lux: &str, more: &[&str]| {
        let args = [
            "simulate",
            "--force",
            "scene:flat",
            "--sensor",
            &sensor,
            "--illuminance-lux",
            lux,
            "--bands",
            "6",
            "--out",
            out,
            "--json",
        ];
        run_ok(folder.path(), &[&args[..], more].concat()).json()[0]["white_e"].as_f64().unwrap()
    };
    let one = take("one", "300", &["--seed", "4"]);
    let (again, two) = (take("again", "300", &["--seed", "4", "--threads", "1"]), take("two", "600", &[]));
    assert_eq!(one, again);
    assert!((two / one - 2.0).abs() < 1e-9);
    let glass = take("glass", "300", &["--transmission", "0.5"]);
    assert!((glass / one - 0.5).abs() < 1e-9);
    let bytes = |out: &str| std::fs::read(folder.path().join(out).join("flat-raw.tiff")).unwrap();
    assert!(bytes("one") == bytes("again") && bytes("one") != bytes("two"));

    // On the axis the green pixels hold the electrons that were reported, less what the axial relative illumination of the
    // lens takes: 1.4 % in the bands where these curves are.
    take("clean", "300", &["--no-noise"]);
    let raw = image::open(folder.path().join("clean/flat-raw.tiff")).unwrap().to_luma16();
    let green_e = (f64::from(raw.get_pixel(97, 60)[0]) - 119.0 - 1.15) / 0.14 - 3.25 - 25.0 * 0.005;
    let illumination = green_e / one;
    // Half a digital number is 0.1 % here.
    assert!((illumination - 0.9855).abs() < 0.003, "{illumination}");
}

/// By the radiance that no lens changes, the light on the axis is that of the real cone: `pi L sin^2 U'`. With the tangent in place of the sine a
/// lens of f/2 had 7 % too little.
#[test]
fn light_on_the_axis_is_that_of_the_real_cone() {
    let folder = tempfile::tempdir().unwrap();
    let sensor = small_sensor(folder.path(), "");
    for lens in ["eight-element-achromat", "cooke-triplet-fast", "cooke-triplet-nominal"] {
        let shown = run_ok(folder.path(), &["lens", "show", lens, "--json"]).json();
        let sine = 0.5 / shown["working_f_number"].as_f64().unwrap();
        let args = ["simulate", "--force", "scene:flat", "--sensor", &sensor, "--lens", lens, "--no-noise"];
        let args =
            [&args[..], &["--qe", "flat:0.6", "--illuminance-lux", "200", "--out", lens, "--json"]].concat();
        let out = run_ok(folder.path(), &args).json();
        let f_number = out[0]["f_number"].as_f64().unwrap();
        let raw = image::open(folder.path().join(lens).join("flat-raw.tiff")).unwrap().to_luma16();
        let green_e = (f64::from(raw.get_pixel(97, 60)[0]) - 119.0 - 1.15) / 0.14 - 3.25 - 25.0 * 0.005;
        let optics =
            PixelOptics { pixel_um: 5.86, f_number, time_s: f64::from(0.005f32), transmission: None };
        let light = Illuminant::named("D65").unwrap().white_radiance(200.0);
        let efficiency = Spectrum::new(vec![0.3, 1.1], vec![0.6, 0.6]).unwrap();
        let electrons_per_joule = optics.electrons(&light, &efficiency) / optics.throughput();
        let exact_e = electrons_per_joule * 5.86e-6f64.powi(2) * 0.005 * std::f64::consts::PI * sine * sine;
        // The PSFs count light by the image scale of chief rays, which is that of the whole pupil within 1 %.
        assert!((green_e / exact_e - 1.0).abs() < 0.012, "{lens}: {green_e} of {exact_e} electrons");
    }
}

/// CIELAB differences of the 24 patches of a developed chart of 192x120 pixels from the colours that they have under the
/// light, seen by an eye adapted to D65.
fn patch_differences(npy: &Path, light: &str) -> Vec<f64> {
    let bytes = std::fs::read(npy).unwrap();
    let array = npyz::NpyFile::new(&bytes[..]).unwrap();
    assert_eq!(array.shape(), [3, 120, 192]);
    let picture = array.into_vec::<f32>().unwrap();
    let light = Illuminant::named(light).unwrap();
    let even = Spectrum::new(vec![0.38, 0.78], vec![1.0, 1.0]).unwrap();
    let (d65, to_xyz, _) = d65_white();
    let adapt = bradford(xyz_of_reflectance(&even, &light.power), d65);
    let difference = |(i, (_, reflectance)): (usize, &(String, Spectrum))| {
        let (y, x) = (6 + 26 * (i / 6) + 12, 16 + 26 * (i % 6) + 12);
        let shown = [0, 1, 2].map(|c| {
            let pixels = (y..y + 6).flat_map(|y| (x..x + 6).map(move |x| (c * 120 + y) * 192 + x));
            pixels.map(|i| f64::from(picture[i])).sum::<f64>() / 36.0
        });
        let target = apply(&adapt, xyz_of_reflectance(reflectance, &light.power));
        delta_e_1976(lab(apply(&to_xyz, shown), d65), lab(target, d65))
    };
    colour_checker(ChartData::Ohta).iter().enumerate().map(difference).collect()
}

#[test]
fn the_colour_errors_of_developed_patches_equal_the_printed_ones() {
    let folder = tempfile::tempdir().unwrap();
    let sensor = small_sensor(folder.path(), "");
    std::fs::write(
        folder.path().join("yellow.csv"),
        "wavelength_nm,tau\n400,0.02\n480,0.1\n520,0.9\n700,0.95\n",
    )
    .unwrap();
    let mut means = Vec::new();
    let runs: [(&str, &[&str]); 4] =
        [("D65", &[]), ("A", &[]), ("D65", &["--transmission", "yellow.csv"]), ("FL11", &["--bands", "31"])];
    for (light, more) in runs {
        let args = ["simulate", "--force", "scene:colorchecker", "--sensor", &sensor, "--illuminant", light];
        let rest = ["--illuminance-lux", "1000", "--no-noise", "--picture-format", "npy", "--json"];
        let out = run_ok(folder.path(), &[&args[..], &rest, more].concat()).json();
        let said = &out[0]["colour_matrix"];
        let found = patch_differences(&folder.path().join("colorchecker-developed.npy"), light);
        let mean = found.iter().sum::<f64>() / 24.0;
        let (mean_said, worst_said) = (&said["mean_delta_e_1976"], &said["worst_delta_e_1976"]);
        // Whole digital numbers and the lens, whose illumination depends on the wavelength, make up for the rest.
        assert!((mean - mean_said.as_f64().unwrap()).abs() < 0.4, "{light} {more:?}: {mean} {mean_said}");
        let worst = found.iter().copied().fold(0.0, f64::max);
        assert!((worst - worst_said.as_f64().unwrap()).abs() < 1.5, "{light} {more:?}: {worst} {worst_said}");
        means.push(mean);
    }
    assert!(means[2] > means[0] + 5.0, "a yellow glass costs colours: {means:?}");
}

/// Writes a spectral image of 12x19 pixels as `NAME.npy`.
fn write_cube(folder: &Path, name: &str, bands: u64, value: impl Fn(usize) -> f32) {
    use npyz::WriterBuilder;
    let file = std::fs::File::create(folder.join(format!("{name}.npy"))).unwrap();
    let mut writer =
        npyz::WriteOptions::new().default_dtype().shape(&[bands, 12, 19]).writer(file).begin_nd().unwrap();
    writer.extend((0..bands as usize * 12 * 19).map(value)).unwrap();
    writer.finish().unwrap();
}

#[test]
fn a_spectral_file_is_exposed_as_the_scene_that_it_holds() {
    let folder = tempfile::tempdir().unwrap();
    let sensor = small_sensor(folder.path(), "");
    // Two bands, bright on the right.
    write_cube(folder.path(), "cube", 2, |i| if i % 19 > 9 { 0.002 } else { 0.0002 });
    let args = ["simulate", "--force", "cube.npy", "--sensor", &sensor, "--json", "--no-noise"];
    run_fails(folder.path(), &args, 2, &["cube.toml", "wavelength_um"]);
    std::fs::write(folder.path().join("cube.toml"), "wavelength_um = [0.45, 0.65]\n").unwrap();
    let outcome = run_ok(folder.path(), &args);
    assert!(outcome.says("cube.npy: the bands, 450 to 650 nm, leave out"), "{}", outcome.stderr);
    let out = outcome.json();
    assert_eq!(out[0]["bands_um"], serde_json::json!([0.45, 0.65]));
    let raw = image::open(folder.path().join("cube-raw.tiff")).unwrap().to_luma16();
    let electrons =
        |x: u32, y: u32| (f64::from(raw.get_pixel(x, y)[0]) - 119.0 - 1.15) / 0.14 - 3.25 - 25.0 * 0.005;

    // Bright pixels: L A t pi / (4 F^2) int QE l / (h c) dl, with L constant from 450 to 650 nm, by the midpoint rule.
    let curves: toml::Table =
        std::fs::read_to_string(data("quantum-efficiency/imx219.toml")).unwrap().parse().unwrap();
    let list = |key: &str| -> Vec<f64> {
        curves[key].as_array().unwrap().iter().map(|v| v.as_float().unwrap()).collect()
    };
    let wavelength_um = list("wavelength_um");
    let expected = |key: &str| {
        let curve = list(key);
        let at = |um: f64| {
            let i = wavelength_um.partition_point(|w| *w <= um) - 1;
            let share = (um - wavelength_um[i]) / (wavelength_um[i + 1] - wavelength_um[i]);
            curve[i] * (1.0 - share) + curve[i + 1] * share
        };
        let nm_um: f64 =
            (0..2000).map(|k| 450.05 + 0.1 * f64::from(k)).map(|nm| 0.1 * at(nm / 1e3) * nm / 1e3).sum();
        let f_number = out[0]["f_number"].as_f64().unwrap();
        let throughput = (5.86e-6f64).powi(2) * 0.005 * std::f64::consts::PI / (4.0 * f_number * f_number);
        0.002 * throughput * nm_um * 1e-6 / (6.626_070_15e-34 * 299_792_458.0)
    };
    // RGGB: row 60 is red and green, row 61 green and blue; the lens takes 1.5 % on the axis.
    for (key, x, y) in [("red", 150, 60), ("green", 151, 60), ("green", 150, 61), ("blue", 151, 61)] {
        let (got, ideal) = (electrons(x, y), 0.9855 * expected(key));
        assert!((got / ideal - 1.0).abs() < 0.006, "{key}: {got} electrons, {ideal} expected");
        assert!((electrons(x - 110, y) / ideal - 0.1).abs() < 0.003, "{key}: {}", electrons(x - 110, y));
    }
}

#[test]
fn bands_without_response_are_named_or_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let sensor = small_sensor(folder.path(), "");
    let cube = |name: &str, wavelengths: &str| {
        write_cube(folder.path(), name, 3, |_| 0.002);
        let text = format!("wavelength_um = {wavelengths}\n");
        std::fs::write(folder.path().join(format!("{name}.toml")), text).unwrap();
    };
    cube("heat", "[5.0, 7.5, 10.0]");
    run_fails(
        folder.path(),
        &["simulate", "--force", "heat.npy", "--sensor", &sensor],
        2,
        &["heat.npy", "5000 to 10000 nm"],
    );
    // In the last band no pixel responds and no ray passes.
    cube("far", "[0.5, 0.7, 20.0]");
    run_ok(folder.path(), &["simulate", "--force", "far.npy", "--sensor", &sensor, "--no-noise"]);
    let args = ["simulate", "--force", "far.npy", "--sensor", &sensor, "--bands", "8"];
    run_fails(folder.path(), &args, 2, &["--bands 8", "far.npy has bands of its own"]);
}

#[test]
fn three_bands_are_the_integral_of_many() {
    let folder = tempfile::tempdir().unwrap();
    let sensor = small_sensor(folder.path(), "");
    image::RgbImage::from_pixel(192, 120, Rgb([220, 90, 40])).save(folder.path().join("rust.png")).unwrap();
    let take = |out: &str, more: &[&str]| {
        let args =
            ["simulate", "--force", "rust.png", "--sensor", &sensor, "--no-noise", "--json", "--out", out];
        let facts = run_ok(folder.path(), &[&args[..], more].concat()).json()[0].clone();
        let raw = image::open(folder.path().join(out).join("rust-raw.tiff")).unwrap().to_luma16();
        let dn = |x, y| f64::from(raw.get_pixel(x, y)[0]) - 120.6;
        (facts, [dn(96, 60), dn(97, 60), dn(97, 61)])
    };
    let (many, slow) = take("many", &["--illuminant", "A", "--illuminance-lux", "2000"]);
    let (three, fast) = take("three", &["--illuminant", "A", "--illuminance-lux", "2000", "--three-band"]);
    assert_eq!((many["three_band"].as_bool(), three["three_band"].as_bool()), (Some(false), Some(true)));
    assert_eq!(many["white_e"], three["white_e"]);
    for (a, b) in slow.iter().zip(&fast) {
        // One per cent, and half a digital number of rounding in each.
        assert!((a - b).abs() < 0.01 * b + 1.0, "{slow:?} {fast:?}");
    }
    // The plain path keeps red light out of green and blue pixels altogether; the filters do not.
    let white_e = many["white_e"].as_f64().unwrap().to_string();
    let (_, plain) = take("plain", &["--white-e", &white_e]);
    assert!(fast[2] > 1.3 * plain[2] / 1.25 * many["relative_qe"][2].as_f64().unwrap(), "{fast:?} {plain:?}");
    run_fails(
        folder.path(),
        &["simulate", "--force", "scene:flat", "--sensor", &sensor, "--three-band"],
        2,
        &["--three-band"],
    );
}

#[test]
fn a_near_object_gives_the_light_of_the_working_f_number() {
    let folder = tempfile::tempdir().unwrap();
    let sensor = small_sensor(folder.path(), "");
    let text = std::fs::read_to_string(data("lenses/cooke-triplet-nominal.toml")).unwrap();
    let assets = petzval::built_in_assets();
    let far = assets.lens("cooke-triplet-nominal").unwrap().lens;
    let near = Lens { object: ObjectDistance::Finite(150.0), ..far.clone() };
    let focused = with_paraxial_focus(&near, 0.0);
    let gap = focused.surfaces.last().unwrap().thickness_mm;
    let text = text
        .replace("distance_mm = inf", "distance_mm = 150.0")
        .replace("24.525171110552694", &gap.to_string());
    let expect = text.find("[expect]").unwrap();
    let solve = text.find("[[variable]]").unwrap();
    std::fs::write(folder.path().join("near.toml"), &text[..solve.min(expect)]).unwrap();
    let take = |lens: &str| {
        let args = [
            "simulate",
            "--force",
            "scene:flat",
            "--sensor",
            &sensor,
            "--lens",
            lens,
            "--json",
            "--no-noise",
        ];
        let out = run_ok(folder.path(), &args).json();
        (out[0]["f_number"].as_f64().unwrap(), out[0]["white_e"].as_f64().unwrap())
    };
    let ((f_far, e_far), (f_near, e_near)) = (take("cooke-triplet-nominal"), take("near.toml"));
    let cone = image_f_number(&focused);
    assert!((f_near / cone - 1.0).abs() < 1e-6 && f_near > 1.1 * f_far, "{f_near} {f_far}");
    let ratio = (f_far / f_near).powi(2);
    assert!((e_near / e_far / ratio - 1.0).abs() < 1e-9, "{e_near} {e_far}");
}

#[test]
fn infrared_counts_where_the_pixels_respond() {
    let folder = tempfile::tempdir().unwrap();
    let sensor = small_sensor(folder.path(), "").replace("small.toml", "mono.toml");
    let text = std::fs::read_to_string(folder.path().join("small.toml")).unwrap();
    let text = &text[..text.find("[quantum_efficiency]").unwrap()];
    std::fs::write(folder.path().join("mono.toml"), text.replace("\"RGGB\"", "\"mono\"")).unwrap();
    let args = ["simulate", "--force", "scene:flat", "--sensor", &sensor, "--no-noise"];
    // There is no built-in curve for clear pixels, and the hint does not suggest one.
    let outcome = run_fails(folder.path(), &args, 2, &["no quantum efficiency curves", "flat:0.6"]);
    assert!(!outcome.says("imx219"), "{}", outcome.stderr);
    let take = |more: &[&str]| {
        let out = run_ok(folder.path(), &[&args[..], &["--qe", "flat:0.6", "--json"], more].concat()).json();
        out[0].clone()
    };
    let bulb = take(&["--illuminant", "blackbody:2856"]);
    let bands = bulb["bands_um"].as_array().unwrap();
    assert_eq!((bands.len(), bands[0].as_f64(), bands[40].as_f64()), (41, Some(0.3), Some(1.1)));
    // The closed form: 0.6 of the photons of Planck's law from 300 to 1100 nm.
    let f_number = bulb["f_number"].as_f64().unwrap();
    let optics = PixelOptics { pixel_um: 5.86, f_number, time_s: f64::from(0.005f32), transmission: None };
    let radiance = Illuminant::named("blackbody:2856").unwrap().white_radiance(500.0);
    let efficiency = Spectrum::new(vec![0.3, 1.1], vec![0.6, 0.6]).unwrap();
    let exact = optics.electrons(&radiance, &efficiency);
    assert!((bulb["white_e"].as_f64().unwrap() / exact - 1.0).abs() < 3e-3, "{exact} {bulb}");
    // The table of D65 ends at 780 nm, where the pixels still respond.
    let day = run_ok(folder.path(), &[&args[..], &["--qe", "flat:0.6"]].concat());
    assert!(day.says("nothing is known of D65 beyond 780 nm"), "{}", day.stderr);
    // So does that of a filter, unless it ends at nothing.
    for (end, is_warned) in [("0.9", true), ("0.0", false)] {
        let table = format!("wavelength_nm,transmission\n400,0.0\n450,0.9\n640,0.9\n650,{end}\n");
        std::fs::write(folder.path().join("filter.csv"), table).unwrap();
        let filter = ["--qe", "flat:0.6", "--illuminant", "blackbody:2856", "--transmission", "filter.csv"];
        let seen = run_ok(folder.path(), &[&args[..], &filter].concat());
        assert_eq!(
            seen.says("nothing is known of the transmission beyond 650 nm"),
            is_warned,
            "{end}: {}",
            seen.stderr
        );
        assert!(!seen.says("beyond 400 nm"), "{}", seen.stderr);
    }
}

#[test]
fn what_cannot_be_simulated_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let sensor = small_sensor(folder.path(), "");
    let broken = folder.path().join("lamp.csv");
    std::fs::write(&broken, "wavelength_nm,power\n400,1\n500,x\n").unwrap();
    let chart = "scene:colorchecker";
    let file = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    file("two.csv", "wavelength_nm,a,b\n400,1,2\n700,1,2\n");
    let text = std::fs::read_to_string(&sensor).unwrap();
    file("lacking.toml", &text.replace("\"RGGB\"", "\"RG/GR\""));
    file(
        "huge.toml",
        &text.replace("height = 120", "height = 60000").replace("width = 192", "width = 60000"),
    );
    image::RgbImage::from_pixel(20, 20, Rgb([220, 90, 40])).save(folder.path().join("rust.png")).unwrap();
    write_cube(folder.path(), "cube", 2, |_| 0.002);
    file("bad.csv", "wavelength_nm,red,green,blue\n400,0.1,0.1,0.5\n700,50,10,5\n");
    let stepped = text.replacen("bits = ", "gain_steps = [1.0, 2.0]\nbits = ", 1);
    std::fs::write(&sensor, stepped).unwrap();
    for (args, needles) in [
        (&[chart][..], ["no quantum efficiency curves", "--qe (imx219, ov5647 are built in"]),
        (&[chart, "--qe", "flat:1.5"], ["--qe flat:1.5", "flat:0.6"]),
        (
            &[chart, "--sensor", &sensor, "--white-e", "9000", "--illuminance-lux", "500"],
            ["--white-e 9000: --illuminance-lux 500", "leave one of the two out"],
        ),
        (
            &["cube.npy", "--sensor", &sensor, "--white-e", "9000"],
            ["--white-e 9000: cube.npy has radiances", "--time-s"],
        ),
        (&["scene:foo"], ["no scene called `foo`", "scene:colorchecker"]),
        (&[chart, "--qe", "bad.csv"], ["bad.csv:3", "percent"]),
        (&[chart, "--sensor", &sensor, "--transmission", "0"], ["--transmission 0: no light", "above 0"]),
        (
            &[chart, "--sensor", &sensor, "--illuminance-lux", "1e-300"],
            ["1e-300 lux (--illuminance-lux)", "--time-s"],
        ),
        (
            &[chart, "--sensor", &sensor, "--illuminant", "two.csv"],
            ["two.csv: 2 curves (a, b)", "two columns"],
        ),
        (&[chart, "--sensor", &sensor, "--gain", "1.5", "--out", "new"], ["gain", "1.5"]),
        (&[chart, "--sensor", "lacking.toml", "--out", "new"], ["blue", "RG/GR"]),
        (&["cube.npy", "--sensor", "huge.toml"], ["huge.toml", "60000 x 60000"]),
        (&["rust.png", "--bands", "8"], ["no quantum efficiency curves", "--qe"]),
        (&["rust.png", "--no-colour-matrix"], ["no quantum efficiency curves", "--qe"]),
        (&["scene:moon", "--sensor", &sensor], ["no scene called `moon`", "scene:siemens-star"]),
        (&[chart, "--sensor", &sensor, "--illuminant", "D66"], ["no illuminant called `D66`", "D65"]),
        (&[chart, "--sensor", &sensor, "--illuminant", "daylight:1"], ["daylight of 1 K", "4000"]),
        (&[chart, "--sensor", &sensor, "--illuminant", "lamp.csv"], ["lamp.csv:3", "`x`"]),
        (
            &[chart, "--sensor", &sensor, "--illuminant", "lost.csv"],
            ["lost.csv: there is no such file", "D65"],
        ),
        (&[chart, "--sensor", &sensor, "--illuminance-lux=-5"], ["--illuminance-lux -5", "office"]),
        (
            &[chart, "--sensor", &sensor, "--bands", "1"],
            ["--bands 1: must lie between 2 and 401", "16 bands"],
        ),
        (&[chart, "--sensor", &sensor, "--transmission", "2"], ["--transmission 2", "0..1"]),
        (&[chart, "--qe", "no-such"], ["no quantum efficiency called `no-such`", "imx219"]),
        (&[chart, chart, "--sensor", &sensor], ["another image is called `colorchecker`", "--out"]),
    ] {
        run_fails(folder.path(), &[&["simulate", "--force"], args].concat(), 2, &needles);
    }
    let wrong = small_sensor(folder.path(), "alpha = 0\n");
    run_fails(
        folder.path(),
        &["simulate", "--force", chart, "--sensor", &wrong],
        2,
        &["small.toml", "alpha", "a factor"],
    );
}

#[test]
fn built_in_names_come_before_files() {
    let folder = tempfile::tempdir().unwrap();
    let sensor = small_sensor(folder.path(), "");
    // A file called as an illuminant is not taken for it; any other file is read.
    std::fs::write(folder.path().join("A"), "nm,power\n400,1\n700,0.01\n").unwrap();
    std::fs::write(folder.path().join("blue"), "nm,power\n400,1\n700,0.01\n").unwrap();
    let relative = |light: &str| {
        let args =
            ["simulate", "--force", "scene:flat", "--sensor", &sensor, "--illuminant", light, "--json"];
        run_ok(folder.path(), &args).json()[0]["relative_qe"][2].as_f64().unwrap()
    };
    let (bulb, blue) = (relative("A"), relative("blue"));
    assert!(blue > 2.0 * bulb, "{bulb} {blue}");
}

#[test]
fn pixels_that_do_not_distinguish_colours_give_a_picture_without_a_matrix() {
    let folder = tempfile::tempdir().unwrap();
    let sensor = small_sensor(folder.path(), "");
    let args = ["simulate", "--force", "scene:flat", "--sensor", &sensor, "--qe", "flat:0.5", "--no-noise"];
    let outcome = run_ok(folder.path(), &args);
    assert!(outcome.says("there is no colour matrix"), "{}", outcome.stderr);
    let picture = developed(&folder.path().join("flat-developed.png"));
    let centre = mean(&picture, 50..70, 80..110);
    assert!(centre.iter().all(|v| *v > 245.0), "{centre:?}");
}

#[test]
fn electrons_of_white_set_the_illuminance() {
    let folder = tempfile::tempdir().unwrap();
    let sensor = small_sensor(folder.path(), "");
    let take = |more: &[&str]| {
        let args = ["simulate", "--force", "scene:flat", "--sensor", &sensor, "--no-noise", "--json"];
        run_ok(folder.path(), &[&args[..], more].concat()).json()[0].clone()
    };
    let number = |facts: &serde_json::Value, key: &str| facts[key].as_f64().unwrap();
    let (scaled, plain) = (take(&["--white-e", "9000"]), take(&[]));
    assert!((number(&scaled, "white_e") - 9000.0).abs() < 1e-6, "{scaled}");
    let lux = 500.0 * 9000.0 / number(&plain, "white_e");
    assert!((number(&scaled, "illuminance_lux") / lux - 1.0).abs() < 1e-9, "{scaled} {lux}");
}

#[test]
fn curves_in_a_table_are_those_of_the_toml_file() {
    let folder = tempfile::tempdir().unwrap();
    let sensor = small_sensor(folder.path(), "");
    let curves: toml::Table =
        toml::from_str(&std::fs::read_to_string(data("quantum-efficiency/imx219.toml")).unwrap()).unwrap();
    let column = |key: &str| -> Vec<f64> {
        curves[key].as_array().unwrap().iter().map(|v| v.as_float().unwrap()).collect()
    };
    let [um, red, green, blue] = ["wavelength_um", "red", "green", "blue"].map(column);
    let lines = (0..um.len()).map(|i| format!("{},{},{},{}\n", 1e3 * um[i], red[i], green[i], blue[i]));
    let table = format!("wavelength_nm,red,green,blue\n{}", lines.collect::<String>());
    std::fs::write(folder.path().join("curves.csv"), table).unwrap();
    let white = |qe: &str| {
        let args = ["simulate", "--force", "scene:flat", "--sensor", &sensor, "--qe", qe, "--json"];
        run_ok(folder.path(), &args).json()[0]["white_e"].as_f64().unwrap()
    };
    assert!((white("curves.csv") / white("imx219") - 1.0).abs() < 1e-9);
}
