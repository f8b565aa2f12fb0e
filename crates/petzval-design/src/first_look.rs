//! A look at an experiment before its first step: what its lenses show on its sensor, what they violate, how its photographs fit, and how many steps it
//! takes.

use std::collections::BTreeMap;

use petzval_base::counted;
use petzval_optics::constraint::SemiDiameters;
use petzval_optics::lens::Lens;
use petzval_optics::paraxial::first_order;
use petzval_optics::pupil::{Quadrature, chief_ray};
use petzval_optics::spot::spot;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::Result;
use crate::experiment::{BlockName, PERFECT_LENS, Stage, Variant, is_derived_lens};
use crate::lens::psf_plan::LEAST_IMAGE;
use crate::lens::start::Start;
use crate::setup::Setup;
use crate::task::PhotosLook;

/// Fields from the axis to the corner of the sensor.
const FIELDS: usize = 5;

/// Share of the light that the grid holds less at a field between these, so that it is shown too: a digit of the table.
const LESS: f64 = 1e-3;

/// Pupil cells a side of the spots.
const CELLS: usize = 48;

/// Usual radii of a sensor's corner, as a share of the image circle's. Others are noted.
const FITS: std::ops::RangeInclusive<f64> = 0.6..=1.1;

/// Violation of a requirement that counts as none, mm.
const NONE_MM: f64 = 1e-6;

/// The checks of an experiment before its first step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FirstLook {
    /// Title of the experiment.
    pub experiment: String,
    /// Steps of all cameras, with one for the score of each.
    pub steps: usize,
    /// The cameras that are made.
    pub cameras: Vec<Planned>,
    /// Half of the sensor's diagonal, mm.
    pub corner_mm: f64,
    /// Pixel pitch, um.
    pub pixel_um: f64,
    /// The lenses from which cameras start.
    pub lenses: Vec<LensLook>,
    /// The photographs; none where scenes are made or labelled.
    pub photos: Option<PhotosLook>,
    /// What makes a result worthless; with one of them, `design` does not begin.
    pub problems: Vec<String>,
    /// What to know before believing a result.
    pub warnings: Vec<String>,
}

/// What a camera takes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Planned {
    /// Its name.
    pub camera: String,
    /// Steps, with one for its score.
    pub steps: usize,
    /// Steps of each block for the task.
    pub blocks: BTreeMap<String, usize>,
    /// Stages that improve the lens alone; each counts as one step.
    pub lens_stages: usize,
}

/// A lens on the sensor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LensLook {
    /// Its name.
    pub lens: String,
    /// Cameras that start from it.
    pub cameras: Vec<String>,
    /// Focal length, mm.
    pub efl_mm: f64,
    /// F-number.
    pub f_number: f64,
    /// Radius at which the outermost field of its file is imaged, mm; none if that is the axis, or no ray of it arrives.
    pub image_circle_mm: Option<f64>,
    /// Its image from the axis to the corner of the sensor at equal distances, and at one place between where the grid of the PSFs holds less of its light
    /// than at all of those.
    pub fields: Vec<FieldLook>,
    /// Requirements that it violates.
    pub violated: Vec<Violated>,
}

/// The image of a field.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FieldLook {
    /// Distance from the axis, mm.
    pub image_mm: f64,
    /// Field angle, degrees.
    pub field_deg: f64,
    /// RMS spot radius over the colours, um; none if no light of a colour arrives.
    pub rms_spot_um: Option<f64>,
    /// Least share, over the colours, of the light that the PSFs' grid holds.
    pub light_on_grid: f64,
    /// Illumination relative to the axis.
    pub illumination: Option<f64>,
}

/// A requirement that a lens violates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Violated {
    /// Which.
    pub requirement: String,
    /// By how much, mm.
    pub by_mm: f64,
}

impl FirstLook {
    /// The steps of all cameras: `29 steps in all: nominal 10 network and 1 score, ...`.
    pub fn steps_in_words(&self) -> String {
        steps_in_words(&self.cameras)
    }
}

/// The steps of cameras: `29 steps in all: nominal 10 network and 1 score, ...`.
pub(crate) fn steps_in_words(cameras: &[Planned]) -> String {
    let of = |camera: &Planned| {
        let lens = (camera.lens_stages > 0).then(|| format!("{} of the lens alone", camera.lens_stages));
        let blocks = camera.blocks.iter().map(|(block, steps)| format!("{steps} {block}"));
        let parts: Vec<String> = lens.into_iter().chain(blocks).chain(["1 score".to_owned()]).collect();
        format!("{} {}", camera.camera, parts.join(" + "))
    };
    let all = cameras.iter().map(|camera| camera.steps).sum();
    let cameras: Vec<String> = cameras.iter().map(of).collect();
    format!("{} in all: {}", counted(all, "step"), cameras.join("; "))
}

