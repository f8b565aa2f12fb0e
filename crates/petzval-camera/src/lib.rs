//! The camera behind the lens, in the order that light travels.
//!
//! | step | module | carrier |
//! |---|---|---|
//! | scene in linear light | [`image`] | [`LinearImage`] |
//! | what the lens does to a point | [`psf`] | [`PsfBank`] |
//! | light on the sensor | [`mod@render`] | [`LinearImage`] (irradiance) |
//! | light over the spectrum, photons | [`spectral`] | [`spectral::SpectralImage`], [`spectral::ColourElectrons`] |
//! | digital numbers | [`sensor`] | [`Raw`] |
//! | linear colour picture | [`mod@develop`] | [`LinearImage`] |
//! | how good it is | [`quality`] | numbers |
//! | how good it could be | [`linear_limit`] | the expected squared error |
//! | all of it on the tape | [`tape`] | tensors |
//! | where its tensors are | [`device`] | what a GPU says of itself |
//!
//! Conventions: pictures are channel-major (red, green, blue), linear light, 1.0 = white. Sensor pixel `(r, c)` has its
//! centre at `x = (c - (W-1)/2) pixel_um`, `y = (r - (H-1)/2) pixel_um`. A [`Placement`] is the sensor position of a
//! picture's top-left pixel. It determines the PSF, the illumination, the phase of the mosaic and the noise of each pixel.
//! Lengths on the sensor are in um, image radii in mm, charges in electrons (`_e`), digital numbers in DN (`_dn`).
//!
//! ```
//! use petzval_camera::*;
//!
//! // A lens that blurs over four cells at the centre and dims to half at 6.6 mm.
//! let (grid, geometry) = (32, RenderGeometry::default());
//! let mut psf = vec![0.0; grid * grid];
//! for cell in [15 * grid + 15, 15 * grid + 16, 16 * grid + 15, 16 * grid + 16] {
//!     psf[cell] = 0.25;
//! }
//! let lens = PsfBank {
//!     field_radius_mm: vec![0.0, 6.6],
//!     grid,
//!     pitch_um: 1.0,
//!     values: psf.repeat(2 * CHANNELS),
//!     illumination: vec![1.0, 1.0, 1.0, 0.5, 0.5, 0.5],
//! };
//! lens.validate()?;
//!
//! // A gray scene of 64x48 pixels near the corner of the sensor, with the border that the PSF needs.
//! let placement = Placement { row: 20, col: 30 };
//! let scene = LinearImage::filled(CHANNELS, 64, 48, 0.5).pad_replicate(kernel_radius(&geometry, &lens.layout())?);
//! let mut light = render(&geometry, &lens, &scene, placement)?;
//! let dimming = illumination_map(&geometry, &lens.layout(), &lens.illumination, placement, 64, 48)?;
//! light.data.iter_mut().zip(&dimming.data).for_each(|(l, d)| *l *= d);
//!
//! // Expose, develop, undo the dimming.
//! let sensor = petzval_files::parse_sensor(include_str!("../../petzval-data/data/sensors/imx249-fitted.toml"))?;
//! let exposure = Exposure { white_e: 20_000.0, time_s: 0.01, linear_gain: 1.0 };
//! let capture = Capture { exposure, placement, frame: 0 };
//! let raw = expose(&light, &sensor, &capture, &Noise { mode: NoiseMode::Exact, seed: 1 })?;
//! let picture = correct_shading(&develop(&raw, &sensor)?, &dimming, 0.1)?;
//! let score = psnr(&picture.to_srgb(), &LinearImage::filled(CHANNELS, 64, 48, 0.5).to_srgb())?;
//! assert!(score > 30.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Every function gives the same bits for the same input, seed and machine, for any number of threads. The renderer does
//! not know how a PSF was made. Derivatives are hand-written adjoints; only [`tape`] uses the tensor framework.

pub mod develop;
pub mod device;
pub mod image;
pub mod isp;
pub mod linear_limit;
pub mod psf;
pub mod quality;
pub mod render;
pub mod sensor;
pub mod spectral;
pub mod spectrum;
pub mod tape;

pub use develop::{correct_shading, dark_mean_dn, develop, develop_adjoint};
pub use image::{CHANNELS, LinearImage, srgb_decode, srgb_encode};
pub use psf::{PsfBank, PsfError, PsfLayout};
pub use quality::{psnr, ssim_gaussian_wang};
pub use render::{
    Placement, RenderError, RenderGeometry, illumination_map, kernel_radius, render, render_adjoint,
};
pub use sensor::{
    Capture, CfaPattern, Exposure, Noise, NoiseMode, Raw, SensorError, SensorModel, expose, expose_pixel,
    expose_with_tape,
};
