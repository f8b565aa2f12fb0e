//! The goal of an optimisation, and the problem that follows from it.

use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use petzval_camera::linear_limit::{LinearLimit, NaturalScenes};
use petzval_camera::sensor::Exposure;
use petzval_design::assets::Assets;
use petzval_design::experiment::{ExposureConfig, PsfConfig};
use petzval_design::lens::restored::RestoredError;
use petzval_files::{LensFile, OperandFile};
use petzval_optics::design_space::{
    EflSolve, Focus, MagnificationSolve, Pickup, Solves, Variable, Vary, powered, varied, wide_variables,
};
use petzval_optics::glass::{Catalog, Glass, Status, map_distance};
use petzval_optics::lens::{Action, Lens, ObjectDistance};
use petzval_optics::merit::SpotResiduals;
use petzval_optics::number::Number;
use petzval_optics::optimize::{GlassChoice, Goal as MeritGoal, Limits, Problem};
use petzval_optics::paraxial::{first_order, marginal_tangent};
use petzval_optics::pupil::PupilSampling;
use petzval_optics::solve::magnification;

use super::operand::goals_of;
use crate::error::{JobError, Result};
use crate::range::{check_ranges, number_text};

petzval_base::parameters! {
    /// The camera whose raw frames should be restored as well as possible.
    pub struct Restored {
        /// Photoelectrons that white gives in a green pixel on the axis.
        white_e: f32 = 16_000.0, "e-", 1..1e7, Log, "photoelectrons: 16000 is usual";
    }
    also {
        /// Sensor, by file or built-in name.
        sensor: String = crate::usual::sensor();
    }
}

petzval_base::parameters! {
    /// What an optimised lens has to be.
    pub struct Goal {
        /// Wavelengths, um, all of the same weight; those of the lens if empty.
        wavelengths: Vec<f64> = Vec::new(), "um", 0.2..20.0, Log, "um: 550 nm is 0.55";
        /// The mean over the fields of `RMS^power` is minimised: 1 the mean spot, 2 the mean square, 8 nearly the worst; 0.5 to 64.
        power: f64 = 1.0, "", 0.5..64, Log, "0.5 to 64; 1 is the mean spot";
        /// F-number: sets the entrance pupil by the focal length that is held, or that of the start.
        f_number: Option<f64> = None, "", 0.4..200, Log, "2.8 is f/2.8";
        /// Least edge thickness of every element, mm, 0.01 at least.
        edge: Option<f64> = None, "mm", 0..1e4, Linear, "a length in mm";
        /// Least centre thickness of every element, mm.
        centre: Option<f64> = None, "mm", 0..1e4, Linear, "a length in mm";
        /// Least air between elements, on the axis and at the edge, mm, 0.01 at least.
        air: Option<f64> = None, "mm", 0..1e4, Linear, "a length in mm";
        /// Greatest track, mm: between any two of the vertices and the image plane.
        track: Option<f64> = None, "mm", 0..1e4, Linear, "a length in mm";
        /// Greatest clear diameter of any surface, mm.
        clear_diameter: Option<f64> = None, "mm", 0..1e4, Linear, "a length in mm";
        /// Greatest distortion at the outermost field, percent.
        distortion: Option<f64> = None, "%", 0..100, Linear, "percent";
        /// Steepest surface within its clear aperture, degrees.
        slope: Option<f64> = None, "degrees", 0..89.999, Linear, "degrees, below 90";
        /// Greatest angle of the outermost chief ray to the axis at the image, degrees.
        chief_ray_angle: Option<f64> = None, "degrees", 0..89.999, Linear, "degrees, below 90";
        /// Field angles, degrees, all of the same weight; those of the lens with their weights if empty.
        fields: Vec<f64> = Vec::new(), "degrees", -180.0..180.0, Linear, "degrees from the axis";
        /// Least and greatest back focal length, mm, positive in the direction of the light; empty for none.
        bfl: Vec<f64> = Vec::new(), "mm", -1e6..1e6, Linear, "for example 24,25";
    }
    also {
        /// The error of the best linear restoration of the frames of a camera is minimised in place of the spots.
        restored: Option<Restored> = None;
        /// Further figures, each with a bound and a weight, and the weight of the spots beside them.
        operands: Option<OperandFile> = None;
        /// Kinds of numbers that vary beside the variables of the lens file; a lens whose file names none varies these alone.
        vary: Vec<Vary> = Vec::new();
        /// Focal length to hold, mm, or `free`; if left out what the lens file solves for, else that of the lens at the start, or the magnification
        /// of a near object.
        efl: Option<String> = None;
        /// Glasses that a search may exchange, each as `SURFACE` or `SURFACE=NAME,...`: the surface in front of the glass, and the
        /// names that it may get, the whole catalogue if none. The glass that it has always takes part.
        glass: Vec<String> = Vec::new();
    }
}

