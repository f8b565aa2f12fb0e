//! From coordinates to the lens, and how every number of the lens follows them.

use nalgebra::DMatrix;

use super::{AtBound, DesignSpaceError, Focus, Pickup, Solves, Variable};
use crate::gradient::LensGradient;
use crate::lens::Lens;
use crate::number::Number;
use crate::paraxial::{
    FirstOrderCotangent, first_order, marginal_tangent, pull_back_entrance_pupil, pull_back_first_order,
    pull_back_image_distance, pull_back_image_height,
};
use crate::solve::{with_efl, with_length, with_magnification, with_marginal_tangent, with_paraxial_focus};
use crate::trace::Sequence;

/// A lens, and the ways in which it may change.
///
/// The coordinates are the values of the variables (a curvature for a radius, a tilt in radians); if the focus has a coordinate,
/// the image distance or the defocus comes last, mm.
#[derive(Clone, Debug)]
pub struct DesignSpace {
    base: Lens,
    variables: Vec<Variable>,
    pickups: Vec<Pickup>,
    solves: Solves,
    focus: Focus,
    /// Bounds of the coordinates.
    bounds: Vec<[f64; 2]>,
    /// Numbers of the lens that move: those of the variables, then pickups, then solves, then the image distance.
    numbers: Vec<(usize, Number)>,
}

/// A lens of a design space, and how it follows the coordinates.
#[derive(Clone, Debug)]
pub struct Mapped {
    /// The lens.
    pub lens: Lens,
    /// Derivatives of [`DesignSpace::numbers`], and last of the logarithm of the stop radius, by the coordinates:
    /// `[number][coordinate]`.
    pub slopes: DMatrix<f64>,
    /// Derivatives of the diameter of the entrance pupil by the coordinates, mm; zero unless a numerical aperture is held.
    pub pupil_slopes: Vec<f64>,
}

impl DesignSpace {
    /// A space around `base`.
    pub fn new(
        base: Lens,
        variables: Vec<Variable>,
        pickups: Vec<Pickup>,
        solves: Solves,
        focus: Focus,
    ) -> Result<Self, DesignSpaceError> {
        if solves.efl.is_some() && solves.magnification.is_some() {
            return Err(DesignSpaceError::TwoPowers);
        }
        let count = variables.len();
        if let Some(p) = pickups.iter().find(|p| p.variable >= count) {
            return Err(DesignSpaceError::NoSuchVariable { variable: p.variable + 1, count });
        }
        // The numbers that move, in their order.
        let mut numbers: Vec<(usize, Number)> = variables.iter().map(|v| (v.surface, v.number)).collect();
        for p in &pickups {
            numbers.push((p.surface, numbers[p.variable].1));
        }
        let moved = numbers.len();
        numbers.extend(solves.curvature().map(|(surface, _)| (surface, Number::Curvature)));
        numbers.extend(solves.length.map(|(s, _)| (s, Number::Thickness)));
        let count = base.surfaces.len();
        for (surface, number) in &numbers {
            let found = base.surfaces.get(*surface);
            let found = found.ok_or(DesignSpaceError::NoSuchSurface { surface: surface + 1, count })?;
            if !found.has_number(*number) {
                return Err(DesignSpaceError::NoSuchNumber { surface: surface + 1, number: *number });
            }
        }
        // A solve computes a number that nothing else may set. A variable of the last thickness is allowed, and without effect
        // where the focus sets the image plane.
        let image = (count - 1, Number::Thickness);
        let follows_focus = |place: usize| place >= variables.len() && focus != Focus::Fixed;
        for (place, (surface, number)) in numbers[..moved].iter().enumerate() {
            let settled = numbers[moved..].contains(&(*surface, *number))
                || follows_focus(place) && (*surface, *number) == image;
            if settled {
                return Err(DesignSpaceError::Settled { surface: surface + 1, number: *number });
            }
        }
        let mut bounds: Vec<[f64; 2]> = variables.iter().map(Variable::bounds).collect();
        for (v, [low, high]) in variables.iter().zip(&bounds) {
            if !(low < high && low.is_finite() && high.is_finite()) {
                let Variable { surface, number, min, max } = *v;
                return Err(DesignSpaceError::Bounds { surface: surface + 1, number, min, max });
            }
        }
        let of_focus = match focus {
            Focus::Fixed => None,
            Focus::Free => Some([f64::NEG_INFINITY, f64::INFINITY]),
            Focus::Paraxial { range_mm } => Some([-range_mm, range_mm]),
        };
        bounds.extend(of_focus);
        numbers.extend(of_focus.map(|_| image));
        Ok(Self { base, variables, pickups, solves, focus, bounds, numbers })
    }

