//! An analysis to test with, of a triplet.

use petzval_optics::analysis::{Analysis, AnalysisOptions, analyze};

use crate::sample::triplet;

/// A triplet, looked at coarsely.
pub(crate) fn analysis() -> Analysis {
    let options = AnalysisOptions {
        pupil_cells: 24,
        spot_rings: 4,
        field_points: 5,
        focus_points: 5,
        frequency_points: 11,
        ..AnalysisOptions::default()
    };
    match analyze(&triplet(), &options) {
        Ok(analysis) => analysis,
        Err(error) => panic!("{error}"),
    }
}
