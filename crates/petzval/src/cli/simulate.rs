//! `petzval simulate`: photographs and scenes through a lens onto a sensor.

use std::path::PathBuf;

use crate::cli::code::Code;
use crate::jobs::simulate::{self, Demosaic, Domain, PictureAs, Place, RawAs, Request};

use super::choice::choice;
use super::defaults::word;
use super::failure::Failure;
use super::signals;
use super::terminal::{Terminal, print_response};

/// The light, and the sampling of its spectrum.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Over the spectrum")]
struct SpectralArgs {
    /// Light on the scene: D65, A, FL11, LED-B3, ..., daylight:KELVIN, blackbody:KELVIN, or a CSV file of wavelengths in nm and
    /// relative power [default: D65]
    #[arg(long, value_name = "LIGHT")]
    illuminant: Option<String>,
    /// Illuminance of the scene, lux; white is a matt white surface there [default: 500, or the value that gives --white-e]
    #[arg(long, value_name = "LUX")]
    illuminance_lux: Option<f64>,
    /// Number of bands for scenes and photographs, over the wavelengths that light, lens and sensor have in common
    /// [default: 16, or more if 16 would be over 20 nm apart]
    #[arg(long, value_name = "N")]
    bands: Option<usize>,
    /// Quantum efficiency curves in place of the sensor's own: a built-in name (imx219, ov5647), flat:VALUE for one efficiency at all
    /// wavelengths, or a file. A CSV file has a head line `wavelength_nm,red,green,blue` or `wavelength_nm,clear` and efficiencies of 0 to 1.
    /// A TOML file has the keys of [quantum_efficiency] in a sensor file
    #[arg(long, value_name = "CURVES")]
    qe: Option<String>,
    /// Transmission of the lens: a number in 0..1, or a CSV file of wavelengths in nm and transmission
    #[arg(long, value_name = "TAU")]
    transmission: Option<String>,
    /// Take photographs the fast way: red, green and blue through three PSFs, then electrons by a 3x3 matrix
    #[arg(long, conflicts_with = "bands")]
    three_band: bool,
    /// Show the camera's own colours, white-balanced, without the colour matrix that is fitted to the ColorChecker
    #[arg(long)]
    no_colour_matrix: bool,
}

