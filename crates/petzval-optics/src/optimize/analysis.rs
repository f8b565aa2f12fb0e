//! A lens under a problem: its merit, the constraints that it violates, and the quadratic model of both.

use nalgebra::{DMatrix, DVector};

use super::problem::{Apertures, Goal, Problem};
use crate::constraint::{ClearRadii, Constraint, SemiDiameters};
use crate::design_space::{DesignSpace, DesignSpaceError, Mapped};
use crate::gradient::LensGradient;
use crate::lens::Lens;
use crate::merit::{
    Beams, Better, Landings, Lost, MOUNT_MM, Merit, Reach, Seen, SpotResiduals, lifted_normal_equations,
};
use crate::number::Number;
use crate::paraxial::first_order;
use crate::pupil::{PupilRefinement, PupilSampling, Quadrature};
use crate::solve::with_best_focus;
use crate::spot::spot_converged;

/// A clear aperture cuts a beam that needs more than it by this share.
const CUTS: f64 = 1e-3;

/// Pupil cells a side at the best focus of cut beams.
const FOCUS_CELLS: usize = 64;

/// The accuracy of spots through clear apertures.
const SPOTS: PupilRefinement = PupilRefinement { tolerance: 1e-3, first_cells: 64, most_cells: 1024 };

/// A lens with its figures.
#[derive(Clone, Debug)]
pub struct Analysis {
    /// The lens.
    pub lens: Lens,
    /// The square of the problem's merit, um^2, plus the squared residuals of its goals and of violated constraints.
    pub merit: f64,
    /// RMS spot of each field about its centroid, all wavelengths together, um.
    pub rms_um: Vec<f64>,
    /// The value of each goal's figure.
    pub goals: Vec<f64>,
    /// The constraints that are violated, and by how much, mm.
    pub violations: Vec<(Constraint, f64)>,
    /// Its rays, from which the aiming of the next lens starts.
    landings: Landings,
}

impl Analysis {
    /// Its rays.
    pub(super) fn landings(&self) -> &Landings {
        &self.landings
    }

    /// Mean RMS spot over the fields, um.
    pub fn mean_rms_um(&self) -> f64 {
        self.rms_um.iter().sum::<f64>() / self.rms_um.len() as f64
    }

    /// The lens with clear semi-diameters as its beams need them, and a margin for the mount; the stop has none. Those that the problem keeps do not grow,
    /// and then the image plane goes where the light that passes them has its least spots.
    pub fn fitted_lens(&self, problem: &Problem) -> Lens {
        let mut lens = self.lens.clone();
        for (i, needed_mm) in self.needed_mm(problem).into_iter().enumerate() {
            let kept_mm = problem.kept_aperture_mm(i).filter(|_| i != lens.stop);
            lens.surfaces[i].semi_diameter_mm = kept_mm.map_or(needed_mm, |own_mm| own_mm.min(needed_mm));
        }
        if problem.keeps_apertures() && problem.has_image_plane_for_spots() {
            let seen = problem.seen(&lens);
            let quadrature = Quadrature::grid(FOCUS_CELLS).ok();
            let focused = quadrature.and_then(|q| with_best_focus(&seen, &problem.merit.fields_rad, &q));
            if let Some(focused) = focused {
                lens = lens.with_image_distance(focused.image_distance_mm());
            }
        }
        lens
    }

    /// The constraints that are violated, and by how much, mm. Edges, gaps at the edge and clear diameters are those of [`Analysis::fitted_lens`],
    /// which passes the beams of all fields and wavelengths of the file.
    pub fn violations_as_written(&self, problem: &Problem, fitted: &Lens) -> Vec<(Constraint, f64)> {
        let is_diameter = |what: &Constraint| matches!(what, Constraint::ClearDiameter { .. });
        let others =
            self.violations_at_written_edges(fitted).into_iter().filter(|(what, _)| !is_diameter(what));
        let diameters = problem.constraints().into_iter().filter(is_diameter);
        let excess = |what: Constraint| Some((what, what.excess_mm(fitted, &SemiDiameters(fitted))?));
        others.chain(diameters.filter_map(excess).filter(|(_, excess_mm)| *excess_mm > 0.0)).collect()
    }

