//! Where designs start: a lens, where it may go, and what it must keep.

use std::path::Path;
use std::sync::Arc;

use petzval_camera::linear_limit::LinearLimit;
use petzval_camera::sensor::SensorModel;
use petzval_files::LensFile;
use petzval_optics::constraint::passing_share;
use petzval_optics::design_space::{
    DesignSpace, DesignSpaceError, EflSolve, Focus, MagnificationSolve, SmoothSpace, Solves, Variable,
    near_variables,
};
use petzval_optics::lens::{Lens, ObjectDistance};
use petzval_optics::merit::{Merit, SpotResiduals};
use petzval_optics::number::Number;
use petzval_optics::optimize::{Apertures, Goal, Problem};
use petzval_optics::pupil::{PupilSampling, Quadrature};
use petzval_optics::solve::{thin_equivalent, with_best_focus};
use petzval_optics::spot::spot;

use crate::assets::Assets;
use crate::error::{DesignError, Result};
use crate::experiment::{BOX_CENTRE_LENS, Experiment, FieldOfView, LensGoal, PERFECT_LENS};
use crate::lens::psf_plan::PsfPlan;
use crate::lens::requirements::Requirements;
use crate::lens::restored::RestoredError;

/// Pupil cells a side of the spot in the corner of the sensor.
const CORNER_CELLS: usize = 48;

/// Distances from the axis at which the light of a lens is held, as shares of that of the corner.
const LIT_SHARES: [f64; 4] = [0.5, 0.7, 0.85, 1.0];

/// Light of the corner that a lens may lose to clear apertures, as a share of all, before a word is said: more than what the requirement allows.
const DARKER: f64 = 0.025;

/// Growth of the spot in the corner of the sensor from which on a word is said.
const WORSE: f64 = 1.5;

/// A lens from which variants start.
pub struct Start {
    /// Its file.
    pub lens_file: LensFile,
    /// Whether the file names variables of its own; they are [`near_variables`] if not.
    pub names_variables: bool,
    /// Where it may go.
    pub space: SmoothSpace,
    /// What every lens of that space must keep.
    pub requirements: Requirements,
    /// Field angles of the spot goal, rad: each stands for an equal area of the sensor.
    pub spot_fields_rad: Vec<f64>,
    /// PSFs of the restored goal.
    plan: PsfPlan,
    /// The error of the best linear restoration.
    limit: Arc<LinearLimit>,
    /// The brightness for which the exposure is stated, see [`RestoredError`].
    stated_brightness: Option<f64>,
}

/// Which lens, and what variants do with it.
#[derive(Clone, Copy, Debug)]
pub struct StartOf<'a> {
    /// File, built-in name, [`PERFECT_LENS`] or [`BOX_CENTRE_LENS`].
    pub lens: &'a str,
    /// Whether it keeps its field of view.
    pub field: FieldOfView,
    /// Whether some variant moves it.
    pub moves: bool,
    /// The brightness for which the exposure is stated, see [`RestoredError`].
    pub stated_brightness: Option<f64>,
}