/// Looks at an experiment that was made ready. Fails with [`DesignError::Stopped`](crate::error::DesignError::Stopped) before the next lens once the job is cancelled.
pub fn first_look(setup: &Setup) -> Result<FirstLook> {
    let mut lenses: Vec<LensLook> = Vec::new();
    for variant in setup.variants.iter().filter(|v| v.lens != PERFECT_LENS) {
        let known =
            lenses.iter_mut().find(|look| look.cameras.iter().any(|c| starts_alike(setup, c, variant)));
        match known {
            Some(look) => look.cameras.push(variant.name.clone()),
            None => {
                setup.cancel.check()?;
                lenses.push(lens_look(setup, variant, setup.start(variant))?);
            }
        }
    }
    setup.cancel.check()?;
    let photos = setup.windows()?.photos_look(setup);
    let cameras: Vec<Planned> = setup.variants.iter().map(planned).collect();
    let mut look = FirstLook {
        experiment: setup.experiment.name.clone(),
        steps: cameras.iter().map(|camera| camera.steps).sum(),
        cameras,
        corner_mm: setup.corner_mm(),
        pixel_um: setup.body.sensor.pixel_um,
        lenses,
        photos,
        problems: Vec::new(),
        warnings: Vec::new(),
    };
    // A lens that the experiment derives, such as the middle of its bounds, is a control: it may be as bad as it is.
    let is_derived = |lens: &&LensLook| {
        let of_lens = |v: &&Variant| lens.cameras.contains(&v.name);
        setup.variants.iter().find(of_lens).is_some_and(|v| is_derived_lens(&v.lens))
    };
    // PSFs of a file have a grid of their own.
    let is_traced = setup.given_psfs().is_none();
    let off_the_grid = |lens: &LensLook| off_the_grid(setup, lens).filter(|_| is_traced);
    let (derived, own): (Vec<&LensLook>, Vec<&LensLook>) = look.lenses.iter().partition(is_derived);
    let problems = own.iter().copied().filter_map(off_the_grid).collect();
    let controls: Vec<String> = derived.into_iter().filter_map(off_the_grid).collect();
    let cut_off = |lens: &LensLook| {
        if is_traced && off_the_grid(lens).is_none() { cut_light(setup, lens) } else { None }
    };
    let cut: Vec<String> = own.into_iter().filter_map(cut_off).collect();
    let doubts = look.lenses.iter().flat_map(|lens| doubts(&look, lens));
    let warnings = controls.into_iter().chain(cut).chain(doubts).collect();
    (look.problems, look.warnings) = (problems, warnings);
    Ok(look)
}

/// Whether a variant starts from the same lens as a camera.
fn starts_alike(setup: &Setup, camera: &str, variant: &Variant) -> bool {
    setup.variants.iter().any(|v| v.name == camera && v.lens == variant.lens && v.field == variant.field)
}

/// The steps of a variant.
pub(crate) fn planned(variant: &Variant) -> Planned {
    let taken = |block: BlockName| (block.name().to_owned(), variant.task_steps_of(block));
    Planned {
        camera: variant.name.clone(),
        steps: variant.stages.iter().map(Stage::steps).sum::<usize>() + 1,
        blocks: BlockName::ALL.into_iter().map(taken).filter(|(_, steps)| *steps > 0).collect(),
        lens_stages: variant.stages.iter().filter(|stage| matches!(stage, Stage::Lens { .. })).count(),
    }
}

