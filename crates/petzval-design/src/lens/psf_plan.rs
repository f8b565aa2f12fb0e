//! Where optics meets the picture: the PSFs that a lens gives the renderer, and the lens gradient that follows from a loss's
//! derivatives by them. The tape of the tensor framework ends here.

use std::f64::consts::{FRAC_PI_4, PI};

use petzval_base::Cancel;
use petzval_base::statistics::{maximum, minimum};
use petzval_camera::psf::PsfBank;
use petzval_camera::render::{Distortion, RenderError, RenderGeometry};
use petzval_camera::sensor::SensorModel;
use petzval_optics::gradient::LensGradient;
use petzval_optics::lens::{Lens, ObjectDistance};
use petzval_optics::paraxial::image_height_per_tangent;
use petzval_optics::psf::{
    FieldPsf, PerfectImage, PsfCotangent, PsfKind, PsfMethod, PsfOptions, PsfTape, focused_thin_lens_mm,
    perfect_psf, psf_converged, psf_with_tape,
};
use petzval_optics::pupil::{PupilRefinement, Quadrature, chief_ray, field_imaged_at};
use petzval_optics::trace::Sequence;
use petzval_optics::wave::NoWaves;
use rayon::prelude::*;

use crate::error::{DesignError, Result};
use crate::experiment::{PsfConfig, PsfsBy};

/// The fields, wavelengths and grids on which a lens is turned into PSFs.
#[derive(Clone, Debug)]
pub struct PsfPlan {
    /// Image radii of the fields, mm, from 0 to the sensor's corner: where their chief rays land.
    pub field_radius_mm: Vec<f64>,
    /// Field angles that are traced whatever the lens, rad; the radii of the bank are then those at which their chief rays land.
    /// Without them the angles are those which each lens images at the radii.
    pub held_fields_rad: Option<Vec<f64>>,
    /// Wavelengths of the red, green and blue channel, um.
    pub wavelengths_um: [f64; 3],
    /// The grid of each PSF.
    pub options: PsfOptions,
    /// The pupil's quadrature.
    pub quadrature: Quadrature,
    /// What a lens without aberrations makes of a point.
    pub perfect_image: PerfectImage,
    /// What is done, where PSFs are by waves, at a field of which no wave can be computed.
    pub rough_fields: RoughFields,
}

/// Fields of which no wave can be computed: rays through the stop are lost, or the wavefront is too rough for polynomials.
#[derive(Clone, Debug, PartialEq)]
pub enum RoughFields {
    /// They are an error.
    Refused,
    /// Their PSFs are by rays, whatever the lens.
    ByRays,
    /// PSFs of the fields that are marked are by rays, and those of all others by waves: what changes with the lens does so without jumps.
    Held(Vec<bool>),
}

/// PSFs of every field, with what their gradient needs.
pub struct BankWithTape {
    /// The renderer's input.
    pub bank: PsfBank,
    /// The pattern of a lens without aberrations has no tape: it does not change.
    fields: Vec<(FieldPsf, Option<PsfTape>)>,
    surfaces: usize,
}

impl PsfConfig {
    /// The plan for a sensor, with `cells` cells across the pupil. The image of a lens without aberrations is that of the kind,
    /// and PSFs of rough fields are by rays.
    pub fn plan(&self, sensor: &SensorModel, cells: usize) -> Result<PsfPlan> {
        let corner_mm = 0.5e-3 * sensor.pixel_um * (sensor.height as f64).hypot(sensor.width as f64);
        let options = PsfOptions { grid: self.grid, pitch_um: self.pitch_um, kind: self.kind.traced() };
        let plan =
            PsfPlan::new(self.fields, corner_mm, self.wavelengths_um, options, Quadrature::grid(cells)?);
        Ok(PsfPlan {
            perfect_image: PerfectImage::of(self.kind.traced()),
            rough_fields: RoughFields::ByRays,
            ..plan
        })
    }

