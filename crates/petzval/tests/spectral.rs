//! `petzval simulate` over the spectrum: built-in scenes, spectral images, photographs under a light.

mod common;

use std::path::Path;

use common::{data, run_fails, run_ok};
use image::{DynamicImage, Rgb};

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
    for light in ["D65", "A", "daylight:5000"] {
        let args = [
            "simulate",
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
        assert_eq!(chart["bands_um"].as_array().unwrap().len(), 12);
        assert!(chart["colour_matrix"]["mean_delta_e_1976"].as_f64().unwrap() < 12.0);
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

#[test]
fn a_spectral_file_is_exposed_as_the_scene_that_it_holds() {
    let folder = tempfile::tempdir().unwrap();
    let sensor = small_sensor(folder.path(), "");
    // Two bands of 12x19 pixels, bright on the right.
    let values: Vec<f32> = (0..2 * 12 * 19).map(|i| if i % 19 > 9 { 0.002 } else { 0.0002 }).collect();
    {
        use npyz::WriterBuilder;
        let file = std::fs::File::create(folder.path().join("cube.npy")).unwrap();
        let mut writer =
            npyz::WriteOptions::new().default_dtype().shape(&[2, 12, 19]).writer(file).begin_nd().unwrap();
        writer.extend(values).unwrap();
        writer.finish().unwrap();
    }
    let args = ["simulate", "cube.npy", "--sensor", &sensor, "--json", "--no-noise"];
    run_fails(folder.path(), &args, 2, &["cube.toml", "wavelength_um"]);
    std::fs::write(folder.path().join("cube.toml"), "wavelength_um = [0.45, 0.65]\n").unwrap();
    let out = run_ok(folder.path(), &args).json();
    assert_eq!(out[0]["bands_um"], serde_json::json!([0.45, 0.65]));
    let raw = image::open(folder.path().join("cube-raw.tiff")).unwrap().to_luma16();
    let (dim, bright) =
        (f64::from(raw.get_pixel(41, 60)[0]) - 120.6, f64::from(raw.get_pixel(151, 60)[0]) - 120.6);
    assert!((bright / dim - 10.0).abs() < 1.0, "{bright} {dim}");
}

#[test]
fn what_cannot_be_simulated_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let sensor = small_sensor(folder.path(), "");
    let broken = folder.path().join("lamp.csv");
    std::fs::write(&broken, "wavelength_nm,power\n400,1\n500,x\n").unwrap();
    let chart = "scene:colorchecker";
    for (args, needles) in [
        (&[chart][..], ["no quantum efficiency curves", "--qe"]),
        (&["scene:moon", "--sensor", &sensor], ["no scene called `moon`", "scene:siemens-star"]),
        (&[chart, "--sensor", &sensor, "--illuminant", "D66"], ["no illuminant called `D66`", "D65"]),
        (&[chart, "--sensor", &sensor, "--illuminant", "daylight:1"], ["daylight of 1 K", "4000"]),
        (&[chart, "--sensor", &sensor, "--illuminant", "lamp.csv"], ["lamp.csv:3", "`x`"]),
        (&[chart, "--sensor", &sensor, "--illuminance-lux=-5"], ["--illuminance-lux -5", "office"]),
        (&[chart, "--sensor", &sensor, "--bands", "1"], ["--bands 1", "2..401"]),
        (&[chart, "--sensor", &sensor, "--transmission", "2"], ["--transmission 2", "0..1"]),
        (&[chart, "--qe", "no-such"], ["no quantum efficiency called `no-such`", "imx219"]),
        (&[chart, chart, "--sensor", &sensor], ["another image is called `colorchecker`", "--out"]),
    ] {
        run_fails(folder.path(), &[&["simulate"], args].concat(), 2, &needles);
    }
    let wrong = small_sensor(folder.path(), "alpha = 0\n");
    run_fails(
        folder.path(),
        &["simulate", chart, "--sensor", &wrong],
        2,
        &["small.toml", "alpha", "a factor"],
    );
}
