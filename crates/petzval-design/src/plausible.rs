//! What is checked of a new run before its first step: a camera that can give no meaningful result is refused, and a comparison that
//! is not like for like is warned of.

use std::path::Path;

use petzval_base::{FileError, pasted};
use petzval_camera::isp::{FrameData, HardwareIsp};
use petzval_camera::sensor::Colour;
use petzval_optics::number::Number;
use petzval_optics::paraxial::{first_order, image_brightness};
use petzval_optics::solve::magnification;

use crate::assets::Text;
use crate::camera::Chip;
use crate::error::{DesignError, Result};
use crate::experiment::{BlockName, FieldOfView, Variant};
use crate::setup::Setup;

/// Largest relative difference of first-order data between comparable cameras.
const LIKE_FOR_LIKE: f64 = 0.01;

/// Refuses cameras that can give no meaningful result; returns the warnings. `source` is the experiment's text.
pub fn check(setup: &Setup, source: &Text) -> Result<Vec<String>> {
    setup.windows()?.check_sensor(&setup.experiment, &setup.body.sensor)?;
    let mut warnings = check_exposure(setup, source)?;
    warnings.extend(clipped_coefficients(setup)?);
    warnings.extend(brighter_lenses(setup));
    warnings.extend(drifting_lenses(setup));
    warnings.extend(usual_variables(setup));
    warnings.extend(unlike_starts(setup));
    warnings.extend(unlike_steps(setup));
    warnings.extend(setup.experiment.idle_keys(&setup.facts));
    Ok(warnings)
}

/// White must fit into a green pixel; where it does not fit into one of another colour, it is clipped there.
fn check_exposure(setup: &Setup, source: &Text) -> Result<Vec<String>> {
    let (sensor, exposure) = (&setup.body.sensor, &setup.experiment.exposure);
    let (white_e, gain) = (f64::from(exposure.white_e), f64::from(exposure.linear_gain));
    let capacity_e = sensor.light_capacity_e(f64::from(exposure.time_s), gain);
    if white_e > capacity_e {
        let message = format!(
            "a pixel of `{}` saturates at {capacity_e:.0} e- of light at linear gain {gain}: bright parts of every picture would be lost",
            sensor.name
        );
        let error = FileError::at_key(&source.text, &["exposure", "white_e"], message);
        let error =
            FileError { key: "exposure.white_e".to_owned(), value: exposure.white_e.to_string(), ..error };
        let hint = "give less, or a lower exposure.linear_gain if the converter is the limit";
        return Err(DesignError::input(&source.path)(error.hint(hint)));
    }
    let of_white = |colour: Colour| white_e * sensor.response(colour).iter().sum::<f64>();
    let clipped = sensor.cfa.colours().into_iter().filter(|colour| of_white(*colour) > capacity_e);
    let warning = |colour: Colour| {
        format!(
            "exposure.white_e = {white_e}: white gives {} pixels {:.0} e-, and they saturate at {capacity_e:.0} e-",
            colour.name(),
            of_white(colour)
        )
    };
    Ok(clipped.map(warning).collect())
}

/// Coefficients that the registers of the built-in ISP cut off at the start.
fn clipped_coefficients(setup: &Setup) -> Result<Vec<String>> {
    let body = &setup.body;
    let Some(settings) = body.chip.as_ref().and_then(Chip::settings) else { return Ok(Vec::new()) };
    let about = FrameData::of_sensor(&body.sensor, &body.exposure)?;
    let clipped = HardwareIsp { settings: settings.clone() }.clipped(&about);
    Ok(clipped.iter().map(|clipped| format!("the ISP at the start: its {clipped}")).collect())
}

/// Lenses behind which white clips because they gather more light in the same time than the one for which the exposure is stated.
fn brighter_lenses(setup: &Setup) -> Vec<String> {
    let Some(same) = setup.body.same_time.filter(|same| same.is_normalised) else { return Vec::new() };
    let exposure = &setup.experiment.exposure;
    let capacity_e =
        (setup.body.sensor).light_capacity_e(f64::from(exposure.time_s), f64::from(exposure.linear_gain));
    let stated_e = f64::from(exposure.white_e);
    let warning = |variant: &Variant| {
        let lens = &setup.start(variant).lens_file.lens;
        let white_e = stated_e * image_brightness(&lens.at_wavelength(lens.reference_um)) / same.brightness;
        (white_e > capacity_e && stated_e <= capacity_e).then(|| {
            format!(
                "`{}` starts with a lens that gathers more light in the same time: white is {white_e:.0} e- behind it, and pixels saturate at \
                 {capacity_e:.0} e- (hint: a lower exposure.white_e, or exposure.same = \"electrons\")",
                variant.name
            )
        })
    };
    setup.variants.iter().filter_map(warning).collect()
}

