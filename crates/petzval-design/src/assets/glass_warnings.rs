//! What a designer should know of the glasses of a lens before believing its figures.

use petzval_optics::glass::{Catalog, Dispersion, Glass};
use petzval_optics::lens::Lens;

/// Warnings about the glasses of a lens whose names were looked up in a catalogue, one line each. A warning names a wavelength outside the
/// range of a formula or a table, or a name that several makers have given to different glasses.
pub fn glass_warnings(lens: &Lens, catalog: &Catalog) -> Vec<String> {
    let mut glasses: Vec<&Glass> = Vec::new();
    for surface in &lens.surfaces {
        if !glasses.contains(&surface.glass.as_ref()) {
            glasses.push(&surface.glass);
        }
    }
    let outside = glasses.iter().filter_map(|glass| outside_range(glass, lens));
    outside.chain(glasses.iter().filter_map(|glass| shared_name(glass, catalog))).collect()
}

fn outside_range(glass: &Glass, lens: &Lens) -> Option<String> {
    let mut used = lens.wavelengths_um.iter().chain([&lens.reference_um]);
    let um = used.find(|um| glass.is_outside_range(**um))?;
    let [min, max] = glass.known_range_um()?;
    let what = if matches!(glass.dispersion, Dispersion::Table { .. }) { "table" } else { "formula" };
    Some(format!("the {what} of {} holds from {min} to {max} um, not at {um} um", glass.name))
}

fn shared_name(glass: &Glass, catalog: &Catalog) -> Option<String> {
    let counts = catalog.get(&glass.name).ok()?;
    let (_, others) = catalog.all(&glass.name).split_last()?;
    let others: Vec<&str> = (others.iter())
        .filter(|other| other.dispersion != glass.dispersion && !other.maker.is_empty())
        .map(|other| other.maker.as_str())
        .collect();
    // A glass of the lens file itself, or one named with its maker, is no matter of doubt.
    if *counts != *glass || others.is_empty() {
        return None;
    }
    let (name, maker) = (&glass.name, if glass.maker.is_empty() { "nobody" } else { &glass.maker });
    let (all, first) = (others.join(", "), others[0]);
    let have = if others.len() > 1 { "have" } else { "has" };
    Some(format!("{name} is that of {maker}; {all} {have} another of this name: write {first}:{name} for it"))
}
