//! The request of `simulate`, and the kinds of images that it names.

use std::path::{Path, PathBuf};

use petzval_camera::develop::Interpolation;
use petzval_camera::image::LinearImage;
use petzval_camera::render::Wiener;
use petzval_camera::sensor::{Exposure, SensorModel};
use petzval_camera::spectral::SceneKind;
use petzval_files::spectral_file::is_spectral;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::input::{LensInput, SensorInput};

/// What the name of a built-in scene begins with.
const SCENE: &str = "scene:";

/// How a photograph lands on the sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Place {
    /// Scaled to cover the sensor, the rest cut off.
    #[default]
    Fill,
    /// One photograph pixel per sensor pixel, or per sample of one, around the axis.
    Centre,
}

impl Place {
    /// A picture laid on a frame of so many rows and columns.
    pub fn lay(self, picture: &LinearImage, (height, width): (usize, usize)) -> LinearImage {
        match self {
            _ if (picture.height, picture.width) == (height, width) => picture.clone(),
            Self::Fill => picture.cover(height, width),
            Self::Centre => picture.centred(height, width),
        }
    }

    /// What this does to a picture on a frame of so many rows and columns that a person would not see at once.
    pub fn note(self, picture: &LinearImage, (height, width): (usize, usize)) -> Option<String> {
        let by = (height as f64 / picture.height as f64).max(width as f64 / picture.width as f64);
        if by <= ENLARGED {
            return None;
        }
        let sizes = format!("{} x {} pixels on a frame of {width} x {height}", picture.width, picture.height);
        Some(match self {
            Self::Fill => format!(
                "{sizes}: the picture is enlarged {by:.1} times, and its own blur with it; --place centre takes its pixels as they are"
            ),
            Self::Centre => format!(
                "{sizes}: the picture's edge is continued to the border of the frame; --place fill enlarges it {by:.1} times"
            ),
        })
    }
}

/// Where pictures are enlarged by more than this, a note says so: up to the surround that a lens with distortion sees, they fill the frame as they are.
const ENLARGED: f64 = 1.25;

petzval_base::parameters! {
    /// Photographs and scenes to take. What is left out has the default of the command.
    pub struct Request {
        /// Samples of the scene along a side of a pixel, 1 to 8: a pixel collects the light of `samples` x `samples` of them. If left out, 4 where every
        /// image is a built-in scene of edges and at most a million pixels are read, and else 1.
        samples: Option<usize> = None, "", 1..8, Linear, "with 4, a pixel collects the light of 4 x 4 samples of the scene";
        /// Photoelectrons that white gives in a green pixel on the axis; 70 % of those with which white saturates the first colour
        /// if none are given, or what the light gives over the spectrum.
        white_e: Option<f32> = None, "e-", 1e-3..1e7, Log, "a positive number of photoelectrons: 16000 is usual";
        /// Exposure time, s.
        time_s: f32 = 0.005, "s", 1e-9..1e4, Log, "5 ms is 0.005";
        /// Linear analogue gain.
        gain: f32 = 1.0, "", 1e-6..1e3, Log, "a positive number; 1 is the gain of the sensor file";
    }
    also {
        /// Photographs (PNG, JPEG, TIFF, WebP, BMP; OpenEXR and Radiance HDR in linear light), spectral images, or `scene:NAME`.
        images: Vec<PathBuf> = Vec::new();
        /// Lens: a built-in name, the path of a file, or the lens itself.
        lens: LensInput = crate::usual::lens().into();
        /// PSFs in place of those of the lens: the folder of results of `psf` or `psf-calibrate`, or its `psf.json`.
        psfs: Option<PathBuf> = None;
        /// Sensor: a built-in name, the path of a file, or the sensor itself.
        sensor: SensorInput = crate::usual::sensor().into();
        /// How a photograph lands on the sensor.
        place: Place = Place::Fill;
        /// How the colours of the mosaic are interpolated.
        development: Interpolation = Interpolation::default();
        /// Restoration of the developed picture with the PSFs of the lens; none leaves its blur.
        restore: Option<Restore> = None;
        /// An image signal processor whose picture is written beside the developed one: a preset, a file, or `neutral`.
        isp: Option<String> = None;
        /// Take the picture as the light on the image plane: straight lines stay straight. Without it, the picture is the rectilinear
        /// scene in front of the lens, and its distortion is rendered.
        no_distortion: bool = false;
        /// Rows and columns in the middle of the sensor that are read; all of them if none are given.
        size: Option<(usize, usize)> = None;
        /// Leave out temporal noise; the fixed pattern (DSNU, PRNU, hot pixels) stays.
        no_noise: bool = false;
        /// Seed of the noise.
        seed: u64 = crate::usual::seed();
        /// The light, for a simulation over the spectrum.
        spectral: Spectral = Spectral::default();
        /// Format of the raw frame.
        raw_format: RawAs = RawAs::Tiff;
        /// Format of the developed picture.
        picture_format: PictureAs = PictureAs::Png;
        /// Folder for the results.
        out: PathBuf = PathBuf::from(".");
    }
}

