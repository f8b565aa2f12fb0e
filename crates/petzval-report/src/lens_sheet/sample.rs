//! An analysis of a triplet, for tests.

use petzval_optics::analysis::{Analysis, AnalysisOptions, analyze};

use crate::sample::triplet;

/// The analysis of a triplet at a coarse resolution.
pub(crate) fn analysis() -> Analysis {
    let options = AnalysisOptions {
        pupil_cells: 24,
        spot_rings: 4,
        field_points: 5,
        focus_points: 5,
        frequency_points: 11,
        ..AnalysisOptions::default()
    };
    match analyze(&triplet(), &options, &|| Ok(())) {
        Ok(analysis) => analysis,
        Err(error) => panic!("{error}"),
    }
}
