//! Requirements that a lens meets from the start: those of a file for another lens may be far from it.

use petzval_optics::constraint::{Constraint, SemiDiameters};
use petzval_optics::lens::Lens;

use crate::experiment::ConstraintConfig;

/// A requirement that a lens misses becomes this share of what the lens has.
const SHARE: f64 = 0.9;

/// Lowers edges, gaps and back focal distance to what the lens has; returns what to say then.
pub(super) fn fit(constraints: &mut ConstraintConfig, lens: &Lens) -> Vec<String> {
    // What the lens has is the limit less its excess; the least of all places counts.
    let has_mm = |is_it: &dyn Fn(&Constraint) -> bool, limit_mm: f64| {
        let excess = constraints.of_lens(lens).into_iter().filter(|c| is_it(c));
        let excess = excess.filter_map(|c| c.excess_mm(lens, &SemiDiameters(lens)));
        limit_mm - excess.fold(f64::NEG_INFINITY, f64::max)
    };
    let is_glass = |c: &Constraint| matches!(c, Constraint::Edge { .. } | Constraint::Centre { .. });
    let is_air = |c: &Constraint| matches!(c, Constraint::Air { .. } | Constraint::AirEdge { .. });
    let is_back = |c: &Constraint| matches!(c, Constraint::ImageDistance { .. });
    let found = [
        has_mm(&is_glass, constraints.element_edge_mm),
        has_mm(&is_air, constraints.air_gap_mm),
        has_mm(&is_back, constraints.back_focal_mm),
    ];
    let keys: [(&str, &str, &mut f64); 3] = [
        ("element_edge_mm", "its thinnest edge or centre", &mut constraints.element_edge_mm),
        ("air_gap_mm", "its narrowest gap of air", &mut constraints.air_gap_mm),
        ("back_focal_mm", "its back focal distance", &mut constraints.back_focal_mm),
    ];
    let mut notes = Vec::new();
    for ((key, what, limit_mm), has_mm) in keys.into_iter().zip(found) {
        if has_mm >= *limit_mm {
            continue;
        }
        let fitted = if has_mm > 0.0 { (SHARE * has_mm * 1e4).floor() / 1e4 } else { 0.0 };
        notes.push(format!(
            "constraints.{key} = {fitted} mm in place of {limit_mm}: {what} has {has_mm:.4} mm"
        ));
        *limit_mm = fitted;
    }
    notes
}
