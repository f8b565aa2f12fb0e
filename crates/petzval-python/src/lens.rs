//! Lenses: read, changed, looked at, and traced.

use std::path::PathBuf;

use petzval_files::{LensFile, write_lens};
use petzval_jobs::glass::context_with;
use petzval_jobs::input::{Input, LensFormat, LensText};
use petzval_jobs::{Context, JobError, LensInput, json};
use petzval_optics::analysis::{AnalysisOptions, layout, mtf_at, spot_diagram, wavefront};
use petzval_optics::lens::Lens;
use petzval_optics::number::Number;
use petzval_optics::paraxial::first_order;
use petzval_report::layout::{CrossSection, Extent};
use pyo3::prelude::*;
use rayon::prelude::*;
use serde::Serialize;

use crate::arrays::{Like1, finite};
use crate::error::{exception, refusal};
use crate::watch::{Watch, watched};

/// A lens, and the glass catalogues that it was read with.
#[pyclass(frozen, name = "Lens", module = "petzval._petzval")]
pub struct PyLens {
    pub file: LensFile,
    pub glasses: Vec<PathBuf>,
}

/// A surface as Python sees it.
#[derive(Serialize)]
struct SurfaceRow {
    label: String,
    radius_mm: Option<f64>,
    conic: f64,
    asphere: Vec<f64>,
    thickness_mm: f64,
    glass: String,
    semi_diameter_mm: f64,
    is_stop: bool,
}

/// What Python reads of a lens again and again.
#[derive(Serialize)]
struct Facts {
    name: String,
    source: String,
    efl_mm: Option<f64>,
    bfl_mm: Option<f64>,
    f_number: Option<f64>,
    entrance_pupil_mm: f64,
    reference_um: f64,
    wavelengths_um: Vec<f64>,
    fields_deg: Vec<f64>,
    surfaces: Vec<SurfaceRow>,
}

/// A lens as its job reads it, with the glasses of these catalogues first.
fn read(input: &LensInput, glasses: &[PathBuf], context: &Context) -> Result<LensFile, JobError> {
    input.read(&context_with(context.clone(), glasses)?.assets)
}

#[pymethods]
impl PyLens {
    /// Reads a lens by path or built-in name.
    #[staticmethod]
    fn load(py: Python<'_>, name: String, glasses: Vec<PathBuf>, watch: Watch<'_>) -> PyResult<Self> {
        let file = watched(py, &watch, |context| read(&Input::Name(name), &glasses, context))?;
        Ok(Self { file, glasses })
    }

    /// Reads the text of a lens file in a format: `toml`, `zmx`, `seq` or `json`.
    #[staticmethod]
    fn parse(
        py: Python<'_>,
        text: String,
        format: &str,
        glasses: Vec<PathBuf>,
        watch: Watch<'_>,
    ) -> PyResult<Self> {
        let format: LensFormat = serde_json::from_value(format.into()).map_err(|_| {
            let hint = "\"toml\", \"zmx\", \"seq\" or \"json\"";
            refusal(py, "format", format, "no such format", hint)
        })?;
        let input = Input::Inline(LensText::Other { text, format });
        let file = watched(py, &watch, |context| read(&input, &glasses, context))?;
        Ok(Self { file, glasses })
    }

    /// The lens as text of a lens file.
    fn toml(&self) -> String {
        write_lens(&self.file)
    }

    /// The glass catalogues that it was read with.
    fn glasses(&self) -> Vec<PathBuf> {
        self.glasses.clone()
    }

    /// Its facts as JSON.
    fn facts(&self, py: Python<'_>) -> PyResult<String> {
        let lens = &self.file.lens;
        let order = first_order(&lens.at_wavelength(lens.reference_um));
        let number = |value: f64| value.is_finite().then_some(value);
        let row = |(i, s): (usize, &petzval_optics::lens::Surface)| SurfaceRow {
            label: s.label.clone(),
            radius_mm: number(1.0 / s.shape.curvature),
            conic: s.shape.conic,
            asphere: s.shape.asphere.to_vec(),
            thickness_mm: s.thickness_mm,
            glass: s.glass.name.clone(),
            semi_diameter_mm: s.semi_diameter_mm,
            is_stop: i == lens.stop,
        };
        let facts = Facts {
            name: lens.name.clone(),
            source: lens.source.clone(),
            efl_mm: number(order.efl_mm),
            bfl_mm: number(order.bfl_mm),
            f_number: number(order.f_number),
            entrance_pupil_mm: lens.entrance_pupil_mm,
            reference_um: lens.reference_um,
            wavelengths_um: lens.wavelengths_um.clone(),
            fields_deg: lens.fields_deg.clone(),
            surfaces: lens.surfaces.iter().enumerate().map(row).collect(),
        };
        json(&facts).map_err(|error| exception(py, &error))
    }

    /// The same lens with some numbers of surfaces changed: `(surface from 0, name, value as stated)`.
    fn changed(
        &self,
        py: Python<'_>,
        numbers: Vec<(usize, String, f64)>,
        wavelengths_um: Option<Vec<f64>>,
        fields_deg: Option<Vec<f64>>,
        watch: Watch<'_>,
    ) -> PyResult<Self> {
        // What its source publishes is no longer true of it.
        let mut file = LensFile { expect: None, ..self.file.clone() };
        for (surface, name, value) in &numbers {
            change(&mut file.lens, *surface, name, *value).map_err(|error| exception(py, &error))?;
        }
        file.lens.wavelengths_um = wavelengths_um.unwrap_or(file.lens.wavelengths_um);
        file.lens.fields_deg = fields_deg.unwrap_or(file.lens.fields_deg);
        // What a file may not hold, a lens may not have.
        let input = Input::Inline(LensText::Toml { toml: write_lens(&file) });
        let file = watched(py, &watch, |context| read(&input, &self.glasses, context))?;
        Ok(Self { file, glasses: self.glasses.clone() })
    }

