//! `petzval detect`: what a detector finds in pictures.

use std::path::PathBuf;
use std::time::Duration;

use crate::base::csv_text;
use crate::cli::code::Code;
use crate::jobs::detect::{self, BackboneKind, Pycocotools, Request, Scores, Seen, Source, Weights};
use clap::ValueEnum;

use super::defaults::word;
use super::failure::Failure;
use super::plain::shown;
use super::signals;
use super::terminal::{Terminal, print_json};

/// Find objects in pictures: by the detector of a finished camera, or by weights of torchvision.
///
/// Pictures are PNG, JPEG, TIFF, WebP or BMP files, or folders of them; a raw frame (a DNG file, also in a folder, or a file with a sidecar) is developed by
/// the camera of --run first. The detector of a camera looks at them in their own size, weights of torchvision
/// in the size for which torchvision trains. Prints one line per detection: file, class, score, left edge, upper edge, width, height, in pixels
/// of the file.
///
/// With --data it looks at the pictures of a data set in COCO format, compares what it finds with the objects there, and prints average
/// precision and recall in place of the lines.
#[derive(Debug, clap::Args)]
#[command(group = clap::ArgGroup::new("detector").required(true).args(["run", "weights"]))]
#[command(group = clap::ArgGroup::new("pictures").required(true).args(["images", "data"]))]
pub struct Args {
    /// Pictures, folders of pictures, or raw frames
    #[arg(value_name = "IMAGE")]
    images: Vec<PathBuf>,
    /// Data set in COCO format whose pictures are looked at: its folder, or its file of annotations
    #[arg(long, value_name = "DATA")]
    data: Option<PathBuf>,
    /// Look at this part of the data set alone, such as `valid`
    #[arg(long, value_name = "NAME", requires = "data")]
    part: Option<String>,
    /// Run whose detector looks; see --camera
    #[arg(long, value_name = "RUN")]
    run: Option<PathBuf>,
    /// Camera of the run [default: the last that is finished]
    #[arg(long, value_name = "NAME", requires = "run")]
    camera: Option<String>,
    /// Weights of a Faster R-CNN of torchvision, as a safetensors file
    #[arg(long, value_name = "FILE")]
    weights: Option<PathBuf>,
    /// Backbone of the weights
    #[arg(long, value_enum, default_value = word(Weights::default().backbone), requires = "weights", conflicts_with = "run")]
    backbone: Backbone,
    /// Classes of the weights, without the background
    #[arg(long, default_value_t = Weights::default().classes, value_name = "N", requires = "weights", conflicts_with = "run")]
    classes: usize,
    /// Pixels to which the shorter side of a picture is scaled for the weights
    #[arg(long, default_value_t = Weights::default().shorter_side, value_name = "PIXELS", requires = "weights", conflicts_with = "run")]
    shorter_side: usize,
    /// Most pixels that its longer side may have after that
    #[arg(long, default_value_t = Weights::default().longer_side, value_name = "PIXELS", requires = "weights", conflicts_with = "run")]
    longer_side: usize,
    /// Least score of a detection that is printed and drawn; with --data, detections.json, average precision and recall are of all that the detector
    /// keeps
    #[arg(long, default_value_t = Request::default().least_score, value_name = "SCORE")]
    least_score: f32,
    /// Folder for detections.json (COCO results, for annotations.json beside it, and for --data where every class takes one category of it),
    /// annotations.json (pictures, classes, and objects of --data) and pictures with boxes
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Believe this file or folder of the run though it does not agree with its digest; may be repeated
    #[arg(long, value_name = "NAME", requires = "run")]
    accept_changed: Vec<String>,
    /// Print everything as JSON
    #[arg(long)]
    json: bool,
    /// Device for tensors; `petzval doctor` lists them
    #[arg(long, default_value = word(Request::default().device))]
    device: String,
}

/// Backbones whose weights can be read.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Backbone {
    Resnet18,
    Resnet50,
    #[value(name = "mobilenet-v2")]
    MobilenetV2,
}

