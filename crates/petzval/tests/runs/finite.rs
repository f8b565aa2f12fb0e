//! What is no number has no score: damaged weights end with a sentence, and never in a score or a picture.

use std::path::{Path, PathBuf};

use crate::common::*;

/// Overwrites the last value of a file of weights, 32-bit floats, by one that is none.
fn poison(path: &Path) {
    let mut bytes = std::fs::read(path).unwrap();
    let last = bytes.len() - 4;
    bytes[last..].copy_from_slice(&f32::NAN.to_le_bytes());
    std::fs::write(path, bytes).unwrap();
}

fn weights_of(run: &Path, camera: &str) -> PathBuf {
    let files = snapshot(&run.join("cameras").join(camera));
    let found = files.into_keys().find(|path| path.file_name().is_some_and(|name| name == "weights.bin"));
    found.expect("a camera keeps its weights")
}

#[test]
fn weights_that_are_no_numbers_are_refused_before_a_score_or_a_picture() {
    let folder = tempfile::tempdir().unwrap();
    let run = finished_run(folder.path());
    let photo = data("photos/coffee.png").display().to_string();

    // Those of a file that an experiment starts from.
    let given = folder.path().join("given.safetensors");
    std::fs::copy(run.join("cameras/nominal/network.safetensors"), &given).unwrap();
    poison(&given);
    let mut table: toml::Table = tiny_experiment().parse().unwrap();
    let network = table["network"].as_table_mut().unwrap();
    network.insert("weights".to_owned(), toml::Value::String("given.safetensors".to_owned())).unwrap();
    let text = toml::to_string(&table).unwrap();
    std::fs::write(folder.path().join("given.toml"), text).unwrap();
    let needles = ["given.safetensors", "is not finite everywhere"];
    run_fails(folder.path(), &["design", "given.toml", "--out", "other"], 2, &needles);

    // Those of a finished camera.
    poison(&weights_of(&run, "nominal"));
    for args in [
        &["evaluate", "run"][..],
        &["apply", "run", &photo, "--camera", "nominal", "--out", "applied"],
        &["evaluate", "run", "--json"],
    ] {
        // The file is not the one that was written; and who means it has no score either.
        run_fails(folder.path(), args, 2, &["cameras/nominal", "weights.bin"]);
        let accepted = [args, &["--accept-changed", "cameras/nominal"]].concat();
        run_fails(folder.path(), &accepted, 2, &["cameras/nominal", "not finite everywhere"]);
    }
}
