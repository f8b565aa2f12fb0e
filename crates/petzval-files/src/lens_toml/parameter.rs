//! Names of a surface's variable numbers in files.

use petzval_optics::design_space::Parameter;
use petzval_optics::lens::{ASPHERE_TERMS, Action, Departure, PHASE_TERMS, Pattern, Surface, xy_powers};
use petzval_optics::number::Number;

/// The numbers of a surface that can be variables, with their names in files.
pub(super) fn parameters(surface: &Surface) -> Vec<(String, Parameter)> {
    let mut all = vec![("thickness_mm".to_owned(), Parameter::Thickness)];
    if surface.has_number(Number::Curvature) {
        all.push(("radius_mm".to_owned(), Parameter::Radius));
        for i in 1..=ASPHERE_TERMS {
            all.push((format!("a{}", 2 * i), Parameter::Asphere(2 * i)));
        }
    }
    if surface.has_number(Number::Conic) {
        all.push(("conic".to_owned(), Parameter::Conic));
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
    all.extend(names.into_iter().enumerate().map(|(k, name)| (name, Parameter::Departure(k))));
    match surface.phase.map(|phase| phase.pattern) {
        None => {}
        Some(Pattern::Grating { .. }) => all.push(("grating.lines_per_mm".into(), Parameter::Phase(0))),
        Some(Pattern::Binary { .. }) => {
            all.extend((0..PHASE_TERMS).map(|k| (format!("binary.a{}", k + 1), Parameter::Phase(k))));
        }
    }
    if let Action::ThinLens { .. } = surface.action {
        all.push(("thin_lens.power_per_mm".into(), Parameter::Power));
    }
    all
}

/// The name of a number of a surface; empty if the surface does not have this number.
pub fn parameter_name(surface: &Surface, parameter: Parameter) -> String {
    parameters(surface).into_iter().find(|(_, p)| *p == parameter).map(|(name, _)| name).unwrap_or_default()
}
