//! `petzval evaluate`: score the cameras of a run again, with exact optics, and cameras as they are made.

use std::path::PathBuf;

use crate::cli::code::Code;
use crate::jobs::evaluate::{
    self, Compensate, Difference, Grade, LensTolerances, Made, MadeMetrics, Metrics, ScoreDescription,
};

use crate::base::counted;
use crate::jobs::psf::PsfKind;

use super::choice::choice;
use super::defaults::word;
use super::failure::Failure;
use super::number::figure;
use super::plain::shown;
use super::score_table;
use super::signals;
use super::terminal::{Terminal, print_response};

/// Score the cameras of a finished run again: lenses by exact tracing, pictures on the held-out photographs.
///
/// The last line gives the largest difference from the run's own figures. With --photos or --data the cameras are scored on these pictures,
/// as many as `scoring.pictures` or `street.held_out` of the run allows, and every score has its 95 % range. A warning says how many of them
/// the run was trained on. If they are the pictures of the run itself, at another place, only its held-out ones are scored. Nothing in the run folder is changed, except with --tolerances. Then cameras are made at random from each design: their lenses
/// deviate by their tolerances and are focused again. They are scored with the network or ISP of the design. Their figures go into
/// tolerance.json and into the report of the run, in place of those of an earlier call.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Run folder
    run: PathBuf,
    /// Folder of photographs: others than those of the run, or those of the run where they are now
    #[arg(long, value_name = "DIR")]
    photos: Option<PathBuf>,
    /// Labelled pictures, in COCO format (a folder or its file of annotations) or a folder of pictures with label images: others than those of the run, or
    /// those of the run where they are now
    #[arg(long, value_name = "FILE", conflicts_with = "photos")]
    data: Option<PathBuf>,
    /// Believe this file or folder of the run though it does not agree with its digest; may be repeated
    #[arg(long, value_name = "NAME")]
    accept_changed: Vec<String>,
    /// Take PSFs by rays (geometric) or by waves (diffraction), in place of those of the run
    #[arg(long, value_parser = choice::<PsfKind>(), value_name = "KIND", hide_possible_values = true, conflicts_with = "tolerances")]
    psf: Option<PsfKind>,
    /// Take these PSFs in place of those of each camera's lens: a folder that psf or psf-calibrate wrote, or its psf.json. They form the images;
    /// development and restoration know them. Spots and fields of view are those of the lens
    #[arg(long, value_name = "PATH", conflicts_with_all = ["psf", "tolerances"])]
    psfs: Option<PathBuf>,
    /// Make cameras at random: a tolerance file, or a grade: default (precision), commercial, precision or high
    #[arg(long, value_name = "FILE|GRADE")]
    tolerances: Option<PathBuf>,
    /// Cameras of each design
    #[arg(long, value_name = "N", default_value_t = Made::default().trials, requires = "tolerances")]
    trials: usize,
    /// Seed of their errors
    #[arg(long, value_name = "SEED", default_value_t = Made::default().seed, requires = "tolerances")]
    seed: u64,
    /// Most held-out pictures on which each is scored, spread over photographs and places
    #[arg(long, value_name = "N", default_value_t = Made::default().pictures, requires = "tolerances")]
    pictures: usize,
    /// Leave the image plane where the tolerances put it
    #[arg(long, requires = "tolerances")]
    no_refocus: bool,
    /// Calibrate each camera: shading and blur are corrected by its lens as it was made, in place of the lens as drawn
    #[arg(long, requires = "tolerances")]
    calibrate: bool,
    /// What a camera has to reach in the first score [default: what the first camera reaches as drawn]
    #[arg(long, value_name = "SCORE", requires = "tolerances")]
    limit: Option<f64>,
    /// Device for tensors; `petzval doctor` lists them
    #[arg(long, default_value = word(evaluate::Request::default().device))]
    device: String,
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let tolerances = args.tolerances.map(source).transpose()?;
    let made = tolerances.map(|tolerances| Made {
        tolerances,
        trials: args.trials,
        seed: args.seed,
        pictures: args.pictures,
        compensate: if args.no_refocus { Compensate::None } else { Compensate::Focus },
        calibrate: args.calibrate,
        limit: args.limit,
    });
    let request = evaluate::Request {
        run: args.run,
        device: args.device,
        photos: args.photos,
        data: args.data,
        accept_changed: args.accept_changed,
        psf: args.psf,
        psfs: args.psfs,
        made,
    };
    let response = evaluate::run(&request, &terminal.context().with_cancellation(signals::end_on_signal()?))?;
    print_response(args.json, &response, || {
        let evaluate::Response { metrics, other_pictures, trained_on, differences, made, .. } = &response;
        if let Some(place) = other_pictures {
            score_table::print_on(metrics, &metrics.scored_on_others());
            // Without a score there is no range: a warning has said so.
            if metrics.has_scores() {
                print_ranges(metrics);
            }
            print_differences(metrics, differences);
            outln!("{}: {}", of_pictures(*trained_on), shown(place));
        } else {
            score_table::print(metrics);
        }
        if let Some(largest) = response.largest_difference_from_run {
            let of =
                response.largest_difference_of.as_ref().map_or_else(String::new, |of| format!(" ({of})"));
            outln!("largest difference from the run's own figures: {largest:.3e}{of}");
        }
        if let Some(made) = made {
            print_made(made);
        }
    })
}

