//! `petzval init`: an experiment to edit.

use std::path::{Path, PathBuf};

use crate::base::pasted;
use crate::cli::code::Code;
use crate::jobs::init::{self, Request};

use super::defaults::word;
use super::failure::Failure;
use super::plain::shown;
use super::terminal::{Terminal, print_response};

/// Write an experiment with its lens and its sensor as files of your own, to edit and run.
///
/// experiment.toml holds every key, with the range of each number or the words to choose from, and a sentence; lens.toml and sensor.toml stand beside
/// it. Photographs, data and other inputs with a relative path are named from the new folder, so that they can be moved with it; absolute paths stay.
/// With --lens the experiment is fitted to the lens: its title, the focus, the array of the sensor, the grid of the PSFs and the requirements
/// follow from it, and every choice is said. A lens file of another program (.zmx, .seq, .json) will do. A lens that names no variables gets
/// curvatures, gaps of air and the coefficients of its aspheres; the last radius holds the focal length
/// or, of a near object, the magnification.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder for the files [default: the name of the lens file, or my-camera]
    out: Option<PathBuf>,
    /// Experiment to start from, by built-in name or file; `petzval experiment list` names them
    #[arg(long, value_name = "NAME", default_value = word(Request::default().from))]
    from: String,
    /// Lens in place of the experiment's, by built-in name or file
    #[arg(long, value_name = "LENS")]
    lens: Option<String>,
    /// Sensor in place of the experiment's, by built-in name or file
    #[arg(long, value_name = "SENSOR")]
    sensor: Option<String>,
    /// Folder of photographs in place of the built-in ones
    #[arg(long, value_name = "DIR")]
    photos: Option<PathBuf>,
    /// Pictures with labels in place of generated streets, for experiments that look for objects or classes of pixels
    #[arg(long, value_name = "PATH", conflicts_with = "photos")]
    data: Option<PathBuf>,
    /// Print the paths as JSON
    #[arg(long)]
    json: bool,
}

/// The folder of no other name.
const FOLDER: &str = "my-camera";

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let of_lens = args.lens.as_ref().and_then(|lens| Some(PathBuf::from(Path::new(lens).file_stem()?)));
    let out = args.out.or(of_lens).unwrap_or_else(|| PathBuf::from(FOLDER));
    let request = Request {
        out,
        from: args.from.into(),
        lens: args.lens.map(Into::into),
        sensor: args.sensor.map(Into::into),
        photos: args.photos,
        data: args.data,
    };
    let response = init::run(&request, &terminal.context())?;
    print_response(args.json, &response, || {
        let variables = if response.gave_variables {
            "  with variables that the file did not name: look at their bounds"
        } else {
            ""
        };
        outln!("{}{variables}", shown(&response.lens));
        outln!("{}", shown(&response.sensor));
        outln!("{}", shown(&response.experiment));
        let photos = if response.needs_gray_photos { " --photos FOLDER_OF_GRAY_PHOTOGRAPHS" } else { "" };
        outln!("\nnext: petzval design {}{photos}", pasted(&response.experiment));
    })
}
