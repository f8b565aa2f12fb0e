//! What the exposure of an experiment must hold.

use petzval_base::FileError;

use super::checked::Checked;
use crate::experiment::{ExposureSetting, variants};

/// Refuses settings of the exposure that cannot move, and ranges that do not hold what is stated.
pub(super) fn settings_and_ranges(c: &Checked) -> Result<(), FileError> {
    let e = &c.experiment.exposure;
    let wrong = |key: &str, message: String, hint: &'static str| {
        Err(variants::at(c.text, &["exposure", key], message).hint(hint))
    };
    if e.vary.iter().enumerate().any(|(i, setting)| e.vary[..i].contains(setting)) {
        return wrong("vary", "names a setting twice".to_owned(), "name each once");
    }
    if !e.vary.is_empty() && c.experiment.sees_streets(c.facts) {
        let message = "streets are exposed automatically, each for its own light".to_owned();
        return wrong("vary", message, "leave it out, or give photographs with boxes as `data`");
    }
    let ranges = [
        (ExposureSetting::Time, "times_s", e.times_s, e.time_s),
        (ExposureSetting::Gain, "gains", e.gains, e.linear_gain),
    ];
    for (_, key, [min, max], stated) in ranges.into_iter().filter(|(s, ..)| e.vary.contains(s)) {
        // A stated value may be a bound in another precision.
        let stated = f64::from(stated);
        if !(min < max && stated >= min * (1.0 - 1e-6) && stated <= max * (1.0 + 1e-6)) {
            let message =
                format!("the range {min} to {max} of exposure.{key} does not hold the stated {stated}");
            return wrong(key, message, "give the smaller bound first, and the stated value between them");
        }
    }
    Ok(())
}
