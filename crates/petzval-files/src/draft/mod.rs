//! The lens of another program's file before its conversion to a [`Lens`]: coordinate breaks among the surfaces, any kind of
//! aperture and fields, surfaces without clear semi-diameters.
//!
//! The reader of a format fills a [`Draft`]. [`Draft::finish`] converts it to a lens, or names the line that prevents it.

mod aperture;
mod clear;
mod field;
mod idle;
mod item;
mod offset;
mod place;
mod power;
mod record;
mod telecentric;
mod wavelengths;

pub(super) use aperture::{AS_WIDE, Aperture, rounded};
pub use clear::with_open_surfaces;
use clear::with_semi_diameters;
pub(super) use field::{FieldKind, Fields};
pub(super) use item::{Break, Clear, Drafted, Item, Offset, Places};
pub(super) use place::{check_angles, is_bend, undone};
pub(super) use power::{in_mm, set_powers};
pub(super) use record::{Record, line_end};
pub(super) use telecentric::{FAR_PUPIL, has_pupil_at_infinity, with_stop_beside_focus};
pub(super) use wavelengths::{Wave, Wavelengths};

use super::loss::{Loss, Losses};
use crate::impossible::{Culprit, hint, measured_surfaces};
use petzval_base::FileError;

use super::LensFile;
use petzval_optics::lens::{Lens, LensDefect, ObjectDistance, traceable};

/// Largest number of surfaces in a file. Real lenses have less than a tenth of it.
pub(super) const MOST_SURFACES: usize = 500;

/// Largest number of wavelengths, and of fields, in a file.
pub(super) const MOST_VALUES: usize = 100;

/// Largest size of a file, bytes.
pub(super) const MOST_BYTES: usize = 16 << 20;

/// Refuses a file above [`MOST_BYTES`].
pub(super) fn check_size(text: &str) -> Result<(), FileError> {
    if text.len() > MOST_BYTES {
        return Err(
            Record::default().error(format!("a lens file of more than {} MB is not read", MOST_BYTES >> 20))
        );
    }
    Ok(())
}

/// The loss of an afocal image space.
pub(super) const AFOCAL_IMAGE_SPACE: &str =
    "afocal image space: the image plane stays where the file places it";

/// Distance from which an object counts as infinitely far, mm: CODE V writes this number for infinity.
pub(super) const FAR_MM: f64 = 1e10;

/// A lens that was read from a file, and the losses of the conversion if the file is another program's.
#[derive(Clone, Debug, PartialEq)]
pub struct Import {
    /// The lens. One of another program has no variables, because their variables have no bounds.
    pub file: LensFile,
    /// Everything in the file that the lens does not represent.
    pub losses: Vec<Loss>,
    /// Why the lens cannot be built, at the place in the file: glass thinner than nothing, or surfaces that cross. An optimisation may start from
    /// such a lens.
    pub unbuildable: Option<FileError>,
}

impl Import {
    /// The import, if its lens can be built.
    pub fn buildable(self) -> Result<Self, FileError> {
        match self.unbuildable {
            None => Ok(self),
            Some(error) => Err(error),
        }
    }
}

/// The content of a file, in the terms of the file (see the module).
#[derive(Clone, Debug)]
pub(super) struct Draft {
    pub name: String,
    pub source: String,
    pub items: Vec<Item>,
    /// Index of the stop in `items`.
    pub stop: usize,
    pub aperture: (Aperture, Record),
    /// Distance from the object to the first vertex, mm; may be infinite.
    pub object: (f64, Record),
    pub wavelengths: Wavelengths,
    /// Index of the reference wavelength.
    pub reference: usize,
    pub fields: Fields,
    /// Whether to place the image plane at the paraxial image: the file has a solve without a stored value.
    pub at_paraxial_focus: bool,
}

