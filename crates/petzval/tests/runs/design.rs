//! `petzval design`, `report` and `evaluate`, on an experiment that takes about a second.

use std::collections::BTreeMap;
use std::path::Path;

use crate::common::{self, *};
use serde_json::Value;

const CAMERAS: [&str; 3] = ["nominal", "spot-optimised", "end-to-end"];

/// The names in a folder, sorted.
fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .unwrap_or_else(|e| panic!("{}: {e}", folder.display()))
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

/// References that a browser would fetch.
fn assert_stands_alone(html: &str) {
    for piece in html.split("http").skip(1) {
        let namespace = piece.starts_with("://www.w3.org/2000/svg");
        assert!(namespace, "the report refers to http{}", &piece[..piece.len().min(60)]);
    }
    for fetching in ["<link", "<iframe", "@import", "url(", "src=\"//", "href=\"//", "file:"] {
        assert!(!html.contains(fetching), "the report contains {fetching}");
    }
    let sources: Vec<&str> = html.split("src=\"").skip(1).collect();
    assert!(sources.len() > 10, "the report shows pictures");
    assert!(sources.iter().all(|s| s.starts_with("data:")));
}

#[test]
fn a_run_writes_all_its_files() {
    let folder = tempfile::tempdir().unwrap();
    write_tiny(folder.path());
    let done = run_ok(folder.path(), &["design", "tiny.toml", "--out", "deep/run", "--seed", "7"]);
    let run = folder.path().join("deep/run");
    assert!(done.stdout.contains("spot-optimised") && done.stdout.contains("report: deep/run/report.html"));
    assert!(done.says("run folder: deep/run") && done.says("nominal: 1 − LPIPS"), "{}", done.stderr);
    // The terminal and the page begin their result with the same sentence.
    let answer = done.stdout.lines().find(|line| line.contains(" scores highest in "));
    let answer = answer.unwrap_or_else(|| panic!("{}", done.stdout));
    assert!(done.stdout.split("\n\n").any(|part| part.starts_with(answer)), "{}", done.stdout);
    let page = read(&run.join("report.html"));
    let at = |text: &str| page.find(text).unwrap_or_else(|| panic!("{text}"));
    assert!(at(answer) < at("class=\"numbers\"") && at("class=\"numbers\"") < at("<h2>Result</h2>"));
    let kept = names(&run);
    for name in [
        "cameras",
        "checkpoints",
        "config.toml",
        "digests.json",
        "environment.json",
        "events.jsonl",
        "inputs",
        "lens",
        "metrics.csv",
        "metrics.json",
        "pictures.csv",
        "report.html",
        "run.json",
    ] {
        assert!(kept.iter().any(|k| k == name), "no {name} in {kept:?}");
    }
    assert!(snapshot(&run).keys().all(|p| !p.display().to_string().contains("partial")));

    // The resolved experiment holds what the command line changed.
    let config: toml::Table = read(&run.join("config.toml")).parse().unwrap();
    let mut given: toml::Table = tiny_experiment().parse().unwrap();
    given.insert("seed".to_owned(), toml::Value::Integer(7));
    assert_eq!(config["seed"], given["seed"]);
    assert_eq!(config["training"]["steps"], given["training"]["steps"]);
    // What only tasks with objects need stands in no file of an experiment with pictures.
    let further: Vec<&String> = config.keys().filter(|key| !given.contains_key(*key)).collect();
    assert_eq!(further, ["data", "detector", "reading", "street"]);
    assert!(given.keys().all(|key| config.contains_key(key)));

    let environment = read_json(&run.join("environment.json"));
    for key in ["version", "os", "architecture", "simd", "cores", "threads", "command"] {
        assert!(!environment[key].is_null(), "no {key} in {environment}");
    }

    // Steps in order, and the requested number of steps of each block of each camera. One line a step; where spots are
    // minimised, one an iteration.
    let events = events(&run);
    let mut steps: Vec<u64> = events.iter().map(|e| e["step"].as_u64().unwrap()).collect();
    assert!(steps.is_sorted());
    steps.dedup();
    assert_eq!(steps, (1..=ALL_STEPS as u64).collect::<Vec<_>>());
    let mut counts: BTreeMap<(&str, &str), usize> = BTreeMap::new();
    for event in &events {
        *counts.entry((event["camera"].as_str().unwrap(), event["block"].as_str().unwrap())).or_default() +=
            1;
        let losses = event["losses"].as_object().unwrap();
        assert!(!losses.is_empty() && losses.values().all(|v| v.as_f64().is_some_and(f64::is_finite)));
        assert!(event["seconds"].as_f64().unwrap() > 0.0);
        assert!(event["learning_rate"].is_number());
    }
    for stage in [("spot-optimised", "spot"), ("end-to-end", "spot"), ("end-to-end", "restored")] {
        let iterations = counts.remove(&stage).unwrap();
        assert!((4..200).contains(&iterations), "{iterations} events of {stage:?}");
    }
    let mut expected = BTreeMap::from([(("end-to-end", "optics"), LENS_STEPS)]);
    for camera in CAMERAS {
        expected.insert((camera, "network"), NETWORK_STEPS);
        expected.insert((camera, "score"), 1);
    }
    assert_eq!(counts, expected);

    // The last few checkpoints, the last of them at the last step.
    let checkpoints = names(&run.join("checkpoints"));
    assert_eq!(checkpoints.len(), 2, "{checkpoints:?}");
    assert_eq!(checkpoints[1], format!("step-{ALL_STEPS:06}"));
    for camera in CAMERAS {
        let kept = names(&run.join("cameras").join(camera));
        for file in ["lens.toml", "metrics.json", "blocks"] {
            assert!(kept.iter().any(|k| k == file), "no {file} of {camera}: {kept:?}");
        }
        assert_weights_are_readable(&run.join("cameras").join(camera));
    }
    let lenses = names(&run.join("lens"));
    assert!(!lenses.is_empty() && lenses.iter().all(|l| l.starts_with("step-") && l.ends_with(".toml")));

    // Every saved lens is a lens file, and moving lenses have changed.
    let shown = |camera: &str| {
        let lens = run.join("cameras").join(camera).join("lens.toml").display().to_string();
        run_ok(folder.path(), &["lens", "show", &lens, "--json"]).json()
    };
    let first_radius = |camera: &str| shown(camera)["surfaces"][0]["radius_mm"].as_f64().unwrap();
    assert!((first_radius("nominal") - 11.34).abs() < 1e-12);
    for camera in ["spot-optimised", "end-to-end"] {
        assert!((first_radius(camera) - 11.34).abs() > 1e-6, "the {camera} lens has not moved");
    }
    for lens in &lenses {
        run_ok(folder.path(), &["lens", "show", &run.join("lens").join(lens).display().to_string()]);
    }
}

