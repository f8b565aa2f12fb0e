//! Point-spread functions: the image of a point of light.
//!
//! The light of a filled pupil is splatted on a grid around the chief ray. [`psf`] evaluates ray positions from
//! polynomials over the pupil, through one to four hundred traced rays. If the polynomials miss other traced rays by
//! too much, or if rays through the stop are lost, it traces a ray for every pupil cell, as the reference
//! [`psf_traced`] always does.
//!
//! A thin lens has no aberrations: [`perfect_psf`]. [`PsfKind::Diffraction`] adds waves instead of rays, see [`wave`](crate::wave).

mod airy;
mod converged;
mod grid;
mod perfect;
mod polynomial;
mod splat;
mod traced;

pub use converged::psf_converged;
pub use grid::{PsfKind, PsfMethod, PsfOptions};
pub use perfect::{PerfectImage, focused_thin_lens_mm, perfect_psf};

use grid::{LightChange, LightCotangent, with_mirror_image};
use polynomial::{Blocks, PolynomialChannel};
use traced::TracedChannel;

use crate::gradient::LensGradient;
use crate::lens::Lens;
use crate::paraxial::{FirstOrderCotangent, first_order, pull_back_first_order};
use crate::pupil::{ChiefRay, ImageArea, PupilMap, Quadrature, chief_ray, pull_back_chief};
use crate::trace::Sequence;
use crate::wave::{Shown, WaveChannel};

/// PSFs of one field, one per wavelength.
///
/// Rows run along y (away from the axis for the image of a positive field), columns along x; the
/// chief ray of the reference wavelength is at the centre, between the two middle cells.
#[derive(Clone, Debug)]
pub struct FieldPsf {
    /// Field angle, rad.
    pub field_rad: f64,
    /// x of the reference chief ray on the image plane, mm; 0 in a lens that is symmetric about the plane of the fields.
    pub chief_x_mm: f64,
    /// Height of the reference chief ray on the image plane, mm.
    pub chief_y_mm: f64,
    /// `[wavelength][row * grid + column]`, each of unit sum.
    pub values: Vec<Vec<f64>>,
    /// Relative illumination per wavelength: irradiance of the image of a uniform scene by vignetting, growth of the pupil, cos^4
    /// and distortion; 1 on the axis of a lens without them.
    pub illumination: Vec<f64>,
    /// Ideal image area per image area around the field, see [`ImageArea`]: the share of [`FieldPsf::illumination`] that is
    /// due to distortion.
    pub image_area: f64,
    /// Share of the light that falls inside the grid, per wavelength.
    pub captured: Vec<f64>,
    /// Method, per wavelength.
    pub method: Vec<PsfMethod>,
}

/// Cotangents of a field's PSFs.
#[derive(Clone, Debug)]
pub struct PsfCotangent {
    /// By each value, laid out as [`FieldPsf::values`].
    pub values: Vec<Vec<f64>>,
    /// By each relative illumination.
    pub illumination: Vec<f64>,
    /// By the height of the reference chief ray on the image plane, 1/mm.
    pub chief_y: f64,
}

/// Derivatives of a field's PSFs along a direction: a change of every number of the lens.
#[derive(Clone, Debug)]
pub struct PsfTangent {
    /// Of each value, laid out as [`FieldPsf::values`].
    pub values: Vec<Vec<f64>>,
    /// Of each relative illumination.
    pub illumination: Vec<f64>,
    /// Of x and y of the reference chief ray on the image plane, mm.
    pub chief_mm: [f64; 2],
    /// Of each share of the light that falls inside the grid.
    pub captured: Vec<f64>,
}

/// Intermediate results of the forward pass, for derivatives: backward by [`PsfTape::gradient`], forward by [`PsfTape::push_forward`].
pub struct PsfTape {
    options: PsfOptions,
    reference: Sequence,
    chief: ChiefRay,
    area: ImageArea,
    channels: Vec<Channel>,
}

struct Channel {
    sequence: Sequence,
    light: Light,
    /// Sum of the grid's values before normalisation.
    total: f64,
    /// Light per ideal image area.
    density: f64,
}

