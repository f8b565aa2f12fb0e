//! Writing a lens file, such that reading it gives the same bits.

use std::fmt::Write;

use toml_writer::{ToTomlKey, ToTomlValue, TomlStringBuilder};

use super::{Expected, LensFile};
use crate::design_space::Parameter;
use crate::glass::{Dispersion, Glass};
use crate::lens::{Lens, ObjectDistance, Surface};

/// A lens file as text. It carries the formula of each of its glasses, so that it means the same
/// lens with any catalogue.
pub fn write_lens(file: &LensFile) -> String {
    let mut out = String::new();
    write(file, &mut out).expect("a string takes whatever is written to it");
    out
}

fn write(file: &LensFile, out: &mut String) -> std::fmt::Result {
    let lens = &file.lens;
    writeln!(out, "name = {}", quoted(&lens.name))?;
    if !lens.source.is_empty() {
        writeln!(out, "source = {}", quoted(&lens.source))?;
    }
    writeln!(out, "units = \"mm\"")?;

    writeln!(out, "\n[aperture]")?;
    writeln!(out, "entrance_pupil_diameter_mm = {}", number(lens.entrance_pupil_mm))?;
    let distance_mm = match lens.object {
        ObjectDistance::Infinity => f64::INFINITY,
        ObjectDistance::Finite(mm) => mm,
    };
    writeln!(out, "\n[object]\ndistance_mm = {}", number(distance_mm))?;
    writeln!(out, "\n[wavelengths]\num = {}", numbers(&lens.wavelengths_um))?;
    writeln!(out, "reference_um = {}", number(lens.reference_um))?;
    writeln!(out, "\n[fields]\nangle_deg = {}", numbers(&lens.fields_deg))?;

    let glasses = named_glasses(lens);
    for (name, glass) in &glasses {
        write_glass(name, &glass.dispersion, out)?;
    }
    for (i, surface) in lens.surfaces.iter().enumerate() {
        write_surface(surface, i == lens.stop, &glasses, out)?;
    }
    for v in &file.variables {
        let parameter = match v.parameter {
            Parameter::Radius => "radius_mm".to_owned(),
            Parameter::Conic => "conic".into(),
            Parameter::Asphere(order) => format!("a{order}"),
            Parameter::Thickness => "thickness_mm".into(),
        };
        writeln!(out, "\n[[variable]]\nsurface = {}", v.surface + 1)?;
        writeln!(out, "parameter = {}", quoted(&parameter))?;
        writeln!(out, "min = {}\nmax = {}", number(v.min), number(v.max))?;
    }
    if let Some(solve) = &file.efl_solve {
        let (surface, efl_mm) = (solve.surface + 1, number(solve.efl_mm));
        let bounds = match solve.radius_mm {
            Some([min, max]) => format!(", radius_mm = [{}, {}]", number(min), number(max)),
            None => String::new(),
        };
        writeln!(out, "\n[solve]\nefl = {{ surface = {surface}, efl_mm = {efl_mm}{bounds} }}")?;
    }
    let Some(expect) = &file.expect else { return Ok(()) };
    writeln!(out, "\n[expect]")?;
    for (key, expected) in [
        ("efl_mm", expect.efl_mm),
        ("bfl_mm", expect.bfl_mm),
        ("f_number", expect.f_number),
        ("total_track_mm", expect.total_track_mm),
    ] {
        if let Some(Expected { value, tolerance }) = expected {
            let (value, tolerance) = (number(value), number(tolerance));
            writeln!(out, "{key} = {{ value = {value}, tolerance = {tolerance} }}")?;
        }
    }
    if let Some(spots) = &expect.rms_spot_um {
        let (values, tolerance) = (numbers(&spots.values_um), number(spots.relative_tolerance));
        writeln!(out, "rms_spot_um = {{ values = {values}, relative_tolerance = {tolerance} }}")?;
    }
    Ok(())
}

