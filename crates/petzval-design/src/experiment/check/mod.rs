//! What an experiment must hold beyond the types of its values: one rule after another, the first that fails is reported.

mod checked;
mod classes;
mod exposure;
mod isp;
mod psf;
mod python;

use petzval_base::FileError;
use petzval_camera::sensor::NoiseMode;

use super::commented::tables;
use super::{BlockName, DetectorInput, Experiment, Keep, NetworkRole, TaskFacts, Variant, variants};
use checked::Checked;

/// One rule. Its error names key, value and a hint.
type Rule = fn(&Checked) -> Result<(), FileError>;

/// Every rule but that of the scores that are known.
const RULES: &[Rule] = &[
    values_lie_in_their_ranges,
    exact_noise_moves_no_lens,
    only_networks_that_read_see_other_pictures,
    demosaicing_leads_a_moving_lens,
    networks_get_the_pictures_they_need,
    isp::parameters_and_windows,
    network_weights_have_a_network,
    python::classes_and_uses,
    exposure::settings_and_ranges,
    classes::fit_the_task,
    waiting_needs_validations,
    variants_can_be_made,
    losses_have_a_weight,
    scores_are_named_once,
    grids_are_even,
    psf::files_and_kinds,
    psf::no_lens_moves,
];

impl Experiment {
    /// Checks everything that does not depend on the scores that are known.
    pub(crate) fn check(&self, text: &str, facts: &TaskFacts) -> Result<(), FileError> {
        let checked = Checked { experiment: self, text, facts };
        RULES.iter().try_for_each(|rule| rule(&checked))
    }
}

fn values_lie_in_their_ranges(c: &Checked) -> Result<(), FileError> {
    let mut tables = tables(c.experiment).into_iter();
    match tables.find_map(|(table, _, wrong)| Some((table, wrong?))) {
        Some((table, wrong)) => {
            let error = c.at(&[table, wrong.parameter.name], wrong.message());
            Err(error.hint(wrong.parameter.hint))
        }
        None => Ok(()),
    }
}

/// Whether a stage of a variant moves the lens by its gradient.
fn leads_the_lens(variant: &Variant) -> bool {
    variant.stages.iter().any(|stage| stage.steps_down_a_gradient(BlockName::Optics))
}

fn exact_noise_moves_no_lens(c: &Checked) -> Result<(), FileError> {
    let variants = c.experiment.variants();
    let Some(i) = variants.iter().position(|v| v.noise == NoiseMode::Exact && leads_the_lens(v)) else {
        return Ok(());
    };
    let place = i.to_string();
    let key = match c.experiment.variant[i].noise {
        Some(_) => ["variant", &place, "noise"].to_vec(),
        None => vec!["training", "noise"],
    };
    let error = c.at(&key, "exact noise has no gradient to the lens");
    Err(error.hint("write \"dequantised\", or 0 for optics.steps"))
}

/// Zoomed pictures and the truth are inputs of networks that read pictures.
fn only_networks_that_read_see_other_pictures(c: &Checked) -> Result<(), FileError> {
    if c.facts.network == NetworkRole::Reads {
        return Ok(());
    }
    let keys = [
        ("zoomed_like", "only a detector sees zoomed pictures", c.first_config(|v| v.zoomed_like.is_some())),
        ("sees", "only a detector can see the truth", c.first_config(|v| v.sees == DetectorInput::Truth)),
    ];
    match keys.into_iter().find_map(|(key, message, place)| Some((key, message, place?))) {
        Some((key, message, place)) => {
            let message = format!("{message}; where pictures are scored they stay as they are");
            Err(c.at(&["variant", &place, key], message).hint("leave it out"))
        }
        None => Ok(()),
    }
}

fn demosaicing_leads_a_moving_lens(c: &Checked) -> Result<(), FileError> {
    if c.experiment.development.demosaic.is_differentiable()
        || !c.experiment.variants().iter().any(leads_the_lens)
    {
        return Ok(());
    }
    let error = c.at(&["development", "demosaic"], "this method has no gradient to the lens");
    Err(error.hint("write \"menon\", \"malvar\" or \"bilinear\", or 0 for optics.steps"))
}

fn networks_get_the_pictures_they_need(c: &Checked) -> Result<(), FileError> {
    let e = c.experiment;
    let finishes = c.facts.network == NetworkRole::Finishes;
    let needs_it = e.network.kind.ours().is_some_and(|kind| kind.needs_restoration());
    if !finishes || !needs_it || e.development.restore {
        return Ok(());
    }
    let error = c.at(&["network", "kind"], "this network needs a restored picture");
    Err(error.hint("write true for development.restore, or \"u-net\""))
}

fn network_weights_have_a_network(c: &Checked) -> Result<(), FileError> {
    let network = &c.experiment.network;
    let names_weights = !network.draws_weights() && !network.has_built_in_weights();
    if !names_weights || c.experiment.has_picture_network(c.facts.network) {
        return Ok(());
    }
    let error = c.at(&["network", "weights"], "there is no network for pictures that could start from them");
    Err(error.hint("leave it out; a detector starts from detector.weights"))
}

fn waiting_needs_validations(c: &Checked) -> Result<(), FileError> {
    let validation = &c.experiment.validation;
    let waits = [("patience", validation.patience > 0), ("keep", validation.keep == Keep::Best)];
    match waits.into_iter().find(|(_, waits)| *waits && !validation.is_used()) {
        Some((key, _)) => {
            let error = c.at(&["validation", key], "there are no validations");
            Err(error.hint("give validation.every the steps between two of them, such as 25"))
        }
        None => Ok(()),
    }
}

fn variants_can_be_made(c: &Checked) -> Result<(), FileError> {
    let e = c.experiment;
    variants::check_variants(&e.variant, c.text)?;
    variants::check_blocks(&e.variant, &e.blocks(c.facts.network), c.text)
}

fn losses_have_a_weight(c: &Checked) -> Result<(), FileError> {
    if !c.experiment.loss.is_empty() {
        return Ok(());
    }
    let error = c.at(&["loss", "l1_weight"], "all weights of the loss are zero");
    Err(error.hint("give at least one part a positive weight"))
}

fn scores_are_named_once(c: &Checked) -> Result<(), FileError> {
    let scores = &c.experiment.scoring.scores;
    let path = ["scoring", "scores"];
    if scores.is_empty() {
        let first = c.facts.default_scores.and_then(|scores| scores.first()).unwrap_or(&"psnr_db");
        return Err(c.at(&path, "names no score").hint(format!("for example [\"{first}\"]")));
    }
    match scores.iter().enumerate().find(|(i, name)| scores[..*i].contains(name)) {
        Some((_, name)) => Err(c.at(&path, format!("`{name}` is named twice")).hint("name each score once")),
        None => Ok(()),
    }
}

fn grids_are_even(c: &Checked) -> Result<(), FileError> {
    let psf = &c.experiment.psf;
    let sizes = [
        ("pupil_cells", psf.pupil_cells),
        ("scoring_pupil_cells", psf.scoring_pupil_cells),
        ("grid", psf.grid),
    ];
    match sizes.into_iter().find(|(_, size)| !size.is_multiple_of(2)) {
        Some((key, size)) => Err(c.at(&["psf", key], "must be even").hint(format!("take {}", size + 1))),
        None => Ok(()),
    }
}
