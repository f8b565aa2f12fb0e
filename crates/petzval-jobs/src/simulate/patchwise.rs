//! A window of the sensor behind a lens without rotational symmetry: each patch of the renderer has the PSF of its own place.
//!
//! A camera has the PSFs of one azimuth, which it turns about the axis. Here fields in every direction are traced, for the patches that light up
//! the window alone.

use petzval_base::Cancel;
use petzval_base::statistics::{maximum, median, minimum};
use petzval_camera::image::{CHANNELS, LinearImage};
use petzval_camera::render::{BlendError, PatchKernels, RenderGeometry, Window, render_kernels_unless};
use petzval_camera::sensor::SensorModel;
use petzval_design::error::DesignError;
use petzval_design::experiment::PsfConfig;
use petzval_design::lens::placed_psf::{Place, kernel_of};
use petzval_design::lens::psf_plan::PsfPlan;
use petzval_optics::lens::Lens;
use petzval_optics::psf::FieldPsf;
use rayon::prelude::*;

use super::accuracy::{coarse_patches, coarse_pupil};
use crate::context::Context;
use crate::error::Result;
use crate::event::WarningKind;

/// Patch rows that are tried, from few to many.
const ROWS: [usize; 3] = [7, 13, 21];

/// Most pupil cells a side.
const MOST_CELLS: usize = 1024;

/// Places of the window, as shares of its height and width, at which the pupil cells are chosen: its middle, and where the outer ones of the fewest
/// patches lie.
const CONVERGED: [[f64; 2]; 5] = {
    const FIRST: f64 = 0.5 / ROWS[0] as f64;
    [[0.5, 0.5], [FIRST, FIRST], [FIRST, 1.0 - FIRST], [1.0 - FIRST, FIRST], [1.0 - FIRST, 1.0 - FIRST]]
};

/// Places of the window, as shares of its height and width, about which the blend of patches is checked.
const CHECKED: [[f64; 2]; 4] = [[0.25, 0.25], [0.25, 0.75], [0.75, 0.25], [0.75, 0.75]];

/// The kernels of the patches that light up a window.
pub struct Patchwise {
    /// The sensor and its patches.
    pub geometry: RenderGeometry,
    /// Places at which PSFs were traced.
    pub places: usize,
    /// Pupil cells a side.
    pub cells: usize,
    /// Shares of a PSF's light that its grid holds, at the places that lose most and least.
    pub captured: [f64; 2],
    /// What is to be said of the accuracy of the PSFs.
    pub warnings: Vec<(WarningKind, String)>,
    window: Window,
    /// How each patch spreads the light.
    kernels: PatchKernels,
    /// Relative illumination of each patch, as kernels of one pixel.
    light: PatchKernels,
}

/// What lights up a window: the lens, and how its PSFs are traced.
pub struct Behind<'a> {
    pub lens: &'a Lens,
    pub sensor: &'a SensorModel,
    pub psf: &'a PsfConfig,
    pub plan: PsfPlan,
    pub window: Window,
}

