//! Light through a lens: pictures blurred, dimmed and distorted by PSFs, and the blur taken out again.

use numpy::ndarray::{Array3, Array4, ArrayView3, Axis};
use numpy::{IntoPyArray, PyArray1, PyArray3, PyArray4};
use petzval_camera::image::{CHANNELS, LinearImage};
use petzval_camera::psf::PsfBank;
use petzval_camera::render::{
    Distortion, KNOTS, MAX_PATCHES, MAX_SIDE, Placement, RenderError, RenderGeometry, Wiener, Window,
    blend_error, kernel_radius, light_on_pixels, render, render_adjoint, with_patches_for,
};
use petzval_camera::sensor::Exposure;
use petzval_design::experiment::PsfConfig;
use petzval_jobs::JobError;
use pyo3::prelude::*;

use crate::arrays::{Like1, Like2, Like3, Like4, finite};
use crate::error::{exception, refusal};
use crate::lens::PyLens;
use crate::sensor::{MOST_PIXELS, PySensor};
use crate::watch::{Watch, watched};

/// Most values of the kernels of all patches: 8 GB.
const MOST_KERNEL_VALUES: usize = 2_000_000_000;

/// Image radii and ideal radii, mm.
type Table<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>);

/// Where the points of a rectilinear picture land.
#[pyclass(frozen, name = "Distortion", module = "petzval._petzval")]
pub struct PyDistortion(Distortion);

#[pymethods]
impl PyDistortion {
    /// A map by image radii and the ideal radius of each, mm.
    #[new]
    fn new(py: Python<'_>, image_mm: Like1<'_>, ideal_mm: Like1<'_>) -> PyResult<Self> {
        let (image_mm, ideal_mm) = (finite(py, "image_mm", &image_mm)?, finite(py, "ideal_mm", &ideal_mm)?);
        let refused = |e: petzval_camera::PsfError| {
            let hint =
                "two radii at least, ascending from 0, and so are the ideal ones, also beyond the last";
            exception(py, &JobError::input(format!("distortion: {e}"), hint))
        };
        Distortion::new(image_mm, ideal_mm).map(Self).map_err(refused)
    }

    /// Image radii on a sensor, mm, and their ideal radii by the chief rays of a lens, as `simulate` has them.
    #[staticmethod]
    fn table<'py>(
        py: Python<'py>,
        lens: &PyLens,
        sensor: &PySensor,
        watch: Watch<'_>,
    ) -> PyResult<Table<'py>> {
        let (image, ideal) = watched(py, &watch, |_| {
            let psf = PsfConfig::default();
            let plan = psf.plan(&sensor.model, psf.pupil_cells)?.with_fields(psf.scoring_fields);
            let map = plan.distortion(&lens.file.lens)?;
            let ideal: Vec<f64> = plan.field_radius_mm.iter().map(|r| map.ideal_mm(*r)).collect();
            Ok((plan.field_radius_mm, ideal))
        })?;
        Ok((image.into_pyarray(py), ideal.into_pyarray(py)))
    }

    /// The ideal radius of each image radius, mm.
    fn ideal_mm<'py>(&self, py: Python<'py>, image_mm: Like1<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let radii = finite(py, "image_mm", &image_mm)?;
        Ok(radii.into_iter().map(|r| self.0.ideal_mm(r)).collect::<Vec<_>>().into_pyarray(py))
    }

    /// The image radius of each ideal radius, mm.
    fn image_mm<'py>(&self, py: Python<'py>, ideal_mm: Like1<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let radii = finite(py, "ideal_mm", &ideal_mm)?;
        Ok(radii.into_iter().map(|r| self.0.image_mm(r)).collect::<Vec<_>>().into_pyarray(py))
    }

    /// Rows and columns of a rectilinear picture that covers everything a sensor sees.
    fn frame(&self, py: Python<'_>, height: usize, width: usize, pixel_um: f64) -> PyResult<(usize, usize)> {
        let frame =
            geometry(height, width, pixel_um, (1, 1)).and_then(|g| self.0.ideal_frame(&g).map_err(refused));
        frame.map_err(|error| exception(py, &error))
    }
}

