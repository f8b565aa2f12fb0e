//! `petzval apply`: pictures of one's own through the cameras of a run.

use std::path::PathBuf;

use crate::cli::code::Code;
use crate::jobs::apply::{self, Place, Request};

use super::choice::choice;
use super::defaults::word;
use super::failure::Failure;
use super::plain::shown;
use super::signals;
use super::terminal::{Terminal, print_response};

/// Take pictures of your own with the cameras of a finished run: whole frames through lens, sensor, development and network.
///
/// A photograph is laid on the sensor, blurred by the lens, exposed with noise, developed and finished, as the camera would. A raw frame
/// (DNG, or a file with a sidecar) is developed and finished as if the camera had taken it; it must be of the sensor of the run. Cameras
/// that look for objects draw the boxes of what they find. Writes NAME-CAMERA.png, NAME-scene.png of every photograph, and
/// NAME-side-by-side.html, which shows all of them.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Run folder
    run: PathBuf,
    /// Photographs and raw frames
    #[arg(required = true, value_name = "IMAGE")]
    images: Vec<PathBuf>,
    /// Camera of the run; may be repeated [default: all that are finished]
    #[arg(long, value_name = "NAME")]
    camera: Vec<String>,
    /// PSFs in place of those of each camera's lens: a folder that psf or psf-calibrate wrote, or its psf.json. They form the images of
    /// photographs; development and restoration know them, also those of raw frames
    #[arg(long, value_name = "PATH")]
    psfs: Option<PathBuf>,
    /// How a photograph lands on the sensor
    #[arg(long, value_parser = choice::<Place>(), default_value = word(Request::default().place))]
    place: Place,
    /// Seed of the noise
    #[arg(long, default_value_t = Request::default().seed)]
    seed: u64,
    /// Folder for the pictures
    #[arg(long, value_name = "DIR", default_value = word(Request::default().out))]
    out: PathBuf,
    /// Device for tensors; `petzval doctor` lists them
    #[arg(long, default_value = word(Request::default().device))]
    device: String,
    /// Believe this file or folder of the run though it does not agree with its digest; may be repeated
    #[arg(long, value_name = "NAME")]
    accept_changed: Vec<String>,
    /// Print everything as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let request = Request {
        run: args.run,
        images: args.images,
        cameras: args.camera,
        psfs: args.psfs,
        place: args.place,
        seed: args.seed,
        out: args.out,
        device: args.device,
        accept_changed: args.accept_changed,
    };
    let context = terminal.context().with_cancellation(signals::end_on_signal()?);
    let response = apply::run(&request, &context)?;
    print_response(args.json, &response, || {
        for p in &response.pictures {
            outln!("{}  {} x {}, {:.1} s", shown(&p.picture), p.width, p.height, p.seconds);
        }
        response.pages.iter().chain(&response.others).for_each(|path| outln!("{}", shown(path)));
    })
}