    /// The variables, in the order of the coordinates.
    pub fn variables(&self) -> &[Variable] {
        &self.variables
    }

    /// Where the image plane goes.
    pub fn focus(&self) -> Focus {
        self.focus
    }

    /// The lens that the space was made around.
    pub fn base(&self) -> &Lens {
        &self.base
    }

    /// Number of coordinates.
    pub fn dimension(&self) -> usize {
        self.bounds.len()
    }

    /// Bounds of the coordinates.
    pub fn bounds(&self) -> &[[f64; 2]] {
        &self.bounds
    }

    /// Surfaces and numbers that move: those of the variables, of the pickups, of the solves for focal length and length, and
    /// the image distance.
    pub fn numbers(&self) -> &[(usize, Number)] {
        &self.numbers
    }

    /// Coordinates of the lens that the space was made around, moved inside their bounds.
    pub fn start(&self) -> Vec<f64> {
        self.coordinates(&self.base)
    }

    /// Coordinates of any lens with the surfaces of this space, moved inside their bounds. What pickups and solves settle is not read.
    pub fn coordinates(&self, lens: &Lens) -> Vec<f64> {
        let variables = &self.numbers[..self.variables.len()];
        let mut at: Vec<f64> = variables.iter().map(|(s, n)| n.read(lens, *s)).collect();
        match self.focus {
            Focus::Fixed => {}
            Focus::Free => at.push(lens.image_distance_mm()),
            Focus::Paraxial { .. } => at.push(defocus_mm(lens)),
        }
        for (x, [low, high]) in at.iter_mut().zip(&self.bounds) {
            *x = x.clamp(*low, *high);
        }
        at
    }

    /// The variables that stand on one of their bounds, to a millionth of the range between them.
    pub fn at_bounds(&self, at: &[f64]) -> Vec<AtBound> {
        let stands = |((v, [low, high]), x): ((&Variable, &[f64; 2]), &f64)| {
            let near = 1e-6 * (high - low);
            let bound = [*low, *high].into_iter().find(|bound| (x - bound).abs() <= near)?;
            Some(AtBound { surface: v.surface, number: v.number, bound: v.number.stated(bound) })
        };
        self.variables.iter().zip(&self.bounds).zip(at).filter_map(stands).collect()
    }

    /// Puts a free image plane at the paraxial focus.
    pub fn refocus(&self, at: &mut [f64]) {
        if self.focus == Focus::Free
            && let Ok(lens) = self.lens_at(at)
            && let Some(distance) = at.last_mut()
        {
            let order = first_order(&lens.at_wavelength(lens.reference_um));
            if order.image_distance_mm.is_finite() {
                *distance = order.image_distance_mm;
            }
        }
    }

