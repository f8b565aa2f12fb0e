//! Clear semi-diameters for surfaces without an edge: large enough for the beams of the lens's fields.

use super::item::Clear;
use crate::loss::{Effect, Loss, Losses};
use petzval_optics::lens::{Lens, LensDefect, traceable, validate};
use petzval_optics::paraxial::first_order;
use petzval_optics::pupil::{aim_one, paraxial_launch};
use petzval_optics::trace::{SOFT_EDGE_MM, launch, trace_ray};

/// Margin around the beams, as a share of their height. The soft edge of apertures is added to it.
const ROOM: f64 = 0.01;

/// Largest number of traced fields: the innermost, the outermost and some between.
const FIELDS: usize = 8;

/// Number of traced azimuths in the pupil.
const AZIMUTHS: usize = 12;

/// Traced pupil radii: the rim, then smaller radii if the ray at the rim does not reach the image.
const RADII: [f64; 3] = [1.0, 0.7, 0.3];

/// Factor by which a surface is made smaller at a time if it cannot be as large as the beams.
const NARROWER: f64 = 0.99;

/// Least share of the beams that a surface takes.
const NARROWEST: f64 = 0.15;

/// Gives the surfaces `open` (from 0), which have no edge of their own, clear semi-diameters that hold the beams of the fields of the
/// lens; light beyond them passes. Returns the lens, what is approximated in it, and the defect if it cannot be built. Fails where a surface ends within its edge.
pub fn with_open_surfaces(
    lens: &Lens,
    open: &[usize],
) -> Result<(Lens, Vec<Loss>, Option<LensDefect>), LensDefect> {
    let clear =
        |(i, semi): (usize, f64)| if open.contains(&i) { Clear::Open(semi) } else { Clear::Edge(semi) };
    let clears: Vec<Clear> =
        lens.surfaces.iter().map(|s| s.semi_diameter_mm).enumerate().map(clear).collect();
    let mut losses = Losses::default();
    let (lens, flaw) = with_semi_diameters(lens.clone(), &clears, &mut losses)?;
    Ok((lens, losses.into_list(), flaw))
}

/// The lens with clear semi-diameters everywhere.
///
/// A surface without an edge keeps its printed size if that holds its beams; else it is made large enough for them. Where the lens is impossible so,
/// no printed size of such a surface counts.
/// Surfaces that cannot be as large as the beams narrow them. A lens that cannot be built even then comes with the reason. Fails where a
/// surface ends within its edge.
pub(super) fn with_semi_diameters(
    lens: Lens,
    clears: &[Clear],
    losses: &mut Losses,
) -> Result<(Lens, Option<LensDefect>), LensDefect> {
    if clears.iter().all(|clear| matches!(clear, Clear::Edge(_) | Clear::Beam(_))) {
        let lens = filled(&lens, clears, |_, _| 0.0);
        traceable(&lens)?;
        let flaw = validate(&lens).err();
        return Ok((lens, flaw));
    }
    // Keep a printed size that holds the beams; other surfaces have room around them, or none. Then try without the printed sizes.
    let heights = beam_heights(&lens, clears);
    let roomy = |i: usize| heights[i] * (1.0 + ROOM) + SOFT_EDGE_MM;
    let holds = |i: usize, printed: f64| printed >= heights[i].max(SOFT_EDGE_MM);
    let open: [&dyn Fn(usize, f64) -> f64; 4] = [
        &|i, printed| if holds(i, printed) { printed } else { roomy(i) },
        &|i, printed| if holds(i, printed) { printed } else { heights[i] },
        &|i, _| roomy(i),
        &|i, _| heights[i],
    ];
    for (attempt, semi) in open.iter().enumerate() {
        let lens = filled(&lens, clears, semi);
        if validate(&lens).is_ok() {
            if attempt > 1 && clears.iter().enumerate().any(|(i, clear)| is_cut(*clear, semi(i, 0.0))) {
                let message = "surfaces end or cross within their printed semi-diameters, which lose no light; \
                               they are made as large as the beams";
                losses.add(0, "", Effect::Approximated, message);
            }
            return Ok((lens, None));
        }
    }
    if let Some((mut lens, shares)) = narrowed(&lens, clears, &heights) {
        // There is no glass beyond.
        for (surface, share) in lens.surfaces.iter_mut().zip(&shares) {
            surface.is_open &= *share == 1.0;
        }
        let cut = shares.iter().enumerate().filter(|(_, share)| **share < 1.0);
        let cut: Vec<String> =
            cut.map(|(i, share)| format!("{:.0} % of them at surface {}", 100.0 * share, i + 1)).collect();
        let message = format!(
            "the beams are wider than the surfaces can be; the clear semi-diameters take {}",
            cut.join(", ")
        );
        losses.add(0, "", Effect::Approximated, message);
        return Ok((lens, None));
    }
    let lens = filled(&lens, clears, |i, _| heights[i]);
    traceable(&lens)?;
    let flaw = validate(&lens).err();
    Ok((lens, flaw))
}