impl Goal {
    /// The problem of bringing a lens there.
    pub(super) fn problem(&self, file: &LensFile, assets: &Assets) -> Result<Problem> {
        check_ranges(self)?;
        self.restored.as_ref().map_or(Ok(()), check_ranges)?;
        let mut problem = Problem::new(file.lens.clone());
        problem.variables = self.variables(file)?;
        if !self.wavelengths.is_empty() {
            problem.merit.wavelengths_um.clone_from(&self.wavelengths);
        }
        // Weights that the file gives its fields hold for these alone.
        if self.fields.is_empty() && !file.field_weights.is_empty() {
            problem.merit.field_weights.clone_from(&file.field_weights);
        }
        if !self.fields.is_empty() {
            let limit_deg = file.lens.object.field_limit_deg();
            let hint = format!("degrees from the axis, less than {limit_deg}");
            check("fields", &self.fields, |f| f.abs() < limit_deg, &hint)?;
            problem.merit.fields_rad = self.fields.iter().map(|f| f.to_radians()).collect();
            problem.merit.field_weights = vec![1.0; self.fields.len()];
        }
        problem.merit.power = self.power;
        let efl = self.efl_solve(file)?;
        let magnification = if efl.is_none() { self.magnification_solve(file) } else { None };
        problem.solves = Solves { efl, length: file.length_solve, magnification, ..Solves::default() };
        problem.pickups.clone_from(&file.pickups);
        let own_mm = first_order(&file.lens.at_wavelength(file.lens.reference_um)).efl_mm;
        let efl_mm = problem.solves.efl.map_or(own_mm, |solve| solve.efl_mm);
        if let Some((solved, _)) = problem.solves.curvature() {
            // A radius that is solved for is no variable.
            let is_solved = |v: &Variable| (v.surface, v.number) == (solved, Number::Curvature);
            if let Some(at) = problem.variables.iter().position(is_solved) {
                if problem.pickups.iter().any(|p| p.variable == at) {
                    return Err(JobError::setting(
                        "efl",
                        "",
                        format!("solves for the radius of surface {}, which others follow", solved + 1),
                        how_to_hold(file, efl_mm),
                    ));
                }
                problem.variables.remove(at);
                for p in &mut problem.pickups {
                    p.variable -= usize::from(p.variable > at);
                }
            }
        }
        if let Some(n) = self.f_number {
            if !efl_mm.is_finite() {
                let message = "the lens is afocal and has no f-number";
                return Err(JobError::setting("f_number", n, message, "hold a focal length with --efl"));
            }
            problem.base.entrance_pupil_mm = efl_mm.abs() / n;
        }
        // A near object keeps its numerical aperture: otherwise a pupil that moves away from it would make the spots small.
        let base = &problem.base;
        problem.solves.marginal_tangent = marginal_tangent(&base.at_wavelength(base.reference_um));
        problem.focus = Focus::Free;
        problem.merit.sampling = PupilSampling::Degree(6);
        problem.limits = self.limits()?;
        if self.distortion.is_some() && !file.lens.is_rotationally_symmetric() {
            return Err(JobError::setting(
                "distortion",
                "",
                "the lens is not rotationally symmetric, and its ideal image is not that of its focal length",
                "leave it out",
            ));
        }
        if self.distortion.is_some() && problem.merit.outermost_field_rad() >= FRAC_PI_2 {
            return Err(JobError::setting(
                "distortion",
                "",
                "the outermost field is 90 degrees or more, which no image without distortion reaches",
                "leave it out",
            ));
        }
        problem.glasses = self.glass_choices(&file.lens, assets.catalog()?.as_ref())?;
        if let Some(restored) = &self.restored {
            let merit = Arc::new(restored.merit(&problem.merit, assets)?);
            // A lens that does not fill the sensor is refused by its own reason.
            merit.plan.bank(&problem.base)?;
            (problem.spot_weight, problem.goals) =
                (0.0, vec![MeritGoal { merit, target: 0.0, weight_um: 1.0 }]);
        }
        if let Some(OperandFile { spot_weight, operand }) = &self.operands {
            problem.spot_weight *= spot_weight;
            for operand in operand {
                let (goals, bound) = goals_of(operand, &problem)?;
                problem.goals.extend(goals);
                problem.further.extend(bound);
            }
        }
        Ok(problem)
    }