    /// The lens at some coordinates.
    pub fn lens_at(&self, at: &[f64]) -> Result<Lens, DesignSpaceError> {
        let mut lens = self.base.clone();
        // Set the variables, and what follows them.
        for ((surface, number), x) in self.numbers.iter().zip(&at[..self.variables.len()]) {
            number.write(&mut lens, *surface, *x);
        }
        for p in &self.pickups {
            let number = self.variables[p.variable].number;
            number.write(&mut lens, p.surface, p.scale * at[p.variable] + p.offset);
        }
        // Solve for the length, then for the focal length, which moves the focus.
        if let Some((surface, length_mm)) = self.solves.length {
            lens = with_length(&lens, surface, length_mm);
        }
        if let Some(solve) = &self.solves.efl {
            let (surface, efl_mm) = (solve.surface, solve.efl_mm);
            lens = with_efl(&lens, surface, efl_mm)
                .ok_or(DesignSpaceError::EflUnsolvable { surface: surface + 1, efl_mm })?;
        }
        if let Some(solve) = &self.solves.magnification {
            let (surface, magnification) = (solve.surface, solve.magnification);
            lens = with_magnification(&lens, surface, magnification)
                .ok_or(DesignSpaceError::MagnificationUnsolvable { surface: surface + 1, magnification })?;
        }
        if let Some(tangent) = self.solves.marginal_tangent {
            lens = with_marginal_tangent(&lens, tangent);
        }
        Ok(match (self.focus, at.last()) {
            (Focus::Free, Some(distance_mm)) => lens.with_image_distance(*distance_mm),
            (Focus::Paraxial { .. }, Some(defocus_mm)) => with_paraxial_focus(&lens, *defocus_mm),
            _ => lens,
        })
    }

    /// The surface whose curvature is solved for, and the gradient of what the solve holds.
    fn held(&self, sequence: &Sequence) -> Option<(usize, LensGradient)> {
        let (surface, _) = self.solves.curvature()?;
        let mut held = LensGradient::zero(sequence.surfaces.len());
        match self.solves.efl {
            Some(_) => {
                let bars = FirstOrderCotangent { efl: 1.0, ..Default::default() };
                pull_back_first_order(sequence, bars, &mut held);
            }
            // With the object in its place, the height of the image is in proportion to the magnification.
            None => pull_back_image_height(sequence, 1.0, &mut held),
        }
        Some((surface, held))
    }

