//! Reads the shape of a surface by the formula of its type.

use super::read_surface::{RawSurface, Said, Shapes};
use crate::draft::{in_mm, set_powers};
use petzval_base::FileError;
use petzval_optics::lens::{ASPHERE_TERMS, Departure, Pattern, Phase, SurfaceShape, XY_TERMS};
use petzval_optics::number::PHASE_TERMS;

/// Index of the first extra value that is a coefficient. The values before it are their number and a normalisation radius.
const FIRST_COEFFICIENT: usize = 3;

/// Types that are read, for messages.
const KNOWN: &str = "STANDARD, EVENASPH, ODDASPHE, XASPHERE, XOSPHERE, XPOLYNOM, BICONICX, TOROIDAL, PARAXIAL, COORDBRK, \
                     DGRATING and BINARY_2 are";

impl RawSurface<'_> {
    /// Shape and diffractive structure, in mm.
    pub(super) fn shape(&self, shapes: &Shapes<'_>) -> Result<(SurfaceShape, Option<Phase>), FileError> {
        let mut shape = SurfaceShape {
            curvature: self.curvature.as_ref().map_or(0.0, |said| said.0) / shapes.mm,
            conic: self.conic.as_ref().map_or(0.0, |said| said.0),
            ..SurfaceShape::PLANE
        };
        let mut phase = None;
        match self.kind_name() {
            "STANDARD" => self.allow(&[])?,
            "PARAXIAL" => {
                self.allow(&[1, 2])?;
                // The curvature of a thin lens has no effect.
                shape = SurfaceShape::PLANE;
            }
            "EVENASPH" => {
                self.allow(&[1, 2, 3, 4, 5, 6, 7, 8])?;
                self.even_parameters(&mut shape, 1, ASPHERE_TERMS, shapes);
            }
            "ODDASPHE" => {
                self.allow(&[1, 2, 3, 4, 5, 6, 7, 8])?;
                let terms = (1..=8).map(|n| (n, self.parameter(n)));
                self.powers(&mut shape, terms, 1.0, shapes)?;
            }
            "XASPHERE" | "XOSPHERE" => {
                let step = if self.kind_name() == "XASPHERE" { 2 } else { 1 };
                let (norm_radius, terms) = self.extra_terms()?;
                let powers = terms.into_iter().map(|(i, value)| (step * (i + 1), value));
                self.powers(&mut shape, powers, norm_radius, shapes)?;
            }
            "XPOLYNOM" => shape.departure = self.polynomial(shapes)?,
            "BICONICX" => {
                self.allow(&[1, 2])?;
                let curvature_x = self.reciprocal(1) / shapes.mm;
                shape.departure = Departure::Biconic { curvature_x, conic_x: self.parameter(2) };
            }
            "TOROIDAL" => {
                self.allow(&[1, 2, 3, 4, 5, 6, 7, 8])?;
                self.check_extra_unused()?;
                self.even_parameters(&mut shape, 2, 7, shapes);
                shape.departure = Departure::Toroid { curvature_x: self.reciprocal(1) / shapes.mm };
            }
            "DGRATING" => {
                self.allow(&[1, 2])?;
                // Convert lines per um to lines per mm by moving the decimal point.
                let lines = self.parameters.get(&1).and_then(|(_, line)| line.word(1));
                let lines_per_mm = lines.and_then(|text| crate::decimal::shifted(text, 3)).unwrap_or(0.0);
                let pattern = Pattern::Grating { lines_per_mm };
                phase = Some(Phase { order: self.order(2, 0)?, pattern });
            }
            "BINARY_2" => {
                self.allow(&[0, 1, 2, 3, 4, 5, 6, 7, 8])?;
                self.even_parameters(&mut shape, 1, ASPHERE_TERMS, shapes);
                phase = Some(self.binary(shapes)?);
            }
            kind => {
                return Err(self.kind_error(format!("surfaces of type {kind} are not traced")).hint(KNOWN));
            }
        }
        Ok((shape, phase))
    }

    /// Power of a thin lens, 1/mm.
    pub(super) fn power(&self, shapes: &Shapes<'_>) -> Result<f64, FileError> {
        match self.parameter(1) {
            0.0 => Err(self.kind_error("a thin lens needs a focal length, `PARM 1`")),
            focal_length => Ok(1.0 / (focal_length * shapes.mm)),
        }
    }

    /// Refuses nonzero parameters other than those of the formula, because their effect is not known.
    fn allow(&self, known: &[usize]) -> Result<(), FileError> {
        // Parameter 0 extends the surface beyond its edge.
        let odd = self.parameters.iter().find(|(i, said)| **i != 0 && said.0 != 0.0 && !known.contains(i));
        match odd {
            None => Ok(()),
            Some((index, (_, line))) => {
                let message = format!(
                    "surfaces of type {} have no parameter {index} with a known meaning",
                    self.kind_name()
                );
                Err(line.error(message))
            }
        }
    }

    fn check_extra_unused(&self) -> Result<(), FileError> {
        match self.extra.iter().find(|(index, said)| **index != 2 && said.0 != 0.0) {
            None => Ok(()),
            Some((_, (_, line))) => {
                let message = format!("extra terms of surfaces of type {} are not traced", self.kind_name());
                Err(line.error(message))
            }
        }
    }

    /// Sets the parameters from `PARM first` on as coefficients of r^2, r^4, ...
    fn even_parameters(&self, shape: &mut SurfaceShape, first: usize, terms: usize, shapes: &Shapes<'_>) {
        for (i, a) in shape.asphere.iter_mut().take(terms).enumerate() {
            *a = in_mm(self.parameter(first + i), 2 * i + 2, shapes.mm);
        }
    }

    /// Coefficients of powers of r, each divided by the normalisation radius.
    fn powers(
        &self,
        shape: &mut SurfaceShape,
        terms: impl Iterator<Item = (usize, f64)>,
        norm_radius: f64,
        shapes: &Shapes<'_>,
    ) -> Result<(), FileError> {
        set_powers(shape, terms, norm_radius, shapes.mm).map_err(|message| self.kind_error(message))
    }

    /// The normalisation radius and the coefficients among the extra values, counted from 0. Terms beyond the stated number are
    /// ignored.
    fn extra_terms(&self) -> Result<(f64, Vec<(usize, f64)>), FileError> {
        self.allow(&[])?;
        let value = |index: usize| self.extra.get(&index).map_or(0.0, |said: &Said<'_>| said.0);
        let count = value(1).clamp(0.0, 1e3) as usize;
        let norm_radius = match self.extra.get(&2) {
            Some((radius, _)) if *radius > 0.0 => *radius,
            Some((_, line)) if count > 0 => {
                return Err(line.error("the normalisation radius must be positive"));
            }
            _ => 1.0,
        };
        let terms = self.extra.iter().filter_map(|(index, said)| {
            let i = index.checked_sub(FIRST_COEFFICIENT)?;
            (i < count).then_some((i, said.0))
        });
        Ok((norm_radius, terms.collect()))
    }

    fn polynomial(&self, shapes: &Shapes<'_>) -> Result<Departure, FileError> {
        let (norm_radius, terms) = self.extra_terms()?;
        let mut coefficients = [0.0; XY_TERMS];
        for (i, value) in terms {
            match coefficients.get_mut(i) {
                Some(to) => *to = value * shapes.mm,
                None if value == 0.0 => {}
                None => {
                    let message =
                        format!("term {} of the polynomial is not traced: terms up to degree 8 are", i + 1);
                    return Err(self.kind_error(message));
                }
            }
        }
        let norm_radius_mm = self.norm_radius_mm(norm_radius, shapes)?;
        Ok(Departure::Xy { norm_radius_mm, coefficients })
    }

    fn binary(&self, shapes: &Shapes<'_>) -> Result<Phase, FileError> {
        let value = |index: usize| self.extra.get(&index).map_or(0.0, |said: &Said<'_>| said.0);
        let count = value(1).clamp(0.0, 1e3) as usize;
        let mut coefficients_rad = [0.0; PHASE_TERMS];
        for (index, (value, line)) in &self.extra {
            let Some(i) = index.checked_sub(FIRST_COEFFICIENT).filter(|i| *i < count) else { continue };
            match coefficients_rad.get_mut(i) {
                Some(to) => *to = *value,
                None if *value == 0.0 => {}
                None => return Err(line.error("phase terms beyond r^16 are not traced")),
            }
        }
        let norm_radius_mm = match count {
            0 => 1.0,
            _ => self.norm_radius_mm(value(2), shapes)?,
        };
        let order = if self.parameters.contains_key(&0) { self.order(0, 1)? } else { 1 };
        Ok(Phase { order, pattern: Pattern::Binary { norm_radius_mm, coefficients_rad } })
    }

    fn norm_radius_mm(&self, value: f64, shapes: &Shapes<'_>) -> Result<f64, FileError> {
        let mm = value * shapes.mm;
        if (1e-6..=1e6).contains(&mm) {
            Ok(mm)
        } else {
            Err(self.kind_error(format!("a normalisation radius of {mm} mm is not traced")))
        }
    }

    /// The curvature of a parameter that is a radius; radius 0 means a plane.
    fn reciprocal(&self, index: usize) -> f64 {
        match self.parameter(index) {
            0.0 => 0.0,
            radius => 1.0 / radius,
        }
    }

    /// An order of diffraction from a parameter.
    fn order(&self, index: usize, default: i32) -> Result<i32, FileError> {
        let Some((value, line)) = self.parameters.get(&index) else { return Ok(default) };
        if value.fract() == 0.0 && value.abs() <= 1e6 {
            Ok(*value as i32)
        } else {
            Err(line.error("an order of diffraction must be a whole number"))
        }
    }
}