petzval_base::parameters! {
    /// Restoration of a developed picture.
    pub struct Restore {
        /// Power of noise over that of the picture at a tenth of a cycle per pixel; that of sensor, exposure and demosaicing if none is given.
        noise: Option<f32> = None, "", 1e-9..10.0, Log, "0.003 suits 16,000 electrons of white; more for less light";
    }
}

impl Restore {
    /// The filter for pictures of a sensor at an exposure.
    pub fn filter(&self, sensor: &SensorModel, exposure: &Exposure) -> Wiener {
        let known = Wiener::of_exposure(sensor, exposure);
        Wiener { noise: self.noise.unwrap_or(known.noise + DEMOSAIC_ERROR), ..known }
    }
}

/// Power of the errors that demosaicing leaves, over that of natural pictures at a tenth of a cycle per pixel. The filter must not amplify them
/// either. In an experiment the curves that are trained with the filter account for them.
///
/// Behind the nominal and the spot-optimised triplet four times as much would be better (0.2 to 0.3 dB), behind perfect optics a little less
/// (0.03 dB): the book's chapter on development has the figures.
const DEMOSAIC_ERROR: f32 = 0.0007;

/// How the raw frame is written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RawAs {
    /// 16-bit gray TIFF.
    #[default]
    Tiff,
    /// 16-bit gray PNG.
    Png,
    /// `.raw`, packed as MIPI CSI-2 does where the sensor has 8, 10, 12 or 14 bits, else contiguous bits.
    Packed,
    /// NumPy array, uint16.
    Npy,
}

/// How the developed picture is written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PictureAs {
    /// 8-bit sRGB PNG.
    #[default]
    Png,
    /// 16-bit sRGB PNG.
    Png16,
    /// OpenEXR, 32-bit floats, linear light.
    Exr,
    /// NumPy array, float32 [plane, row, column], linear light.
    Npy,
}

impl PictureAs {
    /// The ending of such a file.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Png | Self::Png16 => "png",
            Self::Exr => "exr",
            Self::Npy => "npy",
        }
    }
}

petzval_base::parameters! {
    /// The light, and how finely its spectrum is sampled. Any of these makes a simulation one over the spectrum.
    pub struct Spectral {
        /// Illuminance of the scene, lux; 500, or as `white_e` needs.
        illuminance_lux: Option<f64> = None, "lux", 1e-300..1e9, Log, "an office has 500 lux";
        /// Bands for scenes and photographs, 2 to 401; 16, or more where these would be over 20 nm apart.
        bands: Option<usize> = None, "", 2..401, Linear, "16 bands are 20 nm apart over 400..700 nm";
    }
    also {
        /// Light on the scene: D65, A, FL11, LED-B3, ..., daylight:KELVIN, blackbody:KELVIN, or a CSV file of wavelengths in nm and
        /// relative power; D65 if none is named.
        illuminant: Option<String> = None;
        /// Quantum efficiency in place of the sensor's: a built-in name, `flat:VALUE`, or a CSV or TOML file.
        qe: Option<String> = None;
        /// Transmission of the lens: a number in 0..1, or a CSV file of wavelengths in nm and transmission.
        transmission: Option<String> = None;
        /// Photographs through three PSFs, then electrons by a 3x3 matrix.
        three_band: bool = false;
        /// The camera's own colours, without the matrix fitted to the ColorChecker.
        no_colour_matrix: bool = false;
    }
}

/// Samples along a side of a pixel of scenes of edges. One sample spreads the light of an edge over a pixel before the lens moves it, and the pixel
/// collects it once more: the edge is softer than a camera shows it.
const EDGE_SAMPLES: usize = 4;

/// Most pixels that are read, and most samples of a scene, that are taken so finely without an explicit request: a minute on two cores.
const MOST_PIXELS_BY_DEFAULT: usize = 1_000_000;
const MOST_SAMPLES_BY_DEFAULT: usize = 50_000_000;

