//! The geometric PSF of a field: rays of a filled pupil, splatted on a grid around the chief ray.

use super::splat;
use crate::gradient::LensGradient;
use crate::lens::Lens;
use crate::paraxial::{FirstOrderCotangent, first_order, pull_back_first_order};
use crate::pupil::{Beam, BeamCotangent, ChiefRay, Quadrature, chief_ray, pull_back_chief, trace_beam};
use crate::trace::Sequence;

/// The grid on which a PSF is given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PsfOptions {
    /// Cells a side.
    pub grid: usize,
    /// Cell size, um.
    pub pitch_um: f64,
}

impl Default for PsfOptions {
    /// The paper's 128 x 128 um at 1 um.
    fn default() -> Self {
        Self { grid: 128, pitch_um: 1.0 }
    }
}

/// PSFs of one field, one per wavelength.
///
/// Rows run along y (away from the axis for a positive field's image), columns along x; the chief
/// ray of the reference wavelength is at the centre, between the two middle cells.
#[derive(Clone, Debug)]
pub struct FieldPsf {
    /// Field angle, rad.
    pub field_rad: f64,
    /// Height of the reference chief ray on the image plane, mm.
    pub chief_y_mm: f64,
    /// `[wavelength][row * grid + column]`, each of unit sum.
    pub values: Vec<Vec<f64>>,
    /// Relative illumination per wavelength: vignetting, pupil growth and cos^4; 1 on the axis of
    /// a lens without them.
    pub illumination: Vec<f64>,
    /// Share of the light that falls inside the grid, per wavelength.
    pub captured: Vec<f64>,
}

/// What a loss asks of a field's PSFs.
#[derive(Clone, Debug)]
pub struct PsfCotangent {
    /// By each value, laid out as [`FieldPsf::values`].
    pub values: Vec<Vec<f64>>,
    /// By each relative illumination.
    pub illumination: Vec<f64>,
}

/// What the gradient needs of the forward pass.
pub struct PsfTape {
    options: PsfOptions,
    reference: Sequence,
    chief: ChiefRay,
    channels: Vec<Channel>,
}

struct Channel {
    sequence: Sequence,
    beam: Beam,
    normalised: Vec<f64>,
    total: f64,
}

/// PSFs of a field at the given wavelengths; `None` if the field's chief ray does not reach the image
/// or no light arrives at all.
pub fn psf(
    lens: &Lens,
    field_rad: f64,
    wavelengths_um: &[f64],
    quadrature: &Quadrature,
    options: &PsfOptions,
) -> Option<FieldPsf> {
    psf_with_tape(lens, field_rad, wavelengths_um, quadrature, options).map(|(psf, _)| psf)
}

/// [`psf`], with what its gradient needs.
pub fn psf_with_tape(
    lens: &Lens,
    field_rad: f64,
    wavelengths_um: &[f64],
    quadrature: &Quadrature,
    options: &PsfOptions,
) -> Option<(FieldPsf, PsfTape)> {
    let reference = lens.at_wavelength(lens.reference_um);
    let stop_radius_mm = first_order(&reference).stop_radius_mm;
    let chief = chief_ray(&reference, field_rad)?;
    let grid = options.grid;

    let mut result = FieldPsf {
        field_rad,
        chief_y_mm: chief.y_mm,
        values: Vec::new(),
        illumination: Vec::new(),
        captured: Vec::new(),
    };
    let mut channels = Vec::new();
    for wavelength in wavelengths_um {
        let sequence = lens.at_wavelength(*wavelength);
        let beam = trace_beam(&sequence, field_rad, stop_radius_mm, quadrature);
        // Splat the traced half of the pupil, then add its mirror image.
        let mut half = vec![0.0; grid * grid];
        for i in 0..quadrature.len() {
            let (u, v) = cell(options, beam.x_mm[i], beam.y_mm[i] - chief.y_mm);
            splat::add(&mut half, grid, u, v, beam.weight[i]);
        }
        let both = with_mirror_image(&half, grid);
        let total: f64 = both.iter().sum();
        let light = beam.illumination();
        if !(total > 0.0 && light > 0.0) {
            return None;
        }
        let normalised: Vec<f64> = both.iter().map(|v| v / total).collect();
        result.values.push(normalised.clone());
        result.illumination.push(light);
        result.captured.push(0.5 * total / light);
        channels.push(Channel { sequence, beam, normalised, total });
    }
    Some((result, PsfTape { options: *options, reference, chief, channels }))
}

impl PsfTape {
    /// Gradient of a loss of the PSFs with respect to every number of the lens.
    pub fn gradient(&self, quadrature: &Quadrature, cotangent: &PsfCotangent) -> LensGradient {
        let mut gradient = LensGradient::zero(self.reference.surfaces.len());
        let grid = self.options.grid;
        let cells_per_mm = 1e3 / self.options.pitch_um;
        let (mut chief_bar, mut stop_radius_bar) = (0.0, 0.0);
        for (k, channel) in self.channels.iter().enumerate() {
            // Normalisation: P = G / S, so Gbar = (Pbar - <Pbar, P>) / S; then the mirror image.
            let wish = &cotangent.values[k];
            let mean: f64 = wish.iter().zip(&channel.normalised).map(|(a, b)| a * b).sum();
            let raw: Vec<f64> = wish.iter().map(|w| (w - mean) / channel.total).collect();
            let both = with_mirror_image(&raw, grid);
            // Every ray moves, and weighs, as the cells around it wish.
            let beam = &channel.beam;
            let mut bar = BeamCotangent::zero(quadrature.len());
            for i in 0..quadrature.len() {
                let (u, v) = cell(&self.options, beam.x_mm[i], beam.y_mm[i] - self.chief.y_mm);
                let [by_u, by_v, by_light] = splat::gather(&both, grid, u, v);
                bar.x[i] = beam.weight[i] * by_u * cells_per_mm;
                bar.y[i] = beam.weight[i] * by_v * cells_per_mm;
                bar.weight[i] = by_light + cotangent.illumination[k];
                chief_bar -= bar.y[i];
            }
            stop_radius_bar += beam.pull_back(&channel.sequence, quadrature, &bar, &mut gradient);
        }
        pull_back_chief(&self.reference, &self.chief, chief_bar, &mut gradient);
        let wish = FirstOrderCotangent { stop_radius: stop_radius_bar, ..Default::default() };
        pull_back_first_order(&self.reference, wish, &mut gradient);
        gradient
    }
}

/// Cell coordinates of a point given relative to the chief ray, mm.
#[inline]
fn cell(options: &PsfOptions, x_mm: f64, y_mm: f64) -> (f64, f64) {
    let centre = 0.5 * (options.grid as f64 - 1.0);
    let per_mm = 1e3 / options.pitch_um;
    (x_mm * per_mm + centre, y_mm * per_mm + centre)
}

/// Adds to a grid its mirror image in x; this map is its own transpose.
fn with_mirror_image(half: &[f64], grid: usize) -> Vec<f64> {
    let mut both = vec![0.0; half.len()];
    for (row, out) in half.chunks_exact(grid).zip(both.chunks_exact_mut(grid)) {
        for i in 0..grid {
            out[i] = row[i] + row[grid - 1 - i];
        }
    }
    both
}
