//! An experiment with its lens and its sensor as files to edit.

use crate::common::{data, read, run, run_fails, run_ok};

#[test]
fn the_files_are_complete_and_run() {
    let folder = tempfile::tempdir().unwrap();
    let said = run_ok(folder.path(), &["init", "mine"]).stdout;
    for name in ["lens.toml", "sensor.toml", "experiment.toml"] {
        assert!(said.contains(&format!("mine/{name}")), "{said}");
    }
    let experiment = read(&folder.path().join("mine/experiment.toml"));
    assert!(experiment.contains("lens = \"lens.toml\"") && experiment.contains("sensor = \"sensor.toml\""));
    assert!(experiment.contains("# 1 to 100000000: Network steps of a stage that trains the network."));
    // The same experiment as the built-in one, but for where its files are.
    let config = |what: &str| {
        let text = run_ok(folder.path(), &["design", what, "--print-config"]).stdout;
        text.lines()
            .filter(|l| !l.starts_with("lens") && !l.starts_with("sensor"))
            .collect::<Vec<_>>()
            .join("\n")
    };
    assert_eq!(config("mine/experiment.toml"), config("cooke-triplet-image-quality"));
    // Comments of the built-in lens are kept.
    assert!(read(&folder.path().join("mine/lens.toml")).contains("# The nominal Cooke triplet"));

    // A sensor without colour filters is developed as it can be, and what else it needs is said.
    let gray = run_ok(folder.path(), &["init", "gray", "--sensor", "imx250-mono"]);
    assert!(gray.says("`imx250-mono` is monochrome"), "{}", gray.stderr);
    assert!(read(&folder.path().join("gray/experiment.toml")).contains("demosaic = \"bilinear\""));
    assert!(gray.says("development.demosaic is \"bilinear\""), "{}", gray.stderr);
    run_fails(folder.path(), &["design", "gray/experiment.toml", "--steps", "1"], 2, &["is monochrome"]);
    let street = ["init", "street", "--from", "pedestrian-vehicle", "--sensor", "imx250-mono"];
    assert!(!run_ok(folder.path(), &street).says("is monochrome"));
    // Words to choose from are there, too.
    let street = read(&folder.path().join("street/experiment.toml"));
    let light = street.lines().find(|line| line.starts_with("light = ")).unwrap();
    assert!(light.ends_with("# \"day\", \"dusk\", \"night\": Time of day."), "{light}");

    // What a user has edited is not lost.
    run_fails(folder.path(), &["init", "mine"], 2, &["exists already", "--force"]);
    run_ok(folder.path(), &["init", "mine", "--force"]);
    let unknown = ["init", "other", "--from", "no-such-experiment"];
    run_fails(folder.path(), &unknown, 2, &["no-such-experiment", "cooke-triplet-image-quality"]);

    // What lies beside the experiment to start from is found from the new folder.
    let beside = folder.path().join("there");
    std::fs::create_dir_all(beside.join("pictures")).unwrap();
    std::fs::write(beside.join("e.toml"), "photos = \"pictures\"\n").unwrap();
    run_ok(folder.path(), &["init", "from-there", "--from", "there/e.toml"]);
    let text = read(&folder.path().join("from-there/experiment.toml"));
    assert!(text.contains("photos = \"../there/pictures\""), "{text}");
    assert!(!folder.path().join("other").exists());
}

/// A folder whose files and folders have the names that `init` writes, and those of what is built in.
fn with_decoys() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for name in ["built-in", "street", "cooke-triplet-nominal", "imx249-fitted"] {
        std::fs::create_dir(folder.path().join(name)).unwrap();
    }
    for (from, to) in
        [("lenses/cooke-triplet-nominal.toml", "lens.toml"), ("sensors/imx250-mono.toml", "sensor.toml")]
    {
        std::fs::copy(data(from), folder.path().join(to)).unwrap();
    }
    folder
}

