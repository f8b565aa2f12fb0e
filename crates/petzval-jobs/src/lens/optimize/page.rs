//! The page of an optimisation.

use petzval_design::lens::view::{section, surfaces};
use petzval_optics::lens::Lens;
use petzval_optics::optimize::Problem;
use petzval_report::optimize_sheet::{self, FigureRow, LensState, OptimizeSheet};

use super::figures::Figures;
use super::request::Found;

/// The page that shows a lens before and after.
pub(super) fn page(problem: &Problem, found: &Found, before: Option<&Lens>, after: &Lens) -> String {
    let fields_deg: Vec<f64> = problem.merit.fields_rad.iter().map(|f| f.to_degrees()).collect();
    let state = |lens: &Lens, figures: &Figures| LensState {
        layout: section(lens, &fields_deg),
        surfaces: surfaces(lens),
        rms_um: figures.rms_spot_um.clone(),
        mean_rms_um: figures.mean_rms_spot_um,
        missed: figures.missed(),
    };
    let start = found.start.as_ref().map(|start| start.rows(&fields_deg));
    let row = |(i, (name, after, unit)): (usize, (String, Option<f64>, &'static str))| FigureRow {
        name,
        unit: unit.to_owned(),
        values: [start.as_ref().and_then(|rows| rows[i].1), after],
    };
    optimize_sheet::page(&OptimizeSheet {
        lens: problem.base.name.clone(),
        before: before.zip(found.start.as_ref()).map(|(lens, figures)| state(lens, figures)),
        after: state(after, &found.best),
        at_bounds: found.at_bounds.clone(),
        at_limits: found.best.reached(),
        figures: found.best.rows(&fields_deg).into_iter().enumerate().map(row).collect(),
        fields_deg: fields_deg.clone(),
    })
}