/// Whether an image is a built-in scene that shows how sharp a camera is.
fn has_edges(path: &Path) -> bool {
    let scene = scene_name(path).and_then(SceneKind::named);
    matches!(scene, Some(SceneKind::SlantedEdge | SceneKind::SiemensStar | SceneKind::TestChart))
}

impl Request {
    /// Samples along a side of a pixel, and what to say if they soften the edges of a scene.
    pub(super) fn samples_of(&self, sensor: &SensorModel) -> (usize, Option<String>) {
        if let Some(samples) = self.samples {
            return (samples, None);
        }
        let Some(edges) = self.images.iter().find(|path| has_edges(path)) else { return (1, None) };
        let whole = sensor.height * sensor.width;
        let read = self.size.map_or(whole, |(height, width)| height.saturating_mul(width));
        let is_small =
            read <= MOST_PIXELS_BY_DEFAULT && whole * EDGE_SAMPLES.pow(2) <= MOST_SAMPLES_BY_DEFAULT;
        if is_small && self.images.iter().all(|path| has_edges(path)) {
            return (EDGE_SAMPLES, None);
        }
        let warning = format!(
            "{}: one sample a pixel softens its edges, and lowers their MTF (by 0.15 at 0.25 cycles per pixel behind the built-in triplet); \
             --samples 4 is right to 0.02 and takes 16 times as long, unless --size reads a part of the sensor alone",
            edges.display()
        );
        (1, Some(warning))
    }
}

/// Whether a request is one over the spectrum.
pub fn is_over_spectrum(request: &Request) -> bool {
    request.spectral != Spectral::default() || request.images.iter().any(|path| kind(path) != Kind::Photo)
}

/// The scene in `scene:NAME`.
pub fn scene_name(path: &Path) -> Option<&str> {
    path.to_str()?.strip_prefix(SCENE)
}

/// What an image of a request is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// `scene:NAME`.
    Scene,
    /// A spectral image.
    Spectral,
    /// A photograph in three colours.
    Photo,
}

/// What an image of a request is, by its name.
pub fn kind(path: &Path) -> Kind {
    match path {
        path if scene_name(path).is_some() => Kind::Scene,
        path if is_spectral(path) => Kind::Spectral,
        _ => Kind::Photo,
    }
}

/// Name of the results: that of the file or of the scene.
pub fn result_name(path: &Path) -> String {
    if let Some(scene) = scene_name(path) {
        return scene.to_owned();
    }
    path.file_stem().map_or_else(|| "image".to_owned(), |s| s.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_that_are_much_smaller_than_the_frame_get_a_note() {
        let note =
            |place: Place, height, width| place.note(&LinearImage::zeros(3, height, width), (1200, 1920));
        let small = note(Place::Fill, 400, 600).unwrap();
        assert!(small.starts_with("600 x 400 pixels on a frame of 1920 x 1200: "), "{small}");
        assert!(small.contains("enlarged 3.2 times"));
        assert!(note(Place::Centre, 400, 600).unwrap().contains("edge is continued"));
        // As large as the frame, nearly so, and larger.
        for place in [Place::Fill, Place::Centre] {
            assert_eq!(
                [(1200, 1920), (1100, 1700), (3000, 4000)].map(|(h, w)| note(place, h, w)),
                [None, None, None]
            );
        }
    }

    #[test]
    fn small_frames_of_edges_are_drawn_finely_and_large_ones_warn() {
        let whole = petzval_files::parse_sensor(include_str!(
            "../../../petzval-data/data/sensors/imx249-fitted.toml"
        ))
        .unwrap();
        let small = SensorModel { width: 240, ..whole.clone() };
        let samples =
            |images: &[&str], sensor: &SensorModel, size: Option<(usize, usize)>, samples: Option<usize>| {
                let images = images.iter().map(PathBuf::from).collect();
                let (samples, warning) =
                    Request { images, size, samples, ..Request::default() }.samples_of(sensor);
                (samples, warning.is_some())
            };
        assert_eq!(samples(&["scene:slanted-edge"], &small, None, None), (4, false));
        assert_eq!(samples(&["scene:slanted-edge"], &whole, None, None), (1, true));
        assert_eq!(samples(&["scene:test-chart"], &whole, Some((480, 640)), None), (4, false));
        assert_eq!(samples(&["a.png", "scene:siemens-star"], &small, None, None), (1, true));
        // An explicit number is taken, and what has no edges has one sample a pixel.
        assert_eq!(samples(&["scene:slanted-edge"], &whole, None, Some(1)), (1, false));
        for image in ["scene:flat", "scene:colorchecker", "a.png"] {
            assert_eq!(samples(&[image], &small, None, None), (1, false));
        }
    }
}