/// The light of a channel, by its method.
enum Light {
    Polynomial(Box<PolynomialChannel>),
    Traced(Box<TracedChannel>),
    Wave(Box<WaveChannel>),
}

/// The fast path, or the reference.
#[derive(Clone, Copy, PartialEq)]
enum Evaluation {
    Fast,
    Reference,
}

/// PSFs of a field at the given wavelengths.
///
/// `None` if the chief ray of the field does not reach the image, or no light arrives. By diffraction it is also `None` if rays through the
/// stop are lost, if the wavefront is not smooth, or if grid and spot together are wider than the nodes of the pupil can hold.
pub fn psf(
    lens: &Lens,
    field_rad: f64,
    wavelengths_um: &[f64],
    quadrature: &Quadrature,
    options: &PsfOptions,
) -> Option<FieldPsf> {
    psf_with_tape(lens, field_rad, wavelengths_um, quadrature, options).map(|(psf, _)| psf)
}

/// [`psf`] with a traced ray for every pupil cell: the reference.
pub fn psf_traced(
    lens: &Lens,
    field_rad: f64,
    wavelengths_um: &[f64],
    quadrature: &Quadrature,
    options: &PsfOptions,
) -> Option<FieldPsf> {
    make(lens, field_rad, wavelengths_um, quadrature, options, Evaluation::Reference).map(|(psf, _)| psf)
}

/// [`psf`] with the tape for its gradient.
///
/// If every cell is traced because rays through the stop are lost, the gradient leaves out the change of a ray's light with
/// the pupil's aberrations. It always includes the motion of rays and their clipping by apertures.
pub fn psf_with_tape(
    lens: &Lens,
    field_rad: f64,
    wavelengths_um: &[f64],
    quadrature: &Quadrature,
    options: &PsfOptions,
) -> Option<(FieldPsf, PsfTape)> {
    make(lens, field_rad, wavelengths_um, quadrature, options, Evaluation::Fast)
}

/// [`psf_traced`] with the tape for its gradient.
pub fn psf_traced_with_tape(
    lens: &Lens,
    field_rad: f64,
    wavelengths_um: &[f64],
    quadrature: &Quadrature,
    options: &PsfOptions,
) -> Option<(FieldPsf, PsfTape)> {
    make(lens, field_rad, wavelengths_um, quadrature, options, Evaluation::Reference)
}

fn make(
    lens: &Lens,
    field_rad: f64,
    wavelengths_um: &[f64],
    quadrature: &Quadrature,
    options: &PsfOptions,
    evaluation: Evaluation,
) -> Option<(FieldPsf, PsfTape)> {
    // Trace the chief ray of the reference wavelength, which is the centre of the grid.
    let reference = lens.at_wavelength(lens.reference_um);
    let stop_radius_mm = first_order(&reference).stop_radius_mm;
    let chief = chief_ray(&reference, field_rad)?;
    let area = ImageArea::new(&reference, field_rad, &chief)?;
    let mut result = FieldPsf {
        field_rad,
        chief_x_mm: chief.x_mm,
        chief_y_mm: chief.y_mm,
        values: Vec::new(),
        illumination: Vec::new(),
        image_area: area.ratio,
        captured: Vec::new(),
        method: Vec::new(),
    };
    let chief_mm = [chief.x_mm, chief.y_mm];
    // In a symmetric lens, trace half of the pupil; with its mirror image it has twice the light.
    let is_half = reference.is_mirror_symmetric;
    let times = if is_half { 2.0 } else { 1.0 };
    let mut channels: Vec<Channel> = Vec::new();
    let mut room = Blocks::zero(options.grid);
    for wavelength in wavelengths_um {
        // Waves: transform the wave to the grid, and normalise.
        let sequence = lens.at_wavelength(*wavelength);
        if options.kind == PsfKind::Diffraction {
            let like = channels.last().and_then(|c| c.light.wave());
            let grid = options.image_grid();
            let beyond_mm = 0.5 * grid.cells as f64 * grid.pitch_mm;
            let channel = WaveChannel::new(&sequence, field_rad, stop_radius_mm, chief_mm, beyond_mm, like)?;
            let Shown { mut values, density } = channel.show(grid);
            let total: f64 = values.iter().sum();
            if !(total > 0.0 && density > 0.0) {
                return None;
            }
            values.iter_mut().for_each(|v| *v /= total);
            result.values.push(values);
            result.illumination.push(density * area.ratio);
            result.captured.push(total);
            result.method.push(PsfMethod::Wave { degree: channel.degree() });
            channels.push(Channel { sequence, light: Light::Wave(Box::new(channel)), total, density });
            continue;
        }
        // Rays: splat by the pupil polynomial, or trace a ray for every pupil cell if it does not hold.
        let fitted = (evaluation == Evaluation::Fast).then(|| {
            let like = channels.last().and_then(|c| c.light.map());
            PolynomialChannel::new(&sequence, field_rad, stop_radius_mm, like)
        });
        let (light, mut values, density) = match fitted.flatten() {
            Some(channel) => {
                let (values, density) = channel.splat(quadrature, options, chief_mm, &mut room);
                (Light::Polynomial(Box::new(channel)), values, density)
            }
            None => {
                let channel = TracedChannel::new(&sequence, field_rad, stop_radius_mm, quadrature);
                let (values, density) = channel.splat(options, chief_mm, is_half);
                (Light::Traced(Box::new(channel)), values, density)
            }
        };
        // Normalise to unit sum, and record the share of the light on the grid.
        let total: f64 = values.iter().sum();
        if !(total > 0.0 && density > 0.0) {
            return None;
        }
        let per_total = 1.0 / total;
        values.iter_mut().for_each(|v| *v *= per_total);
        result.values.push(values);
        result.illumination.push(density * area.ratio);
        result.captured.push(total / times / density);
        result.method.push(light.method());
        channels.push(Channel { sequence, light, total, density });
    }
    Some((result, PsfTape { options: *options, reference, chief, area, channels }))
}

