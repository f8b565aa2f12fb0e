//! Where optics meets the picture: the PSFs that a lens gives the renderer, and the lens gradient that follows from a loss's
//! derivatives by them. The tape of the tensor framework ends here.

use petzval_camera::psf::PsfBank;
use petzval_camera::render::RenderGeometry;
use petzval_camera::sensor::SensorModel;
use petzval_optics::gradient::LensGradient;
use petzval_optics::lens::{Lens, ObjectDistance};
use petzval_optics::paraxial::image_height_per_tangent;
use petzval_optics::psf::{FieldPsf, PsfCotangent, PsfOptions, PsfTape, psf, psf_with_tape};
use petzval_optics::pupil::Quadrature;
use rayon::prelude::*;

use crate::error::DesignError;
use crate::experiment::PsfConfig;

/// The fields, wavelengths and grids on which a lens is turned into PSFs.
#[derive(Clone, Debug)]
pub struct PsfPlan {
    /// Ideal image radii of the fields, mm, from 0 to the sensor's corner.
    pub field_radius_mm: Vec<f64>,
    /// Wavelengths of the red, green and blue channel, um.
    pub wavelengths_um: [f64; 3],
    /// The grid of each PSF.
    pub options: PsfOptions,
    /// The pupil's quadrature.
    pub quadrature: Quadrature,
}

/// PSFs of every field, with what their gradient needs.
pub struct BankWithTape {
    /// The renderer's input.
    pub bank: PsfBank,
    fields: Vec<(FieldPsf, PsfTape)>,
    surfaces: usize,
}

impl PsfConfig {
    /// The plan for a sensor, with `cells` cells across the pupil.
    pub fn plan(&self, sensor: &SensorModel, cells: usize) -> Result<PsfPlan, DesignError> {
        let corner_mm = 0.5e-3 * sensor.pixel_um * (sensor.height as f64).hypot(sensor.width as f64);
        let options = PsfOptions { grid: self.grid, pitch_um: self.pitch_um, kind: self.kind };
        Ok(PsfPlan::new(self.fields, corner_mm, self.wavelengths_um, options, Quadrature::grid(cells)?))
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
        let all = self.fields.iter().flat_map(|(psf, _)| &psf.captured);
        all.fold(1.0, |least, share| least.min(*share))
    }
}

impl PsfPlan {
    /// Fields evenly spaced in image radius from the axis to `corner_mm`.
    pub fn new(
        fields: usize,
        corner_mm: f64,
        wavelengths_um: [f64; 3],
        options: PsfOptions,
        quadrature: Quadrature,
    ) -> Self {
        let last = fields.saturating_sub(1).max(1) as f64;
        let field_radius_mm = (0..fields).map(|i| corner_mm * i as f64 / last).collect();
        Self { field_radius_mm, wavelengths_um, options, quadrature }
    }

    /// Field angle whose ideal, rectilinear image lies `radius_mm` from the axis, rad: `tan(field) = r / f`, with f
    /// the EFL or, for a near object at D, `D / w'` with w' the final slope of its paraxial ray of slope 1.
    pub fn field_angle(&self, lens: &Lens, radius_mm: f64) -> f64 {
        let per_tangent = image_height_per_tangent(&lens.at_wavelength(lens.reference_um));
        // Of a real image of a near object, turned upside down, the field is as far on the other side.
        let per_tangent =
            if lens.object == ObjectDistance::Infinity { per_tangent } else { per_tangent.abs() };
        (radius_mm / per_tangent).atan()
    }

    /// Field angles of all fields, rad.
    pub fn field_angles(&self, lens: &Lens) -> Vec<f64> {
        self.field_radius_mm.iter().map(|r| self.field_angle(lens, *r)).collect()
    }

    /// PSFs of every field with their tapes; fields in parallel, each in a fixed order.
    pub fn trace(&self, lens: &Lens) -> Result<BankWithTape, DesignError> {
        if !lens.is_rotationally_symmetric() {
            return Err(DesignError::NotSymmetric(lens.name.clone()));
        }
        let angles = self.field_angles(lens);
        let traced: Vec<(FieldPsf, PsfTape)> = angles
            .par_iter()
            .map(|field| {
                psf_with_tape(lens, *field, &self.wavelengths_um, &self.quadrature, &self.options)
                    .ok_or(DesignError::NoLight { field_deg: field.to_degrees() })
            })
            .collect::<Result<_, _>>()?;
        let mut bank = PsfBank {
            field_radius_mm: self.field_radius_mm.clone(),
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

    /// PSFs of every field in double precision, for analysis and for files.
    pub fn psfs(&self, lens: &Lens) -> Result<Vec<FieldPsf>, DesignError> {
        self.field_angles(lens)
            .par_iter()
            .map(|field| {
                psf(lens, *field, &self.wavelengths_um, &self.quadrature, &self.options)
                    .ok_or(DesignError::NoLight { field_deg: field.to_degrees() })
            })
            .collect()
    }

    /// PSFs of every field.
    pub fn bank(&self, lens: &Lens) -> Result<PsfBank, DesignError> {
        Ok(self.trace(lens)?.bank)
    }

    /// The lens gradient of a loss whose derivatives by the bank's values and illumination are given,
    /// laid out as in [`PsfBank`].
    pub fn gradient(
        &self,
        traced: &BankWithTape,
        by_values: &[f32],
        by_illumination: &[f32],
    ) -> LensGradient {
        let cells = self.options.grid * self.options.grid;
        let parts: Vec<LensGradient> = traced
            .fields
            .par_iter()
            .enumerate()
            .map(|(field, (psf, tape))| {
                let values = by_values[field * 3 * cells..(field + 1) * 3 * cells]
                    .chunks_exact(cells)
                    .map(|channel| channel.iter().map(|v| f64::from(*v)).collect())
                    .collect();
                let illumination =
                    by_illumination[field * 3..field * 3 + 3].iter().map(|v| f64::from(*v)).collect();
                tape.gradient(psf, &self.quadrature, &PsfCotangent { values, illumination })
            })
            .collect();
        // Sum in the order of the fields: the same bits for any number of threads.
        let mut total = LensGradient::zero(traced.surfaces);
        parts.iter().for_each(|part| total += part);
        total
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assets::Assets;
    use petzval_optics::pupil::chief_ray;
    use petzval_optics::solve::with_paraxial_focus;

    #[test]
    fn a_small_radius_is_where_its_field_is_imaged_from_any_distance() {
        let data = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data");
        let assets = Assets::from_folder(&data).unwrap();
        let nominal = assets.lens("cooke-triplet-nominal").unwrap().lens;
        let quadrature = Quadrature::grid(16).unwrap();
        let plan = PsfPlan::new(2, 1.0, [0.62, 0.55, 0.486], PsfOptions::default(), quadrature);
        for object in
            [100.0, 400.0, 1e5].map(ObjectDistance::Finite).into_iter().chain([ObjectDistance::Infinity])
        {
            let lens = with_paraxial_focus(&Lens { object, ..nominal.clone() }, 0.0);
            let radius = 1e-3;
            let field = plan.field_angle(&lens, radius);
            let chief = chief_ray(&lens.at_wavelength(lens.reference_um), field).unwrap();
            assert!((chief.y_mm / radius - 1.0).abs() < 1e-5, "{object:?}: {}", chief.y_mm);
        }
    }
}
