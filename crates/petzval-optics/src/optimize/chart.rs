//! From the variables to the lens, and how every number of the lens follows them.

use nalgebra::DMatrix;

use super::problem::{ImagePlane, Problem};
use crate::design_space::Variable;
use crate::gradient::LensGradient;
use crate::lens::Lens;
use crate::number::Number;
use crate::paraxial::{FirstOrderCotangent, first_order, pull_back_first_order};
use crate::solve::{with_efl, with_length};

/// A problem that makes no lens.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ChartError {
    /// A variable, pickup or solve names a surface that the lens does not have.
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
    /// A problem without fields or wavelengths, or with another number of weights than fields.
    #[error("there are {fields} fields, {weights} weights for them and {wavelengths} wavelengths")]
    NothingToSee {
        /// Number of fields.
        fields: usize,
        /// Number of weights.
        weights: usize,
        /// Number of wavelengths.
        wavelengths: usize,
    },
    /// A variable of a surface that has no such number.
    #[error("surface {surface} has no {number}")]
    NoSuchNumber {
        /// Surface, from 1.
        surface: usize,
        /// Which number.
        number: Number,
    },
    /// A pickup on a number that a solve computes.
    #[error("surface {surface}: {number} cannot follow a variable, a solve computes it")]
    Settled {
        /// Surface, from 1.
        surface: usize,
        /// Which number.
        number: Number,
    },
    /// A glass may be exchanged for none.
    #[error("the glass behind surface {surface} has no candidates")]
    NoGlass {
        /// Surface, from 1.
        surface: usize,
    },
    /// Bounds that leave nothing between them.
    #[error("surface {surface}, {number}: the bounds {min} and {max} leave nothing between them")]
    Bounds {
        /// Surface, from 1.
        surface: usize,
        /// Which number.
        number: Number,
        /// Lower bound.
        min: f64,
        /// Upper bound.
        max: f64,
    },
    /// No curvature of the solved surface gives the focal length.
    #[error("no curvature of surface {surface} gives a focal length of {efl_mm} mm")]
    EflUnsolvable {
        /// Surface, from 1.
        surface: usize,
        /// Wanted EFL, mm.
        efl_mm: f64,
    },
    /// Rays of the lens, as its solves and bounds make it, do not reach the image.
    #[error("rays through the stop do not reach the image, with the lens as its solves and bounds make it")]
    NoRays,
}

/// The coordinates of a problem: one per variable (a curvature for a radius), and the image distance last if it is free.
#[derive(Clone, Debug)]
pub(super) struct Chart<'a> {
    problem: &'a Problem,
    /// Bounds of the coordinates.
    pub bounds: Vec<[f64; 2]>,
    /// Numbers of the lens that move: those of the variables, then pickups, then solves, then the image distance.
    pub numbers: Vec<(usize, Number)>,
}

/// A lens of the chart, and how its numbers, and last the relative radius of its stop, move with the coordinates:
/// `[number][coordinate]`.
#[derive(Clone, Debug)]
pub(super) struct Mapped {
    pub lens: Lens,
    pub slopes: DMatrix<f64>,
}

/// Bounds of a variable as bounds of its coordinate.
///
/// Radii of both signs pass through the plane, not through zero: the curvature lies between those of the two bounds.
fn coordinate_bounds(v: &Variable) -> [f64; 2] {
    let [a, b] = [v.min, v.max].map(|bound| v.number.from_stated(bound));
    if v.number == Number::Curvature { [a.min(b), a.max(b)] } else { [a, b] }
}

