//! What several tests of designs share.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use petzval_design::design_loop::{DesignLoop, Ending, Observer};
use petzval_design::experiment::Experiment;
use petzval_design::inputs::keep_inputs;
use petzval_design::library::Library;
use petzval_design::run::{CameraMetrics, Event, Metrics, RunFolder};
use petzval_design::scoring::Scorer;
use petzval_design::setup::Setup;
use petzval_learn::Device;

/// An observer that looks at nothing.
pub struct Silent;

impl Observer for Silent {
    fn start(&mut self, _: u64, _: u64) {}
    fn step(&mut self, _: &Event) {}
    fn camera(&mut self, _: &CameraMetrics) {}
}

/// The folder of the built-in data.
pub fn data_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data")
}

/// The library of the built-in data.
pub fn library() -> Library {
    Library::from_folder(&data_folder()).unwrap()
}

/// The setup of an experiment in that library.
pub fn setup_of(text: &str) -> Setup {
    Setup::new(Experiment::parse(text).unwrap(), &library(), Device::flex().autodiff()).unwrap()
}

/// The run of an experiment in a folder, from its start to its scores.
pub fn finished(setup: &Arc<Setup>, folder: &Path) -> (RunFolder, Metrics) {
    let run = RunFolder::create(&folder.join("run")).unwrap();
    let scorer = Scorer::new(setup.clone()).unwrap();
    keep_inputs(&scorer, &library(), &run, None).unwrap();
    let design = DesignLoop::new(run.clone(), scorer).unwrap();
    let Ending::Finished(metrics) = design.run(&mut Silent).unwrap() else {
        panic!("nothing stops it");
    };
    (run, *metrics)
}
