//! `lens focus`: moves the image plane of a lens, before the lens is looked at or in a file of its own.

use std::path::PathBuf;

use petzval_files::{LensFile, Loss};
use petzval_optics::lens::Lens;
use petzval_optics::pupil::Quadrature;
use petzval_optics::solve::{with_best_focus, with_paraxial_focus};
use petzval_optics::spot::mean_square_spot_traced;
use serde::{Deserialize, Serialize};

use super::convert::write_as_named;
use crate::context::Context;
use crate::error::JobError;

/// Pupil cells a side of the best focus.
const PUPIL_CELLS: usize = 64;

/// Where the image plane goes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
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

/// A lens to focus.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// Lens file, or a built-in name.
    pub lens: String,
    /// Where its image plane goes.
    pub focus: FocusAt,
    /// The file to write, whose ending names the format; none to see the figures alone.
    #[serde(default)]
    pub to: Option<PathBuf>,
}

/// Where the image plane was, and where it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Response {
    /// Name of the lens.
    pub name: String,
    /// From the last vertex to the image plane of the file, mm.
    pub image_distance_before_mm: f64,
    /// From the last vertex to the image plane as it is now, mm.
    pub image_distance_mm: f64,
    /// RMS spot radius over fields and wavelengths in the plane of the file, um; none if some field has no light there.
    pub rms_spot_before_um: Option<f64>,
    /// The same in the plane as it is now.
    pub rms_spot_um: Option<f64>,
    /// The file that was written.
    pub to: Option<PathBuf>,
    /// Properties of the lens that the new file does not represent.
    pub losses_of_writing: Vec<Loss>,
}

/// Focuses the lens, and writes it if a file is named.
pub fn run(request: &Request, context: &Context) -> Result<Response, JobError> {
    let file = context.assets.lens(&request.lens)?;
    let before = file.lens.clone();
    // From a plane far away the spots are no guide: the paraxial focus is nearer.
    let start = match request.focus {
        FocusAt::File => before.clone(),
        FocusAt::Paraxial | FocusAt::Best => with_paraxial_focus(&before, 0.0),
    };
    let lens = focused(start, request.focus)?;
    if !lens.image_distance_mm().is_finite() {
        return Err(JobError::input(
            format!("{}: the lens has no focus: its light leaves it parallel", request.lens),
            "an afocal lens needs another lens behind it",
        ));
    }
    let quadrature = Quadrature::grid(PUPIL_CELLS).map_err(|e| JobError::failed(e.to_string()))?;
    let fields: Vec<f64> = lens.fields_deg.iter().map(|f| f.to_radians()).collect();
    let rms_um =
        |lens: &Lens| Some(1e3 * mean_square_spot_traced(lens, &fields, &quadrature)?.0.max(0.0).sqrt());
    let mut response = Response {
        name: lens.name.clone(),
        image_distance_before_mm: before.image_distance_mm(),
        image_distance_mm: lens.image_distance_mm(),
        rms_spot_before_um: rms_um(&before),
        rms_spot_um: rms_um(&lens),
        to: request.to.clone(),
        losses_of_writing: Vec::new(),
    };
    if let Some(to) = &request.to {
        // What a source publishes holds for its own image plane.
        let file = LensFile { lens, expect: None, ..file };
        response.losses_of_writing = write_as_named(&file, to, context)?.losses;
    }
    Ok(response)
}

/// The lens with its image plane there.
pub(super) fn focused(lens: Lens, focus: FocusAt) -> Result<Lens, JobError> {
    match focus {
        FocusAt::File => Ok(lens),
        FocusAt::Paraxial => Ok(with_paraxial_focus(&lens, 0.0)),
        FocusAt::Best => {
            let quadrature = Quadrature::grid(PUPIL_CELLS).map_err(|e| JobError::failed(e.to_string()))?;
            let fields: Vec<f64> = lens.fields_deg.iter().map(|f| f.to_radians()).collect();
            with_best_focus(&lens, &fields, &quadrature).ok_or_else(|| {
                JobError::setting(
                    "focus",
                    "best",
                    "at some field no ray reaches the image",
                    "--focus file leaves the image plane where the file puts it",
                )
            })
        }
    }
}