    /// What to say of PSFs whose grid holds no more than a share `captured` of their light at some place, the field `at_deg` if it is known; `None` if it
    /// holds nearly all.
    pub fn lost_light(&self, captured: f64, at_deg: Option<f64>) -> Option<String> {
        (captured < LEAST_CAPTURED).then(|| {
            let place = at_deg
                .map_or_else(|| "somewhere in the field".to_owned(), |deg| format!("at {deg:.1} degrees"));
            format!(
                "the PSF grid of {:.0} um cuts off {:.0} % of the light {place}, so pictures are too sharp there",
                self.grid as f64 * self.pitch_um,
                100.0 * (1.0 - captured)
            )
        })
    }

    /// Warning for a camera that computes the PSFs of a share `by_rays` of its fields by rays although waves were requested; `None` if
    /// there are no such fields. `no_waves` is that of its lens, if the lens is known.
    pub fn rough_fields(&self, by_rays: f64, no_waves: Option<NoWaves>) -> Option<String> {
        let why = no_waves.map_or_else(|| ROUGH.to_owned(), |no_waves| no_waves.to_string());
        (self.kind == PsfsBy::Diffraction && by_rays > 0.0).then(|| {
            format!(
                "PSFs of {:.0} % of the fields are by rays: no wave can be computed there, because {why}",
                100.0 * by_rays
            )
        })
    }

    /// The pixels of a sensor and the patches of constant PSF on it.
    pub fn geometry(&self, sensor: &SensorModel) -> RenderGeometry {
        let [rows, columns] = self.patches;
        RenderGeometry {
            sensor_height: sensor.height,
            sensor_width: sensor.width,
            pixel_um: sensor.pixel_um,
            patches: (rows, columns),
        }
    }
}

impl BankWithTape {
    /// Least share of a PSF's light that its grid holds, over fields and colours.
    pub fn captured(&self) -> f64 {
        self.least_captured().0
    }

    /// The same, with the field where it is least, rad; a share that is no number is the least of all.
    pub fn least_captured(&self) -> (f64, f64) {
        let least = |a: (f64, f64), b: (f64, f64)| if b.0.is_nan() || b.0 < a.0 { b } else { a };
        self.captured_by_field().fold((1.0, 0.0), least)
    }

    /// The least share over the colours at the field where it is largest.
    pub fn most_captured(&self) -> f64 {
        self.captured_by_field().map(|(captured, _)| captured).fold(0.0, maximum)
    }

    /// The least share over the colours of each field, rad.
    fn captured_by_field(&self) -> impl Iterator<Item = (f64, f64)> {
        self.fields.iter().map(|(psf, _)| (psf.captured.iter().copied().fold(1.0, minimum), psf.field_rad))
    }

    /// Of each field, whether its PSFs are by rays in whole or in part.
    fn fields_by_rays(&self) -> Vec<bool> {
        let is_by_rays = |(psf, _): &(FieldPsf, Option<PsfTape>)| {
            psf.method.iter().any(|m| matches!(m, PsfMethod::Polynomial { .. } | PsfMethod::Traced))
        };
        self.fields.iter().map(is_by_rays).collect()
    }

    /// Share of the fields whose PSFs are by rays in whole or in part.
    pub fn by_rays(&self) -> f64 {
        let fields = self.fields_by_rays();
        fields.iter().filter(|by_rays| **by_rays).count() as f64 / fields.len().max(1) as f64
    }
}

/// Why no wave can be computed at a field of a lens that is not at hand.
const ROUGH: &str = "rays through the stop are lost, the wavefront is too rough, or a surface is a thin lens";

/// Least share of a PSF's light that its grid must hold to count as all.
const LEAST_CAPTURED: f64 = 0.98;

/// Least share of a PSF's light that its grid must hold to be an image; below, pictures show little of the lens.
pub const LEAST_IMAGE: f64 = 0.5;