    /// The variables of the file and those of further kinds that nothing settles yet; the usual ones if there are neither.
    fn variables(&self, file: &LensFile) -> Result<Vec<Variable>> {
        if self.vary.is_empty() {
            return if file.variables.is_empty() { wide(&file.lens) } else { Ok(file.variables.clone()) };
        }
        let mut variables = file.variables.clone();
        for v in varied(&file.lens, &self.vary) {
            let place = (v.surface, v.number);
            let follows = |p: &Pickup| {
                p.surface == v.surface && file.variables.get(p.variable).is_some_and(|f| f.number == v.number)
            };
            let is_settled = file.pickups.iter().any(follows)
                || file.length_solve.is_some_and(|(s, _)| place == (s, Number::Thickness));
            if !is_settled && !variables.iter().any(|known| (known.surface, known.number) == place) {
                variables.push(v);
            }
        }
        if variables.is_empty() {
            let kinds: Vec<String> =
                self.vary.iter().map(|kind| format!("{kind:?}").to_lowercase()).collect();
            let message = "the lens has no numbers of these kinds that could vary";
            let hint = "curvature, thickness, air, conic and asphere are the kinds; conics and aspheres need a curved surface beside air";
            return Err(JobError::setting("vary", kinds.join(","), message, hint));
        }
        Ok(variables)
    }

    fn glass_choices(&self, lens: &Lens, catalog: &Catalog) -> Result<Vec<GlassChoice>> {
        let mut choices: Vec<GlassChoice> = Vec::new();
        for choice in &self.glass {
            let (surface, names) = choice.split_once('=').unwrap_or((choice, "all"));
            let hint = "for example --glass 1=N-BK7,N-SK16 or --glass 1 for the whole catalogue";
            let wrong = |message: String| JobError::setting("glass", choice, message, hint);
            let index = surface.trim().parse::<usize>().ok().and_then(|s| s.checked_sub(1));
            let surface = index
                .filter(|s| {
                    lens.surfaces.get(*s).is_some_and(|s| !s.glass.is_air() && s.action != Action::Reflect)
                })
                .ok_or_else(|| wrong(format!("there is no glass behind surface `{surface}`")))?;
            if choices.iter().any(|c| c.surface == surface) {
                return Err(wrong("the surface was named already".to_owned()));
            }
            let mut candidates: Vec<Arc<Glass>> = match names.trim() {
                "all" => {
                    one_of_each_kind(catalog.iter().map(|(_, glass)| glass).filter(|g| is_usable(g, lens)))
                }
                names => names
                    .split(',')
                    .map(|name| catalog.get(name.trim()).map_err(|e| wrong(e.to_string())))
                    .collect::<Result<_, _>>()?,
            };
            // A search never returns less than its start, so the start's own glass takes part.
            candidates.push(lens.surfaces[surface].glass.clone());
            // A glass may come twice, by its name and by an alias.
            candidates.sort_by(|a, b| a.name.cmp(&b.name));
            candidates.dedup_by(|a, b| a.name == b.name);
            choices.push(GlassChoice { surface, candidates });
        }
        Ok(choices)
    }

    pub(in crate::lens) fn limits(&self) -> Result<Limits> {
        let back_focal_mm = match self.bfl[..] {
            [] => None,
            [min, max] if min <= max => Some([min, max]),
            _ => {
                let message = "needs two numbers, the smaller first";
                return Err(JobError::setting("bfl", list(&self.bfl), message, "for example 24,25"));
            }
        };
        Ok(Limits {
            element_edge_mm: Some(self.edge.unwrap_or(0.0).max(LEAST_MM)),
            element_centre_mm: self.centre,
            air_gap_mm: Some(self.air.unwrap_or(0.0).max(LEAST_MM)),
            back_focal_mm,
            track_mm: self.track,
            clear_diameter_mm: self.clear_diameter,
            distortion: self.distortion.map(|percent| 0.01 * percent),
            slope_rad: self.slope.map(f64::to_radians),
            chief_ray_angle_rad: self.chief_ray_angle.map(f64::to_radians),
        })
    }