impl Draft {
    /// Converts the draft to a lens. Errors name the record at fault.
    pub fn finish(self, mut losses: Losses) -> Result<Import, FileError> {
        // Turn coordinate breaks into placements, and collect surfaces, wavelengths and object.
        let (mut drafted, stop) = place::lower(self.items, self.stop)?;
        let mut object_mm = self.object.0;
        let stop = idle::without_idle_planes(&mut drafted, stop, &mut object_mm, &mut losses);
        if drafted.is_empty() {
            return Err(Record::default().error("there is no surface between object and image"));
        }
        let (wavelengths_um, reference_um) = self.wavelengths.of_lens(self.reference, &mut losses)?;
        let object = match object_mm {
            far if far.abs() >= FAR_MM => ObjectDistance::Infinity,
            near if near != 0.0 && !near.is_nan() => ObjectDistance::Finite(near),
            _ => return Err(self.object.1.error("the object must lie apart from the first surface")),
        };
        let mut lens = Lens {
            name: self.name,
            source: self.source,
            surfaces: drafted.iter().map(|d| d.surface.clone()).collect(),
            stop,
            entrance_pupil_mm: 1.0,
            object,
            wavelengths_um,
            reference_um,
            fields_deg: vec![0.0],
        };
        let at_fault = |defect: &LensDefect, drafted: &[Drafted]| at_fault(defect, drafted, &self.aperture.1);
        // Check the lens before first-order optics computes aperture, fields and semi-diameters from it.
        traceable(&opened(&lens)).map_err(|defect| at_fault(&defect, &drafted))?;
        if self.at_paraxial_focus {
            lens = petzval_optics::solve::with_paraxial_focus(&lens, 0.0);
        }
        lens = telecentric::off_the_focus(lens, &drafted, &mut losses);
        if lens.object == ObjectDistance::Infinity && has_pupil_at_infinity(&lens) {
            return Err(drafted[stop].record.error(FAR_PUPIL).hint("move the stop off that focus"));
        }
        lens.entrance_pupil_mm = aperture::entrance_pupil_mm(&lens, &self.aperture, drafted[stop].clear)?;
        let (mut lens, drafted) = offset::with_planes(lens, drafted, &self.fields, &mut losses);
        lens.entrance_pupil_mm = aperture::within_stop(&lens, &drafted[lens.stop], &mut losses);
        let (fields_deg, field_weights) = field::angles_deg(&lens, &self.fields, &mut losses)?;
        lens.fields_deg = fields_deg;
        if let Some(record) = &self.fields.telecentric {
            field::check_telecentric(&lens, &lens.fields_deg, record, &mut losses)?;
        }
        let clears: Vec<Clear> = drafted.iter().map(|d| d.clear).collect();
        let (lens, flaw) =
            with_semi_diameters(lens, &clears, &mut losses).map_err(|defect| at_fault(&defect, &drafted))?;
        let unbuildable = flaw.map(|defect| at_fault(&defect, &drafted));
        let file = LensFile { field_weights, ..LensFile::of(lens) };
        Ok(Import { file, losses: losses.into_list(), unbuildable })
    }
}

/// The lens with semi-diameters so small that surfaces do not end within them.
fn opened(lens: &Lens) -> Lens {
    let mut open = lens.clone();
    for surface in &mut open.surfaces {
        surface.semi_diameter_mm = 1e-9;
    }
    open
}

/// The error for a defect of the lens, at the record of what the defect is about. `aperture` is the record of the aperture.
fn at_fault(defect: &LensDefect, drafted: &[Drafted], aperture: &Record) -> FileError {
    let follows_beam =
        measured_surfaces(defect).into_iter().filter_map(|i| drafted.get(i)).any(Drafted::follows_beam);
    let surface = defect.surface().and_then(|number| drafted.get(number - 1));
    let record = surface.map(|surface| surface.record_of(Culprit::of(defect), aperture).clone());
    let error = record.unwrap_or_default().error(format!("this lens is impossible: {defect}"));
    error.hint(hint(defect, follows_beam))
}
