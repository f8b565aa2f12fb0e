//! An experiment with its lens and its sensor as files to edit.

mod common;

use common::{read, run_fails, run_ok};

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
    assert!(text.contains(&format!("photos = \"{}\"", beside.join("pictures").display())), "{text}");
    assert!(!folder.path().join("other").exists());
}

#[test]
fn a_lens_without_variables_gets_the_usual_ones_and_keeps_its_focal_length() {
    let folder = tempfile::tempdir().unwrap();
    let lens = "cooke-triplet-pedestrian-vehicle";
    let said = run_ok(folder.path(), &["init", "mine", "--lens", lens]).stdout;
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