/// Two cameras: one with the experiment's lens, one with a built-in lens.
const TWO_LENSES: &str = r#"lens = "lens.toml"
variant = [
    { name = "own", lens = "lens.toml", stage = [{ goal = "task", moves = ["network"] }] },
    { name = "other", lens = "cooke-triplet-nominal", stage = [{ goal = "task", moves = ["network"] }] },
]
"#;

#[test]
fn an_experiment_names_the_files_that_are_written_with_it() {
    let folder = with_decoys();
    std::fs::write(folder.path().join("two.toml"), TWO_LENSES).unwrap();
    for (out, from) in [
        ("built", &[] as &[&str]),
        ("fitted", &["--lens", "lens.toml"]),
        ("two", &["--from", "two.toml"]),
        ("both", &["--from", "two.toml", "--lens", "lens.toml"]),
    ] {
        run_ok(folder.path(), &[&["init", out], from].concat());
        let text = read(&folder.path().join(out).join("experiment.toml"));
        let named: Vec<&str> = text
            .lines()
            .filter(|line| {
                ["lens = ", "sensor = ", "photos = ", "data = "].iter().any(|key| line.starts_with(key))
            })
            .map(|line| line.split(" #").next().unwrap_or_default().trim_end())
            .collect();
        let own = [
            "lens = \"lens.toml\"",
            "sensor = \"sensor.toml\"",
            "photos = \"built-in\"",
            "data = \"street\"",
        ];
        assert_eq!(named[..4], own, "{out}");
        if from.contains(&"two.toml") {
            assert_eq!(named[4..], ["lens = \"lens.toml\"", "lens = \"cooke-triplet-nominal\""], "{out}");
        }
    }
}

#[test]
fn a_folder_beside_an_experiment_hides_nothing_that_is_built_in() {
    let folder = with_decoys();
    std::fs::write(folder.path().join("two.toml"), TWO_LENSES).unwrap();
    let above = folder.path().parent().unwrap();
    let name = folder.path().join("two.toml");
    let config = run_ok(above, &["design", name.to_str().unwrap(), "--print-config"]).stdout;
    for line in ["lens = \"cooke-triplet-nominal\"", "photos = \"built-in\"", "data = \"street\""] {
        assert!(config.lines().any(|known| known.trim_start().starts_with(line)), "{line}: {config}");
    }
}

/// The same rule as that of `lens optimize`, in the same words.
#[test]
fn a_lens_for_a_near_object_keeps_its_magnification() {
    let folder = tempfile::tempdir().unwrap();
    let text =
        read(&data("lenses/cooke-triplet-nominal.toml")).replace("distance_mm = inf", "distance_mm = 120.0");
    let lens = text.split("[[variable]]").next().unwrap();
    std::fs::write(folder.path().join("near.toml"), lens).unwrap();
    let said = run_ok(folder.path(), &["init", "mine", "--lens", "near.toml"]);
    assert!(said.says("the radius of surface 7 holds the magnification"), "{}", said.stderr);
    let fitted = read(&folder.path().join("mine/lens.toml"));
    assert!(fitted.contains("magnification = { surface = 7, magnification = -0."), "{fitted}");
    assert!(!fitted.contains("efl = {"), "{fitted}");
    run_ok(folder.path(), &["design", "mine/experiment.toml", "--check"]);
}