    fn efl_solve(&self, file: &LensFile) -> Result<Option<EflSolve>> {
        let own_mm = first_order(&file.lens.at_wavelength(file.lens.reference_um)).efl_mm;
        let Some(wanted) = self.efl.as_deref() else {
            // A lens that only got longer would look better. One that is afocal, or has no surface for it, is left free; one for a near object keeps its
            // magnification instead.
            let is_far = file.lens.object == ObjectDistance::Infinity;
            let held = || (is_far && own_mm.is_finite()).then(|| holding(file)).flatten();
            let efl_of = |(surface, radius_mm)| EflSolve { surface, efl_mm: own_mm, radius_mm };
            return Ok(file.efl_solve.or_else(|| held().map(efl_of)));
        };
        if wanted == "free" {
            return Ok(None);
        }
        let efl_mm: f64 = wanted
            .parse()
            .ok()
            .filter(|f: &f64| f.is_finite() && *f != 0.0)
            .ok_or_else(|| JobError::setting("efl", wanted, "neither a length nor `free`", "in mm"))?;
        if own_mm.is_finite() && own_mm * efl_mm < 0.0 {
            let message = format!(
                "the lens has a focal length of {own_mm:.3} mm, and another sign is another kind of lens"
            );
            let hint = format!("--efl {}, or start from another lens", efl_mm.abs().copysign(own_mm));
            return Err(JobError::setting("efl", wanted, message, hint));
        }
        if let Some((surface, radius_mm)) = file.solves().curvature() {
            return Ok(Some(EflSolve { surface, efl_mm, radius_mm }));
        }
        let (surface, radius_mm) = holding(file).ok_or_else(|| {
            let hint = format!(
                "it takes a radius that the file lets vary, or any curved one if it names no variables, without pickups from or to it; {}",
                how_to_hold(file, efl_mm)
            );
            JobError::setting("efl", wanted, "no surface can hold the focal length", hint)
        })?;
        Ok(Some(EflSolve { surface, efl_mm, radius_mm }))
    }

    /// The solve that holds the magnification of a near object, unless the user lets it vary with the focal length.
    fn magnification_solve(&self, file: &LensFile) -> Option<MagnificationSolve> {
        let is_held = self.efl.is_none();
        let own = || {
            let magnification = magnification(&file.lens)?;
            let (surface, radius_mm) = holding(file)?;
            Some(MagnificationSolve { surface, magnification, radius_mm })
        };
        is_held.then(|| file.magnification_solve.or_else(own)).flatten()
    }
}

/// The variable that is the radius of a surface, from 0.
fn radius_variable(file: &LensFile, surface: usize) -> Option<usize> {
    file.variables.iter().position(|v| (v.surface, v.number) == (surface, Number::Curvature))
}

/// Surfaces with power whose radius follows no other and is followed by none, from 0.
fn solvable(file: &LensFile) -> Vec<usize> {
    let follows = |s: usize| {
        let is_radius = |v: usize| file.variables[v].number == Number::Curvature;
        file.pickups.iter().any(|p| p.surface == s && is_radius(p.variable))
    };
    let is_followed =
        |s: usize| radius_variable(file, s).is_some_and(|v| file.pickups.iter().any(|p| p.variable == v));
    powered(&file.lens).filter(|s| !follows(*s) && !is_followed(*s)).collect()
}

/// What holds a focal length, mm, where no radius that the file lets vary is free to: a solve in the file for a curved surface that can have one.
pub(super) fn how_to_hold(file: &LensFile, efl_mm: f64) -> String {
    let is_curved = |s: &usize| file.lens.surfaces[*s].shape.curvature != 0.0;
    match solvable(file).into_iter().rev().find(is_curved) {
        Some(surface) => format!(
            "[solve] efl = {{ surface = {}, efl_mm = {efl_mm:.4} }} in the file does, or that of another curved surface",
            surface + 1
        ),
        None => "no [solve] in the file can: each curved surface follows another or is followed; an operand `focal-length` bounds it".to_owned(),
    }
}