impl From<Backbone> for BackboneKind {
    fn from(backbone: Backbone) -> Self {
        match backbone {
            Backbone::Resnet18 => Self::Resnet18,
            Backbone::Resnet50 => Self::Resnet50,
            Backbone::MobilenetV2 => Self::MobilenetV2,
        }
    }
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let detector = match (args.run, args.weights) {
        (Some(run), _) => Source::Run { run, camera: args.camera },
        (None, Some(file)) => Source::Weights(Weights {
            file,
            backbone: args.backbone.into(),
            classes: args.classes,
            shorter_side: args.shorter_side,
            longer_side: args.longer_side,
        }),
        (None, None) => return Err(Failure::input("no detector", "name a run, or a file of weights")),
    };
    let request = Request {
        images: args.images,
        data: args.data,
        part: args.part,
        detector,
        least_score: args.least_score,
        out: args.out,
        device: args.device,
        accept_changed: args.accept_changed,
    };
    let response =
        detect::run(&request, &terminal.context().with_cancellation(signals::end_within(ONE_PICTURE)?))?;
    if args.json {
        print_json(&response)?;
    } else if let Some(scores) = &response.scores {
        print_scores(scores);
    } else if !response.pictures.is_empty() {
        print_found(&response.pictures);
    }
    match &response.unread[..] {
        [] => Ok(Code::SUCCESS),
        [first, ..] => {
            let (unread, all) = (response.unread.len(), response.unread.len() + response.pictures.len());
            let message = format!("{unread} of {all} pictures cannot be read, the first is {}", shown(first));
            Err(Failure::input(message, "the warnings above say why; all others were looked at"))
        }
    }
}

/// Prints a line for each detection.
fn print_found(pictures: &[Seen]) {
    let head = ["file", "class", "score", "x", "y", "width", "height"].map(str::to_owned);
    let lines = pictures.iter().flat_map(|seen| {
        seen.found.iter().map(|found| {
            let [x, y, width, height] = found.bbox.map(|value| format!("{value:.1}"));
            let score = format!("{:.3}", found.score);
            [shown(&seen.file), found.class.clone(), score, x, y, width, height]
        })
    });
    out!("{}", csv_text([head].into_iter().chain(lines)));
}

/// How long the picture in work may take after a signal, until the results of those before it are written.
const ONE_PICTURE: Duration = Duration::from_secs(60);

/// Prints the numbers of COCO and those of each class.
fn print_scores(scores: &Scores) {
    let number = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.3}"));
    let range = |range: Option<[f64; 2]>| {
        range.map_or(String::new(), |[low, high]| format!(", 95 % range {low:.3} to {high:.3}"))
    };
    let coco = &scores.coco;
    outln!("AP    {}{}", number(coco.ap), range(scores.ap_range));
    outln!("AP50  {}{}", number(coco.ap50), range(scores.ap50_range));
    outln!("AP75  {}", number(coco.ap75));
    if let Some(Pycocotools { overhanging, ignored, coco }) = &scores.pycocotools {
        let [ap, half, tight] = [coco.ap, coco.ap50, coco.ap75].map(number);
        outln!("AP of pycocotools  {ap}, AP50 {half}, AP75 {tight}");
        let reasons = [
            (
                *overhanging,
                "boxes that reach out of their picture",
                "takes them whole, all other figures the part inside",
            ),
            (
                *ignored,
                "objects with `ignore` or thinner than a pixel",
                "judges them, all other figures do not",
            ),
        ];
        for (count, what, difference) in reasons.iter().filter(|(count, ..)| *count > 0) {
            outln!("                   {what}: {count}; pycocotools {difference}");
        }
    }
    let sizes = |of: [Option<f64>; 3]| {
        let [small, medium, large] = of.map(number);
        format!("small {small}, medium {medium}, large {large}")
    };
    outln!("AP by size      {}", sizes([coco.ap_small, coco.ap_medium, coco.ap_large]));
    let [one, ten, hundred] = [coco.ar1, coco.ar10, coco.ar100].map(number);
    outln!(
        "recall          {hundred} with the 100 best detections of a class in a picture, {ten} with 10, {one} with 1"
    );
    outln!("recall by size  {}", sizes([coco.ar_small, coco.ar_medium, coco.ar_large]));
    let of_found = [("state", scores.state_accuracy, "lights"), ("class", scores.class_accuracy, "objects")];
    for (what, accuracy, objects) in of_found {
        if let Some(accuracy) = accuracy {
            outln!(
                "{what}           {accuracy:.3} of the {objects} that are found with a score of 0.5 or more have the right one"
            );
        }
    }
    if scores.classes.len() > 1 && scores.state_accuracy.or(scores.class_accuracy).is_none() {
        outln!("class           - (no object is found with a score of 0.5 or more)");
    }
    outln!("\n{:<20} {:>8} {:>7} {:>11}", "class", "objects", "AP", "AP50 (VOC)");
    for class in &scores.classes {
        let [ap, voc] = [class.ap, class.ap50_voc].map(number);
        outln!("{:<20} {:>8} {ap:>7} {voc:>11}", class.class, class.objects);
    }
    outln!("over {} pictures", scores.pictures);
}