    /// [`Analysis::violations`] with edges measured at the clear semi-diameters of [`Analysis::fitted_lens`]. The descent measures them at the beams and a
    /// mount beyond, at the stop too, which has none in a file.
    pub fn violations_at_written_edges(&self, fitted: &Lens) -> Vec<(Constraint, f64)> {
        let written = |&(what, excess_mm): &(Constraint, f64)| {
            let is_edge = matches!(what, Constraint::Edge { .. } | Constraint::AirEdge { .. });
            let at_edge = is_edge.then(|| what.excess_mm(fitted, &SemiDiameters(fitted))).flatten();
            (what, at_edge.unwrap_or(excess_mm))
        };
        self.violations.iter().map(written).filter(|(_, excess_mm)| *excess_mm > 0.0).collect()
    }

    /// RMS spot of each field of [`Analysis::fitted_lens`], um: of the rays that pass its clear apertures, each with its light. `None` if a field has
    /// no light. What a descent minimises counts the rays of the stop alike, see [`SpotResiduals`].
    pub fn rms_of_light_um(&self, problem: &Problem, fitted: &Lens) -> Option<Vec<f64>> {
        let seen = problem.seen(fitted);
        let rms_um = |field: &f64| Some(spot_converged(&seen, *field, &SPOTS)?.value.rms_poly_um);
        problem.merit.fields_rad.iter().map(rms_um).collect()
    }

    /// The clear semi-diameters of the lens, mm, of surfaces where they cut beams of the stop; `None` elsewhere.
    pub fn cutting_apertures_mm(&self, problem: &Problem) -> Vec<Option<f64>> {
        let cuts = |(i, needed_mm): (usize, f64)| {
            let own = &self.lens.surfaces[i];
            let own_mm = own.semi_diameter_mm;
            (i != self.lens.stop && !own.is_open && own_mm < (1.0 - CUTS) * (needed_mm - MOUNT_MM))
                .then_some(own_mm)
        };
        self.needed_mm(problem).into_iter().enumerate().map(cuts).collect()
    }

    /// The clear semi-diameters that the beams of the stop need, with a margin for the mount, mm; that of the stop has none.
    fn needed_mm(&self, problem: &Problem) -> Vec<f64> {
        let lens = &self.lens;
        let stop_radius_mm = first_order(&lens.at_wavelength(lens.reference_um)).stop_radius_mm;
        // For every field and wavelength of the file, not only for those of the problem.
        let mut whole = problem.merit.clone();
        whole.fields_rad.extend(lens.fields_deg.iter().map(|f| f.to_radians()));
        whole.wavelengths_um.extend(&lens.wavelengths_um);
        let sides = problem.sides();
        let reach = (whole.rim(lens, sides, stop_radius_mm))
            .or_else(|| problem.merit.rim(lens, sides, stop_radius_mm))
            .unwrap_or_else(|| Reach::none(lens));
        let needed_mm = |i: usize| {
            if i == lens.stop {
                stop_radius_mm
            } else {
                reach.clear_mm[i].max(self.landings.reach.clear_mm[i]) + MOUNT_MM
            }
        };
        (0..lens.surfaces.len()).map(needed_mm).collect()
    }
}

/// The merit's quadratic model: `merit + 2 gradient . step + step . hessian step`.
#[derive(Clone, Debug)]
pub(super) struct Linearised {
    /// Half the gradient by the coordinates.
    pub gradient: DVector<f64>,
    /// Half the Hessian of Gauss and Newton.
    pub hessian: DMatrix<f64>,
    /// Further constraints of the problem that are kept: their penalties begin where a step breaks them.
    pub kept: Vec<LimitRow>,
    /// The constraints that are broken: their penalties are part of the model.
    pub broken: Vec<(Constraint, LimitRow)>,
}

/// A constraint to first order about a lens.
#[derive(Clone, Debug)]
pub(super) struct LimitRow {
    /// Its residual, um, negative where the lens keeps it.
    pub residual_um: f64,
    /// Derivatives of the residual by the coordinates.
    pub row: DVector<f64>,
}

impl LimitRow {
    /// The residual after a step, um.
    pub fn after(&self, step: &DVector<f64>) -> f64 {
        self.residual_um + self.row.dot(step)
    }
}