#[test]
fn the_metrics_compare_three_cameras_of_the_same_kind() {
    let folder = tempfile::tempdir().unwrap();
    let run = tiny_run(folder.path(), "run", &["--seed", "3"]);
    let metrics = read_json(&run.join("metrics.json"));
    assert_eq!(metrics["seeds"], serde_json::json!([3]));
    let rows = metrics["rows"].as_array().unwrap();
    assert_eq!(rows.iter().map(|r| r["camera"].as_str().unwrap()).collect::<Vec<_>>(), CAMERAS);
    let figure = |row: &Value, key: &str| row[key].as_f64().unwrap_or_else(|| panic!("no {key} in {row}"));
    for row in rows {
        assert!((0.0..=1.0).contains(&figure(row, "one_minus_lpips")));
        assert!((5.0..60.0).contains(&figure(row, "psnr_db")));
        assert!((0.0..=1.0).contains(&figure(row, "ssim")));
        assert!((1.0..100.0).contains(&figure(row, "rms_spot_um")));
        // The corner is imaged with a few percent of barrel distortion, so its light comes from beyond 29.68.
        assert!((figure(row, "fov_deg") - 31.5).abs() < 0.3, "{}", figure(row, "fov_deg"));
        // The tiny experiment's grid of 64 cells cuts the outer PSFs, and the halo of those that are made for restoration.
        assert!((0.5..=1.0).contains(&figure(row, "psf_captured")), "{}", figure(row, "psf_captured"));
        assert_eq!(row["network_steps"], NETWORK_STEPS);
        // Focal length, f-number, field of view and exposure are the same.
        for key in ["efl_mm", "f_number", "white_e"] {
            let off = figure(row, key) - figure(&rows[0], key);
            assert!(off.abs() < 1e-6, "{}: {key} is off by {off}", row["camera"]);
        }
        // The figures are means over the held-out pictures, which are all there.
        let pictures = row["pictures"].as_array().unwrap();
        let images =
            metrics["held_out_images"].as_u64().unwrap() * metrics["held_out_places"].as_u64().unwrap();
        assert_eq!(images as usize, pictures.len());
        for key in ["one_minus_lpips", "psnr_db", "ssim"] {
            let mean = pictures.iter().map(|p| figure(p, key)).sum::<f64>() / pictures.len() as f64;
            assert!((mean - figure(row, key)).abs() < 1e-12);
        }
    }
    assert!((figure(&rows[0], "efl_mm") - 25.04).abs() < 0.001);
    // Held-out pictures are those of the list, and none is trained on.
    let list: toml::Table = read(&data("photos/photos.toml")).parse().unwrap();
    let files = |key: &str| {
        let entries = list[key].as_array().unwrap().iter();
        entries.map(|e| e["file"].as_str().unwrap().to_owned()).collect::<Vec<_>>()
    };
    for picture in rows[0]["pictures"].as_array().unwrap() {
        let photo = picture["photo"].as_str().unwrap().to_owned();
        assert!(files("held_out").contains(&photo) && !files("training").contains(&photo));
    }
    // Cameras differ, and so do seeds.
    assert_ne!(rows[0]["psnr_db"], rows[1]["psnr_db"]);
    assert_ne!(rows[1]["psnr_db"], rows[2]["psnr_db"]);
    let other = read_json(&tiny_run(folder.path(), "other", &["--seed", "4"]).join("metrics.json"));
    assert_ne!(metrics["rows"], other["rows"]);
}

