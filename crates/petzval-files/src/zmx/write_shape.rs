//! Writes the shape and the diffractive structure of a surface as a surface type of the format.

use super::out::Out;
use crate::decimal::shifted_text;
use crate::export::surface_error;
use crate::loss::Effect;
use crate::toml_number::{exact_reciprocal, number};
use petzval_base::FileError;
use petzval_optics::lens::{Action, Departure, Pattern, Phase, Surface, SurfaceShape};

/// Number of powers of an odd asphere without extra values.
const ODDASPHE_POWERS: usize = 8;

/// Writes type, curvature, conic and coefficients.
pub(super) fn write_shape(out: &mut Out<'_>, number_of: usize, s: &Surface) -> Result<(), FileError> {
    let shape = &s.shape;
    let kind = kind(number_of, s)?;
    out.line(format_args!("  TYPE {kind}\n  CURV {} 0 0 0 0 \"\"", number(shape.curvature)));
    if shape.conic.to_bits() != 0 {
        out.line(format_args!("  CONI {}", number(shape.conic)));
    }
    let mut parm = Values::default();
    let mut xdat = Values::default();
    match kind {
        "EVENASPH" => parm.from(1, &shape.asphere),
        "ODDASPHE" => parm.from(1, &powers(shape)[..ODDASPHE_POWERS]),
        "XOSPHERE" => xdat.counted(1.0, &powers(shape)),
        "PARAXIAL" => {
            let Action::ThinLens { power_per_mm } = s.action else { return Ok(()) };
            parm.set(1, radius(out, number_of, power_per_mm, "focal length"));
            parm.set(2, 1.0);
        }
        "BICONICX" => {
            if let Departure::Biconic { curvature_x, conic_x } = shape.departure {
                parm.set(1, radius(out, number_of, curvature_x, "radius in x"));
                parm.set(2, conic_x);
            }
        }
        "TOROIDAL" => {
            if let Departure::Toroid { curvature_x } = shape.departure {
                parm.set(1, radius(out, number_of, curvature_x, "radius in x"));
                parm.from(2, &shape.asphere[..7]);
            }
        }
        "XPOLYNOM" => {
            if let Departure::Xy { norm_radius_mm, coefficients } = &shape.departure {
                xdat.counted(*norm_radius_mm, coefficients);
            }
        }
        "BINARY_2" => {
            parm.from(1, &shape.asphere);
            if let Some(Phase { order, pattern: Pattern::Binary { norm_radius_mm, coefficients_rad } }) =
                s.phase
            {
                parm.set(0, f64::from(order));
                xdat.counted(norm_radius_mm, &coefficients_rad);
            }
        }
        "DGRATING" => {
            if let Some(Phase { order, pattern: Pattern::Grating { lines_per_mm } }) = s.phase {
                // Convert to lines per um by moving the decimal point.
                out.line(format_args!("  PARM 1 {}", shifted_text(lines_per_mm, -3)));
                parm.set(2, f64::from(order));
            }
        }
        _ => {}
    }
    for (index, value) in parm.0 {
        out.line(format_args!("  PARM {index} {}", number(value)));
    }
    for (index, value) in xdat.0 {
        out.line(format_args!("  XDAT {index} {} 0 0 1 0 0 \"\"", number(value)));
    }
    Ok(())
}

/// Numbered values.
#[derive(Default)]
struct Values(Vec<(usize, f64)>);

impl Values {
    fn set(&mut self, index: usize, value: f64) {
        self.0.push((index, value));
    }

    /// Adds values from an index on. Zeros are omitted, because they are the default; negative zeros are kept.
    fn from(&mut self, first: usize, values: &[f64]) {
        let said = values.iter().enumerate().filter(|(_, v)| v.to_bits() != 0);
        self.0.extend(said.map(|(i, v)| (first + i, *v)));
    }

    /// Adds the number of values, a normalisation radius, and the values.
    fn counted(&mut self, norm_radius: f64, values: &[f64]) {
        let count = values.iter().rposition(|v| v.to_bits() != 0).map_or(0, |last| last + 1);
        self.set(1, count as f64);
        self.set(2, norm_radius);
        self.from(3, values);
    }
}

/// Coefficients of r, r^2, ..., r^16.
fn powers(shape: &SurfaceShape) -> Vec<f64> {
    let odd = match &shape.departure {
        Departure::Odd(b) => *b,
        _ => [0.0; petzval_optics::lens::ODD_TERMS],
    };
    odd.iter().zip(&shape.asphere).flat_map(|(odd, even)| [*odd, *even]).collect()
}

/// The reciprocal of a curvature or power; 0 for 0.
fn radius(out: &mut Out<'_>, surface: usize, value: f64, what: &str) -> f64 {
    if value == 0.0 {
        return 0.0;
    }
    exact_reciprocal(value).unwrap_or_else(|| {
        let message = format!("as a {what}, a number changes in its last digit");
        out.losses.of_surface(surface, Effect::Approximated, message);
        1.0 / value
    })
}

/// The name of the surface type that can represent a surface.
fn kind(number_of: usize, s: &Surface) -> Result<&'static str, FileError> {
    let shape = &s.shape;
    let is_even = shape.asphere.iter().any(|a| a.to_bits() != 0);
    let refused = |message: &str| Err(surface_error(number_of, message));
    if let Action::ThinLens { power_per_mm } = s.action {
        return match power_per_mm {
            0.0 => refused("a thin lens without power cannot be written: its focal length is infinite"),
            _ => Ok("PARAXIAL"),
        };
    }
    if s.phase.is_some() && s.action == Action::Reflect {
        return refused(
            "a diffractive structure on a mirror is not written: the sign of its orders is not known",
        );
    }
    match (&s.phase, &shape.departure) {
        (Some(Phase { pattern: Pattern::Grating { .. }, .. }), Departure::None) if !is_even => Ok("DGRATING"),
        (Some(Phase { pattern: Pattern::Binary { .. }, .. }), Departure::None) => Ok("BINARY_2"),
        (Some(_), _) => refused("no surface type has this shape together with this diffractive structure"),
        (None, Departure::None) => Ok(if is_even { "EVENASPH" } else { "STANDARD" }),
        (None, Departure::Odd(_)) => {
            let beyond = powers(shape)[ODDASPHE_POWERS..].iter().any(|v| v.to_bits() != 0);
            Ok(if beyond { "XOSPHERE" } else { "ODDASPHE" })
        }
        (None, Departure::Xy { .. }) if !is_even => Ok("XPOLYNOM"),
        (None, Departure::Biconic { .. }) if !is_even => Ok("BICONICX"),
        (None, Departure::Toroid { .. }) if shape.asphere[7].to_bits() == 0 => Ok("TOROIDAL"),
        (None, Departure::Toroid { .. }) => refused("a toroid has no term of y^16 in this format"),
        (None, Departure::Xy { .. } | Departure::Biconic { .. }) => {
            refused("a polynomial in x and y or a biconic has no even asphere terms in this format")
        }
        (None, Departure::Qbfs { .. } | Departure::Qcon { .. }) => {
            refused("Forbes surfaces are not written: how files name and order their numbers is not known")
        }
    }
}
