//! The image that a lens forms of a pinhole lit by a white diode: the PSFs that a calibration by captures should find.
//!
//! The lens is traced with the object at the pinhole, at many wavelengths, which the sensor's colours weigh. The image of
//! the pinhole is a disc of `pinhole |m|`, with m the paraxial magnification: 1.3 um for 75 um at 1.5 m and 25 mm.
//!
//! The camera turns towards a source that stands still, as on a tripod head. The source then keeps its distance to the lens
//! and not to its object plane: at field angle theta that plane is at `D cos(theta)`, which moves the image by up to 15 um along the
//! axis. Of the four cosines in the relative illumination of a flat scene only the pupil's own remains, so the light of
//! the PSF is the illumination over `cos^3(theta)`. In either case it is the light of one point, which distortion does not change.

use petzval_camera::image::CHANNELS;
use petzval_camera::sensor::SensorModel;
use petzval_design::error::DesignError;
use petzval_lab::psf_calibration::FinePsf;
use petzval_lab::psf_calibration::led::{channel_weights, led_wavelengths_um};
use petzval_optics::lens::{Lens, ObjectDistance};
use petzval_optics::paraxial::{first_order, image_height_per_tangent};
use petzval_optics::psf::{PsfOptions, psf};
use petzval_optics::pupil::{Quadrature, field_imaged_at};

use crate::error::JobError;

/// Pupil cells a side: splatting error below 0.5 %.
const PUPIL_CELLS: usize = 128;

/// How the image plane moves when the source is near.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refocus {
    /// As far as the paraxial image moves, so that the designer's defocus is kept.
    OnSource,
    /// By this distance from its place in the lens file, mm; with 0 a lens that is focused at infinity stays so.
    Mm(f64),
}

/// Why a lens has no PSFs of a pinhole.
#[derive(Debug, thiserror::Error)]
pub enum PinholeError {
    /// A source too near to have an image behind the lens.
    #[error(
        "a source {distance_mm} mm from the lens `{lens}` has no real image: it is within the front focal length"
    )]
    NoRealImage {
        /// Name of the lens.
        lens: String,
        /// Distance of the source from the first vertex, mm.
        distance_mm: f64,
    },
    /// The sensor resolves the source.
    #[error(
        "the image of the pinhole of {pinhole_um} um is {disc_um:.1} um wide, more than a pixel of {pixel_um} um"
    )]
    WideSource {
        /// Diameter of the pinhole, um.
        pinhole_um: f64,
        /// Diameter of its image, um.
        disc_um: f64,
        /// Pixel pitch, um.
        pixel_um: f64,
    },
    /// The lens is not rotationally symmetric, or loses its light.
    #[error(transparent)]
    Lens(#[from] DesignError),
}

impl From<PinholeError> for JobError {
    fn from(error: PinholeError) -> Self {
        let hint = match error {
            PinholeError::NoRealImage { .. } => "move the source away",
            PinholeError::WideSource { .. } => "take a smaller pinhole, or move it away",
            PinholeError::Lens(error) => return error.into(),
        };
        Self::input(error.to_string(), hint)
    }
}

/// A lens, a sensor and a pinhole.
#[derive(Clone, Debug)]
pub struct PinholeView {
    lens: Lens,
    distance_mm: Option<f64>,
    camera_turned: bool,
    wavelengths_um: Vec<f64>,
    weights: [Vec<f64>; CHANNELS],
    quadrature: Quadrature,
    /// Shift of the image plane from its place in the lens file, mm.
    pub refocus_mm: f64,
    /// Paraxial image height over the tangent of the field angle, mm.
    pub image_scale_mm: f64,
    /// Diameter of the pinhole's image, um.
    pub disc_um: f64,
}

/// The PSF of a field, and where it lies.
#[derive(Clone, Debug)]
pub struct PinholePsf {
    /// The PSF; its light is 1 in the green channel of an axial field without losses.
    pub psf: FinePsf,
    /// Distance of the reference chief ray from the axis, mm: the ideal radius and distortion.
    pub chief_mm: f64,
}

/// Times that field and object distance of a turned camera are solved for in turn; each leaves less than a hundredth of the error.
const TURNS: usize = 4;

