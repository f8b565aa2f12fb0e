//! An experiment fitted to a lens: focus, fields, sensor, grid of the PSFs, exposure, requirements and variables follow from the lens, and each
//! choice is said.

mod demands;
mod field;
mod focus;
mod grid;
mod limits;
mod sensor;
mod windows;

pub use demands::demands;
pub use sensor::white_that_fits;

use std::path::Path;

use petzval_camera::sensor::SensorModel;
use petzval_files::{Import, LensFile};
use petzval_optics::analysis::{leaves_parallel, paraxial_image_mm};
use petzval_optics::design_space::near_variables;
use petzval_optics::lens::{Lens, ObjectDistance};
use petzval_optics::number::Number;
use petzval_optics::paraxial::first_order;

use crate::assets::Assets;
use crate::error::{DesignError, Result};
use crate::experiment::{BlockName, Experiment, PicturesKey};

/// A lens to fit an experiment to.
pub struct FitOf<'a> {
    /// The experiment, whose lens and sensor are replaced.
    pub experiment: Experiment,
    /// The lens, for which an experiment is wanted.
    pub lens: Import,
    /// The name by which the user calls it: a file, or a built-in lens.
    pub lens_name: &'a str,
    /// The sensor that the user names; without one it is chosen.
    pub sensor: Option<&'a str>,
    /// The key of the pictures of its task.
    pub pictures: PicturesKey,
}

/// An experiment that fits its lens.
pub struct Fitted {
    /// The experiment. Lens and sensor have the names that it had before.
    pub experiment: Experiment,
    /// The lens.
    pub lens: LensFile,
    /// Whether the lens differs from its file.
    pub changes_lens: bool,
    /// Whether it was given variables because its file names none.
    pub gave_variables: bool,
    /// Name of the sensor that is taken.
    pub sensor_name: String,
    /// The sensor.
    pub sensor: SensorModel,
    /// Whether the sensor differs from the one of that name: its array was fitted.
    pub changes_sensor: bool,
    /// What was chosen, one line each.
    pub notes: Vec<String>,
    /// What the user should know before believing a result, one line each.
    pub warnings: Vec<String>,
}

/// Light of a camera for pictures in colour, um; other lenses are taken in their own.
const VISIBLE_UM: std::ops::RangeInclusive<f64> = 0.38..=0.78;

/// Least relative distance between the wavelengths of two colours.
const APART: f64 = 0.01;