/// The surface whose radius is solved for the focal length or the magnification, and the bounds of the radius. It is the last radius that
/// the file lets vary or, if the file names no variables, that of the last curved surface. `None` if no radius can be solved.
fn holding(file: &LensFile) -> Option<(usize, Option<[f64; 2]>)> {
    let of_radius = |s: usize| radius_variable(file, s);
    let eligible = solvable(file);
    // A file that names variables says what may move: what it leaves out stays, such as a filter or a test plate's radius.
    let is_curved = |s: &&usize| file.lens.surfaces[**s].shape.curvature != 0.0;
    let surface = if file.variables.is_empty() {
        eligible.iter().rev().find(is_curved)
    } else {
        eligible.iter().rev().find(|s| of_radius(**s).is_some())
    };
    let surface = *surface?;
    Some((surface, of_radius(surface).map(|v| [file.variables[v].min, file.variables[v].max])))
}

impl Restored {
    /// The error as a merit: PSFs to the corner of the sensor, in the colours in which the spots are judged if these are three.
    fn merit(&self, spots: &SpotResiduals, assets: &Assets) -> Result<RestoredError> {
        let sensor = assets.sensor(&self.sensor)?;
        let exposure = Exposure { white_e: self.white_e, ..ExposureConfig::default().exposure() };
        let mut psf = PsfConfig::default();
        let mut colours = spots.wavelengths_um.clone();
        colours.sort_by(|a, b| b.total_cmp(a));
        if let [red, green, blue] = colours[..] {
            psf.wavelengths_um = [red, green, blue];
        }
        let plan = psf.plan(&sensor, psf.pupil_cells)?;
        let limit = Arc::new(LinearLimit::new(&sensor, &exposure, NaturalScenes::default()));
        let rays = SpotResiduals { power: 2.0, ..spots.clone() };
        Ok(RestoredError { plan, limit, stated_brightness: None, rays })
    }
}

/// The least edge thickness and air gap of every goal, mm: a penalty ends a little beyond its limit, and surfaces must not cross there.
pub(super) const LEAST_MM: f64 = 0.01;

/// Whether a search over the whole catalogue may put a glass into a lens: it can be bought, and its formula holds.
fn is_usable(glass: &Glass, lens: &Lens) -> bool {
    !glass.is_air()
        && glass.status != Some(Status::Obsolete)
        && !lens.wavelengths_um.iter().any(|um| glass.is_outside_range(*um))
}

/// One of each set of glasses that makers offer as each other's equivalents, if possible a preferred one. A search exchanges
/// a glass for one of a few neighbours on the glass map; six kinds of BK7 would be no choice.
fn one_of_each_kind<'a>(glasses: impl Iterator<Item = &'a Arc<Glass>>) -> Vec<Arc<Glass>> {
    const ALIKE: f64 = 0.3;
    let mut glasses: Vec<&Arc<Glass>> = glasses.collect();
    glasses.sort_by_key(|glass| glass.status.is_none_or(|status| status != Status::Preferred));
    let mut kept: Vec<Arc<Glass>> = Vec::new();
    for glass in glasses {
        let place = [glass.nd(), glass.abbe_vd()];
        if !kept.iter().any(|other| map_distance(other, place) < ALIKE) {
            kept.push(glass.clone());
        }
    }
    kept
}

/// Refuses a setting one of whose values is out of range.
fn check(key: &'static str, values: &[f64], is_in_range: impl Fn(f64) -> bool, hint: &str) -> Result<()> {
    if values.iter().all(|v| is_in_range(*v)) {
        Ok(())
    } else {
        Err(JobError::setting(key, list(values), "out of range", hint))
    }
}

fn list(values: &[f64]) -> String {
    values.iter().copied().map(number_text).collect::<Vec<_>>().join(",")
}

/// The variables of a lens whose file names none.
fn wide(lens: &Lens) -> Result<Vec<Variable>> {
    let none = || {
        JobError::input("the lens has no curved surface between two media", "give it [[variable]] entries")
    };
    wide_variables(lens).ok_or_else(none)
}
