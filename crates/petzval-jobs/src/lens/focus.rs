//! `lens focus`: moves the image plane of a lens, before the lens is looked at or in a file of its own.

use std::path::{Path, PathBuf};

use petzval_base::pasted;
use petzval_base::statistics::maximum;
use petzval_files::{LensFile, Loss};
use petzval_optics::analysis::{Cone, leaves_parallel, paraxial_image_mm};
use petzval_optics::lens::{Lens, ObjectDistance};
use petzval_optics::paraxial::first_order;
use petzval_optics::pupil::Quadrature;
use petzval_optics::solve::{
    mean_square_spots_of_colours, with_best_focus, with_best_focus_of_colours, with_paraxial_focus,
};
use petzval_optics::spot::mean_square_spot_traced;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::convert::write_as_named;
use super::lost::no_ray_at;
use crate::as_unit::{AsUnit, within};
use crate::context::Context;
use crate::error::{JobError, Result};
use crate::event::WarningKind;
use crate::input::LensInput;

/// Pupil cells a side of the best focus.
const PUPIL_CELLS: usize = 64;

/// How much smaller spots must be at best focus, as a share, for a lens to count as out of focus.
const OUT_OF_FOCUS: f64 = 0.5;

/// Where the image plane goes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FocusAt {
    /// Where the file puts it.
    #[default]
    File,
    /// At the paraxial image of the reference wavelength.
    Paraxial,
    /// Where the mean squared spot over the fields is least.
    Best,
}

petzval_base::parameters! {
    /// A lens to focus.
    pub struct Request {
        /// Lens: a built-in name, the path of a file, or the lens itself.
        lens: LensInput = LensInput::default();
        /// Where its image plane goes.
        focus: FocusAt = FocusAt::Best;
        /// The file to write, whose ending names the format; none to see the figures alone.
        to: Option<PathBuf> = None;
    }
}

/// Where the image plane was, and where it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// Name of the lens.
    pub name: String,
    /// From the last vertex to the image plane of the file, mm.
    pub image_distance_before_mm: f64,
    /// From the last vertex to the image plane as it is now, mm.
    pub image_distance_mm: f64,
    /// How far the image plane has moved, mm; positive away from the lens.
    #[serde(default)]
    pub moved_mm: f64,
    /// RMS spot radius over fields and wavelengths in the plane of the file, um; none if some field has no light there.
    pub rms_spot_before_um: Option<f64>,
    /// The same in the plane as it is now.
    pub rms_spot_um: Option<f64>,
    /// RMS spot radius over the fields of the wavelength whose spots are largest, about its own centroids, in the plane of the file, um; none for a
    /// lens with one wavelength, or if some field has no light there.
    pub largest_colour_spot_before_um: Option<f64>,
    /// The same in the plane as it is now.
    pub largest_colour_spot_um: Option<f64>,
    /// The file that was written.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub to: Option<PathBuf>,
    /// Properties of the lens that the new file does not represent.
    pub losses_of_writing: Vec<Loss>,
}

/// As a unit of work.
pub(crate) const UNIT: AsUnit<Request> = AsUnit::placed(|request, folder| {
    request.to = request.to.as_ref().map(|to| within(folder, to, "lens.toml"))
});

