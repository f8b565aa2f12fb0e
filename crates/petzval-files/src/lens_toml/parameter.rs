//! Names of a surface's variable numbers in files.

use petzval_optics::lens::{ASPHERE_TERMS, Action, Departure, Pattern, Surface, xy_powers};
use petzval_optics::number::Number;
use petzval_optics::number::PHASE_TERMS;

/// The name of a curvature whose bounds enclose the plane; other curvatures vary by their radius.
pub(super) const CURVATURE: &str = "curvature_per_mm";

/// The numbers of a surface that can be variables, with their names in files.
pub(super) fn parameters(surface: &Surface) -> Vec<(String, Number)> {
    let mut all = vec![("thickness_mm".to_owned(), Number::Thickness)];
    if surface.has_number(Number::Curvature) {
        all.push(("radius_mm".to_owned(), Number::Curvature));
        all.push((CURVATURE.to_owned(), Number::Curvature));
        for i in 1..=ASPHERE_TERMS {
            all.push((format!("a{}", 2 * i), Number::Asphere(i - 1)));
        }
    }
    if surface.has_number(Number::Conic) {
        all.push(("conic".to_owned(), Number::Conic));
    }
    let numbers = surface.shape.departure.numbers().len();
    let names: Vec<String> = match &surface.shape.departure {
        Departure::None => Vec::new(),
        Departure::Odd(_) => (0..numbers).map(|k| format!("odd.b{}", 2 * k + 1)).collect(),
        Departure::Xy { .. } => xy_powers().map(|(i, j)| format!("xy.x{i}y{j}")).collect(),
        Departure::Qbfs { .. } => (0..numbers).map(|m| format!("q_bfs.a{m}")).collect(),
        Departure::Qcon { .. } => (0..numbers).map(|m| format!("q_con.a{m}")).collect(),
        Departure::Biconic { .. } => vec!["biconic.curvature_x_per_mm".into(), "biconic.conic_x".into()],
        Departure::Toroid { .. } => vec!["toroid.curvature_x_per_mm".into()],
    };
    all.extend(names.into_iter().enumerate().map(|(k, name)| (name, Number::Departure(k))));
    match surface.phase.map(|phase| phase.pattern) {
        None => {}
        Some(Pattern::Grating { .. }) => all.push(("grating.lines_per_mm".into(), Number::Phase(0))),
        Some(Pattern::Binary { .. }) => {
            all.extend((0..PHASE_TERMS).map(|k| (format!("binary.a{}", k + 1), Number::Phase(k))));
        }
    }
    if let Action::ThinLens { .. } = surface.action {
        all.push(("thin_lens.power_per_mm".into(), Number::Power));
    }
    if surface.placement.is_some() {
        for (k, axis) in ["x", "y"].into_iter().enumerate() {
            all.push((format!("decenter_{axis}_mm"), Number::Decenter(k)));
        }
        for (k, axis) in ["x", "y", "z"].into_iter().enumerate() {
            all.push((format!("tilt_{axis}_deg"), Number::Tilt(k)));
        }
    }
    all
}

/// The name of a number of a surface; empty if the surface does not have this number.
pub fn parameter_name(surface: &Surface, number: Number) -> String {
    parameters(surface).into_iter().find(|(_, n)| *n == number).map(|(name, _)| name).unwrap_or_default()
}