/// PSFs in front of a sensor.
#[pyclass(frozen, name = "Renderer", module = "petzval._petzval")]
pub struct PyRenderer {
    geometry: RenderGeometry,
    /// Banks of three colours each; the last one repeats its last colour where there are fewer.
    banks: Vec<PsfBank>,
    colours: usize,
}

/// Derivatives by PSFs, by field radii (1/mm), and by the scene.
type Gradient<'py> = (Bound<'py, PyArray4<f32>>, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray3<f32>>);

#[pymethods]
impl PyRenderer {
    /// PSFs `[field, colour, y, x]` with their illumination and radii, and a sensor of rows, columns and a pitch in um. Without a number of
    /// patches there are as many as the blend needs.
    #[new]
    #[allow(clippy::too_many_arguments)] // The arrays of a bank, as Python has them.
    fn new(
        py: Python<'_>,
        values: Like4<'_>,
        illumination: Like2<'_, f32>,
        field_radius_mm: Like1<'_>,
        pitch_um: f64,
        sensor: (usize, usize, f64),
        patches: Option<(usize, usize)>,
        largest_error: Option<f64>,
        watch: Watch<'_>,
    ) -> PyResult<Self> {
        let field_radius_mm = finite(py, "field_radius_mm", &field_radius_mm)?;
        let (values, illumination) = (values.as_array(), illumination.as_array());
        let (fields, colours, grid, width) = values.dim();
        let fits = fields == field_radius_mm.len() && grid == width && colours > 0;
        if !fits || illumination.dim() != (fields, colours) {
            let hint = format!(
                "values [{}, colours, cells, cells], illumination [{}, colours]",
                field_radius_mm.len(),
                field_radius_mm.len()
            );
            let found = format!("of shapes {:?} and {:?}", values.dim(), illumination.dim());
            return Err(refusal(py, "psfs", found, "do not fit their field radii", hint));
        }
        let bank = |first: usize| {
            let used: Vec<usize> = (first..first + CHANNELS).map(|c| c.min(colours - 1)).collect();
            let mut bank = PsfBank {
                field_radius_mm: field_radius_mm.clone(),
                grid,
                pitch_um,
                values: Vec::with_capacity(fields * CHANNELS * grid * grid),
                illumination: Vec::with_capacity(fields * CHANNELS),
            };
            for (field, c) in (0..fields).flat_map(|field| used.iter().map(move |c| (field, *c))) {
                bank.values.extend(values.index_axis(Axis(0), field).index_axis(Axis(0), c).iter());
                bank.illumination.push(illumination[[field, c]]);
            }
            bank
        };
        let banks: Vec<PsfBank> = (0..colours).step_by(CHANNELS).map(bank).collect();
        let (height, width, pixel_um) = sensor;
        watched(py, &watch, |context| {
            for bank in &banks {
                bank.validate().map_err(|e| JobError::input(format!("psfs: {e}"), ""))?;
            }
            let largest = largest_error.unwrap_or(PsfConfig::default().scoring_blend_error);
            if largest.is_nan() || largest <= 0.0 {
                return Err(JobError::setting("blend_error", largest, "is not positive", "0.03 is usual"));
            }
            let mut geometry = geometry(height, width, pixel_um, patches.unwrap_or((1, 1)))?;
            if patches.is_none() {
                // As many patches as the colours need that change most over the sensor.
                for bank in &banks {
                    context.check(|| "stopped before the patches were chosen")?;
                    let (found, _) = with_patches_for(&geometry, bank, largest).map_err(refused)?;
                    let (rows, cols) = geometry.patches;
                    geometry.patches = (rows.max(found.patches.0), cols.max(found.patches.1));
                }
            }
            let made = Self { geometry, banks, colours };
            made.check_kernels(1)?;
            Ok(made)
        })
    }

