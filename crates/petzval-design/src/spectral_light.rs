//! A spectral scene through a lens: every band is spread by the PSFs of its own wavelength.

use petzval_base::Cancel;
use petzval_camera::image::{CHANNELS, LinearImage};
use petzval_camera::render::{Distortion, RenderGeometry, Window, light_on_pixels};
use petzval_camera::sensor::Colour;
use petzval_camera::spectral::{ColourElectrons, ElectronsError};
use petzval_optics::lens::Lens;

use crate::error::{DesignError, Result};
use crate::lens::psf_plan::PsfPlan;

/// The bands of a scene, made when they are needed.
pub struct Bands<'a> {
    /// Wavelength of each band, um, ascending.
    pub um: &'a [f64],
    /// Electrons per unit radiance of each colour and band ([`petzval_camera::spectral::band_weights`]).
    pub weights: &'a [(Colour, Vec<f64>)],
    /// Samples of the scene along a side of a pixel.
    pub samples: usize,
    /// Radiance of three bands on the whole sensor, one plane each; with a distortion, on its ideal frame. Each pixel has
    /// `samples` x `samples` values.
    pub planes: &'a dyn Fn([usize; CHANNELS]) -> LinearImage,
    /// Where the points of the scene land, if its distortion is rendered.
    pub distortion: Option<&'a Distortion>,
}

impl Bands<'_> {
    /// Indices of the bands to which some pixel answers; the others need no tracing.
    pub fn seen(&self) -> Vec<usize> {
        let answers = |band: usize| self.weights.iter().any(|(_, weight)| weight[band] > 0.0);
        (0..self.um.len()).filter(|band| answers(*band)).collect()
    }
}

/// Electrons for each filter colour on a window of the sensor when `lens` looks at a scene.
///
/// What the lens sees beyond the sensor repeats its edge. `plan` gives fields,
/// grid and pupil; its wavelengths are replaced by those of the bands, three at a time, as many as the renderer takes, so no
/// more than three planes are in memory. Relative illumination multiplies the electrons off the axis. `done` is called with every band
/// that has been rendered. A call that is cancelled ends soon, with an error of which [`DesignError::is_stopped`] is true.
pub fn render_spectral(
    lens: &Lens,
    plan: &PsfPlan,
    geometry: &RenderGeometry,
    bands: &Bands,
    window: Window,
    done: &dyn Fn(usize),
    cancel: &Cancel,
) -> Result<ColourElectrons> {
    let colours: Vec<Colour> = bands.weights.iter().map(|(colour, _)| *colour).collect();
    let mut electrons: Option<ColourElectrons> = None;
    for group in bands.seen().chunks(CHANNELS) {
        // A last group of less than three bands repeats one, which counts once.
        let three = [0, 1, 2].map(|k| group[k.min(group.len() - 1)]);
        let light = through_lens(lens, plan, geometry, bands, three, window, cancel).map_err(|error| {
            DesignError::InBands { um: group.iter().map(|b| bands.um[*b]).collect(), error: Box::new(error) }
        })?;
        let sum = electrons.get_or_insert_with(|| ColourElectrons::none(&colours, light.height, light.width));
        for (k, band) in group.iter().enumerate() {
            sum.add(light.plane(k), bands.weights, *band);
            done(*band);
        }
    }
    electrons.ok_or_else(|| {
        let (low_um, high_um) = (bands.um.first(), bands.um.last());
        let um = |end: Option<&f64>| end.copied().unwrap_or(0.0);
        ElectronsError::NoBand { low_um: um(low_um), high_um: um(high_um) }.into()
    })
}

/// Radiance of three bands as the lens spreads and dims it.
fn through_lens(
    lens: &Lens,
    plan: &PsfPlan,
    geometry: &RenderGeometry,
    bands: &Bands,
    three: [usize; CHANNELS],
    window: Window,
    cancel: &Cancel,
) -> Result<LinearImage> {
    let bank = PsfPlan { wavelengths_um: three.map(|b| bands.um[b]), ..plan.clone() }.bank(lens)?;
    let picture = (bands.planes)(three);
    Ok(light_on_pixels(geometry, &bank, &picture, bands.distortion, &window, bands.samples, cancel)?)
}