    /// The cross-section with rays, as SVG.
    fn layout_svg(&self, py: Python<'_>, px_per_mm: Option<f64>, watch: Watch<'_>) -> PyResult<String> {
        watched(py, &watch, |_| {
            let lens = &self.file.lens;
            let layout = layout(lens, &AnalysisOptions::default());
            let section = CrossSection {
                name: &lens.name,
                fields_deg: &lens.fields_deg,
                half_diagonal_mm: 0.0,
                layout: &layout,
                ghost: None,
            };
            let extent = section.extent();
            Ok(section.svg(px_per_mm.unwrap_or_else(|| usual_scale(&extent)), extent))
        })
    }

    /// Spot diagrams of fields in degrees, as JSON.
    fn spots(&self, py: Python<'_>, fields_deg: Like1<'_>, watch: Watch<'_>) -> PyResult<String> {
        let fields = finite(py, "fields_deg", &fields_deg)?;
        let options = AnalysisOptions::default();
        self.by_field(py, &fields, &watch, |lens, field| spot_diagram(lens, field, &options))
    }

    /// Modulation of fields in degrees at frequencies in cycles/mm, as JSON.
    fn mtf(
        &self,
        py: Python<'_>,
        fields_deg: Like1<'_>,
        per_mm: Like1<'_>,
        watch: Watch<'_>,
    ) -> PyResult<String> {
        let (fields, frequencies) = (finite(py, "fields_deg", &fields_deg)?, finite(py, "per_mm", &per_mm)?);
        if let Some(negative) = frequencies.iter().find(|f| **f < 0.0) {
            return Err(refusal(py, "per_mm", negative, "a frequency is not negative", "cycles per mm"));
        }
        let options = AnalysisOptions::default();
        self.by_field(py, &fields, &watch, |lens, field| mtf_at(lens, field, &frequencies, &options))
    }

    /// Wavefronts of fields in degrees, as JSON.
    fn wavefront(&self, py: Python<'_>, fields_deg: Like1<'_>, watch: Watch<'_>) -> PyResult<String> {
        let fields = finite(py, "fields_deg", &fields_deg)?;
        self.by_field(py, &fields, &watch, wavefront)
    }
}

impl PyLens {
    /// An analysis of each field, as JSON.
    fn by_field<T: Serialize + Send>(
        &self,
        py: Python<'_>,
        fields_deg: &[f64],
        watch: &Watch<'_>,
        of: impl Fn(&Lens, f64) -> Result<T, petzval_optics::analysis::AnalysisError> + Sync + Send,
    ) -> PyResult<String> {
        let limit = self.file.lens.object.field_limit_deg();
        check_fields(fields_deg, limit).map_err(|error| exception(py, &error))?;
        watched(py, watch, |context| {
            let found: Vec<T> = fields_deg
                .par_iter()
                .map(|field| {
                    context.check(|| "stopped before all fields were analysed")?;
                    of(&self.file.lens, *field).map_err(|e| JobError::input(e.to_string(), ""))
                })
                .collect::<Result<_, JobError>>()?;
            json(&found)
        })
    }
}

/// Fails if a field angle is so large that no light comes from there.
pub fn check_fields(fields_deg: &[f64], limit_deg: f64) -> Result<(), JobError> {
    match fields_deg.iter().find(|f| f.abs() >= limit_deg) {
        None => Ok(()),
        Some(beyond) => {
            let hint = format!("between {} and {limit_deg} degrees", -limit_deg);
            Err(JobError::setting("fields_deg", beyond, "no field", hint))
        }
    }
}

/// Pixels per mm at which a drawing is about 800 pixels wide.
fn usual_scale(extent: &Extent) -> f64 {
    const WIDTH_PX: f64 = 800.0;
    WIDTH_PX / (extent.z_max_mm - extent.z_min_mm).max(1e-3)
}

/// A number of a surface by its name in lens files, such as `radius_mm`.
pub fn number_of(lens: &Lens, surface: usize, name: &str) -> Result<Number, JobError> {
    let count = lens.surfaces.len();
    let Some(found) = lens.surfaces.get(surface) else {
        let hint = format!("the lens has {count} surfaces, from 0 to {}", count - 1);
        return Err(JobError::setting("surface", surface, "no such surface", hint));
    };
    let has = |number: &Number| number.to_string() == name && found.has_number(*number);
    Number::ALL.into_iter().find(has).ok_or_else(|| {
        let hint = "such as radius_mm, thickness_mm, conic, semi_diameter_mm";
        JobError::setting("number", name, format!("surface {surface} has no such number"), hint)
    })
}

/// Sets a number of a surface as users state it.
fn change(lens: &mut Lens, surface: usize, name: &str, value: f64) -> Result<(), JobError> {
    let number = number_of(lens, surface, name)?;
    if value.is_nan() {
        return Err(JobError::setting(
            "value",
            value,
            format!("{name} of surface {surface} is no number"),
            "",
        ));
    }
    number.write(lens, surface, number.from_stated(value));
    Ok(())
}