impl Linearised {
    /// The model with the residuals of broken constraints corrected by what a step has shown: what they are `there`, less what the model says of
    /// them. A limit is curved, and a step along its tangent leaves it.
    pub fn bent(&self, step: &DVector<f64>, there: &Analysis, stiffness_um_per_mm: f64) -> Self {
        let mut bent = self.clone();
        for (constraint, limit) in &self.broken {
            let excess =
                there.violations.iter().find(|(found, _)| found == constraint).map_or(0.0, |(_, mm)| *mm);
            bent.gradient.axpy(stiffness_um_per_mm * excess - limit.after(step), &limit.row, 1.0);
        }
        bent
    }

    /// Adds the square of a residual with its derivatives by the coordinates.
    pub fn add(&mut self, residual_um: f64, row: &DVector<f64>) {
        self.gradient.axpy(residual_um, row, 1.0);
        self.hessian.ger(1.0, row, row, 1.0);
    }
}

/// The merit of a lens; `None` if a ray of the stop is lost. `near`, a lens like it, makes aiming quicker.
pub(super) fn analyse(problem: &Problem, lens: Lens, near: Option<&Analysis>) -> Option<Analysis> {
    // Light cannot go backwards.
    if backwards(&lens).is_some() {
        return None;
    }
    let landings = landings(problem, &lens, near)?;
    figures(problem, lens, landings)
}

/// The figures of a lens whose rays are traced.
pub(super) fn figures(problem: &Problem, lens: Lens, landings: Landings) -> Option<Analysis> {
    let mut violations = Vec::new();
    let clear = clear_radii(problem, &lens, &landings);
    for constraint in problem.constraints() {
        let excess = constraint.excess_mm(&lens, &*clear)?;
        if excess > 0.0 {
            violations.push((constraint, excess));
        }
    }
    drop(clear);
    let seen = problem.seen(&lens);
    let goals: Vec<f64> = problem.goals.iter().map(|goal| goal.merit.value(&seen)).collect::<Option<_>>()?;
    let missed = |(goal, value): (&Goal, &f64)| goal.residual_um(*value).powi(2);
    let stiff = |v: f64| (problem.stiffness_um_per_mm * v).powi(2);
    let merit = problem.spot_weight.powi(2) * problem.merit.square_um2(&landings)
        + problem.goals.iter().zip(&goals).map(missed).sum::<f64>()
        + violations.iter().map(|(_, v)| stiff(*v)).sum::<f64>();
    let rms_um = landings.rms_um.clone();
    merit.is_finite().then_some(Analysis { lens, merit, rms_um, goals, violations, landings })
}

/// The first surface behind which the thickness goes against the light.
fn backwards(lens: &Lens) -> Option<usize> {
    (0..lens.surfaces.len()).find(|i| lens.goes_against_the_light(*i))
}

/// The rays of a lens; `None` if one of them is lost.
fn landings(problem: &Problem, lens: &Lens, near: Option<&Analysis>) -> Option<Landings> {
    // Where a limit depends on the radii that beams need, rays on the rim of the stop measure them.
    let limits = &problem.limits;
    let by_rim = limits.element_edge_mm.is_some()
        || limits.air_gap_mm.is_some()
        || limits.clear_diameter_mm.is_some()
        || limits.slope_rad.is_some();
    let near = near.map(|n| &n.landings);
    problem.merit.landings(lens, problem.sides(), near, by_rim, Lost::Refused)
}

/// Why a lens has no merit under a problem.
pub(super) fn obstacle(problem: &Problem, lens: &Lens) -> DesignSpaceError {
    if let Some(surface) = backwards(lens) {
        return DesignSpaceError::AgainstTheLight { surface: surface + 1 };
    }
    let Some(landings) = landings(problem, lens, None) else { return DesignSpaceError::NoRays };
    let clear = clear_radii(problem, lens, &landings);
    let unknown = problem.constraints().into_iter().find(|c| c.excess_mm(lens, &*clear).is_none());
    let seen = problem.seen(lens);
    let goal = || problem.goals.iter().find(|goal| goal.merit.value(&seen).is_none());
    let what = unknown.map(|c| c.to_string()).or_else(|| goal().map(|goal| goal.merit.name()));
    what.map_or(DesignSpaceError::NoRays, |what| DesignSpaceError::Unmeasured { what })
}