    /// Rows and columns of patches.
    fn patches(&self) -> (usize, usize) {
        self.geometry.patches
    }

    /// Pixels from the centre of a kernel to its edge.
    fn kernel_radius(&self, py: Python<'_>) -> PyResult<usize> {
        kernel_radius(&self.geometry, &self.banks[0].layout()).map_err(|e| exception(py, &refused(e)))
    }

    /// Difference between the PSF that is blended at a place and that of the place itself: median over the sensor, and the largest one.
    fn blend_error(&self, py: Python<'_>, watch: Watch<'_>) -> PyResult<(f64, f64)> {
        watched(py, &watch, |_| {
            let mut worst = (0.0_f64, 0.0_f64);
            for bank in &self.banks {
                let found = blend_error(&self.geometry, bank).map_err(refused)?;
                worst = (worst.0.max(found.median), worst.1.max(found.largest));
            }
            Ok(worst)
        })
    }

    /// The light of a picture on a window of the sensor: row, column, height, width.
    fn light<'py>(
        &self,
        py: Python<'py>,
        picture: Like3<'py>,
        distortion: Option<PyRef<'py, PyDistortion>>,
        window: (usize, usize, usize, usize),
        samples: usize,
        watch: Watch<'_>,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let planes = self.planes(py, "picture", &picture.as_array(), true)?;
        let distortion = distortion.as_deref().map(|d| &d.0);
        let (row, col, height, width) = window;
        let window = Window { placement: Placement { row, col }, height, width };
        let light = watched(py, &watch, |context| {
            self.check_window(&window, samples)?;
            let of = |(bank, picture)| {
                let cancel = context.cancel();
                light_on_pixels(&self.geometry, bank, picture, distortion, &window, samples, cancel)
                    .map_err(refused)
            };
            self.banks.iter().zip(&planes).map(of).collect::<Result<Vec<_>, _>>()
        })?;
        self.picture(py, &light)
    }

    /// The blur of a scene with a border of the kernel's radius, whose output begins at a row and a column; without illumination.
    fn render<'py>(
        &self,
        py: Python<'py>,
        scene: Like3<'py>,
        row: usize,
        column: usize,
        watch: Watch<'_>,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let planes = self.planes(py, "scene", &scene.as_array(), false)?;
        let placement = Placement { row, col: column };
        let light = watched(py, &watch, |_| {
            let of = |(bank, scene)| render(&self.geometry, bank, scene, placement).map_err(refused);
            self.banks.iter().zip(&planes).map(of).collect::<Result<Vec<_>, _>>()
        })?;
        self.picture(py, &light)
    }

    /// The transpose of `render`: derivatives of a loss, from those by the rendered picture.
    fn adjoint<'py>(
        &self,
        py: Python<'py>,
        scene: Like3<'py>,
        row: usize,
        column: usize,
        by_output: Like3<'py>,
        watch: Watch<'_>,
    ) -> PyResult<Gradient<'py>> {
        let scenes = self.planes(py, "scene", &scene.as_array(), false)?;
        let bars = self.planes(py, "by_output", &by_output.as_array(), false)?;
        let placement = Placement { row, col: column };
        let found = watched(py, &watch, |_| {
            let of = |((bank, scene), bar)| {
                render_adjoint(&self.geometry, bank, scene, placement, bar).map_err(refused)
            };
            self.banks.iter().zip(&scenes).zip(&bars).map(of).collect::<Result<Vec<_>, _>>()
        })?;
        let (fields, grid) = (self.banks[0].field_radius_mm.len(), self.banks[0].grid);
        let values = Array4::from_shape_fn((fields, self.colours, grid, grid), |(field, c, y, x)| {
            let of = &found[c / CHANNELS].psfs.values;
            of[((field * CHANNELS + c % CHANNELS) * grid + y) * grid + x]
        });
        // A colour that is repeated has no cotangent, so it adds nothing.
        let radius: Vec<f64> =
            (0..fields).map(|field| found.iter().map(|g| g.psfs.radius[field]).sum()).collect();
        let scenes: Vec<LinearImage> = found.into_iter().map(|g| g.scene).collect();
        Ok((values.into_pyarray(py), radius.into_pyarray(py), self.picture(py, &scenes)?))
    }

    /// A picture without the blur of the lens, by a Wiener filter: noise, power, and the curves of each colour.
    fn restore<'py>(
        &self,
        py: Python<'py>,
        picture: Like3<'py>,
        wiener: (f32, f32, Like2<'py, f32>),
        row: usize,
        column: usize,
        watch: Watch<'_>,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let planes = self.planes(py, "picture", &picture.as_array(), false)?;
        let (noise, power, curves) = wiener;
        let curves = curves.as_array();
        if curves.dim() != (self.colours, KNOTS) || curves.iter().any(|v| !v.is_finite()) {
            let found = format!("of shape {:?}", curves.dim());
            let hint = format!("finite numbers [{}, {KNOTS}]", self.colours);
            return Err(refusal(py, "curves", found, "are no curves of these colours", hint));
        }
        for (name, value, low) in [("noise", noise, f32::MIN_POSITIVE), ("power", power, 0.0)] {
            if !(low..=1e6).contains(&value) {
                return Err(refusal(py, name, value, "is out of range", "noise above 0, power from 0 on"));
            }
        }
        let of_bank = |first: usize| Wiener {
            noise,
            power,
            curves: std::array::from_fn(|k| {
                std::array::from_fn(|knot| curves[[(first + k).min(self.colours - 1), knot]])
            }),
        };
        let wieners: Vec<Wiener> = (0..self.colours).step_by(CHANNELS).map(of_bank).collect();
        let placement = Placement { row, col: column };
        let restored = watched(py, &watch, |context| {
            // Filters reach twice as far as kernels.
            self.check_kernels(4)?;
            let of = |((bank, picture), wiener): ((_, _), &Wiener)| {
                wiener.restore(&self.geometry, bank, picture, placement, context.cancel()).map_err(refused)
            };
            self.banks.iter().zip(&planes).zip(&wieners).map(of).collect::<Result<Vec<_>, _>>()
        })?;
        self.picture(py, &restored)
    }
}