#[test]
fn the_resolved_experiment_runs_again_to_the_same_bits_with_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let first = tiny_run(folder.path(), "first", &["--threads", "1"]);
    let elsewhere = folder.path().join("elsewhere");
    std::fs::create_dir(&elsewhere).unwrap();
    for threads in ["2", "5"] {
        let args = ["design", "../first/config.toml", "--out", threads, "--threads", threads];
        run_ok(&elsewhere, &args);
        for file in ["metrics.json", "config.toml", "cameras/end-to-end/lens.toml"] {
            assert_eq!(read(&elsewhere.join(threads).join(file)), read(&first.join(file)), "{file}");
        }
    }
}

#[test]
fn a_folder_of_pictures_and_files_of_ones_own_run_again_from_anywhere() {
    let folder = tempfile::tempdir().unwrap();
    let inside = folder.path().join("inside");
    std::fs::create_dir_all(inside.join("my-photos")).unwrap();
    for photo in ["astronaut.png", "chelsea.png", "coffee.png"] {
        std::fs::copy(data("photos").join(photo), inside.join("my-photos").join(photo)).unwrap();
    }
    std::fs::copy(data("lenses/cooke-triplet-nominal.toml"), inside.join("my-lens.toml")).unwrap();
    std::fs::copy(data("sensors/imx249-calibrated.toml"), inside.join("my-sensor.toml")).unwrap();
    let text = tiny_experiment()
        .replace("\"cooke-triplet-nominal\"", "\"my-lens.toml\"")
        .replace("\"imx249-fitted\"", "\"my-sensor.toml\"")
        .replace("photos = \"built-in\"", "photos = \"my-photos\"");
    assert!(text.contains("my-lens.toml") && text.contains("my-sensor.toml") && text.contains("my-photos"));
    std::fs::write(inside.join("mine.toml"), text).unwrap();
    run_ok(&inside, &["design", "mine.toml", "--out", "run"]);
    let metrics = read(&inside.join("run/metrics.json"));
    // The last picture by name is held out.
    assert!(metrics.contains("coffee.png") && !metrics.contains("chelsea.png"));

    run_ok(folder.path(), &["design", "inside/run/config.toml", "--out", "again"]);
    assert_eq!(read(&folder.path().join("again/metrics.json")), metrics);
    let said = run_ok(folder.path(), &["report", "inside/run", "--json"]).json();
    assert_eq!(said, serde_json::json!({"report": "inside/run/report.html"}));
    // The same pictures named on the command line.
    run_ok(&inside, &["design", "mine.toml", "--photos", "my-photos", "--out", "named"]);
    assert_eq!(read(&inside.join("named/metrics.json")), metrics);

    // The pictures have changed: the run is neither continued nor scored again; its report needs no pictures.
    let photo = inside.join("my-photos/coffee.png");
    std::fs::copy(data("photos/china.png"), &photo).unwrap();
    for verb in [&["evaluate", "inside/run"][..], &["design", "--resume", "inside/run"]] {
        let needles = ["inside/run", "not those that this run began with: the picture coffee.png ("];
        run_fails(folder.path(), verb, 2, &needles);
    }
    run_ok(folder.path(), &["evaluate", "inside/run", "--accept-changed", "inputs"]);
    run_ok(folder.path(), &["report", "inside/run"]);
    std::fs::copy(data("photos/coffee.png"), &photo).unwrap();
    // The lens file has changed; the run keeps the lens that it began with.
    std::fs::remove_file(inside.join("my-lens.toml")).unwrap();
    for verb in [["report", "inside/run"], ["evaluate", "inside/run"]] {
        run_ok(folder.path(), &verb);
    }
    // A lens of the run that was tampered with is noticed.
    let kept = inside.join("run/inputs/lens.toml");
    let lens = read(&kept);
    let other = lens.replace("thickness_mm = 4.014", "thickness_mm = 4.015");
    assert_ne!(other, lens);
    std::fs::write(&kept, other).unwrap();
    let needles = ["not those that this run began with: the lens of", "the lens of nominal"];
    run_fails(folder.path(), &["evaluate", "inside/run"], 2, &needles);
}

