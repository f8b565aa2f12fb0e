//! Contrast at a spatial frequency: by waves from the overlap of the wave with its shifted copy, by rays from PSFs.
//!
//! By rays along x, `O(f) = sum P(x, y) exp(-2 pi i f x)` over the grid, and alike along y; P is the mean PSF of the wavelengths about one
//! point, so that lateral colour counts. The modulus of O is divided by what the grid itself takes away: splatted light is spread
//! over cells by a quadratic B-spline, whose transform is `sinc(f p)^3` at a pitch p.

use std::f64::consts::{PI, TAU};

use petzval_fourier::Complex64;

use super::{Better, FieldRays, FieldSet, Merit};
use crate::gradient::LensGradient;
use crate::lens::Lens;
use crate::psf::{PsfCotangent, PsfKind, PsfOptions, psf_with_tape};
use crate::pupil::Quadrature;
use crate::trace::Sequence;
use crate::wave::Overlap;

/// Cells a period of the frequency: by rays the grid then aliases less than 5e-4.
const CELLS_PER_PERIOD: f64 = 16.0;

/// Cells a side.
const GRID: usize = 128;

/// Pupil cells a side of geometric PSFs.
const PUPIL_CELLS: usize = 64;

/// The mean over fields of the mean of the sagittal and the tangential MTF at one frequency, 0 ... 1.
#[derive(Clone, Debug)]
pub struct Mtf {
    /// Spatial frequency on the image plane, cycles per mm.
    frequency_per_mm: f64,
    /// Fields.
    fields: FieldSet,
    kind: PsfKind,
    /// The grid by rays.
    options: PsfOptions,
    quadrature: Quadrature,
    /// What the grid takes away.
    loss: f64,
}

fn sinc(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { (PI * x).sin() / (PI * x) }
}

impl Mtf {
    /// Over the fields of a lens, see [`FieldSet::of`]; `frequency_per_mm` is positive, and below the cutoff of the lens.
    ///
    /// By rays the grid is eight periods wide. Light beyond it counts as light without contrast: otherwise a lens out of focus would have the
    /// contrast of the few rays that land on the grid.
    pub fn new(lens: &Lens, frequency_per_mm: f64, kind: PsfKind) -> Self {
        let pitch_um = 1e3 / (CELLS_PER_PERIOD * frequency_per_mm);
        Self {
            frequency_per_mm,
            fields: FieldSet::of(lens),
            kind,
            options: PsfOptions { grid: GRID, pitch_um, kind: PsfKind::Geometric },
            quadrature: Quadrature::grid(PUPIL_CELLS)
                .unwrap_or_else(|_| unreachable!("a grid that is allowed")),
            loss: sinc(1e-3 * frequency_per_mm * pitch_um).powi(3),
        }
    }

    /// The same over other fields.
    pub fn with_fields(self, fields: FieldSet) -> Self {
        Self { fields, ..self }
    }

    /// The same with other pupil cells for geometric PSFs; 64 a side are the usual.
    pub fn with_quadrature(self, quadrature: Quadrature) -> Self {
        Self { quadrature, ..self }
    }

    /// Cosine and sine at the cells of one axis.
    fn phases(&self) -> Vec<[f64; 2]> {
        let per_cell = TAU * 1e-3 * self.frequency_per_mm * self.options.pitch_um;
        (0..self.options.grid)
            .map(|i| {
                let (sin, cos) = ((i as f64 - 0.5 * (self.options.grid as f64 - 1.0)) * per_cell).sin_cos();
                [cos, sin]
            })
            .collect()
    }

    fn of_field(&self, lens: &Lens, field_rad: f64, with_gradient: bool) -> Option<(f64, LensGradient)> {
        match self.kind {
            PsfKind::Geometric => self.by_rays(lens, field_rad, with_gradient),
            PsfKind::Diffraction => self.by_waves(lens, field_rad, with_gradient),
        }
    }