/// Lenses that are free to change their focal length.
fn drifting_lenses(setup: &Setup) -> Vec<String> {
    let mut moving: Vec<&Variant> = setup
        .variants
        .iter()
        .filter(|v| v.steps_of(BlockName::Optics) > 0 && v.field == FieldOfView::Held)
        .collect();
    moving.dedup_by(|a, b| a.lens == b.lens);
    let drifts = |v: &&Variant| {
        let file = &setup.start(v).lens_file;
        let first_order = |number| {
            !matches!(number, Number::Conic | Number::SemiDiameter)
                && !matches!(number, Number::Asphere(term) if term > 0)
        };
        file.solves().curvature().is_none()
            && file.variables.iter().any(|variable| first_order(variable.number))
    };
    let warning = |v: &Variant| {
        let lens = &setup.start(v).lens_file.lens;
        let last = lens.surfaces.len();
        let [what, kind, solve] = match magnification(lens) {
            Some(m) => {
                let solve = format!("magnification = {{ surface = {last}, magnification = {m:.4}");
                ["magnification".to_owned(), "magnification".to_owned(), solve]
            }
            None => {
                let efl_mm = first_order(&lens.at_wavelength(lens.reference_um)).efl_mm;
                let solve = format!("efl = {{ surface = {last}, efl_mm = {efl_mm:.4}");
                ["focal length".to_owned(), "focal-length".to_owned(), solve]
            }
        };
        format!(
            "{}: its variables change the {what}, and it has no {kind} solve: the cameras that move it may end at another \
             {what} and f-number than those they are compared with (hint: add to the lens file: [solve] {solve} }})",
            v.lens,
        )
    };
    moving.into_iter().filter(drifts).map(warning).collect()
}

/// Lenses that move and whose files name no variables.
fn usual_variables(setup: &Setup) -> Vec<String> {
    let moved = setup.variants.iter().filter(|v| v.steps_of(BlockName::Optics) > 0);
    let mut names: Vec<&String> =
        moved.filter(|v| !setup.start(v).names_variables).map(|v| &v.lens).collect();
    names.dedup();
    let held = |name: &String| {
        let of_it = setup.variants.iter().find(|v| v.lens == *name);
        of_it.map_or("", |v| setup.start(v).lens_file.solves().held_in_words())
    };
    let warning = |name: &String| {
        format!(
            "{name}: the file names no variables: curvatures move within a fifth, gaps of air by a quarter, coefficients by a half, and the last radius \
             holds {} (hint: `petzval init --lens {}` writes them into a file to edit)",
            held(name),
            pasted(Path::new(name))
        )
    };
    names.into_iter().map(warning).collect()
}

/// Variants that start from a lens of another focal length or f-number than the first.
fn unlike_starts(setup: &Setup) -> Vec<String> {
    let order = |v: &Variant| {
        let lens = &setup.start(v).lens_file.lens;
        first_order(&lens.at_wavelength(lens.reference_um))
    };
    let Some((baseline, others)) = setup.variants.split_first() else { return Vec::new() };
    let first = order(baseline);
    let is_unlike = |a: f64, b: f64| (a / b - 1.0).abs() > LIKE_FOR_LIKE;
    let warning = |v: &Variant| {
        let own = order(v);
        (is_unlike(own.efl_mm, first.efl_mm) || is_unlike(own.f_number, first.f_number)).then(|| {
            format!(
                "not like for like: `{}` starts at EFL {:.3} mm, f/{:.3}, and `{}` at {:.3} mm, f/{:.3}",
                v.name, own.efl_mm, own.f_number, baseline.name, first.efl_mm, first.f_number
            )
        })
    };
    others.iter().filter_map(warning).collect()
}

/// Variants that get different numbers of network steps. One that only gives its network to others is not among those that are compared.
fn unlike_steps(setup: &Setup) -> Option<String> {
    let gives = |v: &Variant| {
        let takes = |other: &Variant| other.from.as_ref() == Some(&v.name) && !other.keeps_lens;
        setup.variants.iter().any(takes)
    };
    let compared: Vec<&Variant> = setup.variants.iter().filter(|v| !gives(v)).collect();
    let steps = |v: &Variant| setup.task_steps(v, BlockName::Network);
    let is_unlike = compared.windows(2).any(|pair| steps(pair[0]) != steps(pair[1]));
    let list = || compared.iter().map(|v| format!("{} {}", v.name, steps(v))).collect::<Vec<_>>();
    is_unlike.then(|| {
        format!(
            "not like for like: the variants get different numbers of network steps ({})",
            list().join(", ")
        )
    })
}
