//! Runs that are moved, damaged, changed or led astray, and finished cameras on other pictures.

use std::path::{Path, PathBuf};

use crate::common::*;
use serde_json::Value;

/// A folder `work` with the tiny experiment on three photographs of its own, `work/photos`, of which one is scored.
fn work_with_photos(folder: &Path) -> PathBuf {
    let work = folder.join("work");
    copy_photos(&work.join("photos"), &["astronaut.png", "chelsea.png", "coffee.png"]);
    let text = tiny_experiment().replace("photos = \"built-in\"", "photos = \"photos\"");
    let text = text.replace("[scoring]\n", "[scoring]\npictures = 1\n");
    std::fs::write(work.join("tiny.toml"), text).unwrap();
    work
}

fn copy_photos(to: &Path, names: &[&str]) {
    std::fs::create_dir_all(to).unwrap();
    for name in names {
        std::fs::copy(data("photos").join(name), to.join(name)).unwrap();
    }
}

/// Flips the lowest bit of a byte in the middle of a file.
fn flip_a_bit(path: &Path) {
    let mut bytes = std::fs::read(path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(path, bytes).unwrap();
}

/// The latest checkpoint of a run by its name, `step-000021`.
fn latest_checkpoint(run: &Path) -> String {
    let entries = std::fs::read_dir(run.join("checkpoints")).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    names.filter(|name| name.starts_with("step-")).max().unwrap()
}

#[test]
fn a_run_is_moved_with_its_photographs_and_its_photographs_alone() {
    let folder = tempfile::tempdir().unwrap();
    let work = work_with_photos(folder.path());
    run_ok(&work, &["design", "tiny.toml", "--out", "runs/run"]);
    let config: toml::Table = read(&work.join("runs/run/config.toml")).parse().unwrap();
    assert_eq!(config["photos"].as_str(), Some("../../photos"), "relative to the run");
    let metrics = read(&work.join("runs/run/metrics.json"));
    // Name, size, time and content of every picture.
    let list = read_json(&work.join("runs/run/inputs/inputs.json"));
    let files = list["pictures"]["files"].as_array().unwrap();
    let of_file =
        |name: &str, key: &str| files.iter().find(|file| file["name"] == name).unwrap()[key].clone();
    let size = std::fs::metadata(work.join("photos/coffee.png")).unwrap().len();
    assert_eq!((files.len(), of_file("coffee.png", "bytes")), (3, Value::from(size)));
    assert_eq!(of_file("coffee.png", "list"), "held-out");
    assert!(of_file("chelsea.png", "modified_s").is_u64());
    assert_eq!(of_file("chelsea.png", "sha256").as_str().unwrap().len(), 64);

    // Copies of its own pictures under other names, without the rest, are no held-out ones.
    let copies = work.join("copies");
    std::fs::create_dir(&copies).unwrap();
    for (name, copy) in [("astronaut.png", "1.png"), ("chelsea.png", "2.png")] {
        std::fs::copy(work.join("photos").join(name), copies.join(copy)).unwrap();
    }
    let said = run_ok(&work, &["evaluate", "runs/run", "--photos", "copies"]);
    assert!(said.says("has been trained on 1 of the 1 pictures of copies"), "{}", said.stderr);
    assert!(said.says("not scored, by `scoring.pictures`: 1 further picture"), "{}", said.stderr);
    assert!(!said.says("held-out picture") && !said.says("all of them"), "{}", said.stderr);
    std::fs::remove_dir_all(&copies).unwrap();

    // All together.
    let moved = folder.path().join("moved");
    std::fs::rename(&work, &moved).unwrap();
    assert!(run_ok(&moved, &["evaluate", "runs/run"]).stdout.contains("own figures: 0.000e0"));
    // The photographs alone: what needs none of them works, and what needs them says how.
    std::fs::rename(moved.join("photos"), moved.join("elsewhere")).unwrap();
    let photo = data("photos/china.png").display().to_string();
    run_ok(&moved, &["report", "runs/run"]);
    run_ok(&moved, &["apply", "runs/run", &photo, "--camera", "nominal"]);
    run_ok(&moved, &["compare", "runs/run"]);
    let needles = ["the photographs of this run are not at", "photos", "--photos PATH"];
    run_fails(&moved, &["evaluate", "runs/run"], 2, &needles);
    run_fails(&moved, &["design", "--resume", "runs/run", "--extend-to", "5"], 2, &needles);
    let nowhere = ["design", "--resume", "runs/run", "--photos", "nowhere"];
    run_fails(&moved, &nowhere, 2, &["--photos nowhere", "no such folder"]);
    run_fails(
        &moved,
        &["evaluate", "runs/run", "--data", "elsewhere"],
        2,
        &["--data", "the run makes pictures"],
    );
    let said = run_ok(&moved, &["evaluate", "runs/run", "--photos", "elsewhere"]);
    assert!(said.stdout.contains("own figures: 0.000e0"), "{}", said.stdout);
    assert!(said.says("elsewhere holds the pictures of the run"), "{}", said.stderr);
    // A run that goes on remembers where they are.
    std::fs::remove_file(moved.join("runs/run/metrics.json")).unwrap();
    run_ok(&moved, &["design", "--resume", "runs/run", "--photos", "elsewhere"]);
    assert_eq!(read(&moved.join("runs/run/metrics.json")), metrics);
    assert!(run_ok(&moved, &["evaluate", "runs/run"]).stdout.contains("own figures: 0.000e0"));
    // Of an input that changed the name is said, with size and time.
    copy_photos(&moved.join("elsewhere"), &["china.png"]);
    std::fs::copy(data("photos/china.png"), moved.join("elsewhere/chelsea.png")).unwrap();
    let needles =
        ["not those that this run began with", "the picture chelsea.png (", "bytes of 2", "and now"];
    run_fails(&moved, &["evaluate", "runs/run"], 2, &needles);
}

#[test]
fn photographs_of_a_run_are_known_by_content_under_other_names_and_in_another_order() {
    let folder = tempfile::tempdir().unwrap();
    let work = work_with_photos(folder.path());
    // A list holds out its last picture, chelsea.png, and the folder coffee.png.
    let list = "photos/coffee.png\nphotos/astronaut.png\nphotos/chelsea.png\n";
    std::fs::write(work.join("list.txt"), list).unwrap();
    run_ok(&work, &["design", "tiny.toml", "--photos", "list.txt", "--out", "run"]);
    let swapped = work.join("swapped");
    std::fs::create_dir(&swapped).unwrap();
    let others = [("coffee", "astronaut"), ("astronaut", "chelsea"), ("chelsea", "coffee")];
    for (from, to) in others.map(|names| (format!("{}.png", names.0), format!("{}.png", names.1))) {
        std::fs::copy(work.join("photos").join(from), swapped.join(to)).unwrap();
    }
    for place in ["photos", "swapped"] {
        let said = run_ok(&work, &["evaluate", "run", "--photos", place]);
        assert!(said.stdout.contains("own figures: 0.000e0"), "{place}: {}", said.stdout);
        assert!(said.says(&format!("{place} holds the pictures of the run")), "{}", said.stderr);
        assert!(!said.says("has been trained on"), "{}", said.stderr);
    }
    // With a picture more it is another set.
    copy_photos(&swapped, &["china.png", "rocket.png"]);
    let said = run_ok(&work, &["evaluate", "run", "--photos", "swapped"]);
    assert!(said.says("has been trained on"), "{}", said.stderr);
}

#[test]
fn finished_cameras_are_scored_on_other_pictures_with_ranges() {
    let folder = tempfile::tempdir().unwrap();
    let run = finished_run(folder.path());
    let before = snapshot(&run);
    copy_photos(&folder.path().join("other"), &["china.png", "chelsea.png", "rocket.png"]);
    let other = ["evaluate", "run", "--photos", "other"];
    let found = run_ok(folder.path(), &[&other[..], &["--json"]].concat()).json();
    assert_eq!(
        (found["other_pictures"].as_str(), &found["largest_difference_from_run"]),
        (Some("other"), &Value::Null)
    );
    let metrics = &found["metrics"];
    assert_eq!(
        (metrics["held_out_images"].as_u64(), metrics["rows"].as_array().unwrap().len()),
        (Some(3), 3)
    );
    for row in metrics["rows"].as_array().unwrap() {
        let pictures = row["pictures"].as_array().unwrap();
        let psnr: Vec<f64> = pictures.iter().map(|picture| picture["psnr_db"].as_f64().unwrap()).collect();
        let (mean, [low, high]) = (
            psnr.iter().sum::<f64>() / 3.0,
            [0, 1].map(|i| row["intervals"]["psnr_db"][i].as_f64().unwrap()),
        );
        assert!((mean - row["psnr_db"].as_f64().unwrap()).abs() < 1e-9);
        // Draws of three photographs lie between the least and the best of them, but for the rounding of a mean.
        let (least, most) =
            (psnr.iter().copied().fold(f64::INFINITY, f64::min), psnr.iter().copied().fold(0.0, f64::max));
        assert!(
            least <= low + 1e-9 && low < mean && mean < high && high <= most + 1e-9,
            "{least} {low} {mean} {high} {most}"
        );
    }
    // Differences are those of the same photographs.
    let difference = &found["differences"][0];
    let psnr = |i: usize| metrics["rows"][i]["psnr_db"].as_f64().unwrap();
    assert_eq!([&difference["camera"], &difference["against"]], ["end-to-end", "nominal"]);
    assert!((difference["scores"]["psnr_db"].as_f64().unwrap() - (psnr(2) - psnr(0))).abs() < 1e-9);
    assert!(difference["ranges"]["psnr_db"][0].is_f64());
    let said = run_ok(folder.path(), &other);
    // The run was trained on a picture of the same content.
    assert_eq!(found["trained_on"], 1);
    for words in [
        "95 % range of",
        "end-to-end less nominal, PSNR dB: ",
        "means over 3 photographs at",
        "pictures (1 of them trained the run): other",
    ] {
        assert!(said.stdout.contains(words), "{words}: {}", said.stdout);
    }
    assert!(said.says("has been trained on 1 of the 3 pictures of other"), "{}", said.stderr);
    assert!(said.says("scored pictures (3)") && !said.says("held-out pictures"), "{}", said.stderr);
    // One photograph has no range.
    copy_photos(&folder.path().join("one"), &["china.png"]);
    let one = run_ok(folder.path(), &["evaluate", "run", "--photos", "one"]);
    assert!(one.stdout.contains("none: one photograph"), "{}", one.stdout);
    assert!(one.stdout.contains("other pictures than those of the run: one"), "{}", one.stdout);
    assert!(!one.says("has been trained on"), "{}", one.stderr);
    let made = ["evaluate", "run", "--photos", "other", "--tolerances", "default"];
    run_fails(folder.path(), &made, 2, &["--photos other", "other pictures than those of the run"]);
    std::fs::create_dir(folder.path().join("empty")).unwrap();
    run_fails(folder.path(), &["evaluate", "run", "--photos", "empty"], 2, &["empty"]);
    assert_same_files(&before, &snapshot(&run));
}

#[test]
fn a_damaged_checkpoint_gives_way_to_the_one_before() {
    let folder = tempfile::tempdir().unwrap();
    let run = finished_run(folder.path());
    let [whole, again] = ["whole", "again"].map(|name| folder.path().join(name));
    copy_folder(&run, &whole);
    copy_folder(&run, &again);
    run_ok(folder.path(), &["design", "--resume", "whole", "--extend-to", "5"]);
    let metrics = read(&whole.join("metrics.json"));

    let latest = latest_checkpoint(&run);
    let weights = format!("checkpoints/{latest}/blocks/network/weights.bin");
    flip_a_bit(&run.join(&weights));
    let accepted = folder.path().join("accepted");
    copy_folder(&run, &accepted);
    let extend = ["design", "--resume", "run", "--extend-to", "5"];
    let said = run_ok(folder.path(), &extend);
    for words in [&weights, "is not as the run wrote it", "the run goes on from the one of step"] {
        assert!(said.says(words), "{words}: {}", said.stderr);
    }
    assert!(run.join(format!("checkpoints/damaged-{latest}")).is_dir(), "nothing is lost");
    assert_eq!(read(&run.join("metrics.json")), metrics, "the same bits from the one before");

    // Who means the change says so.
    let means = ["design", "--resume", "accepted", "--extend-to", "5", "--accept-changed", &weights];
    let said = run_ok(folder.path(), &means);
    assert!(said.says(&format!("{weights} is not as the run wrote it; accepted")), "{}", said.stderr);
    assert!(!said.says("the run goes on from the one of step"));

    // With no whole checkpoint nothing goes on.
    std::fs::remove_file(run.join("metrics.json")).unwrap();
    for entry in std::fs::read_dir(run.join("checkpoints")).unwrap() {
        let position = entry.unwrap().path().join("position.json");
        std::fs::write(&position, "{").unwrap();
    }
    let needles = [
        "no checkpoint of this run is whole",
        "position.json is not as the run wrote it",
        "--accept-changed",
    ];
    let said = run_fails(folder.path(), &["design", "--resume", "run"], 2, &needles);
    assert!(!said.stderr.contains("hint:"), "one hint in another: {}", said.stderr);

    // As the hint says: without the folder the run begins again, to the same bits. A finished one does not begin again.
    let metrics = read(&again.join("metrics.json"));
    std::fs::remove_file(again.join("metrics.json")).unwrap();
    std::fs::remove_dir_all(again.join("checkpoints")).unwrap();
    let said = run_ok(folder.path(), &["design", "--resume", "again"]);
    assert!(said.says("no checkpoint is left, and the run begins again"), "{}", said.stderr);
    assert_eq!(read(&again.join("metrics.json")), metrics);
    std::fs::remove_dir_all(again.join("checkpoints")).unwrap();
    let needles =
        ["the run is finished, and its checkpoints are gone", "design again/config.toml --out FOLDER"];
    for args in [&["design", "--resume", "again"][..], &["design", "--resume", "again", "--extend-to", "5"]] {
        run_fails(folder.path(), args, 2, &needles);
    }
}

#[test]
fn a_checkpoint_with_a_wrong_digest_of_the_events_gives_way_to_the_one_before() {
    let folder = tempfile::tempdir().unwrap();
    let run = finished_run(folder.path());
    let metrics = read(&run.join("metrics.json"));
    std::fs::remove_file(run.join("metrics.json")).unwrap();
    let latest = latest_checkpoint(&run);
    let path = run.join(format!("checkpoints/{latest}/digests.json"));
    let mut digests = read_json(&path);
    digests["events"]["sha256"] = Value::from("0".repeat(64));
    std::fs::write(&path, digests.to_string()).unwrap();
    let events = read(&run.join("events.jsonl"));
    let said = run_ok(folder.path(), &["design", "--resume", "run"]);
    let named = format!("checkpoints/{latest}/digests.json is not as the run wrote it");
    for words in [&named[..], "the run goes on from the one of step"] {
        assert!(said.says(words), "{words}: {}", said.stderr);
    }
    let aside = run.join(format!("checkpoints/damaged-{latest}"));
    assert!(aside.join("position.json").is_file(), "nothing is lost");
    assert_eq!(read(&aside.join("events.jsonl")), events);
    assert_eq!(read(&run.join("metrics.json")), metrics, "the same bits from the one before");
}

#[test]
fn what_was_changed_in_a_finished_run_is_named_and_not_believed() {
    let folder = tempfile::tempdir().unwrap();
    let run = finished_run(folder.path());
    let changed = |name: &str, change: &dyn Fn(&Path)| {
        let copy = folder.path().join("copy");
        let _none = std::fs::remove_dir_all(&copy);
        copy_folder(&run, &copy);
        change(&copy.join(name));
    };
    let believed: [&[&str]; 4] = [
        &["report", "copy"],
        &["compare", "copy"],
        &["design", "--resume", "copy"],
        &["design", "--resume", "copy", "--extend-to", "5"],
    ];
    let edit = |path: &Path| {
        let mut metrics = read_json(path);
        metrics["rows"][2]["psnr_db"] = serde_json::json!(99.0);
        std::fs::write(path, metrics.to_string()).unwrap();
    };
    let shorten = |path: &Path| {
        let text = read(path);
        let kept: Vec<&str> = text.lines().take(3).collect();
        std::fs::write(path, kept.join("\n") + "\n").unwrap();
    };
    type Change<'a> = (&'a str, &'a dyn Fn(&Path));
    let lengthen = |path: &Path| std::fs::write(path, read(path) + "\n").unwrap();
    let cases: [Change; 7] = [
        ("metrics.json", &edit),
        ("events.jsonl", &shorten),
        ("metrics.csv", &lengthen),
        ("pictures.csv", &lengthen),
        ("run.json", &lengthen),
        ("cameras/nominal/blocks/network/weights.bin", &flip_a_bit),
        ("cameras/nominal/metrics.json", &|path| {
            std::fs::write(path, read(path).replace("\"psnr_db\": ", "\"psnr_db\": 1")).unwrap()
        }),
    ];
    for (name, change) in cases {
        changed(name, change);
        for args in believed {
            run_fails(
                folder.path(),
                args,
                2,
                &[&format!("{name} is not as the run wrote it"), &format!("--accept-changed {name}")],
            );
        }
        let said = run_ok(folder.path(), &["report", "copy", "--accept-changed", name]);
        assert!(said.says(&format!("copy: {name} is not as the run wrote it; accepted")), "{}", said.stderr);
    }
    let photo = data("photos/china.png").display().to_string();
    changed("cameras/nominal/blocks/network/weights.bin", &flip_a_bit);
    for args in [&["apply", "copy", &photo][..], &["evaluate", "copy"]] {
        run_fails(folder.path(), args, 2, &["cameras/nominal/blocks/network/weights.bin"]);
    }
    run_ok(folder.path(), &["apply", "copy", &photo, "--camera", "end-to-end"]);

    // A lens with which no camera can be set up is blamed on the change and not on the lens.
    changed("inputs/lens.toml", &|path| std::fs::write(path, "name = \"none\"\n").unwrap());
    let needles =
        ["inputs/lens.toml is not as the run wrote it, and cannot be used", "from a copy of the run"];
    for args in [&["apply", "copy", &photo][..], &["evaluate", "copy"], &["report", "copy"]] {
        run_fails(folder.path(), args, 2, &needles);
    }

    // An input that the run kept is missed in the run, and not looked for elsewhere.
    for (name, is_all) in [("inputs/sensor.toml", false), ("inputs", true)] {
        changed(name, &|path| {
            if is_all { std::fs::remove_dir_all(path).unwrap() } else { std::fs::remove_file(path).unwrap() }
        });
        let missing = format!("{name} is missing");
        for args in [&["design", "--resume", "copy"][..], &["evaluate", "copy"]] {
            run_fails(folder.path(), args, 2, &[&missing, "put it back from a copy of the run"]);
        }
    }

    // A digest that was changed in the list of inputs is no change of an input.
    changed("inputs/inputs.json", &|path| {
        let mut list = read_json(path);
        list["parts"]["sensor"] = Value::from("0".repeat(64));
        std::fs::write(path, list.to_string()).unwrap();
    });
    for args in [&["design", "--resume", "copy"][..], &["evaluate", "copy"]] {
        let list = "inputs/inputs.json is not as the run wrote it: it has another digest of the sensor";
        run_fails(folder.path(), args, 2, &[list]);
    }

    // Another sensor makes other pictures.
    changed("inputs/sensor.toml", &|path| {
        let noisy = |line: &str| {
            let kept = if line.starts_with("read_noise_e = ") { "read_noise_e = 40.0" } else { line };
            format!("{kept}\n")
        };
        let text = read(path);
        let changed: String = text.lines().map(noisy).collect();
        assert_ne!(changed, text);
        std::fs::write(path, changed).unwrap();
    });
    let needles = ["inputs are not those that this run began with: the sensor", "--accept-changed inputs"];
    run_fails(folder.path(), &["apply", "copy", &photo, "--out", "noisy"], 2, &needles);
    let accepted = ["apply", "copy", &photo, "--camera", "nominal", "--out", "noisy"];
    let said = run_ok(folder.path(), &[&accepted[..], &["--accept-changed", "inputs"]].concat());
    assert!(said.says("copy: inputs is not as the run wrote it; accepted"), "{}", said.stderr);
    // No other verb believes it either, and each takes the same way out.
    copy_photos(&folder.path().join("other"), &["china.png"]);
    for args in [
        &["report", "copy"][..],
        &["compare", "copy", "--out", "page.html"],
        &["evaluate", "copy", "--photos", "other"],
        &["evaluate", "copy"],
    ] {
        run_fails(folder.path(), args, 2, &needles);
        let said = run_ok(folder.path(), &[args, &["--accept-changed", "inputs"]].concat());
        assert!(said.says("copy: inputs is not as the run wrote it; accepted"), "{args:?} {}", said.stderr);
    }

    // Pictures that are gone or cut short are named, and the page does without them.
    let pages = [&["report", "copy"][..], &["compare", "copy", "--out", "page.html", "--force"]];
    let whole = run_ok(folder.path(), &["report", "run"]);
    assert!(!whole.says("not shown"), "{}", whole.stderr);
    let shown = read(&run.join("report.html")).matches("<img").count();
    changed("pictures/00-nominal-output.png", &|path| {
        let bytes = std::fs::read(path).unwrap();
        std::fs::write(path, &bytes[..bytes.len() / 2]).unwrap();
    });
    for args in pages {
        let said = run_ok(folder.path(), args);
        let named = "1 picture missing in the folder of the run or damaged, not shown: pictures/00-nominal-output.png";
        assert!(said.says(named), "{args:?} {}", said.stderr);
    }
    let page = read(&folder.path().join("copy/report.html"));
    assert!(page.contains("not shown: pictures/00-nominal-output.png"));
    assert!(page.matches("<img").count() < shown, "a part of a picture is shown");
    changed("pictures", &|path| std::fs::remove_dir_all(path).unwrap());
    for args in pages {
        let said = run_ok(folder.path(), args);
        assert!(
            said.says("pictures missing in the folder of the run or damaged"),
            "{args:?} {}",
            said.stderr
        );
    }

    // A run of an earlier version has no digests: it is read with one warning.
    changed("metrics.json", &edit);
    let copy = folder.path().join("copy");
    for path in snapshot(&copy).into_keys().filter(|path| path.ends_with("digests.json")) {
        std::fs::remove_file(path).unwrap();
    }
    let said = run_ok(folder.path(), &["report", "copy"]);
    assert_eq!(said.stderr.matches("have no digests").count(), 1, "{}", said.stderr);
    let said = run_ok(folder.path(), &["design", "--resume", "copy", "--extend-to", "5"]);
    assert_eq!(said.stderr.matches("have no digests").count(), 1, "{}", said.stderr);
}

#[test]
fn a_loss_that_diverges_stops_the_run_with_what_to_try() {
    let folder = tempfile::tempdir().unwrap();
    let mut table: toml::Table = tiny_experiment().parse().unwrap();
    let training = table["training"].as_table_mut().unwrap();
    for (key, value) in [("learning_rate", 1.0), ("final_learning_rate", 1.0), ("largest_gradient", 0.0)] {
        training.insert(key.to_owned(), toml::Value::Float(value));
    }
    training.insert("steps".to_owned(), toml::Value::Integer(12));
    table["checkpoint"].as_table_mut().unwrap().insert("every".to_owned(), toml::Value::Integer(1));
    std::fs::write(folder.path().join("wild.toml"), toml::to_string(&table).unwrap()).unwrap();
    let said = run(folder.path(), &["design", "wild.toml", "--variant", "nominal", "--out", "run"]);
    assert_eq!(said.code, Some(1), "{}", said.stderr);
    let last = events(&folder.path().join("run")).last().map_or(0, |event| event["step"].as_u64().unwrap());
    for words in [
        format!("nominal, network, step {}: the loss diverges", last + 1),
        format!("the last good checkpoint is that of step {last}"),
        "lower the learning rate of the network in a copy of run/config.toml, now 1 at its start".to_owned(),
    ] {
        assert!(said.says(&words), "{words}: {}", said.stderr);
    }
    assert!(!folder.path().join("run/metrics.json").exists());
}

#[test]
fn a_run_that_goes_on_with_another_instruction_set_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let run = finished_run(folder.path());
    let mut begun = read_json(&run.join("environment.json"));
    begun["simd_used"] = Value::from("another");
    std::fs::write(run.join("environment.json"), begun.to_string()).unwrap();
    let said = run_ok(folder.path(), &["design", "--resume", "run"]);
    assert!(said.says("begun with the instruction set another, and goes on with"), "{}", said.stderr);
}
