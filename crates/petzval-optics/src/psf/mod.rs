//! Point-spread functions: what the lens makes of a point of light.
//!
//! Rays of a filled pupil are splatted on a grid around the chief ray. [`psf`] evaluates them from polynomials over the
//! pupil, through one to four hundred traced rays; where rays that the polynomials were not fitted to land too far from
//! where these say, or where rays of the stop are lost, it traces a ray for every pupil cell, as the reference
//! [`psf_traced`] always does.
//!
//! With [`PsfKind::Diffraction`] it is waves that are added, see [`wave`](crate::wave).

mod grid;
mod polynomial;
mod splat;
mod traced;

pub use grid::{PsfKind, PsfMethod, PsfOptions};

use grid::{LightCotangent, with_mirror_image};
use polynomial::{Blocks, PolynomialChannel};
use traced::TracedChannel;

use crate::gradient::LensGradient;
use crate::lens::Lens;
use crate::paraxial::{FirstOrderCotangent, first_order, pull_back_first_order};
use crate::pupil::{ChiefRay, PupilMap, Quadrature, chief_ray, pull_back_chief};
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
    /// Place of the reference chief ray across the plane of the fields, mm; 0 in a lens of which that is a plane of symmetry.
    pub chief_x_mm: f64,
    /// Height of the reference chief ray on the image plane, mm.
    pub chief_y_mm: f64,
    /// `[wavelength][row * grid + column]`, each of unit sum.
    pub values: Vec<Vec<f64>>,
    /// Relative illumination per wavelength: vignetting, pupil growth and cos^4; 1 on the axis of
    /// a lens without them.
    pub illumination: Vec<f64>,
    /// Share of the light that falls inside the grid, per wavelength.
    pub captured: Vec<f64>,
    /// How it was made, per wavelength.
    pub method: Vec<PsfMethod>,
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
    light: Light,
    /// What all values of the grid add up to before they are normalised.
    total: f64,
}

/// Where the light of a channel came from.
enum Light {
    Polynomial(Box<PolynomialChannel>),
    Traced(Box<TracedChannel>),
    Wave(Box<WaveChannel>),
}

/// Which way to take.
#[derive(Clone, Copy, PartialEq)]
enum Way {
    Fast,
    Reference,
}

/// PSFs of a field at the given wavelengths; `None` if the field's chief ray does not reach the image
/// or no light arrives at all; by diffraction also if rays of the stop are lost or the wavefront is no smooth function.
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
    make(lens, field_rad, wavelengths_um, quadrature, options, Way::Reference).map(|(psf, _)| psf)
}

/// [`psf`], with what its gradient needs.
///
/// Where every cell is traced because rays of the stop are lost, the gradient leaves out how the light of a ray changes with
/// the pupil's aberrations; how rays move, and how apertures cut them, is always in it.
pub fn psf_with_tape(
    lens: &Lens,
    field_rad: f64,
    wavelengths_um: &[f64],
    quadrature: &Quadrature,
    options: &PsfOptions,
) -> Option<(FieldPsf, PsfTape)> {
    make(lens, field_rad, wavelengths_um, quadrature, options, Way::Fast)
}

/// [`psf_traced`], with what its gradient needs.
pub fn psf_traced_with_tape(
    lens: &Lens,
    field_rad: f64,
    wavelengths_um: &[f64],
    quadrature: &Quadrature,
    options: &PsfOptions,
) -> Option<(FieldPsf, PsfTape)> {
    make(lens, field_rad, wavelengths_um, quadrature, options, Way::Reference)
}