impl Behind<'_> {
    /// With these patches, and the cells of the plan: for a lens that is being dragged.
    pub fn quick(self, patches: (usize, usize), context: &Context) -> Result<Patchwise> {
        let geometry = RenderGeometry { patches, ..self.psf.geometry(self.sensor) };
        self.with(geometry, context)
    }

    /// With as many patches and cells as a score needs.
    pub fn exact(mut self, context: &Context) -> Result<Patchwise> {
        let whole = self.psf.geometry(self.sensor);
        let Window { placement, height, width } = self.window;
        let mut error = 0.0;
        for [down, right] in CONVERGED {
            context.check(|| "stopped before the PSFs were traced")?;
            let row = placement.row as f64 + down * height as f64;
            let (x_um, y_um) = whole.position_um(row, placement.col as f64 + right * width as f64);
            let place = Place::new(self.lens, [1e-3 * x_um, 1e-3 * y_um])?;
            let (plan, left) = place.converged(&self.plan, self.psf.scoring_pupil_error, MOST_CELLS)?;
            (self.plan, error) = (plan, maximum(error, left));
        }
        let aspect = whole.sensor_width as f64 / whole.sensor_height as f64;
        let with_rows = |rows: usize| -> Result<(Patchwise, BlendError)> {
            let columns = ((rows as f64 * aspect).round() as usize).max(1);
            let patches = (rows.min(whole.sensor_height), columns.min(whole.sensor_width));
            let made = self.with(RenderGeometry { patches, ..whole.clone() }, context)?;
            let blend = self.blend_error(&made)?;
            Ok((made, blend))
        };
        let [first, more @ ..] = ROWS;
        let (mut made, mut blend) = with_rows(first)?;
        for rows in more {
            if blend.median <= self.psf.scoring_blend_error {
                break;
            }
            (made, blend) = with_rows(rows)?;
        }
        let coarse =
            [coarse_pupil(self.psf, made.cells, error), coarse_patches(self.psf, &made.geometry, &blend)];
        made.warnings.extend(coarse.into_iter().flatten());
        Ok(made)
    }

    /// The PSFs of the patches of a geometry that have a weight in the window.
    fn with(&self, geometry: RenderGeometry, context: &Context) -> Result<Patchwise> {
        let patches = geometry.patches_in(&self.window);
        let of_patch = |patch: &usize| -> Result<FieldPsf> {
            context.check(|| "stopped before the PSFs were traced")?;
            let (x_um, y_um) = geometry.patch_centre_um(*patch);
            Ok(Place::new(self.lens, [1e-3 * x_um, 1e-3 * y_um])?.psf(&self.plan)?)
        };
        let psfs: Vec<FieldPsf> = patches.par_iter().map(of_patch).collect::<Result<_, _>>()?;
        let kernels: Vec<PatchKernels> =
            psfs.par_iter().map(|psf| kernel_of(psf, &self.plan, &geometry)).collect::<Result<_, _>>()?;
        let radius = kernels.first().map_or(0, |kernel| kernel.radius);
        let values = kernels.iter().flat_map(|kernel| kernel.values.iter().copied()).collect();
        let light = psfs.iter().flat_map(|psf| psf.illumination.iter().map(|v| *v as f32)).collect();
        let of_place = |psf: &FieldPsf| psf.captured.iter().copied().fold(1.0, minimum);
        let captured: Vec<f64> = psfs.iter().map(of_place).collect();
        let captured =
            [captured.iter().copied().fold(1.0, minimum), captured.iter().copied().fold(0.0, maximum)];
        Ok(Patchwise {
            places: patches.len(),
            cells: self.plan.quadrature.cells,
            captured,
            warnings: Vec::new(),
            window: self.window,
            light: PatchKernels { radius: 0, patches: patches.clone(), values: light },
            kernels: PatchKernels { radius, patches, values },
            geometry,
        })
    }

    /// The error of the blend between patches. It is largest in the middle of four of them, where each has a quarter of the weight.
    fn blend_error(&self, made: &Patchwise) -> Result<BlendError> {
        let Patchwise { geometry, kernels, window, .. } = made;
        let (rows, columns) = geometry.patches;
        let mut corners: Vec<usize> = CHECKED
            .iter()
            .map(|[down, right]| {
                let row = window.placement.row as f64 + down * window.height as f64;
                let column = window.placement.col as f64 + right * window.width as f64;
                let before = |at: f64, pixels: usize, count: usize| {
                    ((at * count as f64 / pixels as f64 - 0.5).max(0.0) as usize).min(count.saturating_sub(2))
                };
                before(row, geometry.sensor_height, rows) * columns
                    + before(column, geometry.sensor_width, columns)
            })
            .collect();
        corners.sort_unstable();
        corners.dedup();
        let of_four = |corner: &usize| -> Result<f64> {
            let four = [*corner, corner + 1, corner + columns, corner + columns + 1];
            let centres = four.map(|patch| geometry.patch_centre_um(patch));
            let middle_mm = [0, 1].map(|axis| {
                let along = |(x, y): (f64, f64)| if axis == 0 { x } else { y };
                0.25e-3 * centres.iter().map(|centre| along(*centre)).sum::<f64>()
            });
            let own = kernel_of(&Place::new(self.lens, middle_mm)?.psf(&self.plan)?, &self.plan, geometry)?;
            let difference = (0..CHANNELS).map(|channel| {
                let exact = own.kernel(0, channel);
                let blended = |i: usize| {
                    four.iter().map(|patch| 0.25 * kernels.kernel(*patch, channel)[i]).sum::<f32>()
                };
                exact.iter().enumerate().map(|(i, v)| f64::from((v - blended(i)).abs())).sum::<f64>()
            });
            Ok(difference.sum::<f64>() / CHANNELS as f64)
        };
        let is_between = |corner: &usize| {
            let four = [*corner, corner + 1, corner + columns, corner + columns + 1];
            rows > 1 && columns > 1 && four.iter().all(|patch| kernels.patches.contains(patch))
        };
        let errors: Vec<f64> =
            corners.par_iter().filter(|c| is_between(c)).map(of_four).collect::<Result<_, _>>()?;
        let largest = errors.iter().copied().fold(0.0, maximum);
        Ok(BlendError { median: if errors.is_empty() { 0.0 } else { median(errors) }, largest })
    }
}

impl Patchwise {
    /// Pixels around the window that its PSFs reach into.
    pub fn border(&self) -> usize {
        self.kernels.radius
    }

    /// The light of a scene that covers the window and its border on the pixels of the window, and their relative illumination.
    pub fn light(&self, scene: &LinearImage, cancel: &Cancel) -> Result<[LinearImage; 2], DesignError> {
        let Window { placement, height, width } = self.window;
        // The lens spreads every point by the PSF of its place and dims it.
        let mut light = render_kernels_unless(cancel, &self.geometry, &self.kernels, scene, placement)?;
        let mut white = LinearImage::zeros(CHANNELS, height, width);
        white.data.fill(1.0);
        let illumination = render_kernels_unless(cancel, &self.geometry, &self.light, &white, placement)?;
        light.data.iter_mut().zip(&illumination.data).for_each(|(light, share)| *light *= share);
        Ok([light, illumination])
    }
}

#[cfg(test)]
mod tests {
    use petzval_camera::render::{Placement, render_kernels};

    use super::*;

    #[test]
    fn patches_that_weigh_in_a_window_are_all_there() {
        for patches in [(1, 1), (3, 5), (7, 11), (21, 34)] {
            let geometry = RenderGeometry { patches, ..RenderGeometry::default() };
            for (row, col) in [(0, 0), (300, 900), (1200 - 64, 1920 - 96)] {
                let window = Window { placement: Placement { row, col }, height: 64, width: 96 };
                let chosen = geometry.patches_in(&window);
                let values = vec![1.0; chosen.len() * CHANNELS];
                let kernels = PatchKernels { radius: 0, patches: chosen, values };
                let mut white = LinearImage::zeros(CHANNELS, 64, 96);
                white.data.fill(1.0);
                // The renderer refuses kernels that do not cover the window, and their weights add up to one.
                let seen = render_kernels(&geometry, &kernels, &white, window.placement).unwrap();
                assert!(seen.data.iter().all(|v| (v - 1.0).abs() < 1e-6), "{patches:?} {row} {col}");
            }
        }
    }
}