#[test]
fn fewer_steps_shorten_every_block() {
    let folder = tempfile::tempdir().unwrap();
    let run = tiny_run(folder.path(), "run", &["--steps", "2"]);
    // Half of 4 network steps, and half of 3 lens steps, rounded up; a lens is improved alone in one step as before.
    assert_eq!(events(&run).last().unwrap()["step"], 3 * (2 + 1) + LENS_STAGES + 2);
    assert_eq!(read_json(&run.join("metrics.json"))["rows"][0]["network_steps"], 2);
    // Answer, caveat and the description of the run say how short it was.
    let html = read(&run.join("report.html"));
    for needle in [
        "after 2 of 4 training steps: ",
        "This run is shorter than its experiment: 2 of 4 training steps.",
        "The run was made short: 2 of 4 training steps.",
    ] {
        assert!(html.contains(needle), "{needle}");
    }
    assert_eq!(read_json(&run.join("run.json"))["usual_steps"], 4);
    // By its key as well.
    let by_key = tiny_run(folder.path(), "by-key", &["--set", "training.steps=2"]);
    assert_eq!(read_json(&by_key.join("run.json"))["usual_steps"], 4);
    assert!(read(&by_key.join("report.html")).contains("The run was made short: 2 of 4 training steps."));
    // The grid of 64 cells cuts the outer PSFs: the page says so beside the scores.
    let row = &read_json(&run.join("metrics.json"))["rows"][0];
    let lost =
        format!("cuts off {:.0} % of the light", 100.0 * (1.0 - row["psf_captured"].as_f64().unwrap()));
    assert_eq!(html.contains(&lost), row["psf_captured"].as_f64().unwrap() < 0.98, "{lost}");
    // One that is extended to all steps of its experiment is not short.
    run_ok(folder.path(), &["design", "--resume", "run", "--extend-to", "4"]);
    assert!(!read(&run.join("report.html")).contains("shorter than its experiment"));
}

#[test]
fn the_report_stands_alone_and_is_written_again() {
    let folder = tempfile::tempdir().unwrap();
    let run = finished_run(folder.path());
    let html = read(&run.join("report.html"));
    assert_stands_alone(&html);
    for needle in CAMERAS.iter().chain(&["<svg", "end-to-end", "white_e", "25.04"]) {
        assert!(html.contains(needle), "the report does not mention {needle}");
    }
    // One seed names no winner, and figures of a study are quoted in runs of its own experiment alone.
    assert!(html.contains("one seed is one sample") && !html.contains("beats"));
    assert!(html.contains("seeds 2 and 3") && !html.contains("+0.0185 ± 0.0019"));
    // When, how long, from which seed and by which version it was made; the figures hold nothing that a second run would not repeat.
    let (record, metrics) = (read_json(&run.join("run.json")), read_json(&run.join("metrics.json")));
    assert_eq!(metrics["version"], record["version"]);
    assert!(record["finished"]["seconds"].as_f64().unwrap() > 0.0);
    for date in [&record["begun"], &record["finished"]["date"]] {
        let date = date.as_str().unwrap();
        assert!(date.len() == 20 && date.ends_with('Z') && html.contains(date), "{date}");
    }
    for fact in ["seed", "duration", "version"] {
        assert!(html.contains(&format!("<dt>{fact}</dt>")), "{fact}");
    }
    std::fs::remove_file(run.join("report.html")).unwrap();
    let before = snapshot(&run);
    let said = run_ok(folder.path(), &["report", "run"]);
    assert_eq!(said.stdout.trim(), "run/report.html");
    assert_eq!(read(&run.join("report.html")), html);
    std::fs::remove_file(run.join("report.html")).unwrap();
    assert_same_files(&before, &snapshot(&run));
}

#[test]
fn scoring_again_gives_the_same_figures_and_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let run = finished_run(folder.path());
    let before = snapshot(&run);
    let again = run_ok(folder.path(), &["evaluate", "run", "--json"]).json();
    let largest = again["largest_difference_from_run"].as_f64().unwrap();
    assert!(largest < 1e-6, "{largest}");
    assert_eq!(again["metrics"]["rows"].as_array().unwrap().len(), 3);
    assert_eq!(again["metrics"], read_json(&run.join("metrics.json")));
    assert!(run_ok(folder.path(), &["evaluate", "run"]).stdout.contains("largest difference"));

    // The same cameras, with PSFs by waves.
    let by = |kind: &str| run_ok(folder.path(), &["evaluate", "run", "--psf", kind, "--json"]).json();
    assert_eq!(by("geometric"), again);
    let waves = by("diffraction");
    for (row, of_rays) in
        waves["metrics"]["rows"].as_array().unwrap().iter().zip(again["metrics"]["rows"].as_array().unwrap())
    {
        let psnr_db = |row: &serde_json::Value| row["psnr_db"].as_f64().unwrap();
        let difference = (psnr_db(row) - psnr_db(of_rays)).abs();
        assert!(difference > 1e-3 && difference < 3.0, "{row}");
        assert_eq!(row["rms_spot_um"], of_rays["rms_spot_um"]);
    }
    assert!(waves["largest_difference_from_run"].as_f64().unwrap() > 1e-3);
    run_fails(folder.path(), &["evaluate", "run", "--psf", "waves"], 2, &["diffraction"]);
    assert_same_files(&before, &snapshot(&run));

    // A changed figure is detected.
    let mut metrics = read_json(&run.join("metrics.json"));
    metrics["rows"][2]["psnr_db"] = serde_json::json!(99.0);
    std::fs::write(run.join("metrics.json"), metrics.to_string()).unwrap();
    let said = run_ok(folder.path(), &["evaluate", "run", "--json"]);
    assert!(said.says("run: metrics.json is not as the run wrote it"), "{}", said.stderr);
    let again = said.json();
    assert!(again["largest_difference_from_run"].as_f64().unwrap() > 10.0);
    assert_eq!(again["largest_difference_of"], "end-to-end PSNR dB");
}