#[test]
fn a_lens_without_variables_gets_the_usual_ones_and_keeps_its_focal_length() {
    let folder = tempfile::tempdir().unwrap();
    let lens = "cooke-triplet-pedestrian-vehicle";
    let made = run_ok(folder.path(), &["init", "mine", "--lens", lens]);
    // In the plane of the file, which stays; where the lens is first focused it would be 4.65 mm.
    assert!(made.says("an image circle of 4.64 mm radius"), "{}", made.stderr);
    let said = made.stdout;
    assert!(said.contains("with variables that the file did not name"), "{said}");
    let text = read(&folder.path().join("mine/lens.toml"));
    // Five of the six radii vary, the last holds the focal length; the stop is flat and stays.
    assert_eq!(text.matches("parameter = \"radius_mm\"").count(), 5, "{text}");
    assert!(text.contains("efl = { surface = 7") && text.contains("radius_mm = ["), "{text}");

    // Numbers that the file solves for stay solved for.
    let solves = text.split("[[variable]]").next().unwrap().to_owned()
        + "[solve]\nlength = { surface = 2, length_mm = 27.2659 }\nefl = { surface = 6, efl_mm = 18.533, radius_mm = [12.0, 20.0] }\n";
    std::fs::write(folder.path().join("solved.toml"), solves).unwrap();
    run_ok(folder.path(), &["init", "solved", "--lens", "solved.toml"]);
    let solved = read(&folder.path().join("solved/lens.toml"));
    assert!(solved.contains("efl = { surface = 6") && solved.contains("length = { surface = 2"), "{solved}");
    run_ok(folder.path(), &["lens", "show", "solved/lens.toml"]);

    // The experiment moves it, and so does one that names the lens alone, with a warning.
    let efl = |run: &str| {
        let lens = format!("{run}/cameras/end-to-end/lens.toml");
        let shown = run_ok(folder.path(), &["lens", "show", &lens, "--json"]).json();
        shown["efl_mm"].as_f64().unwrap()
    };
    let quick = "[psf]\nfields = 3\ngrid = 64\npitch_um = 6.0\npatches = [2, 2]\npupil_cells = 16\nscoring_pupil_cells = 16\n\
        scoring_pupil_error = 2.0\nscoring_fields = 3\nscoring_blend_error = 2.0\n[network]\nbase_channels = 4\nlevels = 1\n\
        [training]\nsteps = 2\nbatch = 1\ncrop = 64\n[optics]\nsteps = 1\n[spot]\niterations = 2\n\
        [scoring]\nplaces_per_side = 1\ncrop = 64\nscores = [\"psnr_db\"]\n";
    for (name, lens) in [("own", "mine/lens.toml"), ("bare", lens)] {
        let text = format!("name = \"{name}\"\nlens = \"{lens}\"\n{quick}");
        std::fs::write(folder.path().join(format!("{name}.toml")), text).unwrap();
        let done = run_ok(
            folder.path(),
            &["design", &format!("{name}.toml"), "--out", name, "--variant", "end-to-end"],
        );
        let warns = done.stderr.contains("the file names no variables");
        assert_eq!(warns, name == "bare", "{}", done.stderr);
        assert!((efl(name) / 18.533 - 1.0).abs() < 1e-4, "{}", efl(name));
    }
}

/// The corner of the sensor lies beyond the fields of the file: the field that is written for it is that of the lens in its new focus. Weights and
/// published spots of the file do not fit that field.
#[test]
fn the_field_of_the_sensors_corner_is_that_of_the_lens_in_focus() {
    let folder = tempfile::tempdir().unwrap();
    let nominal = read(&data("lenses/cooke-triplet-nominal.toml"));
    let stated = "angle_deg = [0.0, 5.0, 10.0, 15.0]";
    assert!(nominal.contains(stated));
    let narrow = nominal.split("[[variable]]").next().unwrap();
    let narrow = narrow.replace(stated, "angle_deg = [0.0, 5.0]\nweight = [1.0, 2.0]")
        + "[expect]\nrms_spot_um = { values = [4.0, 9.0], relative_tolerance = 0.5 }\n";
    std::fs::write(folder.path().join("narrow.toml"), narrow).unwrap();
    let init = ["init", "mine", "--lens", "narrow.toml", "--sensor", "imx249-fitted"];
    let made = run_ok(folder.path(), &init);
    assert!(made.says("focus: the image plane moves by"), "{}", made.stderr);

    let lens: toml::Table = read(&folder.path().join("mine/lens.toml")).parse().unwrap();
    let fields = &lens["fields"];
    assert_eq!(fields["weight"], toml::Value::from(vec![1.0, 2.0, 1.0]));
    assert!(!lens.contains_key("expect"));
    let written_deg = fields["angle_deg"][2].as_float().unwrap();
    let look = run_ok(folder.path(), &["design", "mine/experiment.toml", "--check", "--json"]).json();
    let seen = look["lenses"][0]["fields"].as_array().unwrap().last().unwrap();
    let corner_deg = seen["field_deg"].as_f64().unwrap();
    assert!((written_deg - corner_deg).abs() < 1e-5, "{written_deg} {corner_deg}");
    let circle_mm = look["lenses"][0]["image_circle_mm"].as_f64().unwrap();
    assert!((circle_mm / look["corner_mm"].as_f64().unwrap() - 1.0).abs() < 1e-6, "{look}");
}

