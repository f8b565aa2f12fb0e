//! A spectral scene through a lens: every band is spread by the PSFs of its own wavelength.

use petzval_camera::image::LinearImage;
use petzval_camera::render::{Placement, RenderGeometry, illumination_map, kernel_radius, render};
use petzval_camera::sensor::Colour;
use petzval_camera::spectral::{ColourElectrons, SpectralImage};
use petzval_optics::lens::Lens;

use crate::error::DesignError;
use crate::optics::PsfPlan;

/// Electrons for each filter colour on the sensor window at `placement` when `lens` looks at `scene`.
///
/// `scene` has the size of the window; what the lens sees beyond it repeats its edge. `plan` gives fields, grid and pupil;
/// its wavelengths are replaced by those of the bands, three at a time, as many as the renderer takes. `weights` are the
/// electrons per unit radiance of each colour and band ([`petzval_camera::spectral::band_weights`]); relative illumination
/// multiplies them off the axis. `done` is told of every band.
pub fn render_spectral(
    lens: &Lens,
    plan: &PsfPlan,
    geometry: &RenderGeometry,
    scene: &SpectralImage,
    weights: &[(Colour, Vec<f64>)],
    placement: Placement,
    done: &dyn Fn(usize),
) -> Result<ColourElectrons, DesignError> {
    let (height, width) = (scene.height, scene.width);
    let colours: Vec<Colour> = weights.iter().map(|(colour, _)| *colour).collect();
    let mut electrons = ColourElectrons::none(&colours, height, width);
    for first in (0..scene.bands()).step_by(3) {
        let (planes, bands) = scene.three_bands(first);
        let plan = PsfPlan { wavelengths_um: bands.map(|b| scene.wavelength_um[b]), ..plan.clone() };
        let bank = plan.bank(lens)?;
        let border = kernel_radius(geometry, &bank.layout())?;
        let blurred = render(geometry, &bank, &planes.pad_replicate(border), placement)?;
        let map = illumination_map(geometry, &bank.layout(), &bank.illumination, placement, height, width)?;
        let light = LinearImage {
            data: blurred.data.iter().zip(&map.data).map(|(l, m)| (l * m).max(0.0)).collect(),
            ..blurred
        };
        // A last group of less than three bands repeats one, which counts once.
        for (k, band) in bands.into_iter().enumerate().filter(|(k, band)| *band == first + k) {
            electrons.add(light.plane(k), weights, band);
            done(band);
        }
    }
    Ok(electrons)
}