/// Fields at which the number of pupil cells is chosen.
const CHECKED_FIELDS: usize = 7;

/// Pupil cells a side up to which they are doubled, unless a plan begins with more. With so many a PSF takes a hundred times as long as
/// with 200.
const MOST_CELLS: usize = 2048;

/// Field, as a share of the outermost, at which the scale of the image is taken. Distortion grows with the square of the field, so there
/// it is a millionth of that at the corner.
const NEAR_AXIS: f64 = 1e-3;

/// Distance, mm, to which a chief ray lands at its radius.
const LANDS_MM: f64 = 1e-6;

/// Change of the field by which the slope of the image height is taken, rad.
const SLOPE_RAD: f64 = 1e-4;

/// Field from which the next one is guessed by the angle rather than by its tangent: 45 degrees.
const WIDE_RAD: f64 = FRAC_PI_4;

/// Widest field of a rectilinear picture, rad: 85 degrees, at 11 times the height of 45 degrees.
const WIDEST_PICTURE_RAD: f64 = 85.0 / 180.0 * PI;

/// Paraxial image height per tangent of the field, mm: the EFL f or, for a near object at D, `D / w'` with w' the final slope of its
/// paraxial ray of slope 1. Searches for fields begin with it.
fn paraxial_scale_mm(lens: &Lens) -> f64 {
    let per_tangent = image_height_per_tangent(&lens.at_wavelength(lens.reference_um));
    // The real image of a near object is upside down; its field at the same distance from the axis on the other side is taken.
    if lens.object == ObjectDistance::Infinity { per_tangent } else { per_tangent.abs() }
}

/// The field that a lens images on the axis of the image plane, rad: the field of radius 0. `None` if no such field is found.
///
/// It is exactly 0 in a rotationally symmetric lens, and wherever the chief ray of field 0 lands on the axis. Gratings, prisms and decentred
/// elements move the image: another field then lands on the axis. Of an image that lies beside the axis in x, the height y counts.
fn axis_field(lens: &Lens, reference: &Sequence) -> Option<f64> {
    if lens.is_rotationally_symmetric() {
        return Some(0.0);
    }
    let height = |field: f64| Some(chief_ray(reference, field)?.y_mm);
    if height(0.0).is_some_and(|y_mm| y_mm.abs() < LANDS_MM) {
        return Some(0.0);
    }
    // Of field 0 and the fields of the file, take the one whose image is nearest to the axis, and follow the slope there.
    let known = lens.fields_deg.iter().map(|deg| deg.to_radians()).chain([0.0]);
    let landed = known.filter_map(|field| Some((field, height(field)?)));
    let (field, y_mm) = landed.min_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
    let slope = (height(field + SLOPE_RAD)? - height(field - SLOPE_RAD)?) / (2.0 * SLOPE_RAD);
    field_imaged_at(reference, 0.0, field - y_mm / slope)
}

/// Field angle of a lens whose chief ray lands `radius_mm` from the axis, rad, distortion included.
pub(crate) fn field_angle(lens: &Lens, radius_mm: f64) -> Result<f64> {
    let reference = lens.at_wavelength(lens.reference_um);
    let axis = axis_field(lens, &reference);
    let guess = axis.unwrap_or(0.0) + (radius_mm / paraxial_scale_mm(lens)).atan();
    field_imaged(&reference, axis, radius_mm, guess)
}

/// Image height per tangent of the field, mm, which an ideal image has everywhere: that of the lens near the axis of the image. Chief
/// rays go to the image plane where it stands, in focus or not. `None` if the outermost field, rad, lies on the axis.
pub fn image_scale_mm(lens: &Lens, outermost_rad: f64) -> Result<Option<f64>> {
    let reference = lens.at_wavelength(lens.reference_um);
    let axis = axis_field(lens, &reference).unwrap_or(0.0);
    let near = (outermost_rad - axis) * NEAR_AXIS;
    if near == 0.0 {
        return Ok(None);
    }
    let height = |field: f64| {
        let chief = chief_ray(&reference, field);
        Ok::<_, DesignError>(chief.ok_or_else(|| DesignError::no_light(lens, field, &[]))?.y_mm)
    };
    // A rotationally symmetric lens mirrors its chief rays, so one of them is enough.
    if lens.is_rotationally_symmetric() {
        return Ok(Some(height(near)? / near.tan()));
    }
    let (below, above) = (axis - near, axis + near);
    Ok(Some((height(above)? - height(below)?) / (above.tan() - below.tan())))
}