/// The lens with clear semi-diameters that its surfaces can have, and their shares of the beams' heights: only surfaces that end or cross within
/// the beams are made smaller. `None` where that mends nothing.
fn narrowed(lens: &Lens, clears: &[Clear], heights: &[f64]) -> Option<(Lens, Vec<f64>)> {
    let mut shares = vec![1.0; heights.len()];
    loop {
        let lens = filled(lens, clears, |i, _| heights[i] * shares[i]);
        let Err(defect) = validate(&lens) else { return Some((lens, shares)) };
        let too_wide = too_wide(&defect, &lens, clears)?;
        shares[too_wide] *= NARROWER;
        if shares[too_wide] < NARROWEST {
            return None;
        }
    }
}

/// The surface without an edge, from 0, that has to be smaller for a defect to vanish. The stop is as large as the pupil makes it.
fn too_wide(defect: &LensDefect, lens: &Lens, clears: &[Clear]) -> Option<usize> {
    let is_open = |i: &usize| *i != lens.stop && matches!(clears.get(*i), Some(Clear::Open(_)));
    let semi = |i: &usize| lens.surfaces[*i].semi_diameter_mm;
    match *defect {
        LensDefect::SurfaceEnds { surface, .. } => Some(surface - 1).filter(is_open),
        // Glass is thinnest at the larger of its two radii; air is measured at the smaller.
        LensDefect::EdgeThickness { surface, .. } => {
            [surface - 1, surface].into_iter().filter(is_open).max_by(|a, b| semi(a).total_cmp(&semi(b)))
        }
        LensDefect::AirGap { surface, next, .. } => {
            [surface - 1, next - 1].into_iter().filter(is_open).min_by(|a, b| semi(a).total_cmp(&semi(b)))
        }
        _ => None,
    }
}

/// Whether a surface without an edge becomes smaller than the file prints.
fn is_cut(clear: Clear, semi: f64) -> bool {
    matches!(clear, Clear::Open(printed) if printed > semi)
}

/// The lens with the edges of the file, and with `open(surface, printed)` for surfaces without an edge.
fn filled(lens: &Lens, clears: &[Clear], open: impl Fn(usize, f64) -> f64) -> Lens {
    let mut lens = lens.clone();
    let stop_radius = first_order(&lens.at_wavelength(lens.reference_um)).stop_radius_mm.abs();
    for (i, clear) in clears.iter().copied().enumerate() {
        lens.surfaces[i].is_open = matches!(clear, Clear::Open(_)) && i != lens.stop;
        lens.surfaces[i].semi_diameter_mm = match clear {
            Clear::Edge(mm) | Clear::Beam(mm) => mm,
            Clear::Open(_) if i == lens.stop && stop_radius > 0.0 && stop_radius.is_finite() => stop_radius,
            Clear::Open(printed) => {
                let semi = open(i, printed);
                // A beam that only meets the axis has height 0.
                if semi > 0.0 { semi } else { SOFT_EDGE_MM }
            }
        };
    }
    lens
}

/// Largest distance from the vertex at which traced rays meet each surface, mm.
fn beam_heights(lens: &Lens, clears: &[Clear]) -> Vec<f64> {
    let mut lens = lens.clone();
    for (surface, clear) in lens.surfaces.iter_mut().zip(clears) {
        if let Clear::Edge(mm) | Clear::Beam(mm) = clear {
            surface.semi_diameter_mm = *mm;
        }
    }
    let all = &lens.fields_deg;
    // Select fields and wavelengths to trace.
    let looked_at: Vec<f64> = match all.len() {
        few if few <= FIELDS => all.clone(),
        many => (0..FIELDS).map(|i| all[i * (many - 1) / (FIELDS - 1)]).collect(),
    };
    let ends = [lens.wavelengths_um.first(), lens.wavelengths_um.last(), Some(&lens.reference_um)];
    let mut colours: Vec<f64> = ends.into_iter().flatten().copied().collect();
    colours.dedup();
    // Trace rays through the rim of the stop, and record the largest height on every surface.
    let mut heights = vec![0.0_f64; lens.surfaces.len()];
    let stop_radius = first_order(&lens.at_wavelength(lens.reference_um)).stop_radius_mm;
    for um in colours {
        let sequence = lens.at_wavelength(um);
        let order = first_order(&sequence);
        for field in &looked_at {
            let field = field.to_radians();
            for k in 0..AZIMUTHS {
                let (sin, cos) = (k as f64 / AZIMUTHS as f64 * std::f64::consts::TAU).sin_cos();
                for radius in RADII {
                    let p = [radius * cos, radius * sin];
                    let at = aim_one(&sequence, field, stop_radius, p)
                        .unwrap_or_else(|| paraxial_launch(&order, &sequence, field, p));
                    let path = trace_ray(&sequence, launch(&sequence, field, at).ray);
                    for (height, passage) in heights.iter_mut().zip(&path.passages) {
                        let [x, y, _] = passage.point;
                        let here = x.hypot(y);
                        if here.is_finite() {
                            *height = height.max(here);
                        }
                    }
                    if path.fate.reaches_image() {
                        break;
                    }
                }
            }
        }
    }
    heights
}