#[test]
#[ignore = "makes and scores many cameras; `cargo xtask full` runs it"]
fn cameras_are_made_with_tolerances_and_scored() {
    let folder = tempfile::tempdir().unwrap();
    let run = finished_run(folder.path());
    let before = read(&run.join("metrics.json"));
    let evaluate = |more: &[&str]| {
        let args = [&["evaluate", "run", "--json", "--trials", "6", "--pictures", "2"], more].concat();
        run_ok(folder.path(), &args).json()["made"].clone()
    };
    let made = evaluate(&["--tolerances", "commercial"]);
    assert_eq!(read(&run.join("metrics.json")), before);
    assert_eq!(read_json(&run.join("tolerance.json")), made);
    assert_eq!(evaluate(&["--tolerances", "commercial"]), made);
    assert!(made["left_out"].as_u64().unwrap() > 10 && made["is_refocused"] == true, "{made}");
    let psnr =
        |made: &Value, row: usize, key: &str| made["rows"][row]["scores"]["psnr_db"][key].as_f64().unwrap();
    for (row, camera) in CAMERAS.iter().enumerate() {
        assert_eq!(made["rows"][row]["camera"], *camera);
        assert_eq!(made["rows"][row]["trials"].as_array().unwrap().len(), 6);
        assert!(psnr(&made, row, "of_90_percent") <= psnr(&made, row, "mean"));
        // Made cameras differ from the drawn one, but not by much.
        let loss = psnr(&made, row, "drawn") - psnr(&made, row, "mean");
        assert!(loss != 0.0 && loss.abs() < 3.0, "{camera}: {loss}");
    }
    // The limit is what the first camera reaches as drawn, or what is given for the first score.
    assert_eq!(made["limits"]["psnr_db"].as_f64().unwrap(), psnr(&made, 0, "drawn"));
    let given = evaluate(&["--tolerances", "commercial", "--limit", "0.01"]);
    assert_eq!(given["limits"]["one_minus_lpips"], 0.01);
    assert_eq!(given["rows"][2]["scores"]["one_minus_lpips"]["share"], 1.0);
    let html = read(&run.join("report.html"));
    assert!(html.contains("<h2>As made</h2>") && html.contains("commercial grade"));
    assert!(html.contains("None is calibrated"));

    // Errors that no camera notices leave the drawn one: the image plane stays where the design wants it.
    std::fs::write(folder.path().join("exact.toml"), "[[tolerance]]\nsurface = 1\nthickness_mm = 1e-9\n")
        .unwrap();
    let exact = evaluate(&["--tolerances", "exact.toml"]);
    assert_eq!(exact["left_out"], 0);
    for row in 0..CAMERAS.len() {
        let loss = psnr(&exact, row, "drawn") - psnr(&exact, row, "mean");
        assert!(loss.abs() < 2e-3, "{}: {loss}", CAMERAS[row]);
    }
    // Without refocusing, errors of the focus cost more.
    let file = "[[tolerance]]\nsurface = 7\nthickness_mm = 0.3\n";
    std::fs::write(folder.path().join("focus.toml"), file).unwrap();
    let blurred = evaluate(&["--tolerances", "focus.toml", "--no-refocus"]);
    assert!(psnr(&blurred, 1, "drawn") - psnr(&blurred, 1, "mean") > 0.1, "{blurred}");
    // A camera that knows its lens divides more of this blur out.
    let calibrated = evaluate(&["--tolerances", "focus.toml", "--no-refocus", "--calibrate"]);
    assert!(blurred["is_calibrated"] == false && calibrated["is_calibrated"] == true);
    assert!(psnr(&calibrated, 1, "mean") > psnr(&blurred, 1, "mean") + 0.05, "{calibrated} {blurred}");
    let refocused = evaluate(&["--tolerances", "focus.toml"]);
    assert!((psnr(&refocused, 1, "drawn") - psnr(&refocused, 1, "mean")).abs() < 0.01, "{refocused}");
    run_fails(folder.path(), &["evaluate", "run", "--trials", "3"], 2, &["--tolerances"]);
    run_fails(folder.path(), &["evaluate", "run", "--tolerances", "none.toml"], 2, &["none.toml"]);
    // A wrong file is found before any camera is scored.
    let scored = |outcome: Outcome| outcome.says("scoring nominal");
    assert!(scored(run_ok(folder.path(), &["evaluate", "run"])));
    std::fs::write(folder.path().join("wrong.toml"), "[[tolerance]]\nsurface = 99\nradius_percent = 1.0\n")
        .unwrap();
    let wrong = &["evaluate", "run", "--tolerances", "wrong.toml"];
    assert!(!scored(run_fails(folder.path(), wrong, 2, &["wrong.toml", "99"])));
}

