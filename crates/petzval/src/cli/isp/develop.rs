//! `petzval isp develop`: raw frames to pictures.

use std::path::PathBuf;

use crate::jobs::isp::Merge;
use crate::jobs::isp::develop::{self, Chroma, Container, Range, Standard, YcbcrFile};
use clap::ValueEnum;

use super::inputs::{FrameArgs, IspArgs};
use crate::cli::choice::choice;
use crate::cli::code::Code;
use crate::cli::defaults::word;
use crate::cli::failure::Failure;
use crate::cli::plain::shown;
use crate::cli::signals;
use crate::cli::terminal::{Terminal, print_response};

/// Develop raw frames to pictures, NAME.* to NAME.png.
///
/// A frame is a raw file with its sidecar, as `petzval simulate` and `petzval raw convert` write them. The sidecar gives bits, mosaic and
/// levels. The sensor, named by the sidecar or by --sensor, gives noise and the response to white light. The calibration that the sidecar
/// names gives shading and distortion of the lens and the colour matrix. The picture is turned by the orientation that the file or the
/// sidecar states.
///
/// With --merge the frames are exposures of one scene. They are merged into one linear frame of up to 24 bits, which becomes one picture.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Raw frames
    #[arg(value_name = "RAW", required = true)]
    raws: Vec<PathBuf>,
    #[command(flatten)]
    isp: IspArgs,
    /// Change a parameter; may be repeated
    #[arg(long, value_name = "STAGE.KEY=VALUE")]
    set: Vec<String>,
    #[command(flatten)]
    frame: FrameArgs,
    /// Merge the frames, which show one scene at different exposures, into one before development
    #[arg(long)]
    merge: bool,
    /// Relative exposures of the frames to merge, time by gain [default: those of the sidecars]
    #[arg(long, value_name = "E,E,...", value_delimiter = ',', requires = "merge")]
    exposures: Option<Vec<f64>>,
    /// Merge without looking for motion
    #[arg(long, requires = "merge")]
    no_motion_check: bool,
    /// Bits of the pictures: 8, 10 or 16, of y4m and yuv 8 or 10
    ///
    /// PNG has no samples of 10 bits: they are scaled to 16, and the chunk sBIT says that 10 count. The code is the sample shifted right
    /// by 6 bits.
    #[arg(long, default_value_t = develop::Request::default().bits)]
    bits: u32,
    #[command(flatten)]
    file: FileArgs,
    /// Write NAME-strip.html: the picture after every stage, with the parameters of the stage
    #[arg(long)]
    strip: bool,
    /// Folder for the pictures; or the file of the only one, such as picture.png
    #[arg(long, value_name = "PATH")]
    out: PathBuf,
    /// Print what was written as JSON
    #[arg(long)]
    json: bool,
}

/// The file of a picture.
#[derive(Debug, clap::Args)]
struct FileArgs {
    /// Format of the pictures
    #[arg(long, value_enum, default_value_t = Format::of(develop::Request::default().ycbcr))]
    format: Format,
    /// Standard of luma in y4m and yuv
    #[arg(long, value_parser = choice::<Standard>(), default_value = word(ycbcr().standard))]
    luma: Standard,
    /// Codes between black and white in y4m and yuv: 16 to 235, or all
    #[arg(long, value_parser = choice::<Range>(), default_value = word(ycbcr().range))]
    range: Range,
    /// Colour differences in y4m and yuv: 4:2:0, 4:2:2 or 4:4:4
    #[arg(long, value_parser = choice::<Chroma>(), default_value = word(ycbcr().chroma))]
    chroma: Chroma,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Format {
    /// sRGB
    Png,
    /// Luma and colour differences in a Y4M file
    Y4m,
    /// Their planes one after the other
    Yuv,
}

/// Luma and colour differences as a request has them.
fn ycbcr() -> YcbcrFile {
    Default::default()
}

impl Format {
    /// The format of luma and colour differences, or else that of pictures.
    fn of(ycbcr: Option<YcbcrFile>) -> Self {
        match ycbcr.map(|file| file.container) {
            None => Self::Png,
            Some(Container::Y4m) => Self::Y4m,
            Some(Container::Yuv) => Self::Yuv,
        }
    }
}

impl FileArgs {
    /// As jobs take it; none is a PNG.
    fn ycbcr(&self) -> Option<YcbcrFile> {
        let container = match self.format {
            Format::Png => return None,
            Format::Y4m => Container::Y4m,
            Format::Yuv => Container::Yuv,
        };
        Some(YcbcrFile { container, standard: self.luma, range: self.range, chroma: self.chroma })
    }
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let request = develop::Request {
        raws: args.raws,
        isp: args.isp.name(),
        set: args.set,
        frame: args.frame.options(),
        merge: args
            .merge
            .then_some(Merge { exposures: args.exposures, no_motion_check: args.no_motion_check }),
        bits: args.bits,
        ycbcr: args.file.ycbcr(),
        strip: args.strip,
        out: args.out,
    };
    let context = terminal.context().with_cancellation(signals::end_on_signal()?);
    let response = develop::run(&request, &context)?;
    drop(context);
    print_response(args.json, &response.pictures, || {
        for developed in &response.pictures {
            outln!("{}", shown(&developed.picture));
            if let Some(strip) = &developed.strip {
                outln!("{}", shown(strip));
            }
        }
    })
}
