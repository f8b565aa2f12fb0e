//! `petzval psf`: the point-spread functions of a lens, as arrays and as a picture.

use std::path::PathBuf;

use crate::cli::code::Code;
use crate::jobs::psf::{self, PsfKind};

use super::choice::choice;
use super::defaults::{numbers, word};
use super::failure::Failure;
use super::plain::shown;
use super::terminal::{Terminal, print_json};

/// Write the PSFs of a lens, per field and wavelength.
///
/// Files: psf.npy is float64 [field, wavelength, row, column], each PSF of unit sum and centred on the chief ray; illumination.npy is
/// float64 [field, wavelength]. psf.png is a picture of all PSFs with fields, wavelengths and a scale bar. psf.json holds the axes. simulate,
/// apply and evaluate take the folder by --psfs, experiments by psf.kind = "file".
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Lens file, or a built-in name
    lens: String,
    /// Folder for the results
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Number of fields from the axis to the corner
    #[arg(long, default_value_t = psf::Request::default().fields)]
    fields: usize,
    /// Image radius of the last field, mm: by default the corner of a 1920 x 1200 sensor of 5.86 um, whatever the fields of the lens
    #[arg(long, default_value_t = psf::Request::default().corner_mm)]
    corner_mm: f64,
    /// Wavelengths of the red, green and blue channel, um
    #[arg(long, value_name = "UM,UM,UM", value_delimiter = ',', default_value = numbers(&psf::Request::default().wavelengths))]
    wavelengths: Vec<f64>,
    /// Cells a side
    #[arg(long, default_value_t = psf::Request::default().grid)]
    grid: usize,
    /// Cell size, um
    #[arg(long, default_value_t = psf::Request::default().pitch_um)]
    pitch_um: f64,
    /// Least pupil cells a side; not for waves
    #[arg(long, default_value_t = psf::Request::default().pupil_cells)]
    pupil_cells: usize,
    /// The pupil cells are doubled while the sum of absolute errors of a PSF of unit sum is larger than this
    #[arg(long, default_value_t = psf::Request::default().pupil_error)]
    pupil_error: f64,
    /// Rays, accurate where aberrations spread light over many times the Airy disk, or waves
    #[arg(long, value_parser = choice::<PsfKind>(), default_value = word(psf::Request::default().kind))]
    kind: PsfKind,
    /// Print the axes as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let request = psf::Request {
        lens: args.lens.into(),
        out: args.out,
        fields: args.fields,
        corner_mm: args.corner_mm,
        wavelengths: args.wavelengths,
        grid: args.grid,
        pitch_um: args.pitch_um,
        pupil_cells: args.pupil_cells,
        pupil_error: args.pupil_error,
        kind: args.kind,
    };
    let response = psf::run(&request, &terminal.context())?;
    noteln!("{} fields x 3 wavelengths written to {}", request.fields, shown(&request.out));
    if args.json { print_json(&response.axes) } else { Ok(Code::SUCCESS) }
}
