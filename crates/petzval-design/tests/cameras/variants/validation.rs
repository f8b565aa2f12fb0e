//! Held-out windows that say when a stage was at its best.

use std::path::Path;

use crate::common::library;
use petzval_design::experiment::Experiment;
use petzval_design::run::{Event, read_events};
use petzval_design::setup::Setup;
use petzval_design::task::Remark;
use petzval_learn::Device;

use super::{JOINT, NETWORK, TINY, run, variant};

const VALIDATION: &str = "[validation]\nevery = 2\nwindows = 3\n";

/// The validations of a run: step, camera, block and loss.
fn validations(folder: &Path) -> Vec<(u64, String, String, f64)> {
    let events = read_events(&folder.join("events.jsonl")).unwrap();
    let of = |e: Event| Some((e.step, e.camera, e.block, *e.losses.get("validation")?));
    events.into_iter().filter_map(of).collect()
}

#[test]
fn a_stage_ends_with_the_numbers_of_its_best_validation() {
    let folder = tempfile::tempdir().unwrap();
    // A rate at which the network gets worse.
    let wild = variant(
        "a",
        &format!(
            "{NETWORK}schedule = {{ network = {{ learning_rate = 0.1, final_learning_rate = 1.0 }} }}\n"
        ),
    );
    let made = |name: &str, more: &str| {
        let root = folder.path().join(name);
        let text = format!("{TINY}{}{more}{wild}", VALIDATION.replace("every = 2", "every = 1"));
        let rows = run(Experiment::parse(&text).unwrap(), &root).rows;
        let weights = std::fs::read(root.join("cameras/a/blocks/network/weights.bin")).unwrap();
        (rows, weights, validations(&root))
    };
    let (last, last_weights, losses) = made("last", "");
    let values: Vec<f64> = losses.iter().map(|v| v.3).collect();
    assert_eq!(values.len(), 4);
    let least = (0..4).min_by(|a, b| values[*a].total_cmp(&values[*b])).unwrap();
    assert!(least < 3, "the last step is the best: {values:?}");
    let (best, best_weights, same) = made("best", "keep = \"best\"\n");
    assert_eq!(same, losses);
    assert!(best_weights != last_weights && best[0].scores != last[0].scores);
    assert!(best[0].scores["psnr_db"] > last[0].scores["psnr_db"], "{best:?} {last:?}");

    // Impatience ends the stage soon after, with the same camera.
    let (early, early_weights, fewer) = made("early", "keep = \"best\"\npatience = 1\n");
    assert_eq!(early_weights, best_weights);
    assert_eq!(fewer, losses[..least + 2]);
    assert_eq!(early[0].network_steps, least + 2);

    // A camera that starts from it counts the steps that were taken, and its windows go on after theirs.
    let child = format!("{}from = \"a\"\n{NETWORK}", variant("b", ""));
    let root = folder.path().join("child");
    let impatient = VALIDATION.replace("every = 2", "every = 1") + "patience = 1\n";
    let rows = run(Experiment::parse(&format!("{TINY}{impatient}{wild}{child}")).unwrap(), &root).rows;
    let own = validations(&root).iter().filter(|v| v.1 == "b").count();
    assert_eq!(rows[1].network_steps, rows[0].network_steps + own);
    assert!(rows[0].network_steps < 4);
}

#[test]
fn validation_pictures_are_neither_trained_nor_scored_on_and_moving_lenses_are_validated_at_rest() {
    let assets = library();
    let setup = |text: &str| Setup::new(Experiment::parse(text).unwrap(), &assets, Device::flex().autodiff());
    let text = format!("{TINY}{VALIDATION}{}", variant("a", JOINT));
    let (with, without) = (setup(&text).unwrap(), setup(TINY).unwrap());
    let names = |setup: &Setup, list: &str| -> Vec<String> {
        let listed = |remark: Remark| match remark {
            Remark::Note(text) => Some(text.strip_prefix(list)?.split_once(": ")?.1.to_owned()),
            Remark::Warning(_) => None,
        };
        let all = setup.windows().unwrap().remarks().into_iter().find_map(listed).unwrap_or_default();
        all.split(", ").filter(|name| !name.is_empty()).map(str::to_owned).collect()
    };
    let validation = names(&with, "validation");
    assert_eq!(validation.len(), 2);
    assert!(validation.iter().all(|name| !names(&with, "training").contains(name)));
    assert_eq!(names(&with, "held-out"), names(&without, "held-out"));
    assert_eq!(names(&with, "training").len() + 2, names(&without, "training").len());
    assert!(names(&without, "validation").is_empty());
    let camera = with.camera(with.nominal().lens_file.lens.clone(), true).unwrap();
    let batches = with.validation_shots(&camera).unwrap();
    assert_eq!(batches.iter().map(Vec::len).collect::<Vec<_>>(), [1, 1, 1]);

    // Losses of a moving lens and of the same lens at rest are comparable: the network hardly changes them in a few steps.
    let folder = tempfile::tempdir().unwrap();
    run(Experiment::parse(&text).unwrap(), folder.path());
    let found = validations(folder.path());
    assert_eq!(found.iter().map(|v| v.2.as_str()).collect::<Vec<_>>(), ["network"; 2]);
    assert!((found[0].3 / found[1].3 - 1.0).abs() < 0.1, "{found:?}");
    let refused = Experiment::parse("[validation]\nkeep = \"best\"\n").unwrap_err().to_string();
    assert!(refused.contains("no validations"), "{refused}");
}