/// Take photographs and scenes through a lens: scene, raw frame, developed picture.
///
/// For each image NAME four files are written. NAME-raw.tiff, 16 bit, holds the mosaic in digital numbers, and NAME-raw.tiff.toml its
/// camera and exposure. NAME-calibration.toml holds what an ISP may know of it, such as shading and distortion of the lens.
/// NAME-developed.png is 8 bit sRGB.
///
/// OpenEXR pictures with the channels R, G and B, or Y, and Radiance HDR pictures hold linear light of Rec. 709 colours, 1 for
/// white; brighter highlights are kept. What a file says about its colours and is not obeyed, such as an ICC profile, is reported.
///
/// Three kinds of input are simulated over the spectrum: spectral images (.npy, .exr with a channel per band, .tif with a sidecar), the
/// built-in scenes (scene:colorchecker, scene:flat, scene:slanted-edge, scene:siemens-star, scene:test-chart), and photographs with any of
/// the options "Over the spectrum". Every band has its own PSF; light is in photons, and the sensor's quantum efficiency makes electrons of
/// it.
///
/// The flat scene is a perfect diffuser. Edge and star have the reflectances of the white and the black patch of a
/// ColorChecker, 0.89 and 0.03 at 550 nm.
///
/// Behind a lens without rotational symmetry each patch has the PSF of its own place, without distortion.
///
/// Highlights end in neutral white at the level at which white light saturates the first colour. White of a PNG is the
/// white of the scene, or the end of the highlights if that is lower; the linear light of EXR and NPY always has white
/// at 1.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Photographs (PNG, JPEG, TIFF, WebP, BMP; OpenEXR and Radiance HDR in linear light), spectral images, or scene:NAME
    #[arg(required = true, value_name = "IMAGE")]
    images: Vec<PathBuf>,
    /// Lens file, or a built-in name
    #[arg(long, default_value = word(Request::default().lens))]
    lens: String,
    /// PSFs in place of the lens: a folder that psf or psf-calibrate wrote, or its psf.json (psfs.toml of earlier versions). They include the
    /// relative illumination, and distortion where the file has it: that of psf does. Clear pixels receive the three planes of a picture, each spread by its PSF, in the
    /// mixture of the sensor's clear_response
    #[arg(long, value_name = "PATH", conflicts_with = "lens")]
    psfs: Option<PathBuf>,
    /// Sensor file, or a built-in name
    #[arg(long, default_value = word(Request::default().sensor))]
    sensor: String,
    /// Position and scale of a photograph on the sensor
    #[arg(long, value_parser = choice::<Place>(), default_value = word(Request::default().place))]
    place: Place,
    /// Samples of the scene along a side of a pixel, 1 to 8. With K the picture is laid on a frame of K x K samples a pixel. Each pixel
    /// collects the light on its square, so detail finer than a pixel blurs and aliases as in a camera. Time and memory grow with K x K
    /// [default: 4 for scene:slanted-edge, scene:siemens-star and scene:test-chart where at most a million pixels are read, else 1]
    #[arg(long, value_name = "K")]
    samples: Option<usize>,
    /// How the two colours that a pixel did not measure are interpolated
    #[arg(long, value_parser = choice::<Demosaic>(), default_value = word(Request::default().development.demosaic))]
    demosaic: Demosaic,
    /// Values between which they are interpolated
    #[arg(long, value_parser = choice::<Domain>(), default_value = word(Request::default().development.domain))]
    domain: Domain,
    /// Undo the blur of the lens in the developed picture by a Wiener filter with the PSF of every place. NOISE is the power of
    /// noise over that of the picture at a tenth of a cycle per pixel; without it, that of the sensor at this exposure and of demosaicing:
    /// 0.0037 for 16,000 electrons of white
    #[arg(long, value_name = "NOISE", num_args = 0..=1, require_equals = true)]
    restore: Option<Option<f32>>,
    /// Write the picture of an image signal processor, too, as NAME-isp.png: a preset (automotive, low-light, quality, real-time), neutral, or a
    /// file that `isp develop` takes. It is calibrated for the shading and the distortion of the lens, and for the sensor
    #[arg(long, value_name = "ISP")]
    isp: Option<String>,
    /// Take the picture as the light on the image plane, so that straight lines stay straight. Otherwise it is the scene as a pinhole
    /// would show it, and the lens distorts it
    #[arg(long)]
    no_distortion: bool,
    /// Photoelectrons of white in a green pixel on the axis. The default is 70 % of the number at which white saturates
    /// the first colour at this gain, to two digits: 16000 for imx249-fitted. Over the spectrum the number follows from
    /// the light; if it is given, the illuminance follows from it
    #[arg(long, value_name = "E", allow_negative_numbers = true)]
    white_e: Option<f32>,
    /// Read only the middle HEIGHTxWIDTH pixels of the sensor, such as 480x640. They have the same values as in a whole
    /// frame
    #[arg(long, value_name = "HxW", value_parser = size)]
    size: Option<(usize, usize)>,
    /// Exposure time, s
    #[arg(long, default_value_t = Request::default().time_s, value_name = "S", allow_negative_numbers = true)]
    time_s: f32,
    /// Linear analogue gain
    #[arg(long, default_value_t = Request::default().gain, allow_negative_numbers = true)]
    gain: f32,
    /// Leave out temporal noise; the fixed pattern (DSNU, PRNU, hot pixels) stays
    #[arg(long)]
    no_noise: bool,
    /// Seed of the noise
    #[arg(long, default_value_t = Request::default().seed)]
    seed: u64,
    #[command(flatten)]
    spectral: SpectralArgs,
    /// Format of the raw frame
    #[arg(long, value_parser = choice::<RawAs>(), default_value = word(Request::default().raw_format), value_name = "FORMAT")]
    raw_format: RawAs,
    /// Format of the developed picture
    #[arg(long, value_parser = choice::<PictureAs>(), default_value = word(Request::default().picture_format), value_name = "FORMAT")]
    picture_format: PictureAs,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = word(Request::default().out))]
    out: PathBuf,
    /// Print what was written as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let over = args.spectral;
    let request = Request {
        images: args.images,
        lens: args.lens.into(),
        psfs: args.psfs,
        sensor: args.sensor.into(),
        place: args.place,
        samples: args.samples,
        restore: args.restore.map(|noise| simulate::Restore { noise }),
        isp: args.isp,
        development: simulate::Interpolation { demosaic: args.demosaic, domain: args.domain },
        white_e: args.white_e,
        size: args.size,
        time_s: args.time_s,
        gain: args.gain,
        no_distortion: args.no_distortion,
        no_noise: args.no_noise,
        seed: args.seed,
        spectral: simulate::Spectral {
            illuminant: over.illuminant,
            illuminance_lux: over.illuminance_lux,
            bands: over.bands,
            qe: over.qe,
            transmission: over.transmission,
            three_band: over.three_band,
            no_colour_matrix: over.no_colour_matrix,
        },
        raw_format: args.raw_format,
        picture_format: args.picture_format,
        out: args.out,
    };
    let context = terminal.context().with_cancellation(signals::end_on_signal()?);
    let response = simulate::run(&request, &context)?;
    drop(context);
    print_response(args.json, &response.images, || {
        for image in &response.images {
            for file in ["raw", "developed", "isp"].iter().filter_map(|file| image.get(*file)?.as_str()) {
                outln!("{file}");
            }
        }
    })
}

/// Rows and columns of `480x640`.
fn size(text: &str) -> Result<(usize, usize), String> {
    let wrong = || "rows and columns are given as HEIGHTxWIDTH, such as 480x640".to_owned();
    let (height, width) = text.split_once(['x', 'X']).ok_or_else(wrong)?;
    let number = |text: &str| text.trim().parse().map_err(|_| wrong());
    Ok((number(height)?, number(width)?))
}
