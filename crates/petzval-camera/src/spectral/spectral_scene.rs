//! A scene that computes a few bands at a time, so that the whole spectrum need not fit in memory.

use super::illuminant::Illuminant;
use super::image::SpectralImage;
use super::reflectance_scene::ReflectanceScene;
use super::upsampling::{basis_bands, print_plane};
use crate::image::{CHANNELS, LinearImage};

/// A scene over the spectrum that computes its bands on request.
#[derive(Debug, Clone, PartialEq)]
pub struct SpectralScene {
    /// Wavelength of each band, um, ascending; at least two.
    pub band_um: Vec<f64>,
    content: Content,
}

#[derive(Debug, Clone, PartialEq)]
enum Content {
    Surfaces { scene: ReflectanceScene, radiance: Vec<Vec<f64>>, as_points: bool },
    Print { photo: LinearImage, radiance: [Vec<f64>; 3] },
    Image(SpectralImage),
}

impl SpectralScene {
    /// Surfaces under `light` with an illuminance of `lux`; the bands equal those of [`ReflectanceScene::under`].
    pub fn surfaces(scene: ReflectanceScene, light: &Illuminant, lux: f64, band_um: &[f64]) -> Self {
        let radiance = scene.radiance(light, lux, band_um);
        Self { band_um: band_um.to_vec(), content: Content::Surfaces { scene, radiance, as_points: false } }
    }

    /// Surfaces whose planes hold the light at the middle of each sample ([`LinearImage::point_values`]) in place of its mean over the sample. A
    /// renderer that takes samples for points then shows edges as sharp as a lens does.
    pub fn surfaces_as_points(
        scene: ReflectanceScene,
        light: &Illuminant,
        lux: f64,
        band_um: &[f64],
    ) -> Self {
        let radiance = scene.radiance(light, lux, band_um);
        Self { band_um: band_um.to_vec(), content: Content::Surfaces { scene, radiance, as_points: true } }
    }

    /// A photograph as a matt print; the bands equal those of [`upsample`](super::upsample).
    pub fn print(photo: LinearImage, light: &Illuminant, lux: f64, band_um: &[f64]) -> Self {
        let radiance = basis_bands(light, lux, band_um);
        Self { band_um: band_um.to_vec(), content: Content::Print { photo, radiance } }
    }

    /// A spectral image that is already in memory.
    pub fn image(image: SpectralImage) -> Self {
        Self { band_um: image.wavelength_um.clone(), content: Content::Image(image) }
    }

    /// Radiance in three bands, W m-2 sr-1 nm-1, as three planes for the renderer.
    pub fn planes(&self, bands: [usize; CHANNELS]) -> LinearImage {
        let together = |height: usize, width: usize, plane: &dyn Fn(usize) -> Vec<f32>| {
            let data = bands.iter().flat_map(|band| plane(*band)).collect();
            LinearImage { channels: CHANNELS, height, width, data }
        };
        match &self.content {
            Content::Surfaces { scene, radiance, as_points } => {
                let means = together(scene.height, scene.width, &|band| scene.plane(radiance, band));
                if *as_points { means.point_values() } else { means }
            }
            Content::Print { photo, radiance } => {
                together(photo.height, photo.width, &|band| print_plane(photo, radiance, band))
            }
            Content::Image(image) => image.planes(bands),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::scene::SceneKind;
    use super::super::upsampling::upsample;
    use super::*;
    use crate::spectrum::bands::even_bands;

    #[test]
    fn bands_on_request_equal_those_of_the_whole_image() {
        let light = Illuminant::named("FL2").unwrap();
        let bands = even_bands(0.38, 0.90, 9);
        let chart = SceneKind::ColourChecker.draw(40, 60);
        let photo =
            LinearImage::from_data(CHANNELS, 2, 3, (0..18).map(|i| i as f32 / 20.0).collect()).unwrap();
        let (whole, print) = (chart.under(&light, 300.0, &bands), upsample(&photo, &light, 300.0, &bands));
        for (scene, image) in [
            (SpectralScene::surfaces(chart, &light, 300.0, &bands), &whole),
            (SpectralScene::print(photo, &light, 300.0, &bands), &print),
            (SpectralScene::image(whole.clone()), &whole),
        ] {
            assert_eq!(scene.band_um, bands);
            for chosen in [[0, 1, 2], [6, 7, 8], [8, 8, 3]] {
                assert_eq!(scene.planes(chosen), image.planes(chosen));
            }
        }
    }

    #[test]
    fn a_white_print_equals_the_perfect_diffuser_beyond_the_visible() {
        let light = Illuminant::named("blackbody:2856").unwrap();
        let bands = even_bands(0.3, 1.1, 41);
        let white = LinearImage::filled(CHANNELS, 1, 1, 1.0);
        let print = upsample(&white, &light, 100.0, &bands);
        let flat = SceneKind::Flat.draw(1, 1).under(&light, 100.0, &bands);
        for (a, b) in print.data.iter().zip(&flat.data) {
            assert!(*b > 0.0 && (a / b - 1.0).abs() < 1e-5, "{a} {b}");
        }
    }
}