fn make(
    lens: &Lens,
    field_rad: f64,
    wavelengths_um: &[f64],
    quadrature: &Quadrature,
    options: &PsfOptions,
    way: Way,
) -> Option<(FieldPsf, PsfTape)> {
    let reference = lens.at_wavelength(lens.reference_um);
    let stop_radius_mm = first_order(&reference).stop_radius_mm;
    let chief = chief_ray(&reference, field_rad)?;
    let mut result = FieldPsf {
        field_rad,
        chief_x_mm: chief.x_mm,
        chief_y_mm: chief.y_mm,
        values: Vec::new(),
        illumination: Vec::new(),
        captured: Vec::new(),
        method: Vec::new(),
    };
    let chief_mm = [chief.x_mm, chief.y_mm];
    // Half a pupil and its mirror image weigh twice the half.
    let is_half = reference.is_mirror_symmetric;
    let times = if is_half { 2.0 } else { 1.0 };
    let mut channels: Vec<Channel> = Vec::new();
    let mut room = Blocks::zero(options.grid);
    for wavelength in wavelengths_um {
        let sequence = lens.at_wavelength(*wavelength);
        if options.kind == PsfKind::Diffraction {
            let like = channels.last().and_then(|c| c.light.wave());
            let grid = options.image_grid();
            let beyond_mm = 0.5 * grid.cells as f64 * grid.pitch_mm;
            let channel = WaveChannel::new(&sequence, field_rad, stop_radius_mm, chief_mm, beyond_mm, like)?;
            let Shown { mut values, illumination } = channel.show(grid);
            let total: f64 = values.iter().sum();
            if !(total > 0.0 && illumination > 0.0) {
                return None;
            }
            values.iter_mut().for_each(|v| *v /= total);
            result.values.push(values);
            result.illumination.push(illumination);
            result.captured.push(total);
            result.method.push(PsfMethod::Wave { degree: channel.degree() });
            channels.push(Channel { sequence, light: Light::Wave(Box::new(channel)), total });
            continue;
        }
        let fitted = (way == Way::Fast).then(|| {
            let like = channels.last().and_then(|c| c.light.map());
            PolynomialChannel::new(&sequence, field_rad, stop_radius_mm, like)
        });
        let (light, mut values, illumination) = match fitted.flatten() {
            Some(channel) => {
                let (values, illumination) = channel.splat(quadrature, options, chief_mm, &mut room);
                (Light::Polynomial(Box::new(channel)), values, illumination)
            }
            None => {
                let channel = TracedChannel::new(&sequence, field_rad, stop_radius_mm, quadrature);
                let (values, illumination) = channel.splat(options, chief_mm, is_half);
                (Light::Traced(Box::new(channel)), values, illumination)
            }
        };
        let total: f64 = values.iter().sum();
        if !(total > 0.0 && illumination > 0.0) {
            return None;
        }
        let per_total = 1.0 / total;
        values.iter_mut().for_each(|v| *v *= per_total);
        result.values.push(values);
        result.illumination.push(illumination);
        result.captured.push(total / times / illumination);
        result.method.push(light.method());
        channels.push(Channel { sequence, light, total });
    }
    Some((result, PsfTape { options: *options, reference, chief, channels }))
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
    /// Gradient of a loss of the PSFs, of which `psf` are the values, with respect to every number of the lens.
    pub fn gradient(
        &self,
        psf: &FieldPsf,
        quadrature: &Quadrature,
        cotangent: &PsfCotangent,
    ) -> LensGradient {
        let mut gradient = LensGradient::zero(self.reference.surfaces.len());
        let (mut chief_bar, mut stop_radius_bar) = ([0.0; 2], 0.0);
        for (k, channel) in self.channels.iter().enumerate() {
            // Normalisation: P = G / S, so Gbar = (Pbar - <Pbar, P>) / S; then the mirror image.
            let wish = &cotangent.values[k];
            let mean: f64 = wish.iter().zip(&psf.values[k]).map(|(a, b)| a * b).sum();
            let raw: Vec<f64> = wish.iter().map(|w| (w - mean) / channel.total).collect();
            let is_half = self.reference.is_mirror_symmetric && !matches!(channel.light, Light::Wave(_));
            let bar = LightCotangent {
                grid: if is_half { with_mirror_image(&raw, self.options.grid) } else { raw },
                illumination: cotangent.illumination[k],
                options: &self.options,
                chief_mm: [self.chief.x_mm, self.chief.y_mm],
            };
            // Pull the cells' cotangents back to ray positions and weights.
            let (chief, stop_radius) = match &channel.light {
                Light::Polynomial(c) => c.pull_back(&channel.sequence, quadrature, &bar, &mut gradient),
                Light::Traced(c) => c.pull_back(&channel.sequence, &bar, &mut gradient),
                Light::Wave(c) => {
                    let grid = self.options.image_grid();
                    c.pull_back(&channel.sequence, grid, &bar.grid, bar.illumination, &mut gradient)
                }
            };
            chief_bar = [chief_bar[0] + chief[0], chief_bar[1] + chief[1]];
            stop_radius_bar += stop_radius;
        }
        pull_back_chief(&self.reference, &self.chief, chief_bar, &mut gradient);
        let wish = FirstOrderCotangent { stop_radius: stop_radius_bar, ..Default::default() };
        pull_back_first_order(&self.reference, wish, &mut gradient);
        gradient.keep_symmetry(&self.reference);
        gradient
    }
}