impl Start {
    /// Reads a lens, or makes the [`PERFECT_LENS`] or the [`BOX_CENTRE_LENS`], and its design space. With a free field of view the radius that
    /// its file solves for is a variable within the bounds of the solve. A lens that `moves` and whose file names no variables
    /// gets the usual ones near its own numbers, and a solve that holds its focal length or, of a near object, its magnification.
    pub fn new(
        StartOf { lens: name, field, moves, stated_brightness }: StartOf,
        experiment: &Experiment,
        assets: &Assets,
        sensor: &SensorModel,
        plan: &PsfPlan,
        limit: &Arc<LinearLimit>,
    ) -> Result<Self> {
        let mut lens_file = match name {
            PERFECT_LENS => {
                let lens = assets.import(&experiment.lens)?.file.lens;
                if lens.object != ObjectDistance::Infinity {
                    let message = "a lens without aberrations is known for far objects alone";
                    let hint = "leave the variant of the perfect lens out";
                    return Err(DesignError::misfit(Path::new(&experiment.lens), &message, hint));
                }
                LensFile::of(thin_equivalent(&lens))
            }
            BOX_CENTRE_LENS => assets.lens(&experiment.lens)?,
            _ => assets.lens(name)?,
        };
        let names_variables = !lens_file.variables.is_empty();
        if moves
            && !names_variables
            && let Some((variables, solves)) = near_variables(&lens_file.lens, &lens_file.solves())
        {
            lens_file.give(variables, &solves);
        }
        if let Some((surface, radius_mm)) = lens_file.solves().curvature()
            && field == FieldOfView::Free
        {
            let [min, max] = radius_mm.ok_or_else(|| {
                let message = "the radius that is solved for has no bounds, within which it could be free";
                DesignError::misfit(Path::new(name), &message, "add radius_mm = [min, max] to its solve")
            })?;
            (lens_file.efl_solve, lens_file.magnification_solve) = (None, None);
            lens_file.variables.push(Variable { surface, number: Number::Curvature, min, max });
        }
        // Spots and pictures are scored in the same colours.
        let mut colours = experiment.psf.wavelengths_um.to_vec();
        colours.sort_by(f64::total_cmp);
        lens_file.lens.wavelengths_um = colours;
        let focus = Focus::Paraxial { range_mm: experiment.optics.defocus_mm };
        let space = space_of(&lens_file, focus).and_then(|space| {
            if name != BOX_CENTRE_LENS {
                return Ok(space);
            }
            let title = format!("{}, middle of its bounds", lens_file.lens.name);
            lens_file.lens = Lens { name: title, ..space.lens_at(&space.centre())? };
            space_of(&lens_file, focus)
        });
        let space = space.map_err(|e| {
            let hint = "correct the lens file, or optics.defocus_mm of the experiment for its image plane";
            DesignError::misfit(Path::new(name), &e, hint)
        })?;
        // What the sensor sees is taken of the lens in focus.
        let focused = if moves { in_focus(&lens_file.lens, plan) } else { None };
        let lens = focused.as_ref().unwrap_or(&lens_file.lens);
        let corner_mm = plan.field_radius_mm.last().copied().unwrap_or(0.0);
        let lit_rad = LIT_SHARES
            .iter()
            .map(|share| plan.field_angle(lens, share * corner_mm))
            .collect::<Result<Vec<_>, _>>()?;
        let requirements = Requirements::new(lens, &lens_file, &experiment.constraints, &lit_rad)?;
        let spot_fields_rad = area_quantile_radii_mm(sensor, experiment.psf.fields)
            .iter()
            .map(|radius| plan.field_angle(lens, *radius))
            .collect::<Result<_, _>>()?;
        // A lens whose light does not arrive is refused now, not after the first step.
        let traced = plan.trace(&lens_file.lens).map_err(|e| {
            let hint = match e {
                DesignError::NotSymmetric(_) => "leave tilts and decentres out, or name another lens",
                DesignError::NoLight { lost: Some(_), .. } => {
                    "`petzval lens show` lists the light of each field: let it through there, or name a smaller sensor"
                }
                _ => "`petzval lens show` lists the light of each field; PSFs may also miss a small psf.grid",
            };
            DesignError::misfit(Path::new(name), &e, hint)
        })?;
        Ok(Self {
            lens_file,
            names_variables,
            space,
            requirements,
            spot_fields_rad,
            plan: plan.held_as(&traced),
            limit: limit.clone(),
            stated_brightness,
        })
    }

    /// The fields and grids on which PSFs are sampled while the lens moves.
    pub fn plan(&self) -> &PsfPlan {
        &self.plan
    }

    /// The spots of a lens, over fields of equal area.
    pub fn spots(&self, lens: &Lens) -> SpotResiduals {
        SpotResiduals {
            fields_rad: self.spot_fields_rad.clone(),
            field_weights: vec![1.0; self.spot_fields_rad.len()],
            sampling: PupilSampling::Degree(8),
            power: 2.0,
            ..SpotResiduals::new(lens)
        }
    }

    /// What to say of a lens whose spot in the corner of the sensor grew while those of the goal shrank. Few pixels lie beyond the outermost field
    /// of equal area; a table of fields from the axis to the corner shows them.
    pub fn worse_corner(&self, before: &Lens, after: &Lens) -> Option<String> {
        let corner_mm = *self.plan.field_radius_mm.last()?;
        let quadrature = Quadrature::grid(CORNER_CELLS).ok()?;
        let rms_um = |lens: &Lens| {
            let field_rad = self.plan.field_angle(lens, corner_mm).ok()?;
            Some(spot(lens, field_rad, &quadrature)?.rms_poly_um)
        };
        let was_um = rms_um(before)?;
        let Some(is_um) = rms_um(after) else {
            return Some(format!(
                "no light lands in the corner of the sensor any more, where the RMS spot was {was_um:.1} um: the goal counts fields by their area, \
                 and little area lies there"
            ));
        };
        (is_um > WORSE * was_um).then(|| {
            format!(
                "in the corner of the sensor the RMS spot is {is_um:.1} um, and was {was_um:.1} um: the goal counts fields by their area, and little \
                 area lies there"
            )
        })
    }

    /// What to say of a lens whose clear apertures cut off more of the corner's light than they did: part of a smaller spot is then less light.
    pub fn darker_corner(&self, before: &Lens, after: &Lens) -> Option<String> {
        let corner_mm = *self.plan.field_radius_mm.last()?;
        let percent = |lens: &Lens| {
            let field_rad = self.plan.field_angle(lens, corner_mm).ok()?;
            Some(100.0 * passing_share(lens, field_rad)?)
        };
        let (was, is) = (percent(before)?, percent(after)?);
        (is < was - 100.0 * DARKER).then(|| {
            format!(
                "in the corner of the sensor {is:.0} % of the light of the stop passes the clear apertures, and {was:.0} % did: part of what the lens gains \
                 is less light"
            )
        })
    }