/// [`image_scale_mm`] as a bank of PSFs states it. Its radii have no sign, so an image that is upside down has its scale without one,
/// too. `None` if the lens has none.
pub fn scale_of_bank_mm(lens: &Lens, outermost_rad: f64) -> Option<f64> {
    let scale_mm = image_scale_mm(lens, outermost_rad).ok().flatten()?.abs();
    (scale_mm.is_finite() && scale_mm > 0.0).then_some(scale_mm)
}

/// The field imaged at a radius; `axis` is the one imaged on the axis, if there is one.
fn field_imaged(reference: &Sequence, axis: Option<f64>, radius_mm: f64, guess_rad: f64) -> Result<f64> {
    let found = if radius_mm == 0.0 { axis } else { field_imaged_at(reference, radius_mm, guess_rad) };
    found.ok_or(DesignError::OutsideTheImage { radius_mm })
}

impl PsfPlan {
    /// Fields evenly spaced in image radius from the axis to `corner_mm`. A lens without aberrations has an Airy disk, and
    /// rough fields are refused.
    pub fn new(
        fields: usize,
        corner_mm: f64,
        wavelengths_um: [f64; 3],
        options: PsfOptions,
        quadrature: Quadrature,
    ) -> Self {
        let last = fields.saturating_sub(1).max(1) as f64;
        let field_radius_mm = (0..fields).map(|i| corner_mm * i as f64 / last).collect();
        Self {
            field_radius_mm,
            held_fields_rad: None,
            wavelengths_um,
            options,
            quadrature,
            perfect_image: PerfectImage::AiryDisk,
            rough_fields: RoughFields::Refused,
        }
    }

    /// The same with another number of fields.
    pub fn with_fields(&self, fields: usize) -> Self {
        let corner_mm = self.field_radius_mm.last().copied().unwrap_or(0.0);
        let plan = Self::new(fields, corner_mm, self.wavelengths_um, self.options, self.quadrature.clone());
        let rough_fields = match &self.rough_fields {
            RoughFields::Refused => RoughFields::Refused,
            // Marks are of the fields as they were.
            RoughFields::ByRays | RoughFields::Held(_) => RoughFields::ByRays,
        };
        Self { perfect_image: self.perfect_image, rough_fields, ..plan }
    }

    /// The same with as many pupil cells as the PSFs of a lens need for an error of `tolerance`, and the error that is reached.
    ///
    /// The error is the largest over seven of the fields and the colours, estimated by doubling the cells. Of a PSF it is the sum of
    /// absolute differences from the PSF on arbitrarily many cells, both of unit sum; of the illumination it is the relative error. The
    /// cells do not become fewer than they are.
    ///
    /// Waves choose their own grid of the pupil, and the pattern of a lens without aberrations needs none: the plan stays, and the error is 0.
    /// Fails with [`DesignError::Stopped`] before the next field once the flag is set.
    pub fn converged(&self, lens: &Lens, tolerance: f64, cancel: &Cancel) -> Result<(Self, f64)> {
        if self.options.kind == PsfKind::Diffraction || focused_thin_lens_mm(lens).is_some() {
            return Ok((self.clone(), 0.0));
        }
        let first_cells = self.quadrature.cells;
        let refinement =
            PupilRefinement { tolerance, first_cells, most_cells: MOST_CELLS.max(2 * first_cells) };
        let angles = self.field_angles(lens)?;
        let step = angles.len().div_ceil(CHECKED_FIELDS).max(1);
        // From the corner inwards: aberrations are largest there.
        let checked: Vec<f64> = angles.iter().rev().step_by(step).copied().collect();
        let found: Vec<(usize, f64)> = checked
            .par_iter()
            .map(|field| {
                cancel.check()?;
                let psf = psf_converged(lens, *field, &self.wavelengths_um, &self.options, &refinement);
                let psf = psf.ok_or_else(|| DesignError::no_light(lens, *field, &self.wavelengths_um))?;
                Ok((psf.cells, psf.error))
            })
            .collect::<Result<_>>()?;
        let cells = found.iter().map(|f| f.0).max().unwrap_or(self.quadrature.cells);
        let error = found.iter().map(|f| f.1).fold(0.0, maximum);
        Ok((Self { quadrature: Quadrature::grid(cells)?, ..self.clone() }, error))
    }

