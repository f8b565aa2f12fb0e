//! Wavelengths outside the ranges of the formulas of glasses.

use petzval_design::assets::glass_warnings::glass_warnings;
use petzval_optics::glass::Catalog;
use petzval_optics::lens::Lens;

use crate::context::Context;
use crate::event::WarningKind;

/// Warns where a lens is traced at wavelengths, um, that its glasses' formulas do not reach. Those of the lens file itself have their warning when it
/// is read.
pub(crate) fn warn_of_wavelengths(lens: &Lens, um: &[f64], context: &Context) {
    let own = |um: &&f64| !lens.wavelengths_um.contains(um) && **um != lens.reference_um;
    let others: Vec<f64> = um.iter().filter(own).copied().collect();
    let Some(reference_um) = others.first().copied() else { return };
    let traced = Lens { wavelengths_um: others, reference_um, ..lens.clone() };
    for warning in glass_warnings(&traced, &Catalog::default()) {
        context.warning(WarningKind::LensFile, format!("{}: {warning}", lens.name));
    }
}