/// The radii at which the constraints of a problem are measured.
fn clear_radii<'a>(problem: &'a Problem, lens: &'a Lens, landings: &'a Landings) -> Box<dyn ClearRadii + 'a> {
    match problem.apertures {
        Apertures::Fitted => {
            let kept_mm = &problem.kept_apertures_mm;
            Box::new(Beams { merit: &problem.merit, lens, reach: &landings.reach, kept_mm })
        }
        Apertures::Drawn => Box::new(SemiDiameters(lens)),
    }
}

/// The linearised problem at a lens of the space.
pub(super) fn linearise(
    problem: &Problem,
    space: &DesignSpace,
    mapped: &Mapped,
    analysis: &Analysis,
) -> Option<Linearised> {
    let slopes = &mapped.slopes;
    let (numbers, coordinates) = (space.numbers(), space.dimension());
    let mut hessian = DMatrix::zeros(coordinates, coordinates);
    let mut gradient = DVector::zeros(coordinates);
    // Adds residuals by the products of their columns, as `Merit::normal_equations` orders them.
    let mut add_gram = |gram: &DMatrix<f64>, weight: f64| {
        let residual = gram.ncols() - 1;
        let inner = gram.view((0, 0), (residual, residual));
        hessian += slopes.transpose() * inner * slopes * weight;
        gradient += slopes.transpose() * gram.view((0, residual), (residual, 1)).column(0) * weight;
    };
    if problem.spot_weight > 0.0 {
        let gram = problem.merit.gram(&mapped.lens, problem.sides(), &analysis.landings, numbers)?;
        add_gram(&gram, problem.spot_weight.powi(2));
    }
    // A goal adds all of its residuals if they are known and should all vanish. Any other goal adds one residual, its distance from the
    // target: with the curvature of its residuals or of its rays, or with that of its slope, which knows one direction.
    let seen = Mapped { lens: problem.seen(&mapped.lens), ..mapped.clone() };
    let mut single = Vec::new();
    for (goal, value) in problem.goals.iter().zip(&analysis.goals) {
        let residual_um = goal.residual_um(*value);
        if residual_um == 0.0 {
            continue;
        }
        let all = if goal.target == 0.0 { goal.merit.normal_equations(&seen.lens, numbers) } else { None };
        match all {
            Some(gram) => add_gram(&gram, goal.weight_um.powi(2)),
            None => single.push((goal, residual_um)),
        }
    }
    for (goal, residual_um) in single {
        let (value, by_lens) = goal.merit.with_gradient(&seen.lens)?;
        let by_lens = by_lens?;
        let row = DVector::from_vec(space.pull_back(&mapped.lens, &by_lens)) * goal.weight_um;
        gradient += &row * residual_um;
        let curvature = match goal.merit.better() {
            Better::Lower => beyond_bound_hessian(goal, value, &row, &seen, numbers),
            Better::Higher => lifted_hessian(goal, residual_um, &by_lens, &seen, numbers),
        };
        hessian += curvature.unwrap_or_else(|| &row * row.transpose());
    }
    let mut model = Linearised { gradient, hessian, kept: Vec::new(), broken: Vec::new() };
    let clear = clear_radii(problem, &analysis.lens, &analysis.landings);
    let stiffness = problem.stiffness_um_per_mm;
    let row_of = |constraint: &Constraint| {
        let g = constraint.gradient(&analysis.lens, &*clear, 1.0)?;
        let row = DVector::from_fn(numbers.len() + 1, |n, _| numbers.get(n).map_or(0.0, |number| g[*number]));
        let by_pupil = DVector::from_column_slice(&mapped.pupil_slopes) * g.entrance_pupil;
        Some(slopes.transpose() * row + by_pupil)
    };
    for (constraint, excess) in &analysis.violations {
        let row = row_of(constraint)?;
        model.gradient += &row * (stiffness * stiffness * excess);
        model.hessian += &row * row.transpose() * (stiffness * stiffness);
        model.broken.push((*constraint, LimitRow { residual_um: stiffness * excess, row: row * stiffness }));
    }
    // Figures of the whole lens, which bounds of operands limit. The spots of a design come to its requirements by steps that are short anyway, and
    // those behind every surface or of traced light would cost more than they bring.
    let has_figures = problem.goals.iter().any(|goal| goal.weight_um > 0.0);
    let bounds_of_figures = match problem.apertures {
        Apertures::Fitted if has_figures => &problem.further[..],
        _ => &[],
    };
    for constraint in bounds_of_figures {
        let excess = constraint.excess_mm(&analysis.lens, &*clear)?;
        if excess > 0.0 {
            continue;
        }
        let (residual_um, row) = (stiffness * excess, row_of(constraint)? * stiffness);
        // The other end of a range is as far from this one as the range is wide.
        let other_end = constraint
            .range_mm()
            .map(|range_mm| LimitRow { residual_um: -residual_um - stiffness * range_mm, row: -&row });
        model.kept.push(LimitRow { residual_um, row });
        model.kept.extend(other_end);
    }
    Some(model)
}