/// Windows of a lens of one's own fit the photographs that the same command names, by the option or by the key, and not the built-in ones.
#[test]
fn windows_fit_the_photographs_that_the_command_names() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("small")).unwrap();
    for name in ["a.png", "b.png", "c.png"] {
        image::RgbImage::new(160, 130).save(folder.path().join("small").join(name)).unwrap();
    }
    let fitted = |named: &[&str]| {
        run_ok(folder.path(), &[&["design", "cooke-triplet-nominal", "--print-config"], named].concat())
    };
    for named in [["--photos", "small"], ["--set", "photos=small"]] {
        let done = fitted(&named);
        assert!(done.says("in place of 120: half of the photographs in"), "{named:?}: {}", done.stderr);
        assert!(done.says("of 130 pixels at most, hold no larger window"), "{named:?}: {}", done.stderr);
    }
    assert!(!fitted(&[]).says("in place of 120"));

    // So does an experiment that is written with them: it names their folder from its own.
    let lens = ["init", "mine", "--lens", "cooke-triplet-nominal", "--photos", "small"];
    let written = run_ok(folder.path(), &lens);
    assert!(written.says("in place of 120: half of the photographs in"), "{}", written.stderr);
    let text = read(&folder.path().join("mine/experiment.toml"));
    assert!(text.contains("photos = \"../small\""), "{text}");
    let small = folder.path().join("small");
    run_ok(
        folder.path(),
        &["init", "far", "--lens", "cooke-triplet-nominal", "--photos", small.to_str().unwrap()],
    );
    let text = read(&folder.path().join("far/experiment.toml"));
    assert!(text.contains(&format!("photos = \"{}\"", small.display())), "{text}");
    // A folder with the name of what is built in stays a folder.
    std::fs::rename(&small, folder.path().join("built-in")).unwrap();
    run_ok(folder.path(), &["init", ".", "--lens", "cooke-triplet-nominal", "--photos", "built-in"]);
    let text = read(&folder.path().join("experiment.toml"));
    assert!(text.contains("photos = \"./built-in\""), "{text}");
    std::fs::rename(folder.path().join("built-in"), &small).unwrap();
    let labels = ["init", "other", "--from", "pedestrian-vehicle", "--photos", "small"];
    run_fails(folder.path(), &labels, 2, &["--photos", "the experiment needs labels"]);
    run_fails(folder.path(), &["init", "other", "--photos", "nowhere"], 2, &["nowhere", "give a folder"]);
    assert!(!folder.path().join("other").exists());

    // The experiment and its photographs are moved together.
    let moved = folder.path().join("moved");
    std::fs::create_dir(&moved).unwrap();
    for name in ["mine", "small"] {
        std::fs::rename(folder.path().join(name), moved.join(name)).unwrap();
    }
    let config = run_ok(folder.path(), &["design", "moved/mine/experiment.toml", "--print-config"]).stdout;
    assert!(config.contains("moved/small\""), "{config}");

    // The photographs lie in the new folder itself.
    let small = moved.join("small");
    run_ok(&small, &["init", ".", "--lens", "cooke-triplet-nominal", "--photos", "."]);
    run_ok(&small, &["design", "experiment.toml", "--print-config"]);
}

/// A public lens of another program, in a folder with a space.
fn with_double_gauss() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir_all(folder.path().join("my lenses")).unwrap();
    let text = include_str!("../lenses/double-gauss.zmx");
    std::fs::write(folder.path().join("my lenses/double-gauss.zmx"), text).unwrap();
    folder
}

