//! `compare`: several runs on one page, with means over seeds.

use std::path::PathBuf;
use std::sync::Arc;

use petzval_base::time_text;
use petzval_design::inputs::{SetupFor, check_parts_or_accepted, setup_of_run};
use petzval_design::report::comparison::{ComparedDifference, Comparison, compare, comparison_csv};
use petzval_design::report::run_report::report_of_run;
use petzval_design::run::{DigestCheck, RunFolder, check_accepted};
use petzval_design::study::MeanAndDeviation;
use petzval_learn::score::ScoreDescription;
use petzval_report::comparison::{Group, SHOWN, TextTable, page};
use petzval_report::{capitalised, signed_with_error, with_error};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::as_unit::{AsUnit, within};
use crate::context::Context;
use crate::error::{JobError, Result};
use crate::event::WarningKind;
use crate::results::{check_file, has_ending, write_result};
use crate::run_page::warn_of_missing_pictures;

petzval_base::parameters! {
    /// Runs to compare.
    pub struct Request {
        /// Folders of finished runs; those that differ in the seed alone are taken together.
        runs: Vec<PathBuf> = Vec::new();
        /// The page.
        out: PathBuf = PathBuf::from("comparison.html");
        /// Comma-separated values of the cameras; not written without a name.
        csv: Option<PathBuf> = None;
        /// Files or folders of the runs, by their path below them, that may differ from their digests.
        accept_changed: Vec<String> = Vec::new();
    }
}

/// The figures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// One for each experiment.
    pub comparisons: Vec<Comparison>,
    /// The page.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub page: PathBuf,
    /// Its tables in Markdown.
    pub markdown: String,
}

/// As a unit of work.
pub(crate) const UNIT: AsUnit<Request> = AsUnit::placed(|request, folder| {
    request.out = within(folder, &request.out, "comparison.html");
    request.csv = request.csv.take().map(|csv| within(folder, &csv, "comparison.csv"));
});

/// Compares finished runs and writes the page.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    if request.runs.is_empty() {
        return Err(JobError::input("there is no run to compare", "name folders of finished runs"));
    }
    check_endings(request)?;
    let warn = |text: &str| context.warning(WarningKind::Comparison, text);
    let folders: Vec<RunFolder> =
        request.runs.iter().map(|run| RunFolder::open(run)).collect::<std::result::Result<_, _>>()?;
    check_accepted(&folders.iter().collect::<Vec<_>>(), &request.accept_changed)?;
    let comparisons = compare(&request.runs, &context.assets, &request.accept_changed, &warn)?;
    check_inputs(request, context, &warn)?;
    check_file(&request.out, context)?;
    request.csv.iter().try_for_each(|path| check_file(path, context))?;
    let mut groups = Vec::new();
    for (i, comparison) in comparisons.iter().enumerate() {
        context.check(|| "stopped before the page was written")?;
        context.progress(i as u64, comparisons.len() as u64, &comparison.title);
        groups.push(group(comparison, context)?);
    }
    let differences = differences(&comparisons);
    write_result(&request.out, page(differences.as_ref(), &groups), context)?;
    context.wrote(&request.out, "page");
    if let Some(path) = &request.csv {
        write_result(path, comparison_csv(&comparisons), context)?;
        context.wrote(path, "table");
    }
    let of_group = |group: &Group| {
        let tables: Vec<String> = group.tables.iter().map(TextTable::markdown).collect();
        let answer = group.answer.as_ref().map_or_else(String::new, |answer| format!("{answer}\n\n"));
        format!("## {}\n\n{answer}{}\n\n{}", group.title, group.subtitle, tables.join("\n"))
    };
    let above = differences.map(|table| table.markdown());
    let markdown = above.into_iter().chain(groups.iter().map(of_group)).collect::<Vec<_>>().join("\n");
    Ok(Response { comparisons, page: request.out.clone(), markdown })
}

/// Refuses runs whose lens, sensor, ISP or networks were edited since: the page shows lenses as the folders hold them, beside scores.
fn check_inputs(request: &Request, context: &Context, warn: &dyn Fn(&str)) -> Result<()> {
    // What is said of an experiment and its lens is said once, where the page is made.
    let silent = context.assets.clone().reporting_warnings(Arc::new(|_: &str| ()));
    for run in &request.runs {
        let folder = RunFolder::open(run)?;
        let (experiment, device) = (silent.experiment_of_run(&folder)?, context.device("cpu")?);
        let setup = setup_of_run(&folder, experiment, &silent, device, SetupFor::Cameras)?;
        let check = DigestCheck::new(&folder, &request.accept_changed, warn);
        check_parts_or_accepted(&setup, &folder, &check)?;
    }
    Ok(())
}

