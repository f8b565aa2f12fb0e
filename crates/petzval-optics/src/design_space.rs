//! Which numbers of a lens may move, between which bounds, and what algebra settles exactly.
//!
//! A point of the space is a vector of free coordinates x. Each variable is bounded by the smooth map
//! `value = middle + half-range sin(x)`; then a curvature is solved for the focal length, and the
//! image plane is put at the paraxial focus plus a defocus. The gradient goes the same way back.

use std::f64::consts::FRAC_PI_2;

use crate::gradient::LensGradient;
use crate::lens::Lens;
use crate::number::Number;
use crate::paraxial::{FirstOrderCotangent, first_order, pull_back_first_order, pull_back_image_distance};
use crate::solve::{with_efl, with_length, with_paraxial_focus};

/// A number that may move within bounds, which are given as users state them ([`Number::stated`]): those of a curvature are
/// radii in mm, those of a tilt are in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variable {
    /// Surface, from 0.
    pub surface: usize,
    /// Which of its numbers.
    pub number: Number,
    /// Lower bound.
    pub min: f64,
    /// Upper bound.
    pub max: f64,
}

/// A number that follows another: `value = scale * other + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pickup {
    /// The surface whose number follows.
    pub surface: usize,
    /// Index of the variable that it follows; the number is of the same kind.
    pub variable: usize,
    /// Factor. Radii follow as curvatures.
    pub scale: f64,
    /// Offset.
    pub offset: f64,
}

/// Solves one surface's curvature so that the effective focal length holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EflSolve {
    /// Surface, from 0.
    pub surface: usize,
    /// The wanted effective focal length at the reference wavelength, mm.
    pub efl_mm: f64,
    /// Bounds that the solved radius should keep, mm; a solve cannot, a penalty can.
    pub radius_mm: Option<[f64; 2]>,
}

/// Where the image plane goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Focus {
    /// It stays where the last thickness puts it.
    Fixed,
    /// At the paraxial image of the reference wavelength plus a defocus, which is a variable within
    /// plus and minus this many mm.
    Paraxial {
        /// Half-range of the defocus, mm.
        range_mm: f64,
    },
}

/// A design space that cannot be entered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DesignSpaceError {
    /// A variable or solve names a surface that the lens does not have.
    #[error("surface {surface} does not exist: the lens has {count} surfaces")]
    NoSuchSurface {
        /// Surface, from 1.
        surface: usize,
        /// Number of surfaces.
        count: usize,
    },
    /// A pickup follows a variable that does not exist.
    #[error("a pickup follows variable {variable}, of {count}")]
    NoSuchVariable {
        /// Variable, from 1.
        variable: usize,
        /// Number of variables.
        count: usize,
    },
    /// A starting value outside its bounds.
    #[error("surface {surface}, {number}: the lens has {value}, outside {min} ... {max}")]
    OutsideBounds {
        /// Surface, from 1.
        surface: usize,
        /// Which number.
        number: Number,
        /// Its value in the lens.
        value: f64,
        /// Lower bound.
        min: f64,
        /// Upper bound.
        max: f64,
    },
    /// Power behind or in front of the solved surface leaves it no say in the focal length.
    #[error("no curvature of surface {surface} gives a focal length of {efl_mm} mm")]
    EflUnsolvable {
        /// Surface, from 1.
        surface: usize,
        /// Wanted EFL, mm.
        efl_mm: f64,
    },
    /// The defocus of the lens lies outside the range.
    #[error(
        "the image plane is {value_mm:.4} mm from the paraxial focus, outside +-{range_mm} mm; hint: raise that range (`defocus_mm` of an experiment) or refocus the lens"
    )]
    DefocusOutsideRange {
        /// Defocus of the lens, mm.
        value_mm: f64,
        /// Half-range, mm.
        range_mm: f64,
    },
}