#[test]
fn the_experiment_fits_a_lens_of_ones_own() {
    let folder = with_double_gauss();
    let made = run_ok(folder.path(), &["init", "my camera", "--lens", "my lenses/double-gauss.zmx"]);
    assert!(made.stdout.ends_with("next: petzval design 'my camera/experiment.toml'\n"), "{}", made.stdout);
    // By hand: 99.5 mm tan 14 degrees are 24.8 mm.
    assert!(made.says("an image circle of 24.") && made.says("of the image circle"), "{}", made.stderr);
    // The sensor is large, and what that means is said: for photographs, for the work of a run and for memory.
    assert!(made.says("megapixels, whose corner lies"), "{}", made.stderr);
    assert!(made.says("enlarges 11 of the 11 built-in ones, up to"), "{}", made.stderr);
    for said in ["a run takes ", " steps in all: ", "time goes into ", "GB of memory for a whole frame"] {
        assert!(made.says(said), "{said}: {}", made.stderr);
    }
    let file = |name: &str| read(&folder.path().join("my camera").join(name));
    let table = |name: &str| -> toml::Table { file(name).parse().unwrap() };
    let (experiment, sensor) = (table("experiment.toml"), table("sensor.toml"));
    assert_eq!(experiment["name"].as_str(), Some("Double Gauss - 28 degree field"));
    let number = |key: &str| sensor[key].as_float().or(sensor[key].as_integer().map(|n| n as f64)).unwrap();
    let corner_mm = 0.5e-3 * number("pixel_um") * number("height").hypot(number("width"));
    assert!((corner_mm / 24.8 - 1.0).abs() < 0.02, "{corner_mm}");
    assert_eq!(number("pixel_um"), 5.86);
    // The planes within both cemented elements may bend.
    let lens = table("lens.toml");
    let variables = lens["variable"].as_array().unwrap();
    let of = |name: &str| -> Vec<i64> {
        let named = variables.iter().filter(|v| v["parameter"].as_str() == Some(name));
        named.map(|v| v["surface"].as_integer().unwrap()).collect()
    };
    assert_eq!(of("curvature_per_mm"), [4, 8]);
    assert_eq!(of("radius_mm"), [1, 2, 3, 5, 7, 9, 10]);
    assert_eq!(of("thickness_mm"), [2, 5, 6, 9]);
    assert!(file("lens.toml").contains("efl = { surface = 11"));

    // What it prints next would go well: the lens is in focus, its light lies on the grid, it meets every requirement.
    let look = run_ok(folder.path(), &["design", "my camera/experiment.toml", "--check", "--json"]).json();
    let lens = &look["lenses"][0];
    assert_eq!(lens["violated"], serde_json::json!([]), "{look}");
    assert_eq!(lens["cameras"], serde_json::json!(["nominal", "spot-optimised", "end-to-end"]));
    for field in lens["fields"].as_array().unwrap() {
        assert!(field["light_on_grid"].as_f64().unwrap() > 0.98, "{field}");
        assert!(field["rms_spot_um"].as_f64().unwrap() < 30.0, "{field}");
    }
    assert!((lens["image_circle_mm"].as_f64().unwrap() / 24.8 - 1.0).abs() < 0.02, "{lens}");
    assert_eq!(look["problems"], serde_json::json!([]));

    // The lens alone does the same.
    let alone = ["design", "my lenses/double-gauss.zmx", "--check", "--json"];
    let alone = run_ok(folder.path(), &alone).json();
    assert_eq!(alone, look);
    let config = run_ok(folder.path(), &["design", "my lenses/double-gauss.zmx", "--print-config"]).stdout;
    assert!(
        config.starts_with(
            "# Lens and sensor are those that `petzval init --lens 'my lenses/double-gauss.zmx'`"
        )
    );

    // A sensor that is named is taken as it is, and said to be small.
    let small = ["init", "small", "--lens", "my lenses/double-gauss.zmx", "--sensor", "imx249-fitted"];
    assert!(run_ok(folder.path(), &small).says("at 27 % of the image circle"));
    let look = run_ok(folder.path(), &["design", "small/experiment.toml", "--check"]);
    assert!(look.says("fields further out are neither seen nor improved"), "{}", look.stderr);
}