/// Sees that the names of the results say what they hold.
fn check_endings(request: &Request) -> Result<()> {
    let Request { out, csv, .. } = request;
    if !["html", "htm"].iter().any(|ending| has_ending(out, ending)) {
        let page = out.with_extension("html");
        let hint = match out.extension().and_then(|ending| ending.to_str()) {
            Some("csv") => format!(
                "--csv {} writes the figures; --out names the page, such as {}",
                out.display(),
                page.display()
            ),
            Some("json") => "--json prints the figures; --out names the page".to_owned(),
            Some("md") => "the tables are printed in Markdown; --out names the page".to_owned(),
            _ => format!("name it {}", page.display()),
        };
        return Err(JobError::setting(
            "out",
            out.display(),
            "the page is HTML, and its name does not end in .html",
            hint,
        ));
    }
    match csv {
        Some(csv) if !has_ending(csv, "csv") => {
            let hint = format!("name it {}", csv.with_extension("csv").display());
            Err(JobError::setting(
                "csv",
                csv.display(),
                "the figures are CSV, and the name does not end in .csv",
                hint,
            ))
        }
        _ => Ok(()),
    }
}

/// An experiment on the page: the tables of its comparison, and lenses, curves and pictures of its first run.
fn group(comparison: &Comparison, context: &Context) -> Result<Group> {
    let folder = RunFolder::open(&comparison.runs[0])?;
    let experiment = context.assets.experiment_of_run(&folder)?;
    let device = context.device("cpu")?;
    let setup = setup_of_run(&folder, experiment, &context.assets, device, SetupFor::Cameras)?;
    let mut report = report_of_run(&setup, &folder, "")?;
    warn_of_missing_pictures(&report, context);
    report.pictures.truncate(SHOWN);
    let seeds: Vec<String> = comparison.seeds.iter().map(u64::to_string).collect();
    let memory = comparison.memory_gb.map_or_else(String::new, |gb| format!(", at most {gb:.2} GB"));
    let subtitle = format!(
        "{} {}; {} steps of network or ISP; {} in all{memory}.",
        if seeds.len() == 1 { "Seed" } else { "Seeds" },
        seeds.join(", "),
        comparison.steps,
        time_text(3600.0 * comparison.hours)
    );
    let (title, answer) = (comparison.title.clone(), answer(comparison));
    Ok(Group { title, answer, subtitle, tables: tables(comparison), report })
}

/// `End-to-end against nominal: +0.86 ± 0.06 dB PSNR, ...; against spot-optimised: ...`; none without another camera.
fn answer(comparison: &Comparison) -> Option<String> {
    let Comparison { scores, differences, seeds, .. } = comparison;
    let first = differences.first()?;
    let against = |difference: &ComparedDifference| {
        let figures = difference.scores.iter().zip(scores).map(|(value, score)| {
            let unit = if score.unit.is_empty() { String::new() } else { format!(" {}", score.unit) };
            format!(
                "{}{unit} {}",
                signed_with_error(value.mean, value.deviation, score.decimals),
                score.title
            )
        });
        format!("against {}: {}", difference.against, figures.take(FIGURES).collect::<Vec<_>>().join(", "))
    };
    let all: Vec<String> = differences.iter().take(CAMERAS).map(against).collect();
    let over = if seeds.len() == 1 { "one seed".to_owned() } else { format!("{} seeds", seeds.len()) };
    Some(format!("{} over {over}, {}.", capitalised(&first.camera), all.join("; ")))
}

/// Most scores that the first sentence of an experiment names, and most cameras.
const FIGURES: usize = 2;
const CAMERAS: usize = 2;