/// Focuses the lens, and writes it if a file is named.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    let (name, context) = &request.lens.placed(context)?;
    let file = context.assets.lens(name)?;
    let before = file.lens.clone();
    let lens = if request.focus == FocusAt::File {
        before.clone()
    } else {
        check_image(name, &before)?;
        // From a plane far away the spots are no guide: the paraxial focus is nearer.
        focused(with_paraxial_focus(&before, 0.0), request.focus)?
    };
    if request.focus == FocusAt::Best
        && let Some(said) = colours_out_of_focus(&lens)
    {
        context.warning(WarningKind::OutOfFocus, format!("{name}: {said}"));
    }
    let quadrature = Quadrature::grid(PUPIL_CELLS).map_err(|e| JobError::failed(e.to_string()))?;
    let fields: Vec<f64> = lens.fields_deg.iter().map(|f| f.to_radians()).collect();
    let rms_um = |lens: &Lens| Some(mean_square_spot_traced(lens, &fields, &quadrature)?.0.max(0.0).sqrt());
    let colour_um = |lens: &Lens| {
        let has_several = lens.wavelengths_um.len() > 1;
        has_several.then(|| largest_colour_um(lens, &fields, &quadrature)).flatten()
    };
    let mut response = Response {
        name: lens.name.clone(),
        image_distance_before_mm: before.image_distance_mm(),
        image_distance_mm: lens.image_distance_mm(),
        moved_mm: moved_mm(&before, &lens),
        rms_spot_before_um: rms_um(&before),
        rms_spot_um: rms_um(&lens),
        largest_colour_spot_before_um: colour_um(&before),
        largest_colour_spot_um: colour_um(&lens),
        to: request.to.clone(),
        losses_of_writing: Vec::new(),
    };
    if let Some(to) = &request.to {
        if is_virtual(&lens) {
            let message = format!(
                "{name}: the image is virtual: the plane of focus lies {:.4} mm in front of the last surface, where a file of a lens has no image plane",
                lens.image_distance_mm().abs()
            );
            return Err(JobError::input(message, "without a file to write, the figures are printed"));
        }
        // What a source publishes holds for its own image plane.
        let file = LensFile { lens, expect: None, ..file };
        response.losses_of_writing = write_as_named(&file, to, context)?.losses;
    }
    Ok(response)
}

/// The lens with its image plane there.
pub(super) fn focused(lens: Lens, focus: FocusAt) -> Result<Lens> {
    let refused = |said: &str| {
        let name = if focus == FocusAt::Best { "best" } else { "paraxial" };
        JobError::setting("focus", name, said, "--focus file leaves the image plane where the file puts it")
    };
    if focus == FocusAt::File {
        return Ok(lens);
    }
    if let Some(NoImage { reason, .. }) = no_image(&lens) {
        return Err(refused(reason));
    }
    if focus == FocusAt::Paraxial {
        return Ok(with_paraxial_focus(&lens, 0.0));
    }
    let quadrature = Quadrature::grid(PUPIL_CELLS).map_err(|e| JobError::failed(e.to_string()))?;
    let fields: Vec<f64> = lens.fields_deg.iter().map(|f| f.to_radians()).collect();
    with_best_focus(&lens, &fields, &quadrature).ok_or_else(|| {
        let is_dark = |field_rad: &f64| mean_square_spot_traced(&lens, &[*field_rad], &quadrature).is_none();
        let dark = fields.iter().position(is_dark).map(|field| no_ray_at(&lens, lens.fields_deg[field]));
        refused(dark.as_deref().unwrap_or("at some field no ray reaches the image"))
    })
}

/// What to say of a lens whose image plane is so far from its best focus that spots and modulation show little else; `None` if it is in focus, has no
/// focus, or blurs by diffraction more than by defocus. `name`: how the user calls the lens.
pub(super) fn out_of_focus(name: &str, lens: &Lens) -> Option<String> {
    Some(format!("{}, `--focus best` shows it so", focus_elsewhere(name, lens)?))
}

/// RMS spot radius over fields of the wavelength whose spots are largest, about its own centroid, um; `None` if some field has no light.
fn largest_colour_um(lens: &Lens, fields_rad: &[f64], quadrature: &Quadrature) -> Option<f64> {
    let squares = mean_square_spots_of_colours(lens, fields_rad, quadrature)?;
    Some(squares.into_iter().fold(0.0, maximum).sqrt())
}

