//! How far from the axis a lens makes an image.

use petzval_base::{Cancel, Cancelled};
use petzval_files::with_open_surfaces;
use petzval_optics::lens::Lens;
use petzval_optics::paraxial::first_order;
use petzval_optics::pupil::{Quadrature, chief_ray};
use petzval_optics::spot::spot;

use super::focus;
use crate::lens::psf_plan::field_angle;

/// Pupil cells a side where light is looked for.
const CELLS: usize = 24;

/// Image radii of equal areas over which a lens is focused.
const FIELDS: usize = 7;

/// Least relative illumination that counts as light.
const DARK: f64 = 0.02;

/// Shares of its outermost field at which a lens whose rays do not arrive there is tried.
const SHARES: usize = 40;

/// The image of a lens as its file states it.
pub(super) struct Reach {
    /// The lens, about in focus.
    pub lens: Lens,
    /// The outermost field with an image, degrees; 0 if the file names none off the axis.
    pub field_deg: f64,
    /// The outermost field of the file, degrees.
    pub stated_deg: f64,
    /// Radius of the image there, mm; 0 if the file names no field off the axis.
    pub circle_mm: f64,
}

/// The image of a lens up to the outermost field of its file; `None` if none has light. Ends with [`Cancelled`] before the next field once `cancel` is
/// set.
pub(super) fn reach(lens: &Lens, cancel: &Cancel) -> Result<Option<Reach>, Cancelled> {
    let stated_deg = lens.outermost_field_deg();
    for k in 0..SHARES {
        cancel.check()?;
        let field_deg = stated_deg * (1.0 - k as f64 / SHARES as f64);
        let shares = [0.0, 0.5, 0.7, 0.85, 1.0];
        let fields = shares.map(|share| (share * field_deg).to_radians());
        let focused = focus::roughly(lens, &fields);
        if let Some(circle_mm) = lit_mm(&focused, field_deg.to_radians()) {
            return Ok(Some(Reach { lens: focused, field_deg, stated_deg, circle_mm }));
        }
        if stated_deg == 0.0 {
            return Ok(None);
        }
    }
    Ok(None)
}

/// The radius at which a field is imaged, mm, if light arrives there.
fn lit_mm(lens: &Lens, field_rad: f64) -> Option<f64> {
    let chief = chief_ray(&lens.at_wavelength(lens.reference_um), field_rad)?;
    let light = spot(lens, field_rad, &Quadrature::grid(CELLS).ok()?)?.illumination;
    light.iter().all(|light| *light > DARK).then_some(chief.y_mm.abs())
}

impl Reach {
    /// The same lens with other apertures, as far from its last vertex as this one is in focus.
    pub fn focused(&self, lens: &Lens) -> Lens {
        lens.with_image_distance(self.lens.image_distance_mm())
    }

    /// The same fields in the image plane of a lens.
    pub fn in_plane_of(self, lens: Lens) -> Self {
        let circle_mm = lit_mm(&lens, self.field_deg.to_radians()).unwrap_or(self.circle_mm);
        Self { lens, circle_mm, ..self }
    }

    /// Focal length, f-number and image circle.
    pub fn in_words(&self, lens: &Lens) -> String {
        let order = first_order(&lens.at_wavelength(lens.reference_um));
        let scale = format!("focal length {:.2} mm, f/{:.2}", order.efl_mm, order.f_number.abs());
        match self.circle_mm {
            0.0 => format!("lens: {scale}; the file names no field off the axis"),
            circle => {
                let digits = if self.field_deg < 1.0 { 3 } else { 1 };
                format!(
                    "lens: {scale}; fields to {:.digits$} degrees, an image circle of {circle:.2} mm radius",
                    self.field_deg
                )
            }
        }
    }

    /// Fields of the file whose light does not arrive.
    pub fn warning(&self) -> Option<String> {
        (self.field_deg < self.stated_deg).then(|| {
            format!(
                "no light of the outermost field of the file, {} degrees, reaches the image: fields to {:.1} degrees count",
                self.stated_deg, self.field_deg
            )
        })
    }
}

/// The lens with light in the corner of a sensor.
pub(super) struct Corner {
    /// The lens.
    pub lens: Lens,
    pub notes: Vec<String>,
    pub warnings: Vec<String>,
}

/// The lens of a file with the field of a sensor's corner, in the image plane of `reach`. If the corner lies beyond the file's fields, open surfaces grow
/// for its beams. `None` if no light gets there.
pub(super) fn at_corner(reach: &Reach, lens: &Lens, corner_mm: f64) -> Option<Corner> {
    let field_rad = field_angle(&reach.lens, corner_mm).ok()?;
    let field_deg = field_rad.to_degrees().abs();
    let (mut notes, mut warnings) = (Vec::new(), Vec::new());
    let mut found = lens.clone();
    // A thousandth beyond the outermost field is the same field.
    if field_deg > 1.001 * reach.stated_deg {
        let inner = lens.fields_deg.iter().copied().filter(|field| field.abs() < field_deg);
        let inner: Vec<f64> =
            if reach.stated_deg == 0.0 { vec![0.0, 0.7 * field_deg] } else { inner.collect() };
        found.fields_deg = inner.into_iter().chain([field_deg]).collect();
        let open: Vec<usize> = (0..lens.surfaces.len()).filter(|i| lens.surfaces[*i].is_open).collect();
        if !open.is_empty() {
            let grown = with_open_surfaces(&found, &open);
            match grown {
                Ok((lens, losses, None)) => {
                    found = lens;
                    warnings.extend(losses.into_iter().map(|loss| loss.message));
                }
                _ => {
                    warnings.push("its surfaces cannot grow for the beams of the sensor's corner".to_owned())
                }
            }
        }
        notes.push(format!(
            "fields: the sensor's corner sees {field_deg:.1} degrees, which the lens file now names"
        ));
    }
    let lit = lit_mm(
        &reach.focused(&Lens { wavelengths_um: reach.lens.wavelengths_um.clone(), ..found.clone() }),
        field_rad,
    );
    lit.map(|_| Corner { lens: found, notes, warnings })
}

/// Fields of equal areas of a circle around the sensor, rad; fields without an image are left out.
pub(super) fn of_equal_area(lens: &Lens, corner_mm: f64) -> Vec<f64> {
    let radius = |i: usize| corner_mm * ((i as f64 + 0.5) / FIELDS as f64).sqrt();
    (0..FIELDS).filter_map(|i| field_angle(lens, radius(i)).ok()).collect()
}