    /// The lens at the coordinates `at`, and the derivatives of its numbers by the coordinates.
    pub fn map(&self, at: &[f64]) -> Result<Mapped, DesignSpaceError> {
        let lens = self.lens_at(at)?;
        let (variables, coordinates) = (self.variables.len(), self.dimension());
        let last = lens.surfaces.len() - 1;
        let mut slopes = DMatrix::zeros(self.numbers.len() + 1, coordinates);
        // Variables move by themselves, but for a last thickness that the focus sets.
        let image = (self.focus != Focus::Fixed).then_some((last, Number::Thickness));
        for i in (0..variables).filter(|i| Some(self.numbers[*i]) != image) {
            slopes[(i, i)] = 1.0;
        }
        let mut row = variables;
        for p in &self.pickups {
            slopes[(row, p.variable)] = p.scale;
            row += 1;
        }
        let solved_row = self.solves.curvature().map(|_| row);
        row += usize::from(solved_row.is_some());
        if let Some((solved, _)) = self.solves.length {
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
        let sequence = lens.at_wavelength(lens.reference_um);
        let by = |pull_back: &dyn Fn(&mut LensGradient)| {
            let mut g = LensGradient::zero(lens.surfaces.len());
            pull_back(&mut g);
            self.numbers.iter().map(|number| g[*number]).collect::<Vec<f64>>()
        };
        if let (Some(solved), Some((_, held))) = (solved_row, self.held(&sequence)) {
            // What is held stays, so the solved curvature moves against the others.
            let by_number = |n: usize| held[self.numbers[n]];
            for c in 0..coordinates {
                let others = (0..self.numbers.len()).filter(|n| *n != solved);
                let others: f64 = others.map(|n| by_number(n) * slopes[(n, c)]).sum();
                slopes[(solved, c)] = -others / by_number(solved);
            }
        }
        // The image plane has its own coordinate, and goes where the paraxial image goes.
        if self.focus != Focus::Fixed {
            slopes[(row, coordinates - 1)] = 1.0;
        }
        if let Focus::Paraxial { .. } = self.focus {
            let image = by(&|g| pull_back_image_distance(&sequence, 1.0, g));
            for c in 0..coordinates {
                slopes[(row, c)] += (0..row).map(|n| image[n] * slopes[(n, c)]).sum::<f64>();
            }
        }
        // The entrance pupil follows its distance from a near object.
        let mut pupil_slopes = vec![0.0; coordinates];
        if let Some(tangent) = self.held_tangent(&sequence) {
            let pupil = by(&|g| pull_back_entrance_pupil(&sequence, 2.0 * tangent, g));
            for (c, slope) in pupil_slopes.iter_mut().enumerate() {
                *slope = (0..self.numbers.len()).map(|n| pupil[n] * slopes[(n, c)]).sum();
            }
        }
        // The stop keeps the entrance pupil.
        let radius = first_order(&sequence).stop_radius_mm;
        let bars = FirstOrderCotangent { stop_radius: 1.0 / radius, ..Default::default() };
        let stop = by(&|g| pull_back_first_order(&sequence, bars, g));
        for c in 0..coordinates {
            let by_numbers: f64 = (0..self.numbers.len()).map(|n| stop[n] * slopes[(n, c)]).sum();
            slopes[(self.numbers.len(), c)] = by_numbers + pupil_slopes[c] / lens.entrance_pupil_mm;
        }
        Ok(Mapped { lens, slopes, pupil_slopes })
    }

    /// The tangent of the marginal ray that is held, with the sign that it has at a lens of this space: the pupil may stand on either side of the object.
    fn held_tangent(&self, sequence: &Sequence) -> Option<f64> {
        Some(self.solves.marginal_tangent?.abs().copysign(marginal_tangent(sequence)?))
    }

    /// Derivatives by the coordinates, from those by the numbers of `lens`, a lens of this space: the transpose of the slopes of
    /// [`DesignSpace::map`], by one backward pass through the solves.
    pub fn pull_back(&self, lens: &Lens, gradient: &LensGradient) -> Vec<f64> {
        let sequence = lens.at_wavelength(lens.reference_um);
        let mut gradient = gradient.clone();
        let last = lens.surfaces.len() - 1;
        // The entrance pupil follows its distance from a near object.
        if let Some(tangent) = self.held_tangent(&sequence) {
            let by_pupil = std::mem::take(&mut gradient.entrance_pupil);
            pull_back_entrance_pupil(&sequence, 2.0 * tangent * by_pupil, &mut gradient);
        }
        // The image plane has its own coordinate, and goes where the paraxial image goes.
        let mut by_focus = None;
        if self.focus != Focus::Fixed {
            by_focus = Some(std::mem::take(&mut gradient[(last, Number::Thickness)]));
        }
        if let (Focus::Paraxial { .. }, Some(by_image_distance)) = (self.focus, by_focus) {
            pull_back_image_distance(&sequence, by_image_distance, &mut gradient);
        }
        if let Some((surface, held)) = self.held(&sequence) {
            // The solved curvature keeps what is held constant: subtract the multiple of its gradient that cancels the derivative by that
            // curvature.
            let solved = (surface, Number::Curvature);
            let multiple = -gradient[solved] / held[solved];
            gradient += &held.scaled(multiple);
        }
        if let Some((solved, _)) = self.solves.length {
            // The other distances between the vertices push it back.
            let by_solved = std::mem::take(&mut gradient[(solved, Number::Thickness)]);
            for i in (0..last).filter(|i| *i != solved) {
                gradient[(i, Number::Thickness)] -= by_solved;
            }
        }
        for p in &self.pickups {
            let followed = self.numbers[p.variable];
            let by_follower = gradient[(p.surface, followed.1)];
            gradient[followed] += p.scale * by_follower;
        }
        let variables = &self.numbers[..self.variables.len()];
        variables.iter().map(|number| gradient[*number]).chain(by_focus).collect()
    }
}

/// Distance of the image plane behind the paraxial image of the reference wavelength, mm.
pub(super) fn defocus_mm(lens: &Lens) -> f64 {
    let order = first_order(&lens.at_wavelength(lens.reference_um));
    lens.image_distance_mm() - order.image_distance_mm
}