/// What to say of a lens at its best focus that spreads wavelengths over the image, as a spectrometer does: spots about the common centroid of all
/// wavelengths are least where none of them is in focus. `None` if its wavelengths are in focus, or blur less than by diffraction.
pub(super) fn colours_out_of_focus(lens: &Lens) -> Option<String> {
    if lens.wavelengths_um.len() < 2 {
        return None;
    }
    let quadrature = Quadrature::grid(PUPIL_CELLS).ok()?;
    let fields: Vec<f64> = lens.fields_deg.iter().map(|f| f.to_radians()).collect();
    let of_colours = with_best_focus_of_colours(lens, &fields, &quadrature)?;
    let largest_um = |lens: &Lens| largest_colour_um(lens, &fields, &quadrature);
    let (here, there) = (largest_um(lens)?, largest_um(&of_colours)?);
    let airy_um = Cone::of(lens).airy_radius_um(lens.reference_um);
    (there < OUT_OF_FOCUS * here && here > airy_um).then(|| {
        format!(
            "the best focus is that of all wavelengths about their common centroid, and the lens spreads them apart: the spot of one wavelength \
             is up to {here:.1} um, and {there:.1} um with the image plane moved by {:+.4} mm; to focus single wavelengths, leave one of them in \
             [wavelengths]",
            moved_mm(lens, &of_colours)
        )
    })
}

/// [`colours_out_of_focus`] of a lens once it is focused; `None` if it has no focus.
pub(super) fn colours_out_of_best_focus(lens: &Lens) -> Option<String> {
    if no_image(lens).is_some() {
        return None;
    }
    colours_out_of_focus(&focused(with_paraxial_focus(lens, 0.0), FocusAt::Best).ok()?)
}

/// [`out_of_focus`] for verbs that have no choice of the focus.
pub(crate) fn focus_elsewhere(name: &str, lens: &Lens) -> Option<String> {
    let Defocus { moved_mm, rms_spot_um: here, best_rms_spot_um: there } = defocus(lens)?;
    let (by_mm, to) = (moved_mm.abs(), if moved_mm < 0.0 { "nearer" } else { "further away" });
    Some(format!(
        "out of focus: the RMS spot over the fields is {here:.1} um, and {there:.1} um where the image plane lies {by_mm:.4} mm {to}; \
         `petzval lens focus {} OUT.toml` writes the lens with its image plane there",
        pasted(Path::new(name))
    ))
}

/// An image plane so far from the best focus that spots and modulation show little else.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Defocus {
    /// From the image plane to the best focus, mm; positive away from the lens.
    pub moved_mm: f64,
    /// RMS spot radius over fields and wavelengths in the image plane, um.
    pub rms_spot_um: f64,
    /// The same at best focus, um.
    pub best_rms_spot_um: f64,
}

/// The defocus of a lens; `None` if it is in focus, has no focus, or blurs by diffraction more than by defocus.
pub(super) fn defocus(lens: &Lens) -> Option<Defocus> {
    if no_image(lens).is_some() {
        return None;
    }
    // From a plane far away the spots are no guide: the paraxial focus is nearer.
    let best = focused(with_paraxial_focus(lens, 0.0), FocusAt::Best).ok()?;
    let quadrature = Quadrature::grid(PUPIL_CELLS).ok()?;
    let fields: Vec<f64> = lens.fields_deg.iter().map(|f| f.to_radians()).collect();
    let rms_um = |lens: &Lens| Some(mean_square_spot_traced(lens, &fields, &quadrature)?.0.max(0.0).sqrt());
    let (here, there) = (rms_um(lens)?, rms_um(&best)?);
    let airy_um = Cone::of(lens).airy_radius_um(lens.reference_um);
    // A plane in front of the last surface can hold no sensor.
    if is_virtual(&best) {
        return None;
    }
    let moved_mm = moved_mm(lens, &best);
    (there < OUT_OF_FOCUS * here && here > airy_um).then_some(Defocus {
        moved_mm,
        rms_spot_um: here,
        best_rms_spot_um: there,
    })
}