#[test]
fn a_run_is_never_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    finished_run(folder.path());
    let again = ["design", "tiny.toml", "--out", "run"];
    run_fails(folder.path(), &again, 2, &["run: this folder already holds a run", "--resume run"]);
    // Checkpoints without an experiment would count as those of the new run.
    std::fs::remove_file(folder.path().join("run/config.toml")).unwrap();
    run_fails(folder.path(), &again, 2, &["run: this folder holds checkpoints", "--out"]);
    // Nor does one come among files of the user, whether it is checked or begun.
    std::fs::create_dir_all(folder.path().join("mine/pictures")).unwrap();
    for file in ["mine/report.html", "mine/pictures/a.png"] {
        std::fs::write(folder.path().join(file), "mine").unwrap();
    }
    for more in [&[][..], &["--check"], &["--force"]] {
        let args = [&["design", "tiny.toml", "--out", "mine"], more].concat();
        let says = ["mine: this folder is not empty: pictures, report.html", "choose another with --out"];
        run_fails(folder.path(), &args, 2, &says);
    }
}

#[test]
fn a_camera_that_restores_is_designed_and_evaluated() {
    let folder = tempfile::tempdir().unwrap();
    let with = |restore: bool, kind: &str| {
        let mut table: toml::Table = tiny_experiment().parse().unwrap();
        let mut set = |section: &str, key: &str, value: toml::Value| {
            table[section].as_table_mut().unwrap().insert(key.to_owned(), value).unwrap();
        };
        set("development", "restore", toml::Value::Boolean(restore));
        set("network", "kind", toml::Value::String(kind.to_owned()));
        std::fs::write(folder.path().join("restoring.toml"), toml::to_string(&table).unwrap()).unwrap();
    };
    for kind in ["restoration", "restoration-naf"] {
        with(true, kind);
        run_ok(folder.path(), &["design", "restoring.toml", "--out", kind]);
        let again = run_ok(folder.path(), &["evaluate", kind, "--json"]).json();
        assert_eq!(again["largest_difference_from_run"], 0.0);
    }
    // A network that needs a restored picture is not put behind a camera that makes none.
    with(false, "restoration-naf");
    run_fails(
        folder.path(),
        &["design", "restoring.toml", "--out", "x"],
        2,
        &["kind", "development.restore"],
    );
}

/// The tiny experiment with a hardware ISP and a lens without aberrations.
fn hardware_experiment() -> String {
    let mut table: toml::Table = tiny_experiment().parse().unwrap();
    for unused in ["development", "isp", "network", "variant"] {
        table.remove(unused);
    }
    let more = r#"
[isp]
preset = "mine.toml"
vary = ["sharpen", "luma_denoise"]
steps = 4
[[variant]]
name = "nominal"
[[variant.stage]]
moves = ["isp"]
[[variant]]
name = "perfect"
lens = "perfect"
[[variant.stage]]
moves = ["isp"]
schedule = { isp = { method = "evolution", steps = 2 } }
[[variant]]
name = "end-to-end"
from = "nominal"
[[variant.stage]]
moves = ["optics", "isp"]
[[variant]]
name = "isp-frozen"
[[variant.stage]]
moves = ["optics"]
"#;
    toml::to_string(&table).unwrap() + more
}