#[test]
fn lenses_without_a_picture_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let lens = |distances: [f64; 2], focals: [f64; 2]| {
        let surface = |i: usize| {
            let stop = if i == 0 { "stop = true\n" } else { "" };
            format!(
                "[[surface]]\n{stop}radius_mm = inf\nthin_lens = {{ focal_length_mm = {} }}\nthickness_mm = {}\n",
                focals[i], distances[i]
            )
        };
        format!(
            "name = \"two\"\nunits = \"mm\"\n[aperture]\nentrance_pupil_diameter_mm = 20.0\n[wavelengths]\num = [0.55]\n[fields]\nangle_deg = [0.0, 1.0]\n{}{}",
            surface(0),
            surface(1)
        )
    };
    // A telescope, a lens behind which light spreads, and one in which nothing could move.
    for (name, text, said) in [
        ("telescope", lens([240.0, 48.0], [200.0, 40.0]), "the lens is afocal"),
        ("negative", lens([1.0, 48.0], [-200.0, -300.0]), "the image is virtual"),
        ("ideal", lens([1.0, 120.0], [200.0, 300.0]), "no curved surface between two media"),
    ] {
        std::fs::write(folder.path().join(format!("{name}.toml")), text).unwrap();
        let file = format!("{name}.toml");
        run_fails(folder.path(), &["init", "mine", "--lens", &file], 2, &[said, "help"]);
        run_fails(folder.path(), &["design", &file], 2, &[said]);
    }
}

#[test]
fn a_look_before_the_first_step_says_what_is_wrong() {
    let folder = with_double_gauss();
    // An own experiment without the fit: out of focus by 0.8 mm at f/3, nearly all light lies beyond a grid of 64 um.
    let out_of_focus = run_ok(folder.path(), &["lens", "convert", "my lenses/double-gauss.zmx", "dg.toml"]);
    assert!(out_of_focus.stdout.contains("dg.toml"));
    let text = read(&folder.path().join("dg.toml")).replace("thickness_mm = 61.4875", "thickness_mm = 60.7");
    std::fs::write(folder.path().join("dg.toml"), text).unwrap();
    let experiment =
        "name = \"Mine\"\nlens = \"dg.toml\"\n[psf]\ngrid = 64\npitch_um = 1.0\n[optics]\ndefocus_mm = 3.0\n";
    std::fs::write(folder.path().join("e.toml"), experiment).unwrap();
    let wrong = run(folder.path(), &["design", "e.toml", "--check"]);
    assert_eq!(wrong.code, Some(2), "{}", wrong.stderr);
    assert!(wrong.stdout.contains("is it in focus?"), "{}", wrong.stdout);
    run_fails(folder.path(), &["design", "e.toml"], 2, &["is it in focus?", "petzval lens focus"]);

    // Requirements that the start violates are named: the built-in triplet has 24.525 mm.
    let far = "[constraints]\nback_focal_mm = 30.0\n";
    std::fs::write(folder.path().join("far.toml"), far).unwrap();
    let look = run_ok(folder.path(), &["design", "far.toml", "--check", "--json"]).json();
    let violated = &look["lenses"][0]["violated"][0];
    assert_eq!(violated["requirement"], "distance from the last vertex to the image");
    assert!((violated["by_mm"].as_f64().unwrap() - (30.0 - 24.525171110552694)).abs() < 1e-9, "{violated}");
    // 400 network steps a camera, 150 of the lens with them, 3 stages of the lens alone, 3 scores.
    assert_eq!(look["steps"], 3 * 400 + 150 + 3 + 3);
    assert_eq!(look["cameras"][2]["blocks"], serde_json::json!({"network": 400, "optics": 150}));
    // The built-in photographs have 640 pixels or fewer, and a row of the sensor has 1920.
    let photos = &look["photos"];
    let count = |key: &str| photos[key].as_u64().unwrap();
    assert_eq!(count("enlarged"), count("training") + count("held_out"));
    assert!(photos["most_enlarged"].as_f64().unwrap() >= 3.0, "{photos}");
}