    /// Field angle whose chief ray lands `radius_mm` from the axis, rad, distortion included.
    pub fn field_angle(&self, lens: &Lens, radius_mm: f64) -> Result<f64> {
        field_angle(lens, radius_mm)
    }

    /// Field angles of all fields, rad.
    pub fn field_angles(&self, lens: &Lens) -> Result<Vec<f64>> {
        if let Some(held) = &self.held_fields_rad {
            return Ok(held.clone());
        }
        let reference = lens.at_wavelength(lens.reference_um);
        let mut angles: Vec<f64> = Vec::with_capacity(self.field_radius_mm.len());
        let mut scale_mm = paraxial_scale_mm(lens);
        let on_axis = axis_field(lens, &reference);
        // Angles grow from the field that is imaged on the axis.
        let first = on_axis.unwrap_or(0.0);
        for radius_mm in &self.field_radius_mm {
            let guess = match angles.len() {
                // Wide fields hardly grow like a tangent: go on as from the field before the last to the last.
                n if n >= 2 && angles[n - 1] > WIDE_RAD => {
                    let by_radius = (angles[n - 1] - angles[n - 2])
                        / (self.field_radius_mm[n - 1] - self.field_radius_mm[n - 2]);
                    angles[n - 1] + by_radius * (radius_mm - self.field_radius_mm[n - 1])
                }
                // Start from the scale at which the field before it was imaged.
                _ => first + (radius_mm / scale_mm).atan(),
            };
            let angle = field_imaged(&reference, on_axis, *radius_mm, guess)?;
            if angle != first {
                scale_mm = radius_mm / (angle - first).tan();
            }
            angles.push(angle);
        }
        Ok(angles)
    }

    /// [`image_scale_mm`] of the fields of the plan.
    pub fn image_scale_mm(&self, lens: &Lens) -> Result<Option<f64>> {
        image_scale_mm(lens, self.field_angles(lens)?.last().copied().unwrap_or(0.0))
    }

    /// Distances of the images of fields from the axis, mm: the radii of the plan, where the chief rays land at them.
    ///
    /// In a lens without symmetry about the plane of its fields, chief rays land beside that plane, and further from the axis.
    pub fn landing_radii_mm(&self, lens: &Lens, psfs: &[FieldPsf]) -> Vec<f64> {
        if lens.is_rotationally_symmetric() {
            return self.field_radius_mm.clone();
        }
        let landed = |(psf, radius_mm): (&FieldPsf, &f64)| {
            let distance_mm = psf.chief_x_mm.hypot(psf.chief_y_mm);
            if (distance_mm - radius_mm).abs() < LANDS_MM { *radius_mm } else { distance_mm }
        };
        psfs.iter().zip(&self.field_radius_mm).map(landed).collect()
    }