/// Fits an experiment to a lens. Refuses a lens that makes no picture on a sensor. Ends with [`DesignError::Stopped`] at the next field once the flag
/// of `assets` is set.
pub fn fit(of: FitOf, assets: &Assets) -> Result<Fitted> {
    let FitOf { mut experiment, lens: Import { file: mut own, .. }, lens_name, sensor, pictures } = of;
    let cancel = assets.cancel();
    let refuse = |message: &str, hint: &str| DesignError::misfit(Path::new(lens_name), &message, hint);
    check_forms_an_image(&own.lens).map_err(|(message, hint)| refuse(message, hint))?;
    let (mut notes, mut warnings) = (Vec::new(), Vec::new());
    let given = own.clone();

    let title = own.lens.name.trim();
    experiment.name = if title.is_empty() {
        Path::new(lens_name).file_stem().unwrap_or_default().to_string_lossy().into_owned()
    } else {
        title.to_owned()
    };

    // Take the lens in the colours of its pictures.
    if let Some(note) = colours(&own.lens, &mut experiment.psf.wavelengths_um) {
        warnings.push(note);
    }
    let mut colours_um = experiment.psf.wavelengths_um.to_vec();
    colours_um.sort_by(f64::total_cmp);
    let in_colours = |lens: &Lens| Lens { wavelengths_um: colours_um.clone(), ..lens.clone() };

    // Focus over the fields of the file, to see how large its image is.
    let reach = field::reach(&in_colours(&own.lens), cancel)?.ok_or_else(|| {
        refuse(
            "no ray of any field reaches an image",
            "`petzval lens show` names the surface at which they are lost",
        )
    })?;
    warnings.extend(reach.warning());
    let picked = sensor::choose(&experiment.sensor, sensor, &reach, assets)?;

    // Surfaces without an edge of their own let the beams of the sensor's corner through.
    let corner_mm = sensor::corner_mm(&picked.model);
    let in_corner = |reach: &field::Reach, lens: &Lens| {
        field::at_corner(reach, lens, corner_mm).ok_or_else(|| {
            let message = format!(
                "the lens has no light {corner_mm:.2} mm from the axis, where the corner of `{}` lies; its image ends at {:.2} mm",
                picked.name, reach.circle_mm
            );
            let hint = match (reach.circle_mm > 0.01 * corner_mm, sensor.is_some()) {
                (false, _) => "no light of a field off the axis reaches its image: give the file a field that does",
                (true, true) => "name a smaller sensor, or none: its array then fits the lens",
                (true, false) => "name a smaller sensor: `petzval init --lens LENS --sensor NAME`",
            };
            DesignError::misfit(Path::new(lens_name), &message, hint)
        })
    };
    let roughly = in_corner(&reach, &own.lens)?.lens;

    // Focus for the sensor.
    cancel.check()?;
    let fields = field::of_equal_area(&in_colours(&reach.focused(&roughly)), corner_mm);
    let focused = focus::best(&in_colours(&roughly), &reach.lens, &fields).ok_or_else(|| {
        refuse("no ray of some field of the sensor reaches the image", "name a smaller sensor")
    })?;

    // Image circle and corner's field change with the image plane: state those of the lens that is written.
    let in_focus = own.lens.with_image_distance(focused.distance_mm);
    let reach = reach.in_plane_of(in_colours(&in_focus));
    let corner = in_corner(&reach, &in_focus)?;
    replace_lens(&mut own, corner.lens);
    notes.push(reach.in_words(&own.lens));
    notes.push(picked.in_words(&reach, lens_name));
    warnings.extend(corner.warnings);
    notes.extend(corner.notes);
    notes.extend(focused.note);

    // The image plane may move as far as a lens of this size needs.
    experiment.optics.defocus_mm = focus::range_mm(&own.lens, experiment.optics.defocus_mm);

    // A lens that moves keeps what it has: requirements beyond it would be violated from the start.
    notes.extend(limits::fit(&mut experiment.constraints, &own.lens));

    let in_colours = in_colours(&own.lens);
    notes.extend(grid::fit(&mut experiment.psf, &picked.model, &in_colours, cancel)?);
    notes.extend(grid::rays_or_waves(&mut experiment.psf, &picked.model, &in_colours, cancel)?);
    notes.extend(windows::fit(&mut experiment, pictures, &picked.model)?);
    warnings.extend(grid::lost_light(&experiment.psf, &picked.model, &in_colours, cancel)?);
    notes.extend(sensor::fit_exposure(&mut experiment.exposure, &picked));

    let usual = if own.variables.is_empty() { near_variables(&own.lens, &own.solves()) } else { None };
    let gave_variables = usual.is_some();
    if let Some((variables, solves)) = usual {
        own.give(variables, &solves);
        notes.push(variables_in_words(&own));
    }
    let moves = experiment.variants().iter().any(|variant| variant.steps_of(BlockName::Optics) > 0);
    if moves && own.variables.is_empty() {
        let is_toml = Path::new(lens_name).extension().is_none_or(|ending| ending == "toml");
        let first = if is_toml { "" } else { "`petzval lens convert` writes it as .toml: then " };
        let hint = format!("{first}give its file [[variable]] entries with bounds");
        return Err(refuse("the lens has no curved surface between two media that could be varied", &hint));
    }
    Ok(Fitted {
        changes_lens: own != given,
        gave_variables,
        lens: own,
        sensor_name: picked.name,
        changes_sensor: picked.is_fitted,
        sensor: picked.model,
        experiment,
        notes,
        warnings,
    })
}

