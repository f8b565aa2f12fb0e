//! Shared functions of the writers of other programs' formats.

use std::borrow::Cow;

use super::draft::{AS_WIDE, rounded};
use super::loss::{Effect, Loss, Losses};
use super::toml_number::exact_degrees;
use petzval_base::FileError;

use super::LensFile;
use petzval_optics::design_space::Solves;
use petzval_optics::lens::Lens;
use petzval_optics::paraxial::first_order;

/// A lens in another program's format, and the losses of the conversion.
#[derive(Clone, Debug, PartialEq)]
pub struct Export {
    /// The text.
    pub text: String,
    /// Everything in the lens that the text does not represent.
    pub losses: Vec<Loss>,
}

/// Reports the parts of a lens file that other programs' formats do not have.
pub(super) fn lose_the_rest(file: &LensFile, losses: &mut Losses) {
    let mut lose = |what: &str| losses.add(0, what, Effect::NoRay, "the format has no place for this");
    if !file.variables.is_empty() {
        lose("[[variable]]");
    }
    if !file.pickups.is_empty() {
        lose("[[pickup]]");
    }
    if file.solves() != Solves::default() {
        lose("[solve]");
    }
    if file.expect.is_some() {
        lose("[expect]");
    }
}

/// The lens with a clear aperture of its stop that lets the beam through.
///
/// Here the entrance pupil counts where the aperture of the stop is narrower; other programs clip there.
pub(super) fn with_open_stop<'a>(lens: &'a Lens, losses: &mut Losses) -> Cow<'a, Lens> {
    let beam_mm = first_order(&lens.at_wavelength(lens.reference_um)).stop_radius_mm.abs();
    let semi_mm = lens.surfaces[lens.stop].semi_diameter_mm;
    if beam_mm <= semi_mm * AS_WIDE || !beam_mm.is_finite() {
        return Cow::Borrowed(lens);
    }
    let message = format!(
        "the beam of the entrance pupil, {} mm from the axis, is wider than the stop's clear semi-diameter of {} mm, where the program would clip \
         it: the stop is written as wide as the beam",
        rounded(beam_mm),
        rounded(semi_mm)
    );
    losses.of_surface(lens.stop + 1, Effect::NoRay, message);
    let mut lens = lens.clone();
    lens.surfaces[lens.stop].semi_diameter_mm = beam_mm;
    Cow::Owned(lens)
}

/// An error about a surface, counted from 1.
pub(super) fn surface_error(number: usize, message: impl Into<String>) -> FileError {
    FileError::at_line(0, &format!("surface {number}"), message)
}

/// Text on one line.
pub(super) fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Text without spaces or control characters, as a name among other words must be.
pub(super) fn one_word(text: &str) -> String {
    let visible: String = text.chars().map(|c| if c.is_control() { '_' } else { c }).collect();
    visible.split_whitespace().collect::<Vec<_>>().join("_")
}

/// Degrees that convert back to exactly this angle in rad, else the nearest degrees; and whether they are exact.
pub(super) fn degrees(rad: f64) -> (f64, bool) {
    exact_degrees(rad).map_or((rad.to_degrees(), false), |deg| (deg, true))
}

/// Object heights, mm, from which a reader computes the field angles of the lens. It is a loss if not all angles are exact.
pub(super) fn object_heights(lens: &Lens, distance: f64, losses: &mut Losses) -> Vec<f64> {
    const NEIGHBOURS: usize = 8;
    let sign = if lens.is_rotationally_symmetric() { 1.0 } else { -1.0 };
    let mut all_exact = true;
    let heights = lens.fields_deg.iter().map(|field| {
        let near = sign * distance * field.to_radians().tan();
        let read = |height: f64| (sign * height / distance).atan().to_degrees();
        let (mut up, mut down) = (near, near);
        for _ in 0..NEIGHBOURS {
            for candidate in [up, down] {
                if read(candidate) == *field {
                    return candidate;
                }
            }
            (up, down) = (up.next_up(), down.next_down());
        }
        all_exact = false;
        near
    });
    let heights = heights.collect();
    if !all_exact {
        let message = "as heights of the object, fields change in their last digit";
        losses.add(0, "fields", Effect::Approximated, message);
    }
    heights
}

/// Wavelengths, um, with weights, and the index of the reference among them. A reference outside the lens's list is added
/// with weight 0.
pub(super) fn weighted_wavelengths(lens: &Lens) -> (Vec<(f64, u32)>, usize) {
    let mut list: Vec<(f64, u32)> = lens.wavelengths_um.iter().map(|um| (*um, 1)).collect();
    let reference = list.iter().position(|(um, _)| *um == lens.reference_um).unwrap_or_else(|| {
        list.push((lens.reference_um, 0));
        list.len() - 1
    });
    (list, reference)
}