    /// The chief-ray map of a lens: where on the image the points of a rectilinear picture land. An error if a field is wider than 85
    /// degrees.
    pub fn distortion(&self, lens: &Lens) -> Result<Distortion> {
        let angles = self.field_angles(lens)?;
        if let Some(field) = angles.iter().find(|field| field.abs() > WIDEST_PICTURE_RAD) {
            return Err(DesignError::TooWideForAPicture { field_deg: field.to_degrees() });
        }
        let reference = lens.at_wavelength(lens.reference_um);
        let height = |field: f64| {
            let chief = chief_ray(&reference, field);
            Ok(chief.ok_or_else(|| DesignError::no_light(lens, field, &[]))?.y_mm)
        };
        let image_mm = angles.iter().map(|field| height(*field)).collect::<Result<Vec<_>>>()?;
        let scale_mm = self.image_scale_mm(lens)?.unwrap_or(1.0);
        let ideal_mm = angles.iter().map(|field| scale_mm * field.tan()).collect();
        Ok(Distortion::new(image_mm, ideal_mm).map_err(RenderError::from)?)
    }

    /// PSFs of every field with their tapes; fields in parallel, each in a fixed order.
    pub fn trace(&self, lens: &Lens) -> Result<BankWithTape> {
        self.trace_unless(&Cancel::default(), lens)
    }

    /// As [`trace`](Self::trace), for many fields: fails with [`DesignError::Stopped`] before the next field once it is cancelled.
    pub fn trace_unless(&self, cancel: &Cancel, lens: &Lens) -> Result<BankWithTape> {
        if !lens.is_rotationally_symmetric() {
            return Err(DesignError::NotSymmetric(lens.name.clone()));
        }
        let angles = self.field_angles(lens)?;
        let traced: Vec<(FieldPsf, Option<PsfTape>)> = angles
            .par_iter()
            .enumerate()
            .map(|(i, field)| {
                cancel.check()?;
                self.psf(lens, i, *field)
            })
            .collect::<Result<_>>()?;
        let mut bank = PsfBank {
            field_radius_mm: match self.held_fields_rad {
                Some(_) => traced.iter().map(|(psf, _)| psf.chief_y_mm).collect(),
                None => self.field_radius_mm.clone(),
            },
            grid: self.options.grid,
            pitch_um: self.options.pitch_um,
            values: Vec::new(),
            illumination: Vec::new(),
        };
        for (psf, _) in &traced {
            for channel in &psf.values {
                bank.values.extend(channel.iter().map(|v| *v as f32));
            }
            bank.illumination.extend(psf.illumination.iter().map(|v| *v as f32));
        }
        Ok(BankWithTape { bank, fields: traced, surfaces: lens.surfaces.len() })
    }

    /// PSFs of every field in double precision, for analysis and for files. Fails with [`DesignError::Stopped`] before the next field once
    /// the flag is set.
    pub fn psfs(&self, lens: &Lens, cancel: &Cancel) -> Result<Vec<FieldPsf>> {
        let of_field = |(i, field): (usize, &f64)| -> Result<FieldPsf> {
            cancel.check()?;
            Ok(self.psf(lens, i, *field)?.0)
        };
        self.field_angles(lens)?.par_iter().enumerate().map(of_field).collect()
    }

    /// The same for lenses that move from one whose PSFs are these: those of the fields that are by rays now stay so.
    pub fn held_as(&self, traced: &BankWithTape) -> Self {
        match self.options.kind {
            PsfKind::Geometric => self.clone(),
            PsfKind::Diffraction => {
                Self { rough_fields: RoughFields::Held(traced.fields_by_rays()), ..self.clone() }
            }
        }
    }

    /// Whether the PSF of a field is by waves, if it can be.
    fn is_by_waves(&self, field: usize) -> bool {
        let is_marked = match &self.rough_fields {
            RoughFields::Held(marked) => marked.get(field).copied().unwrap_or(false),
            RoughFields::Refused | RoughFields::ByRays => false,
        };
        self.options.kind == PsfKind::Diffraction && !is_marked
    }