/// The lens's materials with names that differ from each other, whatever the glasses are called.
fn named_glasses(lens: &Lens) -> Vec<(String, &Glass)> {
    let mut named: Vec<(String, &Glass)> = Vec::new();
    for surface in &lens.surfaces {
        let glass = surface.glass.as_ref();
        if *glass == *Glass::air() || named.iter().any(|(_, known)| *known == glass) {
            continue;
        }
        let taken = |name: &str| {
            let name = name.to_uppercase();
            name == "AIR" || named.iter().any(|(known, _)| known.to_uppercase() == name)
        };
        let mut name = glass.name.clone();
        let mut copy = 1;
        while taken(&name) {
            copy += 1;
            name = format!("{}-{copy}", glass.name);
        }
        named.push((name, glass));
    }
    named
}

fn write_glass(name: &str, dispersion: &Dispersion, out: &mut String) -> std::fmt::Result {
    writeln!(out, "\n[glass.{}]", name.to_toml_key())?;
    match dispersion {
        Dispersion::Constant(n) => writeln!(out, "n = {}", number(*n)),
        Dispersion::NdVd { nd, vd } => writeln!(out, "nd = {}\nvd = {}", number(*nd), number(*vd)),
        Dispersion::Schott(a) => writeln!(out, "schott = {}", numbers(a)),
        Dispersion::Sellmeier { b, c_um2 } => {
            writeln!(out, "sellmeier = {{ b = {}, c_um2 = {} }}", numbers(b), numbers(c_um2))
        }
        Dispersion::Table { wavelength_um, index } => {
            let (wavelength_um, index) = (numbers(wavelength_um), numbers(index));
            writeln!(out, "table = {{ wavelength_um = {wavelength_um}, index = {index} }}")
        }
    }
}

fn write_surface(
    surface: &Surface,
    stop: bool,
    glasses: &[(String, &Glass)],
    out: &mut String,
) -> std::fmt::Result {
    writeln!(out, "\n[[surface]]")?;
    if !surface.label.is_empty() {
        writeln!(out, "label = {}", quoted(&surface.label))?;
    }
    if stop {
        writeln!(out, "stop = true")?;
    }
    let shape = &surface.shape;
    match exact_radius(shape.curvature) {
        Some(radius_mm) => writeln!(out, "radius_mm = {}", number(radius_mm))?,
        None => {
            let (curvature, about_mm) = (number(shape.curvature), 1.0 / shape.curvature);
            writeln!(out, "curvature_per_mm = {curvature} # radius {about_mm:.6} mm")?;
        }
    }
    // Zero is the default, but not negative zero: its bits are another number's.
    let is_default = |v: f64| v.to_bits() == 0;
    if !is_default(shape.conic) {
        writeln!(out, "conic = {}", number(shape.conic))?;
    }
    let terms: Vec<String> = (0..)
        .zip(shape.asphere)
        .filter(|(_, a)| !is_default(*a))
        .map(|(i, a)| format!("a{} = {}", 2 * i + 2, number(a)))
        .collect();
    if !terms.is_empty() {
        writeln!(out, "asphere = {{ {} }}", terms.join(", "))?;
    }
    writeln!(out, "thickness_mm = {}", number(surface.thickness_mm))?;
    if let Some((name, _)) = glasses.iter().find(|(_, glass)| **glass == *surface.glass) {
        writeln!(out, "glass = {}", quoted(name))?;
    }
    writeln!(out, "semi_diameter_mm = {}", number(surface.semi_diameter_mm))
}

/// A radius whose reciprocal is the curvature to the last bit, the shortest to print; most but not
/// all curvatures have one.
fn exact_radius(curvature: f64) -> Option<f64> {
    let near = 1.0 / curvature;
    let exact = |radius: &f64| (1.0 / radius).to_bits() == curvature.to_bits();
    let candidates = [near, near.next_down(), near.next_up()];
    candidates.into_iter().filter(exact).min_by_key(|radius| number(*radius).len())
}

/// The shortest decimal that reads back as the same bits.
fn number(value: f64) -> String {
    match value.is_nan() {
        true => "nan".into(),
        false => format!("{value:?}"),
    }
}

fn numbers(values: &[f64]) -> String {
    let values: Vec<String> = values.iter().map(|v| number(*v)).collect();
    format!("[{}]", values.join(", "))
}

/// A one-line TOML string.
fn quoted(text: &str) -> String {
    TomlStringBuilder::new(text).as_basic().to_toml_value()
}