impl Light {
    fn method(&self) -> PsfMethod {
        match self {
            Self::Polynomial(channel) => channel.method(),
            Self::Traced(_) => PsfMethod::Traced,
            Self::Wave(channel) => PsfMethod::Wave { degree: channel.degree() },
        }
    }

    fn wave(&self) -> Option<&WaveChannel> {
        match self {
            Self::Wave(channel) => Some(channel),
            _ => None,
        }
    }

    fn map(&self) -> Option<&PupilMap> {
        match self {
            Self::Polynomial(channel) => Some(channel.map()),
            Self::Traced(_) | Self::Wave(_) => None,
        }
    }
}

impl PsfTape {
    /// Gradient of a loss of the PSFs `psf` with respect to every number of the lens.
    pub fn gradient(
        &self,
        psf: &FieldPsf,
        quadrature: &Quadrature,
        cotangent: &PsfCotangent,
    ) -> LensGradient {
        let mut gradient = LensGradient::zero(self.reference.surfaces.len());
        let (mut chief_bar, mut stop_radius_bar) = ([0.0, cotangent.chief_y], 0.0);
        let mut area_bar = 0.0;
        for (k, channel) in self.channels.iter().enumerate() {
            // Undo the normalisation P = G / S: Gbar = (Pbar - <Pbar, P>) / S. Then add the mirror image.
            let values_bar = &cotangent.values[k];
            if cotangent.illumination[k] == 0.0 && values_bar.iter().all(|w| *w == 0.0) {
                continue;
            }
            let mean: f64 = values_bar.iter().zip(&psf.values[k]).map(|(a, b)| a * b).sum();
            let raw: Vec<f64> = values_bar.iter().map(|w| (w - mean) / channel.total).collect();
            let is_half = self.reference.is_mirror_symmetric && !matches!(channel.light, Light::Wave(_));
            let bar = LightCotangent {
                grid: if is_half { with_mirror_image(&raw, self.options.grid) } else { raw },
                density: cotangent.illumination[k] * self.area.ratio,
                options: &self.options,
                chief_mm: [self.chief.x_mm, self.chief.y_mm],
            };
            area_bar += cotangent.illumination[k] * channel.density;
            // Pull the cells' cotangents back to ray positions and weights, and these to the lens.
            let (chief, stop_radius) = match &channel.light {
                Light::Polynomial(c) => c.pull_back(&channel.sequence, quadrature, &bar, &mut gradient),
                Light::Traced(c) => c.pull_back(&channel.sequence, &bar, &mut gradient),
                Light::Wave(c) => {
                    let grid = self.options.image_grid();
                    c.pull_back(&channel.sequence, grid, &bar.grid, bar.density, &mut gradient)
                }
            };
            chief_bar = [chief_bar[0] + chief[0], chief_bar[1] + chief[1]];
            stop_radius_bar += stop_radius;
        }
        // Add the cotangents of the chief ray, of the image area and of the stop radius, which all channels share.
        pull_back_chief(&self.reference, &self.chief, chief_bar, &mut gradient);
        if area_bar != 0.0 {
            self.area.pull_back(&self.reference, area_bar, &mut gradient);
        }
        let first_order_bar = FirstOrderCotangent { stop_radius: stop_radius_bar, ..Default::default() };
        pull_back_first_order(&self.reference, first_order_bar, &mut gradient);
        gradient.keep_symmetry(&self.reference);
        gradient
    }