impl PinholeView {
    /// A source `distance_mm` from the first vertex, or at infinity without it. If `camera_turned`, the camera turns towards
    /// the source; else the source moves in a plane.
    ///
    /// The image must be real. It must also be at most a pixel wide, because [`FinePsf`] models its disc by a few points.
    pub fn new(
        lens: &Lens,
        sensor: &SensorModel,
        distance_mm: Option<f64>,
        pinhole_um: f64,
        camera_turned: bool,
        refocus: Refocus,
    ) -> Result<Self, PinholeError> {
        if !lens.is_rotationally_symmetric() {
            return Err(DesignError::NotSymmetric(lens.name.clone()).into());
        }
        let object = distance_mm.map_or(ObjectDistance::Infinity, ObjectDistance::Finite);
        let near = Lens { object, ..lens.clone() };
        let image_at = |lens: &Lens| first_order(&lens.at_wavelength(lens.reference_um)).image_distance_mm;
        let image_mm = image_at(&near);
        if let Some(distance_mm) = distance_mm.filter(|_| !(image_mm.is_finite() && image_mm > 0.0)) {
            return Err(PinholeError::NoRealImage { lens: lens.name.clone(), distance_mm });
        }
        let refocus_mm = match refocus {
            Refocus::OnSource => image_mm - image_at(lens),
            Refocus::Mm(mm) => mm,
        };
        let near = near.with_image_distance(lens.image_distance_mm() + refocus_mm);
        let image_scale_mm = image_height_per_tangent(&near.at_wavelength(near.reference_um)).abs();
        let disc_um = distance_mm.map_or(0.0, |distance| pinhole_um * image_scale_mm / distance);
        if disc_um > sensor.pixel_um {
            return Err(PinholeError::WideSource { pinhole_um, disc_um, pixel_um: sensor.pixel_um });
        }
        let wavelengths_um = led_wavelengths_um();
        Ok(Self {
            weights: channel_weights(sensor, &wavelengths_um),
            wavelengths_um,
            quadrature: Quadrature::grid(PUPIL_CELLS).map_err(DesignError::from)?,
            disc_um,
            lens: near,
            distance_mm,
            camera_turned,
            refocus_mm,
            image_scale_mm,
        })
    }