impl<'a> Chart<'a> {
    pub fn new(problem: &'a Problem) -> Result<Self, ChartError> {
        let count = problem.base.surfaces.len();
        let solves = &problem.solves;
        let named = problem.variables.iter().map(|v| v.surface);
        let named = named.chain(problem.pickups.iter().map(|p| p.surface));
        let named = named.chain(problem.glasses.iter().map(|g| g.surface));
        let named = named.chain(solves.efl.map(|s| s.surface)).chain(solves.length.map(|(s, _)| s));
        if let Some(surface) = named.into_iter().find(|s| *s >= count) {
            return Err(ChartError::NoSuchSurface { surface: surface + 1, count });
        }
        let (fields, weights) = (problem.fields_rad.len(), problem.field_weights.len());
        let wavelengths = problem.wavelengths_um.len();
        if fields == 0 || weights != fields || wavelengths == 0 {
            return Err(ChartError::NothingToSee { fields, weights, wavelengths });
        }
        for v in &problem.variables {
            if !problem.base.surfaces[v.surface].has_number(v.number) {
                return Err(ChartError::NoSuchNumber { surface: v.surface + 1, number: v.number });
            }
        }
        if let Some(solve) = &solves.efl
            && !problem.base.surfaces[solve.surface].has_number(Number::Curvature)
        {
            let (surface, number) = (solve.surface + 1, Number::Curvature);
            return Err(ChartError::NoSuchNumber { surface, number });
        }
        if let Some(g) = problem.glasses.iter().find(|g| g.candidates.is_empty()) {
            return Err(ChartError::NoGlass { surface: g.surface + 1 });
        }
        let variables = problem.variables.len();
        if let Some(p) = problem.pickups.iter().find(|p| p.variable >= variables) {
            return Err(ChartError::NoSuchVariable { variable: p.variable + 1, count: variables });
        }
        for p in &problem.pickups {
            let number = problem.variables[p.variable].number;
            let settled = match number {
                Number::Curvature => solves.efl.is_some_and(|s| s.surface == p.surface),
                Number::Thickness => {
                    let solved = solves.length.is_some_and(|(s, _)| s == p.surface);
                    let image = problem.image == ImagePlane::Best && p.surface + 1 == count;
                    solved || image
                }
                _ => false,
            };
            if settled {
                return Err(ChartError::Settled { surface: p.surface + 1, number });
            }
            if !problem.base.surfaces[p.surface].has_number(number) {
                return Err(ChartError::NoSuchNumber { surface: p.surface + 1, number });
            }
        }
        let mut bounds: Vec<[f64; 2]> = problem.variables.iter().map(coordinate_bounds).collect();
        for (v, [low, high]) in problem.variables.iter().zip(&mut bounds) {
            let forwards = problem.base.light_goes_forwards(v.surface);
            // A least thickness of a variable is a bound, which costs nothing to keep.
            let least = match (v.number, problem.base.surfaces[v.surface].glass.is_air()) {
                (Number::Thickness, _) if v.surface + 1 == count => None,
                (Number::Thickness, true) if problem.has_open_gap(v.surface) => None,
                (Number::Thickness, true) => problem.limits.air_gap_mm,
                (Number::Thickness, false) => problem.limits.element_centre_mm,
                _ => None,
            };
            if let Some(least) = least {
                match forwards {
                    true => *low = low.max(least).min(*high - 1e-9 * high.abs()),
                    false => *high = high.min(-least).max(*low + 1e-9 * low.abs()),
                }
            }
        }
        for (v, [low, high]) in problem.variables.iter().zip(&bounds) {
            if !(low < high && low.is_finite() && high.is_finite()) {
                let (surface, number) = (v.surface + 1, v.number);
                return Err(ChartError::Bounds { surface, number, min: v.min, max: v.max });
            }
        }
        let mut numbers: Vec<(usize, Number)> =
            problem.variables.iter().map(|v| (v.surface, v.number)).collect();
        for p in &problem.pickups {
            numbers.push((p.surface, numbers[p.variable].1));
        }
        numbers.extend(solves.efl.map(|s| (s.surface, Number::Curvature)));
        numbers.extend(solves.length.map(|(s, _)| (s, Number::Thickness)));
        if problem.image == ImagePlane::Best {
            bounds.push([f64::NEG_INFINITY, f64::INFINITY]);
            numbers.push((count - 1, Number::Thickness));
        }
        Ok(Self { problem, bounds, numbers })
    }

    /// Number of coordinates.
    pub fn dimension(&self) -> usize {
        self.bounds.len()
    }