    /// Derivatives of the PSFs `psf` along `change`, a change of every number of the lens: the transpose of [`PsfTape::gradient`].
    ///
    /// What the gradient holds is held here too: the nodes of the pupil and of waves, the degrees of polynomials and, in a lens
    /// that is symmetric about the plane of the fields, the numbers that break this symmetry.
    pub fn push_forward(&self, psf: &FieldPsf, quadrature: &Quadrature, change: &LensGradient) -> PsfTangent {
        let mut change = change.clone();
        change.keep_symmetry(&self.reference);
        // Move the chief ray, the image area and the stop radius, which all channels share. Each is one number, so its gradient
        // is cheap.
        let along = |pull_back: &dyn Fn(&mut LensGradient)| {
            let mut gradient = LensGradient::zero(self.reference.surfaces.len());
            pull_back(&mut gradient);
            gradient.along(&change)
        };
        let chief_mm = [[1.0, 0.0], [0.0, 1.0]]
            .map(|axis| along(&|gradient| pull_back_chief(&self.reference, &self.chief, axis, gradient)));
        let area = along(&|gradient| self.area.pull_back(&self.reference, 1.0, gradient));
        let stop_radius = FirstOrderCotangent { stop_radius: 1.0, ..Default::default() };
        let stop_growth = along(&|gradient| pull_back_first_order(&self.reference, stop_radius, gradient))
            / first_order(&self.reference).stop_radius_mm;
        let moved = LightChange {
            lens: &change,
            stop_growth,
            chief_change_mm: chief_mm,
            options: &self.options,
            chief_mm: [self.chief.x_mm, self.chief.y_mm],
        };
        let mut tangent =
            PsfTangent { values: Vec::new(), illumination: Vec::new(), chief_mm, captured: Vec::new() };
        for (k, channel) in self.channels.iter().enumerate() {
            // Move rays and weights, and with them the light of the cells.
            let sequence = &channel.sequence;
            let (mut values, density) = match &channel.light {
                Light::Polynomial(c) => c.push_forward(sequence, quadrature, &moved),
                Light::Traced(c) => c.push_forward(sequence, &moved, self.reference.is_mirror_symmetric),
                Light::Wave(c) => {
                    let shown =
                        c.push_forward(sequence, self.options.image_grid(), &change, stop_growth, chief_mm);
                    (shown.values, shown.density)
                }
            };
            // Differentiate the normalisation P = G / S: dP = (dG - P dS) / S.
            let total: f64 = values.iter().sum();
            for (by, value) in values.iter_mut().zip(&psf.values[k]) {
                *by = (*by - value * total) / channel.total;
            }
            tangent.values.push(values);
            tangent.illumination.push(density * self.area.ratio + channel.density * area);
            // Waves have unit energy; the light of rays on the grid is a share of all of theirs.
            let growth = match &channel.light {
                Light::Wave(_) => total / channel.total,
                Light::Polynomial(_) | Light::Traced(_) => total / channel.total - density / channel.density,
            };
            tangent.captured.push(psf.captured[k] * growth);
        }
        tangent
    }
}