#[test]
fn a_run_with_a_hardware_isp_stands_on_its_own_and_is_scored_again() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("in")).unwrap();
    std::fs::write(folder.path().join("in/hardware.toml"), hardware_experiment()).unwrap();
    let preset = read(&data("isp/quality.toml"));
    std::fs::write(folder.path().join("in/mine.toml"), &preset).unwrap();
    let said = run_ok(folder.path(), &["design", "in/hardware.toml", "--out", "run"]);
    assert!(said.stdout.contains("ISP steps") && said.stdout.contains("Share of the gap"), "{}", said.stdout);
    std::fs::remove_file(folder.path().join("in/mine.toml")).unwrap();
    let run = folder.path().join("run");
    let rows = read_json(&run.join("metrics.json"))["rows"].clone();
    let of = |row: usize, key: &str| rows[row][key].clone();
    assert_eq!([of(0, "isp_steps"), of(1, "isp_steps"), of(2, "isp_steps")], [4, 2, 8]);
    assert_eq!(of(1, "is_ceiling"), true);
    assert!(of(1, "restored_error_percent").as_f64() < of(0, "restored_error_percent").as_f64());
    // A lens alone moves behind an ISP that stays.
    assert!(of(3, "isp_steps").is_null() && of(3, "rms_spot_um") != of(0, "rms_spot_um"));
    assert_eq!(read(&run.join("report.html")).matches("Parameters that moved").count(), 3);
    // Once more, from another folder.
    let again = run_ok(&run, &["evaluate", "."]);
    assert!(again.stdout.contains("own figures: 0.000e0"), "{}", again.stdout);
    // Another preset would have other truths.
    std::fs::write(run.join("inputs/isp.toml"), preset.replace("menon", "malvar")).unwrap();
    run_fails(folder.path(), &["evaluate", "run"], 2, &["not those that this run began with"]);
}

/// What an extension adds goes on with the network that imitates the ISP, as a later stage of a run does.
#[test]
fn a_run_through_a_network_that_imitates_the_isp_is_extended() {
    let folder = tempfile::tempdir().unwrap();
    let mut table: toml::Table = tiny_experiment().parse().unwrap();
    for unused in ["development", "isp", "network", "variant"] {
        table.remove(unused);
    }
    let more = "[isp]\npreset = \"quality\"\nvary = [\"sharpen\"]\nsteps = 6\nproxy_warm_up = 4\nproxy_steps = 1\n\
        [[variant]]\nname = \"nominal\"\n[[variant.stage]]\nmoves = [\"isp\"]\nschedule = { isp = { method = \"proxy\" } }\n";
    std::fs::write(folder.path().join("tiny.toml"), toml::to_string(&table).unwrap() + more).unwrap();
    run_ok(folder.path(), &["design", "tiny.toml", "--out", "run"]);
    let before = read(&folder.path().join("run/metrics.json"));
    run_ok(folder.path(), &["design", "--resume", "run", "--extend-to", "9"]);
    let extended = read(&folder.path().join("run/metrics.json"));
    assert_ne!(extended, before);
    run_ok(folder.path(), &["design", "run/config.toml", "--out", "whole"]);
    assert_eq!(read(&folder.path().join("whole/metrics.json")), extended);
}

#[test]
fn a_run_of_an_earlier_version_lacks_keys_that_are_younger() {
    let folder = tempfile::tempdir().unwrap();
    let run = finished_run(folder.path());
    for file in ["config.toml", "run.json"] {
        let text = read(&run.join(file));
        let without = match file {
            "config.toml" => {
                let mut table: toml::Table = text.parse().unwrap();
                table.remove("isp").unwrap();
                table["spot"].as_table_mut().unwrap().remove("rounds").unwrap();
                toml::to_string(&table).unwrap()
            }
            _ => {
                let mut record: serde_json::Value = serde_json::from_str(&text).unwrap();
                record["config"].as_object_mut().unwrap().remove("isp").unwrap();
                record["config"]["spot"].as_object_mut().unwrap().remove("rounds").unwrap();
                serde_json::to_string(&record).unwrap()
            }
        };
        std::fs::write(run.join(file), without).unwrap();
    }
    // Nor had its record a digest.
    std::fs::remove_file(run.join("digests.json")).unwrap();
    let again = run_ok(folder.path(), &["evaluate", "run"]);
    assert!(again.stdout.contains("own figures: 0.000e0"), "{}", again.stdout);
    run_ok(folder.path(), &["report", "run"]);
    run_ok(folder.path(), &["design", "--resume", "run"]);
    // One that is finished by this version is still whole.
    std::fs::remove_file(run.join("metrics.json")).unwrap();
    let mut record: serde_json::Value = serde_json::from_str(&read(&run.join("run.json"))).unwrap();
    record["finished"] = serde_json::Value::Null;
    std::fs::write(run.join("run.json"), serde_json::to_string(&record).unwrap()).unwrap();
    run_ok(folder.path(), &["design", "--resume", "run"]);
    assert!(read_json(&run.join("run.json"))["finished"]["seconds"].is_number());
    run_ok(folder.path(), &["evaluate", "run"]);
    // A key that its record has was lost.
    let config = read(&run.join("config.toml"));
    std::fs::write(run.join("config.toml"), config.replace("iterations = 3\n", "")).unwrap();
    run_fails(folder.path(), &["design", "--resume", "run"], 2, &["spot.iterations", "is missing"]);
}