/// The rays by which a merit sees a lens; `None` if it sees more.
fn rays_of(merit: &dyn Merit, lens: &Lens) -> Option<SpotResiduals> {
    let (fields_rad, field_weights) = merit.fields_of_rays(lens)?.into_iter().unzip();
    Some(SpotResiduals {
        fields_rad,
        field_weights,
        wavelengths_um: lens.wavelengths_um.clone(),
        sampling: PupilSampling::Degree(6),
        // Every field has its weight, whatever its spot.
        power: 2.0,
    })
}

/// Half the Hessian of `w^2 (s - b)^2`, where the figure `s = |d|` of a goal is the root of a sum of squares, b its bound and w its weight:
///
/// `w^2 ((1 - b/s) J'J + (b/s) grad(s) grad(s)')`, with J the derivatives of d. The curvature of d itself is left out, as Gauss and Newton do.
///
/// `row` is `w grad(s)` by the coordinates. Near the bound the figure is held along its slope and free across it. `None` if neither the
/// residuals d are known nor rays that move like them.
fn beyond_bound_hessian(
    goal: &Goal,
    value: f64,
    row: &DVector<f64>,
    mapped: &Mapped,
    numbers: &[(usize, Number)],
) -> Option<DMatrix<f64>> {
    let of_square = curvature_of_square(&*goal.merit, value, &mapped.lens, numbers)?;
    let held = (goal.target / value).clamp(0.0, 1.0);
    let all = mapped.slopes.transpose() * of_square * &mapped.slopes * goal.weight_um.powi(2);
    Some(all * (1.0 - held) + row * row.transpose() * held)
}

/// `J'J` of a figure, where `J` are the derivatives of its residuals by each of the numbers and by the logarithm of the stop radius. A figure without
/// residuals of its own has those of its rays, whose spot is scaled to the size of the figure.
fn curvature_of_square(
    merit: &dyn Merit,
    value: f64,
    lens: &Lens,
    numbers: &[(usize, Number)],
) -> Option<DMatrix<f64>> {
    if let Some(gram) = merit.normal_equations(lens, numbers) {
        let residual = gram.ncols() - 1;
        return Some(gram.view((0, 0), (residual, residual)).into_owned());
    }
    let rays = rays_of(merit, lens)?;
    let size_um = rays.size_um(lens, Lost::LeftOut).filter(|size_um| *size_um > 0.0)?;
    Some(rays.motion(lens, numbers, false)? * (value / size_um).powi(2))
}

/// Half the Hessian of the square of a goal's residual, lifted to the rays by which its merit sees the lens; `None` if it sees more, or no ray
/// moves. `by_lens` are the derivatives of the merit.
fn lifted_hessian(
    goal: &Goal,
    residual_um: f64,
    by_lens: &LensGradient,
    mapped: &Mapped,
    numbers: &[(usize, Number)],
) -> Option<DMatrix<f64>> {
    let rays = rays_of(&*goal.merit, &mapped.lens)?;
    let seen = Seen { rays: &rays, places: false, light: &[] };
    let by_square = by_lens.clone().scaled(2.0 * residual_um * goal.weight_um);
    let gram = lifted_normal_equations(seen, &mapped.lens, numbers, residual_um * residual_um, &by_square)?;
    let moving = gram.ncols() - 1;
    let inner = gram.view((0, 0), (moving, moving));
    Some(mapped.slopes.transpose() * inner * &mapped.slopes)
}