fn lens_look(setup: &Setup, variant: &Variant, start: &Start) -> Result<LensLook> {
    let lens = &start.lens_file.lens;
    // With one more field between any two of those that are shown.
    let plan = setup.moving_plan.with_fields(2 * FIELDS - 1);
    let psfs = plan.psfs(lens, &setup.cancel)?;
    let quadrature = Quadrature::grid(CELLS)?;
    let in_colours = Lens { wavelengths_um: plan.wavelengths_um.to_vec(), ..lens.clone() };
    let axis = spot(&in_colours, 0.0, &quadrature);
    let on_grid: Vec<f64> = psfs.iter().map(|psf| psf.captured.iter().copied().fold(1.0, f64::min)).collect();
    let fields = shown(&on_grid).into_iter().map(|i| {
        let psf = &psfs[i];
        let spot = spot(&in_colours, psf.field_rad, &quadrature);
        let mean = |all: &[f64]| all.iter().sum::<f64>() / all.len() as f64;
        FieldLook {
            image_mm: plan.field_radius_mm[i],
            field_deg: psf.field_rad.to_degrees(),
            rms_spot_um: spot.as_ref().map(|spot| spot.rms_poly_um),
            light_on_grid: on_grid[i],
            illumination: (spot.as_ref().zip(axis.as_ref()))
                .map(|(spot, axis)| mean(&spot.relative_illumination(axis))),
        }
    });
    let reference = lens.at_wavelength(lens.reference_um);
    let order = first_order(&reference);
    let outermost = lens.outermost_field_deg();
    let circle = (outermost > 0.0).then(|| chief_ray(&reference, outermost.to_radians())).flatten();
    let violated = start.requirements.constraints().iter().filter_map(|constraint| {
        let by_mm = constraint.excess_mm(lens, &SemiDiameters(lens))?;
        (by_mm > NONE_MM).then(|| Violated { requirement: constraint.to_string(), by_mm })
    });
    Ok(LensLook {
        lens: lens.name.clone(),
        cameras: vec![variant.name.clone()],
        efl_mm: order.efl_mm,
        f_number: order.f_number,
        image_circle_mm: circle.map(|chief| chief.y_mm.abs()),
        fields: fields.collect(),
        violated: violated.collect(),
    })
}

/// Which fields are shown, by the share of the light that the grid holds of each: every second one, and one between where it holds less than at all of
/// those.
fn shown(on_grid: &[f64]) -> Vec<usize> {
    let least = on_grid.iter().step_by(2).copied().fold(1.0, f64::min);
    let between = (1..on_grid.len()).step_by(2).filter(|i| on_grid[*i] < least - LESS);
    let darkest = between.min_by(|a, b| on_grid[*a].total_cmp(&on_grid[*b]));
    (0..on_grid.len()).filter(|i| i.is_multiple_of(2) || Some(*i) == darkest).collect()
}

/// What to say of a lens whose light lies beyond the grid.
fn off_the_grid(setup: &Setup, lens: &LensLook) -> Option<String> {
    let mut shares: Vec<f64> = lens.fields.iter().map(|field| field.light_on_grid).collect();
    shares.sort_by(f64::total_cmp);
    let median = shares[shares.len() / 2];
    let psf = &setup.experiment.psf;
    (median < LEAST_IMAGE).then(|| {
        format!(
            "{}: the PSFs' grid of {:.0} um holds {:.0} % of its light in the median of the fields: is it in focus?",
            lens.lens,
            psf.grid as f64 * psf.pitch_um,
            100.0 * median
        )
    })
}

/// What to say of a lens of which the grid cuts off light at some field.
fn cut_light(setup: &Setup, lens: &LensLook) -> Option<String> {
    let least = lens.fields.iter().min_by(|a, b| a.light_on_grid.total_cmp(&b.light_on_grid))?;
    let lost = setup.experiment.psf.lost_light(least.light_on_grid, Some(least.field_deg));
    lost.map(|lost| format!("{}: {lost}", lens.lens))
}

/// What to know of a lens before believing a result.
fn doubts(look: &FirstLook, lens: &LensLook) -> Vec<String> {
    let mut found: Vec<String> = (lens.violated.iter())
        .map(|v| {
            format!(
                "{} violates a requirement from the start: {}, by {:.4} mm",
                lens.lens, v.requirement, v.by_mm
            )
        })
        .collect();
    let share = lens.image_circle_mm.map(|circle_mm| look.corner_mm / circle_mm);
    if let (Some(share), Some(circle_mm)) =
        (share.filter(|share| !FITS.contains(share)), lens.image_circle_mm)
    {
        let what = if share < 1.0 {
            "fields further out are neither seen nor improved"
        } else {
            "its file does not state such fields"
        };
        found.push(format!(
            "{}: the sensor's corner lies {:.2} mm from the axis, at {:.0} % of the image circle of its file ({circle_mm:.2} mm); {what}",
            lens.lens,
            look.corner_mm,
            100.0 * share
        ));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A telephoto of which the grid holds 99.6 % in the rows and 98 % between two of them.
    #[test]
    fn the_field_of_which_the_grid_holds_least_is_shown() {
        let rows = vec![0, 2, 4, 6, 8];
        assert_eq!(shown(&[0.997; 9]), rows);
        let mut on_grid = [0.997, 0.996, 0.997, 0.996, 0.996, 0.99, 0.996, 0.9955, 0.996];
        assert_eq!(shown(&on_grid), [0, 2, 4, 5, 6, 8]);
        (on_grid[5], on_grid[7]) = (0.9955, 0.98);
        assert_eq!(shown(&on_grid), [0, 2, 4, 6, 7, 8]);
        on_grid[8] = 0.5;
        assert_eq!(shown(&on_grid), rows);
    }
}
