//! Fields of 90 degrees and more: a fisheye lens through the commands that read, trace, analyse and photograph.

use std::fmt::Write;
use std::path::Path;

use crate::common::{data, run_fails, run_ok};

/// Writes a fisheye lens of 6 mm with fields to `full_deg`; `object` is the distance of the object in mm, or `inf`.
fn write_fisheye(folder: &Path, name: &str, object: &str, full_deg: f64) {
    let mut text = format!(
        "name = \"Fisheye lens of 6 mm\"\nsource = \"this test\"\nunits = \"mm\"\n\
         aperture = {{ entrance_pupil_diameter_mm = 1.5 }}\nobject = {{ distance_mm = {object} }}\n\
         wavelengths = {{ um = [0.486, 0.588, 0.656], reference_um = 0.588 }}\n\
         fields = {{ angle_deg = [0.0, 45.0, 80.0, {full_deg:?}] }}\n"
    );
    for (radius_mm, thickness_mm, glass, semi_diameter_mm) in [
        ("45.0", 2.0, "N-SK16", 34.0),
        ("15.2", 14.0, "", 15.15),
        ("100.0", 1.5, "N-BK7", 14.5),
        ("8.5", 7.0, "", 8.48),
        ("14.0", 5.0, "N-SF6", 9.0),
        ("-60.0", 5.0, "", 9.0),
        ("inf", 1.0, "stop", 3.0),
        ("30.0", 3.0, "N-SK2", 6.0),
        ("-12.0", 9.6, "", 6.0),
    ] {
        let behind = match glass {
            "" => String::new(),
            "stop" => "stop = true".to_owned(),
            glass => format!("glass = \"{glass}\""),
        };
        writeln!(
            text,
            "[[surface]]\nradius_mm = {radius_mm}\nthickness_mm = {thickness_mm:?}\n\
             semi_diameter_mm = {semi_diameter_mm:?}\n{behind}"
        )
        .unwrap();
    }
    std::fs::write(folder.join(name), text).unwrap();
}

#[test]
fn a_fisheye_is_shown_traced_and_analysed_at_92_degrees() {
    let folder = tempfile::tempdir().unwrap();
    write_fisheye(folder.path(), "fisheye.toml", "inf", 92.0);
    let shown = run_ok(folder.path(), &["lens", "show", "fisheye.toml", "--json"]).json();
    let last = |key: &str| &shown[key][3];
    assert!(last("rms_spot_poly_real_stop_um").as_f64().is_some_and(|um| um > 10.0 && um < 200.0));
    assert!(last("relative_illumination")[1].as_f64().is_some_and(|share| share > 0.1 && share < 1.0));
    // The paraxial pupil and third-order theory end before 90 degrees.
    assert!(last("rms_spot_poly_um").is_null() && shown["seidel"].is_null());

    let trace = |field: &str, aim: &str| {
        let args = ["lens", "trace", "fisheye.toml", "--field", field, "--wavelength", "0.588"];
        run_ok(folder.path(), &[&args[..], &["--pupil", "0,0", "--aim", aim, "--json"]].concat()).json()
    };
    let traced = trace("92", "real");
    assert_eq!(traced["status"], "ok");
    // The chief ray meets the middle of the stop, and light from behind the lens has no path from the plane of its front.
    assert!(traced["surfaces"][6]["y_mm"].as_f64().unwrap().abs() < 1e-9);
    assert!(traced["opl_mm"].is_null());
    assert!(trace("80", "real")["opl_mm"].as_f64().is_some_and(|mm| mm > 50.0));
    assert_ne!(trace("80", "paraxial")["status"], "ok");

    run_ok(folder.path(), &["lens", "analyze", "fisheye.toml", "--out", "sheet"]);
    let sheet = std::fs::read_to_string(folder.path().join("sheet/analysis.json")).unwrap();
    let sheet: serde_json::Value = serde_json::from_str(&sheet).unwrap();
    let curve = sheet["field_curves"]["distortion_percent"][0].as_array().unwrap();
    assert_eq!(curve.last().unwrap().as_f64(), Some(-100.0));
}

/// At wide fields the paraxial ray is another ray: here it misses surface 2, and the real beam ends at the edge of surface 4.
#[test]
fn lost_light_is_followed_by_the_ray_through_the_middle_of_the_stop() {
    let folder = tempfile::tempdir().unwrap();
    write_fisheye(folder.path(), "fisheye.toml", "inf", 92.0);
    let text = std::fs::read_to_string(folder.path().join("fisheye.toml")).unwrap();
    let cut = text.replace("semi_diameter_mm = 8.48", "semi_diameter_mm = 5.0");
    assert_ne!(cut, text);
    std::fs::write(folder.path().join("cut.toml"), cut).unwrap();
    let needles = ["degrees no", "the ray through the middle of the stop is clipped at surface 4"];
    for verb in ["show", "analyze"] {
        run_fails(folder.path(), &["lens", verb, "cut.toml"], 2, &needles);
    }
    let needles = ["no light", "degrees: the ray through the middle of the stop is clipped", "help:"];
    run_fails(folder.path(), &["psf", "cut.toml", "--out", "psf"], 2, &needles);
}

#[test]
fn fields_that_no_object_can_have_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    write_fisheye(folder.path(), "behind.toml", "inf", 180.0);
    run_fails(folder.path(), &["lens", "show", "behind.toml"], 2, &["angle_deg", "below 180 degrees"]);
    write_fisheye(folder.path(), "near.toml", "200.0", 92.0);
    run_fails(
        folder.path(),
        &["lens", "show", "near.toml"],
        2,
        &["angle_deg", "near object", "below 90 degrees"],
    );
    write_fisheye(folder.path(), "fisheye.toml", "inf", 92.0);
    let goal = ["lens", "optimize", "fisheye.toml", "--out", "better.toml"];
    let limited = [&goal[..], &["--distortion", "1"]].concat();
    run_fails(folder.path(), &limited, 2, &["--distortion", "90 degrees or more"]);
    let far = [&goal[..], &["--fields", "0,180"]].concat();
    run_fails(folder.path(), &far, 2, &["--fields", "less than 180"]);
}

/// A sensor whose corner sees more than 90 degrees: there is no rectilinear picture of such a scene.
#[test]
fn a_sensor_behind_a_fisheye_takes_pictures_that_lie_on_the_image() {
    let folder = tempfile::tempdir().unwrap();
    write_fisheye(folder.path(), "fisheye.toml", "inf", 92.0);
    let sensor = std::fs::read_to_string(data("sensors/imx249-fitted.toml")).unwrap();
    let small = sensor.replace("height = 1200", "height = 120").replace("width = 1920", "width = 192");
    let wide = small.replace("pixel_um = 5.86", "pixel_um = 89.0");
    assert_ne!(small, wide);
    std::fs::write(folder.path().join("wide.toml"), wide).unwrap();
    let photo = data("photos/coffee.png").display().to_string();
    let args = ["simulate", &photo, "--lens", "fisheye.toml", "--sensor", "wide.toml", "--out", "taken"];
    run_fails(folder.path(), &args, 2, &["rectilinear picture", "leave distortion out"]);
    run_ok(folder.path(), &[&args[..], &["--no-distortion"]].concat());
    assert!(folder.path().join("taken/coffee-developed.png").is_file());
}