/// A lens, and the ways in which it may change.
#[derive(Clone, Debug)]
pub struct DesignSpace {
    base: Lens,
    variables: Vec<Variable>,
    pickups: Vec<Pickup>,
    /// The surface whose thickness keeps the distance from the first vertex to the last, and that distance, mm.
    length: Option<(usize, f64)>,
    efl: Option<EflSolve>,
    focus: Focus,
    start: Vec<f64>,
}

impl DesignSpace {
    /// A space around `base`. Starting values on a bound are moved inside by a thousandth of the
    /// range, because the map has no slope on the bound itself.
    pub fn new(
        base: Lens,
        variables: Vec<Variable>,
        efl: Option<EflSolve>,
        focus: Focus,
    ) -> Result<Self, DesignSpaceError> {
        let count = base.surfaces.len();
        let surfaces = variables.iter().map(|v| v.surface).chain(efl.iter().map(|e| e.surface));
        for surface in surfaces {
            if surface >= count {
                return Err(DesignSpaceError::NoSuchSurface { surface: surface + 1, count });
            }
        }
        let mut start = Vec::with_capacity(variables.len() + 1);
        for v in &variables {
            let value = v.number.read_stated(&base, v.surface);
            let slack = 1e-9 * (v.max - v.min);
            if !(value >= v.min - slack && value <= v.max + slack) {
                return Err(DesignSpaceError::OutsideBounds {
                    surface: v.surface + 1,
                    number: v.number,
                    value,
                    min: v.min,
                    max: v.max,
                });
            }
            start.push(free_coordinate(value, v.min, v.max));
        }
        if let Focus::Paraxial { range_mm } = focus {
            let order = first_order(&base.at_wavelength(base.reference_um));
            let defocus = base.image_distance_mm() - order.image_distance_mm;
            if defocus.abs() > range_mm {
                return Err(DesignSpaceError::DefocusOutsideRange { value_mm: defocus, range_mm });
            }
            start.push(free_coordinate(defocus, -range_mm, range_mm));
        }
        let (pickups, length) = (Vec::new(), None);
        let space = Self { base, variables, pickups, length, efl, focus, start };
        space.lens_at(&space.start)?;
        Ok(space)
    }

    /// The space with numbers that follow its variables, and with the surface whose thickness keeps the distance from the
    /// first vertex to the last, and that distance, mm.
    pub fn with_solves(
        mut self,
        pickups: Vec<Pickup>,
        length: Option<(usize, f64)>,
    ) -> Result<Self, DesignSpaceError> {
        let count = self.base.surfaces.len();
        let named = pickups.iter().map(|p| p.surface).chain(length.map(|(surface, _)| surface));
        for surface in named {
            if surface >= count {
                return Err(DesignSpaceError::NoSuchSurface { surface: surface + 1, count });
            }
        }
        let variables = self.variables.len();
        if let Some(p) = pickups.iter().find(|p| p.variable >= variables) {
            return Err(DesignSpaceError::NoSuchVariable { variable: p.variable + 1, count: variables });
        }
        (self.pickups, self.length) = (pickups, length);
        self.lens_at(&self.start)?;
        Ok(self)
    }

    /// Number of free coordinates.
    pub fn dimension(&self) -> usize {
        self.start.len()
    }

    /// The variables, in the order of the coordinates (a defocus, if free, comes last).
    pub fn variables(&self) -> &[Variable] {
        &self.variables
    }

    /// The coordinates of the lens that the space was made around.
    pub fn start(&self) -> &[f64] {
        &self.start
    }

