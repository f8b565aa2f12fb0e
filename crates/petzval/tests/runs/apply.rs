//! Pictures of one's own through the cameras of a run.

use std::sync::Arc;

use petzval::camera::image::LinearImage;
use petzval::files::raw_file::load_raw;
use petzval::jobs::apply::{Cameras, Taking};
use petzval::jobs::{Context, Silent, built_in_assets};

use crate::common::{data, finished_run, run_fails, run_ok};

#[test]
fn own_pictures_go_whole_through_the_cameras_of_a_run() {
    let folder = tempfile::tempdir().unwrap();
    finished_run(folder.path());
    let photo = data("photos/coffee.png").display().to_string();

    // A photograph fills the sensor; every camera makes a picture of its own, and a page shows them side by side.
    let all = run_ok(folder.path(), &["apply", "run", &photo, "--out", "all", "--json"]).json();
    let cameras: Vec<&str> = all["pictures"]
        .as_array()
        .unwrap()
        .iter()
        .map(|picture| picture["camera"].as_str().unwrap())
        .collect();
    assert_eq!(cameras, ["nominal", "spot-optimised", "end-to-end"]);
    assert_eq!(all["pages"], serde_json::json!(["all/coffee-side-by-side.html"]));
    assert_eq!(all["others"], serde_json::json!(["all/coffee-scene.png"]));
    let page = std::fs::read_to_string(folder.path().join("all/coffee-side-by-side.html")).unwrap();
    // The scene and three cameras, whole and at three places.
    assert_eq!(page.matches("<img").count(), 16);
    assert!(["the scene", "nominal", "spot-optimised", "end-to-end"].iter().all(|name| page.contains(name)));
    let picture = |name: &str| image::open(folder.path().join(name)).unwrap().into_rgb8();
    let scene = picture("all/coffee-scene.png");
    let [nominal, designed] =
        ["nominal", "end-to-end"].map(|name| picture(&format!("all/coffee-{name}.png")));
    assert_eq!(scene.dimensions(), (1920, 1200));
    let mean_difference = |a: &image::RgbImage, b: &image::RgbImage| {
        let sum: f64 = a.iter().zip(b.iter()).map(|(a, b)| (f64::from(*a) - f64::from(*b)).abs()).sum();
        sum / a.len() as f64
    };
    for finished in [&nominal, &designed] {
        let off = mean_difference(finished, &scene);
        assert!(off > 0.1 && off < 12.0, "{off}");
    }
    assert!(mean_difference(&nominal, &designed) > 0.1);

    // A raw frame of the sensor, taken through the lens of the nominal camera, gives nearly what that camera makes of the photograph.
    let simulate = [
        "simulate",
        &photo,
        "--lens",
        "cooke-triplet-nominal",
        "--sensor",
        "imx249-fitted",
        "--white-e",
        "16000",
    ];
    run_ok(folder.path(), &[&simulate[..], &["--no-distortion", "--out", "taken"]].concat());
    let raw = ["apply", "run", "taken/coffee-raw.tiff", "--camera", "nominal", "--out", "raw"];
    let both = ["--camera", "end-to-end", "--json"];
    let done = run_ok(folder.path(), &[&raw[..], &both].concat()).json();
    assert_eq!(done["pictures"].as_array().unwrap().len(), 2, "{done}");
    let of_raw = picture("raw/coffee-raw-nominal.png");
    assert_eq!(of_raw.dimensions(), (1920, 1200));
    let off = mean_difference(&of_raw, &nominal);
    assert!(off < 4.0, "{off}");

    // In memory, the cameras make the same pictures, and write nothing.
    let context = Context::new(built_in_assets(), Arc::new(Silent));
    let nominal_alone = ["nominal".to_owned()];
    let cameras = Cameras::open(&folder.path().join("run"), &nominal_alone, "cpu", &[], &context).unwrap();
    assert_eq!(cameras.names(), nominal_alone);
    let light = petzval::files::load_image(&data("photos/coffee.png")).unwrap().light;
    let taken = cameras.take("nominal", &light, Taking::default()).unwrap();
    let frame = load_raw(&folder.path().join("taken/coffee-raw.tiff")).unwrap();
    let developed = cameras.develop("nominal", &frame).unwrap();
    assert_eq!(taken.picture, taken.shown);
    for (finished, file) in [(taken, &nominal), (developed, &of_raw)] {
        let LinearImage { width, .. } = finished.shown;
        for (x, y, pixel) in file.enumerate_pixels() {
            for (colour, code) in pixel.0.into_iter().enumerate() {
                let value = 255.0 * finished.shown.plane(colour)[y as usize * width + x as usize];
                assert!((value - f32::from(code)).abs() < 0.501, "{x}, {y}: {value}, not {code}");
            }
        }
    }
    for (error, says) in [
        (
            cameras.take("end-to-end", &light, Taking::default()).unwrap_err(),
            "no camera of this name was opened",
        ),
        (
            cameras.take("nominal", &LinearImage::zeros(1, 8, 8), Taking::default()).unwrap_err(),
            "a picture of 1 planes",
        ),
    ] {
        assert!(error.to_string().contains(says), "{error}");
    }

    // What cannot be applied is named before anything is written.
    for (args, needles) in [
        (
            &["apply", "run", photo.as_str(), "--camera", "best"][..],
            &["there is no finished camera", "nominal"][..],
        ),
        (&["apply", "run", "none.png"], &["none.png"]),
        (&["apply", "none", &photo], &["none"]),
        (&["apply", "run", &photo, &photo], &["another picture has this name too"]),
        (
            &["apply", "run", &photo, "--camera", "nominal", "--camera", "end-to-end", "--out", "all"],
            &["coffee-nominal.png: exists already"],
        ),
    ] {
        run_fails(folder.path(), args, 2, needles);
    }
    let text = std::fs::read_to_string(folder.path().join("taken/coffee-raw.tiff.toml")).unwrap();
    std::fs::write(folder.path().join("taken/coffee-raw.tiff.toml"), text.replace("RGGB", "BGGR")).unwrap();
    run_fails(folder.path(), &[&raw[..6], &["again"]].concat(), 2, &["its colour filters are not RGGB"]);
}