/// What differs between experiments: a column for each key, and a row for each experiment with the scores of its last camera that is no
/// ceiling. None for a single experiment.
fn differences(comparisons: &[Comparison]) -> Option<TextTable> {
    let first = comparisons.first().filter(|_| comparisons.len() > 1)?;
    let mut scores: Vec<&ScoreDescription> = Vec::new();
    for score in comparisons.iter().flat_map(|comparison| &comparison.scores) {
        if !scores.iter().any(|known| known.name == score.name) {
            scores.push(score);
        }
    }
    let heads = first.differs.iter().map(|(key, _)| key.clone());
    let scored = scores.iter().map(|score| score.heading());
    let head = ["experiment", "seeds"].map(str::to_owned).into_iter().chain(heads);
    let row = |comparison: &Comparison| {
        let seeds: Vec<String> = comparison.seeds.iter().map(u64::to_string).collect();
        let camera = comparison.cameras.iter().rfind(|camera| !camera.is_ceiling);
        let score = |score: &&ScoreDescription| {
            let place = comparison.scores.iter().position(|own| own.name == score.name);
            let value = place.and_then(|place| camera?.scores.get(place));
            value.map_or_else(|| "-".to_owned(), |v| with_error(v.mean, 0.0, score.decimals))
        };
        let values = comparison.differs.iter().map(|(_, value)| value.clone());
        let name = camera.map_or("-", |camera| &camera.name).to_owned();
        [comparison.title.clone(), seeds.join(" ")]
            .into_iter()
            .chain(values)
            .chain([name])
            .chain(scores.iter().map(score))
            .collect()
    };
    Some(TextTable {
        caption: "What differs between the runs, and the scores of the last camera that is no ceiling. Inputs are named by the first digits of \
                  their SHA-256."
            .to_owned(),
        head: head.chain(["camera".to_owned()]).chain(scored).collect(),
        rows: comparisons.iter().map(row).collect(),
    })
}

/// The tables of a comparison.
fn tables(comparison: &Comparison) -> Vec<TextTable> {
    let Comparison { scores, seeds, cameras, differences, paper, .. } = comparison;
    let is_several = seeds.len() > 1;
    let headings: Vec<String> = scores.iter().map(ScoreDescription::heading).collect();
    let head = |first: &str, further: &[String]| {
        [vec![first.to_owned()], headings.clone(), further.to_vec()].concat()
    };
    let cell = |value: &MeanAndDeviation, decimals: usize, is_difference: bool| {
        // A single seed has no deviation, and figures without one have all their decimals.
        let deviation = if is_several { value.deviation } else { 0.0 };
        let text = if is_difference { signed_with_error } else { with_error };
        text(value.mean, deviation, decimals)
    };
    let all = |values: &[MeanAndDeviation], is_difference: bool| -> Vec<String> {
        values.iter().zip(scores).map(|(v, s)| cell(v, s.decimals, is_difference)).collect()
    };

    let closed = |score: &ScoreDescription| format!("closed, {} %", score.title);
    let has_ceiling = cameras.iter().any(|camera| camera.is_ceiling);
    let shares: Vec<String> = scores.iter().filter(|_| has_ceiling).map(closed).collect();
    let lens = ["RMS spot um", "EFL mm", "f/#"].map(str::to_owned).to_vec();
    let rows = cameras.iter().map(|camera| {
        let percent = |share: &Option<MeanAndDeviation>| {
            let in_percent = |v: &MeanAndDeviation| MeanAndDeviation {
                mean: 100.0 * v.mean,
                deviation: 100.0 * v.deviation,
            };
            share.as_ref().map_or_else(|| "-".to_owned(), |v| cell(&in_percent(v), 0, false))
        };
        let shares = camera.gap_closed.iter().filter(|_| has_ceiling).map(percent);
        let lens = [
            cell(&camera.rms_spot_um, 2, false),
            cell(&camera.efl_mm, 2, false),
            cell(&camera.f_number, 2, false),
        ];
        let cells = all(&camera.scores, false).into_iter().chain(shares).chain(lens);
        [camera.name.clone()].into_iter().chain(cells).collect()
    });
    let mut tables = vec![TextTable {
        caption: if has_ceiling {
            let baseline = cameras.iter().find(|camera| !camera.is_ceiling).map_or("", |camera| &camera.name);
            format!(
                "Scores, and the share of the gap from {baseline} to a lens without aberrations that is closed."
            )
        } else {
            "Scores.".to_owned()
        },
        head: head("camera", &[shares, lens].concat()),
        rows: rows.collect(),
    }];
    if let Some(difference) = differences.first() {
        tables.push(TextTable {
            caption: format!("Scores of {} less those of the other camera, seed by seed.", difference.camera),
            head: head("against", &[]),
            rows: differences
                .iter()
                .map(|d| [vec![d.against.clone()], all(&d.scores, true)].concat())
                .collect(),
        });
    }
    if let Some(paper) = paper {
        let value = |score: &ScoreDescription, of: &petzval_design::report::comparison::PaperRow| {
            of.scores.get(&score.name).map_or_else(|| "-".to_owned(), |v| v.to_string())
        };
        tables.push(TextTable {
            caption: format!(
                "What the paper prints ({}), on pictures, networks and an ISP of its own: the order can be compared, the levels cannot.",
                paper.source
            ),
            head: head("camera", &[]),
            rows: (paper.row.iter())
                .map(|row| [row.camera.clone()].into_iter().chain(scores.iter().map(|s| value(s, row))).collect())
                .collect(),
        });
    }
    tables
}
