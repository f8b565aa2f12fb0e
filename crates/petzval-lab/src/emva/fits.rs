//! All fits of a characterisation with the tests of their points, by name.

use serde::Serialize;

use super::colour_name::colour_name;
use super::goodness::{ALPHA, FitTest, Verdict};
use super::result::Characterization;
use super::transfer::PhotonTransfer;
use petzval_camera::sensor::Colour;

/// A fit by name.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NamedFit {
    /// What was fitted.
    pub name: &'static str,
    /// Linear gain; `None` of fits to all gains.
    pub linear_gain: Option<f64>,
    /// Colour; `None` of fits to all pixels.
    pub colour: Option<Colour>,
    /// The test.
    pub test: FitTest,
    /// Error that a departure adds, as a share of the fitted number; `None` where the number is not resolved.
    pub model_share: Option<f64>,
    /// Why the points depart from the model, if the captures show it.
    pub cause: Option<&'static str>,
}

impl NamedFit {
    /// Gain and colour in words, empty of fits to all gains.
    pub fn place(&self) -> String {
        match (self.linear_gain, self.colour) {
            (None, _) => String::new(),
            (Some(gain), None) => format!("gain {gain}"),
            (Some(gain), Some(colour)) => format!("gain {gain}, {}", colour_name(colour)),
        }
    }
}

/// Share of a number from which on the error that a departure adds is worth a warning: every real lamp drifts by less.
pub(super) const WORTH_A_WARNING: f64 = 0.01;

/// The usual cause of pixels that differ in the light from one to the next: the list states no mosaic, or another one.
const OTHER_FILTERS: &str =
    "as if the pixels have colour filters of another mosaic; if so, state it in `cfa`";

/// The cause of a K that is no number of the sensor although its points lie on their line. It has a warning of its own.
pub(super) const SHARED_NOISE: &str = "pixels or frames share noise";

/// The cause of a K whose error contains the steps between compressed numbers. It has a warning of its own.
pub(super) const COMPRESSED: &str = "the digital numbers are compressed";

/// The cause of a K whose error contains what the response over the light does to it, if that is so.
fn of_response(transfer: &PhotonTransfer) -> Option<&'static str> {
    let test = transfer.gain_test;
    let own_fails = test.p_value < ALPHA || test.curvature_p_value.is_some_and(|p| p < ALPHA);
    if transfer.straightened_gain_dn_per_e.is_some() {
        Some("the response bends over the light")
    } else if test.model_error > 0.0 && !own_fails {
        Some("the response departs from a line over the light")
    } else {
        None
    }
}

/// Whether the points of K depart from their line by themselves, without the errors of shared noise and of compression. Steps between
/// compressed numbers scatter the variance by about their own error.
fn departs_by_itself(transfer: &PhotonTransfer) -> bool {
    let Some(gain) = transfer.gain_dn_per_e.value() else { return false };
    let of_noise = transfer.shared_noise.map_or(0.0, |shared| shared.missing_share());
    let of_steps = transfer.compression.map_or(0.0, |found| found.gain_error_dn_per_e / gain);
    let of_all = transfer.gain_test.model_error / gain;
    let own = (of_all.powi(2) - of_noise.powi(2) - of_steps.powi(2)).max(0.0).sqrt();
    own > of_steps.abs().max(WORTH_A_WARNING)
}

/// Every fit, those of all gains first.
pub fn fits(found: &Characterization) -> Vec<NamedFit> {
    let share = |test: &FitTest, value: Option<f64>| {
        value.map(|v| (test.model_error / v).abs()).filter(|s| s.is_finite())
    };
    let joint = &found.joint;
    let of_all = |name, test: FitTest, value: Option<f64>| NamedFit {
        name,
        linear_gain: None,
        colour: None,
        model_share: share(&test, value),
        test,
        cause: None,
    };
    let mut all = vec![
        of_all("K over the gains", joint.tests.gain, joint.gain_dn_per_e.value()),
        of_all("dark current over the gains", joint.tests.dark_current, joint.dark_current_e_per_s.value()),
        of_all("dark variance over K^2", joint.tests.variance_line, joint.read_variance_e2.value()),
        of_all("dark mean over K", joint.tests.mean_line, joint.read_noise_mean_e.value()),
    ];
    // The usual cause of dark means far off their line.
    if joint.tests.mean_line.verdict == Verdict::Withdrawn
        && joint.rows.iter().all(|r| r.black_shift_dn == 0.0)
    {
        all[3].cause = Some(
            "as if each gain has a black level of its own; if so, state black_level_dn in each [[point]]",
        );
    }
    if let Some(fit) = &found.histogram_fit {
        all.push(of_all("histograms", fit.test, fit.gain_dn_per_e.value()));
    }
    for gain in &found.gains {
        let mut add = |name, colour: Option<Colour>, test: FitTest, value: Option<f64>, cause| {
            let linear_gain = Some(gain.linear_gain);
            let model_share = share(&test, value);
            all.push(NamedFit { name, linear_gain, colour, test, model_share, cause });
        };
        let dark = &gain.dark;
        let hot = gain.pixel_dark_currents.as_ref().and_then(|p| p.hot_share.value());
        let fills = hot.map(|_| "hot pixels fill");
        add("dark mean over time", None, dark.mean_test, dark.mean.slope.value(), fills);
        add("dark variance over time", None, dark.variance_test, dark.variance.slope.value(), None);
        if let Some(test) = gain.pixel_dark_currents.as_ref().and_then(|p| p.hot_test) {
            add("hot pixels", None, test, None, None);
        }
        for channel in &gain.channels {
            let (colour, transfer) = (Some(channel.colour), &channel.transfer);
            let bends = of_response(transfer);
            let compressed = transfer.compression.map(|_| COMPRESSED);
            let named = transfer.shared_noise.map(|_| SHARED_NOISE).or(compressed);
            // A fit that departs by itself has its own warning, whatever else the error of K contains.
            let cause = if departs_by_itself(transfer) { bends } else { named.or(bends) };
            add("K", colour, transfer.gain_test, transfer.gain_dn_per_e.value(), cause);
            if let Some(test) = transfer.responsivity_test {
                add("R", colour, test, transfer.responsivity_dn.value(), None);
            }
            if let Some(linearity) = &transfer.linearity {
                add("linearity", colour, linearity.test, None, None);
            }
            if let Some(test) = channel.spatial.as_ref().and_then(|s| s.dark_components.test) {
                add("DSNU", colour, test, None, None);
            }
            let flat = channel.spatial.as_ref().map(|s| &s.flat_components);
            if let Some(test) = flat.and_then(|components| components.test) {
                let tiled = flat.is_some_and(|components| components.is_tiled);
                add("PRNU", colour, test, None, tiled.then_some(OTHER_FILTERS));
            }
        }
    }
    all
}