impl PyRenderer {
    /// Planes of a picture `[y, x, colour]`, three to a bank; a colour that a bank repeats is dark.
    fn planes(
        &self,
        py: Python<'_>,
        name: &'static str,
        picture: &ArrayView3<'_, f32>,
        is_light: bool,
    ) -> PyResult<Vec<LinearImage>> {
        let (height, width, colours) = picture.dim();
        if colours != self.colours || height == 0 || width == 0 {
            let (found, hint) =
                (format!("of shape {:?}", picture.dim()), format!("give [y, x, {}]", self.colours));
            return Err(refusal(py, name, found, "has the wrong shape", hint));
        }
        if let Some(((y, x, _), value)) =
            picture.indexed_iter().find(|(_, v)| !v.is_finite() || (is_light && **v < 0.0))
        {
            let message = if value.is_finite() { "light is not negative" } else { "is not finite" };
            return Err(refusal(py, name, value, message, format!("at row {y}, column {x}")));
        }
        let of_bank = |bank: usize| {
            let mut planes = LinearImage::zeros(CHANNELS, height, width);
            for c in bank * CHANNELS..((bank + 1) * CHANNELS).min(colours) {
                let plane = planes.plane_mut(c % CHANNELS);
                plane
                    .iter_mut()
                    .zip(picture.index_axis(Axis(2), c).iter())
                    .for_each(|(to, from)| *to = *from);
            }
            planes
        };
        Ok((0..self.banks.len()).map(of_bank).collect())
    }