    /// The lens at a point of the space.
    pub fn lens_at(&self, x: &[f64]) -> Result<Lens, DesignSpaceError> {
        let mut lens = self.base.clone();
        for (v, x) in self.variables.iter().zip(x) {
            v.number.write(&mut lens, v.surface, v.number.from_stated(bounded_value(*x, v.min, v.max)));
        }
        for p in &self.pickups {
            let followed = &self.variables[p.variable];
            let number = followed.number;
            let value = p.scale * number.read(&lens, followed.surface) + p.offset;
            number.write(&mut lens, p.surface, value);
        }
        if let Some((surface, length_mm)) = self.length {
            lens = with_length(&lens, surface, length_mm);
        }
        if let Some(solve) = &self.efl {
            lens = with_efl(&lens, solve.surface, solve.efl_mm).ok_or(DesignSpaceError::EflUnsolvable {
                surface: solve.surface + 1,
                efl_mm: solve.efl_mm,
            })?;
        }
        if let (Focus::Paraxial { range_mm }, Some(x)) = (self.focus, x.last()) {
            lens = with_paraxial_focus(&lens, bounded_value(*x, -range_mm, range_mm));
        }
        Ok(lens)
    }

    /// Derivatives by the free coordinates, from those by the numbers of the lens at `x`.
    pub fn pull_back(&self, x: &[f64], lens: &Lens, gradient: &LensGradient) -> Vec<f64> {
        let sequence = lens.at_wavelength(lens.reference_um);
        let mut gradient = gradient.clone();
        let last = lens.surfaces.len() - 1;
        let by_image_distance = gradient[(last, Number::Thickness)];
        if let Focus::Paraxial { .. } = self.focus {
            // The image plane follows the paraxial image.
            gradient[(last, Number::Thickness)] = 0.0;
            pull_back_image_distance(&sequence, by_image_distance, &mut gradient);
        }
        if let Some(solve) = &self.efl {
            // The solved curvature keeps EFL(lens) constant: add the multiple of dEFL that takes
            // away what the loss asks of that curvature.
            let mut efl = LensGradient::zero(lens.surfaces.len());
            let wish = FirstOrderCotangent { efl: 1.0, ..Default::default() };
            pull_back_first_order(&sequence, wish, &mut efl);
            let s = solve.surface;
            let multiple = -gradient[(s, Number::Curvature)] / efl[(s, Number::Curvature)];
            gradient += &efl.scaled(multiple);
        }
        if let Some((solved, _)) = self.length {
            // The other distances between the vertices push it back.
            let by_solved = std::mem::take(&mut gradient[(solved, Number::Thickness)]);
            for i in (0..last).filter(|i| *i != solved) {
                gradient[(i, Number::Thickness)] -= by_solved;
            }
        }
        for p in &self.pickups {
            let followed = &self.variables[p.variable];
            let number = followed.number;
            let by_follower = gradient[(p.surface, number)];
            gradient[(followed.surface, number)] += p.scale * by_follower;
        }
        let mut out: Vec<f64> = self
            .variables
            .iter()
            .zip(x)
            .map(|(v, x)| 0.5 * (v.max - v.min) * x.cos() * by_stated(v, lens, &gradient))
            .collect();
        if let (Focus::Paraxial { range_mm }, Some(x)) = (self.focus, x.last()) {
            out.push(range_mm * x.cos() * by_image_distance);
        }
        out
    }
}

/// The derivative by a variable as users state it.
fn by_stated(v: &Variable, lens: &Lens, gradient: &LensGradient) -> f64 {
    let by = gradient[(v.surface, v.number)];
    match v.number {
        // dc/dR = -1/R^2 = -c^2
        Number::Curvature => -lens.surfaces[v.surface].shape.curvature.powi(2) * by,
        Number::Tilt(_) => by.to_radians(),
        _ => by,
    }
}

fn bounded_value(x: f64, min: f64, max: f64) -> f64 {
    0.5 * (min + max) + 0.5 * (max - min) * x.sin()
}

fn free_coordinate(value: f64, min: f64, max: f64) -> f64 {
    let s = (2.0 * value - min - max) / (max - min);
    s.clamp(-0.998, 0.998).asin().clamp(-FRAC_PI_2, FRAC_PI_2)
}