    /// The PSF of a field, which is the `index`-th: by tracing, with its tape, or of a lens without aberrations.
    fn psf(&self, lens: &Lens, index: usize, field_rad: f64) -> Result<(FieldPsf, Option<PsfTape>)> {
        let (colours, options) = (&self.wavelengths_um, &self.options);
        if let Some(perfect) = perfect_psf(lens, field_rad, colours, options, self.perfect_image) {
            return Ok((perfect, None));
        }
        let of_kind = |kind: PsfKind| {
            psf_with_tape(lens, field_rad, colours, &self.quadrature, &PsfOptions { kind, ..*options })
        };
        let traced = if self.is_by_waves(index) {
            of_kind(PsfKind::Diffraction).or_else(|| {
                let takes_rays = self.rough_fields == RoughFields::ByRays;
                takes_rays.then(|| of_kind(PsfKind::Geometric)).flatten()
            })
        } else {
            of_kind(PsfKind::Geometric)
        };
        let (psf, tape) = traced.ok_or_else(|| self.no_psf(lens, index, field_rad))?;
        Ok((psf, Some(tape)))
    }

    /// Why a field, which is the `index`-th, has no PSF.
    fn no_psf(&self, lens: &Lens, index: usize, field_rad: f64) -> DesignError {
        let needs_waves = self.is_by_waves(index) && self.rough_fields != RoughFields::ByRays;
        match NoWaves::of(lens).filter(|_| needs_waves) {
            Some(no_waves) => DesignError::NoWaves(no_waves),
            None => DesignError::no_light(lens, field_rad, &self.wavelengths_um),
        }
    }

    /// PSFs of every field.
    pub fn bank(&self, lens: &Lens) -> Result<PsfBank> {
        Ok(self.trace(lens)?.bank)
    }

    /// The lens gradient of the relative illumination of each field, at the second wavelength.
    pub fn light_gradients(&self, traced: &BankWithTape) -> Vec<LensGradient> {
        let cells = self.options.grid * self.options.grid;
        let of_field = |(psf, tape): &(FieldPsf, Option<PsfTape>)| {
            let Some(tape) = tape else { return LensGradient::zero(traced.surfaces) };
            let values = vec![vec![0.0; cells]; 3];
            let cotangent = PsfCotangent { values, illumination: vec![0.0, 1.0, 0.0], chief_y: 0.0 };
            tape.gradient(psf, &self.quadrature, &cotangent)
        };
        traced.fields.par_iter().map(of_field).collect()
    }

    /// The lens gradient of a loss whose derivatives by the bank's values, illumination and field radii are given, laid out as in
    /// [`PsfBank`]. The fields stay, so that their chief rays land elsewhere when the lens changes.
    pub fn gradient(
        &self,
        traced: &BankWithTape,
        by_values: &[f32],
        by_illumination: &[f32],
        by_radius: &[f32],
    ) -> LensGradient {
        let cells = self.options.grid * self.options.grid;
        let parts: Vec<LensGradient> = traced
            .fields
            .par_iter()
            .enumerate()
            .map(|(field, (psf, tape))| {
                let Some(tape) = tape else { return LensGradient::zero(traced.surfaces) };
                let values = by_values[field * 3 * cells..(field + 1) * 3 * cells]
                    .chunks_exact(cells)
                    .map(|channel| channel.iter().map(|v| f64::from(*v)).collect())
                    .collect();
                let illumination =
                    by_illumination[field * 3..field * 3 + 3].iter().map(|v| f64::from(*v)).collect();
                let chief_y = f64::from(by_radius[field]);
                tape.gradient(psf, &self.quadrature, &PsfCotangent { values, illumination, chief_y })
            })
            .collect();
        // Sum in the order of the fields: the same bits for any number of threads.
        let mut total = LensGradient::zero(traced.surfaces);
        parts.iter().for_each(|part| total += part);
        total
    }
}

#[cfg(test)]
mod tests;
