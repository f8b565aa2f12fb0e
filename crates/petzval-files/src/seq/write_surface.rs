//! Writes a surface: its line, its shape, its placement.

use super::out::Out;
use crate::draft::is_bend;
use crate::export::{degrees, surface_error};
use crate::loss::Effect;
use crate::toml_number::number;
use petzval_base::FileError;
use petzval_optics::lens::{Action, Axis, Departure, Placement, Surface, xy_powers};

/// Letters of the coefficients of r^4, r^6, ..., r^16.
const LETTERS: [&str; 7] = ["A", "B", "C", "D", "E", "F", "G"];

/// Writes a surface, and a dummy behind a mirror that bends the axis about two axes at once.
pub(super) fn write_surface(
    out: &mut Out<'_>,
    index: usize,
    s: &Surface,
    stop: bool,
) -> Result<(), FileError> {
    let compound = s.placement.filter(|p| p.axis == Axis::Bends && !is_bend(p));
    let glass = out.glass_name(index, &s.glass);
    let medium = match s.action {
        Action::Refract => glass.clone(),
        Action::Reflect => "REFL".to_owned(),
        Action::ThinLens { .. } => {
            return Err(surface_error(index + 1, "the format has no thin lenses that are read"));
        }
    };
    if s.phase.is_some() {
        let message = "diffractive structures are not written: the sign of their orders is not known";
        return Err(surface_error(index + 1, message));
    }
    let thickness_mm = if compound.is_some() { 0.0 } else { s.thickness_mm };
    let line = format!("S {} {} {medium}", out.curved(s.shape.curvature), number(thickness_mm));
    out.line(format_args!("{}", line.trim_end()));
    if stop {
        out.line(format_args!("  STO"));
    }
    if !s.label.is_empty() {
        let label = out.quoted(&format!("surface {}", index + 1), &s.label);
        out.line(format_args!("  SLB {label}"));
    }
    write_shape(out, index, s)?;
    if !s.is_open {
        out.line(format_args!("  CIR {}", number(s.semi_diameter_mm)));
    }
    if let Some(placed) = &s.placement {
        write_place(out, index, placed, compound.is_some());
    }
    if let Some(placed) = compound {
        // Rotate the axis behind the mirror by the mirror's rotations about x and y, and back about z, in reverse order.
        let [x, y, z] = placed.tilt_rad;
        let behind = Placement { tilt_rad: [0.0 - x, 0.0 - y, z], ..Placement::default() };
        out.line(format_args!("S 0.0 {} {glass}", number(s.thickness_mm)));
        write_angles(out, index, &behind);
        out.line(format_args!("  REV"));
    }
    Ok(())
}

fn write_place(out: &mut Out<'_>, index: usize, placed: &Placement, compound: bool) {
    let [x, y] = placed.decenter_mm;
    out.line(format_args!("  XDE {}; YDE {}; ZDE 0.0", number(x), number(y)));
    write_angles(out, index, placed);
    match placed.axis {
        Axis::Returns => out.line(format_args!("  DAR")),
        Axis::Bends if !compound => out.line(format_args!("  BEN")),
        _ => {}
    }
}

/// Writes the rotations of a placement; those about x and y are left-handed in the file.
fn write_angles(out: &mut Out<'_>, index: usize, placed: &Placement) {
    let mut angle = |rad: f64| {
        let (deg, exact) = degrees(rad);
        if !exact {
            let message = "in degrees, a tilt changes in its last digit";
            out.losses.of_surface(index + 1, Effect::Approximated, message);
        }
        number(deg)
    };
    let [x, y, z] = placed.tilt_rad;
    let (a, b, c) = (angle(0.0 - x), angle(0.0 - y), angle(z));
    out.line(format_args!("  ADE {a}; BDE {b}; CDE {c}"));
}

fn write_shape(out: &mut Out<'_>, index: usize, s: &Surface) -> Result<(), FileError> {
    let shape = &s.shape;
    let has = |values: &[f64]| values.iter().any(|v| v.to_bits() != 0);
    let refused = |message: &str| Err(surface_error(index + 1, message));
    match &shape.departure {
        // Even powers from r^4 on are written as an asphere; r^2 exists only in the form with all powers.
        Departure::None if !has(&shape.asphere[..1]) => {
            if has(&shape.asphere) {
                out.line(format_args!("  ASP\n  K {}", number(shape.conic)));
                write_letters(out, &LETTERS, &shape.asphere[1..]);
            } else if shape.conic.to_bits() != 0 {
                out.line(format_args!("  CON\n  K {}", number(shape.conic)));
            }
        }
        Departure::None => {
            write_powers(out, shape.conic, &[0.0; petzval_optics::lens::ODD_TERMS], &shape.asphere)
        }
        Departure::Odd(b) => write_powers(out, shape.conic, b, &shape.asphere),
        Departure::Xy { norm_radius_mm, coefficients } => {
            if has(&shape.asphere) {
                return refused("a polynomial in x and y has no even asphere terms in this format");
            }
            let norm = number(*norm_radius_mm);
            out.line(format_args!("  SPS XYP {norm}\n    SCO NRADIUS {norm}; SCO K {}", number(shape.conic)));
            for (k, _) in xy_powers().enumerate().filter(|(k, _)| coefficients[*k].to_bits() != 0) {
                out.line(format_args!("    SCO C{} {}", k + 2, number(coefficients[k])));
            }
        }
        Departure::Biconic { curvature_x, conic_x } => {
            if has(&shape.asphere[..1]) || has(&shape.asphere[5..]) {
                return refused("an anamorphic asphere has terms of r^4 to r^10 only");
            }
            out.line(format_args!(
                "  AAS\n  {} {}",
                if out.radii { "RDX" } else { "CUX" },
                out.curved(*curvature_x)
            ));
            out.line(format_args!("  KX {}; KY {}", number(*conic_x), number(shape.conic)));
            write_letters(out, &["AR", "BR", "CR", "DR"], &shape.asphere[1..5]);
        }
        Departure::Toroid { curvature_x } => {
            if has(&shape.asphere[..1]) {
                return refused("a toroid has no term of y^2 in this format");
            }
            out.line(format_args!(
                "  YTO\n  {} {}",
                if out.radii { "RDX" } else { "CUX" },
                out.curved(*curvature_x)
            ));
            out.line(format_args!("  K {}", number(shape.conic)));
            write_letters(out, &LETTERS, &shape.asphere[1..]);
        }
        Departure::Qbfs { .. } | Departure::Qcon { .. } => {
            return refused(
                "Forbes surfaces are not written: how files name and order their numbers is not known",
            );
        }
    }
    Ok(())
}

fn write_letters(out: &mut Out<'_>, letters: &[&str], values: &[f64]) {
    for (letter, value) in letters.iter().zip(values).filter(|(_, v)| v.to_bits() != 0) {
        out.line(format_args!("  {letter} {}", number(*value)));
    }
}

/// Writes all powers of r.
fn write_powers(out: &mut Out<'_>, conic: f64, odd: &[f64], even: &[f64]) {
    out.line(format_args!("  SPS ODD 0.0\n    SCO K {}", number(conic)));
    let powers = odd.iter().zip(even).flat_map(|(o, e)| [*o, *e]);
    for (power, value) in (1..).zip(powers).filter(|(_, v)| v.to_bits() != 0) {
        out.line(format_args!("    SCO AR{power} {}", number(value)));
    }
}