    fn by_waves(&self, lens: &Lens, field_rad: f64, with_gradient: bool) -> Option<(f64, LensGradient)> {
        let rays = FieldRays::new(lens, field_rad)?;
        let mut beams: Vec<(Sequence, Overlap)> = Vec::new();
        for um in &lens.wavelengths_um {
            let sequence = lens.at_wavelength(*um);
            let like = beams.last().map(|(_, overlap)| overlap);
            let (stop_mm, chief_mm) = (rays.stop_radius_mm, rays.chief_mm());
            let frequency = self.frequency_per_mm;
            let overlap = Overlap::new(&sequence, field_rad, stop_mm, chief_mm, (frequency, 0.0), like)?;
            beams.push((sequence, overlap));
        }
        let share = 1.0 / beams.len() as f64;
        let transfer = [0, 1].map(|k| share * beams.iter().map(|(_, o)| o.transfer[k]).sum::<Complex64>());
        let value = 0.5 * (transfer[0].norm() + transfer[1].norm());
        let mut gradient = LensGradient::zero(lens.surfaces.len());
        if with_gradient {
            // d|O| = (Re O dRe O + Im O dIm O) / |O|
            let bars =
                transfer.map(|o| if o.norm() > 0.0 { 0.5 * share * o / o.norm() } else { Complex64::ZERO });
            let by_beam =
                beams.iter().map(|(sequence, overlap)| overlap.pull_back(sequence, bars, &mut gradient));
            let by_beam: Vec<_> = by_beam.collect();
            rays.pull_back(by_beam.into_iter(), &mut gradient);
        }
        value.is_finite().then_some((value, gradient))
    }

    fn by_rays(&self, lens: &Lens, field_rad: f64, with_gradient: bool) -> Option<(f64, LensGradient)> {
        let (psf, tape) =
            psf_with_tape(lens, field_rad, &lens.wavelengths_um, &self.quadrature, &self.options)?;
        let (phases, grid) = (self.phases(), self.options.grid);
        // The PSFs have a sum of 1 on the grid, and the share of the light there is `captured`.
        let share = 1.0 / (psf.values.len() as f64 * self.loss);
        let shares: Vec<f64> = psf.captured.iter().map(|captured| share * captured).collect();
        // Cosine and sine sums along x (sagittal) and y (tangential).
        let mut sums = [[0.0; 2]; 2];
        for (values, share) in psf.values.iter().zip(&shares) {
            for (row, y) in values.chunks_exact(grid).zip(&phases) {
                for (value, x) in row.iter().zip(&phases) {
                    for k in 0..2 {
                        sums[0][k] += share * value * x[k];
                        sums[1][k] += share * value * y[k];
                    }
                }
            }
        }
        let [sagittal, tangential] = sums.map(|[c, s]| c.hypot(s));
        let value = 0.5 * (sagittal + tangential);
        if !with_gradient {
            return Some((value, LensGradient::zero(lens.surfaces.len())));
        }
        // d|O| = (C dC + S dS) / |O|. Light that crosses the rim of the grid has no slope there.
        let direction = |section: usize, size: f64| {
            if size > 0.0 { sums[section].map(|v| 0.5 * v / size) } else { [0.0; 2] }
        };
        let (by_x, by_y) = (direction(0, sagittal), direction(1, tangential));
        let along = |by: [f64; 2], phase: &[f64; 2]| by[0] * phase[0] + by[1] * phase[1];
        let mut bars = Vec::with_capacity(grid * grid);
        for y in &phases {
            bars.extend(phases.iter().map(|x| along(by_x, x) + along(by_y, y)));
        }
        let of_colour = |share: &f64| bars.iter().map(|bar| share * bar).collect();
        let cotangent = PsfCotangent {
            values: shares.iter().map(of_colour).collect(),
            illumination: vec![0.0; shares.len()],
            chief_y: 0.0,
        };
        Some((value, tape.gradient(&psf, &self.quadrature, &cotangent)))
    }
}

impl Merit for Mtf {
    fn name(&self) -> String {
        format!("MTF at {}/mm{}", self.frequency_per_mm, self.fields.in_name())
    }

    fn unit(&self) -> &str {
        ""
    }

    fn better(&self) -> Better {
        Better::Higher
    }

    fn value(&self, lens: &Lens) -> Option<f64> {
        self.fields.mean(lens, |field| self.of_field(lens, field, false)).map(|(value, _)| value)
    }

    fn with_gradient(&self, lens: &Lens) -> Option<(f64, Option<LensGradient>)> {
        let (value, gradient) = self.fields.mean(lens, |field| self.of_field(lens, field, true))?;
        Some((value, Some(gradient)))
    }

    /// By waves too: contrast falls with the variance of the slopes of the wavefront, which are places on the image.
    fn fields_of_rays(&self, lens: &Lens) -> Option<Vec<(f64, f64)>> {
        Some(self.fields.seen(lens))
    }
}
