//! What to say of scores of which a camera has no value.

use petzval_design::run::{CameraMetrics, Metrics};
use petzval_learn::score::ScoreDescription;

use crate::context::Context;
use crate::event::WarningKind;

/// Warns of scores of which a camera has no value.
pub fn warn_of_missing(metrics: &Metrics, context: &Context) {
    if let Some(text) = without_scores(&metrics.rows, &metrics.scores) {
        context.warning(WarningKind::DataSet, text);
    } else if let Some(missing) = metrics.missing_values() {
        context.warning(WarningKind::LeftOut, missing);
    }
}

/// What to say where no camera has a score; `None` where one has.
fn without_scores(rows: &[CameraMetrics], scores: &[ScoreDescription]) -> Option<String> {
    if rows.iter().any(|row| !row.scores.is_empty()) {
        return None;
    }
    let headings: Vec<String> = scores.iter().map(ScoreDescription::heading).collect();
    Some(format!(
        "nothing in the scored windows counts for {}: no camera has a score; give pictures that show objects of the classes of the run",
        headings.join(", ")
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_that_counts_is_said_where_no_camera_has_a_score() {
        let metrics: Metrics = serde_json::from_value(serde_json::json!({
            "rows": [{
                "camera": "nominal", "ap50": 0.4, "rms_spot_um": 7.25, "efl_mm": 25.0, "f_number": 2.8, "fov_deg": 40.0,
                "corner_distortion_percent": -1.5, "psf_captured": 1.0, "white_e": 16000.0, "network_steps": 3,
                "rms_spot_by_field_um": [], "pictures": []
            }],
            "seeds": [1], "held_out_images": 3, "held_out_places": 1,
            "scores": [{"name": "ap50", "title": "AP50", "unit": "", "definition": "", "decimals": 4, "higher_is_better": true}]
        }))
        .unwrap();
        assert_eq!(without_scores(&metrics.rows, &metrics.scores), None);
        let mut none = metrics.rows.clone();
        none.iter_mut().for_each(|row| row.scores.clear());
        let said = without_scores(&none, &metrics.scores).unwrap();
        assert!(said.contains("counts for AP50: no camera has a score"), "{said}");
    }
}