/// Puts a lens with another image plane, or with one more field, into its file. What a source publishes holds for the lens as it was.
fn replace_lens(file: &mut LensFile, lens: Lens) {
    if file.lens == lens {
        return;
    }
    file.set_fields(lens.fields_deg.clone());
    file.lens = lens;
    file.expect = None;
}

/// Refuses lenses that make no picture on a sensor: message and hint.
fn check_forms_an_image(lens: &Lens) -> Result<(), (&'static str, &'static str)> {
    if !lens.is_rotationally_symmetric() {
        let hint = "leave tilts and decentres out; `petzval psf` shows the PSFs of such a lens";
        return Err(("the lens is not rotationally symmetric, and the camera of a design is", hint));
    }
    let order = first_order(&lens.at_wavelength(lens.reference_um));
    let has_image = paraxial_image_mm(lens).is_some();
    let light = if lens.light_goes_forwards(lens.surfaces.len() - 1) { 1.0 } else { -1.0 };
    if lens.object == ObjectDistance::Infinity
        && !order.efl_mm.is_finite()
        && leaves_parallel(lens) != [true; 2]
    {
        let hint = "the camera of a design needs a lens that images points";
        return Err((
            "the lens has no focal length: its rays meet at no paraxial focus, as those of an axicon do",
            hint,
        ));
    }
    if lens.object == ObjectDistance::Infinity && !has_image {
        let hint = "add the lens that focuses behind it to the file";
        return Err((
            "the lens is afocal: light from far away leaves it parallel, and makes no image on a sensor",
            hint,
        ));
    }
    if !has_image {
        let hint = "move the object away from the front focus";
        return Err((
            "the object lies at the front focus: its light leaves the lens parallel, and makes no image on a sensor",
            hint,
        ));
    }
    if light * order.image_distance_mm <= 0.0 {
        let hint = "a sensor needs an image behind the last surface";
        return Err(("the image is virtual: it lies in front of the last surface", hint));
    }
    Ok(())
}

/// Sets the wavelengths of red, green and blue to those of a lens that is not made for visible light; returns what to say then.
fn colours(lens: &Lens, wavelengths_um: &mut [f64; 3]) -> Option<String> {
    let list = &lens.wavelengths_um;
    let (first, last) = (*list.first()?, *list.last()?);
    let overlaps = first <= *VISIBLE_UM.end() && last >= *VISIBLE_UM.start();
    if overlaps {
        return None;
    }
    let middle = 0.5 * (first + last);
    let half = (0.5 * (last - first)).max(APART * middle);
    *wavelengths_um = [middle + half, middle, middle - half].map(grid::without_noise);
    let [red, green, blue] = *wavelengths_um;
    let range = if first < last { format!("{first} to {last}") } else { first.to_string() };
    Some(format!(
        "the lens is made for {range} um: psf.wavelengths_um = [{red}, {green}, {blue}] stand for red, green and blue, and the sensor is \
         one for visible light"
    ))
}

/// What a lens was given to move.
fn variables_in_words(file: &LensFile) -> String {
    let count = |is_it: &dyn Fn(Number) -> bool| file.variables.iter().filter(|v| is_it(v.number)).count();
    let parts = [
        (count(&|n| n == Number::Curvature), "curvature"),
        (count(&|n| n == Number::Thickness), "gap of air"),
        (count(&|n| n == Number::Conic), "conic constant"),
        (count(&|n| matches!(n, Number::Asphere(_) | Number::Departure(_))), "coefficient"),
    ];
    let named = parts.iter().filter(|(count, _)| *count > 0).map(|(count, name)| match (count, *name) {
        (1, name) => format!("1 {name}"),
        (n, "gap of air") => format!("{n} gaps of air"),
        (n, name) => format!("{n} {name}s"),
    });
    let solves = file.solves();
    let solved = solves.curvature().map_or(0, |(surface, _)| surface + 1);
    format!(
        "the file names no variables: it is given {}; the radius of surface {solved} holds {}",
        named.collect::<Vec<_>>().join(", "),
        solves.held_in_words()
    )
}