    /// A picture `[y, x, colour]` of the planes of all banks.
    fn picture<'py>(&self, py: Python<'py>, planes: &[LinearImage]) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let (height, width) = (planes[0].height, planes[0].width);
        let at = |(y, x, c): (usize, usize, usize)| planes[c / CHANNELS].get(c % CHANNELS, y, x);
        Ok(Array3::from_shape_fn((height, width, self.colours), at).into_pyarray(py))
    }

    /// Fails if kernels, each so many times as large, do not fit into memory.
    fn check_kernels(&self, times: usize) -> Result<(), JobError> {
        let radius = kernel_radius(&self.geometry, &self.banks[0].layout()).map_err(refused)?;
        let values = self.geometry.patch_count() * CHANNELS * (2 * radius + 1).pow(2) * times;
        if values <= MOST_KERNEL_VALUES {
            return Ok(());
        }
        let (rows, cols) = self.geometry.patches;
        let hint = "take fewer patches, or PSFs on a smaller grid";
        Err(JobError::setting(
            "patches",
            format!("{rows} x {cols}"),
            "their kernels do not fit into memory",
            hint,
        ))
    }

    /// Fails if a window is empty, leaves the sensor, or has too many samples.
    fn check_window(&self, window: &Window, samples: usize) -> Result<(), JobError> {
        let &Window { placement: Placement { row, col }, height, width } = window;
        let (rows, cols) = (self.geometry.sensor_height, self.geometry.sensor_width);
        for (name, start, size, whole) in [("row", row, height, rows), ("column", col, width, cols)] {
            if size == 0 || start.checked_add(size).is_none_or(|end| end > whole) {
                let hint = format!("the sensor has {rows} x {cols} pixels, the window {height} x {width}");
                return Err(JobError::setting(name, start, "the window leaves the sensor", hint));
            }
        }
        let most = samples.saturating_pow(2).saturating_mul(height * width);
        let side = samples.saturating_mul(rows.max(cols));
        if samples == 0 || most > MOST_PIXELS || side > MAX_SIDE {
            let hint = format!(
                "1 on; the window may have {MOST_PIXELS} samples, the sensor {MAX_SIDE} along a side"
            );
            return Err(JobError::setting("samples", samples, "is out of range", hint));
        }
        Ok(())
    }
}

/// The usual noise and power of a restoration, or those for pictures of a sensor at an exposure: electrons of white, time in s, gain.
#[pyfunction]
pub fn wiener(py: Python<'_>, of: Option<(PyRef<'_, PySensor>, f32, f32, f32)>) -> PyResult<(f32, f32)> {
    let Some((sensor, white_e, time_s, linear_gain)) = of else {
        let usual = Wiener::default();
        return Ok((usual.noise, usual.power));
    };
    let exposure = Exposure { white_e, time_s, linear_gain };
    exposure.validate().map_err(|e| exception(py, &JobError::input(e.to_string(), "")))?;
    let found = Wiener::of_exposure(&sensor.model, &exposure);
    Ok((found.noise, found.power))
}

/// A sensor and its patches, checked.
fn geometry(
    height: usize,
    width: usize,
    pixel_um: f64,
    patches: (usize, usize),
) -> Result<RenderGeometry, JobError> {
    let sizes = [("shape", height, MAX_SIDE), ("shape", width, MAX_SIDE)];
    let counts = [("patches", patches.0, MAX_PATCHES), ("patches", patches.1, MAX_PATCHES)];
    for (name, number, most) in sizes.into_iter().chain(counts) {
        if !(1..=most).contains(&number) {
            return Err(JobError::setting(
                name,
                number,
                "is out of range",
                format!("rows and columns, 1 to {most}"),
            ));
        }
    }
    if !(1e-3..=1e4).contains(&pixel_um) {
        return Err(JobError::setting("pixel_um", pixel_um, "is out of range", "in um, 0.001 to 10000"));
    }
    Ok(RenderGeometry { sensor_height: height, sensor_width: width, pixel_um, patches })
}

fn refused(error: RenderError) -> JobError {
    match error {
        RenderError::Stopped(cancelled) => cancelled.into(),
        other => JobError::input(other.to_string(), ""),
    }
}