/// `network.safetensors` has a header of JSON and, for every tensor, the bytes that the run itself reads its network from.
fn assert_weights_are_readable(camera: &Path) {
    let own = std::fs::read(camera.join("blocks/network/weights.bin")).unwrap();
    let file = std::fs::read(camera.join("network.safetensors")).unwrap();
    let (length, rest) = file.split_first_chunk::<8>().unwrap();
    let (header, data) = rest.split_at(u64::from_le_bytes(*length) as usize);
    let header: serde_json::Value = serde_json::from_slice(header).unwrap();
    let tensors = header.as_object().unwrap();
    assert!(tensors.keys().any(|name| name.ends_with("weight")), "{:?}", tensors.keys());
    let mut read = 0;
    for (name, tensor) in tensors {
        let number = |value: &serde_json::Value| value.as_u64().unwrap() as usize;
        let [start, end] = [0, 1].map(|i| number(&tensor["data_offsets"][i]));
        let values: usize = tensor["shape"].as_array().unwrap().iter().map(number).product();
        assert_eq!((end - start, tensor["dtype"].as_str()), (4 * values, Some("F32")), "{name}");
        let bytes = &data[start..end];
        assert!(own.windows(bytes.len()).any(|part| part == bytes), "{name} is not in weights.bin");
        read += bytes.len();
    }
    assert_eq!(read, data.len());
}

/// The ten-line ISP of the manual, a command outside this program, in a camera that is designed: its parameters move, its pictures are scored, and
/// the run can be scored again. A description whose command fails loses nothing.
#[test]
#[cfg(unix)]
fn a_command_outside_this_program_is_the_isp_of_a_design() {
    let folder = tempfile::tempdir().unwrap();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../book/src/examples");
    std::fs::create_dir(folder.path().join("lab")).unwrap();
    for name in ["external-isp.sh", "external-isp.toml"] {
        std::fs::copy(examples.join(name), folder.path().join("lab").join(name)).unwrap();
    }
    let mut table: toml::Table = tiny_experiment().parse().unwrap();
    let isp: toml::Table =
        "preset = \"lab/external-isp.toml\"\nvary = [\"tone\"]\nsteps = 2".parse().unwrap();
    table.insert("isp".to_owned(), isp.into());
    let variants: toml::Table = "[[variant]]\nname = \"tuned\"\n[[variant.stage]]\nmoves = [\"isp\"]\n\
                                 schedule.isp.method = \"evolution\"\n"
        .parse()
        .unwrap();
    table.extend(variants);
    std::fs::write(folder.path().join("lab.toml"), toml::to_string(&table).unwrap()).unwrap();
    run_ok(folder.path(), &["design", "lab.toml", "--out", "run"]);
    let run = folder.path().join("run");
    let row = &read_json(&run.join("metrics.json"))["rows"][0];
    assert!(row["camera"] == "tuned" && row["psnr_db"].as_f64().unwrap() > 5.0, "{row}");
    let places = read_json(&run.join("cameras/tuned/blocks/isp/places.json"));
    assert_eq!(places.as_array().unwrap().len(), 2);
    run_ok(folder.path(), &["evaluate", "run"]);

    // A command that fails ends the run with what it said; once it is repaired, the run goes on to the same figures.
    let script = folder.path().join("lab/external-isp.sh");
    let works = read(&script);
    std::fs::write(&script, "echo no lamp >&2; exit 3\n").unwrap();
    let outcome = common::run(folder.path(), &["design", "lab.toml", "--out", "broken"]);
    assert_eq!(outcome.code, Some(1), "{}", outcome.stderr);
    assert!(outcome.says("Ten-line ISP") && outcome.says("no lamp"), "{}", outcome.stderr);
    let broken = folder.path().join("broken");
    assert!(!broken.join("metrics.json").exists());
    std::fs::write(&script, works).unwrap();
    run_ok(folder.path(), &["design", "--resume", "broken"]);
    assert_eq!(read_json(&broken.join("metrics.json"))["rows"], read_json(&run.join("metrics.json"))["rows"]);
}

#[test]
fn a_run_by_a_call_names_its_job() {
    let folder = tempfile::tempdir().unwrap();
    write_tiny(folder.path());
    let new = serde_json::json!({"experiment": "tiny.toml", "out": "run", "changes": {"variant": "nominal"}});
    let call = serde_json::json!({"format": 1, "job": "design", "request": {"run": {"new": new}}});
    std::fs::write(folder.path().join("call.json"), call.to_string()).unwrap();
    run_ok(folder.path(), &["call", "call.json"]);
    let environment = read_json(&folder.path().join("run/environment.json"));
    assert_eq!(environment["command"], "petzval call # job design");
    assert!(read(&folder.path().join("run/report.html")).contains("petzval call # job design"));
}