/// From the image plane of a lens to that of the same lens `there`, mm; positive away from the lens.
fn moved_mm(lens: &Lens, there: &Lens) -> f64 {
    lens.away_from_lens_mm(there.image_distance_mm() - lens.image_distance_mm())
}

/// Whether light has to go back to reach the image plane.
fn is_virtual(lens: &Lens) -> bool {
    lens.goes_against_the_light(lens.surfaces.len() - 1)
}

/// Whether the plane of best focus lies in front of the last surface, as that of a lens with a virtual image does.
pub(super) fn is_virtual_at_best(lens: &Lens) -> bool {
    focused(with_paraxial_focus(lens, 0.0), FocusAt::Best).is_ok_and(|best| is_virtual(&best))
}

/// What to say of a lens whose paraxial image lies where no image plane can be.
pub(super) fn virtual_image(lens: &Lens) -> Option<&'static str> {
    let direction = if lens.light_goes_forwards(lens.surfaces.len() - 1) { 1.0 } else { -1.0 };
    let is_virtual = paraxial_image_mm(lens)? * direction < 0.0;
    is_virtual.then_some("the paraxial image is virtual: it lies in front of the last surface")
}

/// Why a lens has no entrance pupil or no image at a finite distance, from which analyses and tolerances start.
pub(super) struct NoImage {
    /// What the lens is.
    pub reason: &'static str,
    /// What to do.
    pub hint: &'static str,
}

/// [`NoImage`] of a lens; `None` if it has both.
pub(super) fn no_image(lens: &Lens) -> Option<NoImage> {
    let order = first_order(&lens.at_wavelength(lens.reference_um));
    if order.stop_radius_mm == 0.0 {
        let reason = match lens.object {
            ObjectDistance::Infinity => {
                "the stop is at the focus of what is in front of it: the entrance pupil of a far object is at infinity"
            }
            ObjectDistance::Finite(_) => {
                "the lens is telecentric on the side of its object: its entrance pupil is at infinity"
            }
        };
        return Some(NoImage {
            reason,
            hint: "move the stop a little off the focus of what is in front of it",
        });
    }
    if paraxial_image_mm(lens).is_some() {
        return None;
    }
    let reason = image_at_infinity(lens, order.image_distance_mm);
    // What to do depends on where real rays go.
    let hint = match leaves_parallel(lens) {
        [true, true] => "a thin lens of known focal length behind it makes an image of parallel light",
        [false, true] => {
            "its power lies in x: exchange x and y of its surfaces; `lens show` and `lens trace` take it as it is"
        }
        [_, false] => {
            "its rays meet at no paraxial focus, as those of an axicon do; `lens show` and `lens trace` take it"
        }
    };
    Some(NoImage { reason, hint })
}

/// Why the paraxial image of a lens is at infinity, or as good as there: at a distance of so many mm.
pub(super) fn image_at_infinity(lens: &Lens, image_distance_mm: f64) -> &'static str {
    match (lens.object, image_distance_mm.is_finite()) {
        (ObjectDistance::Infinity, false) => "the lens is afocal in the y-z plane: it has no focus",
        (ObjectDistance::Infinity, true) => {
            "the lens is so nearly afocal that light leaves it parallel: it has no focus within reach"
        }
        (ObjectDistance::Finite(_), false) => "the object is at the front focus: its image is at infinity",
        (ObjectDistance::Finite(_), true) => {
            "the object is so near the front focus that light leaves the lens parallel: its image is out of reach"
        }
    }
}

/// Refuses a lens that has no entrance pupil or no image at a finite distance.
pub(super) fn check_image(name: &str, lens: &Lens) -> Result<()> {
    no_image(lens)
        .map_or(Ok(()), |NoImage { reason, hint }| Err(JobError::input(format!("{name}: {reason}"), hint)))
}