    /// The PSF that lies `radius_mm` from the axis, where its chief ray lands.
    pub fn psf(&self, radius_mm: f64) -> Result<PinholePsf, DesignError> {
        let mut field_rad = (radius_mm / self.image_scale_mm).atan();
        let mut lens = self.lens.clone();
        // Turning the camera brings the object plane nearer, which moves the image a little: solve for both in turn.
        for _ in 0..TURNS {
            if let (Some(distance), true) = (self.distance_mm, self.camera_turned) {
                lens.object = ObjectDistance::Finite(distance * field_rad.cos());
            }
            if radius_mm > 0.0 {
                field_rad = field_imaged_at(&lens.at_wavelength(lens.reference_um), radius_mm, field_rad)
                    .ok_or_else(|| DesignError::no_light(&lens, field_rad, &[]))?;
            }
        }
        let cos = field_rad.cos();
        let options = PsfOptions::default();
        let traced = psf(&lens, field_rad, &self.wavelengths_um, &self.quadrature, &options)
            .ok_or_else(|| DesignError::no_light(&lens, field_rad, &self.wavelengths_um))?;
        let turned = if self.camera_turned { cos.powi(3) } else { 1.0 };

        // Sum the wavelengths for each colour, weighted by the spectrum of the diode and the colour's filter.
        let mut light = [0.0; CHANNELS];
        let values: [Vec<f64>; CHANNELS] = std::array::from_fn(|c| {
            let mut sum = vec![0.0; options.grid * options.grid];
            for (k, values) in traced.values.iter().enumerate() {
                let weight = self.weights[c][k] * traced.illumination[k] / traced.image_area
                    * traced.captured[k]
                    / turned;
                sum.iter_mut().zip(values).for_each(|(s, v)| *s += weight * v);
                light[c] += weight;
            }
            sum.iter_mut().for_each(|v| *v /= light[c].max(f64::MIN_POSITIVE));
            sum
        });
        let psf =
            FinePsf { grid: options.grid, pitch_um: options.pitch_um, values, light, disc_um: self.disc_um };
        Ok(PinholePsf { psf, chief_mm: traced.chief_y_mm })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use petzval_design::assets::Assets;

    fn view(refocus: Refocus) -> PinholeView {
        view_of(1500.0, 75.0, refocus).unwrap()
    }

    fn view_of(distance_mm: f64, pinhole_um: f64, refocus: Refocus) -> Result<PinholeView, PinholeError> {
        let data = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data");
        let assets = Assets::from_folder(&data).unwrap();
        let lens = assets.lens("cooke-triplet-nominal").unwrap().lens;
        let sensor = assets.sensor("imx249-calibrated").unwrap();
        PinholeView::new(&lens, &sensor, Some(distance_mm), pinhole_um, true, refocus)
    }

    /// RMS distance of green light from the middle of the grid, um.
    fn spread_um(psf: &FinePsf) -> f64 {
        let centre = 0.5 * (psf.grid as f64 - 1.0);
        let square =
            |i: usize| ((i / psf.grid) as f64 - centre).powi(2) + ((i % psf.grid) as f64 - centre).powi(2);
        psf.values[1].iter().enumerate().map(|(i, v)| v * square(i)).sum::<f64>().sqrt() * psf.pitch_um
    }

    #[test]
    fn focusing_on_the_pinhole_moves_the_sensor_by_newtons_formula() {
        let near = view(Refocus::OnSource);
        // z' = f^2 / z with z from the front focal point, 2.3 mm in front of the lens.
        assert!((near.refocus_mm - 25.04f64.powi(2) / 1497.7).abs() < 0.01, "{}", near.refocus_mm);
        // The pinhole's image is far below a pixel: about 1 um according to the paper.
        assert!((near.disc_um - 1.25).abs() < 0.02, "{}", near.disc_um);
        // Left at infinity, the axial spot is the pupil's shadow: 0.42 mm at f/4.4, RMS radius D / sqrt(8).
        let far = view(Refocus::Mm(0.0)).psf(0.0).unwrap();
        let shadow_um = 1e3 * near.refocus_mm / 4.39 / 8.0f64.sqrt();
        let ratio = spread_um(&far.psf) / shadow_um;
        assert!((0.6..1.2).contains(&ratio), "{ratio}");
        assert!(spread_um(&near.psf(0.0).unwrap().psf) < 0.4 * spread_um(&far.psf));
    }

    #[test]
    fn a_source_without_an_image_or_wider_than_a_pixel_is_refused() {
        // The front focal point is 2.3 mm in front of the lens; an image of 5.86 um is that of some 350 um at 1.5 m.
        for refocus in [Refocus::OnSource, Refocus::Mm(0.0)] {
            let near = view_of(1.0, 0.0, refocus).err();
            assert!(matches!(near, Some(PinholeError::NoRealImage { .. })), "{near:?}");
        }
        assert!(view_of(100.0, 0.0, Refocus::OnSource).is_ok());
        assert!(view_of(1500.0, 340.0, Refocus::OnSource).is_ok());
        let wide = view_of(1500.0, 360.0, Refocus::OnSource).err();
        assert!(matches!(wide, Some(PinholeError::WideSource { .. })), "{wide:?}");
    }

    #[test]
    fn light_falls_slowly_when_the_camera_turns() {
        let turned = view(Refocus::OnSource);
        let still = PinholeView { camera_turned: false, ..turned.clone() };
        let ratio = |v: &PinholeView| v.psf(5.0).unwrap().psf.light[1] / v.psf(0.0).unwrap().psf.light[1];
        let sequence = turned.lens.at_wavelength(turned.lens.reference_um);
        let cos = field_imaged_at(&sequence, 5.0, (5.0 / turned.image_scale_mm).atan()).unwrap().cos();
        assert!((ratio(&still) / ratio(&turned) / cos.powi(3) - 1.0).abs() < 2e-3);
        assert!(ratio(&turned) > ratio(&still));
    }
}