    /// The error of the best linear restoration, from PSFs by a plan.
    pub fn restored(&self, plan: &PsfPlan) -> RestoredError {
        let rays = self.spots(&self.lens_file.lens);
        let (limit, stated_brightness) = (self.limit.clone(), self.stated_brightness);
        RestoredError { plan: plan.clone(), limit, stated_brightness, rays }
    }

    /// The problem of a goal of the lens alone, within the bounds of the space, with the requirements as limits: a violation costs this many
    /// um per mm, where a percent of white counts as one um of spot.
    pub fn problem(&self, goal: LensGoal, lens: Lens, stiffness_um_per_mm: f64) -> Problem {
        let file = &self.lens_file;
        // The requirements hold the bounds of the radius that is solved for.
        let efl = file.efl_solve.map(|solve| EflSolve { radius_mm: None, ..solve });
        let magnification =
            file.magnification_solve.map(|solve| MagnificationSolve { radius_mm: None, ..solve });
        let merit = self.spots(&lens);
        let (spot_weight, goals) = match goal {
            LensGoal::Spot => (1.0, Vec::new()),
            LensGoal::Restored => {
                let merit = Arc::new(self.restored(&self.plan));
                (0.0, vec![Goal { merit, target: 0.0, weight_um: 1.0 }])
            }
        };
        Problem {
            spot_weight,
            goals,
            variables: file.variables.clone(),
            pickups: file.pickups.clone(),
            solves: Solves { efl, magnification, ..file.solves() },
            focus: self.space.space().focus(),
            merit,
            further: self.requirements.constraints().to_vec(),
            apertures: Apertures::Drawn,
            stiffness_um_per_mm,
            ..Problem::new(lens)
        }
    }
}

/// How much smaller spots must be in focus, as a share, for the image plane of a lens to count as out of focus.
const OUT_OF_FOCUS: f64 = 0.5;

/// Pupil cells a side of the best focus.
const FOCUS_CELLS: usize = 32;

/// The lens with its image plane at best focus over the sensor; `None` if the plane of its file is in focus, or no place is better.
///
/// Where fields are imaged depends on the plane. On one far from focus the field of view is another, and a lens that had to keep it would be held
/// there.
fn in_focus(lens: &Lens, plan: &PsfPlan) -> Option<Lens> {
    let fields_rad = plan.field_angles(lens).ok()?;
    let refocused = with_best_focus(lens, &fields_rad, &Quadrature::grid(FOCUS_CELLS).ok()?)?;
    let spots = SpotResiduals {
        field_weights: vec![1.0; fields_rad.len()],
        fields_rad,
        power: 2.0,
        ..SpotResiduals::new(lens)
    };
    let better = spots.value(&refocused)?;
    spots.value(lens).is_none_or(|here| better < OUT_OF_FOCUS * here).then_some(refocused)
}

/// The design space of a lens file.
fn space_of(file: &LensFile, focus: Focus) -> Result<SmoothSpace, DesignSpaceError> {
    let solves = file.solves();
    let (lens, variables, pickups) = (file.lens.clone(), file.variables.clone(), file.pickups.clone());
    SmoothSpace::new(DesignSpace::new(lens, variables, pickups, solves, focus)?)
}

/// Image radii that stand for equal areas of the sensor: the medians of `count` equal parts of its pixels, ordered by their
/// distance from the centre, mm, ascending.
fn area_quantile_radii_mm(sensor: &SensorModel, count: usize) -> Vec<f64> {
    // A grid over a quadrant, fine enough for the quantiles to be good to a thousandth of the diagonal.
    const CELLS: usize = 200;
    let at = |i: usize, side: usize| 0.5e-3 * sensor.pixel_um * side as f64 * (i as f64 + 0.5) / CELLS as f64;
    let mut radii: Vec<f64> =
        (0..CELLS * CELLS).map(|i| at(i / CELLS, sensor.height).hypot(at(i % CELLS, sensor.width))).collect();
    radii.sort_by(f64::total_cmp);
    (0..count).map(|i| radii[(2 * i + 1) * radii.len() / (2 * count)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sensor(height: usize, width: usize, pixel_um: f64) -> SensorModel {
        let text = include_str!("../../../petzval-data/data/sensors/imx249-fitted.toml");
        SensorModel { height, width, pixel_um, ..petzval_files::parse_sensor(text).unwrap() }
    }

    #[test]
    fn quantiles_of_a_square_are_those_of_its_area() {
        // Half of a square of side 2 lies within sqrt(2 / pi) of its centre, a little less than 1.
        let radii = area_quantile_radii_mm(&sensor(2000, 2000, 1.0), 1);
        assert!((radii[0] - (2.0 / std::f64::consts::PI).sqrt()).abs() < 3e-3, "{radii:?}");
        let many = area_quantile_radii_mm(&sensor(1200, 1920, 5.86), 13);
        assert!(many.is_sorted() && many[0] > 0.5 && many[12] < 6.634, "{many:?}");
    }
}