#[test]
fn a_lens_is_focused_into_a_file_of_its_own() {
    let folder = with_double_gauss();
    let args = ["lens", "focus", "my lenses/double-gauss.zmx", "sharp.toml", "--json"];
    let found = run_ok(folder.path(), &args).json();
    let figure = |key: &str| found[key].as_f64().unwrap();
    assert_eq!(figure("image_distance_before_mm"), 61.4875);
    assert!(figure("rms_spot_um") < figure("rms_spot_before_um"), "{found}");
    // The RMS over the fields of the spots that `lens show` finds.
    let shown = run_ok(folder.path(), &["lens", "show", "sharp.toml", "--json"]).json();
    let spots = shown["rms_spot_poly_real_stop_um"].as_array().unwrap();
    let squares: f64 = spots.iter().map(|um| um.as_f64().unwrap().powi(2)).sum();
    let rms_um = (squares / spots.len() as f64).sqrt();
    assert!((figure("rms_spot_um") / rms_um - 1.0).abs() < 0.02, "{found} {rms_um}");
    // The file holds the plane, and no plane beside it has smaller spots.
    let again = run_ok(folder.path(), &["lens", "focus", "sharp.toml", "--json"]).json();
    assert!(
        (again["image_distance_before_mm"].as_f64().unwrap() - figure("image_distance_mm")).abs() < 1e-12
    );
    assert!((again["image_distance_mm"].as_f64().unwrap() - figure("image_distance_mm")).abs() < 1e-6);
    // Without a file to write there are figures alone, and a file that is there stays.
    run_fails(
        folder.path(),
        &["lens", "focus", "my lenses/double-gauss.zmx", "sharp.toml"],
        2,
        &["exists already"],
    );
    let paraxial = ["lens", "focus", "sharp.toml", "--at", "paraxial", "--json"];
    let order = run_ok(folder.path(), &["lens", "show", "sharp.toml", "--json"]).json();
    let plane = run_ok(folder.path(), &paraxial).json()["image_distance_mm"].as_f64().unwrap();
    assert!((plane - order["bfl_mm"].as_f64().unwrap()).abs() < 1e-9);
}

#[test]
fn wrong_settings_are_refused_before_a_lens_is_fitted() {
    let folder = with_double_gauss();
    let lens = "my lenses/double-gauss.zmx";
    std::fs::create_dir_all(folder.path().join("taken/checkpoints/one")).unwrap();
    for (more, says) in [
        (["--variant", "x"], ["--variant x: no such variant", "there are"]),
        (["--steps", "0"], ["--steps 0: must lie between", "at least one"]),
        (["--out", "taken"], ["taken", "holds checkpoints"]),
    ] {
        let refused = run_fails(folder.path(), &[&["design", lens], &more[..]].concat(), 2, &says);
        assert!(!refused.says("image circle") && !refused.says("a run takes"), "{}", refused.stderr);
    }
}

#[test]
fn a_folder_in_place_of_an_experiment_is_named_with_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    run_ok(folder.path(), &["init", "mine"]);
    run_fails(
        folder.path(),
        &["design", "mine"],
        2,
        &["mine: is a folder, not an experiment", "mine/experiment.toml"],
    );
    std::fs::create_dir(folder.path().join("run")).unwrap();
    std::fs::write(folder.path().join("run/config.toml"), "name = \"a run\"\n").unwrap();
    run_fails(folder.path(), &["design", "run"], 2, &["the folder of a run", "petzval design --resume run"]);
    std::fs::create_dir(folder.path().join("empty")).unwrap();
    run_fails(folder.path(), &["design", "empty"], 2, &["empty: is a folder", "built-in one"]);
}