    /// Coordinates of the problem's own lens, moved inside their bounds.
    pub fn start(&self) -> Vec<f64> {
        let lens = &self.problem.base;
        let mut at: Vec<f64> =
            self.numbers[..self.problem.variables.len()].iter().map(|(s, n)| n.read(lens, *s)).collect();
        if self.problem.image == ImagePlane::Best {
            at.push(lens.image_distance_mm());
        }
        for (x, [low, high]) in at.iter_mut().zip(&self.bounds) {
            *x = x.clamp(*low, *high);
        }
        at
    }

    /// Puts a free image plane at the paraxial focus.
    pub fn refocus(&self, at: &mut [f64]) {
        if self.problem.image == ImagePlane::Best
            && let Some(lens) = self.lens(at)
            && let Some(distance) = at.last_mut()
        {
            let order = first_order(&lens.at_wavelength(lens.reference_um));
            if order.image_distance_mm.is_finite() {
                *distance = order.image_distance_mm;
            }
        }
    }

    /// The lens at some coordinates; `None` if a solve has no solution.
    pub fn lens(&self, at: &[f64]) -> Option<Lens> {
        let mut lens = self.problem.base.clone();
        for (n, x) in self.numbers.iter().zip(&at[..self.problem.variables.len()]) {
            n.1.write(&mut lens, n.0, *x);
        }
        for p in &self.problem.pickups {
            let followed = self.numbers[p.variable];
            followed.1.write(&mut lens, p.surface, p.scale * at[p.variable] + p.offset);
        }
        if let Some((surface, length_mm)) = self.problem.solves.length {
            lens = with_length(&lens, surface, length_mm);
        }
        if let Some(solve) = &self.problem.solves.efl {
            lens = with_efl(&lens, solve.surface, solve.efl_mm)?;
        }
        if self.problem.image == ImagePlane::Best {
            lens = lens.with_image_distance(*at.last()?);
        }
        Some(lens)
    }

    /// The lens at some coordinates, and how it moves.
    pub fn map(&self, at: &[f64]) -> Option<Mapped> {
        let lens = self.lens(at)?;
        let variables = self.problem.variables.len();
        let coordinates = self.dimension();
        let mut slopes = DMatrix::zeros(self.numbers.len() + 1, coordinates);
        for i in 0..variables {
            slopes[(i, i)] = 1.0;
        }
        let mut row = variables;
        for p in &self.problem.pickups {
            slopes[(row, p.variable)] = p.scale;
            row += 1;
        }
        let efl_row = self.problem.solves.efl.map(|_| row);
        row += usize::from(efl_row.is_some());
        let last = lens.surfaces.len() - 1;
        if let Some((solved, _)) = self.problem.solves.length {
            // The other thicknesses between the vertices push it back.
            for other in 0..row {
                let (surface, number) = self.numbers[other];
                if number == Number::Thickness && surface != last && surface != solved {
                    for c in 0..coordinates {
                        slopes[(row, c)] -= slopes[(other, c)];
                    }
                }
            }
            row += 1;
        }
        if self.problem.image == ImagePlane::Best {
            slopes[(row, coordinates - 1)] = 1.0;
        }
        let sequence = lens.at_wavelength(lens.reference_um);
        let by = |bars: FirstOrderCotangent| {
            let mut g = LensGradient::zero(lens.surfaces.len());
            pull_back_first_order(&sequence, bars, &mut g);
            self.numbers.iter().map(|number| g[*number]).collect::<Vec<f64>>()
        };
        if let Some(solved) = efl_row {
            // EFL(numbers) stays, so the solved curvature moves against the others.
            let efl = by(FirstOrderCotangent { efl: 1.0, ..Default::default() });
            for c in 0..coordinates {
                let others: f64 =
                    (0..self.numbers.len()).filter(|n| *n != solved).map(|n| efl[n] * slopes[(n, c)]).sum();
                slopes[(solved, c)] = -others / efl[solved];
            }
        }
        // The stop keeps the entrance pupil.
        let radius = first_order(&sequence).stop_radius_mm;
        let stop = by(FirstOrderCotangent { stop_radius: 1.0 / radius, ..Default::default() });
        for c in 0..coordinates {
            slopes[(self.numbers.len(), c)] = (0..self.numbers.len()).map(|n| stop[n] * slopes[(n, c)]).sum();
        }
        Some(Mapped { lens, slopes })
    }
}