/// What other pictures are to a run that was trained on some of them.
fn of_pictures(trained_on: usize) -> String {
    match trained_on {
        0 => "other pictures than those of the run".to_owned(),
        some => format!("pictures ({some} of them trained the run)"),
    }
}

/// Prints the 95 % range of every score.
fn print_ranges(metrics: &Metrics) {
    let none = without_range(metrics);
    outln!("\n{:<16} {:<16} {:>24}", "95 % range of", "score", "low to high");
    for row in &metrics.rows {
        for score in metrics.scores.iter().filter(|score| row.scores.contains_key(&score.name)) {
            outln!(
                "{:<16} {:<16} {:>24}",
                row.camera,
                score.heading(),
                range(score, row.intervals.get(&score.name), none)
            );
        }
    }
}

/// Prints differences between cameras on the same pictures.
fn print_differences(metrics: &Metrics, differences: &[Difference]) {
    let none = without_range(metrics);
    for Difference { camera, against, scores, ranges } in differences {
        for score in &metrics.scores {
            let Some(value) = scores.get(&score.name) else { continue };
            let range = range(score, ranges.get(&score.name), none);
            outln!(
                "{camera} less {against}, {}: {value:+.*}, 95 % range {range}",
                score.heading(),
                score.decimals
            );
        }
    }
}

/// Why a figure or a difference has no range.
fn without_range(metrics: &Metrics) -> &'static str {
    if metrics.is_of_objects() { "none: one picture or film" } else { "none: one photograph" }
}

/// A range in the digits of its score, or why there is `none`.
fn range(score: &ScoreDescription, range: Option<&[f64; 2]>, none: &str) -> String {
    let d = score.decimals;
    range.map_or_else(|| none.to_owned(), |[low, high]| format!("{low:.d$} to {high:.d$}"))
}

/// A grade by its name, or a file.
fn source(name: PathBuf) -> Result<LensTolerances, Failure> {
    Ok(match name.to_str() {
        Some("commercial") => LensTolerances::Grade(Grade::Commercial),
        Some("default" | "precision") => LensTolerances::Grade(Grade::Precision),
        Some("high") => LensTolerances::Grade(Grade::High),
        _ if name.extension().is_none() && !name.exists() => {
            let message = format!("--tolerances {}: neither a grade nor a file", shown(&name));
            let hint = "grades are default, commercial, precision and high; `petzval lens tolerance --help` says what a file holds";
            return Err(Failure::input(message, hint));
        }
        _ => LensTolerances::File(name),
    })
}

/// Prints what tolerances leave of the scores.
fn print_made(made: &MadeMetrics) {
    outln!("\nas made          score         as drawn      mean  90 % reach     limit reach it %");
    for row in &made.rows {
        for score in &made.scores {
            let (figures, d) = (&row.scores[&score.name], score.decimals);
            let known = |value: Option<f64>| figure(value, d);
            outln!(
                "{:<16} {:<12} {:>9} {:>9} {:>11} {:>9.d$} {:>10.0}",
                row.camera,
                score.heading(),
                known(figures.drawn),
                known(figures.mean),
                known(figures.of_90_percent),
                made.limits[&score.name],
                100.0 * figures.share
            );
        }
    }
    let calibrated = if made.is_calibrated { "each calibrated" } else { "none calibrated" };
    outln!(
        "{} of each design, {calibrated}, {} each",
        counted(made.trials, "camera"),
        counted(made.pictures, "held-out picture")
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_range_says_why() {
        let score = ScoreDescription {
            name: "miou".to_owned(),
            title: "mIoU".to_owned(),
            unit: String::new(),
            definition: String::new(),
            decimals: 2,
            higher_is_better: true,
        };
        // No picture has a score of its own, as those of objects and of pixels.
        let metrics = Metrics {
            rows: Vec::new(),
            seeds: vec![1],
            held_out_images: 9,
            held_out_places: 1,
            scores: vec![score.clone()],
            without_value: Default::default(),
            version: String::new(),
        };
        let none = without_range(&metrics);
        assert_eq!(range(&score, Some(&[0.101, 0.256]), none), "0.10 to 0.26");
        assert_eq!(range(&score, None, none), "none: one picture or film");
    }
}
